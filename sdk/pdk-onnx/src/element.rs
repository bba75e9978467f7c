//! How numbers fit the small types of elements: integers wrap or saturate, and floats of 8 bits are rounded.

use crate::tensor::Element;

/// The layout of a float of 8 bits.
struct Float8 {
    /// The number of bits of its fraction.
    fraction: i32,
    /// What is taken off its exponent.
    bias: i32,
    greatest: f64,
    /// Whether it has infinities.
    infinite: bool,
    /// Whether minus zero stands for what is not a number.
    unsigned_zero: bool,
}

impl Element {
    /// Whether elements are whole numbers.
    pub fn is_integer(self) -> bool {
        self.bits().is_some()
    }

    /// The number of bits of an integer type, and whether it has a sign; nothing for other types.
    fn bits(self) -> Option<(u32, bool)> {
        Some(match self.0 {
            2 => (8, false),
            3 => (8, true),
            4 => (16, false),
            5 => (16, true),
            6 => (32, true),
            7 => (64, true),
            12 => (32, false),
            13 => (64, false),
            21 => (4, false),
            22 => (4, true),
            _ => return None,
        })
    }

    /// The element with the low bits of a whole number, which is what sums and products that overflow leave. The element of a type
    /// that does not consist of integers is the number itself.
    pub fn wrapped(self, value: i128) -> f64 {
        let Some((bits, signed)) = self.bits() else { return value as f64 };
        let low = value & ((1 << bits) - 1);
        (if signed && low >> (bits - 1) != 0 { low - (1 << bits) } else { low }) as f64
    }

    /// The nearest element of an integer type to a whole number, 0 for what is not a number. Other types keep the number.
    pub fn saturated(self, value: f64) -> f64 {
        let Some((bits, signed)) = self.bits() else { return value };
        let count = 1i128 << bits;
        let low = if signed { -(count / 2) } else { 0 };
        (value as i128).clamp(low, low + count - 1) as f64
    }

    /// Integers of 4 bits, two in each byte, the first in its low half. The bytes are in one of the two lists.
    pub fn nibbles(self, raw: &[u8], listed: &[i32], count: usize) -> Vec<f64> {
        let bytes =
            raw.iter().map(|&byte| i128::from(byte)).chain(listed.iter().map(|&byte| i128::from(byte)));
        let mut values: Vec<f64> =
            bytes.flat_map(|byte| [self.wrapped(byte), self.wrapped(byte >> 4)]).collect();
        // The last half is empty if the number of elements is odd.
        if values.len() == count + 1 {
            values.pop();
        }
        values
    }

    /// Whether elements are floats of 8 bits.
    pub fn is_float8(self) -> bool {
        self.layout().is_some()
    }

    fn layout(self) -> Option<Float8> {
        let (fraction, bias, greatest, infinite, unsigned_zero) = match self.0 {
            17 => (3, 7, 448.0, false, false),
            18 => (3, 8, 240.0, false, true),
            19 => (2, 15, 57344.0, true, false),
            20 => (2, 16, 57344.0, false, true),
            _ => return None,
        };
        Some(Float8 { fraction, bias, greatest, infinite, unsigned_zero })
    }

    /// A float of 8 bits.
    pub fn float8(self, bits: u8) -> f64 {
        let Some(layout) = self.layout() else { return f64::NAN };
        let low = i32::from(bits & 127);
        let (exponent, fraction) = (low >> layout.fraction, low & ((1 << layout.fraction) - 1));
        let size = match exponent {
            0 => libm::scalbn(f64::from(fraction), 1 - layout.bias - layout.fraction),
            _ => libm::scalbn(
                f64::from(fraction + (1 << layout.fraction)),
                exponent - layout.bias - layout.fraction,
            ),
        };
        if layout.unsigned_zero && bits == 128 {
            return f64::NAN;
        }
        let size = match size > layout.greatest {
            true if layout.infinite && fraction == 0 => f64::INFINITY,
            true => f64::NAN,
            false => size,
        };
        if bits > 127 { -size } else { size }
    }

    /// The nearest float of 8 bits, of two the even one. One that is too large becomes the greatest if it is to saturate, else
    /// infinite or what is not a number. Other types keep the number.
    pub fn rounded(self, value: f64, saturate: bool) -> f64 {
        let Some(layout) = self.layout() else { return value };
        if value.is_nan() || value == 0.0 {
            return if layout.unsigned_zero { value + 0.0 } else { value };
        }
        let rounded = match value.is_infinite() {
            true => value,
            false => {
                let exponent = libm::ilogb(value).max(1 - layout.bias) - layout.fraction;
                libm::scalbn(libm::scalbn(value, -exponent).round_ties_even(), exponent)
            }
        };
        match rounded.abs() > layout.greatest {
            true if saturate => layout.greatest.copysign(value),
            true if layout.infinite => f64::INFINITY.copysign(value),
            true => f64::NAN,
            false => rounded,
        }
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
            assert_eq!(element.wrapped(high as i128 + 1), low, "{element}");
            assert_eq!(element.wrapped(low as i128 - 1), high, "{element}");
            assert_eq!([element.wrapped(high as i128), element.saturated(high)], [high; 2], "{element}");
        }
        assert_eq!(Element::INT64.wrapped(1 << 63), -libm::exp2(63.0));
        assert_eq!(Element(13).wrapped(-(1 << 63)), libm::exp2(63.0));
        assert_eq!([Element::FLOAT.saturated(0.5), Element::FLOAT.wrapped(300)], [0.5, 300.0]);
    }

    #[test]
    fn two_integers_of_4_bits_share_a_byte() {
        assert_eq!(Element(21).nibbles(&[0x21, 0xf3], &[], 3), [1.0, 2.0, 3.0]);
        assert_eq!(Element(22).nibbles(&[], &[0xf8], 2), [-8.0, -1.0]);
        // A number of bytes that is wrong is left for the check of the shape.
        assert_eq!(Element(22).nibbles(&[1], &[], 7).len(), 2);
    }

    #[test]
    fn every_float_of_8_bits_is_its_own_nearest() {
        for number in 17..=20 {
            let element = Element(number);
            for bits in 0..=255 {
                let value = element.float8(bits);
                let same = element.rounded(value, false);
                assert!(same == value || same.is_nan() && value.is_nan(), "{element} {bits}: {value} {same}");
            }
            assert_eq!(
                element.rounded(1e9, true),
                (0..=127).map(|bits| element.float8(bits)).filter(|v| v.is_finite()).fold(0.0, f64::max)
            );
        }
        assert_eq!(Element(17).rounded(17.0, true), 16.0);
        assert_eq!(Element(17).rounded(19.0, true), 20.0);
        assert_eq!(Element(19).rounded(-1e9, false), f64::NEG_INFINITY);
        assert!(Element(17).rounded(1e9, false).is_nan());
    }
}
