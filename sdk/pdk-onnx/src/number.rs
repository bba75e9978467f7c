//! The numbers of each element type: which values a type can hold, how others are rounded, wrapped or limited, and their bytes.

use crate::tensor::Element;

/// The numbers of a 16-bit float type.
struct Narrow {
    /// The number of bits behind the leading one.
    fraction: i32,
    /// The power of two of the least normal number.
    least: i32,
    /// The greatest finite number.
    greatest: f64,
}

const HALF: Narrow = Narrow { fraction: 10, least: -14, greatest: 65504.0 };
const BRAIN: Narrow = Narrow { fraction: 7, least: -126, greatest: 3.389_531_389_251_535_5e38 };

/// The limit between numbers that round to the greatest 32-bit float and those that round to infinity.
const BEYOND_FLOAT: f64 = 3.402_823_567_797_336_6e38;

impl Narrow {
    /// The nearest number of the type, of two the even one. Numbers beyond the range become infinite.
    fn round(&self, value: f64) -> f64 {
        if value == 0.0 || !value.is_finite() {
            return value;
        }
        let exponent = ((value.to_bits() >> 52) & 0x7ff) as i32 - 1023;
        let step = libm::ldexp(1.0, exponent.max(self.least) - self.fraction);
        let rounded = (value / step).round_ties_even() * step;
        if rounded.abs() > self.greatest { f64::INFINITY.copysign(value) } else { rounded }
    }
}

/// The least and the greatest number of an integer type; nothing for other types.
pub(crate) fn range(element: Element) -> Option<(i128, i128)> {
    Some(match element.0 {
        2 => (0, i128::from(u8::MAX)),
        3 => (i128::from(i8::MIN), i128::from(i8::MAX)),
        4 => (0, i128::from(u16::MAX)),
        5 => (i128::from(i16::MIN), i128::from(i16::MAX)),
        6 => (i128::from(i32::MIN), i128::from(i32::MAX)),
        7 => (i128::from(i64::MIN), i128::from(i64::MAX)),
        12 => (0, i128::from(u32::MAX)),
        13 => (0, i128::from(u64::MAX)),
        _ => return None,
    })
}

/// The number of an integer type that has the same lowest bits.
pub(crate) fn wrap(value: i128, (low, high): (i128, i128)) -> f64 {
    ((value.wrapping_sub(low)).rem_euclid(high - low + 1) + low) as f64
}

/// The whole number of a value of an integer type. A 64-bit float may round the greatest 64-bit integers to a number beyond them.
pub(crate) fn whole(value: f64, (low, high): (i128, i128)) -> i128 {
    // The conversion takes NaN to 0 and infinite numbers to the ends.
    (value as i128).clamp(low, high)
}

/// What a computed number becomes as an element of a type: 16-bit floats are rounded, and integers of up to 32 bits wrap. Integers of 64
/// bits are limited, because their last digits are not known here. Other floats stay as they are.
pub(crate) fn fit(element: Element, value: f64) -> f64 {
    match (element, range(element)) {
        (Element::FLOAT16, _) => HALF.round(value),
        (Element::BFLOAT16, _) => BRAIN.round(value),
        (Element::INT64 | Element::UINT64, Some(range)) => whole(value, range) as f64,
        (_, Some(range)) if value.is_finite() => wrap(value as i128, range),
        (_, Some(range)) => whole(value, range) as f64,
        _ => value,
    }
}

/// What a number of a type becomes in another: floats are cut and limited to the range of an integer, and integers wrap. A 32-bit float
/// keeps the digits of a 64-bit float, so that differences of them show slopes.
pub(crate) fn cast(from: Element, to: Element, value: f64) -> f64 {
    match (range(from), range(to)) {
        _ if to == Element::BOOL => f64::from(u8::from(value != 0.0)),
        (Some(from), Some(to)) => wrap(whole(value, from), to),
        (None, Some(to)) => whole(value, to) as f64,
        (_, None) if to == Element::FLOAT && value.abs() >= BEYOND_FLOAT => f64::INFINITY.copysign(value),
        (_, None) => fit(to, value),
    }
}

/// The bytes of a number, the least significant first.
pub(crate) fn bytes(element: Element, value: f64) -> Vec<u8> {
    let value = if element.is_float() { fit(element, value) } else { value };
    match element {
        Element::DOUBLE => value.to_le_bytes().to_vec(),
        Element::BOOL => vec![u8::from(value != 0.0)],
        Element::FLOAT16 => half_bits(value).to_le_bytes().to_vec(),
        Element::BFLOAT16 => ((value as f32).to_bits() >> 16).to_le_bytes()[..2].to_vec(),
        Element(2) => (value as u8).to_le_bytes().to_vec(),
        Element(3) => (value as i8).to_le_bytes().to_vec(),
        Element(4) => (value as u16).to_le_bytes().to_vec(),
        Element(5) => (value as i16).to_le_bytes().to_vec(),
        Element(6) => (value as i32).to_le_bytes().to_vec(),
        Element(7) => (value as i64).to_le_bytes().to_vec(),
        Element(12) => (value as u32).to_le_bytes().to_vec(),
        Element(13) => (value as u64).to_le_bytes().to_vec(),
        _ => (value as f32).to_le_bytes().to_vec(),
    }
}

