//! Laying a partly transparent picture over a frame, and what is done to picture and frame before.

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::planes::{BLOCK, BLOCK_BYTES, put_together};
use crate::simd::vectorised;

/// Lays a picture over `src`: `dst = picture * opacity + src * (1 - alpha * opacity)`, each product rounded to the nearest
/// whole number. `colours` holds red, green and blue of all pixels, row by row, premultiplied: no value exceeds the pixel's
/// alpha in `alphas`. `opacity` is clipped to 0..=1 and rounded to 1/256.
///
/// # Panics
/// If the sizes differ.
pub fn overlay(src: Frame<'_>, mut dst: FrameMut<'_>, colours: &[u8], alphas: &[u8], opacity: f64) {
    let (width, height) = (src.width(), src.height());
    assert!(src.same_size(&dst.as_ref()), "overlay between frames of different size");
    assert!(
        alphas.len() == width * height && colours.len() == alphas.len() * CHANNELS,
        "overlay of a picture of another size than the frame"
    );
    let weight = (opacity.clamp(0.0, 1.0) * 256.0).round() as u16;
    if let (Some(src), Some(dst)) = (src.contiguous(), dst.contiguous_mut()) {
        return overlay_row(src, dst, colours, alphas, weight);
    }
    let lines = colours.chunks_exact(width * CHANNELS).zip(alphas.chunks_exact(width));
    for (y, (colours, alphas)) in lines.enumerate() {
        overlay_row(src.row(y), dst.row_mut(y), colours, alphas, weight);
    }
}

vectorised! {
    fn overlay_row / overlay_row_avx2 / overlay_row_avx512 (
        src: &[u8], dst: &mut [u8], colours: &[u8], alphas: &[u8], weight: u16,
    ) {
        let mut spread = [0u8; BLOCK_BYTES];
        let pixels = dst.chunks_mut(BLOCK_BYTES).zip(src.chunks(BLOCK_BYTES));
        for (((dst, src), colours), alphas) in pixels.zip(colours.chunks(BLOCK_BYTES)).zip(alphas.chunks(BLOCK)) {
            // Most blocks of most clips have nothing in them.
            if alphas.iter().fold(0, |all, alpha| all | alpha) == 0 {
                dst.copy_from_slice(src);
                continue;
            }
            let mut plane = [0; BLOCK];
            plane[..alphas.len()].copy_from_slice(alphas);
            put_together(&[plane; CHANNELS], &mut spread);
            for (((dst, &src), &colour), &alpha) in dst.iter_mut().zip(src).zip(colours).zip(&spread) {
                *dst = overlay_value(src, colour, alpha, weight);
            }
        }
    }
}

/// All of it fits 16 bits.
#[inline(always)]
fn overlay_value(src: u8, colour: u8, alpha: u8, weight: u16) -> u8 {
    let scaled = |value: u8| (u16::from(value) * weight + 128) >> 8;
    // A division by 255, rounded: exact for products of two bytes.
    let product = u16::from(src) * (255 - scaled(alpha)) + 128;
    (scaled(colour) + ((product + (product >> 8)) >> 8)) as u8
}

vectorised! {
    /// A mixture of two pictures with alpha, byte by byte: `weight` 256ths of the second, at most 256, rounded down, so that no colour comes to
    /// exceed its alpha. All three have the same length.
    pub fn mix / mix_avx2 / mix_avx512 (first: &[u8], second: &[u8], weight: u16, mixed: &mut [u8]) {
        let weight = weight.min(256);
        for ((mixed, &first), &second) in mixed.iter_mut().zip(first).zip(second) {
            *mixed = ((u16::from(first) * (256 - weight) + u16::from(second) * weight) >> 8) as u8;
        }
    }
}

/// Values that [`attenuate`] does at a time: whole pixels, and whole vectors.
const REPEATED: usize = 192;

