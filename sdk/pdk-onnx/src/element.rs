//! The types of elements: which numbers they hold, and what becomes of others.

use std::fmt;

use crate::narrow::Narrow;

/// The type of a tensor's elements, by its number in ONNX.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Element(pub i32);

impl Element {
    /// 32-bit float.
    pub const FLOAT: Self = Self(1);
    /// 8-bit unsigned integer.
    pub const UINT8: Self = Self(2);
    /// 8-bit signed integer.
    pub const INT8: Self = Self(3);
    /// 32-bit signed integer.
    pub const INT32: Self = Self(6);
    /// 64-bit signed integer.
    pub const INT64: Self = Self(7);
    /// True or false.
    pub const BOOL: Self = Self(9);
    /// 16-bit float.
    pub const FLOAT16: Self = Self(10);
    /// 64-bit float.
    pub const DOUBLE: Self = Self(11);
    /// 64-bit unsigned integer.
    pub const UINT64: Self = Self(13);
    /// The upper half of a 32-bit float.
    pub const BFLOAT16: Self = Self(16);

    /// Whether elements are real numbers.
    pub fn is_float(self) -> bool {
        matches!(self.0, 1 | 10 | 11 | 16) || self.is_float8()
    }

    /// Whether elements are floats of 8 bits.
    pub fn is_float8(self) -> bool {
        matches!(self.0, 17..=20)
    }

    /// Whether elements are whole numbers.
    pub fn is_integer(self) -> bool {
        self.range().is_some()
    }

    /// The least and the greatest number of an integer type; nothing for other types.
    pub(crate) fn range(self) -> Option<(i128, i128)> {
        Some(match self.0 {
            2 => (0, i128::from(u8::MAX)),
            3 => (i128::from(i8::MIN), i128::from(i8::MAX)),
            4 => (0, i128::from(u16::MAX)),
            5 => (i128::from(i16::MIN), i128::from(i16::MAX)),
            6 => (i128::from(i32::MIN), i128::from(i32::MAX)),
            7 => (i128::from(i64::MIN), i128::from(i64::MAX)),
            12 => (0, i128::from(u32::MAX)),
            13 => (0, i128::from(u64::MAX)),
            21 => (0, 15),
            22 => (-8, 7),
            _ => return None,
        })
    }

    /// The whole number of an integer type that is nearest to a number without its fraction; 0 for what is not a number. A 64-bit float may
    /// have rounded the greatest 64-bit integers to a number beyond them.
    pub(crate) fn whole(self, value: f64) -> i128 {
        let (low, high) = self.range().unwrap_or((i128::MIN, i128::MAX));
        (value as i128).clamp(low, high)
    }

    /// The same as an element, which is what saturates. Other types keep the number.
    pub(crate) fn saturated(self, value: f64) -> f64 {
        if self.is_integer() { self.whole(value) as f64 } else { value }
    }

    /// The element with the low bits of a whole number, which is what sums and products that overflow leave. Of truth values all but 0 are
    /// true. The element of other types is the number itself.
    pub(crate) fn wrapped(self, value: i128) -> f64 {
        match self.range() {
            None if self == Self::BOOL => f64::from(u8::from(value != 0)),
            None => value as f64,
            Some((low, high)) => {
                let bits = value & (high - low);
                (if bits > high { bits - (high - low) - 1 } else { bits }) as f64
            }
        }
    }

    /// What a computed number becomes as an element: floats are rounded to the nearest, of two to the even one, and integers of up to 32 bits
    /// are cut and wrap. Integers of 64 bits saturate, because their last digits are not known here.
    pub(crate) fn rounded(self, value: f64) -> f64 {
        match self {
            Self::FLOAT => f64::from(value as f32),
            Self::INT64 | Self::UINT64 => self.saturated(value),
            _ if !self.is_integer() => Narrow::of(self.0).map_or(value, |narrow| narrow.round(value)),
            _ if value.is_finite() => self.wrapped(value as i128),
            _ => self.saturated(value),
        }
    }

    /// What an element of this type becomes in another: floats are cut and saturate in integers, and integers wrap. Floats of 8 bits
    /// saturate if they are to. A 32-bit float keeps the digits of a 64-bit float, so that differences of them show slopes.
    pub(crate) fn converted(self, to: Self, value: f64, saturate: bool) -> f64 {
        match Narrow::of(to.0) {
            _ if to == Self::BOOL => f64::from(u8::from(value != 0.0)),
            _ if to.is_integer() && self.is_integer() => to.wrapped(self.whole(value)),
            _ if to.is_integer() => to.saturated(value),
            _ if to == Self::FLOAT && to.rounded(value).is_finite() => value,
            Some(narrow) if saturate && to.is_float8() => {
                narrow.round(value.clamp(-narrow.greatest, narrow.greatest))
            }
            _ => to.rounded(value),
        }
    }

    /// The sum of two elements. Integers wrap.
    pub(crate) fn sum(self, a: f64, b: f64) -> f64 {
        if self.is_float() { a + b } else { self.wrapped((a as i128).wrapping_add(b as i128)) }
    }

    /// The difference of two elements. Integers wrap.
    pub(crate) fn difference(self, a: f64, b: f64) -> f64 {
        if self.is_float() { a - b } else { self.wrapped((a as i128).wrapping_sub(b as i128)) }
    }

