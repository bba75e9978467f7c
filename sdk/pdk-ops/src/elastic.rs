//! Elastic distortion: every pixel comes from a random place nearby.

use crate::displacement::Displacement;
use crate::frame::{Frame, FrameMut};
use crate::sample::{Border, Padded, SUBPIXELS};
use crate::simd::vectorised;
use crate::smooth::{self, Kernel, Size, WEIGHT_BITS, smooth};
use pdk_seed::Random;

/// The largest displacement [`elastic`] takes, in pixels.
pub const MAX_DISPLACEMENT: f64 = 1000.0;
/// Random numbers from -1 to 1 have this many fractional bits.
const DRAW_BITS: u32 = 14;

/// What [`elastic`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    kernel: Kernel,
    smooth: smooth::Workspace,
    padded: Padded,
    bytes: Vec<u8>,
    draws: Vec<i16>,
    /// The places that pixels come from, in 1/32 pixel.
    xs: Vec<i32>,
    ys: Vec<i32>,
}

/// Gives each pixel the colour at a displaced place. Displacements to the right and down are uniform within
/// `-alpha..alpha` pixels for each pixel, then smoothed with a Gaussian of standard deviation `sigma` pixels, mirrored at
/// the edges without repeating them; the larger `sigma`, the smaller what is left of them. Colours are interpolated
/// linearly at 1/32 px, and the frame goes on mirrored beyond its edges.
///
/// Simard, Steinkraus, Platt, "Best practices for convolutional neural networks applied to visual document analysis"
/// (2003).
///
/// # Panics
/// If the sizes differ, `alpha` is not within 0..=1000 or `sigma` not within 0.1..=20.
pub fn elastic(
    src: Frame<'_>,
    mut dst: FrameMut<'_>,
    alpha: f64,
    sigma: f64,
    random: &mut Random,
    workspace: &mut Workspace,
) {
    assert!(src.same_size(&dst.as_ref()), "elastic between frames of different size");
    let width = src.width();
    places((width, src.height()), alpha, sigma, random, workspace);
    let Workspace { padded, xs, ys, .. } = workspace;
    padded.fill(src, alpha.ceil() as usize + 1, Border::Mirror);
    for ((xs, ys), row) in xs.chunks_exact(width).zip(ys.chunks_exact(width)).zip(dst.rows_mut()) {
        padded.sample(xs, ys, row);
    }
}

/// Where [`elastic`] takes the pixels of a frame of this size from, with the same numbers and the same random numbers.
///
/// # Panics
/// If `alpha` is not within 0..=1000 or `sigma` not within 0.1..=20.
pub fn displacement(
    (width, height): (usize, usize),
    alpha: f64,
    sigma: f64,
    random: &mut Random,
    workspace: &mut Workspace,
) -> Displacement {
    places((width, height), alpha, sigma, random, workspace);
    let Workspace { xs, ys, .. } = workspace;
    let place = |at: usize| [xs[at], ys[at]].map(|place| place as f32 / SUBPIXELS as f32);
    Displacement::new(width, height, (0..width * height).map(place).collect())
}

/// Draws the places that pixels come from.
fn places(
    (width, height): (usize, usize),
    alpha: f64,
    sigma: f64,
    random: &mut Random,
    workspace: &mut Workspace,
) {
    assert!(
        (0.0..=MAX_DISPLACEMENT).contains(&alpha),
        "elastic takes displacements of 0 to 1000 pixels, not {alpha}"
    );
    assert!((0.1..=20.0).contains(&sigma), "elastic takes a sigma of 0.1 to 20 pixels, not {sigma}");
    let Workspace { kernel, smooth: buffers, bytes, draws, xs, ys, .. } = workspace;
    kernel.set_gaussian((8.0 * sigma + 1.0).round_ties_even() as usize | 1, sigma);
    // From sums to 1/32 px.
    let scale = (alpha * f64::from(SUBPIXELS) / f64::from(1u32 << (WEIGHT_BITS + DRAW_BITS))) as f32;
    bytes.resize(width * height * 2, 0);
    draws.resize(width * height, 0);
    for (places, vertical) in [(&mut *xs, false), (&mut *ys, true)] {
        random.fill(bytes);
        draw(bytes, draws);
        places.resize(width * height, 0);
        smooth(
            Size { width, height, channels: 1 },
            kernel,
            0,
            |y, start, to| to.copy_from_slice(&draws[y * width + start..][..to.len()]),
            |y, sums| {
                let (first, step) = if vertical { (y as i32 * SUBPIXELS, 0) } else { (0, SUBPIXELS) };
                displace(sums, scale, first, step, &mut places[y * width..(y + 1) * width]);
            },
            buffers,
        );
    }
}

