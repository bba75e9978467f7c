//! Draws a picture over a frame in strips that are four pixels wide, from top to bottom, with AVX-512.
//!
//! Pictures are narrow, above all far away. Along a strip the columns of texels stay the same, and there are more pixels
//! than along a row.

use std::arch::x86_64::*;
use std::ops::Range;

use crate::blend::{FAINTEST, Paint};
use crate::simd::avx512::{LANES, mix, store};

/// Pixels across a strip.
const WIDTH: usize = 4;
/// Rows of pixels whose places on the picture are kept at a time.
const ROWS: usize = 64;

/// A picture and how pixels of a frame lie on it.
pub struct Picture<'a> {
    /// Row by row, with a transparent border one texel wide: colours multiplied by their opacity, then the opacity.
    pub texels: &'a [[f32; 4]],
    /// Texels along a side, without the border.
    pub size: usize,
    /// For each column of texels and the one to its right: from the first to behind the last row that is not transparent.
    pub opaque: &'a [Range<u32>],
    /// Where the frame's first pixel begins on the picture, in pixels, and the texels in a pixel: across and down.
    pub corner: [f32; 2],
    pub step: [f32; 2],
    /// The pixels that it may cover.
    pub columns: Range<usize>,
    pub rows: Range<usize>,
}

/// Draws over the bytes of a frame whose rows begin this many bytes after each other.
///
/// # Panics
/// If the picture is not as large as it says, or covers pixels outside of the frame.
#[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
pub fn draw(picture: &Picture<'_>, paint: &Paint, frame: &mut [u8], pitch: usize) {
    let Picture { texels, size, corner, step, .. } = *picture;
    let stride = size + 2;
    assert_eq!(texels.len(), stride * stride);
    let set = |value: f32| _mm512_set1_ps(value);
    let all = |four: &[f32; 4]| {
        // SAFETY: there are four floats, which need no alignment.
        _mm512_broadcast_f32x4(unsafe { _mm_loadu_ps(four.as_ptr()) })
    };
    let (own, air) = (all(&paint.own), all(&paint.air));
    // The bytes of four pixels, each value in a lane of its own and each pixel in a quarter of its own, and back.
    let apart = _mm512_setr_epi32(0, 1, 2, 0, 3, 4, 5, 0, 6, 7, 8, 0, 9, 10, 11, 0);
    let values: __mmask64 = 0x0111_0111_0111_0111;
    let together =
        _mm512_zextsi128_si512(_mm_setr_epi8(0, 4, 8, 16, 20, 24, 32, 36, 40, 48, 52, 56, 0, 0, 0, 0));
    // Where pixels lie on the picture: as `place`, for four columns or sixteen rows.
    let most = set(size as f32);
    let numbers =
        _mm512_setr_ps(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0);
    let placed = |first: usize, axis: usize| {
        let middles = _mm512_add_ps(_mm512_add_ps(set(first as f32), numbers), set(0.5));
        let from_corner = _mm512_sub_ps(middles, set(corner[axis]));
        let texel = _mm512_sub_ps(_mm512_mul_ps(from_corner, set(step[axis])), set(0.5));
        let place = _mm512_min_ps(_mm512_max_ps(_mm512_add_ps(texel, set(1.0)), set(0.0)), most);
        let whole = _mm512_cvttps_epi32(place);
        (whole, _mm512_sub_ps(place, _mm512_cvtepi32_ps(whole)))
    };
    let quarters = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
    let (mut tops, mut belows) = ([0u32; ROWS], [0.0f32; ROWS]);
    // Of sixteen columns, which are four strips.
    let mut placed_columns = (_mm512_setzero_si512(), _mm512_setzero_ps());
    for first in picture.rows.clone().step_by(ROWS) {
        let count = ROWS.min(picture.rows.end - first);
        for from in (0..count).step_by(LANES) {
            let (whole, below) = placed(first + from, 1);
            // SAFETY: there is room for sixteen of both, which need no alignment.
            unsafe { _mm512_storeu_si512(tops[from..from + LANES].as_mut_ptr().cast(), whole) };
            store(&mut belows[from..from + LANES], !0, below);
        }
        for left in picture.columns.clone().step_by(WIDTH) {
            let strip = (left - picture.columns.start) / WIDTH % (LANES / WIDTH);
            if strip == 0 {
                placed_columns = placed(left, 0);
            }
            let (whole, shares) = placed_columns;
            let width = WIDTH.min(picture.columns.end - left);
            let of = _mm512_add_epi32(quarters, _mm512_set1_epi32((strip * WIDTH) as i32));
            let fx = _mm512_permutexvar_ps(of, shares);
            let whole = _mm512_castsi512_si128(_mm512_maskz_compress_epi32(0xF << (strip * WIDTH), whole));
            let mut columns = [0u32; WIDTH];
            // SAFETY: there is room for four, which need no alignment.
            unsafe { _mm_storeu_si128(columns.as_mut_ptr().cast(), whole) };
            // From the first row on which any of these columns shows something to the last one.
            let (mut start, mut end) = (u32::MAX, 0);
            for column in &columns[..width] {
                let opaque = &picture.opaque[*column as usize];
                if !opaque.is_empty() {
                    (start, end) = (start.min(opaque.start), end.max(opaque.end));
                }
            }
            let (mut from, mut to) = (0, count);
            while from < to && tops[from] + 1 < start {
                from += 1;
            }
            while from < to && tops[to - 1] >= end {
                to -= 1;
            }
            let columns = columns.map(|column| column as usize);
            let bytes = ((1u32 << (width * 3)) - 1) as u16;
            for y in from..to {
                let begin = (first + y) * pitch + left * 3;
                let pixels = &mut frame[begin..begin + width * 3];
                // The four texels to the left of the pixels, and the four to the right.
                let sides = |row: usize| {
                    // SAFETY: columns and rows were held between 0 and `size`, and there are two more of each than that.
                    // Floats need no alignment.
                    let both = |pixel: usize| unsafe {
                        _mm256_loadu_ps(texels.as_ptr().add(row).add(columns[pixel]).cast())
                    };
                    let two = |pixel: usize| {
                        _mm512_insertf32x8::<1>(_mm512_castps256_ps512(both(pixel)), both(pixel + 1))
                    };
                    let (first, last) = (two(0), two(2));
                    (_mm512_shuffle_f32x4::<0x88>(first, last), _mm512_shuffle_f32x4::<0xDD>(first, last))
                };
                let row = tops[y] as usize * stride;
                let ((a, b), (c, d)) = (sides(row), sides(row + stride));
                let texel = mix(mix(a, b, fx), mix(c, d, fx), set(belows[y]));
                let cover = _mm512_mul_ps(_mm512_shuffle_ps::<0xFF>(texel, texel), set(paint.opacity));
                // Pixels that are not drawn are computed too: at the edges of pictures the processor would mispredict a branch.
                let drawn = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(cover, set(FAINTEST));
                // SAFETY: only bytes are read that there are.
                let behind = unsafe { _mm_maskz_loadu_epi8(bytes, pixels.as_ptr().cast()) };
                let behind = _mm512_maskz_permutexvar_epi8(values, apart, _mm512_castsi128_si512(behind));
                let behind = _mm512_cvtepi32_ps(behind);
                let seen = _mm512_add_ps(_mm512_mul_ps(texel, own), _mm512_mul_ps(air, cover));
                let mixed = _mm512_sub_ps(_mm512_add_ps(behind, seen), _mm512_mul_ps(behind, cover));
                let mixed = _mm512_mask_mov_ps(behind, drawn, mixed);
                // As `byte`.
                let held = _mm512_min_ps(_mm512_max_ps(mixed, set(0.0)), set(255.0));
                let rounded = _mm512_castps_si512(_mm512_add_ps(held, set(8_388_608.0)));
                let packed = _mm512_castsi512_si128(_mm512_permutexvar_epi8(together, rounded));
                // SAFETY: only bytes are written that there are.
                unsafe { _mm_mask_storeu_epi8(pixels.as_mut_ptr().cast(), bytes, packed) };
            }
        }
    }
}
