//! Filters of images of floating-point numbers, for results that have to be finer than 8 bits.
//!
//! Each result is a sum of products in a fixed order, and none is fused, so every machine computes the same numbers.

mod rows;
mod sums;

use crate::border::reflect;
use crate::frame::{Frame, FrameMut};
use crate::point::drop_fractions;
use crate::simd::vectorised;
use rows::{Frames, Images, Rows};
use sums::{BLOCK, add_around, weighted_sums};

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

    /// The numbers of a row, to be written.
    fn row_mut(&mut self, y: usize) -> &mut [f32] {
        let line = self.width * self.channels;
        &mut self.values[y * line..][..line]
    }

    /// The numbers of a row.
    pub fn row(&self, y: usize) -> &[f32] {
        let line = self.width * self.channels;
        &self.values[y * line..][..line]
    }
}

/// A copy of an image: how far it is moved right and down, and its weight.
pub type Moved = ([isize; 2], f32);

/// What the filters keep between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    /// Rows of the image: those around the ones that are computed.
    ring: Vec<f32>,
    between: Vec<f32>,
    padded: Vec<f32>,
    sums: Vec<f32>,
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
    correlate(image, down, right, edge, workspace);
}

/// As [`separable`], from one frame to another, with values from 0 to 255. The results are clipped to them, and their fractions dropped.
///
/// # Panics
/// If the sizes of the frames differ.
pub fn separable_frame(
    src: Frame<'_>,
    dst: FrameMut<'_>,
    down: &[f32],
    right: &[f32],
    edge: Edge,
    workspace: &mut Workspace,
) {
    assert!(src.same_size(&dst.as_ref()), "a filter between frames of different size");
    correlate(Frames { src, dst }, down, right, edge, workspace);
}

/// Columns that are worked on at a time, so that the rows around a row stay in the fastest cache from one row to the next.
const STRIP: usize = 3 * BLOCK;
/// Numbers in the widest vector. Those that begin at a multiple of it are read in one piece.
const ALIGNMENT: usize = 16;
/// Rows that are computed together. What they need, and what is between both directions, stays in the second cache.
const BAND: usize = 16;

fn correlate(mut rows: impl Rows, down: &[f32], right: &[f32], edge: Edge, workspace: &mut Workspace) {
    let [width, height, channels] = rows.size();
    let line = width * channels;
    let (reach_down, reach) = (down.len() - 1, right.len() - 1);
    let stride = line + 2 * reach * channels;
    let slots = (BAND + 2 * reach_down).min(height);
    let Workspace { ring, between, sums, starts, .. } = workspace;
    ring.resize(slots * line + ALIGNMENT, 0.0);
    let aligned = ring.as_ptr().align_offset(ALIGNMENT * size_of::<f32>()).min(ALIGNMENT);
    let ring = &mut ring[aligned..];
    between.resize(BAND * stride, 0.0);
    sums.resize(line, 0.0);
    let mut read = 0;
    for top in (0..height).step_by(BAND) {
        let band = top..(top + BAND).min(height);
        while read < (band.end + reach_down).min(height) {
            rows.read(read, &mut ring[read % slots * line..][..line]);
            read += 1;
        }
        let around = band.start as isize - reach_down as isize..(band.end + reach_down) as isize;
        for first in (0..line).step_by(STRIP) {
            let strip = first..(first + STRIP).min(line);
            starts.clear();
            starts.extend(around.clone().map(|y| edge.place(y, height) % slots * line + first));
            for (around, padded) in starts.windows(2 * reach_down + 1).zip(between.chunks_exact_mut(stride)) {
                let sums = &mut padded[reach * channels..][strip.clone()];
                sums.fill(0.0);
                add_around(ring, around, down, sums);
            }
        }
        starts.clear();
        starts.extend((0..=2 * reach).map(|pixel| pixel * channels));
        for (y, padded) in band.zip(between.chunks_exact_mut(stride)) {
            pad(padded, width, channels, reach, edge);
            sums.fill(0.0);
            add_around(padded, starts, right, sums);
            rows.write(y, sums);
        }
    }
}

/// Correlates with a kernel that is symmetric in both directions; `quadrant` has its weights from the middle on, row by row
/// of the same length. Values are from 0 to 255; the results are clipped to them, and their fractions dropped.
///
/// # Panics
/// If the sizes of the frames differ.
pub fn symmetric(
    src: Frame<'_>,
    mut dst: FrameMut<'_>,
    quadrant: &[Vec<f32>],
    edge: Edge,
    workspace: &mut Workspace,
) {
    assert!(src.same_size(&dst.as_ref()), "a filter between frames of different size");
    let (width, height, channels) = (src.width(), src.height(), crate::frame::CHANNELS);
    let line = width * channels;
    let Workspace { padded, sums, starts, .. } = workspace;
    sums.resize(line, 0.0);
    for (y, to) in dst.rows_mut().enumerate() {
        sums.fill(0.0);
        for (distance, weights) in quadrant.iter().enumerate() {
            // Weights of 0 add nothing, and kernels are often wider than what is not 0 in them.
            let Some(reach) = weights.iter().rposition(|weight| *weight != 0.0) else { continue };
            let at = |moved: isize| src.row(edge.place(y as isize + moved, height));
            padded.resize((width + 2 * reach) * channels, 0.0);
            let row = &mut padded[reach * channels..][..line];
            match distance as isize {
                0 => widen(at(0), row),
                distance => add_rows(at(distance), at(-distance), row),
            }
            pad(padded, width, channels, reach, edge);
            starts.clear();
            starts.extend((0..=2 * reach).map(|pixel| pixel * channels));
            add_around(padded, starts, &weights[..=reach], sums);
        }
        drop_fractions(sums, to);
    }
}

