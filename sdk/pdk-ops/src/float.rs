//! Filters of images of floating-point numbers, for results that have to be finer than 8 bits.
//!
//! Each result is a sum of products in a fixed order, and none is fused, so every machine computes the same numbers.

use crate::border::reflect;
use crate::frame::{Frame, FrameMut};
use crate::point::truncated;
use crate::simd::vectorised;

/// What lies beyond the edges of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edge {
    /// The nearest pixel: `aaa|abcd|ddd`.
    Nearest,
    /// The image mirrored with its last pixel: `cba|abcd|dcb`.
    Symmetric,
    /// The image mirrored without its last pixel: `dcb|abcd|cba`.
    Mirrored,
}

impl Edge {
    /// The place in a row of `length` pixels that stands for a place outside of it.
    #[inline]
    pub fn place(self, index: isize, length: usize) -> usize {
        match self {
            Self::Nearest => index.clamp(0, length as isize - 1) as usize,
            Self::Mirrored => reflect(index, length),
            Self::Symmetric => {
                let place = index.rem_euclid(2 * length as isize) as usize;
                if place < length { place } else { 2 * length - 1 - place }
            }
        }
    }
}

/// An image: `channels` numbers for each pixel, row by row.
#[derive(Debug, Clone, Default)]
pub struct Image {
    /// The numbers.
    pub values: Vec<f32>,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Numbers for each pixel.
    pub channels: usize,
}

impl Image {
    /// Makes it an image of this size. What it holds is left over from before.
    pub fn resize(&mut self, width: usize, height: usize, channels: usize) {
        (self.width, self.height, self.channels) = (width, height, channels);
        self.values.resize(width * height * channels, 0.0);
    }

    /// Makes it a frame, with values from 0 to 255.
    pub fn read(&mut self, src: Frame<'_>) {
        self.resize(src.width(), src.height(), crate::frame::CHANNELS);
        for (row, to) in src.rows().zip(self.values.chunks_exact_mut(src.width() * crate::frame::CHANNELS)) {
            widen(row, to);
        }
    }

    /// Writes it to a frame of the same size: clipped to 0 to 255, the fraction dropped.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn write(&self, mut dst: FrameMut<'_>) {
        let line = self.width * self.channels;
        assert!(
            (dst.width(), dst.height(), crate::frame::CHANNELS) == (self.width, self.height, self.channels),
            "an image is written to a frame of another size"
        );
        for (row, from) in dst.rows_mut().zip(self.values.chunks_exact(line)) {
            drop_fractions(from, row);
        }
    }

    /// The numbers of a row.
    pub fn row(&self, y: usize) -> &[f32] {
        let line = self.width * self.channels;
        &self.values[y * line..][..line]
    }
}

/// What the filters keep between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    between: Vec<f32>,
    padded: Vec<f32>,
    /// Where the values begin that are added up, in the order of their distance from the first one.
    starts: Vec<usize>,
    /// Where values begin, and their weight.
    weighted: Vec<(usize, f32)>,
}

/// The weights of a Gaussian at the distances 0 to `radius`; with those on the other side they sum to 1.
pub fn gaussian(sigma: f64, radius: usize) -> Vec<f32> {
    let density = |x: usize| libm::exp(-0.5 / (sigma * sigma) * (x * x) as f64);
    let total = 1.0 + 2.0 * (1..=radius).map(density).sum::<f64>();
    (0..=radius).map(|x| (density(x) / total) as f32).collect()
}

/// Correlates with a symmetric kernel in each direction; `down` and `right` are its weights from the middle on.
pub fn separable(image: &mut Image, down: &[f32], right: &[f32], edge: Edge, workspace: &mut Workspace) {
    let Image { width, height, channels, .. } = *image;
    let line = width * channels;
    let Workspace { between, padded, starts, .. } = workspace;
    between.resize(line * height, 0.0);
    let reach = down.len() - 1;
    let rows = -(reach as isize)..(height + reach) as isize;
    for first in (0..line).step_by(STRIP) {
        let strip = first..(first + STRIP).min(line);
        starts.clear();
        starts.extend(rows.clone().map(|y| edge.place(y, height) * line + first));
        for (around, sum) in starts.windows(2 * reach + 1).zip(between.chunks_exact_mut(line)) {
            let sum = &mut sum[strip.clone()];
            sum.fill(0.0);
            add_around(&image.values, around, down, sum);
        }
    }
    let reach = right.len() - 1;
    padded.resize((width + 2 * reach) * channels, 0.0);
    starts.clear();
    starts.extend((0..=2 * reach).map(|pixel| pixel * channels));
    for (from, sum) in between.chunks_exact(line).zip(image.values.chunks_exact_mut(line)) {
        padded[reach * channels..][..line].copy_from_slice(from);
        pad(padded, width, channels, reach, edge);
        sum.fill(0.0);
        add_around(padded, starts, right, sum);
    }
}

