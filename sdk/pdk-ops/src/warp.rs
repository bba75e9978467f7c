//! Affine maps of the whole image: shift, shear, rotation.

pub use crate::affine::Affine;
use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::sample::{Border, Padded, SUBPIXELS};
use crate::simd::vectorised;

/// Places are computed in 1/1024 pixel, one part for the row and one for the column, and their sum is rounded to
/// 1/32 pixel.
const FINE: f64 = 1024.0;
const FINE_TO_SUBPIXEL_BITS: u32 = 5;
/// What a column adds is limited to this many steps of 1/1024 pixel, and where a row starts to twice as many, so that
/// a row that starts too far away to be computed stays outside of the image.
const FAR: i32 = 1 << 29;

/// What [`warp_affine`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    padded: Padded,
    /// What each column adds to a place, in 1/1024 pixel.
    column_x: Vec<i32>,
    column_y: Vec<i32>,
    /// The places of a row, in 1/32 pixel.
    xs: Vec<i32>,
    ys: Vec<i32>,
    /// Two rows interpolated, with a black pixel at both ends.
    mixed: Vec<u16>,
}

/// A coordinate in 1/1024 pixel.
fn fine(value: f64, limit: i32) -> i32 {
    ((value * FINE).round_ties_even() as i32).clamp(-limit, limit)
}

/// Moves every pixel of `src` as `map` says, with linear interpolation; what the image does not cover is black, and its
/// edges fade to black over one pixel. Places are rounded to 1/32 pixel. A map that cannot be inverted, because it leaves
/// no area, gives a black frame.
///
/// # Panics
/// If the sizes differ.
pub fn warp_affine(src: Frame<'_>, mut dst: FrameMut<'_>, map: &Affine, workspace: &mut Workspace) {
    assert!(src.same_size(&dst.as_ref()), "warp_affine between frames of different size");
    let Some(Affine([a, b, c, d, e, f])) = map.inverse() else {
        return dst.rows_mut().for_each(|row| row.fill(0));
    };
    let Workspace { padded, column_x, column_y, xs, ys, mixed } = workspace;
    let rounding = 1 << (FINE_TO_SUBPIXEL_BITS - 1);
    let start = |y: usize| {
        let place = |across: f64, shift: f64| fine(across * y as f64 + shift, 2 * FAR) + rounding;
        (place(b, c), place(e, f))
    };
    if a == 1.0 && d == 0.0 {
        for y in 0..src.height() {
            let (x, down) = start(y);
            shift_row(src, x >> FINE_TO_SUBPIXEL_BITS, down >> FINE_TO_SUBPIXEL_BITS, dst.row_mut(y), mixed);
        }
        return;
    }
    padded.fill(src, 1, Border::Black);
    for (columns, factor) in [(&mut *column_x, a), (&mut *column_y, d)] {
        columns.clear();
        columns.extend((0..src.width()).map(|x| fine(factor * x as f64, FAR)));
    }
    xs.resize(src.width(), 0);
    ys.resize(src.width(), 0);
    for y in 0..src.height() {
        let (x, down) = start(y);
        places(x, column_x, xs);
        places(down, column_y, ys);
        padded.sample(xs, ys, dst.row_mut(y));
    }
}

vectorised! {
    fn places / places_avx2 / places_avx512 (start: i32, columns: &[i32], into: &mut [i32]) {
        for (into, &column) in into.iter_mut().zip(columns) {
            *into = (start + column) >> FINE_TO_SUBPIXEL_BITS;
        }
    }
}

/// Fills a row from places that lie one pixel apart, the first of them at `(x, y)` in 1/32 pixel: the weights are the
/// same all along the row.
fn shift_row(src: Frame<'_>, x: i32, y: i32, out: &mut [u8], mixed: &mut Vec<u16>) {
    let (width, height) = (src.width() as i64, src.height() as i64);
    let (left, top) = (i64::from(x.div_euclid(SUBPIXELS)), i64::from(y.div_euclid(SUBPIXELS)));
    let (right, down) = (x.rem_euclid(SUBPIXELS) as u16, y.rem_euclid(SUBPIXELS) as u16);
    // Pixels of the output that see any of the image: `left + x` or the one after it is inside.
    let first = (-left - 1).clamp(0, width);
    let end = (width - left).clamp(first, width);
    if first == end || top < -1 || top >= height {
        return out.fill(0);
    }
    let (inside, count) = (first as usize * CHANNELS, (end - first) as usize * CHANNELS);
    out[..inside].fill(0);
    out[inside + count..].fill(0);
    let out = &mut out[inside..inside + count];
    if right == 0 && down == 0 && left + first >= 0 && top >= 0 {
        let from = (left + first) as usize * CHANNELS;
        let row = src.row(top as usize);
        return out.copy_from_slice(&row[from..from + count]);
    }
    let values = src.width() * CHANNELS;
    mixed.resize(values + 2 * CHANNELS, 0);
    mixed[..CHANNELS].fill(0);
    mixed[values + CHANNELS..].fill(0);
    let middle = &mut mixed[CHANNELS..values + CHANNELS];
    match (top >= 0, top + 1 < height) {
        (true, true) => mix_rows(src.row(top as usize), src.row(top as usize + 1), middle, down),
        (true, false) => scale_row(src.row(top as usize), middle, SUBPIXELS as u16 - down),
        (false, _) => scale_row(src.row(0), middle, down),
    }
    let from = (left + first + 1) as usize * CHANNELS;
    mix_along(&mixed[from..], out, right);
}

