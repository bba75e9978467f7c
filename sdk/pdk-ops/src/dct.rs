//! The discrete cosine transform of 8x8 blocks in whole numbers, as JPEG codecs use it.
//!
//! Loeffler, Ligtenberg and Moschytz, "Practical fast 1-D DCT algorithms with 11 multiplications" (1989), with 13-bit
//! constants and 12 multiplications. Every step is the one that the Independent JPEG Group's accurate integer method
//! takes, so that coefficients and samples are equal to those of the usual codecs in every bit.

/// A block of 64 samples or coefficients, row by row.
pub(crate) type Block = [i32; 64];

/// The constants are fixed-point numbers with this many fractional bits.
const CONSTANT_BITS: u32 = 13;
/// Between the two passes numbers keep this many fractional bits.
const PASS_BITS: u32 = 2;

/// `sqrt(2)` times sums and differences of `cos(k pi / 16)`, named after their values.
mod constant {
    pub const C0_298: i32 = 2446;
    pub const C0_390: i32 = 3196;
    pub const C0_541: i32 = 4433;
    pub const C0_765: i32 = 6270;
    pub const C0_899: i32 = 7373;
    pub const C1_175: i32 = 9633;
    pub const C1_501: i32 = 12299;
    pub const C1_847: i32 = 15137;
    pub const C1_961: i32 = 16069;
    pub const C2_053: i32 = 16819;
    pub const C2_562: i32 = 20995;
    pub const C3_072: i32 = 25172;
}
use constant::*;

/// Divides by `2^bits` and rounds half up.
#[inline(always)]
fn descale(value: i32, bits: u32) -> i32 {
    (value + (1 << (bits - 1))) >> bits
}

/// Exchanges rows and columns. Each of the three steps interleaves the two halves, which moves the bits of every
/// element's index by one place; the compiler makes vector shuffles of it.
#[inline(always)]
fn transpose(block: &mut Block) {
    for _ in 0..3 {
        let from = *block;
        let (low, high) = from.split_at(32);
        for ((pair, &low), &high) in block.chunks_exact_mut(2).zip(low).zip(high) {
            pair[0] = low;
            pair[1] = high;
        }
    }
}

/// The rotation that odd coefficients and odd samples go through, in either direction.
#[inline(always)]
fn rotate_odd([a, b, c, d]: [i32; 4]) -> [i32; 4] {
    let (outer, inner) = ((a + d) * -C0_899, (b + c) * -C2_562);
    let (even, odd) = (a + c, b + d);
    let both = (even + odd) * C1_175;
    let (even, odd) = (both - even * C1_961, both - odd * C0_390);
    [a * C0_298 + outer + even, b * C2_053 + inner + odd, c * C3_072 + inner + even, d * C1_501 + outer + odd]
}

/// Transforms all columns.
#[inline(always)]
fn forward_columns(block: &mut Block, bits: u32) {
    for x in 0..8 {
        let at = |y: usize| block[y * 8 + x];
        let sums = [at(0) + at(7), at(1) + at(6), at(2) + at(5), at(3) + at(4)];
        let differences = [at(3) - at(4), at(2) - at(5), at(1) - at(6), at(0) - at(7)];
        let (outer, inner) = (sums[0] + sums[3], sums[1] + sums[2]);
        let (outer_difference, inner_difference) = (sums[0] - sums[3], sums[1] - sums[2]);
        let both = (inner_difference + outer_difference) * C0_541;
        let odd = rotate_odd(differences);
        block[x] = descale((outer + inner) << CONSTANT_BITS, bits);
        block[8 + x] = descale(odd[3], bits);
        block[16 + x] = descale(both + outer_difference * C0_765, bits);
        block[24 + x] = descale(odd[2], bits);
        block[32 + x] = descale((outer - inner) << CONSTANT_BITS, bits);
        block[40 + x] = descale(odd[1], bits);
        block[48 + x] = descale(both - inner_difference * C1_847, bits);
        block[56 + x] = descale(odd[0], bits);
    }
}

