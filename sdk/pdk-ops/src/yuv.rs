//! Between RGB and the planes of a video: ITU-R BT.601, luma from 16 to 235, chroma at half the width and height. Planes that a camera coded
//! in another way, which a [`Coding`] names, are read as well.
//!
//! A chroma sample lies on an even column, halfway between two rows, which is what H.264 means if it says nothing. All sums are of whole
//! numbers.

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::simd::vectorised;

/// Fraction bits of the coefficients.
const BITS: u32 = 16;
/// Luma of red, green and blue.
const LUMA: [i32; 3] = [16_829, 33_039, 6_416];
/// Blue and red chroma of red, green and blue. Each sums to zero, so that grey has none.
const CHROMA: [[i32; 3]; 2] = [[-9_714, -19_070, 28_784], [28_784, -24_103, -4_681]];

/// The matrix by which the planes of a video are made of red, green and blue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Matrix {
    /// ITU-R BT.601: 5 and 6 in ITU-T H.264, table E-5.
    #[default]
    Bt601,
    /// ITU-R BT.709: 1 in that table.
    Bt709,
}

/// How the planes of a video hold its colours. The default is BT.601 with luma from 16 to 235.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Coding {
    /// The matrix.
    pub matrix: Matrix,
    /// Whether luma and chroma take all values from 0 to 255. If not, luma lies from 16 to 235 and chroma from 16 to 240.
    pub full_range: bool,
}

/// What the planes of a coding add to red, green and blue.
struct Coefficients {
    /// Luma of black.
    black: i32,
    /// What luma adds to each channel.
    luma: i32,
    /// What red chroma adds to red, blue and red chroma to green, and blue chroma to blue.
    chroma: [i32; 4],
}

const BT601: Coefficients = coefficients([2_990, 1_140], false);
const BT601_FULL: Coefficients = coefficients([2_990, 1_140], true);
const BT709: Coefficients = coefficients([2_126, 722], false);
const BT709_FULL: Coefficients = coefficients([2_126, 722], true);

/// By the shares of red and blue in luma, in ten-thousandths.
const fn coefficients([red, blue]: [i64; 2], full_range: bool) -> Coefficients {
    /// Rounds half away from zero.
    const fn rounded(numerator: i64, denominator: i64) -> i32 {
        let half = if numerator < 0 { -denominator } else { denominator } / 2;
        ((numerator + half) / denominator) as i32
    }
    const ALL: i64 = 10_000;
    let green = ALL - red - blue;
    let [luma, chroma] = if full_range { [255, 255] } else { [219, 224] };
    let one = 255 << BITS;
    Coefficients {
        black: if full_range { 0 } else { 16 },
        luma: rounded(one, luma),
        chroma: [
            rounded(2 * (ALL - red) * one, ALL * chroma),
            rounded(-2 * blue * (ALL - blue) * one, green * ALL * chroma),
            rounded(-2 * red * (ALL - red) * one, green * ALL * chroma),
            rounded(2 * (ALL - blue) * one, ALL * chroma),
        ],
    }
}

/// Pixels of a row that are worked on at once: an even number.
const PART: usize = 512;

/// Luma, blue chroma and red chroma of a pixel.
pub fn components(pixel: [u8; 3]) -> [u8; 3] {
    let pixel = pixel.map(i32::from);
    let [blue, red] = CHROMA.map(|weights| chroma(weights, pixel, 0));
    [luma(pixel), blue, red]
}

/// Red, green and blue of a pixel with this luma, blue chroma and red chroma.
#[inline(always)]
pub fn colour(luma: u8, blue: u8, red: u8) -> [u8; 3] {
    coded_colour(&BT601, luma, blue, red)
}

#[inline(always)]
fn coded_colour(coefficients: &Coefficients, luma: u8, blue: u8, red: u8) -> [u8; 3] {
    let [blue, red] = [blue, red].map(|chroma| i32::from(chroma) - 128);
    let base = (i32::from(luma) - coefficients.black) * coefficients.luma + (1 << (BITS - 1));
    let [red_red, blue_green, red_green, blue_blue] = coefficients.chroma;
    let sums = [base + red_red * red, base + blue_green * blue + red_green * red, base + blue_blue * blue];
    sums.map(|sum| (sum >> BITS).clamp(0, 255) as u8)
}