/// Correlates with a kernel that is symmetric in both directions; `quadrant` has its weights from the middle on, row by row
/// of the same length.
pub fn symmetric(
    image: &Image,
    quadrant: &[Vec<f32>],
    edge: Edge,
    into: &mut Image,
    workspace: &mut Workspace,
) {
    let Image { width, height, channels, .. } = *image;
    let line = width * channels;
    into.resize(width, height, channels);
    let Workspace { padded, starts, .. } = workspace;
    for (y, total) in into.values.chunks_exact_mut(line).enumerate() {
        total.fill(0.0);
        for (distance, weights) in quadrant.iter().enumerate() {
            // Weights of 0 add nothing, and kernels are often wider than what is not 0 in them.
            let Some(reach) = weights.iter().rposition(|weight| *weight != 0.0) else { continue };
            let at = |moved: isize| image.row(edge.place(y as isize + moved, height));
            padded.resize((width + 2 * reach) * channels, 0.0);
            let row = &mut padded[reach * channels..][..line];
            match distance as isize {
                0 => row.copy_from_slice(at(0)),
                distance => add_rows(at(distance), at(-distance), row),
            }
            pad(padded, width, channels, reach, edge);
            starts.clear();
            starts.extend((0..=2 * reach).map(|pixel| pixel * channels));
            add_around(padded, starts, &weights[..=reach], total);
        }
    }
}

/// The weighted sum of copies of the image that are moved by this many pixels right and down, their edges repeated.
pub fn moved(image: &Image, copies: &[([isize; 2], f32)], into: &mut Image, workspace: &mut Workspace) {
    let Image { width, height, channels, .. } = *image;
    let line = width * channels;
    into.resize(width, height, channels);
    let furthest = copies.iter().map(|([right, _], _)| right.unsigned_abs()).max().unwrap_or_default();
    let stride = line + 2 * furthest * channels;
    let Workspace { between, weighted, .. } = workspace;
    between.resize(stride * height, 0.0);
    for (y, to) in between.chunks_exact_mut(stride).enumerate() {
        to[furthest * channels..][..line].copy_from_slice(image.row(y));
        pad(to, width, channels, furthest, Edge::Nearest);
    }
    for (y, total) in into.values.chunks_exact_mut(line).enumerate() {
        weighted.clear();
        weighted.extend(copies.iter().map(|([right, down], weight)| {
            let row = Edge::Nearest.place(y as isize - down, height);
            (row * stride + (furthest as isize - right) as usize * channels, *weight)
        }));
        weighted_sums(between, weighted, total);
    }
}

/// Fills the `reach` pixels at both ends of a row, which lies between them.
fn pad(padded: &mut [f32], width: usize, channels: usize, reach: usize, edge: Edge) {
    for distance in 1..=reach {
        let left = edge.place(-(distance as isize), width);
        let right = edge.place((width + distance - 1) as isize, width);
        for (to, from) in [(reach - distance, left), (reach + width + distance - 1, right)] {
            let from = (reach + from) * channels;
            padded.copy_within(from..from + channels, to * channels);
        }
    }
}

vectorised! {
    fn widen / widen_avx2 / widen_avx512 (from: &[u8], to: &mut [f32]) {
        for (to, &from) in to.iter_mut().zip(from) {
            *to = f32::from(from);
        }
    }
}

vectorised! {
    fn drop_fractions / drop_fractions_avx2 / drop_fractions_avx512 (from: &[f32], to: &mut [u8]) {
        for (to, &from) in to.iter_mut().zip(from) {
            *to = truncated(from);
        }
    }
}

vectorised! {
    fn add_rows / add_rows_avx2 / add_rows_avx512 (a: &[f32], b: &[f32], to: &mut [f32]) {
        for ((to, &a), &b) in to.iter_mut().zip(a).zip(b) {
            *to = a + b;
        }
    }
}

