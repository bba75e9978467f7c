//! Sums and extremes of many 32-bit floats. The order of additions is fixed, and lets a processor add several numbers at a time.
//!
//! Elements whose places leave the same remainder when divided by eight are added from left to right, in 64 bits, and the eight sums in pairs.

use crate::order::further;

/// The number of sums that are kept at a time.
pub const PARTS: usize = 8;

/// The sum of a function of each element.
#[inline(always)]
pub fn sum(values: &[f32], f: impl Fn(f64) -> f64) -> f64 {
    let mut parts = [0.0; PARTS];
    add(&mut parts, values, f);
    joined(parts)
}

/// Adds a function of each element to the sums.
#[inline(always)]
pub fn add(parts: &mut [f64; PARTS], values: &[f32], f: impl Fn(f64) -> f64) {
    let (rows, rest) = values.as_chunks::<PARTS>();
    for row in rows {
        for (part, x) in parts.iter_mut().zip(row) {
            *part += f(f64::from(*x));
        }
    }
    for (part, x) in parts.iter_mut().zip(rest) {
        *part += f(f64::from(*x));
    }
}

/// The sum of the sums.
#[inline(always)]
pub fn joined([a, b, c, d, e, f, g, h]: [f64; PARTS]) -> f64 {
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// The greater of two numbers if `GREATEST`, else the lesser one; the first of two equal numbers. What is not a number stays so.
#[inline(always)]
pub fn beyond<const GREATEST: bool>(a: f32, b: f32) -> f32 {
    let first = if GREATEST { a >= b } else { a <= b };
    if first | a.is_nan() { a } else { b }
}

/// The greatest or the least of some elements, which begin with `far`. Of 0 and -0 it may be either.
#[inline(always)]
pub fn extreme<const GREATEST: bool>(far: f32, values: &[f32]) -> f32 {
    // More than for sums, since each takes a comparison and a choice.
    const PARTS: usize = 32;
    let (rows, rest) = values.as_chunks::<PARTS>();
    let mut parts = [far; PARTS];
    for row in rows {
        for (part, x) in parts.iter_mut().zip(row) {
            *part = beyond::<GREATEST>(*part, *x);
        }
    }
    let sign = if GREATEST { 1.0 } else { -1.0 };
    let all = parts.into_iter().chain(rest.iter().copied());
    all.map(f64::from).fold(f64::from(far), |far, x| further(far, x, sign)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::numbers;

    #[test]
    fn sums_and_extremes_are_those_of_all_elements() {
        for count in [0, 1, 7, 8, 9, 31, 64, 197] {
            let values: Vec<f32> = numbers(count as u64, count).iter().map(|&x| x as f32).collect();
            let expected: f64 = values.iter().map(|&x| f64::from(x) * 2.0).sum();
            assert!((sum(&values, |x| x * 2.0) - expected).abs() < 1e-13, "{count}");
            let greatest = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            let least = values.iter().copied().fold(f32::INFINITY, f32::min);
            assert_eq!(extreme::<true>(f32::NEG_INFINITY, &values), greatest, "{count}");
            assert_eq!(extreme::<false>(f32::INFINITY, &values), least, "{count}");
            for place in 0..count {
                let mut values = values.clone();
                values[place] = f32::NAN;
                assert!(extreme::<true>(f32::NEG_INFINITY, &values).is_nan(), "{place} of {count}");
                assert!(extreme::<false>(f32::INFINITY, &values).is_nan(), "{place} of {count}");
            }
        }
    }
}
