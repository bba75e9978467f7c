//! The share of a lap that a car has driven.

/// How much of a lap on a closed track has been driven, from the numbers of the nodes that the car passes.
#[derive(Debug, Default)]
pub struct Lap {
    first: Option<f64>,
    farthest: f64,
}

impl Lap {
    /// The car is at this node of this many; the share of the lap, 1 once it is complete.
    pub fn go_on(&mut self, node: f64, nodes: f64) -> f64 {
        if nodes.is_nan() || nodes < 2.0 {
            return 0.0;
        }
        let first = *self.first.get_or_insert(node);
        let share = (node - first).rem_euclid(nodes) / nodes;
        // A car that stands just before its first node has not driven a lap.
        if self.farthest > 0.9 && share < 0.1 {
            self.farthest = 1.0;
        } else if share - self.farthest < 0.5 {
            self.farthest = self.farthest.max(share);
        }
        self.farthest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lap_is_complete_when_its_first_node_comes_again() {
        let mut lap = Lap::default();
        assert_eq!(lap.go_on(5.0, 100.0), 0.0);
        // Backwards is not a lap.
        assert_eq!(lap.go_on(3.0, 100.0), 0.0);
        assert_eq!(lap.go_on(5.0, 100.0), 0.0);
        let mut share = 0.0;
        for node in 5..100 {
            let now = lap.go_on(f64::from(node), 100.0);
            assert!(now >= share && now < 1.0, "{node} {now}");
            share = now;
        }
        for node in 0..5 {
            assert!(lap.go_on(f64::from(node), 100.0) < 1.0);
        }
        assert_eq!(lap.go_on(5.0, 100.0), 1.0);
        assert_eq!(lap.go_on(9.0, 100.0), 1.0);
    }
}
