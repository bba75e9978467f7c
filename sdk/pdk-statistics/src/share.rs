//! The share of drives that failed.

use crate::estimate::{Estimate, normal_limit};

/// The share of `count` among `of` independent drives, such as one on each road; none if there are no drives.
///
/// Wilson's score interval: E. B. Wilson, "Probable inference" (1927). It holds for few drives and for shares of 0 and 1: 0 of 10
/// is at most 28 %.
pub fn share(count: u64, of: u64, confidence: f64) -> Option<Estimate> {
    (of > 0).then(|| wilson(count as f64 / of as f64, of, confidence))
}

/// The mean of values from 0 to 1 of this many independent units, such as a share for each. None without values.
///
/// Wilson's interval, as if each unit were all or nothing. Values in between vary less, so it is too wide rather than too narrow, and holds
/// for few units of which most have the same value.
pub fn mean_of_shares(values: &[f64], confidence: f64) -> Option<Estimate> {
    let units = values.len() as u64;
    let value = values.iter().sum::<f64>() / units as f64;
    (units > 0).then(|| wilson(value.clamp(0.0, 1.0), units, confidence))
}

fn wilson(value: f64, of: u64, confidence: f64) -> Estimate {
    let n = of as f64;
    let z = normal_limit(confidence);
    let (z2, scale) = (z * z, 1.0 + z * z / n);
    let middle = (value + z2 / (2.0 * n)) / scale;
    let half = z / scale * (value * (1.0 - value) / n + z2 / (4.0 * n * n)).sqrt();
    // A share that was seen lies within its interval, rounding or not.
    Estimate { value, low: (middle - half).clamp(0.0, value), high: (middle + half).clamp(value, 1.0) }
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
        let halves = mean_of_shares(&[0.5, 0.5, 0.0, 0.0], 0.95).unwrap();
        assert_eq!(halves, share(1, 4, 0.95).unwrap());
        assert!(mean_of_shares(&[], 0.95).is_none());
    }
}
