//! Depth: the errors of D. Eigen et al., "Depth Map Prediction from a Single Image using a Multi-Scale Deep Network" (2014).

/// The errors of a depth map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthErrors {
    /// The mean of |predicted - measured| / measured.
    pub absolute_relative: f64,
    /// The root of the mean of (predicted - measured)^2.
    pub root_mean_square: f64,
    /// The share of pixels at which the larger of both is less than 1.25 times the smaller.
    pub within_1_25: f64,
    /// Pixels that have a measured depth.
    pub pixels: usize,
}

/// The errors over all pixels that have a measured depth, which is more than 0 and finite. None if there are none.
pub fn errors(predicted: &[f32], measured: &[f32]) -> Option<DepthErrors> {
    let known: Vec<(f64, f64)> = predicted
        .iter()
        .zip(measured)
        .filter(|(_, measured)| **measured > 0.0 && measured.is_finite())
        .map(|(predicted, measured)| (f64::from(*predicted), f64::from(*measured)))
        .collect();
    let pixels = known.len();
    let mean =
        |of: &dyn Fn(f64, f64) -> f64| known.iter().map(|(p, m)| of(*p, *m)).sum::<f64>() / pixels as f64;
    let near = |p: f64, m: f64| if p > 0.0 && (p / m).max(m / p) < 1.25 { 1.0 } else { 0.0 };
    (pixels > 0).then(|| DepthErrors {
        absolute_relative: mean(&|p, m| (p - m).abs() / m),
        root_mean_square: mean(&|p, m| (p - m) * (p - m)).sqrt(),
        within_1_25: mean(&near),
        pixels,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_without_a_measured_depth_do_not_count() {
        let found = errors(&[2.0, 5.0, 9.0, 1.0], &[2.0, 4.0, 0.0, f32::INFINITY]).unwrap();
        assert_eq!(found.pixels, 2);
        assert!((found.absolute_relative - 0.125).abs() < 1e-12);
        assert!((found.root_mean_square - 0.5_f64.sqrt()).abs() < 1e-12);
        // 5 / 4 is not less than 1.25.
        assert_eq!(found.within_1_25, 0.5);
        assert_eq!(errors(&[1.0], &[0.0]), None);
    }
}
