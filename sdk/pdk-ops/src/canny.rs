//! Edges after Canny, "A computational approach to edge detection" (1986).
//!
//! Gradients are Sobel sums of 3x3 pixels, their magnitude is |dx| + |dy|. A pixel is a candidate where its magnitude
//! exceeds the lower threshold and is the largest across the edge; candidates that are connected to one above the upper
//! threshold are edges.

use crate::color::grey;
use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::simd::{round_inside_byte, vectorised};

/// The tangent of 22.5 degrees, times 2^15.
const TANGENT: i32 = 13573;

/// A pixel that is not an edge.
const NONE: u8 = 0;
/// A pixel that is an edge if it is connected to one.
const CANDIDATE: u8 = 1;
/// A pixel on an edge.
const EDGE: u8 = 2;

/// Pixels of a row that are skipped together if they are smooth.
const PART: usize = 16;

/// What [`blend_with_edges`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    /// The grey of three rows, each with its ends repeated once.
    greys: [Vec<u8>; 3],
    /// The gradient across and down, and its magnitude, with a border of one pixel whose magnitude is zero.
    across: Vec<i16>,
    down: Vec<i16>,
    magnitude: Vec<i16>,
    /// `EDGE` where there is one, with a border of one pixel.
    marks: Vec<u8>,
    /// Edge pixels whose neighbours are still to be looked at.
    open: Vec<u32>,
    width: usize,
}

impl Workspace {
    /// A row of what [`canny`] found in the last frame: [`EDGE`] where there is an edge, another value elsewhere.
    fn row(&self, y: usize) -> &[u8] {
        &self.marks[(y + 1) * (self.width + 2) + 1..][..self.width]
    }
}

/// Blends the frame with a picture of its edges: `weight * edges + (1 - weight) * src`, rounded half to even. Edges are
/// red on black; thresholds are those of the gradient's magnitude |dx| + |dy|, which reaches 2040. They lose their
/// fraction, and the smaller one is the lower. The weight is clipped to 0..=1.
///
/// # Panics
/// If the sizes differ.
pub fn blend_with_edges(
    src: Frame<'_>,
    mut dst: FrameMut<'_>,
    weight: f64,
    thresholds: (f64, f64),
    workspace: &mut Workspace,
) {
    assert!(src.same_size(&dst.as_ref()), "edges between frames of different size");
    canny(src, thresholds.0, thresholds.1, workspace);
    let weight = weight.clamp(0.0, 1.0);
    let (red, rest) = ((255.0 * weight) as f32, (1.0 - weight) as f32);
    for y in 0..src.height() {
        blend_row(src.row(y), dst.row_mut(y), workspace.row(y), red, rest);
    }
}

vectorised! {
    fn blend_row / blend_row_avx2 (
        from: &[u8], to: &mut [u8], marks: &[u8], red: f32, rest: f32,
    ) {
        let pixels = from.chunks_exact(CHANNELS).zip(to.chunks_exact_mut(CHANNELS));
        for ((from, to), &mark) in pixels.zip(marks) {
            let red = if mark == EDGE { red } else { 0.0 };
            to[0] = round_inside_byte(f32::from(from[0]) * rest + red);
            to[1] = round_inside_byte(f32::from(from[1]) * rest);
            to[2] = round_inside_byte(f32::from(from[2]) * rest);
        }
    }
}

