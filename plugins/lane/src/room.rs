//! Room for one row of pixels, so that drawing allocates nothing; and from values to bytes.

use crate::places::{Asked, RoadPlaces};
use crate::simd::{padded, vectorised};

/// Values along one row of pixels, in whole blocks.
#[derive(Debug)]
pub struct Room {
    /// 0, 1, 2 and so on.
    pub numbers: Vec<f32>,
    /// Where the pixels lie on the road.
    pub places: RoadPlaces,
    /// What the field was asked for to find that.
    pub asked: Asked,
    /// Red, green and blue of the surface.
    pub colours: [Vec<f32>; 3],
    /// How strongly the texture changes its brightness.
    pub rough: Vec<f32>,
    /// How much of it is meadow.
    pub meadow: Vec<f32>,
    /// Light of the headlights.
    pub beam: Vec<f32>,
    /// How much of the sun is left.
    pub sun: Vec<f32>,
    /// How much of the sky a wet surface throws back.
    pub gloss: Vec<f32>,
    pub bytes: [Vec<u8>; 3],
    /// Textures: fine, coarse, in between, and of the road's damage.
    pub grain: Vec<f32>,
    pub patches: Vec<f32>,
    pub leaves: Vec<f32>,
    pub damage: Vec<f32>,
}

impl Room {
    /// Room for rows of this many pixels.
    pub fn new(width: usize) -> Self {
        let width = padded(width);
        let room = || vec![0.0; width];
        Self {
            numbers: (0..width).map(|i| i as f32).collect(),
            places: RoadPlaces::new(width),
            asked: Asked::new(width),
            colours: std::array::from_fn(|_| room()),
            rough: room(),
            meadow: room(),
            beam: room(),
            sun: room(),
            gloss: room(),
            bytes: std::array::from_fn(|_| vec![0; width]),
            grain: room(),
            patches: room(),
            leaves: room(),
            damage: room(),
        }
    }
}

/// Rounds a value to a byte.
#[inline(always)]
pub fn byte(value: f32) -> u8 {
    // In a number just above 2^23 the lowest bits are those of the whole number added: faster than a conversion.
    (value.clamp(0.0, 255.0) + 8_388_608.0).to_bits() as u8
}

/// Writes channels as pixels; they may be longer than the row.
pub fn interleave(channels: &[Vec<u8>; 3], row: &mut [u8]) {
    #[cfg(target_arch = "x86_64")]
    if crate::simd::has_avx512() {
        // SAFETY: the processor has all that this version asks for.
        return unsafe { interleave_avx512(channels, row) };
    }
    #[cfg(target_arch = "x86_64")]
    if crate::simd::has_avx2() {
        // SAFETY: the processor has AVX2, which is all that this version asks for.
        return unsafe { interleave_avx2(channels, row) };
    }
    interleave_from(0, channels, row);
}

fn interleave_from(first: usize, [red, green, blue]: &[Vec<u8>; 3], row: &mut [u8]) {
    let pixels = row[first * 3..].chunks_exact_mut(3);
    for (((pixel, red), green), blue) in pixels.zip(&red[first..]).zip(&green[first..]).zip(&blue[first..]) {
        pixel[0] = *red;
        pixel[1] = *green;
        pixel[2] = *blue;
    }
}

