//! Floats of 8 and 16 bits: their numbers, the nearest of them, and their bits.

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
pub(crate) struct Narrow {
    /// The number of its bits.
    pub bits: i32,
    /// The number of bits behind the leading one.
    fraction: i32,
    /// The power of two of the least normal number.
    least: i32,
    /// The greatest finite number.
    pub greatest: f64,
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

/// 2 to the power of the exponent of a normal number.
fn power(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

impl Narrow {
    /// The narrow float type with a number in ONNX; nothing for other types.
    pub fn of(element: i32) -> Option<&'static Self> {
        Some(match element {
            10 => &HALF,
            16 => &BRAIN,
            17 => &E4M3FN,
            18 => &E4M3FNUZ,
            19 => &E5M2,
            20 => &E5M2FNUZ,
            _ => return None,
        })
    }

    /// The nearest number of the type, of two the even one. Numbers beyond the range become infinite, or not a number in types without
    /// infinite ones.
    pub fn round(&self, value: f64) -> f64 {
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
        let step = power(exponent.max(self.least) - self.fraction);
        (value / step).round_ties_even() * step
    }

    /// The number that bits mean.
    pub fn read(&self, bits: u16) -> f64 {
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
    pub fn write(&self, value: f64) -> u16 {
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
        if size < power(self.least) {
            return signed(libm::ldexp(size, self.fraction - self.least) as u16);
        }
        let exponent = (size.to_bits() >> 52) as i32 - 1023;
        let fraction = size.to_bits() >> (52 - self.fraction) & ((1 << self.fraction) - 1);
        signed(((exponent - self.least + 1) as u16) << self.fraction | fraction as u16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Element;

    #[test]
    fn every_narrow_float_is_read_and_written_as_it_is() {
        for element in [10, 16, 17, 18, 19, 20].map(Element) {
            let narrow = Narrow::of(element.0).unwrap();
            let mut greatest = 0.0;
            for bits in 0..=(1u32 << narrow.bits) - 1 {
                let value = narrow.read(bits as u16);
                if value.is_nan() {
                    assert!(narrow.read(narrow.write(value)).is_nan(), "{element} {bits:x}");
                    continue;
                }
                assert_eq!(element.rounded(value), value, "{element} {bits:x}");
                assert_eq!(u32::from(narrow.write(value)), bits, "{element}");
                if value.is_finite() {
                    greatest = if value > greatest { value } else { greatest };
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
                [Element::FLOAT16.rounded(value), Element::BFLOAT16.rounded(value)],
                [half, brain],
                "{value}"
            );
        }
    }
}