/// Transforms all columns back.
#[inline(always)]
fn inverse_columns(block: &mut Block, bits: u32) {
    for x in 0..8 {
        let at = |y: usize| block[y * 8 + x];
        let both = (at(2) + at(6)) * C0_541;
        let (inner, outer) = (both - at(6) * C1_847, both + at(2) * C0_765);
        let (sum, difference) = ((at(0) + at(4)) << CONSTANT_BITS, (at(0) - at(4)) << CONSTANT_BITS);
        let even = [sum + outer, difference + inner, difference - inner, sum - outer];
        let [d, c, b, a] = rotate_odd([at(7), at(5), at(3), at(1)]);
        for (y, (even, odd)) in even.into_iter().zip([a, b, c, d]).enumerate() {
            block[y * 8 + x] = descale(even + odd, bits);
            block[(7 - y) * 8 + x] = descale(even - odd, bits);
        }
    }
}

/// The coefficients of samples from -128 to 127, times 8: first the rows, then the columns.
#[inline(always)]
pub(crate) fn forward(block: &mut Block) {
    transpose(block);
    forward_columns(block, CONSTANT_BITS - PASS_BITS);
    transpose(block);
    forward_columns(block, CONSTANT_BITS + PASS_BITS);
}

/// The samples of coefficients (not times 8): first the columns, then the rows. Samples may lie outside -128..=127.
#[inline(always)]
pub(crate) fn inverse(block: &mut Block) {
    inverse_columns(block, CONSTANT_BITS - PASS_BITS);
    transpose(block);
    inverse_columns(block, CONSTANT_BITS + PASS_BITS + 3);
    transpose(block);
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::random::Key;

    /// `cos((2x + 1) u pi / 16)`, normalised.
    fn basis(u: usize, x: usize) -> f64 {
        let scale = if u == 0 { 0.125f64.sqrt() } else { 0.5 };
        scale * ((2 * x + 1) as f64 * u as f64 * PI / 16.0).cos()
    }

    fn random_block(seed: u8, reach: i32) -> Block {
        let mut random = Key([seed; 32]).sequence();
        std::array::from_fn(|_| random.between(-reach, reach))
    }

    #[test]
    fn transpose_exchanges_rows_and_columns() {
        let block: Block = std::array::from_fn(|i| i as i32);
        let mut transposed = block;
        transpose(&mut transposed);
        for (i, value) in transposed.into_iter().enumerate() {
            assert_eq!(value, block[i % 8 * 8 + i / 8]);
        }
    }

    #[test]
    fn forward_is_the_cosine_transform_times_eight() {
        for seed in 0..20 {
            let samples = random_block(seed, 127);
            let mut block = samples;
            forward(&mut block);
            for (i, actual) in block.into_iter().enumerate() {
                let (v, u) = (i / 8, i % 8);
                let exact: f64 =
                    (0..64).map(|j| f64::from(samples[j]) * basis(v, j / 8) * basis(u, j % 8)).sum();
                assert!((f64::from(actual) - 8.0 * exact).abs() < 4.0, "{actual} {exact}");
            }
        }
    }

    #[test]
    fn inverse_is_the_inverse_cosine_transform() {
        for seed in 0..20 {
            let coefficients = random_block(seed, 300);
            let mut block = coefficients;
            inverse(&mut block);
            for (i, actual) in block.into_iter().enumerate() {
                let (y, x) = (i / 8, i % 8);
                let exact: f64 =
                    (0..64).map(|j| f64::from(coefficients[j]) * basis(j / 8, y) * basis(j % 8, x)).sum();
                assert!((f64::from(actual) - exact).abs() < 1.0, "{actual} {exact}");
            }
        }
    }

    #[test]
    fn the_largest_samples_survive_the_round_trip() {
        for samples in
            [[-128; 64], [127; 64], std::array::from_fn(|i| if (i / 8 + i) % 2 == 0 { -128 } else { 127 })]
        {
            let mut block: Block = samples;
            forward(&mut block);
            block.iter_mut().for_each(|v| *v = (*v + 4) >> 3);
            inverse(&mut block);
            assert!(block.iter().zip(&samples).all(|(a, b)| (a - b).abs() <= 1), "{block:?}");
        }
    }
}