/// Values whose sums stay in registers while all terms are added: four registers of AVX-512.
const BLOCK: usize = 64;
/// The same for the end of a row.
const SMALL_BLOCK: usize = 8;
/// Columns that are worked on at a time, so that the rows around a row stay in the fastest cache from one row to the next.
const STRIP: usize = 3 * BLOCK;

vectorised! {
    // Adds to sum `i` the value `i` behind the start in the middle times the first weight, then of each pair of starts at the same
    // distance from it the sum of both values times the weight of that distance.
    fn add_around / add_around_avx2 / add_around_avx512 (
        values: &[f32], starts: &[usize], weights: &[f32], sums: &mut [f32],
    ) {
        let done = add_blocks_around::<BLOCK>(values, starts, weights, 0, sums);
        let done = add_blocks_around::<SMALL_BLOCK>(values, starts, weights, done, sums);
        add_blocks_around::<1>(values, starts, weights, done, sums);
    }
}

/// Does so for whole blocks from sum `first` on, and returns where it ends.
#[inline(always)]
fn add_blocks_around<const BLOCK: usize>(
    values: &[f32],
    starts: &[usize],
    weights: &[f32],
    first: usize,
    sums: &mut [f32],
) -> usize {
    let reach = weights.len() - 1;
    let (nearer, further) = (starts[..reach].iter().rev(), &starts[reach + 1..]);
    let mut place = first;
    for block in sums[first..].as_chunks_mut::<BLOCK>().0 {
        let mut sums = *block;
        for (sum, value) in sums.iter_mut().zip(&values[starts[reach] + place..][..BLOCK]) {
            *sum += value * weights[0];
        }
        for ((before, behind), weight) in nearer.clone().zip(further).zip(&weights[1..]) {
            let (before, behind) = (&values[before + place..][..BLOCK], &values[behind + place..][..BLOCK]);
            for ((sum, before), behind) in sums.iter_mut().zip(before).zip(behind) {
                *sum += (before + behind) * weight;
            }
        }
        *block = sums;
        place += BLOCK;
    }
    place
}

vectorised! {
    // Sum `i` becomes that of the values `i` behind each start, times its weight.
    fn weighted_sums / weighted_sums_avx2 / weighted_sums_avx512 (
        values: &[f32], terms: &[(usize, f32)], sums: &mut [f32],
    ) {
        let done = blocks_of_weighted_sums::<BLOCK>(values, terms, 0, sums);
        let done = blocks_of_weighted_sums::<SMALL_BLOCK>(values, terms, done, sums);
        blocks_of_weighted_sums::<1>(values, terms, done, sums);
    }
}