/// Writes a frame of even width and height as luma, blue chroma and red chroma, each without gaps between its rows.
///
/// # Panics
/// If the width or height is odd, or the planes have another size.
pub fn from_rgb(src: Frame<'_>, [luma, blue, red]: [&mut [u8]; 3]) {
    let (width, height) = (src.width(), src.height());
    assert!(width.is_multiple_of(2) && height.is_multiple_of(2), "an odd width or height");
    assert_planes(width, height, [luma.len(), blue.len(), red.len()]);
    let halves = blue.chunks_exact_mut(width / 2).zip(red.chunks_exact_mut(width / 2));
    for (y, (luma, (blue, red))) in luma.chunks_exact_mut(2 * width).zip(halves).enumerate() {
        let (above, below) = luma.split_at_mut(width);
        rows_from_rgb(src.row(2 * y), src.row(2 * y + 1), above, below, blue, red);
    }
}

/// Writes luma, blue chroma and red chroma, each without gaps between its rows, as RGB. Chroma is interpolated between its samples. If the
/// width or height is odd, chroma has half of it, rounded up.
///
/// # Panics
/// If the planes have another size.
pub fn to_rgb(planes: [&[u8]; 3], dst: FrameMut<'_>) {
    coded_to_rgb(planes, Coding::default(), dst);
}

/// As [`to_rgb`], for planes of any coding.
///
/// # Panics
/// If the planes have another size.
pub fn coded_to_rgb([luma, blue, red]: [&[u8]; 3], coding: Coding, mut dst: FrameMut<'_>) {
    let row_to_rgb: RowToRgb = match (coding.matrix, coding.full_range) {
        (Matrix::Bt601, false) => row_from_bt601,
        (Matrix::Bt601, true) => row_from_bt601_full,
        (Matrix::Bt709, false) => row_from_bt709,
        (Matrix::Bt709, true) => row_from_bt709_full,
    };
    let (width, height) = (dst.width(), dst.height());
    assert_planes(width, height, [luma.len(), blue.len(), red.len()]);
    let half = width.div_ceil(2);
    for (y, luma) in luma.chunks_exact(width).enumerate() {
        let near = y / 2;
        let far = if y % 2 == 0 { near.saturating_sub(1) } else { (near + 1).min(height.div_ceil(2) - 1) };
        let [blue, red] = [blue, red].map(|plane| [near, far].map(|row| &plane[row * half..][..half]));
        row_to_rgb(luma, blue, red, dst.row_mut(y));
    }
}

fn assert_planes(width: usize, height: usize, lengths: [usize; 3]) {
    let chroma = width.div_ceil(2) * height.div_ceil(2);
    assert_eq!(lengths, [width * height, chroma, chroma], "planes of another size");
}

#[inline(always)]
fn weighted(weights: [i32; 3], values: [i32; 3]) -> i32 {
    weights[0] * values[0] + weights[1] * values[1] + weights[2] * values[2]
}

#[inline(always)]
fn luma(pixel: [i32; 3]) -> u8 {
    ((weighted(LUMA, pixel) + (16 << BITS) + (1 << (BITS - 1))) >> BITS) as u8
}

/// Of a sum of `1 << bits` pixels.
#[inline(always)]
fn chroma(weights: [i32; 3], sum: [i32; 3], bits: u32) -> u8 {
    let bits = BITS + bits;
    ((weighted(weights, sum) + (128 << bits) + (1 << (bits - 1))) >> bits).clamp(0, 255) as u8
}

