//! Zoom blur: the mean of an image and of its enlargements about the middle.

mod grid;
#[cfg(target_arch = "x86_64")]
mod wide;

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::point::truncated;
use crate::rgbx::pack;
use crate::simd::{round_to_byte, vectorised};

pub use grid::Grid;

/// Sums of a pixel have a fourth element that is not used, so that a pixel is as long as a vector.
const LANES: usize = 4;

/// Values of a row that are read at a time, at most.
const MOST_READ: usize = 16;

/// The largest number of enlargements [`zoom_blur`] takes.
pub const MAX_COUNT: f64 = 1000.0;
/// The largest step between enlargements that [`zoom_blur`] takes.
pub const MAX_STEP: f64 = 10.0;

/// How an image is enlarged by a factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Enlargement {
    /// `ceil(length / factor)` whole pixels from the middle are stretched to a whole number of pixels near the factor,
    /// first to first and last to last, and trimmed. The middle moves by up to a pixel from one factor to the next.
    /// If the last position, computed in double precision, comes out a trace beyond the last pixel, that row or
    /// column is black; that depends on the size of the frame and on the factor.
    WholePixels,
    /// As [`Grid`] stretches: like `WholePixels`, but what is too long is cut off at the right and lower edges, so that nothing is black. The
    /// sum is not rounded but loses its fraction.
    Corner,
    /// About the middle of the image and by the factor, exactly.
    Exact,
}

/// Where a position lies between two pixels.
#[derive(Debug, Clone, Copy, Default)]
struct Tap {
    first: u32,
    fraction: f32,
}

/// One direction of an enlargement.
#[derive(Debug, Clone, Copy)]
enum Stretch {
    WholePixels {
        /// Where the part begins, and its length.
        start: usize,
        part: usize,
        /// The length of the stretched part, and how much of it is trimmed at its beginning.
        stretched: usize,
        trimmed: usize,
    },
    Corner(Grid),
    Exact {
        middle: f64,
        factor: f64,
    },
}

impl Stretch {
    fn new(length: usize, factor: f64, enlargement: Enlargement) -> Self {
        match enlargement {
            Enlargement::Exact => return Self::Exact { middle: (length - 1) as f64 / 2.0, factor },
            Enlargement::Corner => return Self::Corner(Grid::new(length, factor)),
            Enlargement::WholePixels => {}
        }
        let part = ((length as f64 / factor).ceil() as usize).clamp(1, length);
        let stretched = ((part as f64 * factor).round_ties_even() as usize).max(length);
        Self::WholePixels { start: (length - part) / 2, part, stretched, trimmed: (stretched - length) / 2 }
    }

    /// Which pixels of the image position `i` lies between; none if it is black. The second pixel is there unless
    /// the fraction is 0.
    fn tap(&self, i: usize) -> Option<Tap> {
        let place = match *self {
            Self::Corner(grid) => {
                let (first, fraction) = grid.place(i);
                return Some(Tap { first: first as u32, fraction });
            }
            Self::Exact { middle, factor } => middle + (i as f64 - middle) / factor,
            Self::WholePixels { start, part, stretched, trimmed } => {
                let ratio = (part - 1) as f64 / (stretched - 1).max(1) as f64;
                let place = (i + trimmed) as f64 * ratio;
                if place > (part - 1) as f64 {
                    return None;
                }
                start as f64 + place
            }
        };
        Some(Tap { first: place as u32, fraction: place.fract() as f32 })
    }
}

/// What [`zoom_blur`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    /// Width, height, count, step and enlargement that `zooms` and `columns` belong to.
    made_for: Option<(usize, usize, f64, f64, Enlargement)>,
    /// The vertical direction and the weight of each enlargement.
    zooms: Vec<(Stretch, f32)>,
    /// The taps of all columns, one enlargement after the other.
    columns: Vec<Tap>,
    /// The same for four columns each, without the last few; empty if columns come from pixels too far apart for that.
    #[cfg(target_arch = "x86_64")]
    fours: Vec<wide::Four>,
    /// A row between two rows of the image, then zeros: as many as are read at a time.
    row: Vec<f32>,
    /// The sums of a row.
    sums: Vec<f32>,
    /// The results of a row, with the element that is not used.
    bytes: Vec<[u8; LANES]>,
}

