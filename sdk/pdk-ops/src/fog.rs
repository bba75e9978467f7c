//! Fog: a fractal field and a noisy white layer, to be blended with a frame.

use crate::frame::{CHANNELS, Frame, FrameBuf};
use crate::noise::{NORMAL_SCALE, normals};
use crate::simd::vectorised;
use pdk_seed::{Key, Random};

/// A random midpoint lies this far or less above the mean of its neighbours, at every scale.
const ROUGHNESS: f32 = 0.6;

/// A grey fractal field for one frame size and one key at a time.
///
/// The diamond-square method (Fournier, Fussell and Carpenter, "Computer rendering of stochastic models", 1982) on a
/// square with a side of a power of two plus one, that is larger than the frame. Corners are random numbers from 0 to
/// 1; each midpoint is the mean of its three or four neighbours plus a random number from 0 to 0.6. That number does
/// not shrink with the distance, so the field is mostly fine grain. The square is resized to the frame with linear
/// interpolation and normalised to 0..=255, its fraction dropped.
#[derive(Debug, Clone, Default)]
pub struct Field {
    made_for: Option<(usize, usize, Key)>,
    coarse: Vec<f32>,
    fine: Vec<f32>,
    /// The midpoints of squares above and below a row.
    midpoints: [Vec<f32>; 2],
    bytes: Vec<u8>,
    resized: Vec<f32>,
    frame: FrameBuf,
}

impl Field {
    /// The field as a grey frame, drawn from the sequence stream of `key`.
    ///
    /// # Panics
    /// If the width or the height is zero.
    pub fn frame(&mut self, width: usize, height: usize, key: Key) -> Frame<'_> {
        let wanted = Some((width, height, key));
        if self.made_for != wanted {
            let side = self.draw(width.max(height), &mut key.sequence());
            self.fit(side, width, height);
            self.made_for = wanted;
        }
        self.frame.as_ref()
    }

    /// Fills `fine` with a square that has more than `length` elements on a side; returns that number.
    fn draw(&mut self, length: usize, random: &mut Random) -> usize {
        let target = length.next_power_of_two();
        // The grids take turns; the larger buffer has to be the last one's.
        let turns_are_even = target.trailing_zeros().is_multiple_of(2);
        if (self.fine.capacity() >= self.coarse.capacity()) != turns_are_even {
            std::mem::swap(&mut self.coarse, &mut self.fine);
        }
        self.fine.clear();
        self.fine.extend((0..4).map(|_| random.unit() as f32));
        let mut squares = 1;
        while squares < target {
            std::mem::swap(&mut self.coarse, &mut self.fine);
            self.refine(squares, random);
            squares *= 2;
        }
        squares + 1
    }

    /// Halves the distance between the elements of `coarse`, which is a grid of `squares` squares on a side.
    fn refine(&mut self, squares: usize, random: &mut Random) {
        let Self { coarse, fine, midpoints: [above, below], bytes, .. } = self;
        let (side, fine_side) = (squares + 1, 2 * squares + 1);
        fine.resize(fine_side * fine_side, 0.0);
        bytes.resize(2 * side, 0);
        for midpoints in [&mut *above, &mut *below] {
            midpoints.resize(squares, 0.0);
        }
        let row = |y: usize| &coarse[y * side..(y + 1) * side];
        for y in 0..side {
            std::mem::swap(above, below);
            let (first, last) = (y == 0, y == squares);
            if !last {
                random.fill(&mut bytes[..2 * squares]);
                middle_of_squares(row(y), row(y + 1), bytes, below);
            }
            random.fill(&mut bytes[..2 * squares]);
            let (top, bottom) = (if first { &*below } else { &*above }, if last { &*above } else { &*below });
            // At the edges there is one square only; counted twice with half the weight it makes the mean of three.
            let weights = if first || last { [1.0 / 3.0, 1.0 / 6.0] } else { [0.25, 0.25] };
            let out = &mut fine[2 * y * fine_side..][..fine_side];
            even_row(row(y), top, bottom, bytes, out, weights);
            if !last {
                random.fill(bytes);
                let out = &mut fine[(2 * y + 1) * fine_side..][..fine_side];
                odd_row(row(y), row(y + 1), below, bytes, out);
            }
        }
    }

    /// Resizes `fine`, which has `side` elements on a side, to the frame and normalises it.
    fn fit(&mut self, side: usize, width: usize, height: usize) {
        let Self { coarse, fine, resized, frame, .. } = self;
        frame.resize(width, height);
        resized.resize(width * height, 0.0);
        // A row between two rows; the coarser grid is not needed any more.
        coarse.resize(side.max(coarse.len()), 0.0);
        let place = |i: usize, length: usize| {
            let centre = (i as f64 + 0.5) * side as f64 / length as f64 - 0.5;
            let centre = centre.clamp(0.0, (side - 1) as f64);
            // The second element is there: before the last one the fraction is 0, and it may be any.
            let first = (centre as usize).min(side - 2);
            (first, (centre - first as f64) as f32)
        };
        for (y, out) in resized.chunks_exact_mut(width).enumerate() {
            let (top, fraction) = place(y, height);
            let (upper, lower) = fine[top * side..(top + 2) * side].split_at(side);
            mix(upper, lower, &mut coarse[..side], fraction);
            for (x, out) in out.iter_mut().enumerate() {
                let (left, fraction) = place(x, width);
                *out = coarse[left] + (coarse[left + 1] - coarse[left]) * fraction;
            }
        }
        let (low, high) =
            resized.iter().fold((f32::MAX, f32::MIN), |(low, high), &v| (low.min(v), high.max(v)));
        // Divided first, so that the highest value becomes 1 and then 255 exactly.
        let range = if high > low { high - low } else { 1.0 };
        let mut view = frame.as_mut();
        for (pixel, &value) in view.data_mut().chunks_exact_mut(CHANNELS).zip(&*resized) {
            pixel.fill(((value - low) / range * 255.0) as u8);
        }
    }
}

