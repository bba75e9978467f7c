//! Depth: how far predicted distances are from measured ones (D. Eigen et al., "Depth Map Prediction from a Single Image using a
//! Multi-Scale Deep Network", 2014).

/// Distances that differ by less than this factor are right.
pub const NEAR: f64 = 1.25;

/// The errors of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthErrors {
    /// The mean of the absolute differences, each as a share of the measured distance.
    pub absolute_relative: f64,
    /// The root of the mean squared difference.
    pub root_mean_square: f64,
    /// The share of the pixels that differ by a factor of less than [`NEAR`].
    pub near: f64,
}

/// The errors over pixels, each with its predicted and its measured distance, which are positive. None if there are none.
pub fn errors(pixels: &[(f64, f64)]) -> Option<DepthErrors> {
    let count = pixels.len() as f64;
    let mean = |of: &dyn Fn(f64, f64) -> f64| {
        pixels.iter().map(|(predicted, measured)| of(*predicted, *measured)).sum::<f64>() / count
    };
    (!pixels.is_empty()).then(|| DepthErrors {
        absolute_relative: mean(&|predicted, measured| (predicted - measured).abs() / measured),
        root_mean_square: mean(&|predicted, measured| (predicted - measured) * (predicted - measured)).sqrt(),
        near: mean(&|predicted, measured| f64::from((predicted / measured).max(measured / predicted) < NEAR)),
    })
}

/// The factor that gives predicted distances the median of the measured ones, for networks that know distances up to a factor only.
/// None if there are no pixels or the median of the predicted distances is not positive.
pub fn median_factor(pixels: &[(f64, f64)]) -> Option<f64> {
    let predicted = median(pixels.iter().map(|(predicted, _)| *predicted).collect())?;
    let measured = median(pixels.iter().map(|(_, measured)| *measured).collect())?;
    (predicted > 0.0).then(|| measured / predicted)
}

/// The value in the middle, or the mean of the two there.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let upper = *values.get(values.len() / 2)?;
    Some(match values.len() % 2 {
        1 => upper,
        _ => (values[values.len() / 2 - 1] + upper) / 2.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_relative_to_what_was_measured() {
        let found = errors(&[(2.0, 1.0), (10.0, 10.0), (4.0, 5.0)]).unwrap();
        assert!((found.absolute_relative - (1.0 + 0.2) / 3.0).abs() < 1e-12);
        assert!((found.root_mean_square - (2.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        // 5 / 4 is not less than 1.25.
        assert!((found.near - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(errors(&[]), None);
    }

    #[test]
    fn a_factor_makes_the_medians_equal() {
        assert_eq!(median_factor(&[(1.0, 3.0), (2.0, 5.0), (9.0, 4.0)]), Some(2.0));
        assert_eq!(median_factor(&[(1.0, 3.0), (3.0, 5.0)]), Some(2.0));
        assert_eq!((median_factor(&[]), median_factor(&[(0.0, 1.0)])), (None, None));
    }
}
