//! How different two frames are.

use crate::frame::Frame;

/// Mean difference of all values of two frames of the same size.
///
/// # Panics
/// If the sizes differ.
pub fn mean_difference(a: Frame<'_>, b: Frame<'_>) -> f64 {
    assert!(a.same_size(&b), "frames of different size cannot be compared");
    let rows = a.rows().zip(b.rows());
    let sum: u64 = rows.flat_map(|(a, b)| a.iter().zip(b)).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / (a.width() * a.height() * 3) as f64
}

/// Mean squared difference of all values of two frames of the same size; 0 if they are equal, at most 255².
///
/// # Panics
/// If the sizes differ.
pub fn mean_squared_difference(a: Frame<'_>, b: Frame<'_>) -> f64 {
    assert!(a.same_size(&b), "frames of different size cannot be compared");
    let squares = a.rows().zip(b.rows()).map(|(a, b)| {
        a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(*b)) * u64::from(a.abs_diff(*b))).sum::<u64>()
    });
    squares.sum::<u64>() as f64 / (a.width() * a.height() * 3) as f64
}

/// Radius of the window of [`structural_similarity`].
const RADIUS: usize = 5;

/// Mean structural similarity of two frames of the same size, over all windows that lie inside and all channels: 1 where
/// they are equal. Gaussian weights with a standard deviation of 1.5 pixels over 11x11 pixels, constants for a range of
/// 255. Frames narrower or lower than a window have one window, which is cut.
///
/// Wang, Bovik, Sheikh and Simoncelli, "Image quality assessment: from error visibility to structural similarity" (2004).
///
/// # Panics
/// If the sizes differ.
pub fn structural_similarity(a: Frame<'_>, b: Frame<'_>) -> f64 {
    assert!(a.same_size(&b), "frames of different size cannot be compared");
    (0..3).map(|channel| channel_similarity(&plane(a, channel), &plane(b, channel))).sum::<f64>() / 3.0
}

/// One channel as numbers.
struct Plane {
    values: Vec<f64>,
    width: usize,
}

fn plane(frame: Frame<'_>, channel: usize) -> Plane {
    let values = frame.rows().flat_map(|row| row.iter().skip(channel).step_by(3)).map(|&v| f64::from(v));
    Plane { values: values.collect(), width: frame.width() }
}

fn channel_similarity(a: &Plane, b: &Plane) -> f64 {
    let product = |p: &Plane, q: &Plane| {
        smoothed(&Plane {
            values: p.values.iter().zip(&q.values).map(|(p, q)| p * q).collect(),
            width: p.width,
        })
    };
    let (mean_a, mean_b) = (smoothed(a), smoothed(b));
    let (square_a, square_b, mixed) = (product(a, a), product(b, b), product(a, b));
    let (c1, c2) = ((0.01 * 255.0) * (0.01 * 255.0), (0.03 * 255.0) * (0.03 * 255.0));
    let sum: f64 = (0..mean_a.len())
        .map(|i| {
            let (ma, mb) = (mean_a[i], mean_b[i]);
            let (va, vb, covariance) = (square_a[i] - ma * ma, square_b[i] - mb * mb, mixed[i] - ma * mb);
            ((2.0 * ma * mb + c1) * (2.0 * covariance + c2)) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
        })
        .sum();
    sum / mean_a.len() as f64
}

/// Weighted means over all windows that lie inside: first across, then down.
fn smoothed(plane: &Plane) -> Vec<f64> {
    let (width, height) = (plane.width, plane.values.len() / plane.width);
    let (across, wide) = means(&plane.values, width, height, |line, place| line * width + place);
    let (down, _) = means(&across, height, wide, |line, place| place * wide + line);
    down
}

/// Weighted means along lines of `length` values, of which there are `lines`; `at` says where value `place` of a line is.
/// Returns the means line by line, and how many a line has.
fn means(
    values: &[f64],
    length: usize,
    lines: usize,
    at: impl Fn(usize, usize) -> usize,
) -> (Vec<f64>, usize) {
    let window = (2 * RADIUS + 1).min(length);
    let middle = (window - 1) as f64 / 2.0;
    let weights: Vec<f64> = (0..window)
        .map(|i| libm::exp(-(i as f64 - middle) * (i as f64 - middle) / (2.0 * 1.5 * 1.5)))
        .collect();
    let total: f64 = weights.iter().sum();
    let count = length - window + 1;
    let mut means = Vec::with_capacity(count * lines);
    for line in 0..lines {
        for start in 0..count {
            let sum: f64 =
                weights.iter().enumerate().map(|(i, weight)| weight * values[at(line, start + i)]).sum();
            means.push(sum / total);
        }
    }
    (means, count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FrameBuf;

    fn gradient(width: usize, height: usize, offset: u8) -> FrameBuf {
        let mut frame = FrameBuf::new(width, height);
        for y in 0..height {
            for x in 0..width {
                frame.as_mut().set_pixel(x, y, [(x * 5) as u8 + offset, (y * 7) as u8 + offset, offset]);
            }
        }
        frame
    }

    #[test]
    fn equal_frames_do_not_differ() {
        for (width, height) in [(1, 1), (3, 40), (20, 15)] {
            let frame = gradient(width, height, 9);
            assert_eq!(mean_squared_difference(frame.as_ref(), frame.as_ref()), 0.0);
            assert!((structural_similarity(frame.as_ref(), frame.as_ref()) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_shift_of_brightness_costs_squares_but_little_structure() {
        let (a, b) = (gradient(30, 20, 10), gradient(30, 20, 13));
        assert_eq!(mean_squared_difference(a.as_ref(), b.as_ref()), 9.0);
        let mut noise = a.clone();
        let mut random = pdk_seed::Key([1; 32]).sequence();
        noise
            .as_mut()
            .rows_mut()
            .flatten()
            .for_each(|value| *value = value.wrapping_add(random.below(90) as u8));
        let (shifted, noisy) = (
            structural_similarity(a.as_ref(), b.as_ref()),
            structural_similarity(a.as_ref(), noise.as_ref()),
        );
        assert!(shifted > 0.9 && noisy < 0.7, "{shifted} {noisy}");
    }
}
