//! What JPEG compression does to a frame, without the file.
//!
//! Baseline JPEG (ITU-T T.81) with the colour space of JFIF, chroma at half the resolution in both directions, the
//! tables of Annex K scaled as the Independent JPEG Group scales them, accurate integer transforms, and chroma
//! interpolated with a triangle filter. Entropy coding changes nothing, so it is left out: colours are converted,
//! transformed, quantised, and everything is undone again. The bytes are those of the usual encoder and decoder.

mod blocks;
mod colours;
mod levels;

pub use levels::{LARGEST, LARGEST_SUM, Levels, PlaneLevels, Quantisation};

use crate::dct::LANES;
use crate::frame::{Frame, FrameMut};
use blocks::{compress_blocks, decompress_blocks, interleave_columns, round_trip_blocks, separate_columns};
use colours::{add_rows, double, halve, join_colours, split_colours};
use levels::Table;

/// Which channel is taken for which colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChannelOrder {
    /// As they are.
    Rgb,
    /// The first for blue and the third for red, so that their weights in the luma are exchanged.
    Bgr,
}

/// What [`jpeg`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    /// Luma, and the two chroma planes at half the resolution.
    planes: [Plane; 3],
    /// Two rows of each chroma channel at full resolution, one after the other; later one row of each.
    chroma: [Vec<u8>; 2],
    /// Rows whose columns are being brought into another order.
    reordered: [Vec<u8>; 2],
    /// A row of sums of neighbouring chroma rows, with one more element at each end.
    sums: Vec<u16>,
}

/// Samples, padded to whole groups of blocks.
#[derive(Debug, Clone, Default)]
struct Plane {
    samples: Vec<u8>,
    /// Bytes from one row to the next: the width, rounded up to whole groups of blocks.
    stride: usize,
    /// Columns and rows that belong to the image.
    width: usize,
    height: usize,
}

impl Plane {
    fn resize(&mut self, width: usize, height: usize) {
        (self.stride, self.width, self.height) = (width.next_multiple_of(8 * LANES), width, height);
        self.samples.resize(self.stride * height.next_multiple_of(8), 0);
    }

    fn row(&self, y: usize) -> &[u8] {
        &self.samples[y * self.stride..(y + 1) * self.stride]
    }

    fn row_mut(&mut self, y: usize) -> &mut [u8] {
        &mut self.samples[y * self.stride..(y + 1) * self.stride]
    }

    /// Repeats the last row down to the end of the last block.
    fn pad(&mut self) {
        let image = self.height * self.stride;
        for start in (image..self.samples.len()).step_by(self.stride) {
            self.samples.copy_within(image - self.stride..image, start);
        }
    }

    /// Takes every block through the transform, there and back.
    fn round_trip(&mut self, table: &Table, spare: &mut [Vec<u8>; 2]) {
        self.pad();
        for rows in self.samples.chunks_exact_mut(8 * self.stride) {
            separate_columns(rows, self.stride, spare);
            round_trip_blocks(rows, self.stride, table);
            interleave_columns(rows, self.stride, spare);
        }
    }

    /// The levels of every block.
    fn compress(&mut self, table: &Table, spare: &mut [Vec<u8>; 2], levels: &mut PlaneLevels) {
        self.pad();
        levels.resize(self.stride / 8, self.height.div_ceil(8));
        let strips = self.samples.chunks_exact_mut(8 * self.stride);
        for (rows, levels) in strips.zip(levels.values.chunks_exact_mut(8 * self.stride)) {
            separate_columns(rows, self.stride, spare);
            compress_blocks(rows, self.stride, table, levels);
        }
    }

    /// The samples of every block.
    fn decompress(&mut self, table: &Table, spare: &mut [Vec<u8>; 2], levels: &PlaneLevels) {
        let strips = self.samples.chunks_exact_mut(8 * self.stride);
        for (rows, levels) in strips.zip(levels.values.chunks_exact(8 * self.stride)) {
            decompress_blocks(levels, table, rows, self.stride);
            interleave_columns(rows, self.stride, spare);
        }
    }
}

/// Compresses and decompresses a frame at a quality from 1 to 100; what lies outside counts as the nearest.
///
/// # Panics
/// If the sizes of the frames differ.
pub fn jpeg(
    src: Frame<'_>,
    mut dst: FrameMut<'_>,
    quality: f64,
    order: ChannelOrder,
    workspace: &mut Workspace,
) {
    assert!(src.same_size(&dst.as_ref()), "jpeg between frames of different size");
    let quantisation = Quantisation::of_quality(quality);
    to_planes(src, order, workspace);
    for (number, plane) in workspace.planes.iter_mut().enumerate() {
        plane.round_trip(quantisation.table(number), &mut workspace.reordered);
    }
    from_planes(dst.reborrow(), order, workspace);
}

