//! Zoom blur: the mean of an image and of its enlargements about the middle.

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::simd::{round_to_byte, vectorised};

/// Sums of a pixel have a fourth element that is not used, so that a pixel is as long as a vector.
const LANES: usize = 4;

/// The largest number of enlargements [`zoom_blur`] takes.
pub const MAX_COUNT: f64 = 1000.0;
/// The largest step between enlargements that [`zoom_blur`] takes.
pub const MAX_STEP: f64 = 10.0;

/// What happens where the last position of an enlargement, computed in double precision, comes out a trace beyond the
/// last pixel. That depends on the size of the frame and on the factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    /// That row or column of the enlargement is black.
    Black,
    /// It is the last row or column.
    Kept,
}

/// Where a position lies between two pixels.
#[derive(Debug, Clone, Copy, Default)]
struct Tap {
    first: u32,
    fraction: f32,
}

/// One direction of an enlargement: a part from the middle, stretched so that its ends meet the ends of the stretched
/// part, and trimmed at both ends to the old length.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    /// Where the part begins, and its length.
    start: usize,
    length: usize,
    /// The length of the stretched part, and how much of it is trimmed at its beginning.
    stretched: usize,
    trimmed: usize,
}

impl Stretch {
    fn new(length: usize, factor: f64) -> Self {
        let part = ((length as f64 / factor).ceil() as usize).clamp(1, length);
        let stretched = ((part as f64 * factor).round_ties_even() as usize).max(length);
        Self { start: (length - part) / 2, length: part, stretched, trimmed: (stretched - length) / 2 }
    }

    /// Which pixels of the image position `i` lies between; none where it lies beyond and ends are black. The second
    /// pixel is there unless the fraction is 0.
    fn tap(&self, i: usize, ends: Ends) -> Option<Tap> {
        let ratio = (self.length - 1) as f64 / (self.stretched - 1).max(1) as f64;
        let (place, last) = ((i + self.trimmed) as f64 * ratio, (self.length - 1) as f64);
        if place > last && ends == Ends::Black {
            return None;
        }
        let place = place.min(last);
        let first = place as usize;
        Some(Tap { first: (self.start + first) as u32, fraction: (place - first as f64) as f32 })
    }
}

/// What [`zoom_blur`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    /// Width, height, count, step and ends that `zooms` and `columns` belong to.
    made_for: Option<(usize, usize, f64, f64, Ends)>,
    /// The vertical direction and the weight of each enlargement.
    zooms: Vec<(Stretch, f32)>,
    /// The taps of all columns, one enlargement after the other.
    columns: Vec<Tap>,
    /// A row between two rows of the image, then zeros: two pixels and one more value.
    row: Vec<f32>,
    /// The sums of a row.
    sums: Vec<f32>,
}

impl Workspace {
    fn prepare(&mut self, width: usize, height: usize, count: f64, step: f64, ends: Ends) {
        let wanted = Some((width, height, count, step, ends));
        if self.made_for == wanted {
            return;
        }
        self.made_for = wanted;
        self.zooms.clear();
        self.columns.clear();
        for i in 1..count.ceil() as usize {
            // The step as it is left after the addition of 1, as number ranges are usually made.
            let factor = 1.0 + i as f64 * ((1.0 + step) - 1.0);
            let weight = (count - i as f64).min(1.0) as f32;
            self.zooms.push((Stretch::new(height, factor), weight));
            let across = Stretch::new(width, factor);
            // Right of the row it is black.
            let black = Tap { first: width as u32, fraction: 0.0 };
            self.columns.extend((0..width).map(|x| across.tap(x, ends).unwrap_or(black)));
        }
        self.row.clear();
        self.row.resize((width + 2) * CHANNELS + 1, 0.0);
        self.sums.resize(width * LANES, 0.0);
    }
}