/// The random part of a midpoint, from two random bytes.
#[inline(always)]
fn draw(bytes: &[u8]) -> f32 {
    f32::from(u16::from_le_bytes([bytes[0], bytes[1]])) * (ROUGHNESS / 65536.0)
}

vectorised! {
    fn middle_of_squares / middle_of_squares_avx2 (
        upper: &[f32], lower: &[f32], bytes: &[u8], out: &mut [f32],
    ) {
        let corners = upper.iter().zip(&upper[1..]).zip(lower.iter().zip(&lower[1..]));
        for ((out, ((a, b), (c, d))), bytes) in out.iter_mut().zip(corners).zip(bytes.chunks_exact(2)) {
            *out = ((a + b) + (c + d)) * 0.25 + draw(bytes);
        }
    }
}

vectorised! {
    // Old elements with new ones in between, whose neighbours are left and right, and in the squares above and below.
    fn even_row / even_row_avx2 (
        row: &[f32], above: &[f32], below: &[f32], bytes: &[u8], out: &mut [f32], weights: [f32; 2],
    ) {
        let neighbours = row.iter().zip(&row[1..]).zip(above.iter().zip(below));
        for ((out, ((left, right), (top, bottom))), bytes) in
            out.chunks_exact_mut(2).zip(neighbours).zip(bytes.chunks_exact(2))
        {
            out[0] = *left;
            out[1] = (left + right) * weights[0] + (top + bottom) * weights[1] + draw(bytes);
        }
        out[out.len() - 1] = row[row.len() - 1];
    }
}

vectorised! {
    // The middles of squares with new elements in between, whose neighbours are above and below, and in the squares to
    // the left and right.
    fn odd_row / odd_row_avx2 (
        upper: &[f32], lower: &[f32], midpoints: &[f32], bytes: &[u8], out: &mut [f32],
    ) {
        let last = midpoints.len();
        let edge = |i: usize, square: f32| (upper[i] + lower[i] + square) * (1.0 / 3.0) + draw(&bytes[2 * i..]);
        (out[0], out[1]) = (edge(0, midpoints[0]), midpoints[0]);
        let squares = midpoints.iter().zip(&midpoints[1..]);
        let neighbours = upper[1..].iter().zip(&lower[1..]).zip(squares);
        for ((out, ((top, bottom), (left, right))), bytes) in
            out[2..].chunks_exact_mut(2).zip(neighbours).zip(bytes[2..].chunks_exact(2))
        {
            out[0] = (top + bottom) * 0.25 + (left + right) * 0.25 + draw(bytes);
            out[1] = *right;
        }
        out[2 * last] = edge(last, midpoints[last - 1]);
    }
}

