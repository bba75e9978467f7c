//! Colours, as OpenCV converts 8-bit images: Y'UV by ITU-R BT.601 in 14-bit fixed point (`COLOR_RGB2YUV`), HSV with the hue in steps of two
//! degrees (`COLOR_RGB2HSV`), grey by the same luma in 15-bit fixed point (`COLOR_RGB2GRAY`).
//!
//! All arithmetic is on whole numbers, so that it does not depend on the processor.

use pdk_sdk::ops::color::grey;
use pdk_sdk::ops::hsv::rgb_to_hsv;

/// The names that the field takes.
pub const NAMES: [&str; 5] = ["rgb", "bgr", "grey", "yuv", "hsv"];

/// What the channels of an image are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Color {
    /// Red, green, blue.
    Rgb,
    /// Blue, green, red.
    Bgr,
    /// The luma.
    Grey,
    /// Luma and two differences of colours.
    Yuv,
    /// Hue, saturation, value.
    Hsv,
}

impl Color {
    /// The one of this name.
    pub fn of(name: &str) -> Option<Self> {
        let all = [Self::Rgb, Self::Bgr, Self::Grey, Self::Yuv, Self::Hsv];
        NAMES.iter().zip(all).find(|(known, _)| **known == name).map(|(_, color)| color)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        NAMES[self as usize]
    }

    /// The number of its channels.
    pub fn channels(self) -> usize {
        if self == Self::Grey { 1 } else { 3 }
    }

    /// A pixel in these channels; grey has one, and the others repeat it.
    #[inline]
    pub fn pixel(self, [r, g, b]: [u8; 3]) -> [u8; 3] {
        match self {
            Self::Rgb => [r, g, b],
            Self::Bgr => [b, g, r],
            Self::Grey => [grey(r, g, b); 3],
            Self::Yuv => yuv([r, g, b]),
            Self::Hsv => rgb_to_hsv([r, g, b]),
        }
    }
}

/// Fractional bits of the factors of Y'UV.
const BITS: i32 = 14;

/// Shifts the fraction away, rounding halves up.
fn rounded(value: i32) -> i32 {
    (value + (1 << (BITS - 1))) >> BITS
}

/// Y' = 0.299 R + 0.587 G + 0.114 B, U = 0.492 (B - Y') + 128, V = 0.877 (R - Y') + 128.
fn yuv(rgb: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = rgb.map(i32::from);
    let luma = rounded(r * 4899 + g * 9617 + b * 1868);
    let difference =
        |channel: i32, factor: i32| rounded((channel - luma) * factor + (128 << BITS)).clamp(0, 255) as u8;
    [luma as u8, difference(b, 8061), difference(r, 14369)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversions_give_the_values_of_opencv() {
        // From cv2.cvtColor of OpenCV 4.
        for (rgb, expected) in [
            ([255, 0, 0], [76, 91, 255]),
            ([0, 255, 0], [150, 54, 0]),
            ([0, 0, 255], [29, 239, 103]),
            ([12, 200, 77], [130, 102, 25]),
        ] {
            assert_eq!(Color::Yuv.pixel(rgb), expected, "{rgb:?}");
        }
        assert_eq!(Color::Hsv.pixel([0, 255, 0]), [60, 255, 255]);
        assert_eq!(Color::Bgr.pixel([1, 2, 3]), [3, 2, 1]);
        assert_eq!(Color::Grey.pixel([255, 0, 0]), [76; 3]);
        for name in NAMES {
            assert_eq!(Color::of(name).unwrap().name(), name);
        }
    }
}