/// Does so for whole blocks from sum `first` on, and returns where it ends.
#[inline(always)]
fn blocks_of_weighted_sums<const BLOCK: usize>(
    values: &[f32],
    terms: &[(usize, f32)],
    first: usize,
    sums: &mut [f32],
) -> usize {
    let mut place = first;
    for block in sums[first..].as_chunks_mut::<BLOCK>().0 {
        let mut sums = [0.0; BLOCK];
        for (start, weight) in terms {
            for (sum, value) in sums.iter_mut().zip(&values[start + place..][..BLOCK]) {
                *sum += value * weight;
            }
        }
        *block = sums;
        place += BLOCK;
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::with_each;
    use pdk_seed::Key;

    fn image(width: usize, height: usize, channels: usize) -> Image {
        let mut random = Key([3; 32]).sequence();
        let values = (0..width * height * channels).map(|_| random.unit() as f32 * 255.0).collect();
        Image { values, width, height, channels }
    }

    fn at(image: &Image, x: isize, y: isize, channel: usize, edge: Edge) -> f64 {
        let (x, y) = (edge.place(x, image.width), edge.place(y, image.height));
        f64::from(image.row(y)[x * image.channels + channel])
    }

    /// The sum of the weights times what lies around each pixel, as it is written in books.
    fn plain(image: &Image, weight: impl Fn(isize, isize) -> f64, reach: isize, edge: Edge) -> Vec<f64> {
        let mut sums = Vec::new();
        for y in 0..image.height as isize {
            for x in 0..image.width as isize {
                for channel in 0..image.channels {
                    let around =
                        (-reach..=reach).flat_map(|down| (-reach..=reach).map(move |right| (right, down)));
                    let term =
                        |(right, down)| weight(right, down) * at(image, x + right, y + down, channel, edge);
                    sums.push(around.map(term).sum());
                }
            }
        }
        sums
    }

    fn close(found: &Image, wanted: &[f64]) {
        assert_eq!(found.values.len(), wanted.len());
        for (found, wanted) in found.values.iter().zip(wanted) {
            assert!((f64::from(*found) - wanted).abs() < 1e-3, "{found} {wanted}");
        }
    }

    const SIZES: [(usize, usize, usize); 5] = [(1, 1, 3), (3, 2, 1), (17, 9, 3), (5, 20, 1), (90, 7, 3)];
    const EDGES: [Edge; 3] = [Edge::Nearest, Edge::Symmetric, Edge::Mirrored];

    #[test]
    fn filters_match_the_plain_version() {
        let weights = gaussian(1.3, 4);
        let one = |distance: isize| f64::from(weights[distance.unsigned_abs()]);
        let quadrant: Vec<Vec<f32>> =
            (0..5).map(|y| (0..5).map(|x| (x + 2 * y) as f32 / 200.0).collect()).collect();
        let both = |right: isize, down: isize| f64::from(quadrant[down.unsigned_abs()][right.unsigned_abs()]);
        let mut workspace = Workspace::default();
        for (width, height, channels) in SIZES {
            for edge in EDGES {
                let before = image(width, height, channels);
                let mut after = before.clone();
                separable(&mut after, &weights, &weights, edge, &mut workspace);
                close(&after, &plain(&before, |right, down| one(right) * one(down), 4, edge));
                symmetric(&before, &quadrant, edge, &mut after, &mut workspace);
                close(&after, &plain(&before, both, 4, edge));
            }
        }
    }

    /// The sums in the order of the definition, one value after the other, without vectors.
    fn plain_around(values: &[f32], starts: &[usize], weights: &[f32], sums: &mut [f32]) {
        let reach = weights.len() - 1;
        for (place, sum) in sums.iter_mut().enumerate() {
            *sum += values[starts[reach] + place] * weights[0];
            for distance in 1..=reach {
                let pair =
                    values[starts[reach - distance] + place] + values[starts[reach + distance] + place];
                *sum += pair * weights[distance];
            }
        }
    }

    #[test]
    fn sums_are_those_of_the_plain_version_bit_for_bit() {
        let values = image(300, 2, 1).values;
        let starts = [0, 290, 7, 300, 3];
        let weights = [0.3, 0.21, 0.07];
        for length in [1, 7, 8, 63, 64, 65, 137, 300] {
            let before: Vec<f32> = (0..length).map(|place| place as f32 * 0.37).collect();
            let terms: Vec<(usize, f32)> = starts.into_iter().zip([0.1, 0.7, -0.3, 1.9, 0.01]).collect();
            let mut around = before.clone();
            plain_around(&values, &starts, &weights, &mut around);
            let term =
                |place: usize| terms.iter().fold(0.0, |sum, (start, w)| sum + values[start + place] * w);
            let weighted: Vec<f32> = (0..length).map(term).collect();
            with_each(|instructions| {
                let mut sums = before.clone();
                add_around(&values, &starts, &weights, &mut sums);
                assert_eq!(sums, around, "{length} with {instructions:?}");
                weighted_sums(&values, &terms, &mut sums);
                assert_eq!(sums, weighted, "{length} with {instructions:?}");
            });
        }
    }

    #[test]
    fn copies_are_moved_and_their_edges_repeated() {
        let copies = [([0, 0], 0.5), ([2, -1], 0.3), ([-7, 3], 0.2)];
        let mut workspace = Workspace::default();
        for (width, height, channels) in SIZES {
            let before = image(width, height, channels);
            let mut after = Image::default();
            moved(&before, &copies, &mut after, &mut workspace);
            let weight = |right: isize, down: isize| {
                copies
                    .iter()
                    .filter(|(by, _)| *by == [-right, -down])
                    .map(|(_, w)| f64::from(*w))
                    .sum::<f64>()
            };
            close(&after, &plain(&before, weight, 7, Edge::Nearest));
        }
    }

    #[test]
    fn weights_of_a_gaussian_sum_to_one() {
        for (sigma, radius) in [(0.7, 3), (6.0, 24)] {
            let weights = gaussian(sigma, radius);
            assert!((f64::from(weights[0] + 2.0 * weights[1..].iter().sum::<f32>()) - 1.0).abs() < 1e-6);
        }
    }
}
