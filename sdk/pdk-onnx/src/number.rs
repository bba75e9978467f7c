//! The numbers of each element type: which values a type can hold, how others are rounded, wrapped or limited, and their bytes.

use crate::tensor::Element;

/// Which bits of a narrow float type are not finite numbers.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Special {
    /// Those with all bits of the exponent set, as in IEEE 754: infinite, or not a number.
    Exponent,
    /// Those with all bits but the sign set are not a number; none is infinite.
    All,
    /// A negative zero is not a number; none is infinite.
    NegativeZero,
}

/// A float type of 8 or 16 bits.
struct Narrow {
    /// The number of its bits.
    bits: i32,
    /// The number of bits behind the leading one.
    fraction: i32,
    /// The power of two of the least normal number.
    least: i32,
    /// The greatest finite number.
    greatest: f64,
    special: Special,
}

const fn narrow_type(bits: i32, fraction: i32, least: i32, greatest: f64, special: Special) -> Narrow {
    Narrow { bits, fraction, least, greatest, special }
}

static HALF: Narrow = narrow_type(16, 10, -14, 65504.0, Special::Exponent);
static BRAIN: Narrow = narrow_type(16, 7, -126, 3.389_531_389_251_535_5e38, Special::Exponent);
static E4M3FN: Narrow = narrow_type(8, 3, -6, 448.0, Special::All);
static E4M3FNUZ: Narrow = narrow_type(8, 3, -7, 240.0, Special::NegativeZero);
static E5M2: Narrow = narrow_type(8, 2, -14, 57344.0, Special::Exponent);
static E5M2FNUZ: Narrow = narrow_type(8, 2, -15, 57344.0, Special::NegativeZero);

/// The narrow float type of an element; nothing for other types.
fn narrow(element: Element) -> Option<&'static Narrow> {
    Some(match element.0 {
        10 => &HALF,
        16 => &BRAIN,
        17 => &E4M3FN,
        18 => &E4M3FNUZ,
        19 => &E5M2,
        20 => &E5M2FNUZ,
        _ => return None,
    })
}

/// The limit between numbers that round to the greatest 32-bit float and those that round to infinity.
const BEYOND_FLOAT: f64 = 3.402_823_567_797_336_6e38;

impl Narrow {
    /// The nearest number of the type, of two the even one. Numbers beyond the range become infinite, or not a number in types without
    /// infinite ones.
    fn round(&self, value: f64) -> f64 {
        if value == 0.0 && self.special == Special::NegativeZero {
            return 0.0;
        }
        let rounded = if value == 0.0 || !value.is_finite() { value } else { self.nearest(value) };
        match rounded.abs() > self.greatest {
            true if self.special == Special::Exponent => f64::INFINITY.copysign(value),
            true => f64::NAN,
            false if rounded == 0.0 && self.special == Special::NegativeZero => 0.0,
            false => rounded,
        }
    }

    /// The nearest number, were the range without an end.
    fn nearest(&self, value: f64) -> f64 {
        let exponent = ((value.to_bits() >> 52) & 0x7ff) as i32 - 1023;
        let step = libm::ldexp(1.0, exponent.max(self.least) - self.fraction);
        (value / step).round_ties_even() * step
    }

    /// The number that bits mean.
    fn read(&self, bits: u16) -> f64 {
        let (sign, size) = (1 << (self.bits - 1), (1 << (self.bits - 1)) - 1);
        let (exponent, fraction) = (bits & size, bits & ((1 << self.fraction) - 1));
        let exponent = i32::from(exponent >> self.fraction);
        let infinite = self.special == Special::Exponent && exponent == i32::from(size >> self.fraction);
        let signed = |value: f64| if bits & sign == 0 { value } else { -value };
        match self.special {
            _ if infinite && fraction == 0 => signed(f64::INFINITY),
            _ if infinite => f64::NAN,
            Special::All if bits & size == size => f64::NAN,
            Special::NegativeZero if bits == sign => f64::NAN,
            _ if exponent == 0 => signed(libm::ldexp(f64::from(fraction), self.least - self.fraction)),
            _ => {
                let whole = f64::from(fraction | 1 << self.fraction);
                signed(libm::ldexp(whole, exponent - 1 + self.least - self.fraction))
            }
        }
    }