vectorised! {
    // Steps of 2^-14 from -1 up to, but not including, 1.
    fn draw / draw_avx2 (bytes: &[u8], draws: &mut [i16]) {
        for (draw, pair) in draws.iter_mut().zip(bytes.chunks_exact(2)) {
            *draw = i16::from_le_bytes([pair[0], pair[1]]) >> (15 - DRAW_BITS);
        }
    }
}

/// Adding this to a number within 2^22 of zero leaves the number, rounded half to even, in the lowest bits.
const ROUNDING: f32 = 12_582_912.0;

vectorised! {
    fn displace / displace_avx2 (
        sums: &[i32], scale: f32, first: i32, step: i32, places: &mut [i32],
    ) {
        let mut place = first;
        for (to, &sum) in places.iter_mut().zip(sums) {
            let displacement = (sum as f32 * scale + ROUNDING).to_bits() as i32 - ROUNDING.to_bits() as i32;
            *to = place + displacement;
            place += step;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::border::reflect;
    use crate::testing::{plain, run_on, samples};
    use pdk_seed::Key;

    /// Draws, smooths and interpolates in floating point.
    fn plain_elastic(src: Frame<'_>, alpha: f64, sigma: f64, random: &mut Random) -> Vec<[f64; 3]> {
        let (width, height) = (src.width(), src.height());
        let radius = ((8.0 * sigma + 1.0).round_ties_even() as usize | 1) as isize / 2;
        let weights: Vec<f64> =
            (-radius..=radius).map(|x| libm::exp(-((x * x) as f64) / (2.0 * sigma * sigma))).collect();
        let total: f64 = weights.iter().sum();
        let mut fields = [(); 2].map(|()| {
            let mut bytes = vec![0; width * height * 2];
            random.fill(&mut bytes);
            let number = |pair: &[u8]| f64::from(i16::from_le_bytes([pair[0], pair[1]])) / 32768.0;
            bytes.chunks(2).map(number).collect::<Vec<f64>>()
        });
        for field in &mut fields {
            for vertical in [true, false] {
                let before = field.clone();
                for (i, value) in field.iter_mut().enumerate() {
                    let (x, y) = ((i % width) as isize, (i / width) as isize);
                    let at = |d: isize| match vertical {
                        true => before[reflect(y + d, height) * width + x as usize],
                        false => before[y as usize * width + reflect(x + d, width)],
                    };
                    *value = (-radius..=radius).zip(&weights).map(|(d, w)| w / total * at(d)).sum();
                }
            }
        }
        let mirror = |i: isize, len: usize| {
            let place = i.rem_euclid(2 * len as isize) as usize;
            place.min(2 * len - 1 - place)
        };
        (0..width * height)
            .map(|i| {
                let x = (i % width) as f64 + alpha * fields[0][i];
                let y = (i / width) as f64 + alpha * fields[1][i];
                let at = |right: isize, down: isize| {
                    src.pixel(
                        mirror(x.floor() as isize + right, width),
                        mirror(y.floor() as isize + down, height),
                    )
                };
                let (right, down) = (x - x.floor(), y - y.floor());
                [0, 1, 2].map(|c| {
                    let across =
                        |d: isize| f64::from(at(0, d)[c]) * (1.0 - right) + f64::from(at(1, d)[c]) * right;
                    across(0) * (1.0 - down) + across(1) * down
                })
            })
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn matches_floating_point(sample in samples(), alpha in 0.0..20.0, sigma in 0.1..3.0, key: [u8; 32]) {
            let mut workspace = Workspace::default();
            let result = run_on(&sample, |src, dst| {
                elastic(src, dst, alpha, sigma, &mut Key(key).frame(0), &mut workspace);
            });
            let expected = plain_elastic(sample.frame(), alpha, sigma, &mut Key(key).frame(0));
            for (actual, expected) in result.data().chunks(3).zip(expected) {
                for c in 0..3 {
                    // A place may be off by half a step of 1/32 px and what draws and sums lost, in both directions,
                    // between pixels that differ by up to 255.
                    let tolerance = 255.0 * 2.0 * (0.5 / 32.0 + 0.0004 * alpha) + 1.0;
                    prop_assert!((f64::from(actual[c]) - expected[c]).abs() < tolerance);
                }
            }
        }

        #[test]
        fn without_displacement_nothing_changes(sample in samples()) {
            let result = run_on(&sample, |src, dst| {
                elastic(src, dst, 0.0, 1.0, &mut Key([1; 32]).frame(0), &mut Workspace::default());
            });
            prop_assert_eq!(result, plain(sample.frame(), |x, y| sample.frame().pixel(x, y)));
        }
    }
}
