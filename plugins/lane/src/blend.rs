//! Draws one row of a picture over a row of a frame.

use std::ops::Range;

use wide::f32x4;

use crate::room::byte;
#[cfg(target_arch = "x86_64")]
use crate::simd::has_avx2;

/// What covers less than this is not drawn.
pub const FAINTEST: f32 = 0.003;

/// Two neighbouring rows of a picture's texels, and how pixels of a frame lie on them.
pub struct TexelRows<'a> {
    /// The upper and the lower row: colours multiplied by their opacity, then the opacity. Both are as long, and at least two.
    pub texels: [&'a [[f32; 4]]; 2],
    /// How far below the upper row the pixels lie, 0 to 1.
    pub below: f32,
    /// Where the frame's first pixel begins on the picture, in pixels, and the texels in a pixel.
    pub corner: f32,
    pub step: f32,
}

/// What becomes of a picture's colours.
#[derive(Clone, Copy)]
pub struct Paint {
    /// What the opacity is multiplied with.
    pub opacity: f32,
    /// What each colour is multiplied with, and what the air adds to it where the picture is opaque. The last is 0.
    pub own: [f32; 4],
    pub air: [f32; 4],
}

impl TexelRows<'_> {
    /// The texel to the left of the middle of pixel `x`, and how far to the right of it that lies.
    #[inline(always)]
    fn column(&self, x: usize) -> (usize, f32) {
        place(x, self.corner, self.step, self.texels[0].len() - 2)
    }
}

/// The texel before the middle of a pixel, counted from the border, and how far behind it that lies: of a picture that begins at
/// `corner`, with `step` texels in a pixel and `size` texels without the border.
#[inline(always)]
pub fn place(pixel: usize, corner: f32, step: f32, size: usize) -> (usize, f32) {
    let texel = (pixel as f32 + 0.5 - corner) * step - 0.5;
    let place = (texel + 1.0).clamp(0.0, size as f32);
    let whole = place as i32;
    (whole as usize, place - whole as f32)
}

/// Draws over columns of a frame's row.
pub fn blend(rows: &TexelRows<'_>, paint: &Paint, columns: Range<usize>, row: &mut [u8]) {
    let first = columns.start;
    #[cfg(target_arch = "x86_64")]
    let first = match has_avx2() {
        // SAFETY: the processor has AVX2, which is all that this version asks for.
        true => unsafe { blend_avx2(rows, paint, columns.clone(), row) },
        false => first,
    };
    blend_plainly(rows, paint, first, &mut row[first * 3..columns.end.max(first) * 3]);
}

/// Draws over `pixels`, which begin with pixel `first` of the row.
fn blend_plainly(rows: &TexelRows<'_>, paint: &Paint, first: usize, pixels: &mut [u8]) {
    let [above, under] = rows.texels;
    let (own, air, below) = (f32x4::new(paint.own), f32x4::new(paint.air), f32x4::splat(rows.below));
    let mix = |a: f32x4, b: f32x4, share: f32x4| a + (b - a) * share;
    for (x, pixel) in pixels.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        let (left, fx) = rows.column(first + x);
        let fx = f32x4::splat(fx);
        let upper = mix(f32x4::new(above[left]), f32x4::new(above[left + 1]), fx);
        let lower = mix(f32x4::new(under[left]), f32x4::new(under[left + 1]), fx);
        let texel = mix(upper, lower, below);
        let cover = texel.to_array()[3] * paint.opacity;
        if cover <= FAINTEST {
            continue;
        }
        let cover = f32x4::splat(cover);
        let [red, green, blue] = pixel.map(f32::from);
        let behind = f32x4::new([red, green, blue, 0.0]);
        let seen = texel * own + air * cover;
        let [red, green, blue, _] = (behind + seen - behind * cover).to_array();
        *pixel = [red, green, blue].map(byte);
    }
}