/// The first half of [`jpeg`]: the levels of a frame.
pub fn compress(src: Frame<'_>, quantisation: &Quantisation, workspace: &mut Workspace, levels: &mut Levels) {
    to_planes(src, ChannelOrder::Rgb, workspace);
    let planes = workspace.planes.iter_mut().zip(&mut levels.planes).enumerate();
    for (number, (plane, levels)) in planes {
        plane.compress(quantisation.table(number), &mut workspace.reordered, levels);
    }
}

/// The second half: the frame of the levels that were compressed with this workspace last.
///
/// # Panics
/// If the frame or the levels are not of the size that was compressed.
pub fn decompress(
    levels: &Levels,
    quantisation: &Quantisation,
    workspace: &mut Workspace,
    mut dst: FrameMut<'_>,
) {
    let luma = &workspace.planes[0];
    assert!(
        luma.width == dst.width() && luma.height == dst.height(),
        "decompression into a frame of another size"
    );
    let planes = workspace.planes.iter_mut().zip(&levels.planes).enumerate();
    for (number, (plane, levels)) in planes {
        assert!(levels.values.len() == plane.samples.len(), "decompression of levels of another size");
        plane.decompress(quantisation.table(number), &mut workspace.reordered, levels);
    }
    from_planes(dst.reborrow(), ChannelOrder::Rgb, workspace);
}

fn to_planes(src: Frame<'_>, order: ChannelOrder, workspace: &mut Workspace) {
    let (width, height) = (src.width(), src.height());
    let Workspace { planes: [luma, blue, red], chroma: [blue_rows, red_rows], .. } = workspace;
    luma.resize(width, height);
    for plane in [&mut *blue, &mut *red] {
        plane.resize(width.div_ceil(2), height.div_ceil(2));
    }
    let full = 2 * blue.stride;
    for rows in [&mut *blue_rows, &mut *red_rows] {
        rows.resize(2 * full, 0);
    }
    for pair in 0..height.div_ceil(2) {
        for half in 0..2 {
            // Under an odd number of rows the last one counts twice.
            let y = (2 * pair + half).min(height - 1);
            let row = half * full..half * full + full;
            let (out, blue, red) = (luma.row_mut(y), &mut blue_rows[row.clone()], &mut red_rows[row]);
            split_colours(src.row(y), out, blue, red, order == ChannelOrder::Bgr);
            for row in [out, blue, red] {
                let last = row[width - 1];
                row[width..].fill(last);
            }
        }
        for (rows, plane) in [(&*blue_rows, &mut *blue), (&*red_rows, &mut *red)] {
            let (upper, lower) = rows.split_at(full);
            halve(upper, lower, plane.row_mut(pair));
        }
    }
}

