//! What JPEG compression does to a frame, without the file.
//!
//! Baseline JPEG (ITU-T T.81) with the colour space of JFIF, chroma at half the resolution in both directions, the
//! tables of Annex K scaled as the Independent JPEG Group scales them, accurate integer transforms, and chroma
//! interpolated with a triangle filter. Entropy coding changes nothing, so it is left out: colours are converted,
//! transformed, quantised, and everything is undone again. The bytes are those of the usual encoder and decoder.

use crate::dct::{Blocks, LANES, forward, inverse};
use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::simd::vectorised;

/// The quantisation table of Annex K for luma, row by row.
pub const LUMA: [u8; 64] = [
    16, 11, 10, 16, 24, 40, 51, 61, //
    12, 12, 14, 19, 26, 58, 60, 55, //
    14, 13, 16, 24, 40, 57, 69, 56, //
    14, 17, 22, 29, 51, 87, 80, 62, //
    18, 22, 37, 56, 68, 109, 103, 77, //
    24, 35, 55, 64, 81, 104, 113, 92, //
    49, 64, 78, 87, 103, 121, 120, 101, //
    72, 92, 95, 98, 112, 100, 103, 99,
];
/// The quantisation table of Annex K for chroma, row by row.
pub const CHROMA: [u8; 64] = [
    17, 18, 24, 47, 99, 99, 99, 99, //
    18, 21, 26, 66, 99, 99, 99, 99, //
    24, 26, 56, 99, 99, 99, 99, 99, //
    47, 66, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99,
];

/// Colour conversions work with this many fractional bits.
const COLOUR_BITS: u32 = 16;
/// One half in that format.
const HALF: i32 = 1 << (COLOUR_BITS - 1);

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
    /// Rows that belong to the image.
    height: usize,
}

impl Plane {
    fn resize(&mut self, width: usize, height: usize) {
        (self.stride, self.height) = (width.next_multiple_of(8 * LANES), height);
        self.samples.resize(self.stride * height.next_multiple_of(8), 0);
    }

    fn row(&self, y: usize) -> &[u8] {
        &self.samples[y * self.stride..(y + 1) * self.stride]
    }

    fn row_mut(&mut self, y: usize) -> &mut [u8] {
        &mut self.samples[y * self.stride..(y + 1) * self.stride]
    }

    /// Repeats the last row down to the end of the last block, and takes every block through the transform.
    fn round_trip(&mut self, table: &Table, [first, second]: &mut [Vec<u8>; 2]) {
        let image = self.height * self.stride;
        for start in (image..self.samples.len()).step_by(self.stride) {
            self.samples.copy_within(image - self.stride..image, start);
        }
        first.resize(self.stride, 0);
        second.resize(self.stride, 0);
        for rows in self.samples.chunks_exact_mut(8 * self.stride) {
            // Three separations bring the first columns of all blocks to the front, then the second ones, and so on,
            // so that the same element of neighbouring blocks lies side by side.
            for row in rows.chunks_exact_mut(self.stride) {
                separate(row, first);
                separate(first, second);
                separate(second, row);
            }
            round_trip_blocks(rows, self.stride, table);
            for row in rows.chunks_exact_mut(self.stride) {
                interleave(row, first);
                interleave(first, second);
                interleave(second, row);
            }
        }
    }
}

/// The steps of quantisation, for coefficients times 8, and their reciprocals.
#[derive(Debug, Clone)]
struct Table {
    steps: [f32; 64],
    reciprocals: [f32; 64],
}