vectorised! {
    /// `(keep * value + add) / 65536` of a row, clipped to 255, its fraction dropped, with a summand for each channel; `keep` is at most
    /// 65536, and a summand at most 2^24.
    pub fn attenuate / attenuate_avx2 / attenuate_avx512 (from: &[u8], to: &mut [u8], keep: u32, add: [u32; 3]) {
        // Halves of 32-bit numbers, so that a vector has twice as many of them. A factor of 65536 has no lower half.
        let (share, whole) = (keep as u16, (keep >> 16) as u16);
        let upper: [u16; REPEATED] = std::array::from_fn(|at| (add[at % 3] >> 16) as u16);
        let lower: [u16; REPEATED] = std::array::from_fn(|at| add[at % 3] as u16);
        for (from, to) in from.chunks(REPEATED).zip(to.chunks_mut(REPEATED)) {
            for (((&from, to), &upper), &lower) in from.iter().zip(to).zip(&upper).zip(&lower) {
                let value = u16::from(from);
                let product = ((u32::from(value) * u32::from(share)) >> 16) as u16;
                let rest = value.wrapping_mul(share).wrapping_add(lower);
                let carry = u16::from(rest < lower);
                *to = (product + value * whole + upper + carry).min(255) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::simd::with_each;
    use crate::testing::{plain, run_on, samples};

    fn plain_value(src: u8, colour: u8, alpha: u8, opacity: f64) -> u8 {
        let weight = (opacity * 256.0).round() / 256.0;
        let scaled = |value: u8| (f64::from(value) * weight + 0.5).floor();
        let rest = f64::from(src) * (255.0 - scaled(alpha)) / 255.0;
        (scaled(colour) + (rest + 0.5).floor()) as u8
    }

    proptest! {
        #[test]
        fn matches_the_plain_version(sample in samples(), seed in 1usize..1000, opacity in 0.0..=1.0) {
            let src = sample.frame();
            let width = src.width();
            // Every third run of pixels is empty.
            let alpha = |i: usize| if i / 300 % 3 == 1 { 0 } else { (i * seed % 256) as u8 };
            let colour = |i: usize, c: usize| (usize::from(alpha(i)) * ((i + c * 7) % 5) / 4) as u8;
            let pixels = width * src.height();
            let alphas: Vec<u8> = (0..pixels).map(alpha).collect();
            let colours: Vec<u8> = (0..pixels).flat_map(|i| [0, 1, 2].map(|c| colour(i, c))).collect();
            let expected = plain(src, |x, y| {
                let i = y * width + x;
                let pixel = src.pixel(x, y);
                [0, 1, 2].map(|c| plain_value(pixel[c], colour(i, c), alpha(i), opacity))
            });
            prop_assert_eq!(run_on(&sample, |src, dst| overlay(src, dst, &colours, &alphas, opacity)), expected);
        }
    }

    #[test]
    fn rows_are_attenuated_as_whole_products_say_with_all_instructions() {
        let from: Vec<u8> = (0..=255).cycle().take(3 * 331).collect();
        for (keep, add) in [
            (65536, [32768, 32768, 0]),
            (65535, [32768, 1, 65535]),
            (40000, [5_570_560, 16_711_680, 98_304]),
            (0, [32768, 16_744_448, 70_000]),
        ] {
            with_each(|instructions| {
                let mut to = vec![0; from.len()];
                attenuate(&from, &mut to, keep, add);
                for (at, (&from, &to)) in from.iter().zip(&to).enumerate() {
                    let sum = u64::from(from) * u64::from(keep) + u64::from(add[at % 3]);
                    assert_eq!(u64::from(to), (sum >> 16).min(255), "{instructions:?} {from} {keep} {add:?}");
                }
            });
        }
    }

    #[test]
    fn mixtures_are_rounded_down_with_all_instructions() {
        let first: Vec<u8> = (0..700).map(|at| (at * 37 % 256) as u8).collect();
        let second: Vec<u8> = (0..700).map(|at| (at * 91 % 256) as u8).collect();
        for weight in [0, 1, 128, 255, 256] {
            with_each(|instructions| {
                let mut mixed = vec![0; 700];
                mix(&first, &second, weight, &mut mixed);
                for ((&mixed, &a), &b) in mixed.iter().zip(&first).zip(&second) {
                    let sum = u32::from(a) * (256 - u32::from(weight)) + u32::from(b) * u32::from(weight);
                    assert_eq!(u32::from(mixed), sum / 256, "{instructions:?} {a} {b} {weight}");
                }
            });
        }
    }

    #[test]
    fn every_combination_of_bytes_stays_in_range() {
        for weight in [0, 1, 51, 128, 255, 256] {
            for alpha in 0..=255 {
                for src in 0..=255 {
                    for colour in [0, alpha / 2, alpha] {
                        let expected = plain_value(src, colour, alpha, f64::from(weight) / 256.0);
                        assert_eq!(overlay_value(src, colour, alpha, weight), expected);
                    }
                }
            }
        }
    }

    #[test]
    fn the_ends_of_opacity_give_the_frame_and_the_picture() {
        let src = crate::FrameBuf::from_vec(vec![10, 20, 30, 40, 50, 60], 2, 1).unwrap();
        let (colours, alphas) = ([200, 100, 0, 7, 8, 9], [255, 255]);
        for (opacity, expected) in
            [(-1.0, src.data().to_vec()), (0.0, src.data().to_vec()), (1.0, colours.to_vec())]
        {
            let mut dst = crate::FrameBuf::new(2, 1);
            overlay(src.as_ref(), dst.as_mut(), &colours, &alphas, opacity);
            assert_eq!(dst.data(), expected, "{opacity}");
        }
    }
}