/// The bits of a number that a 16-bit float of IEEE 754 holds exactly.
fn half_bits(value: f64) -> u16 {
    let sign = if value.is_sign_negative() { 0x8000 } else { 0 };
    let size = value.abs();
    sign | if size.is_nan() {
        0x7e00
    } else if size.is_infinite() {
        0x7c00
    } else if size < libm::ldexp(1.0, HALF.least) {
        (size * libm::ldexp(1.0, HALF.fraction - HALF.least)) as u16
    } else {
        let exponent = (size.to_bits() >> 52) as i32 - 1023;
        let fraction = (size.to_bits() >> 42) & 0x3ff;
        (((exponent + 15) << 10) as u16) | fraction as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::Tensor;

    const UINT8: Element = Element(2);
    const INT8: Element = Element(3);

    #[test]
    fn every_16_bit_float_is_read_and_written_as_it_is() {
        for element in [Element::FLOAT16, Element::BFLOAT16] {
            let raw: Vec<u8> = (0..=u16::MAX).flat_map(u16::to_le_bytes).collect();
            let mut proto = Tensor::filled(element, &[1 << 16], 0.0).unwrap().to_proto("w");
            proto.raw_data = raw.clone();
            let tensor = Tensor::from_proto(&proto).unwrap();
            for (place, value) in tensor.values.iter().enumerate() {
                assert!(fit(element, *value) == *value || value.is_nan(), "{element} {place:x}");
                let bits = bytes(element, *value);
                assert!(bits == raw[2 * place..][..2] || value.is_nan(), "{element} {place:x}: {bits:x?}");
            }
        }
    }

    #[test]
    fn numbers_between_two_16_bit_floats_go_to_the_nearest_and_of_two_to_the_even_one() {
        for (value, half, brain) in [
            (1.0 + 1.0 / 2048.0, 1.0, 1.0),
            (1.0 + 1.5 / 2048.0, 1.0 + 1.0 / 1024.0, 1.0),
            (1.0 + 3.0 / 2048.0, 1.0 + 2.0 / 1024.0, 1.0),
            (1.0 + 1.0 / 256.0, 1.0 + 1.0 / 256.0, 1.0),
            (1.0 + 3.0 / 256.0, 1.0 + 3.0 / 256.0, 1.0 + 1.0 / 64.0),
            (65519.0, 65504.0, 65536.0),
            (65520.0, f64::INFINITY, 65536.0),
            (-1e39, f64::NEG_INFINITY, f64::NEG_INFINITY),
            (libm::ldexp(1.0, -25), 0.0, libm::ldexp(1.0, -25)),
            (libm::ldexp(3.0, -26), libm::ldexp(1.0, -24), libm::ldexp(3.0, -26)),
        ] {
            assert_eq!(
                [fit(Element::FLOAT16, value), fit(Element::BFLOAT16, value)],
                [half, brain],
                "{value}"
            );
        }
    }

    #[test]
    fn integers_wrap_and_floats_are_limited() {
        assert_eq!(cast(Element::INT32, UINT8, -1.0), 255.0);
        assert_eq!(cast(Element::INT64, INT8, 200.0), -56.0);
        assert_eq!(cast(Element::INT64, Element::INT32, i64::MAX as f64), -1.0);
        assert_eq!(cast(Element::UINT64, Element::INT64, u64::MAX as f64), -1.0);
        assert_eq!(cast(Element::FLOAT, UINT8, 300.7), 255.0);
        assert_eq!(cast(Element::FLOAT, INT8, -1.9), -1.0);
        assert_eq!(cast(Element::DOUBLE, Element::INT64, f64::NEG_INFINITY), i64::MIN as f64);
        assert_eq!(cast(Element::FLOAT, Element::INT32, f64::NAN), 0.0);
        assert_eq!(cast(Element::FLOAT, Element::BOOL, f64::NAN), 1.0);
        assert_eq!(cast(Element::BOOL, INT8, 1.0), 1.0);
        assert_eq!(cast(Element::DOUBLE, Element::FLOAT, 1e39), f64::INFINITY);
        assert_eq!(fit(UINT8, 260.0), 4.0);
        assert_eq!(fit(INT8, f64::NEG_INFINITY), -128.0);
        assert_eq!(fit(Element::INT64, i64::MAX as f64), i64::MAX as f64);
    }

    #[test]
    fn every_type_is_written_as_it_is_read() {
        for element in [1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13, 16].map(Element) {
            let tensor = Tensor { element, shape: vec![2], values: vec![0.0, 1.0] };
            assert_eq!(Tensor::from_proto(&tensor.to_proto("w")).unwrap(), tensor);
        }
    }
}
