//! Hue, saturation and value in 8 bits: hue in steps of two degrees, 0..=179; saturation and value 0..=255.
//!
//! There are two of each conversion: of a pixel, which is the standard, and of a block of pixels, which does every step with the
//! narrowest numbers that hold it, of which a vector has the most. Both use single-precision arithmetic on whole numbers,
//! which is exact below 2^24.

use crate::frame::{Frame, FrameMut, for_each_row};
use crate::planes::{BLOCK, BLOCK_BYTES, Planes, put_together, take_apart};
use crate::simd::vectorised;
use crate::table::look_up_row;

/// Adding this to a whole number of magnitude below 2^22 puts that number into the lower bits.
const SHIFT: f32 = 12_582_912.0;

/// Rounds half to even. For magnitudes below 2^22.
#[inline(always)]
fn round(value: f32) -> i32 {
    (value + SHIFT).to_bits() as i32 - SHIFT.to_bits() as i32
}

/// `[hue, saturation, value]` of `[red, green, blue]`; each rounded.
#[inline(always)]
pub fn rgb_to_hsv(rgb: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = rgb.map(i32::from);
    let value = r.max(g).max(b);
    let range = value - r.min(g).min(b);
    // Quotients are fixed-point numbers with 12 fractional bits. If a divisor is zero, so is what it divides.
    let saturation = round(range as f32 * round(255.0 * 4096.0 / value.max(1) as f32) as f32);
    let position = if value == r {
        g - b
    } else if value == g {
        b - r + 2 * range
    } else {
        r - g + 4 * range
    };
    let hue = round(position as f32 * round(30.0 * 4096.0 / range.max(1) as f32) as f32);
    let hue = (hue + 2048) >> 12;
    let hue = if hue < 0 { hue + 180 } else { hue };
    [hue as u8, ((saturation + 2048) >> 12) as u8, value as u8]
}

/// `[red, green, blue]` of `[hue, saturation, value]`; rounded half to even. The hue is at most 179.
#[inline(always)]
pub fn hsv_to_rgb(hsv: [u8; 3]) -> [u8; 3] {
    let [hue, saturation, value] = hsv.map(i32::from);
    let chroma = (saturation as f32) * (value as f32);
    // How far each channel lies below the value is a trapezium over the hue circle: 0 or 30 thirtieths of the chroma
    // for a third of the circle each, and a slope in between.
    [150, 90, 30].map(|offset| {
        let place = hue + offset;
        let place = if place >= 180 { place - 180 } else { place };
        let weight = place.min(120 - place).clamp(0, 30);
        (value - round(chroma * weight as f32 * (1.0 / 7650.0))) as u8
    })
}

/// Red, green and blue of a block become hue, saturation and value.
#[inline(always)]
pub(crate) fn block_to_hsv(planes: &mut Planes) {
    let [reds, greens, blues] = planes;
    let mut ranges = [0u8; BLOCK];
    let mut values = [0u8; BLOCK];
    let mut positions = [0i16; BLOCK];
    let colours = reds.iter().zip(&*greens).zip(&*blues);
    for (((&r, &g), &b), (range, value)) in colours.zip(ranges.iter_mut().zip(&mut values)) {
        *value = r.max(g).max(b);
        *range = *value - r.min(g).min(b);
    }
    let colours = reds.iter().zip(&*greens).zip(&*blues);
    for (((&r, &g), &b), (position, (&range, &value))) in
        colours.zip(positions.iter_mut().zip(ranges.iter().zip(&values)))
    {
        let [red, green, blue, range, value] = [r, g, b, range, value].map(i16::from);
        let other = if value == green { blue - red + 2 * range } else { red - green + 4 * range };
        *position = if value == red { green - blue } else { other };
    }
    for ((hue, &position), &range) in reds.iter_mut().zip(&positions).zip(&ranges) {
        let reciprocal = 30.0 * 4096.0 / f32::from(range.max(1)) + SHIFT - SHIFT;
        let found = (round(f32::from(position) * reciprocal) + 2048) >> 12;
        *hue = if found < 0 { found + 180 } else { found } as u8;
    }
    for ((saturation, &range), &value) in greens.iter_mut().zip(&ranges).zip(&values) {
        let reciprocal = 255.0 * 4096.0 / f32::from(value.max(1)) + SHIFT - SHIFT;
        *saturation = ((round(f32::from(range) * reciprocal) + 2048) >> 12) as u8;
    }
    *blues = values;
}