vectorised! {
    fn mix / mix_avx2 (upper: &[f32], lower: &[f32], out: &mut [f32], fraction: f32) {
        for ((out, upper), lower) in out.iter_mut().zip(upper).zip(lower) {
            *out = upper + (lower - upper) * fraction;
        }
    }
}

/// What becomes of noise that does not fit a byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Overflow {
    /// It is taken modulo 256, so that a little less than 0 is bright.
    Wraps,
    /// It becomes 0 or 255.
    Clips,
}

/// A white layer with grain.
#[derive(Debug, Clone, Default)]
pub struct Grain {
    made_for: Option<(f64, Overflow)>,
    /// The layer's value for each random number.
    table: Vec<u8>,
    bytes: Vec<u8>,
    frame: FrameBuf,
}

impl Grain {
    /// `share` of normal noise with a standard deviation of `share` times 255, its fraction dropped, in `1 - share` of
    /// white; drawn for each value by itself. The share is clipped to 0..=1.
    ///
    /// # Panics
    /// If the width or the height is zero.
    pub fn frame(
        &mut self,
        width: usize,
        height: usize,
        share: f64,
        overflow: Overflow,
        random: &mut Random,
    ) -> Frame<'_> {
        let share = share.clamp(0.0, 1.0);
        if self.made_for != Some((share, overflow)) {
            self.made_for = Some((share, overflow));
            self.table.clear();
            self.table.extend(normals().map(|normal| {
                let noise = (f32::from(normal) * NORMAL_SCALE * (share * 255.0) as f32) as i32;
                let noise = match overflow {
                    Overflow::Wraps => noise as u8,
                    Overflow::Clips => noise.clamp(0, 255) as u8,
                };
                (255.0 * (1.0 - share) as f32 + f32::from(noise) * share as f32).round_ties_even() as u8
            }));
        }
        self.frame.resize(width, height);
        self.bytes.resize(2 * width * CHANNELS, 0);
        for row in self.frame.as_mut().rows_mut() {
            random.fill(&mut self.bytes);
            for (value, pair) in row.iter_mut().zip(self.bytes.chunks_exact(2)) {
                *value = self.table[usize::from(u16::from_le_bytes([pair[0], pair[1]]))];
            }
        }
        self.frame.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::with_each;

    /// The square in one array, midpoint by midpoint, with the draws in the order of `refine`.
    fn plain_square(squares: usize, random: &mut Random) -> Vec<Vec<f64>> {
        let side = squares + 1;
        let mut square = vec![vec![0.0; side]; side];
        for (y, x) in [(0, 0), (0, squares), (squares, 0), (squares, squares)] {
            square[y][x] = random.unit();
        }
        let mut step = squares;
        while step > 1 {
            let half = step / 2;
            let number = |bytes: &[u8], i: usize| f64::from(draw(&bytes[2 * i..]));
            let mut bytes = vec![0; 2 * side];
            let mut middles = vec![vec![]; squares / step];
            let mut evens = vec![vec![]; squares / step + 1];
            let mut odds = middles.clone();
            for y in 0..=squares / step {
                if y < squares / step {
                    random.fill(&mut bytes[..2 * (squares / step)]);
                    middles[y] = (0..squares / step).map(|i| number(&bytes, i)).collect();
                }
                random.fill(&mut bytes[..2 * (squares / step)]);
                evens[y] = (0..squares / step).map(|i| number(&bytes, i)).collect();
                if y < squares / step {
                    random.fill(&mut bytes[..2 * (squares / step + 1)]);
                    odds[y] = (0..=squares / step).map(|i| number(&bytes, i)).collect();
                }
            }
            for (i, y) in (half..side).step_by(step).enumerate() {
                for (j, x) in (half..side).step_by(step).enumerate() {
                    let corners = square[y - half][x - half]
                        + square[y - half][x + half]
                        + square[y + half][x - half]
                        + square[y + half][x + half];
                    square[y][x] = corners / 4.0 + middles[i][j];
                }
            }
            for y in (0..side).step_by(half) {
                let even = (y / half).is_multiple_of(2);
                for x in ((if even { half } else { 0 })..side).step_by(step) {
                    let mut neighbours = vec![];
                    for (dy, dx) in [(0, -1), (0, 1), (-1, 0), (1, 0)] {
                        let (v, u) = (y as i64 + dy * half as i64, x as i64 + dx * half as i64);
                        if (0..side as i64).contains(&v) && (0..side as i64).contains(&u) {
                            neighbours.push(square[v as usize][u as usize]);
                        }
                    }
                    let mean = neighbours.iter().sum::<f64>() / neighbours.len() as f64;
                    square[y][x] =
                        mean + if even { evens[y / step][x / step] } else { odds[y / step][x / step] };
                }
            }
            step = half;
        }
        square
    }

