//! The discrete cosine transform of 8x8 blocks in whole numbers, as JPEG codecs use it.
//!
//! Loeffler, Ligtenberg and Moschytz, "Practical fast 1-D DCT algorithms with 11 multiplications" (1989), with 13-bit
//! constants and 12 multiplications. Every step is the one that the Independent JPEG Group's accurate integer method
//! takes, so that coefficients and samples are equal to those of the usual codecs in every bit.

/// The number of blocks that are transformed side by side.
pub(crate) const LANES: usize = 8;
/// Blocks of 64 samples or coefficients, row by row; each element holds that of all blocks.
pub(crate) type Blocks = [[i32; LANES]; 64];

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

/// The rotation that odd coefficients and odd samples go through, in either direction.
#[inline(always)]
fn rotate_odd([a, b, c, d]: [i32; 4]) -> [i32; 4] {
    let (outer, inner) = ((a + d) * -C0_899, (b + c) * -C2_562);
    let (even, odd) = (a + c, b + d);
    let both = (even + odd) * C1_175;
    let (even, odd) = (both - even * C1_961, both - odd * C0_390);
    [a * C0_298 + outer + even, b * C2_053 + inner + odd, c * C3_072 + inner + even, d * C1_501 + outer + odd]
}

/// Transforms eight elements, `step` apart from each other.
#[inline(always)]
fn forward_line(blocks: &mut Blocks, first: usize, step: usize, bits: u32) {
    #[allow(clippy::needless_range_loop)] // the index goes into eight arrays
    for lane in 0..LANES {
        let at = |i: usize| blocks[first + i * step][lane];
        let sums = [at(0) + at(7), at(1) + at(6), at(2) + at(5), at(3) + at(4)];
        let differences = [at(3) - at(4), at(2) - at(5), at(1) - at(6), at(0) - at(7)];
        let (outer, inner) = (sums[0] + sums[3], sums[1] + sums[2]);
        let (outer_difference, inner_difference) = (sums[0] - sums[3], sums[1] - sums[2]);
        let both = (inner_difference + outer_difference) * C0_541;
        let odd = rotate_odd(differences);
        let results = [
            (outer + inner) << CONSTANT_BITS,
            odd[3],
            both + outer_difference * C0_765,
            odd[2],
            (outer - inner) << CONSTANT_BITS,
            odd[1],
            both - inner_difference * C1_847,
            odd[0],
        ];
        for (i, result) in results.into_iter().enumerate() {
            blocks[first + i * step][lane] = descale(result, bits);
        }
    }
}

/// Transforms eight elements, `step` apart from each other, back.
#[inline(always)]
fn inverse_line(blocks: &mut Blocks, first: usize, step: usize, bits: u32) {
    #[allow(clippy::needless_range_loop)] // the index goes into eight arrays
    for lane in 0..LANES {
        let at = |i: usize| blocks[first + i * step][lane];
        let both = (at(2) + at(6)) * C0_541;
        let (inner, outer) = (both - at(6) * C1_847, both + at(2) * C0_765);
        let (sum, difference) = ((at(0) + at(4)) << CONSTANT_BITS, (at(0) - at(4)) << CONSTANT_BITS);
        let even = [sum + outer, difference + inner, difference - inner, sum - outer];
        let [d, c, b, a] = rotate_odd([at(7), at(5), at(3), at(1)]);
        for (i, (even, odd)) in even.into_iter().zip([a, b, c, d]).enumerate() {
            blocks[first + i * step][lane] = descale(even + odd, bits);
            blocks[first + (7 - i) * step][lane] = descale(even - odd, bits);
        }
    }
}

/// The coefficients of samples from -128 to 127, times 8: first the rows, then the columns.
#[inline(always)]
pub(crate) fn forward(blocks: &mut Blocks) {
    for row in 0..8 {
        forward_line(blocks, 8 * row, 1, CONSTANT_BITS - PASS_BITS);
    }
    for column in 0..8 {
        forward_line(blocks, column, 8, CONSTANT_BITS + PASS_BITS);
    }
}

