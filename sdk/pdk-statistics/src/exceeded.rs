//! From which level on a quantity exceeds a tolerance.

use serde::{Deserialize, Serialize};

use crate::estimate::Estimate;

/// A level with its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Exceeded {
    /// From this level on the quantity exceeds the tolerance. It is the lowest level if it does so there already, and none if it does
    /// not at the highest.
    pub level: Option<f64>,
    /// The lowest level that is possible: there the upper ends of the intervals exceed the tolerance.
    pub low: Option<f64>,
    /// The highest level that is possible: there the lower ends exceed it.
    pub high: Option<f64>,
}

/// The level from which on a quantity exceeds a tolerance: at it and at all higher levels. Between two levels the quantity counts as a
/// straight line. `measured` has the levels with what was measured at each, in any order.
pub fn from_level(measured: &[(f64, Estimate)], tolerance: f64) -> Exceeded {
    let mut measured = measured.to_vec();
    measured.sort_by(|a, b| a.0.total_cmp(&b.0));
    let crossing = |of: fn(&Estimate) -> f64| {
        let points: Vec<(f64, f64)> = measured.iter().map(|(level, found)| (*level, of(found))).collect();
        crossing(&points, tolerance)
    };
    Exceeded {
        level: crossing(|found| found.value),
        low: crossing(|found| found.high),
        high: crossing(|found| found.low),
    }
}

fn crossing(points: &[(f64, f64)], tolerance: f64) -> Option<f64> {
    let below = points.iter().rposition(|(_, value)| *value <= tolerance);
    let Some(below) = below else { return points.first().map(|(level, _)| *level) };
    let (level, value) = points[below];
    let (next, above) = *points.get(below + 1)?;
    // An end of an interval may be infinite: it says that the level before it is possible already, or that this one is not yet.
    if !value.is_finite() {
        return Some(next);
    }
    if !above.is_finite() {
        return Some(level);
    }
    Some(level + (next - level) * (tolerance - value) / (above - value))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(values: &[(f64, f64)], half: f64) -> Vec<(f64, Estimate)> {
        let estimate = |value: f64| Estimate { value, low: value - half, high: value + half };
        values.iter().map(|(level, value)| (*level, estimate(*value))).collect()
    }

    #[test]
    fn the_level_lies_where_the_line_crosses_the_tolerance() {
        let found = from_level(&measured(&[(4.0, 0.5), (0.0, 0.0), (1.0, 0.1), (2.0, 0.3)], 0.05), 0.2);
        assert!((found.level.unwrap() - 1.5).abs() < 1e-12);
        assert!((found.low.unwrap() - 1.25).abs() < 1e-12 && (found.high.unwrap() - 1.75).abs() < 1e-12);
    }

    #[test]
    fn a_quantity_that_falls_below_it_again_has_not_exceeded_it_yet() {
        let found = from_level(&measured(&[(0.0, 0.0), (1.0, 0.3), (2.0, 0.1), (3.0, 0.3)], 0.0), 0.2);
        assert!((found.level.unwrap() - 2.5).abs() < 1e-12);
    }

    #[test]
    fn the_ends_are_the_lowest_level_and_none() {
        let high = from_level(&measured(&[(1.0, 0.3), (2.0, 0.4)], 0.0), 0.2);
        assert_eq!((high.level, high.low, high.high), (Some(1.0), Some(1.0), Some(1.0)));
        let low = from_level(&measured(&[(1.0, 0.1), (2.0, 0.1)], 0.15), 0.2);
        assert_eq!((low.level, low.low, low.high), (None, Some(1.0), None));
        assert_eq!(from_level(&[], 0.2), Exceeded { level: None, low: None, high: None });
    }
}
