//! The share of drives that failed, with any number of drives a road.

use crate::estimate::Estimate;
use crate::mean;
use crate::share::share;

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

/// The share that failed on roads with any number of drives each; roads without drives do not count. None if no road has any.
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
