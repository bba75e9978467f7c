//! Resizing with linear interpolation.

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::halve::halve_rows;
use crate::simd::vectorised;
#[cfg(target_arch = "x86_64")]
use crate::simd::{Instructions, instructions};

/// Interpolation weights are fixed-point numbers with this many fractional bits.
const WEIGHT_BITS: u32 = 11;
/// Rows that are interpolated horizontally keep this many fractional bits.
const ROW_BITS: u32 = 7;
/// Columns are done in blocks of this many pixels, so that what belongs to a column stays on the stack.
const BLOCK: usize = 512;
/// Groups of pixels are written with stores that reach a little further.
const SLACK: usize = 4;

/// An image that is there row by row, such as a part of another or several put together.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// Width in pixels, at least 1.
    pub width: usize,
    /// Height in pixels, at least 1.
    pub height: usize,
    /// The bytes of a row, red, green and blue of one pixel after the other.
    pub row: &'a dyn Fn(usize) -> &'a [u8],
}

/// Where an output position lies between two input positions.
#[derive(Clone, Copy, Default)]
struct Tap {
    /// The first of the two; the second is the next one, or the same if there is only one.
    first: usize,
    weights: [u16; 2],
}

impl Tap {
    /// Pixel centres coincide at the edges of both images; beyond the outermost centres the edge is repeated. `scale` is
    /// `from` divided by the length of the output.
    fn at(position: usize, from: usize, scale: f64) -> Self {
        let centre = ((position as f64 + 0.5) * scale - 0.5).clamp(0.0, (from - 1) as f64);
        let first = (centre as usize).min(from.saturating_sub(2));
        let fraction = centre - first as f64;
        let one = f64::from(1 << WEIGHT_BITS);
        let weight = |share: f64| (share * one).round_ties_even() as u16;
        Self { first, weights: [weight(1.0 - fraction), weight(fraction)] }
    }
}

/// The taps of a block of columns.
struct Columns {
    /// Where the first of a tap's two pixels starts in a row, in bytes, growing from left to right.
    places: [u32; BLOCK],
    weights: [[u16; 2]; BLOCK],
    len: usize,
    fours: [Four; BLOCK / 4],
    /// How many groups of four taps, from the left, can be done at a time.
    groups: usize,
    /// Whether the output is as wide as the input.
    same: bool,
}

/// Four neighbouring taps, arranged for two registers that hold 16 bytes from the first and 16 from the third on.
#[derive(Clone, Copy, Default)]
struct Four {
    /// Where the second and the fourth tap start within these bytes, 16 times each.
    starts: [[u8; 16]; 2],
    /// The weights of the first and the third tap, then those of the second and the fourth, four times each.
    weights: [[[[u16; 2]; 4]; 2]; 2],
}

/// As many bytes are read at a time.
const READ: usize = 16;

impl Columns {
    /// Computes the taps of the columns from `start` on, as many as there are up to `width`.
    fn set(&mut self, start: usize, width: usize, from: usize) {
        self.same = from == width;
        self.len = BLOCK.min(width - start);
        let scale = from as f64 / width as f64;
        for i in 0..self.len {
            let tap = Tap::at(start + i, from, scale);
            self.places[i] = (tap.first * CHANNELS) as u32;
            self.weights[i] = tap.weights;
        }
        self.groups = 0;
        let fours = self.places[..self.len].chunks_exact(4).zip(self.weights.chunks_exact(4));
        for ((places, weights), four) in fours.zip(&mut self.fours) {
            let [a, b, c, d] = [places[0], places[1], places[2], places[3]].map(|place| place as usize);
            let near = (b - a).max(d - c) + 2 * CHANNELS <= READ;
            if !near || c + READ > from * CHANNELS {
                break;
            }
            four.starts = [[(b - a) as u8; 16], [(d - c) as u8; 16]];
            four.weights = [[[weights[0]; 4], [weights[2]; 4]], [[weights[1]; 4], [weights[3]; 4]]];
            self.groups += 1;
        }
    }
}

/// Resizes `src` to the size of `dst` with linear interpolation between the two nearest pixels in each direction.
/// Shrinking does not average, so fine patterns alias. Each interpolation has 11-bit weights.
pub fn resize_linear(src: Frame<'_>, mut dst: FrameMut<'_>) {
    if src.same_size(&dst.as_ref()) {
        return dst.copy_from(src);
    }
    resize_linear_from(Source { width: src.width(), height: src.height(), row: &|y| src.row(y) }, dst);
}