/// Sixteen pixels at a time: each of the three registers written takes its bytes from all channels.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn interleave_avx2(channels: &[Vec<u8>; 3], row: &mut [u8]) {
    use std::arch::x86_64::*;

    /// For each register and channel: which byte of the channel goes where; -1 for none.
    const ORDER: [[[i8; 16]; 3]; 3] = {
        let mut order = [[[-1; 16]; 3]; 3];
        let mut at = 0;
        while at < 48 {
            order[at / 16][at % 3][at % 16] = (at / 3) as i8;
            at += 1;
        }
        order
    };
    // SAFETY: each order has the sixteen bytes of a register.
    let order = ORDER.map(|of| of.map(|bytes| unsafe { _mm_loadu_si128(bytes.as_ptr().cast()) }));
    let [red, green, blue] = channels.each_ref().map(|channel| channel.as_chunks::<16>().0);
    let groups = row.as_chunks_mut::<48>().0;
    let done = groups.len().min(red.len());
    for (((pixels, red), green), blue) in groups.iter_mut().zip(red).zip(green).zip(blue) {
        // SAFETY: each has the sixteen bytes of a register.
        let channels = [red, green, blue].map(|bytes| unsafe { _mm_loadu_si128(bytes.as_ptr().cast()) });
        for (register, order) in pixels.as_chunks_mut::<16>().0.iter_mut().zip(&order) {
            let [red, green, blue] = [0, 1, 2].map(|c| _mm_shuffle_epi8(channels[c], order[c]));
            let bytes = _mm_or_si128(_mm_or_si128(red, green), blue);
            // SAFETY: it has the sixteen bytes of a register.
            unsafe { _mm_storeu_si128(register.as_mut_ptr().cast(), bytes) };
        }
    }
    interleave_from(done * 16, channels, row);
}

/// Sixteen pixels at a time: one permutation of a register that holds the bytes of all channels.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
fn interleave_avx512(channels: &[Vec<u8>; 3], row: &mut [u8]) {
    use std::arch::x86_64::*;

    /// Which byte of the register goes where; the last sixteen are not written.
    const ORDER: [u8; 64] = {
        let mut order = [0; 64];
        let mut at = 0;
        while at < 48 {
            order[at] = (at % 3 * 16 + at / 3) as u8;
            at += 1;
        }
        order
    };
    // SAFETY: there are the 64 bytes of a register.
    let order = unsafe { _mm512_loadu_si512(ORDER.as_ptr().cast()) };
    let [red, green, blue] = channels.each_ref().map(|channel| channel.as_chunks::<16>().0);
    let groups = row.as_chunks_mut::<48>().0;
    let done = groups.len().min(red.len());
    for (((pixels, red), green), blue) in groups.iter_mut().zip(red).zip(green).zip(blue) {
        // SAFETY: each has the sixteen bytes of a quarter of a register.
        let [red, green, blue] =
            [red, green, blue].map(|bytes| unsafe { _mm_loadu_si128(bytes.as_ptr().cast()) });
        let both = _mm512_inserti32x4::<1>(_mm512_castsi128_si512(red), green);
        let bytes = _mm512_permutexvar_epi8(order, _mm512_inserti32x4::<2>(both, blue));
        // SAFETY: 48 bytes are written, for which there is room.
        unsafe { _mm512_mask_storeu_epi8(pixels.as_mut_ptr().cast(), (1 << 48) - 1, bytes) };
    }
    interleave_from(done * 16, channels, row);
}

vectorised! {
    /// Rounds values to bytes.
    pub fn to_bytes / to_bytes_avx2 / to_bytes_avx512(values: &[f32], bytes: &mut [u8]) {
        for (byte_out, value) in bytes.iter_mut().zip(values) {
            *byte_out = byte(*value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::portably;

    #[test]
    fn channels_become_pixels_on_every_processor() {
        for pixels in [1, 7, 16, 33, 320] {
            let channels: [Vec<u8>; 3] = [0u8, 50, 100].map(|first| {
                (0..padded(pixels)).map(|i| (i as u8).wrapping_mul(7).wrapping_add(first)).collect()
            });
            let written = || {
                let mut row = vec![0; pixels * 3];
                interleave(&channels, &mut row);
                row
            };
            let row = written();
            assert_eq!(row, portably(written));
            assert!(row.chunks(3).enumerate().all(|(i, pixel)| (0..3).all(|c| pixel[c] == channels[c][i])));
        }
    }

    #[test]
    fn values_are_rounded_and_held() {
        let mut bytes = [0; 6];
        to_bytes(&[-3.0, 0.4, 0.6, 254.4, 300.0, 17.0], &mut bytes);
        assert_eq!(bytes, [0, 0, 1, 254, 255, 17]);
    }
}
