//! What a perturbation costs over its published levels, and the published level at which it costs so much.

/// Costs measured at published levels.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// `[published level, cost]` by level, up to the highest cost.
    points: Vec<[f64; 2]>,
}

/// From this published level on, a perturbation is taken to grow up to its highest cost. Some have a first level that is stronger than the
/// next.
const GROWS_FROM: f64 = 1.0;

impl Curve {
    /// What was measured, `[published level, cost]` by level. What lies beyond the highest cost is not used.
    pub fn new(measured: &[[f64; 2]]) -> Self {
        let growing = measured.iter().enumerate().filter(|(_, point)| point[0] >= GROWS_FROM);
        // The first of equal ones: beyond it, parameters are at the end of their range.
        let highest = growing.fold(None, |highest: Option<(usize, f64)>, (place, point)| match highest {
            Some((_, cost)) if cost >= point[1] => highest,
            _ => Some((place, point[1])),
        });
        Self { points: measured[..highest.map_or(measured.len(), |(place, _)| place + 1)].to_vec() }
    }

    /// The lowest and the highest cost; none if nothing was measured.
    pub fn range(&self) -> Option<(f64, f64)> {
        let lowest = self.points.iter().map(|point| point[1]).fold(f64::INFINITY, f64::min);
        Some((lowest, self.points.last()?[1]))
    }

    /// The two published levels, with their costs, between which the perturbation comes to cost so much, and after which it always costs more: the cost
    /// may fall on the way. None if no level costs so much, or so little.
    pub fn around(&self, cost: f64) -> Option<[[f64; 2]; 2]> {
        let (_, highest) = self.range()?;
        let last = self.points.iter().rposition(|point| point[1] <= cost)?;
        let low = self.points[last];
        match self.points.get(last + 1) {
            Some(&high) => Some([low, high]),
            None => (cost == highest).then_some([low, low]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cost_lies_between_what_was_measured() {
        let curve = Curve::new(&[[-1.0, 0.0], [0.0, 2.0], [1.0, 6.0], [2.0, 6.5]]);
        assert_eq!(curve.range(), Some((0.0, 6.5)));
        assert_eq!(curve.around(1.0), Some([[-1.0, 0.0], [0.0, 2.0]]));
        assert_eq!(curve.around(2.0), Some([[0.0, 2.0], [1.0, 6.0]]));
        assert_eq!(curve.around(6.5), Some([[2.0, 6.5], [2.0, 6.5]]));
        assert_eq!([-0.1, 6.6].map(|cost| curve.around(cost)), [None, None]);
        assert_eq!(Curve::new(&[]).around(1.0), None);
    }

    #[test]
    fn what_falls_back_is_left_out() {
        // The first level is strong, the second weak; at the end the parameters are at the end of their range.
        let measured = [[0.0, 9.0], [1.0, 2.0], [2.0, 4.0], [3.0, 8.0], [4.0, 10.0], [5.0, 10.0], [6.0, 7.0]];
        let curve = Curve::new(&measured);
        assert_eq!(curve.range(), Some((2.0, 10.0)));
        assert_eq!(curve.around(9.0), Some([[3.0, 8.0], [4.0, 10.0]]));
        let dip = Curve::new(&[[0.0, 1.0], [1.0, 5.0], [2.0, 3.0], [3.0, 7.0]]);
        assert_eq!(dip.around(2.0), Some([[0.0, 1.0], [1.0, 5.0]]));
        assert_eq!(dip.around(4.0), Some([[2.0, 3.0], [3.0, 7.0]]));
        assert_eq!(dip.range(), Some((1.0, 7.0)));
    }
}
