//! Colours as luma and chroma, and chroma at half the resolution.

use crate::frame::CHANNELS;
use crate::simd::vectorised;

/// Colour conversions work with this many fractional bits.
const COLOUR_BITS: u32 = 16;
/// One half in that format.
const HALF: i32 = 1 << (COLOUR_BITS - 1);

vectorised! {
    pub(super) fn split_colours / split_colours_avx2 / split_colours_avx512 (
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
    /// The mean of four; one half is rounded down and up in turn.
    pub(super) fn halve / halve_avx2 / halve_avx512 (upper: &[u8], lower: &[u8], out: &mut [u8]) {
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
    pub(super) fn add_rows / add_rows_avx2 / add_rows_avx512 (near: &[u8], far: &[u8], sums: &mut [u16]) {
        for ((sum, &near), &far) in sums.iter_mut().zip(near).zip(far) {
            *sum = 3 * u16::from(near) + u16::from(far);
        }
    }
}

vectorised! {
    /// Two samples from each sum and its neighbours; one half is rounded up and down in turn.
    pub(super) fn double / double_avx2 / double_avx512 (sums: &[u16], out: &mut [u8]) {
        let (left, right) = (sums, &sums[2..]);
        for (((out, &left), &middle), &right) in out.chunks_exact_mut(2).zip(left).zip(&sums[1..]).zip(right) {
            out[0] = ((3 * middle + left + 8) >> 4) as u8;
            out[1] = ((3 * middle + right + 7) >> 4) as u8;
        }
    }
}

vectorised! {
    pub(super) fn join_colours / join_colours_avx2 / join_colours_avx512 (
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