/// As [`resize_linear`], from an image that is there row by row.
///
/// # Panics
/// If the source has no pixels or its rows are too short.
pub fn resize_linear_from(src: Source<'_>, mut dst: FrameMut<'_>) {
    assert!(src.width > 0 && src.height > 0, "resizing needs an image");
    let (width, height) = (dst.width(), dst.height());
    if (src.width, src.height) == (2 * width, 2 * height) {
        // Every output pixel lies in the middle of four.
        let row = |y: usize| &(src.row)(y)[..src.width * CHANNELS];
        return (0..height).for_each(|y| halve_rows(row(2 * y), row(2 * y + 1), dst.row_mut(y)));
    }
    let scale = src.height as f64 / height as f64;
    let mut columns = Columns {
        places: [0; BLOCK],
        weights: [[0; 2]; BLOCK],
        len: 0,
        fours: [Four::default(); BLOCK / 4],
        groups: 0,
        same: false,
    };
    // The two source rows that an output row lies between, interpolated horizontally, with their row numbers.
    let mut rows = [[0u16; BLOCK * CHANNELS + SLACK]; 2];
    let [mut first, mut second] = rows.each_mut();
    for start in (0..width).step_by(BLOCK) {
        columns.set(start, width, src.width);
        let values = columns.len * CHANNELS;
        let mut held = [usize::MAX; 2];
        for y in 0..height {
            let tap = Tap::at(y, src.height, scale);
            let wanted = [tap.first, (tap.first + 1).min(src.height - 1)];
            if held[0] != wanted[0] && held[1] == wanted[0] {
                std::mem::swap(&mut first, &mut second);
                held.swap(0, 1);
            }
            for (slot, into) in [&mut *first, &mut *second].into_iter().enumerate() {
                if held[slot] != wanted[slot] && tap.weights[slot] > 0 {
                    let row = &(src.row)(wanted[slot])[..src.width * CHANNELS];
                    match columns.same {
                        true => widen(&row[start * CHANNELS..][..values], into),
                        false => interpolate_row(row, &columns, into),
                    }
                    held[slot] = wanted[slot];
                }
            }
            let out = &mut dst.row_mut(y)[start * CHANNELS..][..values];
            mix(first, second, out, tap.weights);
        }
    }
}

vectorised! {
    fn widen / widen_avx2 / widen_avx512 (row: &[u8], into: &mut [u16]) {
        for (into, &value) in into.iter_mut().zip(row) {
            *into = u16::from(value) << ROW_BITS;
        }
    }
}

vectorised! {
    fn mix / mix_avx2 / mix_avx512 (a: &[u16], b: &[u16], out: &mut [u8], weights: [u16; 2]) {
        let share = |value: u16, weight: u16| ((u32::from(value) * u32::from(weight)) >> 16) as u16;
        for ((out, &a), &b) in out.iter_mut().zip(a).zip(b) {
            *out = ((share(a, weights[0]) + share(b, weights[1]) + 2) >> 2) as u8;
        }
    }
}

/// Interpolates one row at each tap; the results are larger by 2^7.
fn interpolate_row(row: &[u8], columns: &Columns, into: &mut [u16; BLOCK * CHANNELS + SLACK]) {
    #[cfg(target_arch = "x86_64")]
    let done = match instructions() >= Instructions::Avx2 {
        // SAFETY: the processor has AVX2, and the row is as long as the one that the groups were counted for.
        true => unsafe { interpolate_row_avx2(row, columns, into) },
        false => 0,
    };
    #[cfg(not(target_arch = "x86_64"))]
    let done = 0;
    let next = if row.len() > CHANNELS { CHANNELS } else { 0 };
    let taps = columns.places[..columns.len].iter().zip(&columns.weights).skip(done);
    for ((&place, weights), into) in taps.zip(into[done * CHANNELS..].chunks_exact_mut(CHANNELS)) {
        let pair = &row[place as usize..][..CHANNELS + next];
        let [first, second] = weights.map(u32::from);
        for (channel, into) in into.iter_mut().enumerate() {
            let sum = u32::from(pair[channel]) * first + u32::from(pair[channel + next]) * second;
            *into = (sum >> (WEIGHT_BITS - ROW_BITS)) as u16;
        }
    }
}