/// The mean of the image and of `count` enlargements by `1`, `1 + step`, `1 + 2 * step` and so on, so that the image
/// itself counts twice. What `count` has beyond a whole number is the weight of the last enlargement.
///
/// An enlargement by `z` takes `ceil(height / z)` rows from the middle, stretches them linearly to `z` times their
/// number, first row to first row and last to last, and trims the result; the same with columns. The sum is rounded
/// once.
///
/// # Panics
/// Where the sizes of the frames differ, `count` is not within 0..=[`MAX_COUNT`], or `step` not within 0..=[`MAX_STEP`].
pub fn zoom_blur(
    src: Frame<'_>,
    mut dst: FrameMut<'_>,
    count: f64,
    step: f64,
    ends: Ends,
    workspace: &mut Workspace,
) {
    assert!(src.same_size(&dst.as_ref()), "zoom_blur between frames of different size");
    assert!((0.0..=MAX_COUNT).contains(&count), "zoom_blur takes a count of 0 to 1000, not {count}");
    assert!((0.0..=MAX_STEP).contains(&step), "zoom_blur takes a step of 0 to 10, not {step}");
    let (width, height) = (src.width(), src.height());
    workspace.prepare(width, height, count, step, ends);
    let Workspace { zooms, columns, row, sums, .. } = workspace;
    let own_weight = (1.0 + count.min(1.0)) as f32;
    let scale = (1.0 / (1.0 + count)) as f32;
    for y in 0..height {
        start_sums(src.row(y), sums, own_weight);
        for ((down, weight), columns) in zooms.iter().zip(columns.chunks_exact(width)) {
            let Some(tap) = down.tap(y, ends) else { continue };
            let upper = src.row(tap.first as usize);
            let lower = src.row((tap.first as usize + 1).min(height - 1));
            let weights = [weight * (1.0 - tap.fraction), weight * tap.fraction];
            // Only the columns that are used: the outermost ones are the first and the last.
            let used = columns[0].first as usize..(columns[width - 1].first as usize + 2).min(width);
            let used = used.start * CHANNELS..used.end * CHANNELS;
            mix_rows(&upper[used.clone()], &lower[used.clone()], &mut row[used], weights);
            add_stretched(row, columns, sums);
        }
        finish(sums, dst.row_mut(y), scale);
    }
}

vectorised! {
    fn start_sums / start_sums_portable / start_sums_avx2 (row: &[u8], sums: &mut [f32], weight: f32) {
        for (sums, pixel) in sums.chunks_exact_mut(LANES).zip(row.chunks_exact(CHANNELS)) {
            for (sum, &value) in sums.iter_mut().zip(pixel) {
                *sum = f32::from(value) * weight;
            }
        }
    }
}

vectorised! {
    fn mix_rows / mix_rows_portable / mix_rows_avx2 (
        upper: &[u8], lower: &[u8], row: &mut [f32], weights: [f32; 2],
    ) {
        for ((out, &upper), &lower) in row.iter_mut().zip(upper).zip(lower) {
            *out = f32::from(upper) * weights[0] + f32::from(lower) * weights[1];
        }
    }
}

vectorised! {
    // Four values are read where a pixel has three: the fourth goes into the element that is not used.
    fn add_stretched / add_stretched_portable / add_stretched_avx2 (
        row: &[f32], columns: &[Tap], sums: &mut [f32],
    ) {
        for (sums, tap) in sums.chunks_exact_mut(LANES).zip(columns) {
            let start = tap.first as usize * CHANNELS;
            let pixels = &row[start..start + CHANNELS + LANES];
            let (left, right) = (&pixels[..LANES], &pixels[CHANNELS..]);
            for ((sum, left), right) in sums.iter_mut().zip(left).zip(right) {
                *sum += left + (right - left) * tap.fraction;
            }
        }
    }
}

