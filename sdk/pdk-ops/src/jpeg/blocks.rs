//! Strips of blocks, transformed there and back.

use super::levels::Table;
use crate::dct::{Blocks, LANES, forward, inverse};
use crate::simd::vectorised;

/// Brings the first columns of all blocks to the front, then the second ones, and so on, by three separations, so that the same element
/// of neighbouring blocks lies side by side.
pub(super) fn separate_columns(rows: &mut [u8], stride: usize, [first, second]: &mut [Vec<u8>; 2]) {
    first.resize(stride, 0);
    second.resize(stride, 0);
    for row in rows.chunks_exact_mut(stride) {
        separate(row, first);
        separate(first, second);
        separate(second, row);
    }
}

/// Undoes [`separate_columns`].
pub(super) fn interleave_columns(rows: &mut [u8], stride: usize, [first, second]: &mut [Vec<u8>; 2]) {
    first.resize(stride, 0);
    second.resize(stride, 0);
    for row in rows.chunks_exact_mut(stride) {
        interleave(row, first);
        interleave(first, second);
        interleave(second, row);
    }
}

vectorised! {
    // The even elements, then the odd ones.
    fn separate / separate_avx2 / separate_avx512 (from: &[u8], to: &mut [u8]) {
        let (even, odd) = to.split_at_mut(from.len() / 2);
        for ((pair, even), odd) in from.chunks_exact(2).zip(even).zip(odd) {
            *even = pair[0];
            *odd = pair[1];
        }
    }
}

vectorised! {
    // Undoes `separate`.
    fn interleave / interleave_avx2 / interleave_avx512 (from: &[u8], to: &mut [u8]) {
        let (even, odd) = from.split_at(from.len() / 2);
        for ((pair, even), odd) in to.chunks_exact_mut(2).zip(even).zip(odd) {
            pair[0] = *even;
            pair[1] = *odd;
        }
    }
}

vectorised! {
    pub(super) fn round_trip_blocks / round_trip_blocks_avx2 / round_trip_blocks_avx512 (
        rows: &mut [u8], stride: usize, table: &Table,
    ) {
        let mut blocks: Blocks = [[0; LANES]; 64];
        for start in (0..stride / 8).step_by(LANES) {
            gather(rows, stride, start, &mut blocks);
            forward(&mut blocks);
            quantise(&mut blocks, table);
            inverse(&mut blocks);
            scatter(&blocks, rows, stride, start);
        }
    }
}

vectorised! {
    /// The first half of [`round_trip_blocks`].
    pub(super) fn compress_blocks / compress_blocks_avx2 / compress_blocks_avx512 (rows: &[u8], stride: usize, table: &Table, levels: &mut [i16]) {
        let mut blocks: Blocks = [[0; LANES]; 64];
        for (group, levels) in levels.chunks_exact_mut(64 * LANES).enumerate() {
            gather(rows, stride, group * LANES, &mut blocks);
            forward(&mut blocks);
            let levels = levels.chunks_exact_mut(LANES).zip(&table.reciprocals);
            for (lanes, (levels, &reciprocal)) in blocks.iter().zip(levels) {
                for (level, &value) in levels.iter_mut().zip(lanes) {
                    *level = (shifted_level(value, reciprocal).to_bits() as i32 - SHIFT.to_bits() as i32) as i16;
                }
            }
        }
    }
}

vectorised! {
    /// The second half.
    pub(super) fn decompress_blocks / decompress_blocks_avx2 / decompress_blocks_avx512 (levels: &[i16], table: &Table, rows: &mut [u8], stride: usize) {
        let mut blocks: Blocks = [[0; LANES]; 64];
        for (group, levels) in levels.chunks_exact(64 * LANES).enumerate() {
            let levels = levels.chunks_exact(LANES).zip(&table.steps);
            for (lanes, (levels, &step)) in blocks.iter_mut().zip(levels) {
                for (value, &level) in lanes.iter_mut().zip(levels) {
                    *value = i32::from(level) * step as i32;
                }
            }
            inverse(&mut blocks);
            scatter(&blocks, rows, stride, group * LANES);
        }
    }
}

/// Where an element of the blocks from number `start` on lies in a strip of separated columns.
#[inline(always)]
fn strip_place(element: usize, stride: usize, start: usize) -> usize {
    element / 8 * stride + element % 8 * (stride / 8) + start
}

/// Takes blocks from a strip, around 0.
#[inline(always)]
fn gather(rows: &[u8], stride: usize, start: usize, blocks: &mut Blocks) {
    for (element, lanes) in blocks.iter_mut().enumerate() {
        for (value, &sample) in lanes.iter_mut().zip(&rows[strip_place(element, stride, start)..][..LANES]) {
            *value = i32::from(sample) - 128;
        }
    }
}

/// Puts blocks back.
#[inline(always)]
fn scatter(blocks: &Blocks, rows: &mut [u8], stride: usize, start: usize) {
    for (element, lanes) in blocks.iter().enumerate() {
        for (sample, &value) in rows[strip_place(element, stride, start)..][..LANES].iter_mut().zip(lanes) {
            *sample = (value + 128).clamp(0, 255) as u8;
        }
    }
}

/// Adding this to a number of magnitude below 2^22 leaves it, rounded, in the lower bits.
const SHIFT: f32 = 12_582_912.0;

/// The level of a coefficient (times 8), halves away from zero, plus [`SHIFT`].
#[inline(always)]
fn shifted_level(value: i32, reciprocal: f32) -> f32 {
    // Whole numbers moved by half a unit away from zero never lie half-way between two multiples of an even step.
    let moved = value as f32 + 0.5f32.copysign(value as f32);
    moved * reciprocal + SHIFT
}

/// Rounds coefficients (times 8) to the nearest multiple of their step, halves away from zero.
#[inline(always)]
pub(super) fn quantise(blocks: &mut Blocks, table: &Table) {
    for ((lanes, step), reciprocal) in blocks.iter_mut().zip(&table.steps).zip(&table.reciprocals) {
        for value in lanes {
            let multiple = shifted_level(*value, *reciprocal) - SHIFT;
            *value = (multiple * step + SHIFT).to_bits() as i32 - SHIFT.to_bits() as i32;
        }
    }
}