    /// The bits of the nearest number.
    fn write(&self, value: f64) -> u16 {
        let value = self.round(value);
        let (sign, all) = (1u16 << (self.bits - 1), (1u16 << (self.bits - 1)) - 1);
        let infinity = all >> self.fraction << self.fraction;
        let size = value.abs();
        let signed = |bits: u16| if value.is_sign_negative() { sign | bits } else { bits };
        if size.is_nan() {
            return match self.special {
                Special::Exponent => infinity | 1 << (self.fraction - 1),
                Special::All => all,
                Special::NegativeZero => sign,
            };
        }
        if size.is_infinite() {
            return signed(infinity);
        }
        if size < libm::ldexp(1.0, self.least) {
            return signed(libm::ldexp(size, self.fraction - self.least) as u16);
        }
        let exponent = (size.to_bits() >> 52) as i32 - 1023;
        let fraction = size.to_bits() >> (52 - self.fraction) & ((1 << self.fraction) - 1);
        signed(((exponent - self.least + 1) as u16) << self.fraction | fraction as u16)
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
        21 => (0, 15),
        22 => (-8, 7),
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

/// What a computed number becomes as an element of a type: floats of 8 and 16 bits are rounded, and integers of up to 32 bits wrap.
/// Integers of 64 bits are limited, because their last digits are not known here. Other floats stay as they are.
pub(crate) fn fit(element: Element, value: f64) -> f64 {
    match (narrow(element), range(element)) {
        (Some(narrow), _) => narrow.round(value),
        (None, Some(range)) if element == Element::INT64 || element == Element::UINT64 => {
            whole(value, range) as f64
        }
        (None, Some(range)) if value.is_finite() => wrap(value as i128, range),
        (None, Some(range)) => whole(value, range) as f64,
        (None, None) => value,
    }
}

/// What a number of a type becomes in another: floats are cut and limited to the range of an integer, and integers wrap. Floats of 8 bits
/// are limited if they are to `saturate`. A 32-bit float keeps the digits of a 64-bit float, so that differences of them show slopes.
pub(crate) fn cast(from: Element, to: Element, value: f64, saturate: bool) -> f64 {
    match (range(from), range(to), narrow(to)) {
        _ if to == Element::BOOL => f64::from(u8::from(value != 0.0)),
        (Some(from), Some(to), _) => wrap(whole(value, from), to),
        (None, Some(to), _) => whole(value, to) as f64,
        (_, None, Some(narrow)) if saturate && narrow.bits == 8 => {
            narrow.round(value.clamp(-narrow.greatest, narrow.greatest))
        }
        (_, None, None) if to == Element::FLOAT && value.abs() >= BEYOND_FLOAT => {
            f64::INFINITY.copysign(value)
        }
        (_, None, _) => fit(to, value),
    }
}

/// The bytes of numbers, the least significant first. Two integers of 4 bits share a byte, the first of them in its lower half.
pub(crate) fn bytes(element: Element, values: &[f64]) -> Vec<u8> {
    if element.0 == 21 || element.0 == 22 {
        let nibble = |value: Option<&f64>| value.map_or(0, |value| *value as i8 as u8 & 15);
        return values.chunks(2).map(|pair| nibble(pair.first()) | nibble(pair.get(1)) << 4).collect();
    }
    values.iter().flat_map(|&value| bytes_of(element, value)).collect()
}

fn bytes_of(element: Element, value: f64) -> Vec<u8> {
    match (element.0, narrow(element)) {
        (_, Some(narrow)) => narrow.write(value).to_le_bytes()[..narrow.bits as usize / 8].to_vec(),
        (2, _) => (value as u8).to_le_bytes().to_vec(),
        (3, _) => (value as i8).to_le_bytes().to_vec(),
        (4, _) => (value as u16).to_le_bytes().to_vec(),
        (5, _) => (value as i16).to_le_bytes().to_vec(),
        (6, _) => (value as i32).to_le_bytes().to_vec(),
        (7, _) => (value as i64).to_le_bytes().to_vec(),
        (9, _) => vec![u8::from(value != 0.0)],
        (11, _) => value.to_le_bytes().to_vec(),
        (12, _) => (value as u32).to_le_bytes().to_vec(),
        (13, _) => (value as u64).to_le_bytes().to_vec(),
        _ => (value as f32).to_le_bytes().to_vec(),
    }
}

/// The float of 8 or 16 bits that these bits are; nothing for other types.
pub(crate) fn float(element: Element, bits: u16) -> Option<f64> {
    narrow(element).map(|narrow| narrow.read(bits))
}

/// This many integers of 4 bits, of which two share a byte.
pub(crate) fn nibbles(element: Element, bytes: impl Iterator<Item = u8>, count: usize) -> Vec<f64> {
    let high = range(element).map_or(15, |(_, high)| high);
    let signed =
        |nibble: u8| if i128::from(nibble) > high { f64::from(nibble) - 16.0 } else { nibble.into() };
    bytes.flat_map(|byte| [byte & 15, byte >> 4]).map(signed).take(count).collect()
}

/// The number that bytes mean, the least significant first.
pub(crate) fn read(element: Element, b: &[u8]) -> f64 {
    match (element.0, b) {
        (10 | 16, &[a, b]) => float(element, u16::from_le_bytes([a, b])).unwrap_or(f64::NAN),
        (17..=20, &[a]) => float(element, u16::from(a)).unwrap_or(f64::NAN),
        (2 | 9, &[a]) => f64::from(a),
        (3, &[a]) => f64::from(a as i8),
        (4, &[a, b]) => f64::from(u16::from_le_bytes([a, b])),
        (5, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
        (6, &[a, b, c, d]) => f64::from(i32::from_le_bytes([a, b, c, d])),
        (12, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
        (_, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
        (7, &[a, b, c, d, e, f, g, h]) => i64::from_le_bytes([a, b, c, d, e, f, g, h]) as f64,
        (13, &[a, b, c, d, e, f, g, h]) => u64::from_le_bytes([a, b, c, d, e, f, g, h]) as f64,
        (_, &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::Tensor;

    const UINT8: Element = Element(2);
    const INT8: Element = Element(3);

    #[test]
    fn every_narrow_float_is_read_and_written_as_it_is() {
        for element in [10, 16, 17, 18, 19, 20].map(Element) {
            let narrow = narrow(element).unwrap();
            let mut greatest = 0.0f64;
            for bits in 0..=(1u32 << narrow.bits) - 1 {
                let value = narrow.read(bits as u16);
                if value.is_nan() {
                    assert!(narrow.read(narrow.write(value)).is_nan(), "{element} {bits:x}");
                    continue;
                }
                assert_eq!(fit(element, value), value, "{element} {bits:x}");
                assert_eq!(u32::from(narrow.write(value)), bits, "{element}");
                if value.is_finite() {
                    greatest = greatest.max(value);
                }
            }
            assert_eq!(greatest, narrow.greatest, "{element}");
        }
        assert_eq!(HALF.read(0x3c00), 1.0);
        assert_eq!(BRAIN.read(0x3f80), 1.0);
        assert_eq!([E4M3FN.read(0x38), E4M3FNUZ.read(0x40)], [1.0, 1.0]);
        assert_eq!([E5M2.read(0x3c), E5M2FNUZ.read(0x40)], [1.0, 1.0]);
    }

    #[test]
    fn floats_of_8_bits_are_limited_or_overflow() {
        for (element, greatest, infinity) in [
            (17, 448.0, f64::NAN),
            (18, 240.0, f64::NAN),
            (19, 57344.0, f64::INFINITY),
            (20, 57344.0, f64::NAN),
        ] {
            let to = Element(element);
            assert_eq!(cast(Element::FLOAT, to, 1e6, true), greatest);
            assert_eq!(cast(Element::FLOAT, to, f64::NEG_INFINITY, true), -greatest);
            let beyond = cast(Element::FLOAT, to, 1e6, false);
            assert!(beyond == infinity || beyond.is_nan() && infinity.is_nan(), "{to}: {beyond}");
        }
        assert_eq!(cast(Element::FLOAT, Element(18), -1e-9, true).to_bits(), 0);
        assert_eq!(cast(Element::FLOAT, Element::FLOAT16, 1e6, true), f64::INFINITY);
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
        assert_eq!(cast(Element::INT32, UINT8, -1.0, true), 255.0);
        assert_eq!(cast(Element::INT64, INT8, 200.0, true), -56.0);
        assert_eq!(cast(Element::INT64, Element::INT32, i64::MAX as f64, true), -1.0);
        assert_eq!(cast(Element::UINT64, Element::INT64, u64::MAX as f64, true), -1.0);
        assert_eq!(cast(Element::FLOAT, UINT8, 300.7, true), 255.0);
        assert_eq!(cast(Element::FLOAT, INT8, -1.9, true), -1.0);
        assert_eq!(cast(Element::DOUBLE, Element::INT64, f64::NEG_INFINITY, true), i64::MIN as f64);
        assert_eq!(cast(Element::FLOAT, Element::INT32, f64::NAN, true), 0.0);
        assert_eq!(cast(Element::FLOAT, Element::BOOL, f64::NAN, true), 1.0);
        assert_eq!(cast(Element::BOOL, INT8, 1.0, true), 1.0);
        assert_eq!(cast(Element::DOUBLE, Element::FLOAT, 1e39, true), f64::INFINITY);
        assert_eq!(cast(Element::FLOAT, Element(22), -9.0, true), -8.0);
        assert_eq!(cast(INT8, Element(21), 17.0, true), 1.0);
        assert_eq!(fit(UINT8, 260.0), 4.0);
        assert_eq!(fit(INT8, f64::NEG_INFINITY), -128.0);
        assert_eq!(fit(Element::INT64, i64::MAX as f64), i64::MAX as f64);
    }

    #[test]
    fn every_type_is_written_as_it_is_read() {
        let types = [1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13, 16, 17, 18, 19, 20, 21, 22];
        for element in types.map(Element) {
            let tensor = Tensor { element, shape: vec![3], values: vec![0.0, 1.0, 1.0] };
            assert_eq!(Tensor::from_proto(&tensor.to_proto("w")).unwrap(), tensor);
        }
    }
}