    /// The product of two elements. Integers wrap.
    pub(crate) fn product(self, a: f64, b: f64) -> f64 {
        if self.is_float() { a * b } else { self.wrapped((a as i128).wrapping_mul(b as i128)) }
    }
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.0 {
            1 => "FLOAT",
            2 => "UINT8",
            3 => "INT8",
            4 => "UINT16",
            5 => "INT16",
            6 => "INT32",
            7 => "INT64",
            8 => "STRING",
            9 => "BOOL",
            10 => "FLOAT16",
            11 => "DOUBLE",
            12 => "UINT32",
            13 => "UINT64",
            16 => "BFLOAT16",
            17 => "FLOAT8E4M3FN",
            18 => "FLOAT8E4M3FNUZ",
            19 => "FLOAT8E5M2",
            20 => "FLOAT8E5M2FNUZ",
            21 => "UINT4",
            22 => "INT4",
            _ => "of a rare type",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_wrap_and_saturate_at_the_ends_of_their_types() {
        for (number, low, high) in [
            (2, 0.0, 255.0),
            (3, -128.0, 127.0),
            (4, 0.0, 65535.0),
            (5, -32768.0, 32767.0),
            (6, -2147483648.0, 2147483647.0),
            (12, 0.0, 4294967295.0),
            (21, 0.0, 15.0),
            (22, -8.0, 7.0),
        ] {
            let element = Element(number);
            assert_eq!([element.saturated(f64::NEG_INFINITY), element.saturated(f64::INFINITY)], [low, high]);
            assert_eq!([element.sum(high, 1.0), element.difference(low, 1.0)], [low, high], "{element}");
            assert_eq!([element.wrapped(high as i128), element.saturated(high)], [high; 2], "{element}");
            assert_eq!([element.rounded(high + 1.5), element.rounded(f64::NAN)], [low, 0.0], "{element}");
        }
        assert_eq!(Element::INT64.wrapped(1 << 63), -libm::exp2(63.0));
        assert_eq!(Element::UINT64.wrapped(-(1 << 63)), libm::exp2(63.0));
        assert_eq!(Element::INT64.rounded(i64::MAX as f64), i64::MAX as f64);
        assert_eq!([Element::FLOAT.saturated(0.5), Element::FLOAT.wrapped(300)], [0.5, 300.0]);
        assert_eq!(Element::INT32.product(65536.0, 65537.0), 65536.0);
        assert_eq!([Element::BOOL.sum(1.0, 1.0), Element::FLOAT.sum(250.0, 10.5)], [1.0, 260.5]);
        assert_eq!(Element::INT8.rounded(f64::NEG_INFINITY), -128.0);
    }

    #[test]
    fn integers_become_others_by_their_low_bits_and_floats_are_cut() {
        let cast = |from: Element, to: Element, value| from.converted(to, value, true);
        assert_eq!(cast(Element::INT32, Element::UINT8, -1.0), 255.0);
        assert_eq!(cast(Element::INT64, Element::INT8, 200.0), -56.0);
        assert_eq!(cast(Element::INT64, Element::INT32, i64::MAX as f64), -1.0);
        assert_eq!(cast(Element::UINT64, Element::INT64, u64::MAX as f64), -1.0);
        assert_eq!(cast(Element::FLOAT, Element::UINT8, 300.7), 255.0);
        assert_eq!(cast(Element::FLOAT, Element::INT8, -1.9), -1.0);
        assert_eq!(cast(Element::DOUBLE, Element::INT64, f64::NEG_INFINITY), i64::MIN as f64);
        assert_eq!(cast(Element::FLOAT, Element::INT32, f64::NAN), 0.0);
        assert_eq!(cast(Element::FLOAT, Element::BOOL, f64::NAN), 1.0);
        assert_eq!(cast(Element::BOOL, Element::INT8, 1.0), 1.0);
        assert_eq!(cast(Element::DOUBLE, Element::FLOAT, 1e39), f64::INFINITY);
        assert_eq!(cast(Element::DOUBLE, Element::FLOAT, 0.1), 0.1);
        assert_eq!(cast(Element::FLOAT, Element(22), -9.0), -8.0);
        assert_eq!(cast(Element::INT8, Element(21), 17.0), 1.0);
    }

    #[test]
    fn floats_of_8_bits_saturate_or_overflow() {
        for (number, greatest, infinity) in [
            (17, 448.0, f64::NAN),
            (18, 240.0, f64::NAN),
            (19, 57344.0, f64::INFINITY),
            (20, 57344.0, f64::NAN),
        ] {
            let to = Element(number);
            let cast = |value, saturate| Element::FLOAT.converted(to, value, saturate);
            assert_eq!([cast(1e6, true), cast(f64::NEG_INFINITY, true)], [greatest, -greatest]);
            let beyond = cast(1e6, false);
            assert!(beyond == infinity || beyond.is_nan() && infinity.is_nan(), "{to}: {beyond}");
        }
        assert_eq!(Element::FLOAT.converted(Element(18), -1e-9, true).to_bits(), 0);
        assert_eq!(Element::FLOAT.converted(Element::FLOAT16, 1e6, true), f64::INFINITY);
    }
}