vectorised! {
    fn mix_rows / mix_rows_avx2 / mix_rows_avx512 (upper: &[u8], lower: &[u8], into: &mut [u16], down: u16) {
        for ((into, &upper), &lower) in into.iter_mut().zip(upper).zip(lower) {
            *into = u16::from(upper) * (SUBPIXELS as u16 - down) + u16::from(lower) * down;
        }
    }
}

vectorised! {
    fn scale_row / scale_row_avx2 / scale_row_avx512 (row: &[u8], into: &mut [u16], weight: u16) {
        for (into, &value) in into.iter_mut().zip(row) {
            *into = u16::from(value) * weight;
        }
    }
}

vectorised! {
    fn mix_along / mix_along_avx2 / mix_along_avx512 (mixed: &[u16], out: &mut [u8], right: u16) {
        let (left, right) = (SUBPIXELS as u32 - u32::from(right), u32::from(right));
        for ((out, &a), &b) in out.iter_mut().zip(mixed).zip(&mixed[CHANNELS..]) {
            *out = ((u32::from(a) * left + u32::from(b) * right + 512) >> 10) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{run_on, samples};

    /// Interpolates pixel by pixel, testing each of the four neighbours.
    fn plain(src: Frame<'_>, map: &Affine) -> crate::FrameBuf {
        let [a, b, c, d, e, f] = map.inverse().unwrap().0;
        crate::testing::plain(src, |x, y| {
            let place = |across: f64, down: f64, shift: f64| {
                let row = ((down * y as f64 + shift) * 1024.0).round_ties_even() as i64;
                (row + 16 + (across * x as f64 * 1024.0).round_ties_even() as i64).div_euclid(32)
            };
            let (x, y) = (place(a, b, c), place(d, e, f));
            let at = |x: i64, y: i64, channel: usize| {
                let inside = (0..src.width() as i64).contains(&x) && (0..src.height() as i64).contains(&y);
                if inside { i64::from(src.pixel(x as usize, y as usize)[channel]) } else { 0 }
            };
            let (left, top) = (x.div_euclid(32), y.div_euclid(32));
            let (right, down) = (x.rem_euclid(32), y.rem_euclid(32));
            [0, 1, 2].map(|channel| {
                let mut sum = 512;
                for (x, y, weight) in [
                    (left, top, (32 - right) * (32 - down)),
                    (left + 1, top, right * (32 - down)),
                    (left, top + 1, (32 - right) * down),
                    (left + 1, top + 1, right * down),
                ] {
                    sum += at(x, y, channel) * weight;
                }
                (sum >> 10) as u8
            })
        })
    }

    proptest! {
        #[test]
        fn rotation_matches_the_plain_version(
            sample in samples(), degrees in -400.0..400.0, x in -10.0..80.0, y in -10.0..30.0,
        ) {
            let map = Affine::rotation(degrees, x, y);
            let mut workspace = Workspace::default();
            let result = run_on(&sample, |src, dst| warp_affine(src, dst, &map, &mut workspace));
            prop_assert_eq!(result, plain(sample.frame(), &map));
        }

        #[test]
        fn translation_matches_the_plain_version(
            sample in samples(), right in -80.0..80.0, down in -25.0..25.0, whole: bool,
        ) {
            let map = match whole {
                true => Affine::translation(f64::floor(right), f64::floor(down)),
                false => Affine::translation(right, down),
            };
            let mut workspace = Workspace::default();
            let result = run_on(&sample, |src, dst| warp_affine(src, dst, &map, &mut workspace));
            prop_assert_eq!(result, plain(sample.frame(), &map));
        }

        #[test]
        fn shear_matches_the_plain_version(sample in samples(), factor in -3.0..3.0) {
            let map = Affine::shear(factor);
            let mut workspace = Workspace::default();
            let result = run_on(&sample, |src, dst| warp_affine(src, dst, &map, &mut workspace));
            prop_assert_eq!(result, plain(sample.frame(), &map));
        }
    }

    #[test]
    fn the_inverse_undoes_a_map() {
        let map = Affine([1.5, 0.25, -7.0, -0.5, 0.75, 3.0]);
        let [a, b, c, d, e, f] = map.0;
        let [p, q, r, s, t, u] = map.inverse().unwrap().0;
        for (x, y) in [(0.0, 0.0), (5.0, -3.0), (100.0, 40.0)] {
            let (right, down) = (a * x + b * y + c, d * x + e * y + f);
            assert!(
                (p * right + q * down + r - x).abs() < 1e-9 && (s * right + t * down + u - y).abs() < 1e-9
            );
        }
        assert_eq!(Affine([1.0, 2.0, 0.0, 2.0, 4.0, 0.0]).inverse(), None);
    }

    #[test]
    fn extreme_maps_give_black() {
        let src = crate::FrameBuf::from_vec(vec![200; 40 * 6 * 3], 40, 6).unwrap();
        let maps = [
            Affine([0.0; 6]),
            Affine([1e-200, 0.0, 3.0, 0.0, 1e-200, 2.0]),
            Affine([f64::NAN, 0.0, 3.0, 0.0, 1.0, 2.0]),
            Affine::translation(1e300, 0.0),
            Affine::translation(-41.0, 0.0),
            Affine::translation(0.0, 1e12),
            Affine([1e-9, 0.0, 1e6, 0.0, 1.0, 0.0]),
        ];
        for map in maps {
            let mut dst = src.clone();
            warp_affine(src.as_ref(), dst.as_mut(), &map, &mut Workspace::default());
            assert!(dst.data().iter().all(|&v| v == 0), "{map:?}");
        }
    }
}