vectorised! {
    fn finish / finish_portable / finish_avx2 (sums: &[f32], row: &mut [u8], scale: f32) {
        for (pixel, sums) in row.chunks_exact_mut(CHANNELS).zip(sums.chunks_exact(LANES)) {
            for (value, sum) in pixel.iter_mut().zip(sums) {
                *value = round_to_byte(sum * scale);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::testing::{plain, run_on, samples};

    /// The enlargement by `factor`, made as a whole image in double precision.
    fn enlarged(src: Frame<'_>, factor: f64) -> Vec<[f64; 3]> {
        let axis = |length: usize| {
            let part = (length as f64 / factor).ceil() as usize;
            let stretched = (part as f64 * factor).round_ties_even() as usize;
            let places: Vec<f64> =
                (0..stretched)
                    .map(|i| {
                        if stretched == 1 {
                            0.0
                        } else {
                            i as f64 * (part - 1) as f64 / (stretched - 1) as f64
                        }
                    })
                    .map(|place| place + ((length - part) / 2) as f64)
                    .collect();
            let trimmed = (stretched - length) / 2;
            places[trimmed..trimmed + length].to_vec()
        };
        let (across, down) = (axis(src.width()), axis(src.height()));
        let mut out: Vec<[f64; 3]> = Vec::new();
        for &v in &down {
            for &u in &across {
                let at = |x: f64, y: f64, c: usize| {
                    let (x, y) = ((x as usize).min(src.width() - 1), (y as usize).min(src.height() - 1));
                    f64::from(src.pixel(x, y)[c])
                };
                out.push([0, 1, 2].map(|c| {
                    let upper = at(u, v, c) * (1.0 - u.fract()) + at(u + 1.0, v, c) * u.fract();
                    let lower = at(u, v + 1.0, c) * (1.0 - u.fract()) + at(u + 1.0, v + 1.0, c) * u.fract();
                    upper * (1.0 - v.fract()) + lower * v.fract()
                }));
            }
        }
        out
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn matches_the_plain_version(sample in samples(), count in 0.0..14.0f64, step in 0.0..0.3) {
            let src = sample.frame();
            let mut sums: Vec<[f64; 3]> = src.rows()
                .flat_map(|row| row.chunks(3).map(|p| [p[0], p[1], p[2]].map(f64::from)))
                .collect();
            for i in 0..count.ceil() as usize {
                let weight = (count - i as f64).min(1.0);
                let zoomed = enlarged(src, 1.0 + i as f64 * ((1.0 + step) - 1.0));
                for (sum, value) in sums.iter_mut().zip(zoomed) {
                    (0..3).for_each(|c: usize| sum[c] += weight * value[c]);
                }
            }
            let mut workspace = Workspace::default();
            let result = run_on(&sample, |src, dst| zoom_blur(src, dst, count, step, Ends::Kept, &mut workspace));
            let exact = plain(src, |x, y| {
                sums[y * src.width() + x].map(|v| (v / (count + 1.0)).round() as u8)
            });
            for (actual, exact) in result.data().iter().zip(exact.data()) {
                prop_assert!(actual.abs_diff(*exact) <= 1, "{} {}", actual, exact);
            }
        }
    }

    #[test]
    fn a_workspace_serves_frames_and_zooms_of_any_size_in_turn() {
        let mut kept = Workspace::default();
        for (width, height, count, step) in [
            (40, 30, 11.0, 0.03),
            (7, 3, 2.5, 0.5),
            (1, 1, 12.0, 10.0),
            (40, 30, 0.0, 0.1),
            (90, 2, 8.0, 0.02),
        ] {
            let bytes: Vec<u8> = (0..width * height * 3).map(|i| (i * 37 % 251) as u8).collect();
            let src = Frame::new(&bytes, width, height).unwrap();
            let (mut first, mut second) = (src.to_buf(), src.to_buf());
            zoom_blur(src, first.as_mut(), count, step, Ends::Kept, &mut kept);
            zoom_blur(src, second.as_mut(), count, step, Ends::Kept, &mut Workspace::default());
            assert_eq!(first, second);
        }
    }

    #[test]
    fn a_white_frame_stays_white() {
        let bytes = [255; 50 * 20 * 3];
        let src = Frame::new(&bytes, 50, 20).unwrap();
        for count in [0.0, 0.5, 1.0, 3.3, 12.0] {
            let mut dst = FrameBuf::new(50, 20);
            zoom_blur(src, dst.as_mut(), count, 0.03, Ends::Kept, &mut Workspace::default());
            assert!(dst.data().iter().all(|&v| v == 255));
        }
    }

    #[test]
    fn positions_beyond_the_last_pixel_are_black_or_kept() {
        // 159 times 125 / 159 is more than 125 in double precision.
        let stretch = Stretch::new(160, 1.0 + 9.0 * ((1.0 + 0.03) - 1.0));
        assert_eq!((stretch.length, stretch.stretched), (126, 160));
        assert!(stretch.tap(159, Ends::Black).is_none());
        assert_eq!(stretch.tap(159, Ends::Kept).map(|tap| (tap.first, tap.fraction)), Some((17 + 125, 0.0)));
        let bytes = [255; 160 * 10 * 3];
        let src = Frame::new(&bytes, 160, 10).unwrap();
        for (ends, last) in [(Ends::Black, 234), (Ends::Kept, 255)] {
            let mut dst = FrameBuf::new(160, 10);
            zoom_blur(src, dst.as_mut(), 11.0, 0.03, ends, &mut Workspace::default());
            assert_eq!([158, 159].map(|x| dst.as_ref().pixel(x, 5)), [[255; 3], [last; 3]]);
        }
    }
}
