//! Between RGB and the planes of a video: ITU-R BT.601, luma from 16 to 235, chroma at half the width and height.
//!
//! A chroma sample lies on an even column, halfway between two rows, which is what H.264 means if it says nothing.

use pdk_sdk::prelude::*;

/// Fraction bits of the coefficients.
const BITS: u32 = 16;
/// Luma of red, green and blue.
const LUMA: [i32; 3] = [16_829, 33_039, 6_416];
/// Blue and red chroma of red, green and blue. Each sums to zero, so that grey has none.
const CHROMA: [[i32; 3]; 2] = [[-9_714, -19_070, 28_784], [28_784, -24_103, -4_681]];
/// What luma adds to each channel.
const FROM_LUMA: i32 = 76_309;
/// What red chroma adds to red, blue and red chroma to green, and blue chroma to blue.
const FROM_CHROMA: [i32; 4] = [104_597, -25_675, -53_279, 132_201];

/// A picture as a video has it: luma, then blue chroma and red chroma, each without gaps between its rows.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Yuv420 {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The three planes; those of chroma have half the width and height, rounded up.
    pub data: Vec<u8>,
    /// Chroma of one row at full width, before it is divided.
    workspace: [Vec<u16>; 3],
}

impl Yuv420 {
    /// Takes a size, and makes room for the planes.
    pub fn reset(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.data.resize(width * height + 2 * width.div_ceil(2) * height.div_ceil(2), 0);
    }

    /// Luma, blue chroma and red chroma.
    pub fn planes(&self) -> [&[u8]; 3] {
        let (luma, chroma) = self.data.split_at(self.width * self.height);
        let (blue, red) = chroma.split_at(chroma.len() / 2);
        [luma, blue, red]
    }

    /// Luma, blue chroma and red chroma.
    pub fn planes_mut(&mut self) -> [&mut [u8]; 3] {
        split_mut(&mut self.data, self.width * self.height)
    }

    /// Takes the size and the picture of a frame whose width and height are even.
    pub(crate) fn fill(&mut self, frame: Frame<'_>) {
        let (width, height) = (frame.width(), frame.height());
        self.reset(width, height);
        let [luma, blue, red] = split_mut(&mut self.data, width * height);
        for (out, row) in luma.chunks_exact_mut(width).zip(frame.rows()) {
            for (out, pixel) in out.iter_mut().zip(row.chunks_exact(3)) {
                let sum = weighted(LUMA, [pixel[0], pixel[1], pixel[2]].map(i32::from));
                *out = ((sum + (16 << BITS) + (1 << (BITS - 1))) >> BITS) as u8;
            }
        }
        // Two rows are added, then three columns with the weights 1, 2 and 1: eight times a mean.
        let sums = &mut self.workspace[0];
        sums.resize(width * 3, 0);
        for (y, (blue, red)) in
            blue.chunks_exact_mut(width / 2).zip(red.chunks_exact_mut(width / 2)).enumerate()
        {
            for (sum, (a, b)) in sums.iter_mut().zip(frame.row(2 * y).iter().zip(frame.row(2 * y + 1))) {
                *sum = u16::from(*a) + u16::from(*b);
            }
            for (x, (blue, red)) in blue.iter_mut().zip(red).enumerate() {
                let left = (2 * x).saturating_sub(1);
                let mean = [0, 1, 2].map(|c| {
                    i32::from(sums[left * 3 + c])
                        + 2 * i32::from(sums[2 * x * 3 + c])
                        + i32::from(sums[(2 * x + 1) * 3 + c])
                });
                for (out, weights) in [blue, red].into_iter().zip(CHROMA) {
                    let sum = weighted(weights, mean) + (128 << (BITS + 3)) + (1 << (BITS + 2));
                    *out = (sum >> (BITS + 3)).clamp(0, 255) as u8;
                }
            }
        }
    }

