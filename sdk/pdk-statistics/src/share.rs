//! The share of drives that failed.

use crate::estimate::{Estimate, normal_limit};

/// The share of `count` among `of` independent drives, such as one on each road; none if there are no drives.
///
/// Wilson's score interval: E. B. Wilson, "Probable inference" (1927). It holds for few drives and for shares of 0 and 1: 0 of 10
/// is at most 28 %.
pub fn share(count: u64, of: u64, confidence: f64) -> Option<Estimate> {
    if of == 0 {
        return None;
    }
    let (n, value) = (of as f64, count as f64 / of as f64);
    let z = normal_limit(confidence);
    let (z2, scale) = (z * z, 1.0 + z * z / n);
    let middle = (value + z2 / (2.0 * n)) / scale;
    let half = z / scale * (value * (1.0 - value) / n + z2 / (4.0 * n * n)).sqrt();
    // A share that was seen lies within its interval, rounding or not.
    Some(Estimate { value, low: (middle - half).clamp(0.0, value), high: (middle + half).clamp(value, 1.0) })
}

/// The share of all roads that may have what none of `roads` had.
pub(crate) fn largest_unseen(roads: u64, confidence: f64) -> f64 {
    share(0, roads, confidence).map_or(1.0, |none| none.high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_wilsons() {
        // R. G. Newcombe, "Two-sided confidence intervals for the single proportion" (1998), table I.
        for (count, of, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let found = share(count, of, 0.95).unwrap();
            assert!((found.low - low).abs() < 6e-5 && (found.high - high).abs() < 6e-5, "{found:?}");
        }
        let none = share(0, 10, 0.95).unwrap();
        assert_eq!((none.value, none.low), (0.0, 0.0));
        assert!((none.high - 0.2775).abs() < 1e-4);
        assert_eq!(share(10, 10, 0.95).unwrap().high, 1.0);
        assert!(share(0, 0, 0.95).is_none());
    }
}
