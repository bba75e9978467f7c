//! Differences between two samples that have nothing to do with each other, such as searches by two strategies with seeds of their
//! own.

use serde::Serialize;
use statrs::stats_tests::Alternative;
use statrs::stats_tests::mannwhitneyu::{MannWhitneyUMethod, mannwhitneyu};

/// How two samples differ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Independent {
    /// The probability that a value of the first sample is larger than one of the second, with ties as one half: 0.5 if they do
    /// not differ. A. Vargha, H. D. Delaney, "A critique and improvement of the CL common language effect size" (2000).
    pub effect_size: f64,
    /// The p-value of the two-sided Mann-Whitney test: how likely a difference of this size is if both come from the same distribution, in
    /// the test's normal approximation with corrections for ties and continuity.
    pub p: f64,
}

/// Compares two samples; none if one of them is empty or a value is not a number.
pub fn compare(first: &[f64], second: &[f64]) -> Option<Independent> {
    // The exact form of this library says 1 for samples that do not overlap (0.19.1).
    let method = MannWhitneyUMethod::AsymptoticInclContinuityCorrection;
    let (u, p) = mannwhitneyu(first, second, method, Alternative::TwoSided).ok()?;
    let pairs = (first.len() * second.len()) as f64;
    // If all values are equal, nothing varies, and nothing differs.
    Some(Independent { effect_size: u / pairs, p: if p.is_nan() { 1.0 } else { p } })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_distinguished() {
        let apart = compare(&[5.0, 6.0, 7.0, 8.0], &[1.0, 2.0, 3.0, 4.0]).unwrap();
        // What scipy.stats.mannwhitneyu(method="asymptotic") says.
        assert!(apart.effect_size == 1.0 && (apart.p - 0.030_382_8).abs() < 1e-6, "{apart:?}");
        let back = compare(&[1.0, 2.0, 3.0, 4.0], &[5.0, 6.0, 7.0, 8.0]).unwrap();
        assert!(back.effect_size == 0.0 && (back.p - apart.p).abs() < 1e-12, "{back:?}");
        let ties = compare(&[1.0, 2.0, 3.0], &[2.0, 3.0, 4.0]).unwrap();
        assert!((ties.effect_size - 2.0 / 9.0).abs() < 1e-12 && ties.p > 0.1, "{ties:?}");
        let same = compare(&[3.0; 12], &[3.0; 12]).unwrap();
        assert_eq!((same.effect_size, same.p), (0.5, 1.0));
        assert_eq!(compare(&[], &[1.0]), None);
        assert_eq!(compare(&[f64::NAN], &[1.0]), None);
    }
}