    /// Luma, blue chroma and red chroma of a pixel.
    pub fn components(pixel: [u8; 3]) -> [u8; 3] {
        let pixel = pixel.map(i32::from);
        let half = 1 << (BITS - 1);
        let [blue, red] = CHROMA.map(|weights| (weighted(weights, pixel) + (128 << BITS) + half) >> BITS);
        [(weighted(LUMA, pixel) + (16 << BITS) + half) >> BITS, blue, red]
            .map(|value| value.clamp(0, 255) as u8)
    }

    /// Red, green and blue of a pixel with this luma, blue chroma and red chroma.
    pub fn colour(luma: u8, blue: u8, red: u8) -> [u8; 3] {
        let [blue, red] = [blue, red].map(|chroma| i32::from(chroma) - 128);
        colour(luma, blue, red)
    }

    /// Writes the picture as RGB; chroma is interpolated between its samples.
    ///
    /// # Panics
    /// If the frame has another size.
    pub fn to_rgb(&mut self, mut into: FrameMut<'_>) {
        let (width, height) = (self.width, self.height);
        assert_eq!((into.width(), into.height()), (width, height), "a frame of another size");
        let (half, half_height) = (width.div_ceil(2), height.div_ceil(2));
        let (luma, chroma) = self.data.split_at(width * height);
        let (blue, red) = chroma.split_at(chroma.len() / 2);
        let [_, blue_row, red_row] = &mut self.workspace;
        for y in 0..height {
            let near = y / 2;
            let far = if y % 2 == 0 { near.saturating_sub(1) } else { (near + 1).min(half_height - 1) };
            for (row, plane) in [(&mut *blue_row, blue), (&mut *red_row, red)] {
                row.resize(half + 1, 0);
                let (near, far) = (&plane[near * half..][..half], &plane[far * half..][..half]);
                for ((out, &near), &far) in row.iter_mut().zip(near).zip(far) {
                    *out = 3 * u16::from(near) + u16::from(far);
                }
                // The last column has no neighbour to its right.
                row[half] = row[half - 1];
            }
            // A chroma sample lies on the left of two columns; the right one has the mean of it and the next.
            let pairs = into.row_mut(y).chunks_mut(6).zip(luma[y * width..][..width].chunks(2));
            for ((out, luma), (blue, red)) in pairs.zip(blue_row.windows(2).zip(red_row.windows(2))) {
                let chroma = [[2 * blue[0], 2 * red[0]], [blue[0] + blue[1], red[0] + red[1]]];
                for ((out, &luma), chroma) in out.chunks_exact_mut(3).zip(luma).zip(chroma) {
                    let [blue, red] = chroma.map(|eightfold| i32::from((eightfold + 4) >> 3) - 128);
                    out.copy_from_slice(&colour(luma, blue, red));
                }
            }
        }
    }
}

fn split_mut(data: &mut [u8], pixels: usize) -> [&mut [u8]; 3] {
    let (luma, chroma) = data.split_at_mut(pixels);
    let (blue, red) = chroma.split_at_mut(chroma.len() / 2);
    [luma, blue, red]
}

/// A pixel of this luma, and of chroma that is 0 for grey.
#[inline]
fn colour(luma: u8, blue: i32, red: i32) -> [u8; 3] {
    let base = (i32::from(luma) - 16) * FROM_LUMA + (1 << (BITS - 1));
    let [red_red, blue_green, red_green, blue_blue] = FROM_CHROMA;
    let sums = [base + red_red * red, base + blue_green * blue + red_green * red, base + blue_blue * blue];
    sums.map(|sum| (sum >> BITS).clamp(0, 255) as u8)
}