vectorised! {
    /// Two rows of pixels, their luma and the row of chroma between them.
    fn rows_from_rgb / rows_from_rgb_avx2 / rows_from_rgb_avx512 (
        above: &[u8], below: &[u8], luma_above: &mut [u8], luma_below: &mut [u8], blue: &mut [u8], red: &mut [u8],
    ) {
        // Of two rows, after the last column of the part before. The first column has no neighbour to its left.
        let mut sums = [[0_u16; PART + 1]; CHANNELS];
        for (sums, (above, below)) in sums.iter_mut().zip(above.iter().zip(below)) {
            sums[PART] = u16::from(*above) + u16::from(*below);
        }
        let rows = above.chunks(PART * CHANNELS).zip(below.chunks(PART * CHANNELS));
        let lumas = luma_above.chunks_mut(PART).zip(luma_below.chunks_mut(PART));
        let chromas = blue.chunks_mut(PART / 2).zip(red.chunks_mut(PART / 2));
        for (((above, below), (luma_above, luma_below)), (blue, red)) in rows.zip(lumas).zip(chromas) {
            luma_row(above, luma_above);
            luma_row(below, luma_below);
            let [r, g, b] = &mut sums;
            (r[0], g[0], b[0]) = (r[PART], g[PART], b[PART]);
            let pixels = above.chunks_exact(CHANNELS).zip(below.chunks_exact(CHANNELS));
            for (((above, below), r), (g, b)) in pixels.zip(&mut r[1..]).zip(g[1..].iter_mut().zip(&mut b[1..])) {
                *r = u16::from(above[0]) + u16::from(below[0]);
                *g = u16::from(above[1]) + u16::from(below[1]);
                *b = u16::from(above[2]) + u16::from(below[2]);
            }
            chroma_row(&sums, blue, red);
        }
    }
}

#[inline(always)]
fn luma_row(pixels: &[u8], out: &mut [u8]) {
    for (out, pixel) in out.iter_mut().zip(pixels.chunks_exact(CHANNELS)) {
        *out = luma([i32::from(pixel[0]), i32::from(pixel[1]), i32::from(pixel[2])]);
    }
}

/// Three columns with the weights 1, 2 and 1, of sums of two rows: eight times a mean.
#[inline(always)]
fn chroma_row([r, g, b]: &[[u16; PART + 1]; CHANNELS], blue: &mut [u8], red: &mut [u8]) {
    let mean = |sums: &[u16; PART + 1], x: usize| {
        i32::from(sums[2 * x]) + 2 * i32::from(sums[2 * x + 1]) + i32::from(sums[2 * x + 2])
    };
    let count = blue.len().min(PART / 2);
    let (blue, red) = (&mut blue[..count], &mut red[..count]);
    for x in 0..count {
        let means = [mean(r, x), mean(g, x), mean(b, x)];
        blue[x] = chroma(CHROMA[0], means, 3);
        red[x] = chroma(CHROMA[1], means, 3);
    }
}

/// Writes a row of pixels, of which it gets the luma, and of either chroma the nearer row and the one on the other side.
type RowToRgb = fn(&[u8], [&[u8]; 2], [&[u8]; 2], &mut [u8]);

// Each coding has functions of its own, so that their coefficients are constants to the compiler.
vectorised! {
    fn row_from_bt601 / row_from_bt601_avx2 / row_from_bt601_avx512 (luma: &[u8], blue: [&[u8]; 2], red: [&[u8]; 2], out: &mut [u8]) {
        row_to_rgb(&BT601, luma, blue, red, out);
    }
}
vectorised! {
    fn row_from_bt601_full / row_from_bt601_full_avx2 / row_from_bt601_full_avx512 (
        luma: &[u8], blue: [&[u8]; 2], red: [&[u8]; 2], out: &mut [u8],
    ) {
        row_to_rgb(&BT601_FULL, luma, blue, red, out);
    }
}
vectorised! {
    fn row_from_bt709 / row_from_bt709_avx2 / row_from_bt709_avx512 (luma: &[u8], blue: [&[u8]; 2], red: [&[u8]; 2], out: &mut [u8]) {
        row_to_rgb(&BT709, luma, blue, red, out);
    }
}
vectorised! {
    fn row_from_bt709_full / row_from_bt709_full_avx2 / row_from_bt709_full_avx512 (
        luma: &[u8], blue: [&[u8]; 2], red: [&[u8]; 2], out: &mut [u8],
    ) {
        row_to_rgb(&BT709_FULL, luma, blue, red, out);
    }
}