fn from_planes(mut dst: FrameMut<'_>, order: ChannelOrder, workspace: &mut Workspace) {
    let (width, height) = (dst.width(), dst.height());
    let Workspace { planes: [luma, blue, red], chroma: [blue_row, red_row], sums, .. } = workspace;
    let columns = width.div_ceil(2);
    sums.resize(columns + 2, 0);
    for y in 0..height {
        let near = y / 2;
        let far = if y % 2 == 0 { near.saturating_sub(1) } else { (near + 1).min(blue.height - 1) };
        for (plane, out) in [(&*blue, &mut *blue_row), (&*red, &mut *red_row)] {
            let (near, out) = (&plane.row(near)[..columns], &mut out[..2 * columns]);
            if columns > 2 {
                add_rows(near, &plane.row(far)[..columns], &mut sums[1..=columns]);
                (sums[0], sums[columns + 1]) = (sums[1], sums[columns]);
                double(sums, out);
            } else {
                // Decoders repeat samples where there are hardly any.
                out.chunks_exact_mut(2).zip(near).for_each(|(pair, &sample)| pair.fill(sample));
            }
        }
        let (luma, blue, red) = (&luma.row(y)[..width], &blue_row[..width], &red_row[..width]);
        join_colours(luma, blue, red, dst.row_mut(y), order == ChannelOrder::Bgr);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::blocks::quantise;
    use super::*;
    use crate::dct::Blocks;
    use crate::frame::FrameBuf;
    use crate::testing::{run_on, samples};

    fn compressed(src: Frame<'_>, quality: f64, order: ChannelOrder) -> FrameBuf {
        let mut dst = FrameBuf::new(src.width(), src.height());
        jpeg(src, dst.as_mut(), quality, order, &mut Workspace::default());
        dst
    }

    #[test]
    fn tables_scale_with_quality() {
        let first = |quality| Quantisation::of_quality(quality).steps(0)[0];
        // 16 percent of 5000 / quality, or of 200 - 2 * quality, in whole percent.
        assert_eq!(
            [1.0, 5.0, 18.0, 30.0, 50.0, 75.0, 100.0].map(first),
            [255.0, 160.0, 44.0, 27.0, 16.0, 8.0, 1.0]
        );
    }

    #[test]
    fn quantisation_rounds_to_the_nearest_multiple_with_halves_away_from_zero() {
        for quality in [1.0, 10.0, 33.0, 75.0, 100.0] {
            let Quantisation { luma: table, .. } = Quantisation::of_quality(quality);
            for start in (-16384i32..16384).step_by(64) {
                let mut blocks: Blocks = std::array::from_fn(|i| [start + i as i32; LANES]);
                quantise(&mut blocks, &table);
                for (i, [actual, ..]) in blocks.into_iter().enumerate() {
                    let (value, step) = (start + i as i32, table.steps[i] as i32);
                    let multiple = (value.abs() + 4 * step) / (8 * step) * step;
                    assert_eq!(actual, multiple * value.signum(), "{value} by {step}");
                }
            }
        }
    }

    #[test]
    fn exchanging_channels_twice_changes_nothing() {
        let bytes: Vec<u8> = (0..37 * 21 * 3).map(|i| (i * i / 7 % 256) as u8).collect();
        let exchanged: Vec<u8> = bytes.chunks(3).flat_map(|p| [p[2], p[1], p[0]]).collect();
        let bgr = compressed(Frame::new(&exchanged, 37, 21).unwrap(), 20.0, ChannelOrder::Bgr);
        let rgb = compressed(Frame::new(&bytes, 37, 21).unwrap(), 20.0, ChannelOrder::Rgb);
        assert!(bgr.data().chunks(3).zip(rgb.data().chunks(3)).all(|(a, b)| a == [b[2], b[1], b[0]]));
        assert_ne!(rgb, compressed(Frame::new(&bytes, 37, 21).unwrap(), 20.0, ChannelOrder::Bgr));
    }

    #[test]
    fn grey_frames_at_full_quality_stay_within_rounding() {
        let bytes: Vec<u8> = (0..40 * 24).flat_map(|i| [(i * 31 % 256) as u8; 3]).collect();
        let out = compressed(Frame::new(&bytes, 40, 24).unwrap(), 100.0, ChannelOrder::Rgb);
        assert!(bytes.iter().zip(out.data()).all(|(a, b)| a.abs_diff(*b) <= 2));
    }

    #[test]
    fn chroma_has_half_the_resolution() {
        // Red and green columns of equal luma in turn come out as their mean.
        let bytes: Vec<u8> =
            (0..32 * 16).flat_map(|i| if i % 2 == 0 { [196, 0, 0] } else { [0, 100, 0] }).collect();
        let out = compressed(Frame::new(&bytes, 32, 16).unwrap(), 100.0, ChannelOrder::Rgb);
        for pixel in out.data().chunks(3) {
            assert!(pixel[0].abs_diff(98) <= 3 && pixel[1].abs_diff(50) <= 3 && pixel[2] <= 3, "{pixel:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn a_kept_workspace_and_the_instruction_set_change_nothing(sample in samples(), quality in 0.0..110.0) {
            let src = sample.frame();
            let expected = compressed(src, quality, ChannelOrder::Bgr);
            let mut kept = Workspace::default();
            let large = FrameBuf::new(90, 33);
            jpeg(large.as_ref(), large.clone().as_mut(), 3.0, ChannelOrder::Rgb, &mut kept);
            let result = run_on(&sample, |src, dst| jpeg(src, dst, quality, ChannelOrder::Bgr, &mut kept));
            prop_assert_eq!(result, expected);
        }

        #[test]
        fn the_two_halves_are_the_whole(sample in samples(), quality in 0.0..110.0) {
            let expected = compressed(sample.frame(), quality, ChannelOrder::Rgb);
            let quantisation = Quantisation::of_quality(quality);
            let result = run_on(&sample, |src, mut dst| {
                let (mut workspace, mut levels) = (Workspace::default(), Levels::default());
                compress(src, &quantisation, &mut workspace, &mut levels);
                for (plane, levels) in levels.planes.iter().enumerate() {
                    for block in (0..levels.rows).flat_map(|row| (0..levels.columns).map(move |column| [row, column])) {
                        let levels = levels.block(block, &std::array::from_fn(|place| place)).into_iter();
                        let sum: i32 = levels
                            .zip(quantisation.steps(plane))
                            .map(|(level, step)| i32::from(level).abs() * *step as i32)
                            .sum();
                        assert!(sum <= LARGEST_SUM, "{sum}");
                    }
                }
                decompress(&levels, &quantisation, &mut workspace, dst.reborrow());
            });
            prop_assert_eq!(result, expected);
        }
    }
}