    #[test]
    fn the_square_matches_the_plain_version() {
        for length in [1, 2, 3, 9, 60] {
            with_each(|instructions| {
                let mut field = Field::default();
                let side = field.draw(length, &mut Key([4; 32]).sequence());
                assert!(side > length && (side - 1).is_power_of_two());
                let expected = plain_square(side - 1, &mut Key([4; 32]).sequence());
                for (actual, expected) in field.fine.iter().zip(expected.iter().flatten()) {
                    assert!(
                        (f64::from(*actual) - expected).abs() < 1e-4,
                        "{length}, {instructions:?}: {actual} {expected}"
                    );
                }
            });
        }
    }

    #[test]
    fn the_field_covers_all_greys_and_depends_on_size_and_key_alone() {
        let mut kept = Field::default();
        for (width, height, key) in
            [(320, 240, 1), (33, 90, 1), (320, 240, 1), (320, 240, 2), (1, 1, 1), (2, 1, 1)]
        {
            let key = Key([key; 32]);
            let fresh = Field::default().frame(width, height, key).to_buf();
            assert_eq!(kept.frame(width, height, key), fresh.as_ref());
            with_each(|_| assert_eq!(Field::default().frame(width, height, key), fresh.as_ref()));
            assert!(fresh.data().chunks(3).all(|pixel| pixel[0] == pixel[1] && pixel[0] == pixel[2]));
            if width > 1 {
                let greys = || fresh.data().iter();
                assert_eq!((greys().min(), greys().max()), (Some(&0), Some(&255)));
            }
        }
        let one = kept.frame(320, 240, Key([1; 32])).to_buf();
        assert_ne!(one, kept.frame(320, 240, Key([2; 32])).to_buf());
    }

    #[test]
    fn grain_wraps_or_clips() {
        let mut grain = Grain::default();
        // The layer's values are between 255 * (1 - share) for noise of 0 and 255 for noise of 255.
        for (overflow, dark) in [(Overflow::Wraps, 0.0), (Overflow::Clips, 0.5)] {
            let frame = grain.frame(100, 100, 0.4, overflow, &mut Key([1; 32]).frame(0)).to_buf();
            assert!(frame.data().iter().all(|&v| v >= 153));
            let darkest = frame.data().iter().filter(|&&v| v == 153).count() as f64 / 30_000.0;
            assert!((darkest - dark).abs() < 0.02, "{overflow:?}: {darkest}");
        }
        let white = grain.frame(5, 4, 0.0, Overflow::Wraps, &mut Key([1; 32]).frame(0));
        assert!(white.data().iter().all(|&v| v == 255));
    }

    #[test]
    fn the_same_field_and_grain_on_every_machine() {
        let mut field = Field::default();
        let row = field.frame(12, 8, Key([1; 32])).row(3).iter().step_by(3).copied().collect::<Vec<_>>();
        let mut grain = Grain::default();
        let values = grain.frame(4, 1, 0.4, Overflow::Wraps, &mut Key([1; 32]).frame(0)).row(0).to_vec();
        assert_eq!(row, [220, 243, 241, 243, 205, 164, 155, 164, 202, 171, 222, 190]);
        assert_eq!(values, [248, 196, 181, 234, 216, 247, 220, 219, 255, 217, 253, 173]);
    }
}
