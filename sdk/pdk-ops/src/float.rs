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
    sum: Vec<f32>,
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
    let Workspace { between, padded, .. } = workspace;
    between.resize(line * height, 0.0);
    for (y, sum) in between.chunks_exact_mut(line).enumerate() {
        scale(image.row(y), sum, down[0]);
        for (distance, weight) in down.iter().enumerate().skip(1) {
            let at = |moved: isize| image.row(edge.place(y as isize + moved, height));
            add_both(at(-(distance as isize)), at(distance as isize), sum, *weight);
        }
    }
    let reach = right.len() - 1;
    for (from, sum) in between.chunks_exact(line).zip(image.values.chunks_exact_mut(line)) {
        pad(from, width, channels, reach, edge, padded);
        let at = |moved: isize| &padded[(reach as isize + moved) as usize * channels..][..line];
        scale(at(0), sum, right[0]);
        for (distance, weight) in right.iter().enumerate().skip(1) {
            add_both(at(-(distance as isize)), at(distance as isize), sum, *weight);
        }
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
    let Workspace { padded, sum, .. } = workspace;
    sum.resize(line, 0.0);
    for (y, total) in into.values.chunks_exact_mut(line).enumerate() {
        total.fill(0.0);
        for (distance, weights) in quadrant.iter().enumerate() {
            let at = |moved: isize| image.row(edge.place(y as isize + moved, height));
            scale(at(distance as isize), sum, 1.0);
            if distance > 0 {
                let above = at(-(distance as isize));
                add(above, sum, 1.0);
            }
            let reach = weights.len() - 1;
            pad(sum, width, channels, reach, edge, padded);
            let at = |moved: isize| &padded[(reach as isize + moved) as usize * channels..][..line];
            add(at(0), total, weights[0]);
            for (distance, weight) in weights.iter().enumerate().skip(1).filter(|(_, weight)| **weight != 0.0)
            {
                add_both(at(-(distance as isize)), at(distance as isize), total, *weight);
            }
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
    let Workspace { padded, between, .. } = workspace;
    between.resize(stride * height, 0.0);
    for (y, to) in between.chunks_exact_mut(stride).enumerate() {
        pad(image.row(y), width, channels, furthest, Edge::Nearest, padded);
        to.copy_from_slice(&padded[..stride]);
    }
    for (y, total) in into.values.chunks_exact_mut(line).enumerate() {
        total.fill(0.0);
        for ([right, down], weight) in copies {
            let row = Edge::Nearest.place(y as isize - down, height);
            let start = row * stride + (furthest as isize - right) as usize * channels;
            add(&between[start..start + line], total, *weight);
        }
    }
}

/// A row that goes on for `reach` pixels at both ends.
fn pad(row: &[f32], width: usize, channels: usize, reach: usize, edge: Edge, into: &mut Vec<f32>) {
    into.resize((width + 2 * reach) * channels, 0.0);
    into[reach * channels..][..row.len()].copy_from_slice(row);
    for distance in 1..=reach {
        let left = edge.place(-(distance as isize), width);
        let right = edge.place((width + distance - 1) as isize, width);
        for (to, from) in [(reach - distance, left), (reach + width + distance - 1, right)] {
            let pixel = &row[from * channels..][..channels];
            into[to * channels..][..channels].copy_from_slice(pixel);
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
    fn scale / scale_avx2 / scale_avx512 (from: &[f32], to: &mut [f32], weight: f32) {
        for (to, &from) in to.iter_mut().zip(from) {
            *to = from * weight;
        }
    }
}

vectorised! {
    fn add / add_avx2 / add_avx512 (from: &[f32], sum: &mut [f32], weight: f32) {
        for (sum, &from) in sum.iter_mut().zip(from) {
            *sum += from * weight;
        }
    }
}

vectorised! {
    fn add_both / add_both_avx2 / add_both_avx512 (a: &[f32], b: &[f32], sum: &mut [f32], weight: f32) {
        for ((sum, &a), &b) in sum.iter_mut().zip(a).zip(b) {
            *sum += (a + b) * weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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

    const SIZES: [(usize, usize, usize); 4] = [(1, 1, 3), (3, 2, 1), (17, 9, 3), (5, 20, 1)];
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