impl Workspace {
    fn prepare(&mut self, width: usize, height: usize, count: f64, step: f64, enlargement: Enlargement) {
        let wanted = Some((width, height, count, step, enlargement));
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
            self.zooms.push((Stretch::new(height, factor, enlargement), weight));
            let across = Stretch::new(width, factor, enlargement);
            // Right of the row it is black.
            let black = Tap { first: width as u32, fraction: 0.0 };
            self.columns.extend((0..width).map(|x| across.tap(x).unwrap_or(black)));
        }
        self.row.clear();
        self.row.resize(width * CHANNELS + MOST_READ, 0.0);
        #[cfg(target_arch = "x86_64")]
        {
            self.fours.clear();
            for columns in self.columns.chunks_exact(width).flat_map(|columns| columns.as_chunks::<4>().0) {
                let Some(four) = wide::Four::new(columns, width) else {
                    self.fours.clear();
                    break;
                };
                self.fours.push(four);
            }
        }
        self.sums.resize(width * LANES, 0.0);
        self.bytes.resize(width, [0; LANES]);
    }
}

/// The mean of the image and of `count` enlargements by `1`, `1 + step`, `1 + 2 * step` and so on, so that the image
/// itself counts twice. What `count` has beyond a whole number is the weight of the last enlargement.
///
/// Enlargements interpolate linearly; the sum is rounded once, or with [`Enlargement::Corner`] loses its fraction once.
///
/// # Panics
/// If the sizes of the frames differ, `count` is not within 0..=[`MAX_COUNT`], or `step` not within 0..=[`MAX_STEP`].
pub fn zoom_blur(
    src: Frame<'_>,
    mut dst: FrameMut<'_>,
    count: f64,
    step: f64,
    enlargement: Enlargement,
    workspace: &mut Workspace,
) {
    assert!(src.same_size(&dst.as_ref()), "zoom_blur between frames of different size");
    assert!((0.0..=MAX_COUNT).contains(&count), "zoom_blur takes a count of 0 to 1000, not {count}");
    assert!((0.0..=MAX_STEP).contains(&step), "zoom_blur takes a step of 0 to 10, not {step}");
    let (width, height) = (src.width(), src.height());
    workspace.prepare(width, height, count, step, enlargement);
    let Workspace { zooms, columns, row, sums, bytes, .. } = workspace;
    #[cfg(target_arch = "x86_64")]
    let fours = Some(&workspace.fours).filter(|fours| !fours.is_empty() && crate::simd::has_avx512());
    let own_weight = (1.0 + count.min(1.0)) as f32;
    let scale = (1.0 / (1.0 + count)) as f32;
    for y in 0..height {
        start_sums(src.row(y), sums, own_weight);
        for (zoom, (down, weight)) in zooms.iter().enumerate() {
            let columns = &columns[zoom * width..][..width];
            let Some(tap) = down.tap(y) else { continue };
            let upper = src.row(tap.first as usize);
            let lower = src.row((tap.first as usize + 1).min(height - 1));
            // Only the columns that are used: the outermost ones are the first and the last.
            let used = columns[0].first as usize..(columns[width - 1].first as usize + 2).min(width);
            let used = used.start * CHANNELS..used.end * CHANNELS;
            let (upper, lower, between) = (&upper[used.clone()], &lower[used.clone()], &mut row[used]);
            if enlargement == Enlargement::Corner {
                interpolate_rows(upper, lower, between, tap.fraction, *weight);
            } else {
                mix_rows(upper, lower, between, [weight * (1.0 - tap.fraction), weight * tap.fraction]);
            }
            #[cfg(target_arch = "x86_64")]
            let done = fours.map_or(0, |fours| {
                let fours = &fours[zoom * (width / 4)..][..width / 4];
                // SAFETY: the processor has AVX-512.
                unsafe { wide::add_stretched(row, fours, sums) };
                4 * fours.len()
            });
            #[cfg(not(target_arch = "x86_64"))]
            let done = 0;
            add_stretched(row, &columns[done..], &mut sums[done * LANES..]);
        }
        match enlargement {
            Enlargement::Corner => finish_without_fractions(sums, bytes.as_flattened_mut(), scale),
            Enlargement::WholePixels | Enlargement::Exact => finish(sums, bytes.as_flattened_mut(), scale),
        }
        pack(bytes, dst.row_mut(y));
    }
}

vectorised! {
    fn start_sums / start_sums_avx2 (row: &[u8], sums: &mut [f32], weight: f32) {
        for (sums, pixel) in sums.chunks_exact_mut(LANES).zip(row.chunks_exact(CHANNELS)) {
            for (sum, &value) in sums.iter_mut().zip(pixel) {
                *sum = f32::from(value) * weight;
            }
        }
    }
}

