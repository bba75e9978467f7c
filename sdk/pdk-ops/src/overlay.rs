//! Laying a partly transparent picture over a frame.

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::simd::vectorised;

/// Pixels that are done at a time, so that their alphas, one for each value, stay in the fastest cache.
const BLOCK: usize = 256;

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
    fn overlay_row / overlay_row_avx2 (
        src: &[u8], dst: &mut [u8], colours: &[u8], alphas: &[u8], weight: u16,
    ) {
        let mut spread = [0u8; BLOCK * CHANNELS];
        let values = BLOCK * CHANNELS;
        let blocks = dst.chunks_mut(values).zip(src.chunks(values)).zip(colours.chunks(values)).zip(alphas.chunks(BLOCK));
        for (((dst, src), colours), alphas) in blocks {
            // Most blocks of most clips have nothing in them.
            if alphas.iter().fold(0, |all, alpha| all | alpha) == 0 {
                dst.copy_from_slice(src);
                continue;
            }
            for (spread, &alpha) in spread.chunks_exact_mut(CHANNELS).zip(alphas) {
                spread.copy_from_slice(&[alpha; CHANNELS]);
            }
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
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