/// Hue, saturation and value of a block become red, green and blue.
#[inline(always)]
pub(crate) fn block_to_rgb(planes: &mut Planes) {
    let [hues, saturations, values] = planes;
    // How far below the value a channel lies, in thirtieths of the chroma, by the distance to where its slopes end.
    let mut weights = [[0u8; BLOCK]; 3];
    let [of_red, of_green, of_blue] = &mut weights;
    for (((red, green), blue), &hue) in of_red.iter_mut().zip(of_green).zip(of_blue).zip(&*hues) {
        *red = hue.saturating_sub(30).min(150u8.saturating_sub(hue)).min(30);
        *green = hue.saturating_sub(90).max(30u8.saturating_sub(hue)).min(30);
        *blue = hue.saturating_sub(150).max(90u8.saturating_sub(hue)).min(30);
    }
    let mut chroma = [0f32; BLOCK];
    for ((chroma, &saturation), &value) in chroma.iter_mut().zip(&*saturations).zip(&*values) {
        *chroma = f32::from(u16::from(saturation) * u16::from(value));
    }
    let top = *values;
    for (channel, weights) in [hues, saturations, values].into_iter().zip(&weights) {
        for (((channel, &weight), &chroma), &value) in channel.iter_mut().zip(weights).zip(&chroma).zip(&top)
        {
            let below = (chroma * f32::from(weight) * (1.0 / 7650.0) + SHIFT).to_bits() as u8;
            *channel = value.wrapping_sub(below);
        }
    }
}

/// Multiplies saturation and value by factors: both are clipped to 255 and lose their fraction. Negative factors
/// count as 0.
///
/// # Panics
/// If the sizes differ.
pub fn scale_hsv(src: Frame<'_>, dst: FrameMut<'_>, saturation_factor: f64, value_factor: f64) {
    // What keeps its size is not looked up.
    let table = |factor: f64| -> Option<[u8; 256]> {
        (factor != 1.0).then(|| std::array::from_fn(|v| (v as f64 * factor) as u8))
    };
    let (saturations, values) = (table(saturation_factor), table(value_factor));
    for_each_row(src, dst, |from, to| scale_hsv_row(from, to, saturations.as_ref(), values.as_ref()));
}

vectorised! {
    fn scale_hsv_row / scale_hsv_row_avx2 / scale_hsv_row_avx512 (
        from: &[u8], to: &mut [u8], saturations: Option<&[u8; 256]>, values: Option<&[u8; 256]>,
    ) {
        for (from, to) in from.chunks(BLOCK_BYTES).zip(to.chunks_mut(BLOCK_BYTES)) {
            let mut planes = take_apart(from);
            block_to_hsv(&mut planes);
            for (plane, table) in planes[1..].iter_mut().zip([saturations, values]) {
                if let Some(table) = table {
                    let from = *plane;
                    look_up_row(&from, plane, table);
                }
            }
            block_to_rgb(&mut planes);
            put_together(&planes, to);
        }
    }
}

/// Turns the hue by an angle in degrees, rounded to the steps of two degrees that 8-bit HSV has; saturation and value stay.
///
/// # Panics
/// If the sizes differ.
pub fn turn_hue(src: Frame<'_>, dst: FrameMut<'_>, degrees: f64) {
    // What is left of whole turns is exact; a number that is none turns nothing.
    let steps = ((degrees % 360.0) / 2.0).round_ties_even() as i32;
    let steps = steps.rem_euclid(180) as u8;
    for_each_row(src, dst, |from, to| turn_hue_row(from, to, steps));
}

