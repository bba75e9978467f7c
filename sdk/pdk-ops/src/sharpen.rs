//! Sharpening with the 3x3 Laplacian.

use crate::border::reflect;
use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::simd::{round_inside_byte, round_to_byte, vectorised};

/// What [`sharpen`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    /// Sums of three rows, with a mirrored pixel at both ends.
    sums: Vec<u16>,
}

/// Filters with a kernel of -1 around a centre of `8 + gain`, clipped and rounded half to even, and blends:
/// `weight * src + (1 - weight) * filtered`, rounded half to even. The kernel sums to `gain`, so it brightens by that
/// factor too. The edges mirror without repeating the edge pixel; the weight is clipped to 0..=1.
///
/// # Panics
/// If the sizes differ.
pub fn sharpen(src: Frame<'_>, mut dst: FrameMut<'_>, gain: f64, weight: f64, workspace: &mut Workspace) {
    assert!(src.same_size(&dst.as_ref()), "sharpen between frames of different size");
    let weight = weight.clamp(0.0, 1.0);
    let (width, height) = (src.width(), src.height());
    let values = width * CHANNELS;
    let sums = &mut workspace.sums;
    sums.resize(values + 2 * CHANNELS, 0);
    for y in 0..height {
        let row = |down: isize| src.row(reflect(y as isize + down, height));
        add_three(row(-1), row(0), row(1), &mut sums[CHANNELS..CHANNELS + values]);
        for (to, from) in [(0, reflect(-1, width)), (width + 1, reflect(width as isize, width))] {
            let from = (from + 1) * CHANNELS;
            sums.copy_within(from..from + CHANNELS, to * CHANNELS);
        }
        // The centre is in the sum of nine, so it counts once more.
        let centre = (9.0 + gain) as f32;
        sharpen_row(row(0), sums, dst.row_mut(y), centre, weight as f32, (1.0 - weight) as f32);
    }
}

vectorised! {
    fn add_three / add_three_avx2 / add_three_avx512 (a: &[u8], b: &[u8], c: &[u8], sums: &mut [u16]) {
        for (((sum, &a), &b), &c) in sums.iter_mut().zip(a).zip(b).zip(c) {
            *sum = u16::from(a) + u16::from(b) + u16::from(c);
        }
    }
}

vectorised! {
    fn sharpen_row / sharpen_row_avx2 / sharpen_row_avx512 (
        row: &[u8], sums: &[u16], out: &mut [u8], centre: f32, weight: f32, rest: f32,
    ) {
        let neighbours = sums.iter().zip(&sums[CHANNELS..]).zip(&sums[2 * CHANNELS..]);
        for ((out, &value), ((&a, &b), &c)) in out.iter_mut().zip(row).zip(neighbours) {
            let value = f32::from(value);
            let filtered = round_to_byte(centre * value - f32::from(a + b + c));
            *out = round_inside_byte(value * weight + f32::from(filtered) * rest);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{plain, run_on, samples};

    proptest! {
        #[test]
        fn matches_the_plain_version(sample in samples(), gain in 0.0..6.0, weight in 0.0..=1.0, whole: bool) {
            let gain = if whole { f64::floor(gain) } else { gain };
            let src = sample.frame();
            let expected = plain(src, |x, y| {
                let at = |right: isize, down: isize, c: usize| {
                    let (column, row) = (reflect(x as isize + right, src.width()), reflect(y as isize + down, src.height()));
                    f32::from(src.pixel(column, row)[c])
                };
                [0, 1, 2].map(|c| {
                    let around: f32 = (-1..=1).flat_map(|r| (-1..=1).map(move |d| (r, d)))
                        .map(|(right, down)| at(right, down, c))
                        .sum();
                    let filtered = ((9.0 + gain) as f32 * at(0, 0, c) - around).round_ties_even().clamp(0.0, 255.0);
                    (at(0, 0, c) * weight as f32 + filtered * (1.0 - weight) as f32).round_ties_even() as u8
                })
            });
            let mut workspace = Workspace::default();
            prop_assert_eq!(run_on(&sample, |src, dst| sharpen(src, dst, gain, weight, &mut workspace)), expected);
        }
    }

    #[test]
    fn a_gain_of_one_keeps_a_flat_frame() {
        let src = crate::FrameBuf::from_vec(vec![77; 9 * 4 * 3], 9, 4).unwrap();
        let mut dst = crate::FrameBuf::new(9, 4);
        sharpen(src.as_ref(), dst.as_mut(), 1.0, 0.3, &mut Workspace::default());
        assert_eq!(src, dst);
    }
}