fn weighted(weights: [i32; 3], values: [i32; 3]) -> i32 {
    weights[0] * values[0] + weights[1] * values[1] + weights[2] * values[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ITU-R BT.601 in plain arithmetic.
    fn reference([r, g, b]: [f64; 3]) -> [f64; 3] {
        let luma = 0.299 * r + 0.587 * g + 0.114 * b;
        [
            16.0 + luma * 219.0 / 255.0,
            128.0 + (b - luma) * 112.0 / 255.0 / 0.886,
            128.0 + (r - luma) * 112.0 / 255.0 / 0.701,
        ]
    }

    fn picture(width: usize, height: usize) -> FrameBuf {
        let bytes = (0..width * height * 3).map(|i| (i * i % 251 + i % 5) as u8).collect();
        FrameBuf::from_vec(bytes, width, height).unwrap()
    }

    #[test]
    fn one_colour_becomes_what_the_recommendation_says_and_comes_back() {
        for r in (0..=255u8).step_by(51) {
            for g in (0..=255u8).step_by(17) {
                for b in (0..=255u8).step_by(51) {
                    let frame = FrameBuf::from_vec([r, g, b].repeat(8), 4, 2).unwrap();
                    let mut yuv = Yuv420::default();
                    yuv.fill(frame.as_ref());
                    let wanted = reference([r, g, b].map(f64::from));
                    for (plane, wanted) in yuv.planes().into_iter().zip(wanted) {
                        for &value in plane {
                            let off = (f64::from(value) - wanted).abs();
                            assert!(off < 0.51, "{r} {g} {b}: {value} {wanted}");
                        }
                    }
                    let [luma, blue, red] = Yuv420::components([r, g, b]);
                    assert_eq!(yuv.planes().map(|plane| plane[0]), [luma, blue, red]);
                    let mut back = FrameBuf::new(4, 2);
                    yuv.to_rgb(back.as_mut());
                    for (a, b) in frame.data().iter().zip(back.data()) {
                        assert!(a.abs_diff(*b) <= 2, "{:?} {:?}", frame.data(), back.data());
                    }
                }
            }
        }
    }

    #[test]
    fn chroma_is_the_mean_around_an_even_column() {
        let frame = picture(12, 6);
        let mut yuv = Yuv420::default();
        yuv.fill(frame.as_ref());
        let [_, blue, red] = yuv.planes();
        for y in 0..3 {
            for x in 0..6usize {
                let mut mean = [0.0; 3];
                for (column, weight) in [((2 * x).saturating_sub(1), 0.25), (2 * x, 0.5), (2 * x + 1, 0.25)] {
                    for row in [2 * y, 2 * y + 1] {
                        let pixel = frame.as_ref().pixel(column, row);
                        for c in 0..3 {
                            mean[c] += 0.5 * weight * f64::from(pixel[c]);
                        }
                    }
                }
                let wanted = reference(mean);
                assert!((f64::from(blue[y * 6 + x]) - wanted[1]).abs() < 0.51);
                assert!((f64::from(red[y * 6 + x]) - wanted[2]).abs() < 0.51);
            }
        }
    }

    #[test]
    fn a_flat_picture_of_any_size_stays_flat() {
        let mut yuv = Yuv420::default();
        for (width, height) in [(1, 1), (2, 1), (3, 5), (8, 6), (7, 72)] {
            yuv.reset(width, height);
            for (plane, value) in yuv.planes_mut().into_iter().zip([90, 60, 200]) {
                plane.fill(value);
            }
            let mut rgb = FrameBuf::new(width, height);
            yuv.to_rgb(rgb.as_mut());
            let [r, g, b] = rgb.as_ref().pixel(0, 0);
            assert_eq!([r, g, b], [201, 54, 0]);
            assert!(rgb.data().chunks(3).all(|pixel| pixel == [r, g, b]), "{width}x{height}");
        }
    }

    #[test]
    fn chroma_is_interpolated_between_its_samples() {
        let mut yuv = Yuv420::default();
        yuv.reset(4, 2);
        for (plane, value) in yuv.planes_mut().into_iter().zip([126, 128, 128]) {
            plane.fill(value);
        }
        yuv.planes_mut()[2].copy_from_slice(&[108, 148]);
        let mut rgb = FrameBuf::new(4, 2);
        yuv.to_rgb(rgb.as_mut());
        let reds = [0, 1, 2, 3].map(|x| rgb.as_ref().pixel(x, 0)[0]);
        // 110 grey is 128; a step of chroma is 1.596 of red.
        assert_eq!(reds, [96, 128, 160, 160]);
    }
}
