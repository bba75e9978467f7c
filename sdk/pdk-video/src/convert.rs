//! The picture of a video, from RGB and back by [`yuv`].

use pdk_sdk::ops::yuv::{self, Coding, Matrix};
use pdk_sdk::prelude::*;

/// A picture as a video has it: luma, then blue chroma and red chroma, each without gaps between its rows.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Yuv420 {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The three planes; those of chroma have half the width and height, rounded up.
    pub data: Vec<u8>,
    /// How the planes hold colours.
    pub coding: Coding,
}

impl Yuv420 {
    /// Takes a size and the coding of BT.601 with luma from 16 to 235, and makes room for the planes.
    pub fn reset(&mut self, width: usize, height: usize) {
        (self.width, self.height, self.coding) = (width, height, Coding::default());
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
        let (luma, chroma) = self.data.split_at_mut(self.width * self.height);
        let (blue, red) = chroma.split_at_mut(chroma.len() / 2);
        [luma, blue, red]
    }

    /// Takes the size and the picture of a frame whose width and height are even.
    pub(crate) fn fill(&mut self, frame: Frame<'_>) {
        self.reset(frame.width(), frame.height());
        yuv::from_rgb(frame, self.planes_mut());
    }

    /// Writes the picture as RGB; chroma is interpolated between its samples.
    ///
    /// # Panics
    /// If the frame has another size.
    pub fn to_rgb(&self, into: FrameMut<'_>) {
        assert_eq!((into.width(), into.height()), (self.width, self.height), "a frame of another size");
        yuv::coded_to_rgb(self.planes(), self.coding, into);
    }

    /// Brings the planes to BT.601 with luma from 16 to 235, for what works with planes and knows no other coding. Grey stays grey, so
    /// chroma follows from chroma alone; luma takes that of the nearest sample.
    pub fn to_bt601(&mut self) {
        if self.coding == Coding::default() {
            return;
        }
        let from = Terms::of(self.coding.matrix);
        let to = Terms::of(Matrix::Bt601);
        // The lowest luma, and what luma and chroma from 0 to 255 are divided by to be of full range.
        let (black, luma_range, chroma_range) =
            if self.coding.full_range { (0.0, 1.0, 1.0) } else { (16.0, 219.0 / 255.0, 224.0 / 255.0) };
        // What a unit of blue and of red chroma adds to the new luma.
        let [blue_adds, red_adds] = [
            to.blue * from.blue_of_blue() + to.green() * from.green_of_blue(),
            to.red * from.red_of_red() + to.green() * from.green_of_red(),
        ];
        let byte = |value: f32| (value.clamp(0.0, 255.0) + 0.5) as u8;
        let (width, half) = (self.width, self.width.div_ceil(2));
        let [luma, blues, reds] = self.planes_mut();
        for (y, row) in luma.chunks_exact_mut(width).enumerate() {
            for (x, luma) in row.iter_mut().enumerate() {
                let at = y / 2 * half + x / 2;
                let [blue, red] =
                    [blues[at], reds[at]].map(|chroma| (f32::from(chroma) - 128.0) / chroma_range);
                let full = (f32::from(*luma) - black) / luma_range + blue_adds * blue + red_adds * red;
                *luma = byte(16.0 + full * (219.0 / 255.0));
            }
        }
        for (blue, red) in blues.iter_mut().zip(reds) {
            let [b, r] = [*blue, *red].map(|chroma| (f32::from(chroma) - 128.0) / chroma_range);
            let luma = blue_adds * b + red_adds * r;
            let [b, r] = [
                (from.blue_of_blue() * b - luma) / to.blue_of_blue(),
                (from.red_of_red() * r - luma) / to.red_of_red(),
            ];
            (*blue, *red) = (byte(128.0 + b * (224.0 / 255.0)), byte(128.0 + r * (224.0 / 255.0)));
        }
        self.coding = Coding::default();
    }
}

/// The shares of red and blue in luma, from which everything else follows (ITU-R BT.601 and BT.709).
struct Terms {
    red: f32,
    blue: f32,
}

impl Terms {
    fn of(matrix: Matrix) -> Self {
        match matrix {
            Matrix::Bt601 => Self { red: 0.299, blue: 0.114 },
            Matrix::Bt709 => Self { red: 0.2126, blue: 0.0722 },
        }
    }

    fn green(&self) -> f32 {
        1.0 - self.red - self.blue
    }

    /// What blue chroma adds to blue.
    fn blue_of_blue(&self) -> f32 {
        2.0 * (1.0 - self.blue)
    }

    /// What red chroma adds to red.
    fn red_of_red(&self) -> f32 {
        2.0 * (1.0 - self.red)
    }

    fn green_of_blue(&self) -> f32 {
        -self.blue * self.blue_of_blue() / self.green()
    }

    fn green_of_red(&self) -> f32 {
        -self.red * self.red_of_red() / self.green()
    }
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
                    let [luma, blue, red] = yuv::components([r, g, b]);
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