/// Finds the edges in the grey of a frame.
fn canny(src: Frame<'_>, first_threshold: f64, second_threshold: f64, workspace: &mut Workspace) {
    let (width, height) = (src.width(), src.height());
    let stride = width + 2;
    let threshold = |value: f64| value.floor().clamp(-1.0, 3000.0) as i16;
    let lower = threshold(first_threshold.min(second_threshold));
    let upper = threshold(first_threshold.max(second_threshold));
    let Workspace { greys, across, down, magnitude, marks, open, width: last_width } = workspace;
    *last_width = width;

    // Borders are set anew for every frame, because their places depend on the width.
    for plane in [&mut *across, &mut *down, &mut *magnitude] {
        plane.resize(stride * (height + 2), 0);
    }
    marks.clear();
    marks.resize(stride * (height + 2), NONE);
    magnitude[..stride].fill(0);
    magnitude[stride * (height + 1)..].fill(0);
    open.clear();
    open.reserve(width * height);

    for grey in greys.iter_mut() {
        grey.resize(stride, 0);
    }
    // The row above the first one is the first one.
    grey_row(src.row(0), &mut greys[1]);
    grey_row(src.row(0), &mut greys[2]);
    for y in 0..height {
        greys.rotate_left(1);
        grey_row(src.row((y + 1).min(height - 1)), &mut greys[2]);
        let row = (y + 1) * stride..(y + 2) * stride;
        let [above, middle, below] = &*greys;
        let magnitude = &mut magnitude[row.clone()];
        sobel_row(above, middle, below, &mut across[row.clone()], &mut down[row], magnitude);
        (magnitude[0], magnitude[stride - 1]) = (0, 0);
    }

    for y in 1..=height {
        let row = y * stride..(y + 1) * stride;
        for (part, strengths) in magnitude[row.clone()].chunks(PART).enumerate() {
            // Most of a frame is smooth, which many pixels at a time tell.
            if strengths.iter().fold(i16::MIN, |most, &strength| most.max(strength)) <= lower {
                continue;
            }
            let start = row.start + part * PART;
            for at in start.max(row.start + 1)..(start + PART).min(row.end - 1) {
                let strength = magnitude[at];
                if strength > lower && is_largest(magnitude, at, stride, across[at], down[at]) {
                    marks[at] = if strength > upper { EDGE } else { CANDIDATE };
                    if strength > upper {
                        open.push(at as u32);
                    }
                }
            }
        }
    }
    // Candidates beside an edge join it.
    while let Some(at) = open.pop() {
        let at = at as usize;
        for start in [at - stride - 1, at - 1, at + stride - 1] {
            for (mark, neighbour) in marks[start..start + 3].iter_mut().zip(start..) {
                if *mark == CANDIDATE {
                    *mark = EDGE;
                    open.push(neighbour as u32);
                }
            }
        }
    }
}

/// Whether the magnitude at a place is the largest across the edge. Of two equal ones side by side the right or lower
/// one counts; on a diagonal neither does.
#[inline]
fn is_largest(magnitude: &[i16], at: usize, stride: usize, across: i16, down: i16) -> bool {
    let strength = magnitude[at];
    let wide = i32::from(across).abs();
    let high = i32::from(down).abs() << 15;
    let low_slope = wide * TANGENT;
    if high < low_slope {
        strength > magnitude[at - 1] && strength >= magnitude[at + 1]
    } else if high > low_slope + (wide << 16) {
        strength > magnitude[at - stride] && strength >= magnitude[at + stride]
    } else if (across ^ down) < 0 {
        strength > magnitude[at - stride + 1] && strength > magnitude[at + stride - 1]
    } else {
        strength > magnitude[at - stride - 1] && strength > magnitude[at + stride + 1]
    }
}

/// The grey of a row, with both ends repeated.
fn grey_row(from: &[u8], to: &mut [u8]) {
    let last = to.len() - 1;
    grey_pixels(from, &mut to[1..last]);
    (to[0], to[last]) = (to[1], to[last - 1]);
}

vectorised! {
    fn grey_pixels / grey_pixels_avx2 (from: &[u8], to: &mut [u8]) {
        for (to, pixel) in to.iter_mut().zip(from.chunks_exact(CHANNELS)) {
            *to = grey(pixel[0], pixel[1], pixel[2]);
        }
    }
}

