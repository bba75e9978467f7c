//! A mean over frames of a recording, which resemble their neighbours.
//!
//! Frames that follow each other show nearly the same, so an interval that took them for independent would be far too narrow. The
//! circular block bootstrap draws blocks of frames that follow each other instead (D. Politis and J. Romano, "A Circular
//! Block-Resampling Procedure for Stationary Data", 1992, after H. Kuensch, 1989). [`length`] chooses how long they are.

use pdk_seed::Key;

use crate::bootstrap;
use crate::estimate::Estimate;

/// Resamples for an interval.
const DRAWS: usize = 2000;

/// The key of all resamples, so that equal values have equal intervals.
const KEY: Key = Key(*b"pdk statistics: resampled frames");

/// The fewest blocks that say anything about how blocks differ.
const FEWEST: usize = 3;

/// The length of blocks for the mean of a series: D. Politis and H. White, "Automatic Block-Length Selection for the Dependent
/// Bootstrap" (2004), with the correction of A. Patton, D. Politis and H. White (2009), for the circular block bootstrap.
///
/// It looks for the lag from which on the autocorrelation is not significant any more, estimates the spectrum at 0 from the lags up
/// to twice that, and takes the length with the smallest expected error of the variance. It is 1 for values that do not depend on
/// each other, and never more than a third of the series.
pub fn length(values: &[f64]) -> usize {
    let n = values.len() as f64;
    // Rounded down, so that there are always enough blocks.
    let most = (3.0 * n.sqrt()).min(n / FEWEST as f64).floor().max(1.0);
    let mut covariances = Covariances::new(values);
    let variance = covariances.at(0);
    if values.len() < 2 * FEWEST || variance <= 0.0 {
        return 1;
    }
    // The published choice of the constants: c = 2, and the number of lags in a row that are not significant.
    let limit = 2.0 * (libm::log10(n) / n).sqrt();
    let in_a_row = libm::log10(n).sqrt().ceil().max(5.0) as usize;
    let last = (n.sqrt().ceil() as usize + in_a_row).min(values.len() - 1);
    let mut significant = 0;
    for lag in 1..=last {
        if covariances.at(lag).abs() / variance >= limit {
            significant = lag;
        } else if lag - significant >= in_a_row {
            break;
        }
    }
    let window = (2 * significant.max(1)).min(last);
    let (mut spectrum, mut slope) = (variance, 0.0);
    for lag in 1..=window {
        // The flat-top window: 1 up to the middle, and down to 0 at the end.
        let share = lag as f64 / window as f64;
        let weight = if share <= 0.5 { 1.0 } else { 2.0 * (1.0 - share) };
        spectrum += 2.0 * weight * covariances.at(lag);
        slope += 2.0 * weight * lag as f64 * covariances.at(lag);
    }
    let best = libm::cbrt(1.5 * slope * slope / (spectrum * spectrum)) * libm::cbrt(n);
    if best.is_finite() { best.round().clamp(1.0, most) as usize } else { 1 }
}

/// The mean of a series with its interval, from blocks of this length. None without values. If there are fewer than three blocks,
/// the values do not say how sure the mean is, and the interval is infinite.
pub fn mean(values: &[f64], length: usize, confidence: f64) -> Option<Estimate> {
    let n = values.len();
    if n == 0 {
        return None;
    }
    let value = values.iter().sum::<f64>() / n as f64;
    let length = length.max(1);
    let blocks = n / length;
    if blocks < FEWEST {
        return Some(Estimate { value, low: f64::NEG_INFINITY, high: f64::INFINITY });
    }
    // The sum of the block that begins at each value, around the end to the beginning.
    let mut sums = Vec::with_capacity(n);
    for start in 0..n {
        sums.push((0..length).map(|step| values[(start + step) % n]).sum::<f64>());
    }
    let mut random = KEY.sequence();
    let mut means: Vec<f64> = (0..DRAWS)
        .map(|_| {
            let sum: f64 = (0..blocks).map(|_| sums[random.below(n as u32) as usize]).sum();
            sum / (blocks * length) as f64
        })
        .collect();
    means.sort_by(f64::total_cmp);
    let (low, high) = bootstrap::interval(&means, blocks, confidence);
    Some(Estimate { value, low: low.min(value), high: high.max(value) })
}

/// Autocovariances of a series, each computed when it is first needed.
struct Covariances {
    away: Vec<f64>,
    known: Vec<f64>,
}

impl Covariances {
    fn new(values: &[f64]) -> Self {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        Self { away: values.iter().map(|value| value - mean).collect(), known: Vec::new() }
    }

    fn at(&mut self, lag: usize) -> f64 {
        while self.known.len() <= lag {
            let lag = self.known.len();
            let products = self.away.iter().zip(self.away.iter().skip(lag)).map(|(a, b)| a * b);
            self.known.push(products.sum::<f64>() / self.away.len().max(1) as f64);
        }
        self.known[lag]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values that remember this share of the one before.
    fn remembering(share: f64, count: usize, key: u8) -> Vec<f64> {
        let mut random = Key([key; 32]).sequence();
        let mut value = 0.0;
        (0..count)
            .map(|_| {
                value = share * value + (1.0 - share * share).sqrt() * random.normal();
                value
            })
            .collect()
    }

    #[test]
    fn the_length_grows_with_how_much_neighbours_resemble_each_other() {
        let mean_length = |share: f64| {
            let lengths = (0..20).map(|key| length(&remembering(share, 1000, key)) as f64);
            lengths.sum::<f64>() / 20.0
        };
        // For this model the best length is (6 rho^2 / (1 - rho^2)^2)^(1/3) n^(1/3), with rho the share.
        for (share, best) in [(0.0, 1.0), (0.5, 13.9), (0.9, 51.3)] {
            let found = mean_length(share);
            assert!((found / best - 1.0).abs() < 0.35 || found - best < 2.5, "{share}: {found} for {best}");
        }
        assert_eq!(length(&[2.0; 50]), 1);
        assert_eq!(length(&[1.0, 2.0]), 1);
        assert_eq!(length(&[]), 1);
    }

    #[test]
    fn intervals_of_dependent_frames_cover_the_truth() {
        for (share, least) in [(0.0, 0.90), (0.5, 0.88), (0.9, 0.82)] {
            let covered = (0..200).filter(|key| {
                let values = remembering(share, 400, *key);
                let found = mean(&values, length(&values), 0.95).unwrap();
                found.low <= 0.0 && 0.0 <= found.high
            });
            let covered = covered.count() as f64 / 200.0;
            println!("{share}: {covered}");
            assert!(covered >= least, "{share}: {covered}");
        }
        // Taken for independent, the same frames cover the truth in less than half of all cases.
        let values: Vec<_> = (0..200).map(|key| remembering(0.9, 400, key)).collect();
        let alone = values.iter().filter(|values| {
            let found = mean(values, 1, 0.95).unwrap();
            found.low <= 0.0 && 0.0 <= found.high
        });
        assert!(alone.count() < 100);
    }

    #[test]
    fn few_blocks_say_nothing_and_equal_values_are_sure() {
        assert!(mean(&[], 1, 0.95).is_none());
        let few = mean(&[1.0, 2.0, 3.0], 2, 0.95).unwrap();
        assert!(few.value == 2.0 && few.low == f64::NEG_INFINITY && few.high == f64::INFINITY);
        assert_eq!(mean(&[0.5; 40], 4, 0.95).unwrap(), Estimate { value: 0.5, low: 0.5, high: 0.5 });
    }
}