/// The samples of coefficients (not times 8): first the columns, then the rows. Samples may lie outside -128..=127.
#[inline(always)]
pub(crate) fn inverse(blocks: &mut Blocks) {
    for column in 0..8 {
        inverse_line(blocks, column, 8, CONSTANT_BITS - PASS_BITS);
    }
    for row in 0..8 {
        inverse_line(blocks, 8 * row, 1, CONSTANT_BITS + PASS_BITS + 3);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use pdk_seed::Key;

    /// `cos((2x + 1) u pi / 16)`, normalised.
    fn basis(u: usize, x: usize) -> f64 {
        let scale = if u == 0 { 0.125f64.sqrt() } else { 0.5 };
        scale * libm::cos((2 * x + 1) as f64 * u as f64 * PI / 16.0)
    }

    fn random_blocks(reach: i32) -> Blocks {
        let mut random = Key([7; 32]).sequence();
        std::array::from_fn(|_| std::array::from_fn(|_| random.between(-reach, reach)))
    }

    #[test]
    fn forward_is_the_cosine_transform_times_eight() {
        let samples = random_blocks(127);
        let mut blocks = samples;
        forward(&mut blocks);
        for (i, lanes) in blocks.iter().enumerate() {
            for (lane, &actual) in lanes.iter().enumerate() {
                let exact: f64 = (0..64)
                    .map(|j| f64::from(samples[j][lane]) * basis(i / 8, j / 8) * basis(i % 8, j % 8))
                    .sum();
                assert!((f64::from(actual) - 8.0 * exact).abs() < 4.0, "{actual} {exact}");
            }
        }
    }

    #[test]
    fn inverse_is_the_inverse_cosine_transform() {
        let coefficients = random_blocks(300);
        let mut blocks = coefficients;
        inverse(&mut blocks);
        for (i, lanes) in blocks.iter().enumerate() {
            for (lane, &actual) in lanes.iter().enumerate() {
                let exact: f64 = (0..64)
                    .map(|j| f64::from(coefficients[j][lane]) * basis(j / 8, i / 8) * basis(j % 8, i % 8))
                    .sum();
                assert!((f64::from(actual) - exact).abs() < 1.0, "{actual} {exact}");
            }
        }
    }

    /// As many of the largest coefficients as a damaged stream may have in a block, wherever they are.
    #[test]
    fn the_largest_coefficients_have_room() {
        use crate::jpeg::{LARGEST, LARGEST_SUM};

        let mut random = Key([8; 32]).sequence();
        for _ in 0..200 {
            let mut coefficients: Blocks = [[0; LANES]; 64];
            for _ in 0..LARGEST_SUM / LARGEST {
                let coefficient = if random.below(2) == 0 { LARGEST } else { -LARGEST };
                coefficients[random.below(64) as usize] = [coefficient; LANES];
            }
            let mut blocks = coefficients;
            inverse(&mut blocks);
            for (i, lanes) in blocks.iter().enumerate() {
                let exact: f64 = (0..64)
                    .map(|j| f64::from(coefficients[j][0]) * basis(j / 8, i / 8) * basis(j % 8, i % 8))
                    .sum();
                assert!((f64::from(lanes[0]) - exact).abs() < 2.0, "{} {exact}", lanes[0]);
            }
        }
    }

    #[test]
    fn the_largest_samples_survive_the_round_trip() {
        let checks = std::array::from_fn(|i| [if (i / 8 + i) % 2 == 0 { -128 } else { 127 }; LANES]);
        for samples in [[[-128; LANES]; 64], [[127; LANES]; 64], checks] {
            let mut blocks: Blocks = samples;
            forward(&mut blocks);
            blocks.iter_mut().flatten().for_each(|v| *v = (*v + 4) >> 3);
            inverse(&mut blocks);
            let pairs = blocks.iter().flatten().zip(samples.iter().flatten());
            pairs.for_each(|(a, b)| assert!((a - b).abs() <= 1, "{a} {b}"));
        }
    }
}
