//! A mean over roads.

use crate::bootstrap;
use crate::estimate::Estimate;

/// The mean of a quantity, of which there is one value a road; `range` is what it can be, infinite where it has no end. None where
/// there are no roads.
///
/// A single road says nothing about others: of a quantity without ends, the interval is the value then.
pub fn over_roads(values: &[f64], range: (f64, f64), confidence: f64) -> Option<Estimate> {
    (!values.is_empty()).then(|| bootstrap::mean(values, range, confidence))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_lies_in_its_interval_and_in_its_range() {
        let metres = (0.0, f64::INFINITY);
        let found = over_roads(&[0.1, 0.3, 0.2, 0.9, 0.1, 0.2], metres, 0.95).unwrap();
        assert!((found.value - 0.3).abs() < 1e-15 && found.low < 0.3 && found.high > 0.3);
        assert!(found.low >= 0.1 && found.high <= 0.9);
        // Two roads say next to nothing: 12.7 standard errors.
        let two = over_roads(&[1.1, 1.2], metres, 0.95).unwrap();
        assert!(
            (two.low - (1.15 - 12.7062 * 0.05)).abs() < 1e-4 && (two.high - 1.7853).abs() < 1e-4,
            "{two:?}"
        );
        assert_eq!(over_roads(&[0.1, 0.2], metres, 0.95).unwrap().low, 0.0);
        let alike = over_roads(&[0.4; 10], metres, 0.95).unwrap();
        assert!(alike.value == alike.high && (alike.low - 0.4 * (1.0 - 0.2775)).abs() < 1e-4, "{alike:?}");
        assert!(over_roads(&[], metres, 0.95).is_none());
    }
}
