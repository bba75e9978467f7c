//! The greater and the lesser of two numbers, by comparisons alone: of 0 and -0, which are equal, the first is chosen. With `f64::max` and
//! `f64::min` that is up to the processor.

/// The greater of two numbers; of one that is not a number and another, the other.
pub(crate) fn greater(a: f64, b: f64) -> f64 {
    if b > a || a.is_nan() { b } else { a }
}

/// The lesser of two numbers; of one that is not a number and another, the other.
pub(crate) fn lesser(a: f64, b: f64) -> f64 {
    if b < a || a.is_nan() { b } else { a }
}

/// The number if it is above 0, else 0, as `Relu` has it. What is not a number stays so.
pub(crate) fn cut(x: f64) -> f64 {
    if x <= 0.0 { 0.0 } else { x }
}

/// The number, but not below or above these bounds. What is not a number stays so; a bound that is not a number does not count.
pub(crate) fn clip(x: f64, low: f64, high: f64) -> f64 {
    let x = if x < low { low } else { x };
    if x > high { high } else { x }
}

/// The greater of two numbers if `sign` is 1, the lesser one if it is -1. What is not a number stays so.
pub(crate) fn further(a: f64, b: f64, sign: f64) -> f64 {
    if a.is_nan() || a * sign >= b * sign { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_equal_numbers_is_chosen() {
        for [a, b] in [[0.0, -0.0], [-0.0, 0.0]] {
            for chosen in [greater(a, b), lesser(a, b), further(a, b, 1.0), further(a, b, -1.0)] {
                assert_eq!(chosen.to_bits(), f64::to_bits(a));
            }
        }
        assert_eq!([greater(1.0, 2.0), lesser(1.0, 2.0)], [2.0, 1.0]);
        assert_eq!([further(1.0, 2.0, 1.0), further(1.0, 2.0, -1.0)], [2.0, 1.0]);
        assert_eq!(further(f64::INFINITY, f64::INFINITY, 1.0), f64::INFINITY);
    }

    #[test]
    fn relu_of_negative_zero_is_zero_and_a_zero_within_bounds_keeps_its_sign() {
        assert_eq!([cut(-0.0).to_bits(), cut(-1.0).to_bits(), cut(2.0).to_bits()], [0, 0, 2f64.to_bits()]);
        for zero in [0.0, -0.0] {
            assert_eq!(clip(zero, -zero, 1.0).to_bits(), f64::to_bits(zero));
            assert_eq!(clip(zero, -1.0, -zero).to_bits(), f64::to_bits(zero));
        }
    }

    #[test]
    fn what_is_not_a_number_is_left_out_or_kept() {
        for choose in [greater, lesser] {
            assert_eq!([choose(f64::NAN, 1.0), choose(1.0, f64::NAN)], [1.0, 1.0]);
            assert!(choose(f64::NAN, f64::NAN).is_nan());
        }
        assert!(cut(f64::NAN).is_nan() && clip(f64::NAN, 0.0, 1.0).is_nan());
        assert_eq!([clip(2.0, f64::NAN, 1.0), clip(2.0, 3.0, f64::NAN)], [1.0, 3.0]);
        assert!(further(f64::NAN, 1.0, 1.0).is_nan() && further(1.0, f64::NAN, -1.0).is_nan());
    }
}
