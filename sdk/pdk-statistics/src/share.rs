//! The share of drives that failed.

use crate::estimate::{Estimate, normal_limit};
use crate::mean;

/// The share of `count` among `of` independent drives, such as one on each road; none where there are no drives.
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

/// How often a condition failed on one road.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Drives {
    /// Drives that failed.
    pub failed: u64,
    /// Drives that say something about the driver.
    pub of: u64,
}

impl Drives {
    /// Counts another drive.
    pub fn add(&mut self, failed: bool) {
        self.failed += u64::from(failed);
        self.of += 1;
    }

    /// The share that failed; none without drives.
    pub fn share(self) -> Option<f64> {
        (self.of > 0).then(|| self.failed as f64 / self.of as f64)
    }
}

/// The share that failed on roads with any number of drives each; roads without drives do not count. None where no road has any.
///
/// With one drive a road it is [`share`], which is exact about few drives. With several the interval comes from resampled roads, and
/// the share is the mean over roads.
pub fn share_over_roads(roads: &[Drives], confidence: f64) -> Option<Estimate> {
    if roads.iter().all(|drives| drives.of <= 1) {
        let sum = |of: fn(&Drives) -> u64| roads.iter().map(of).sum();
        return share(sum(|drives| drives.failed), sum(|drives| drives.of), confidence);
    }
    let shares: Vec<f64> = roads.iter().filter_map(|drives| drives.share()).collect();
    (!shares.is_empty()).then(|| mean::interval(&shares, (0.0, 1.0), confidence))
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

    #[test]
    fn levels_of_one_road_are_not_independent() {
        let of = |failed, of| Drives { failed, of };
        // Half of the roads fail always, half never: 50 drives, but ten roads.
        let roads: Vec<Drives> = (0..10).map(|road| of(if road % 2 == 0 { 5 } else { 0 }, 5)).collect();
        let pooled = share(25, 50, 0.95).unwrap();
        let found = share_over_roads(&roads, 0.95).unwrap();
        assert_eq!(found.value, 0.5);
        assert!(found.high - found.low > 1.5 * (pooled.high - pooled.low), "{found:?} {pooled:?}");
        // All alike: as much is unknown as with one drive a road.
        let never = share_over_roads(&[of(0, 5); 10], 0.95).unwrap();
        assert_eq!(never, share(0, 10, 0.95).unwrap());
        assert_eq!(share_over_roads(&[of(1, 1), of(0, 1), of(0, 0)], 0.95), share(1, 2, 0.95));
        assert!(share_over_roads(&[of(0, 0)], 0.95).is_none());
    }
}
