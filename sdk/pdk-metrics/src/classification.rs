//! Classification: is the right class among the first?
//!
//! The corruption errors are those of D. Hendrycks and T. Dietterich, "Benchmarking Neural Network Robustness to Common Corruptions and
//! Perturbations" (2019), section 4.1: the errors of a network under a corruption, summed over its levels, divided by those of a
//! baseline, so that a corruption that is hard for every network does not outweigh the others.

/// The places of the `count` largest scores, the largest first. Of equal scores the first counts as larger, and one that is not a
/// number as the smallest.
pub fn top(scores: &[f32], count: usize) -> Vec<usize> {
    let mut places: Vec<usize> = (0..scores.len()).collect();
    let key = |place: usize| if scores[place].is_nan() { f32::NEG_INFINITY } else { scores[place] };
    places.sort_by(|a, b| key(*b).total_cmp(&key(*a)).then(a.cmp(b)));
    places.truncate(count);
    places
}

/// The errors of a network under a corruption, and those of a baseline, one for each level, from 0 to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Errors<'a> {
    /// The network.
    pub network: &'a [f64],
    /// The baseline.
    pub baseline: &'a [f64],
}

/// The corruption error: the sum of the network's errors over that of the baseline's. None if the baseline makes no errors.
pub fn corruption_error(errors: &Errors<'_>) -> Option<f64> {
    quotient(errors.network.iter().sum(), errors.baseline.iter().sum())
}

/// The relative corruption error: as [`corruption_error`], of how much larger errors are than without a corruption. None if those of the
/// baseline are not larger.
pub fn relative_corruption_error(
    errors: &Errors<'_>,
    network_clean: f64,
    baseline_clean: f64,
) -> Option<f64> {
    quotient(
        errors.network.iter().map(|error| error - network_clean).sum(),
        errors.baseline.iter().map(|error| error - baseline_clean).sum(),
    )
}

fn quotient(network: f64, baseline: f64) -> Option<f64> {
    (baseline > 0.0).then(|| network / baseline)
}

/// The mean over corruptions. None if there are none.
pub fn mean(errors: &[f64]) -> Option<f64> {
    (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_scores_come_first_and_what_is_not_a_number_last() {
        assert_eq!(top(&[0.5, f32::NAN, 0.9, 0.5], 3), [2, 0, 3]);
        assert_eq!(top(&[f32::NAN, -1.0], 5), [1, 0]);
        assert!(top(&[], 1).is_empty());
    }

    #[test]
    fn corruption_errors_are_quotients_of_sums() {
        let errors = Errors { network: &[0.2, 0.4], baseline: &[0.5, 1.0] };
        assert!((corruption_error(&errors).unwrap() - 0.4).abs() < 1e-12);
        // (0.1 + 0.3) / (0.1 + 0.6)
        assert!((relative_corruption_error(&errors, 0.1, 0.4).unwrap() - 4.0 / 7.0).abs() < 1e-12);
        assert_eq!(corruption_error(&Errors { network: &[0.1], baseline: &[0.0] }), None);
        assert_eq!(mean(&[0.5, 1.0]), Some(0.75));
        assert_eq!(mean(&[]), None);
    }
}