impl Table {
    /// A table of Annex K for a quality from 1 (coarsest) to 100.
    fn new(base: &[u8; 64], quality: f64) -> Self {
        // The percentage loses its fraction, as the scaling of the Independent JPEG Group has it.
        let percent = if quality < 50.0 { 5000.0 / quality } else { 200.0 - 2.0 * quality } as u32;
        let steps = base.map(|base| ((u32::from(base) * percent + 50) / 100).clamp(1, 255) as f32);
        Self { steps, reciprocals: steps.map(|step| 1.0 / (8.0 * step)) }
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
    let quality = quality.clamp(1.0, 100.0);
    to_planes(src, order, workspace);
    let [luma, chroma] = [Table::new(&LUMA, quality), Table::new(&CHROMA, quality)];
    for (plane, table) in workspace.planes.iter_mut().zip([&luma, &chroma, &chroma]) {
        plane.round_trip(table, &mut workspace.reordered);
    }
    from_planes(dst.reborrow(), order, workspace);
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

vectorised! {
    fn split_colours / split_colours_avx2 (
        from: &[u8], luma: &mut [u8], blue: &mut [u8], red: &mut [u8], exchanged: bool,
    ) {
        // The offset of 128, and a little less than one half, so that chroma stays below 256.
        let offset = (128 << COLOUR_BITS) + HALF - 1;
        let outputs = luma.iter_mut().zip(blue).zip(red);
        for (from, ((luma, blue), red)) in from.chunks_exact(CHANNELS).zip(outputs) {
            let [first, g, third] = [from[0], from[1], from[2]].map(i32::from);
            let (r, b) = if exchanged { (third, first) } else { (first, third) };
            *luma = ((19595 * r + 38470 * g + 7471 * b + HALF) >> COLOUR_BITS) as u8;
            *blue = ((-11059 * r - 21709 * g + 32768 * b + offset) >> COLOUR_BITS) as u8;
            *red = ((32768 * r - 27439 * g - 5329 * b + offset) >> COLOUR_BITS) as u8;
        }
    }
}

vectorised! {
    // The mean of four; one half is rounded down and up in turn.
    fn halve / halve_avx2 (upper: &[u8], lower: &[u8], out: &mut [u8]) {
        let sum = |upper: &[u8], lower: &[u8], bias: u16| {
            let pairs = [upper[0], upper[1], lower[0], lower[1]];
            ((pairs.into_iter().map(u16::from).sum::<u16>() + bias) >> 2) as u8
        };
        for ((out, upper), lower) in out.chunks_exact_mut(2).zip(upper.chunks_exact(4)).zip(lower.chunks_exact(4)) {
            out[0] = sum(&upper[..2], &lower[..2], 1);
            out[1] = sum(&upper[2..], &lower[2..], 2);
        }
    }
}

vectorised! {
    // The even elements, then the odd ones.
    fn separate / separate_avx2 (from: &[u8], to: &mut [u8]) {
        let (even, odd) = to.split_at_mut(from.len() / 2);
        for ((pair, even), odd) in from.chunks_exact(2).zip(even).zip(odd) {
            *even = pair[0];
            *odd = pair[1];
        }
    }
}

vectorised! {
    // Undoes `separate`.
    fn interleave / interleave_avx2 (from: &[u8], to: &mut [u8]) {
        let (even, odd) = from.split_at(from.len() / 2);
        for ((pair, even), odd) in to.chunks_exact_mut(2).zip(even).zip(odd) {
            pair[0] = *even;
            pair[1] = *odd;
        }
    }
}

vectorised! {
    fn round_trip_blocks / round_trip_blocks_avx2 (
        rows: &mut [u8], stride: usize, table: &Table,
    ) {
        let mut blocks: Blocks = [[0; LANES]; 64];
        for start in (0..stride / 8).step_by(LANES) {
            let place = |element: usize| element / 8 * stride + element % 8 * (stride / 8) + start;
            for (element, lanes) in blocks.iter_mut().enumerate() {
                for (value, &sample) in lanes.iter_mut().zip(&rows[place(element)..][..LANES]) {
                    *value = i32::from(sample) - 128;
                }
            }
            forward(&mut blocks);
            quantise(&mut blocks, table);
            inverse(&mut blocks);
            for (element, lanes) in blocks.iter().enumerate() {
                for (sample, &value) in rows[place(element)..][..LANES].iter_mut().zip(lanes) {
                    *sample = (value + 128).clamp(0, 255) as u8;
                }
            }
        }
    }
}

/// Rounds coefficients (times 8) to the nearest multiple of their step, halves away from zero.
#[inline(always)]
fn quantise(blocks: &mut Blocks, table: &Table) {
    /// Adding this to a number of magnitude below 2^22 leaves it, rounded, in the lower bits.
    const SHIFT: f32 = 12_582_912.0;
    for ((lanes, step), reciprocal) in blocks.iter_mut().zip(&table.steps).zip(&table.reciprocals) {
        for value in lanes {
            // Whole numbers moved by half a unit away from zero never lie half-way between two multiples of an even
            // step.
            let moved = *value as f32 + 0.5f32.copysign(*value as f32);
            let multiple = (moved * reciprocal + SHIFT) - SHIFT;
            *value = (multiple * step + SHIFT).to_bits() as i32 - SHIFT.to_bits() as i32;
        }
    }
}

vectorised! {
    fn add_rows / add_rows_avx2 (near: &[u8], far: &[u8], sums: &mut [u16]) {
        for ((sum, &near), &far) in sums.iter_mut().zip(near).zip(far) {
            *sum = 3 * u16::from(near) + u16::from(far);
        }
    }
}

vectorised! {
    // Two samples from each sum and its neighbours; one half is rounded up and down in turn.
    fn double / double_avx2 (sums: &[u16], out: &mut [u8]) {
        let (left, right) = (sums, &sums[2..]);
        for (((out, &left), &middle), &right) in out.chunks_exact_mut(2).zip(left).zip(&sums[1..]).zip(right) {
            out[0] = ((3 * middle + left + 8) >> 4) as u8;
            out[1] = ((3 * middle + right + 7) >> 4) as u8;
        }
    }
}

vectorised! {
    fn join_colours / join_colours_avx2 (
        luma: &[u8], blue: &[u8], red: &[u8], to: &mut [u8], exchanged: bool,
    ) {
        let inputs = luma.iter().zip(blue).zip(red);
        for (to, ((&luma, &blue), &red)) in to.chunks_exact_mut(CHANNELS).zip(inputs) {
            let (luma, blue, red) = (i32::from(luma), i32::from(blue) - 128, i32::from(red) - 128);
            let part = |sum: i32| (luma + ((sum + HALF) >> COLOUR_BITS)).clamp(0, 255) as u8;
            let (r, b) = (part(91881 * red), part(116130 * blue));
            (to[0], to[2]) = if exchanged { (b, r) } else { (r, b) };
            to[1] = part(-22554 * blue - 46802 * red);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::testing::{run_on, samples};

    fn compressed(src: Frame<'_>, quality: f64, order: ChannelOrder) -> FrameBuf {
        let mut dst = FrameBuf::new(src.width(), src.height());
        jpeg(src, dst.as_mut(), quality, order, &mut Workspace::default());
        dst
    }

    #[test]
    fn tables_scale_with_quality() {
        let first = |quality| Table::new(&LUMA, quality).steps[0];
        // 16 percent of 5000 / quality, or of 200 - 2 * quality, in whole percent.
        assert_eq!(
            [1.0, 5.0, 18.0, 30.0, 50.0, 75.0, 100.0].map(first),
            [255.0, 160.0, 44.0, 27.0, 16.0, 8.0, 1.0]
        );
    }

    #[test]
    fn quantisation_rounds_to_the_nearest_multiple_with_halves_away_from_zero() {
        for quality in [1.0, 10.0, 33.0, 75.0, 100.0] {
            let table = Table::new(&LUMA, quality);
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
    }
}