/// The weighted sum of copies of the image that are moved by this many pixels right and down, their edges repeated.
pub fn moved(image: &Image, copies: &[Moved], into: &mut Image, workspace: &mut Workspace) {
    into.resize(image.width, image.height, image.channels);
    add_moved(Images { from: image, into }, copies, workspace);
}

/// As [`moved`], from one frame to another, with values from 0 to 255. The results are clipped to them, and their fractions dropped.
///
/// # Panics
/// If the sizes of the frames differ.
pub fn moved_frame(src: Frame<'_>, dst: FrameMut<'_>, copies: &[Moved], workspace: &mut Workspace) {
    assert!(src.same_size(&dst.as_ref()), "a filter between frames of different size");
    add_moved(Frames { src, dst }, copies, workspace);
}

fn add_moved(mut rows: impl Rows, copies: &[Moved], workspace: &mut Workspace) {
    let [width, height, channels] = rows.size();
    let line = width * channels;
    let furthest = copies.iter().map(|([right, _], _)| right.unsigned_abs()).max().unwrap_or_default();
    let stride = line + 2 * furthest * channels;
    let Workspace { between, weighted, sums, .. } = workspace;
    between.resize(stride * height, 0.0);
    sums.resize(line, 0.0);
    for (y, to) in between.chunks_exact_mut(stride).enumerate() {
        rows.read(y, &mut to[furthest * channels..][..line]);
        pad(to, width, channels, furthest, Edge::Nearest);
    }
    for y in 0..height {
        weighted.clear();
        weighted.extend(copies.iter().map(|([right, down], weight)| {
            let row = Edge::Nearest.place(y as isize - down, height);
            (row * stride + (furthest as isize - right) as usize * channels, *weight)
        }));
        weighted_sums(between, weighted, sums);
        rows.write(y, sums);
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
    fn add_rows / add_rows_avx2 / add_rows_avx512 (a: &[u8], b: &[u8], to: &mut [f32]) {
        for ((to, &a), &b) in to.iter_mut().zip(a).zip(b) {
            *to = f32::from(u16::from(a) + u16::from(b));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FrameBuf;
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

    const SIZES: [(usize, usize, usize); 5] = [(1, 1, 3), (3, 2, 1), (17, 9, 3), (5, 70, 1), (90, 7, 3)];
    const EDGES: [Edge; 3] = [Edge::Nearest, Edge::Symmetric, Edge::Mirrored];

    #[test]
    fn filters_match_the_plain_version() {
        let weights = gaussian(1.3, 4);
        let one = |distance: isize| f64::from(weights[distance.unsigned_abs()]);
        let mut workspace = Workspace::default();
        for (width, height, channels) in SIZES {
            for edge in EDGES {
                let before = image(width, height, channels);
                let mut after = before.clone();
                separable(&mut after, &weights, &weights, edge, &mut workspace);
                close(&after, &plain(&before, |right, down| one(right) * one(down), 4, edge));
            }
        }
    }

    /// A result without its fraction, to within what rounding does to a sum.
    fn truncations(wanted: &[f64], found: &FrameBuf) {
        for (wanted, found) in wanted.iter().zip(found.data()) {
            let found = f64::from(*found);
            assert!((found - 1e-3..found + 1.001).contains(wanted), "{found} {wanted}");
        }
    }

    #[test]
    fn filters_of_frames_match_the_plain_version() {
        let weights = gaussian(1.3, 4);
        let one = |distance: isize| f64::from(weights[distance.unsigned_abs()]);
        let mut quadrant: Vec<Vec<f32>> =
            (0..5).map(|y| (0..5).map(|x| (x + 2 * y) as f32 / 700.0).collect()).collect();
        // An edge of zeros.
        quadrant.iter_mut().for_each(|row| row.push(0.0));
        quadrant.push(vec![0.0; 6]);
        let both = |right: isize, down: isize| f64::from(quadrant[down.unsigned_abs()][right.unsigned_abs()]);
        let mut workspace = Workspace::default();
        for (width, height) in [(1, 1), (3, 2), (17, 9), (90, 7), (6, 40)] {
            let mut src = FrameBuf::new(width, height);
            Key([9; 32]).sequence().fill(src.as_mut().data_mut());
            let mut before = Image::default();
            before.read(src.as_ref());
            for edge in EDGES {
                let mut dst = FrameBuf::new(width, height);
                symmetric(src.as_ref(), dst.as_mut(), &quadrant, edge, &mut workspace);
                truncations(&plain(&before, both, 5, edge), &dst);

                separable_frame(src.as_ref(), dst.as_mut(), &weights, &weights, edge, &mut workspace);
                truncations(&plain(&before, |right, down| one(right) * one(down), 4, edge), &dst);
                let mut image = before.clone();
                separable(&mut image, &weights, &weights, edge, &mut workspace);
                let mut same = FrameBuf::new(width, height);
                image.write(same.as_mut());
                assert!(same == dst, "{width}x{height}, {edge:?}");
            }
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
            if channels == 3 {
                let (mut src, [mut dst, mut same]) =
                    (FrameBuf::new(width, height), [0; 2].map(|_| FrameBuf::new(width, height)));
                before.write(src.as_mut());
                moved_frame(src.as_ref(), dst.as_mut(), &copies, &mut workspace);
                let mut whole = Image::default();
                whole.read(src.as_ref());
                moved(&whole, &copies, &mut after, &mut workspace);
                after.write(same.as_mut());
                assert!(dst == same, "{width}x{height}");
            }
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
