//! From the numbers of an image back to the frame: what a gradient with respect to the numbers is with respect to the frame's bytes.
//!
//! On its way, a frame passes steps that are linear in its bytes but for rounding, so the gradient passes them backwards with the same weights.
//! Rounding, and keeping to what a byte holds, change nothing on the way back. Hue and saturation are not linear; they have the slope that they
//! have at the frame's own colours.

use pdk_sdk::error::Result;
use pdk_sdk::prelude::Frame;

use crate::color::Color;
use crate::eye::{Eye, Slot};
use crate::resize::{Resizer, Weights};

impl Eye {
    /// What has the gradient `of_numbers` with respect to the numbers that [`Self::see_first`] writes has this one with respect to the bytes of the
    /// frame: row by row, three numbers a pixel.
    ///
    /// # Errors
    /// If nothing is left of the frame.
    pub fn back(&mut self, frame: Frame<'_>, of_numbers: &[f32]) -> Result<Vec<f32>> {
        let fitted = self.fit(frame)?;
        let of_fitted = self.back_to_fitted(fitted.as_ref(), of_numbers);
        let [first, second] = &self.resizers;
        let size = [frame.width(), frame.height()];
        let whole = self.frame.unwrap_or(size);
        let part = self.region.part(whole[0], whole[1])?;
        let of_part = passed(second.as_ref(), of_fitted);
        let mut of_whole = vec![0.0; whole[0] * whole[1] * 3];
        for (y, row) in of_part.chunks_exact(part.width * 3).enumerate() {
            let start = ((part.top + y) * whole[0] + part.left) * 3;
            of_whole[start..start + row.len()].copy_from_slice(row);
        }
        Ok(if whole == size { of_whole } else { passed(first.as_ref(), of_whole) })
    }

    /// Whether the numbers of a frame that counts as the first change with it. Differences of frames do not, since all frames are the same one then.
    pub fn first_matters(&self) -> bool {
        self.slots.iter().any(|slot| self.share(*slot) != 0.0)
    }

    /// By how much the place of a stack grows with a frame that counts as the first.
    fn share(&self, slot: Slot) -> f32 {
        let of_frame = |age: usize| if age == 0 || !self.starts_with_zeros { 1.0 } else { 0.0 };
        match slot {
            Slot::Frame(age) => of_frame(age),
            Slot::Difference(newer, older) => of_frame(newer) - of_frame(older),
        }
    }

    /// The gradient with respect to the bytes of a frame in the size of the image.
    fn back_to_fitted(&self, fitted: Frame<'_>, of_numbers: &[f32]) -> Vec<f32> {
        let strides = self.strides();
        let channels = self.image.channels;
        let slopes: Vec<f32> = (0..channels).map(|channel| self.numbers.slope(channel)).collect();
        let mut gradient = Vec::with_capacity(self.image.width * self.image.height * 3);
        for y in 0..self.image.height {
            for x in 0..self.image.width {
                let mut of_channels = [0.0; 3];
                for (place, slot) in self.slots.iter().enumerate() {
                    let (share, from) = (self.share(*slot), strides.place(place, y, x));
                    for (channel, (sum, slope)) in of_channels.iter_mut().zip(&slopes).enumerate() {
                        *sum += share * slope * of_numbers[from + channel * strides.deep];
                    }
                }
                gradient.extend(self.color.back(fitted.pixel(x, y), of_channels));
            }
        }
        gradient
    }
}

/// The gradient before a resizer; the same without one.
fn passed(resizer: Option<&Resizer>, gradient: Vec<f32>) -> Vec<f32> {
    let Some(resizer) = resizer else { return gradient };
    let [columns, rows] = resizer.weights();
    let (width, narrow) = (resizer.from[0] * 3, columns.len() * 3);
    let mut down = vec![0.0; narrow * resizer.from[1]];
    for (taps, gradient) in rows.iter().zip(gradient.chunks_exact(narrow)) {
        for &(place, weight) in taps {
            let sums = &mut down[place * narrow..][..narrow];
            sums.iter_mut().zip(gradient).for_each(|(sum, value)| *sum += weight * value);
        }
    }
    let mut across = vec![0.0; width * resizer.from[1]];
    for (sums, gradient) in across.chunks_exact_mut(width).zip(down.chunks_exact(narrow)) {
        add_across(&columns, gradient, sums);
    }
    across
}

/// Spreads the gradient of a row over the pixels that it was made of.
fn add_across(columns: &Weights, gradient: &[f32], sums: &mut [f32]) {
    for (taps, gradient) in columns.iter().zip(gradient.chunks_exact(3)) {
        for &(place, weight) in taps {
            let sums = &mut sums[place * 3..][..3];
            sums.iter_mut().zip(gradient).for_each(|(sum, value)| *sum += weight * value);
        }
    }
}

impl Color {
    /// The gradient with respect to red, green and blue of a pixel, given the one with respect to its channels.
    fn back(self, pixel: [u8; 3], [a, b, c]: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Rgb => [a, b, c],
            Self::Bgr => [c, b, a],
            Self::Grey => LUMA.map(|share| share * a),
            Self::Yuv => {
                let luma = a - BLUE * b - RED * c;
                let [r, g, b_share] = LUMA.map(|share| share * luma);
                [r + RED * c, g, b_share + BLUE * b]
            }
            Self::Hsv => back_from_hsv(pixel, [a, b, c]),
        }
    }
}

/// Shares of red, green and blue in the luma.
const LUMA: [f32; 3] = [0.299, 0.587, 0.114];
/// By how much U grows with blue less luma, and V with red less luma.
const BLUE: f32 = 0.492;
const RED: f32 = 0.877;

/// The slope of hue in steps of two degrees, saturation and value at a colour. A grey one has no hue.
fn back_from_hsv(pixel: [u8; 3], [hue, saturation, value]: [f32; 3]) -> [f32; 3] {
    let at = pixel.map(f32::from);
    let (mut most, mut least) = (0, 0);
    for channel in 1..3 {
        most = if pixel[channel] > pixel[most] { channel } else { most };
        least = if pixel[channel] < pixel[least] { channel } else { least };
    }
    let mut gradient = [0.0; 3];
    gradient[most] += value;
    let spread = at[most] - at[least];
    if spread == 0.0 {
        return gradient;
    }
    // S = 255 (1 - least / most).
    gradient[most] += saturation * 255.0 * at[least] / (at[most] * at[most]);
    gradient[least] -= saturation * 255.0 / at[most];
    // H = 30 (p - q) / spread, plus a third of the circle for each channel, of the two that follow the greatest.
    let (p, q) = ((most + 1) % 3, (most + 2) % 3);
    gradient[p] += hue * 30.0 / spread;
    gradient[q] -= hue * 30.0 / spread;
    let of_spread = -hue * 30.0 * (at[p] - at[q]) / (spread * spread);
    gradient[most] += of_spread;
    gradient[least] -= of_spread;
    gradient
}

#[cfg(test)]
#[path = "back_tests.rs"]
mod tests;
