//! How far a vehicle has driven.

/// The way driven, from one frame to the next.
#[derive(Debug, Clone, Copy, Default)]
pub struct Way {
    metres: f64,
    /// Time and speed of the last frame.
    last: Option<(f64, f64)>,
}

impl Way {
    /// The way driven by the frame at this time and speed: between two frames the vehicle drives at the mean of their speeds. Who
    /// drives backwards comes back, and time that runs back counts as none.
    pub fn reach(&mut self, time: f64, speed: f64) -> f64 {
        if let Some((before, slower)) = self.last.replace((time, speed)) {
            self.metres += 0.5 * (slower + speed) * (time - before).max(0.0);
        }
        self.metres
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_is_what_the_speeds_add_up_to() {
        let mut way = Way::default();
        // From 4 to 10 m/s in two seconds, beginning late.
        let driven: Vec<f64> =
            (0..=20).map(|i| way.reach(3.0 + f64::from(i) / 10.0, 4.0 + 0.3 * f64::from(i))).collect();
        assert_eq!(driven[0], 0.0);
        assert!((driven[20] - 14.0).abs() < 1e-9, "{}", driven[20]);
        assert_eq!(way.reach(1.0, 10.0), driven[20]);
        assert!(way.reach(2.0, -30.0) < driven[20]);
    }
}
