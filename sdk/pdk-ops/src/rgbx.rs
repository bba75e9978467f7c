//! Rows of pixels with a fourth value that is not used, so that a pixel is as long as a vector of four numbers or a word of four bytes.

use crate::frame::CHANNELS;
use crate::point::drop_fractions;

/// Writes a row: clipped to 0 to 255, the fraction dropped. `bytes` is for the pixels on the way.
///
/// # Panics
/// If the lengths are not those of the same number of pixels.
pub fn truncate(pixels: &[[f32; 4]], bytes: &mut [[u8; 4]], row: &mut [u8]) {
    assert!(pixels.len() == bytes.len(), "one pixel of bytes for each of numbers");
    drop_fractions(pixels.as_flattened(), bytes.as_flattened_mut());
    pack(bytes, row);
}

/// Writes a row of bytes without the fourth ones.
///
/// # Panics
/// If the row has another number of pixels.
pub fn pack(pixels: &[[u8; 4]], row: &mut [u8]) {
    assert!(row.len() == CHANNELS * pixels.len(), "a row has as many pixels as are written to it");
    let Some((last, others)) = pixels.split_last() else { return };
    // Each word is written whole, and the next one overwrites its last byte.
    for (x, pixel) in others.iter().enumerate() {
        row[CHANNELS * x..][..4].copy_from_slice(pixel);
    }
    row[CHANNELS * others.len()..].copy_from_slice(&last[..CHANNELS]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::with_each;

    #[test]
    fn fourth_values_are_left_out() {
        for width in 0..40 {
            let pixels: Vec<[f32; 4]> =
                (0..width).map(|x| [0, 1, 2, 3].map(|c| (x * 13 + c * 70) as f32 * 0.7 - 20.0)).collect();
            let wanted: Vec<u8> =
                pixels.iter().flat_map(|pixel| [0, 1, 2].map(|channel| pixel[channel] as u8)).collect();
            with_each(|instructions| {
                let (mut bytes, mut row) = (vec![[0; 4]; width], vec![0; 3 * width]);
                truncate(&pixels, &mut bytes, &mut row);
                assert_eq!(row, wanted, "{width} with {instructions:?}");
            });
        }
    }
}