#[inline(always)]
fn row_to_rgb(coefficients: &Coefficients, luma: &[u8], blue: [&[u8]; 2], red: [&[u8]; 2], out: &mut [u8]) {
    let mut chroma = [[0; PART]; 2];
    for (part, (luma, out)) in luma.chunks(PART).zip(out.chunks_mut(PART * CHANNELS)).enumerate() {
        let [blue_wide, red_wide] = &mut chroma;
        widen(blue, part * (PART / 2), blue_wide);
        widen(red, part * (PART / 2), red_wide);
        let pixels = out.chunks_exact_mut(CHANNELS).zip(luma);
        for ((out, &luma), (&blue, &red)) in pixels.zip(blue_wide.iter().zip(&*red_wide)) {
            let [r, g, b] = coded_colour(coefficients, luma, blue, red);
            (out[0], out[1], out[2]) = (r, g, b);
        }
    }
}

/// Chroma of the pixels of a part, from the row of samples that is nearer to them and the one on their other side. A sample lies on the
/// left of two columns; the right one has the mean of it and the next, and the last column has no neighbour to its right.
#[inline(always)]
fn widen([near, far]: [&[u8]; 2], start: usize, out: &mut [u8; PART]) {
    let (near, far) = (&near[start..], &far[start..]);
    let whole = near.len().min(PART / 2 + 1);
    let mut sums = [0_u16; PART / 2 + 1];
    for ((sum, &near), &far) in sums.iter_mut().zip(near).zip(far) {
        *sum = 3 * u16::from(near) + u16::from(far);
    }
    if whole <= PART / 2 {
        sums[whole] = sums[whole - 1];
    }
    for (out, (&left, &right)) in out.chunks_exact_mut(2).zip(sums.iter().zip(&sums[1..])) {
        out[0] = ((2 * left + 4) >> 3) as u8;
        out[1] = ((left + right + 4) >> 3) as u8;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::simd::with_each;
    use crate::testing::{run, samples};

    /// Pixel by pixel.
    fn plain_from_rgb(src: Frame<'_>) -> [Vec<u8>; 3] {
        let (width, height) = (src.width(), src.height());
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| src.pixel(x, y).map(i32::from)));
        let luma = pixels.map(luma).collect();
        let halves = CHROMA.map(|weights| {
            let mut plane = Vec::new();
            for y in 0..height / 2 {
                for x in 0..width / 2 {
                    let mut sum = [0; 3];
                    for (column, weight) in [((2 * x).saturating_sub(1), 1), (2 * x, 2), (2 * x + 1, 1)] {
                        for row in [2 * y, 2 * y + 1] {
                            let pixel = src.pixel(column, row);
                            for c in 0..3 {
                                sum[c] += weight * i32::from(pixel[c]);
                            }
                        }
                    }
                    plane.push(chroma(weights, sum, 3));
                }
            }
            plane
        });
        let [blue, red] = halves;
        [luma, blue, red]
    }

    const CODINGS: [(Matrix, bool, Coefficients); 4] = [
        (Matrix::Bt601, false, BT601),
        (Matrix::Bt601, true, BT601_FULL),
        (Matrix::Bt709, false, BT709),
        (Matrix::Bt709, true, BT709_FULL),
    ];

    /// Pixel by pixel.
    fn plain_to_rgb(
        coefficients: &Coefficients,
        [luma, blue, red]: [&[u8]; 3],
        width: usize,
        height: usize,
    ) -> FrameBuf {
        let (half, half_height) = (width.div_ceil(2), height.div_ceil(2));
        let mut out = FrameBuf::new(width, height);
        for y in 0..height {
            let near = y / 2;
            let far = if y % 2 == 0 { near.max(1) - 1 } else { (near + 1).min(half_height - 1) };
            for x in 0..width {
                let [blue, red] = [blue, red].map(|plane| {
                    let fourfold = |x: usize| {
                        let x = x.min(half - 1);
                        3 * u32::from(plane[near * half + x]) + u32::from(plane[far * half + x])
                    };
                    ((fourfold(x / 2) + fourfold(x.div_ceil(2)) + 4) / 8) as u8
                });
                out.as_mut().set_pixel(x, y, coded_colour(coefficients, luma[y * width + x], blue, red));
            }
        }
        out
    }

    fn assert_planes_match(src: Frame<'_>) {
        let expected = plain_from_rgb(src);
        with_each(|instructions| {
            let mut planes = expected.each_ref().map(|plane| vec![0xa5; plane.len()]);
            from_rgb(src, planes.each_mut().map(Vec::as_mut_slice));
            assert_eq!(planes, expected, "{instructions:?}, {} x {}", src.width(), src.height());
        });
    }

    /// Of any bytes, three for each pixel.
    fn assert_rgb_matches(bytes: &[u8], width: usize, height: usize) {
        let half = width.div_ceil(2) * height.div_ceil(2);
        let [luma, blue] = [&bytes[..width * height], &bytes[width * height..][..half]];
        let planes = [luma, blue, &bytes[bytes.len() - half..]];
        for (matrix, full_range, coefficients) in &CODINGS {
            let coding = Coding { matrix: *matrix, full_range: *full_range };
            let result = run(width, height, |dst| coded_to_rgb(planes, coding, dst));
            assert_eq!(
                result,
                plain_to_rgb(coefficients, planes, width, height),
                "{coding:?}, {width} x {height}"
            );
        }
        assert_eq!(
            run(width, height, |dst| to_rgb(planes, dst)),
            run(width, height, |dst| coded_to_rgb(planes, Coding::default(), dst))
        );
    }

    #[test]
    fn the_coefficients_of_the_default_are_those_of_bt_601() {
        assert_eq!(
            (BT601.black, BT601.luma, BT601.chroma),
            (16, 76_309, [104_597, -25_675, -53_279, 132_201])
        );
    }

    /// ITU-T H.264, equations E-20 to E-27, solved for red, green and blue.
    #[test]
    fn colours_of_each_coding_are_within_a_level_of_the_standard() {
        for (matrix, full_range, coefficients) in &CODINGS {
            let [kr, kb] = if *matrix == Matrix::Bt601 { [0.299, 0.114] } else { [0.2126, 0.0722] };
            let [black, of_luma, of_chroma] =
                if *full_range { [0.0, 255.0, 255.0] } else { [16.0, 219.0, 224.0] };
            for values in (0..256 * 256 * 256).step_by(37) {
                let [luma, blue, red] = [values >> 16, values >> 8, values].map(|value| value as u8);
                let y = (f64::from(luma) - black) / of_luma;
                let [pb, pr] = [blue, red].map(|chroma| (f64::from(chroma) - 128.0) / of_chroma);
                let (r, b) = (y + 2.0 * (1.0 - kr) * pr, y + 2.0 * (1.0 - kb) * pb);
                let wanted = [r, (y - kr * r - kb * b) / (1.0 - kr - kb), b];
                let found = coded_colour(coefficients, luma, blue, red);
                for (wanted, found) in wanted.into_iter().zip(found) {
                    let off = (f64::from(found) - (255.0 * wanted).clamp(0.0, 255.0)).abs();
                    assert!(off < 0.6, "{matrix:?} {full_range} {luma} {blue} {red}: {off}");
                }
            }
        }
    }

    #[test]
    fn long_rows_are_joined_from_their_parts() {
        for width in [PART - 2, PART, PART + 2, 2 * PART, 2 * PART + 4] {
            let bytes: Vec<u8> = (0..width * 12).map(|i| (i * i % 251 + i % 5) as u8).collect();
            assert_planes_match(Frame::new(&bytes, width, 4).unwrap());
            for width in [width, width + 1] {
                assert_rgb_matches(&bytes[..width * 9], width, 3);
            }
        }
    }

    proptest! {
        #[test]
        fn planes_match_the_plain_version(sample in samples()) {
            let src = sample.frame();
            let (width, height) = (src.width() & !1, src.height() & !1);
            prop_assume!(width > 0 && height > 0);
            assert_planes_match(Frame::with_stride(src.data(), width, height, src.stride()).unwrap());
        }

        #[test]
        fn rgb_matches_the_plain_version(sample in samples()) {
            let src = sample.frame();
            let bytes: Vec<u8> = src.rows().flatten().copied().collect();
            assert_rgb_matches(&bytes, src.width(), src.height());
        }
    }
}