vectorised! {
    fn turn_hue_row / turn_hue_row_avx2 / turn_hue_row_avx512 (from: &[u8], to: &mut [u8], steps: u8) {
        for (from, to) in from.chunks(BLOCK_BYTES).zip(to.chunks_mut(BLOCK_BYTES)) {
            let mut planes = take_apart(from);
            block_to_hsv(&mut planes);
            for hue in &mut planes[0] {
                let turned = u16::from(*hue) + u16::from(steps);
                *hue = if turned >= 180 { turned - 180 } else { turned } as u8;
            }
            block_to_rgb(&mut planes);
            put_together(&planes, to);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{plain, run_on, samples};

    /// The conversion with integers and tables of reciprocals.
    fn plain_hsv([r, g, b]: [i32; 3], saturations: &[i32; 256], hues: &[i32; 256]) -> [u8; 3] {
        let value = r.max(g).max(b);
        let range = value - r.min(g).min(b);
        let saturation = (range * saturations[value as usize] + 2048) >> 12;
        let position = match value {
            v if v == r => g - b,
            v if v == g => b - r + 2 * range,
            _ => r - g + 4 * range,
        };
        let hue = (position * hues[range as usize] + 2048) >> 12;
        [if hue < 0 { hue + 180 } else { hue }, saturation, value].map(|v| v as u8)
    }

    #[test]
    fn every_colour_has_the_hue_saturation_and_value_of_the_table_method() {
        let reciprocals = |numerator: f64| -> [i32; 256] {
            std::array::from_fn(|i| if i == 0 { 0 } else { (numerator / i as f64).round_ties_even() as i32 })
        };
        let (saturations, hues) = (reciprocals(255.0 * 4096.0), reciprocals(180.0 * 4096.0 / 6.0));
        for colour in 0..1 << 24 {
            let rgb = [colour >> 16, colour >> 8 & 255, colour & 255];
            let expected = plain_hsv(rgb, &saturations, &hues);
            let actual = rgb_to_hsv(rgb.map(|v| v as u8));
            assert_eq!(actual, expected, "{rgb:?}");
            assert!(actual[0] < 180);
        }
    }

    /// All of these, a block at a time.
    fn in_blocks(all: impl Iterator<Item = [u8; 3]>, mut check: impl FnMut(&[[u8; 3]; BLOCK], &Planes)) {
        let mut block = [[0; 3]; BLOCK];
        for (i, colour) in all.enumerate() {
            block[i % BLOCK] = colour;
            if i % BLOCK == BLOCK - 1 {
                check(&block, &std::array::from_fn(|channel| block.map(|colour| colour[channel])));
            }
        }
    }

    #[test]
    fn blocks_are_converted_like_pixels() {
        let every = || (0..1 << 24).map(|colour: u32| [colour >> 16, colour >> 8, colour].map(|v| v as u8));
        in_blocks(every(), |block, planes| {
            let mut planes = *planes;
            block_to_hsv(&mut planes);
            for (i, &pixel) in block.iter().enumerate() {
                assert_eq!(planes.map(|plane| plane[i]), rgb_to_hsv(pixel), "{pixel:?}");
            }
        });
        in_blocks(every().filter(|hsv| hsv[0] < 180), |block, planes| {
            let mut planes = *planes;
            block_to_rgb(&mut planes);
            for (i, &pixel) in block.iter().enumerate() {
                assert_eq!(planes.map(|plane| plane[i]), hsv_to_rgb(pixel), "{pixel:?}");
            }
        });
    }

    #[test]
    fn every_hue_saturation_and_value_gives_the_nearest_colour() {
        for hue in 0..180u8 {
            for saturation in 0..=255u8 {
                for value in 0..=255u8 {
                    let actual = hsv_to_rgb([hue, saturation, value]);
                    // In units of 1/7650: 255 for the saturation times 30 for the slope along a sixth of the circle.
                    let (h, s, v) = (i32::from(hue), i32::from(saturation), i32::from(value));
                    let (sector, slope) = (h / 30, h % 30);
                    let (full, none) = (v * 7650, v * 7650 - v * s * 30);
                    let (falling, rising) = (v * 7650 - v * s * slope, v * 7650 - v * s * (30 - slope));
                    let exact = match sector {
                        0 => [full, rising, none],
                        1 => [falling, full, none],
                        2 => [none, full, rising],
                        3 => [none, falling, full],
                        4 => [rising, none, full],
                        _ => [full, none, falling],
                    };
                    for (actual, exact) in actual.iter().zip(exact) {
                        let off = 2 * (i32::from(*actual) * 7650 - exact).abs();
                        assert!(off <= 7650, "{hue} {saturation} {value}: {actual}");
                    }
                }
            }
        }
    }

    proptest! {
        #[test]
        fn turn_hue_matches_the_plain_version(sample in samples(), degrees in -800.0..800.0) {
            let src = sample.frame();
            let steps = (f64::round_ties_even(degrees % 360.0 / 2.0) as i32).rem_euclid(180);
            let expected = plain(src, |x, y| {
                let [hue, saturation, value] = rgb_to_hsv(src.pixel(x, y));
                hsv_to_rgb([((i32::from(hue) + steps) % 180) as u8, saturation, value])
            });
            prop_assert_eq!(run_on(&sample, |src, dst| turn_hue(src, dst, degrees)), expected);
        }
    }

    proptest! {
        #[test]
        fn scale_hsv_matches_the_plain_version(
            sample in samples(),
            saturation in prop_oneof![Just(1.0), -1.0..3.0],
            value in prop_oneof![Just(1.0), -1.0..3.0],
        ) {
            let src = sample.frame();
            let expected = plain(src, |x, y| {
                let [h, s, v] = rgb_to_hsv(src.pixel(x, y));
                let scale = |v: u8, factor: f64| (f64::from(v) * factor).clamp(0.0, 255.0) as u8;
                hsv_to_rgb([h, scale(s, saturation), scale(v, value)])
            });
            prop_assert_eq!(run_on(&sample, |src, dst| scale_hsv(src, dst, saturation, value)), expected);
        }
    }
}
