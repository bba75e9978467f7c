//! Resizing.

use crate::frame::{CHANNELS, Frame, FrameMut};

/// Interpolation weights are fixed-point numbers with this many fractional bits.
const WEIGHT_BITS: u32 = 11;
/// Columns are done in blocks of this many pixels, so that what belongs to a column stays on the stack.
const BLOCK: usize = 128;

/// Where an output position lies between two input positions.
#[derive(Clone, Copy, Default)]
struct Tap {
    first: usize,
    second: usize,
    first_weight: i32,
    second_weight: i32,
}

impl Tap {
    /// Pixel centres coincide at the edges of both images; beyond the outermost centres the edge is repeated.
    fn at(position: usize, from: usize, to: usize) -> Self {
        let scale = from as f64 / to as f64;
        let centre = ((position as f64 + 0.5) * scale - 0.5).clamp(0.0, (from - 1) as f64);
        let first = centre as usize;
        let fraction = centre - first as f64;
        let one = f64::from(1 << WEIGHT_BITS);
        Self {
            first,
            second: (first + 1).min(from - 1),
            first_weight: ((1.0 - fraction) * one).round_ties_even() as i32,
            second_weight: (fraction * one).round_ties_even() as i32,
        }
    }
}

/// Resizes `src` to the size of `dst` with linear interpolation between the two nearest pixels in each direction.
/// Shrinking does not average, so fine patterns alias. Each interpolation has 11-bit weights.
pub fn resize_linear(src: Frame<'_>, mut dst: FrameMut<'_>) {
    let (width, height) = (dst.width(), dst.height());
    if src.same_size(&dst.as_ref()) {
        return dst.copy_from(src);
    }
    let mut taps = [Tap::default(); BLOCK];
    // The two source rows that an output row lies between, interpolated horizontally, with their row numbers.
    let mut rows = [[0i32; BLOCK * CHANNELS]; 2];
    for start in (0..width).step_by(BLOCK) {
        let columns = BLOCK.min(width - start);
        for (offset, tap) in taps[..columns].iter_mut().enumerate() {
            *tap = Tap::at(start + offset, src.width(), width);
        }
        let mut held = [usize::MAX; 2];
        for y in 0..height {
            let tap = Tap::at(y, src.height(), height);
            if held[0] != tap.first && held[1] == tap.first {
                rows.swap(0, 1);
                held.swap(0, 1);
            }
            for (slot, wanted) in [tap.first, tap.second].into_iter().enumerate() {
                if held[slot] != wanted {
                    interpolate_row(src.row(wanted), &taps[..columns], &mut rows[slot]);
                    held[slot] = wanted;
                }
            }
            let out = &mut dst.row_mut(y)[start * CHANNELS..(start + columns) * CHANNELS];
            let (first, second) = (tap.first_weight, tap.second_weight);
            for ((out, &a), &b) in out.iter_mut().zip(&rows[0]).zip(&rows[1]) {
                let sum = ((first * (a >> 4)) >> 16) + ((second * (b >> 4)) >> 16);
                *out = ((sum + 2) >> 2) as u8;
            }
        }
    }
}

/// Interpolates one row at each tap; the results are larger by 2^11.
fn interpolate_row(row: &[u8], taps: &[Tap], into: &mut [i32]) {
    for (tap, into) in taps.iter().zip(into.chunks_exact_mut(CHANNELS)) {
        let (a, b) = (tap.first * CHANNELS, tap.second * CHANNELS);
        for (channel, into) in into.iter_mut().enumerate() {
            *into = i32::from(row[a + channel]) * tap.first_weight
                + i32::from(row[b + channel]) * tap.second_weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::testing::{run, samples};

    /// Linear interpolation in floating point.
    fn plain(src: Frame<'_>, width: usize, height: usize) -> Vec<f64> {
        let place = |i: usize, from: usize, to: usize| {
            let centre = ((i as f64 + 0.5) * from as f64 / to as f64 - 0.5).clamp(0.0, (from - 1) as f64);
            (centre.floor() as usize, (centre.floor() as usize + 1).min(from - 1), centre.fract())
        };
        let mut out = Vec::new();
        for y in 0..height {
            let (top, bottom, down) = place(y, src.height(), height);
            for x in 0..width {
                let (left, right, across) = place(x, src.width(), width);
                for c in 0..CHANNELS {
                    let at = |x: usize, y: usize| f64::from(src.pixel(x, y)[c]);
                    let upper = at(left, top) * (1.0 - across) + at(right, top) * across;
                    let lower = at(left, bottom) * (1.0 - across) + at(right, bottom) * across;
                    out.push(upper * (1.0 - down) + lower * down);
                }
            }
        }
        out
    }

    proptest! {
        #[test]
        fn matches_linear_interpolation(sample in samples(), width in 1usize..300, height in 1usize..40) {
            let result = run(width, height, |dst| resize_linear(sample.frame(), dst));
            let expected = plain(sample.frame(), width, height);
            for (actual, expected) in result.data().iter().zip(expected) {
                prop_assert!((f64::from(*actual) - expected).abs() < 1.0, "{} {}", actual, expected);
            }
        }
    }

    #[test]
    fn a_constant_frame_stays_constant() {
        for value in [0, 1, 127, 255] {
            let src = FrameBuf::from_vec(vec![value; 7 * 5 * 3], 7, 5).unwrap();
            for (width, height) in [(1, 1), (13, 4), (400, 11)] {
                let mut dst = FrameBuf::new(width, height);
                resize_linear(src.as_ref(), dst.as_mut());
                assert!(dst.data().iter().all(|&v| v == value), "{value} {width}x{height}");
            }
        }
    }
}