/// Does four taps at a time and returns how many it did.
///
/// # Safety
/// `row` has the width that `columns` was set for.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn interpolate_row_avx2(
    row: &[u8],
    columns: &Columns,
    into: &mut [u16; BLOCK * CHANNELS + SLACK],
) -> usize {
    use std::arch::x86_64::*;
    // The first pixel's red and the second's, as words, then green and blue. Adding a start to the others leaves them
    // negative, and so zero.
    let pairs = _mm256_broadcastsi128_si256(_mm_setr_epi8(
        0, -128, 3, -128, 1, -128, 4, -128, 2, -128, 5, -128, -128, -128, -128, -128,
    ));
    // From r g b 0 r g b 0 to r g b r g b, in words.
    let in_threes =
        _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 13, -1, -1, -1, -1));
    let fours = columns.fours[..columns.groups].iter().zip(columns.places.chunks_exact(4));
    for ((four, places), out) in fours.zip(into.chunks_exact_mut(4 * CHANNELS)) {
        // SAFETY: a group was counted only where 16 bytes follow its third place, which is not before its first.
        let bytes = unsafe {
            let at = |place: u32| _mm_loadu_si128(row.as_ptr().add(place as usize).cast());
            _mm256_setr_m128i(at(places[0]), at(places[2]))
        };
        // SAFETY: each of the arrays has 32 bytes.
        let [starts, even, odd] = unsafe {
            [four.starts.as_ptr().cast(), four.weights[0].as_ptr().cast(), four.weights[1].as_ptr().cast()]
                .map(|array: *const __m256i| _mm256_loadu_si256(array))
        };
        let sums = |which: __m256i, weights: __m256i| {
            let sums = _mm256_madd_epi16(_mm256_shuffle_epi8(bytes, which), weights);
            _mm256_srli_epi32::<{ (WEIGHT_BITS - ROW_BITS) as i32 }>(sums)
        };
        let pixels = _mm256_packus_epi32(sums(pairs, even), sums(_mm256_add_epi8(pairs, starts), odd));
        let pixels = _mm256_shuffle_epi8(pixels, in_threes);
        let out = out.as_mut_ptr();
        // SAFETY: there are 12 numbers and, after the last group, SLACK more; these write 6 and 8.
        unsafe {
            _mm_storeu_si128(out.cast(), _mm256_castsi256_si128(pixels));
            _mm_storeu_si128(out.add(6).cast(), _mm256_extracti128_si256::<1>(pixels));
        }
    }
    columns.groups * 4
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
    fn widths_beyond_a_block_match_linear_interpolation() {
        let src =
            FrameBuf::from_vec((0..700 * 3 * 3).map(|i| (i * 97 % 256) as u8).collect(), 700, 3).unwrap();
        for (width, height) in [(1100, 5), (699, 2), (1400, 3)] {
            let result = run(width, height, |dst| resize_linear(src.as_ref(), dst));
            let expected = plain(src.as_ref(), width, height);
            for (actual, expected) in result.data().iter().zip(expected) {
                assert!((f64::from(*actual) - expected).abs() < 1.0, "{actual} {expected}");
            }
        }
    }

    #[test]
    fn half_the_size_is_what_the_weights_give() {
        // The weights of the general way are 1024 of 2048 there, with 7 bits kept in between.
        for [a, b, c, d] in
            [[0, 0, 0, 1], [0, 1, 1, 0], [255, 255, 255, 254], [3, 200, 17, 90], [1, 1, 1, 0], [255; 4]]
        {
            let share = |t: u32| (t * 1024) >> 16;
            let across =
                |a: u8, b: u8| (u32::from(a) * 1024 + u32::from(b) * 1024) >> (WEIGHT_BITS - ROW_BITS);
            let expected = ((share(across(a, b)) + share(across(c, d)) + 2) >> 2) as u8;
            let src = FrameBuf::from_vec([[a; 3], [b; 3], [c; 3], [d; 3]].concat(), 2, 2).unwrap();
            assert_eq!(run(1, 1, |dst| resize_linear(src.as_ref(), dst)).data(), [expected; 3]);
        }
    }

    #[test]
    fn rows_may_come_from_anywhere() {
        let src = FrameBuf::from_vec((0..9 * 6 * 3).map(|i| (i * 41 % 256) as u8).collect(), 9, 6).unwrap();
        let twice = FrameBuf::from_vec([src.data(), src.data()].concat(), 9, 12).unwrap();
        let view = src.as_ref();
        for (width, height) in [(9, 6), (9, 12), (5, 17), (20, 3)] {
            let row = |y: usize| view.row(y % 6);
            let result = run(width, height, |dst| {
                resize_linear_from(Source { width: 9, height: 12, row: &row }, dst);
            });
            let mut expected = FrameBuf::new(width, height);
            resize_linear(twice.as_ref(), expected.as_mut());
            assert_eq!(result, expected, "{width}x{height}");
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
