//! From bytes to the numbers that a network was trained on.

use pdk_sdk::error::Result;
use pdk_sdk::serde_json::Value;

use crate::given::Given;

/// How bytes become numbers before mean and standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// A range from the least to the greatest.
    Range(f64, f64),
    /// A factor.
    Factor(f64),
}

impl Scale {
    /// Reads the field.
    pub(crate) fn read(given: &Given) -> Result<Option<Self>> {
        let Some((value, _)) = given.get("scale") else { return Ok(None) };
        let range = |text: &str| {
            let (low, high) = text.split_once("..")?;
            let (low, high): (f64, f64) = (low.trim().parse().ok()?, high.trim().parse().ok()?);
            (low.is_finite() && high.is_finite() && low < high).then_some(Self::Range(low, high))
        };
        let scale = match value {
            Value::String(text) => range(text),
            Value::Number(number) => number.as_f64().filter(|factor| *factor != 0.0).map(Self::Factor),
            _ => None,
        };
        match scale {
            Some(scale) => Ok(Some(scale)),
            None => Err(given.wrong(
                "scale",
                format_args!("is {value}; write a range such as \"0..1\", or a factor on bytes"),
            )),
        }
    }

    /// The number of a byte.
    fn number(self, byte: u8) -> f32 {
        match self {
            // As programs write it, so that the last digit is theirs too.
            Self::Range(0.0, 255.0) => f32::from(byte),
            Self::Range(0.0, 1.0) => f32::from(byte) / 255.0,
            Self::Range(-1.0, 1.0) => f32::from(byte) / 127.5 - 1.0,
            Self::Range(low, high) => (low + f64::from(byte) * ((high - low) / 255.0)) as f32,
            Self::Factor(factor) => f32::from(byte) * factor as f32,
        }
    }
}

impl std::fmt::Display for Scale {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Range(low, high) => write!(f, "{low}..{high}"),
            Self::Factor(factor) => write!(f, "bytes times {factor}"),
        }
    }
}

/// The numbers of each channel's bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct Numbers {
    tables: Vec<[f32; 256]>,
}

impl Numbers {
    /// The conversion for a number of channels. `mean` and `std` have one number, or one for each channel.
    pub fn new(scale: Scale, mean: &[f64], std: &[f64], channels: usize) -> Self {
        let of = |list: &[f64], channel: usize| list.get(channel).or(list.first()).copied();
        let table = |channel: usize| {
            let mean = of(mean, channel).unwrap_or(0.0) as f32;
            let std = of(std, channel).unwrap_or(1.0) as f32;
            std::array::from_fn(|byte| (scale.number(byte as u8) - mean) / std)
        };
        Self { tables: (0..channels).map(table).collect() }
    }

    /// The numbers of all bytes of a channel.
    pub fn table(&self, channel: usize) -> &[f32; 256] {
        &self.tables[channel]
    }

    /// The number of a byte of a channel.
    #[inline]
    pub fn number(&self, channel: usize, byte: u8) -> f32 {
        self.tables[channel][usize::from(byte)]
    }

    /// By how much the number of a channel grows with its byte.
    pub fn slope(&self, channel: usize) -> f32 {
        (self.number(channel, 255) - self.number(channel, 0)) / 255.0
    }

    /// The least and the greatest number of all channels.
    pub fn range(&self) -> (f32, f32) {
        let all = || self.tables.iter().flatten().copied();
        (all().fold(f32::INFINITY, f32::min), all().fold(f32::NEG_INFINITY, f32::max))
    }

    /// The byte whose number is nearest.
    pub fn byte(&self, channel: usize, number: f32) -> u8 {
        let far = |byte: &usize| (self.tables[channel][*byte] - number).abs();
        (0..256).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap_or(0) as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_reach_both_ends_of_their_range() {
        for (low, high, middle) in [(0.0, 255.0, 51.0), (0.0, 1.0, 0.2), (-1.0, 1.0, -0.6), (-0.5, 0.5, -0.3)]
        {
            let numbers = Numbers::new(Scale::Range(low, high), &[0.0], &[1.0], 1);
            for (byte, expected) in [(0, low), (51, middle), (255, high)] {
                let number = numbers.number(0, byte);
                assert!((f64::from(number) - expected).abs() < 1e-6, "{low}..{high} {byte}: {number}");
                assert_eq!(numbers.byte(0, number), byte);
            }
            assert_eq!(numbers.range(), (low as f32, high as f32));
        }
    }

    #[test]
    fn each_channel_has_its_mean_and_deviation() {
        let numbers = Numbers::new(Scale::Range(0.0, 1.0), &[0.5, 0.0, 0.25], &[0.5, 1.0, 2.0], 3);
        assert_eq!([0, 1, 2].map(|channel| numbers.number(channel, 255)), [1.0, 1.0, 0.375]);
        assert_eq!(Numbers::new(Scale::Factor(2.0), &[1.0], &[1.0], 3).number(2, 3), 5.0);
    }
}