vectorised! {
    /// Gradients of the middle row but for its two ends, which are repetitions.
    fn sobel_row / sobel_row_avx2 (
        above: &[u8], middle: &[u8], below: &[u8], across: &mut [i16], down: &mut [i16], magnitude: &mut [i16],
    ) {
        let count = middle.len() - 2;
        let (above, middle, below) = (&above[..count + 2], &middle[..count + 2], &below[..count + 2]);
        let (across, down) = (&mut across[1..=count], &mut down[1..=count]);
        let magnitude = &mut magnitude[1..=count];
        for x in 0..count {
            let column = |x: usize| i16::from(above[x]) + 2 * i16::from(middle[x]) + i16::from(below[x]);
            let difference = |x: usize| i16::from(below[x]) - i16::from(above[x]);
            across[x] = column(x + 2) - column(x);
            down[x] = difference(x) + 2 * difference(x + 1) + difference(x + 2);
            magnitude[x] = across[x].abs() + down[x].abs();
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::simd::with_each;
    use crate::testing::{plain, run_on, samples};

    /// The method from its description, with coordinates that are clamped and sets that grow until nothing changes.
    fn plain_canny(src: Frame<'_>, lower: i32, upper: i32) -> Vec<bool> {
        let (width, height) = (src.width() as i32, src.height() as i32);
        let value = |x: i32, y: i32| {
            let [r, g, b] = src.pixel(x.clamp(0, width - 1) as usize, y.clamp(0, height - 1) as usize);
            i32::from(grey(r, g, b))
        };
        let gradient = |x: i32, y: i32| {
            let (mut across, mut down) = (0, 0);
            for i in -1..=1i32 {
                across += (2 - i.abs()) * (value(x + 1, y + i) - value(x - 1, y + i));
                down += (2 - i.abs()) * (value(x + i, y + 1) - value(x + i, y - 1));
            }
            (across, down)
        };
        let inside = |x: i32, y: i32| (0..width).contains(&x) && (0..height).contains(&y);
        let strength = |x: i32, y: i32| {
            let (across, down) = gradient(x, y);
            if inside(x, y) { across.abs() + down.abs() } else { 0 }
        };
        let tangent = f64::from(TANGENT) / 32768.0;
        let mut candidate = vec![false; (width * height) as usize];
        let mut edge = candidate.clone();
        for y in 0..height {
            for x in 0..width {
                let (across, down) = gradient(x, y);
                let (wide, high) = (f64::from(across.abs()), f64::from(down.abs()));
                let (dx, dy, strict) = if high < wide * tangent {
                    (1, 0, false)
                } else if high > wide * (tangent + 2.0) {
                    (0, 1, false)
                } else if (across < 0) != (down < 0) {
                    (-1, 1, true)
                } else {
                    (1, 1, true)
                };
                let here = strength(x, y);
                let (before, after) = (strength(x - dx, y - dy), strength(x + dx, y + dy));
                let largest = here > before && (here > after || !strict && here == after);
                let at = (y * width + x) as usize;
                candidate[at] = here > lower && largest;
                edge[at] = here > upper && candidate[at];
            }
        }
        loop {
            let before = edge.clone();
            for y in 0..height {
                for x in 0..width {
                    let at = (y * width + x) as usize;
                    let near = (-1..=1).any(|j| {
                        (-1..=1).any(|i| inside(x + i, y + j) && edge[((y + j) * width + x + i) as usize])
                    });
                    edge[at] |= candidate[at] && near;
                }
            }
            if edge == before {
                return edge;
            }
        }
    }

    fn edges(src: Frame<'_>, first: f64, second: f64, workspace: &mut Workspace) -> Vec<bool> {
        canny(src, first, second, workspace);
        (0..src.height())
            .flat_map(|y| workspace.row(y).iter().map(|&m| m == EDGE).collect::<Vec<_>>())
            .collect()
    }

    proptest! {
        #[test]
        fn matches_the_plain_version(sample in samples(), lower in 0i32..600, more in 0i32..600) {
            let src = sample.frame();
            let expected = plain_canny(src, lower, lower + more);
            let (first, second) = (f64::from(lower) + 0.5, f64::from(lower + more));
            let mut workspace = Workspace::default();
            with_each(|instructions| {
                assert_eq!(edges(src, first, second, &mut workspace), expected, "{instructions:?}");
                // The order of the thresholds does not matter.
                assert_eq!(edges(src, second, first, &mut workspace), expected, "{instructions:?}");
            });
        }
    }

    proptest! {
        #[test]
        fn edges_are_blended_in_red(sample in samples(), weight in 0.0..=1.0f64) {
            let src = sample.frame();
            let found = plain_canny(src, 80, 200);
            let expected = plain(src, |x, y| {
                let red = if found[y * src.width() + x] { (255.0 * weight) as f32 } else { 0.0 };
                let [r, g, b] = src.pixel(x, y).map(|v| f32::from(v) * (1.0 - weight) as f32);
                [r + red, g, b].map(|v| v.round_ties_even() as u8)
            });
            let mut workspace = Workspace::default();
            let actual = run_on(&sample, |src, dst| {
                blend_with_edges(src, dst, weight, (80.0, 200.0), &mut workspace);
            });
            prop_assert_eq!(actual, expected);
        }
    }

    #[test]
    fn one_workspace_serves_frames_of_any_size() {
        let mut random = pdk_seed::Key([1; 32]).sequence();
        let mut workspace = Workspace::default();
        for (width, height) in [(64, 48), (31, 80), (64, 48), (1, 9), (200, 3)] {
            let mut pixels = vec![0; width * height * 3];
            random.fill(&mut pixels);
            // Smooth enough for edges that run on, rough enough for some that end.
            pixels.iter_mut().enumerate().for_each(|(i, v)| *v = *v / 5 + (i / 3 % 23 / 11 * 90) as u8);
            let src = FrameBuf::from_vec(pixels, width, height).unwrap();
            let result = edges(src.as_ref(), 60.0, 250.0, &mut workspace);
            assert_eq!(result, plain_canny(src.as_ref(), 60, 250), "{width}x{height}");
            assert!(width * height < 100 || result.iter().any(|&e| e));
        }
    }
}
