//! Copies along a line, of which motion blur and the streaks of snow consist.

use std::f64::consts::PI;

use pdk_sdk::ops::float::Moved;

/// Copies of a moving image, each so far moved right and down, with weights that sum to 1: the half of a Gaussian along a line.
pub fn motion(radius: f64, sigma: f64, degrees: f64, (width, height): (usize, usize)) -> Vec<Moved> {
    let count = 2 * radius.round() as usize + 1;
    let density = |step: usize| libm::exp(-((step * step) as f64) / (2.0 * sigma * sigma));
    let total: f64 = (0..count).map(density).sum();
    let (right, down) = (libm::cos(degrees * PI / 180.0), libm::sin(degrees * PI / 180.0));
    let mut copies = Vec::with_capacity(count);
    for step in 0..count {
        let by = |part: f64| -(libm::ceil(step as f64 * part - 0.5) as isize);
        let (right, down) = (by(right), by(down));
        // What has moved out of the image is left out, and the image becomes darker, as in the package.
        if right.unsigned_abs() >= width || down.unsigned_abs() >= height {
            break;
        }
        copies.push(([right, down], (density(step) / total) as f32));
    }
    copies
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_has_the_weights_of_half_a_gaussian() {
        let copies = motion(10.0, 3.0, 0.0, (100, 100));
        assert_eq!(copies.len(), 21);
        assert!((copies.iter().map(|(_, weight)| weight).sum::<f32>() - 1.0).abs() < 1e-5);
        assert!(
            copies
                .iter()
                .enumerate()
                .all(|(step, ([right, down], _))| (*right, *down) == (-(step as isize), 0))
        );
        assert_eq!(motion(10.0, 3.0, 0.0, (5, 5)).len(), 5);
    }
}
