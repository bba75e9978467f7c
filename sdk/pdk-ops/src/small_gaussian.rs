//! Rows of a Gaussian blur with a kernel of 3, 5 or 7 pixels. Without the factor that their weights have in common, sums of
//! weighted values fit 16 bits, so that each of the two directions is a single pass.

use crate::simd::vectorised;

/// Sums rows, as many as the kernel has pixels, with its weights: of 4 for 3 rows, of 16 for 5 and of 64 for 7.
pub(crate) fn sum_down(rows: &[&[u8]], sums: &mut [u16]) {
    match rows.len() {
        3 => down_3(rows, sums),
        5 => down_5(rows, sums),
        rows_given => {
            debug_assert_eq!(rows_given, 7, "small kernels have 3, 5 or 7 rows");
            down_7(rows, sums);
        }
    }
}

/// Sums what [`sum_down`] gave to the right with the kernel's `size` weights, each value `step` from the next, and divides by both
/// directions' weights, rounding half up. The middle of the first sum is `size / 2 * step` after the start of `sums`.
pub(crate) fn sum_right(sums: &[u16], size: usize, step: usize, out: &mut [u8]) {
    match size {
        3 => right_3(sums, step, out),
        5 => right_5(sums, step, out),
        size => {
            debug_assert_eq!(size, 7, "small kernels have 3, 5 or 7 pixels");
            right_7(sums, step, out);
        }
    }
}

#[inline(always)]
fn weighted_3([a, b, c]: [u16; 3]) -> u16 {
    a + 2 * b + c
}

#[inline(always)]
fn weighted_5([a, b, c, d, e]: [u16; 5]) -> u16 {
    (a + e) + 4 * (b + d) + 6 * c
}

/// Of values or sums of two values at each distance from the middle, the furthest first.
#[inline(always)]
fn weighted_7(pairs: [u16; 4]) -> u16 {
    2 * pairs[0] + 7 * pairs[1] + 14 * pairs[2] + 18 * pairs[3]
}

vectorised! {
    fn down_3 / down_3_avx2 / down_3_avx512 (rows: &[&[u8]], sums: &mut [u16]) {
        let [a, b, c] = [0, 1, 2].map(|i: usize| &rows[i][..sums.len()]);
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum = weighted_3([a[i], b[i], c[i]].map(u16::from));
        }
    }
}

vectorised! {
    fn down_5 / down_5_avx2 / down_5_avx512 (rows: &[&[u8]], sums: &mut [u16]) {
        let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|i: usize| &rows[i][..sums.len()]);
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum = weighted_5([a[i], b[i], c[i], d[i], e[i]].map(u16::from));
        }
    }
}

vectorised! {
    fn down_7 / down_7_avx2 / down_7_avx512 (rows: &[&[u8]], sums: &mut [u16]) {
        let [a, b, c, d] = [0, 1, 2, 3].map(|i: usize| &rows[i][..sums.len()]);
        let [e, f, g] = [4, 5, 6].map(|i: usize| &rows[i][..sums.len()]);
        for (i, sum) in sums.iter_mut().enumerate() {
            let both = |one: &[u8], other: &[u8]| u16::from(one[i]) + u16::from(other[i]);
            *sum = weighted_7([both(a, g), both(b, f), both(c, e), u16::from(d[i])]);
        }
    }
}

vectorised! {
    fn right_3 / right_3_avx2 / right_3_avx512 (sums: &[u16], step: usize, out: &mut [u8]) {
        let [a, b, c] = [0, 1, 2].map(|i| &sums[i * step..][..out.len()]);
        for (i, out) in out.iter_mut().enumerate() {
            *out = ((weighted_3([a[i], b[i], c[i]]) + 8) >> 4) as u8;
        }
    }
}

vectorised! {
    fn right_5 / right_5_avx2 / right_5_avx512 (sums: &[u16], step: usize, out: &mut [u8]) {
        let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|i| &sums[i * step..][..out.len()]);
        for (i, out) in out.iter_mut().enumerate() {
            *out = ((weighted_5([a[i], b[i], c[i], d[i], e[i]]) + 128) >> 8) as u8;
        }
    }
}

vectorised! {
    // Upper and lower bytes of sums are weighted one after the other, which fits 16 bits: (256 * upper + lower + 2048) >> 12.
    fn right_7 / right_7_avx2 / right_7_avx512 (sums: &[u16], step: usize, out: &mut [u8]) {
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| &sums[i * step..][..out.len()]);
        let [e, f, g] = [4, 5, 6].map(|i| &sums[i * step..][..out.len()]);
        for (i, out) in out.iter_mut().enumerate() {
            let [ag, bf, ce, d] = [a[i] + g[i], b[i] + f[i], c[i] + e[i], d[i]];
            let upper = weighted_7([ag >> 8, bf >> 8, ce >> 8, d >> 8]);
            let lower = weighted_7([ag & 255, bf & 255, ce & 255, d & 255]);
            *out = ((upper + (lower >> 8) + 8) >> 4) as u8;
        }
    }
}