/// As [`blend_plainly`], two pixels at a time; the first column that is not done.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn blend_avx2(rows: &TexelRows<'_>, paint: &Paint, columns: Range<usize>, row: &mut [u8]) -> usize {
    use std::arch::x86_64::*;

    use crate::simd::avx2::{mix, store};

    let set = |value: f32| _mm256_set1_ps(value);
    let both = |four: &[f32; 4]| {
        // SAFETY: there are four floats, which need no alignment.
        let four = unsafe { _mm_loadu_ps(four.as_ptr()) };
        _mm256_set_m128(four, four)
    };
    let (own, air, below) = (both(&paint.own), both(&paint.air), set(rows.below));
    // The bytes of two pixels, each of its own half, and back.
    let apart = _mm_setr_epi8(0, 1, 2, -1, 3, 4, 5, -1, -1, -1, -1, -1, -1, -1, -1, -1);
    let lowest = _mm256_setr_epi8(
        0, 4, 8, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, //
        0, 4, 8, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1,
    );
    let first_alone = _mm256_castsi256_ps(_mm256_setr_epi32(-1, -1, -1, -1, 0, 0, 0, 0));
    let [above, under] = rows.texels;
    // A place lies up to here, so that the texel behind it is there too.
    let size = above.len().min(under.len()) - 2;
    let numbers = _mm256_setr_ps(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0);
    for first in columns.clone().step_by(8) {
        let middles = _mm256_add_ps(_mm256_add_ps(set(first as f32), numbers), set(0.5));
        let from_corner = _mm256_sub_ps(middles, set(rows.corner));
        let texel = _mm256_sub_ps(_mm256_mul_ps(from_corner, set(rows.step)), set(0.5));
        let place = _mm256_add_ps(texel, set(1.0));
        let place = _mm256_min_ps(_mm256_max_ps(place, set(0.0)), set(size as f32));
        let whole = _mm256_cvttps_epi32(place);
        let (mut lefts, mut shares) = ([0u32; 8], [0.0f32; 8]);
        // SAFETY: it has room for the eight numbers, and needs no alignment.
        unsafe { _mm256_storeu_si256(lefts.as_mut_ptr().cast(), whole) };
        store(&mut shares, _mm256_sub_ps(place, _mm256_cvtepi32_ps(whole)));
        for (pair, x) in (first..columns.end.min(first + 8)).step_by(2).enumerate() {
            // Two bytes behind the second pixel are read with it.
            let Some(bytes) = row.get(x * 3..).and_then(|bytes| bytes.first_chunk()) else { return x };
            let lefts = [lefts[pair * 2] as usize, lefts[pair * 2 + 1] as usize];
            let corner = |row: &[[f32; 4]], more: usize| {
                // SAFETY: a place was held between 0 and `size`, and a row has two texels more than that.
                let [a, b] = lefts.map(|left| unsafe { _mm_loadu_ps(row.as_ptr().add(left + more).cast()) });
                _mm256_set_m128(b, a)
            };
            let fx = _mm256_set_m128(_mm_set1_ps(shares[pair * 2 + 1]), _mm_set1_ps(shares[pair * 2]));
            let upper = mix(corner(above, 0), corner(above, 1), fx);
            let lower = mix(corner(under, 0), corner(under, 1), fx);
            let texel = mix(upper, lower, below);
            let cover = _mm256_mul_ps(_mm256_shuffle_ps::<0xFF>(texel, texel), set(paint.opacity));
            let mut drawn = _mm256_cmp_ps::<_CMP_GT_OQ>(cover, set(FAINTEST));
            if x + 1 == columns.end {
                drawn = _mm256_and_ps(drawn, first_alone);
            }
            if _mm256_testz_ps(drawn, drawn) == 1 {
                continue;
            }
            let bytes = _mm_cvtsi64_si128(i64::from_le_bytes(*bytes));
            let behind = _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_shuffle_epi8(bytes, apart)));
            let seen = _mm256_add_ps(_mm256_mul_ps(texel, own), _mm256_mul_ps(air, cover));
            let mixed = _mm256_sub_ps(_mm256_add_ps(behind, seen), _mm256_mul_ps(behind, cover));
            let mixed = _mm256_blendv_ps(behind, mixed, drawn);
            // As `byte`.
            let held = _mm256_min_ps(_mm256_max_ps(mixed, set(0.0)), set(255.0));
            let rounded = _mm256_castps_si256(_mm256_add_ps(held, set(8_388_608.0)));
            let packed = _mm256_shuffle_epi8(rounded, lowest);
            let [a, b] = [_mm256_castsi256_si128(packed), _mm256_extracti128_si256::<1>(packed)]
                .map(|pixel| u64::from(_mm_cvtsi128_si32(pixel) as u32));
            row[x * 3..x * 3 + 6].copy_from_slice(&(a | b << 24).to_le_bytes()[..6]);
        }
    }
    columns.end
}