vectorised! {
    fn mix_rows / mix_rows_avx2 / mix_rows_avx512 (
        upper: &[u8], lower: &[u8], row: &mut [f32], weights: [f32; 2],
    ) {
        for ((out, &upper), &lower) in row.iter_mut().zip(upper).zip(lower) {
            *out = f32::from(upper) * weights[0] + f32::from(lower) * weights[1];
        }
    }
}

vectorised! {
    // Unlike `mix_rows`, this leaves what is equal in both rows as it is, which matters where fractions are dropped.
    fn interpolate_rows / interpolate_rows_avx2 / interpolate_rows_avx512 (
        upper: &[u8], lower: &[u8], row: &mut [f32], fraction: f32, weight: f32,
    ) {
        for ((out, &upper), &lower) in row.iter_mut().zip(upper).zip(lower) {
            let (upper, lower) = (f32::from(upper), f32::from(lower));
            *out = (upper + (lower - upper) * fraction) * weight;
        }
    }
}

vectorised! {
    // Four values are read where a pixel has three: the fourth goes into the element that is not used.
    fn add_stretched / add_stretched_avx2 (
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
    fn finish / finish_avx2 / finish_avx512 (sums: &[f32], bytes: &mut [u8], scale: f32) {
        for (value, sum) in bytes.iter_mut().zip(sums) {
            *value = round_to_byte(sum * scale);
        }
    }
}

vectorised! {
    fn finish_without_fractions / finish_without_fractions_avx2 / finish_without_fractions_avx512 (
        sums: &[f32], bytes: &mut [u8], scale: f32,
    ) {
        for (value, sum) in bytes.iter_mut().zip(sums) {
            *value = truncated(sum * scale);
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
    fn enlarged(src: Frame<'_>, factor: f64, enlargement: Enlargement) -> Vec<[f64; 3]> {
        let axis = |length: usize| -> Vec<f64> {
            if enlargement == Enlargement::Exact {
                let middle = (length - 1) as f64 / 2.0;
                return (0..length).map(|i| (i as f64 - middle) / factor + middle).collect();
            }
            let part = (length as f64 / factor).ceil() as usize;
            let stretched = (part as f64 * factor).round_ties_even() as usize;
            let ratio = if stretched == 1 { 0.0 } else { (part - 1) as f64 / (stretched - 1) as f64 };
            let trimmed = (stretched - length) / 2;
            let places = (trimmed..trimmed + length).map(|i| i as f64 * ratio);
            // Infinity is black.
            let black = |place: f64| if place > (part - 1) as f64 { f64::INFINITY } else { place };
            places.map(|place| black(place) + ((length - part) / 2) as f64).collect()
        };
        let (across, down) = (axis(src.width()), axis(src.height()));
        let mut out: Vec<[f64; 3]> = Vec::new();
        for &v in &down {
            for &u in &across {
                if u.is_infinite() || v.is_infinite() {
                    out.push([0.0; 3]);
                    continue;
                }
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
        fn matches_the_plain_version(
            sample in samples(), count in 0.0..14.0f64, step in 0.0..0.3, exact: bool,
        ) {
            let enlargement = if exact { Enlargement::Exact } else { Enlargement::WholePixels };
            let src = sample.frame();
            let mut sums: Vec<[f64; 3]> = src.rows()
                .flat_map(|row| row.chunks(3).map(|p| [p[0], p[1], p[2]].map(f64::from)))
                .collect();
            for i in 0..count.ceil() as usize {
                let weight = (count - i as f64).min(1.0);
                let zoomed = enlarged(src, 1.0 + i as f64 * ((1.0 + step) - 1.0), enlargement);
                for (sum, value) in sums.iter_mut().zip(zoomed) {
                    (0..3).for_each(|c: usize| sum[c] += weight * value[c]);
                }
            }
            let mut workspace = Workspace::default();
            let result = run_on(&sample, |src, dst| zoom_blur(src, dst, count, step, enlargement, &mut workspace));
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
            zoom_blur(src, first.as_mut(), count, step, Enlargement::Exact, &mut kept);
            zoom_blur(src, second.as_mut(), count, step, Enlargement::Exact, &mut Workspace::default());
            assert_eq!(first, second);
        }
    }

    /// As whole enlarged images, pixel by pixel.
    fn plain_from_corner(src: Frame<'_>, count: usize, step: f64) -> FrameBuf {
        let step = (1.0 + step) - 1.0;
        let mut sums: Vec<[f32; 3]> =
            src.rows().flat_map(|row| row.chunks(3).map(|p| [p[0], p[1], p[2]].map(f32::from))).collect();
        for zoom in 0..count {
            let factor = 1.0 + zoom as f64 * step;
            let (across, down) = (Grid::new(src.width(), factor), Grid::new(src.height(), factor));
            for y in 0..src.height() {
                for x in 0..src.width() {
                    let ((left, right_by), (upper, down_by)) = (across.place(x), down.place(y));
                    let (right, lower) = ((left + 1).min(across.last()), (upper + 1).min(down.last()));
                    for (c, sum) in sums[y * src.width() + x].iter_mut().enumerate() {
                        let at = |x: usize, y: usize| f32::from(src.pixel(x, y)[c]);
                        let between = |x: usize| at(x, upper) + (at(x, lower) - at(x, upper)) * down_by;
                        *sum += between(left) + (between(right) - between(left)) * right_by;
                    }
                }
            }
        }
        let scale = 1.0 / (count + 1) as f32;
        plain(src, |x, y| sums[y * src.width() + x].map(|sum| (sum * scale) as u8))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn from_the_corner_it_is_the_plain_version(sample in samples(), count in 0..16usize, step in 0.0..0.3) {
            let expected = plain_from_corner(sample.frame(), count, step);
            crate::simd::with_each(|_| {
                let mut workspace = Workspace::default();
                let result = run_on(&sample, |src, dst| {
                    zoom_blur(src, dst, count as f64, step, Enlargement::Corner, &mut workspace);
                });
                assert!(result == expected);
            });
        }
    }

    #[test]
    fn all_instructions_give_the_same_bytes() {
        let sizes = [(160, 10), (67, 41), (7, 3), (320, 4), (1, 1), (200, 60)];
        for (enlargement, (width, height)) in [Enlargement::WholePixels, Enlargement::Exact]
            .into_iter()
            .flat_map(|e| sizes.map(|size| (e, size)))
        {
            let bytes: Vec<u8> = (0..width * height * 3).map(|i| (i * 37 % 251) as u8).collect();
            let src = Frame::new(&bytes, width, height).unwrap();
            for (count, step) in [(11.0, 0.03), (12.5, 0.01), (30.0, 0.0), (5.0, 1.7)] {
                let mut results = Vec::new();
                crate::simd::with_each(|_| {
                    let mut dst = FrameBuf::new(width, height);
                    zoom_blur(src, dst.as_mut(), count, step, enlargement, &mut Workspace::default());
                    results.push(dst);
                });
                assert!(
                    results.iter().all(|result| *result == results[0]),
                    "{enlargement:?} {width} {count}"
                );
            }
        }
    }

    #[test]
    fn a_white_frame_stays_white() {
        let bytes = [255; 50 * 20 * 3];
        let src = Frame::new(&bytes, 50, 20).unwrap();
        for count in [0.0, 0.5, 1.0, 3.3, 12.0] {
            let mut dst = FrameBuf::new(50, 20);
            zoom_blur(src, dst.as_mut(), count, 0.03, Enlargement::Exact, &mut Workspace::default());
            assert!(dst.data().iter().all(|&v| v == 255));
        }
    }

    #[test]
    fn positions_beyond_the_last_pixel_are_black() {
        // 159 times 125 / 159 is more than 125 in double precision.
        let factor = 1.0 + 9.0 * ((1.0 + 0.03) - 1.0);
        assert!(Stretch::new(160, factor, Enlargement::WholePixels).tap(159).is_none());
        assert!((0..160).all(|x| Stretch::new(160, factor, Enlargement::Exact).tap(x).is_some()));
        let bytes = [255; 160 * 10 * 3];
        let src = Frame::new(&bytes, 160, 10).unwrap();
        for (enlargement, last) in [(Enlargement::WholePixels, 234), (Enlargement::Exact, 255)] {
            let mut dst = FrameBuf::new(160, 10);
            zoom_blur(src, dst.as_mut(), 11.0, 0.03, enlargement, &mut Workspace::default());
            assert_eq!([158, 159].map(|x| dst.as_ref().pixel(x, 5)), [[255; 3], [last; 3]]);
        }
    }
}
