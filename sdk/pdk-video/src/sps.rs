//! What a stream of H.264 says about its colours: the matrix and the range in its sequence parameter sets (ITU-T H.264, 7.3.2.1 and annex E).
//! Nothing else is read of them. The built-in decoder reads the same fields, but does not give them to others.

use pdk_sdk::ops::yuv::{Coding, Matrix};

/// Profiles whose sets have fields of their own before those of all.
const HIGH: [u32; 13] = [100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135];

/// What sequence parameter sets say about colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colours {
    /// Colours that are read here.
    Coded(Coding),
    /// Another matrix, by its number in table E-5.
    Matrix(u8),
    /// Several sets, which differ.
    Several,
}

impl Default for Colours {
    fn default() -> Self {
        Self::Coded(Coding::default())
    }
}

impl Colours {
    /// The coding of the planes.
    ///
    /// # Errors
    /// If it is not read here; the sentence part names the video.
    pub fn coding(self) -> Result<Coding, String> {
        let name = match self {
            Self::Coded(coding) => return Ok(coding),
            Self::Several => return Err("H.264 with several matrices or ranges of colours".to_owned()),
            Self::Matrix(0) => "RGB",
            Self::Matrix(4) => "FCC 73.682",
            Self::Matrix(7) => "SMPTE 240M",
            Self::Matrix(8) => "YCgCo",
            Self::Matrix(9 | 10) => "BT.2020",
            Self::Matrix(number) => {
                return Err(format!("H.264 whose matrix of colours is number {number} of the standard"));
            }
        };
        Err(format!("H.264 whose matrix of colours is that of {name}"))
    }
}

/// What the sets before the first slice of these units say, which have start codes (annex B); none if there are no sets.
pub fn colours(units: &[u8]) -> Option<Colours> {
    let mut found = None;
    let mut rest = units;
    while let Some(at) = rest.windows(3).position(|window| window == [0, 0, 1]) {
        rest = &rest[at + 3..];
        match rest.first().map_or(0, |header| header & 31) {
            1..=5 => break,
            7 => {
                let colours = of_set(rest);
                found = match found {
                    Some(before) if before != colours => Some(Colours::Several),
                    _ => Some(colours),
                };
            }
            _ => {}
        }
    }
    found
}

/// What a set says, given from its header on; what follows it is not read. A set that is cut off says nothing, and the decoder rejects it.
fn of_set(unit: &[u8]) -> Colours {
    let (full_range, matrix) =
        read(&mut Bits { bytes: unit, at: 0, zeros: 0, left: 0 }).unwrap_or((false, 2));
    let coded = |matrix| Colours::Coded(Coding { matrix, full_range });
    match matrix {
        // 2 leaves it open.
        2 | 5 | 6 => coded(Matrix::Bt601),
        1 => coded(Matrix::Bt709),
        other => Colours::Matrix(other),
    }
}

/// The range and the matrix, as far as they are there.
fn read(bits: &mut Bits<'_>) -> Option<(bool, u8)> {
    bits.take(8)?;
    let profile = bits.take(8)?;
    bits.take(16)?;
    bits.number()?;
    if HIGH.contains(&profile) {
        let chroma = bits.number()?;
        if chroma == 3 {
            bits.take(1)?;
        }
        bits.number()?;
        bits.number()?;
        bits.take(1)?;
        if bits.flag()? {
            for list in 0..if chroma == 3 { 12 } else { 8 } {
                if bits.flag()? {
                    scaling_list(bits, if list < 6 { 16 } else { 64 })?;
                }
            }
        }
    }
    bits.number()?;
    match bits.number()? {
        0 => {
            bits.number()?;
        }
        1 => {
            bits.take(1)?;
            bits.number()?;
            bits.number()?;
            // The standard allows 255.
            for _ in 0..bits.number()?.min(255) {
                bits.number()?;
            }
        }
        _ => {}
    }
    bits.number()?;
    bits.take(1)?;
    bits.number()?;
    bits.number()?;
    if !bits.flag()? {
        bits.take(1)?;
    }
    bits.take(1)?;
    if bits.flag()? {
        for _ in 0..4 {
            bits.number()?;
        }
    }
    if !bits.flag()? {
        return None;
    }
    if bits.flag()? && bits.take(8)? == 255 {
        bits.take(32)?;
    }
    if bits.flag()? {
        bits.take(1)?;
    }
    if !bits.flag()? {
        return None;
    }
    bits.take(3)?;
    let full_range = bits.flag()?;
    let matrix = if bits.flag()? {
        bits.take(16)?;
        bits.take(8)? as u8
    } else {
        2
    };
    Some((full_range, matrix))
}

fn scaling_list(bits: &mut Bits<'_>, count: usize) -> Option<()> {
    let (mut last, mut next) = (8_u8, 8_u8);
    for _ in 0..count {
        if next != 0 {
            let coded = bits.number()?;
            // Numbers with a sign are 0, 1, -1, 2, -2 and so on; what is kept of the sum is its lowest byte.
            let half = coded.div_ceil(2) as u8;
            let change = if coded % 2 == 1 { half } else { half.wrapping_neg() };
            next = last.wrapping_add(change);
        }
        last = if next == 0 { last } else { next };
    }
    Some(())
}

/// The bits of a unit, without the bytes that keep start codes out of it.
struct Bits<'a> {
    bytes: &'a [u8],
    /// The byte that is read.
    at: u8,
    /// Zero bytes before the next one.
    zeros: u32,
    /// Bits of the byte that are left.
    left: u32,
}

impl Bits<'_> {
    /// The next bits as a number, 32 at most.
    fn take(&mut self, count: u32) -> Option<u32> {
        let mut value = 0;
        for _ in 0..count {
            if self.left == 0 {
                let (mut byte, mut rest) = self.bytes.split_first()?;
                if self.zeros >= 2 && *byte == 3 {
                    self.zeros = 0;
                    (byte, rest) = rest.split_first()?;
                }
                self.zeros = if *byte == 0 { self.zeros + 1 } else { 0 };
                (self.at, self.bytes, self.left) = (*byte, rest, 8);
            }
            self.left -= 1;
            value = value << 1 | u32::from(self.at >> self.left & 1);
        }
        Some(value)
    }

    fn flag(&mut self) -> Option<bool> {
        Some(self.take(1)? == 1)
    }

    /// A number in the code of Exp-Golomb.
    fn number(&mut self) -> Option<u32> {
        let mut zeros = 0;
        while !self.flag()? {
            zeros += 1;
            if zeros > 31 {
                return None;
            }
        }
        Some((1 << zeros) - 1 + self.take(zeros)?)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Bits that are written.
    #[derive(Default)]
    struct Written(Vec<bool>);

    impl Written {
        fn put(&mut self, value: u32, count: u32) {
            self.0.extend((0..count).rev().map(|bit| value >> bit & 1 == 1));
        }

        fn number(&mut self, value: u32) {
            let length = (value + 1).ilog2();
            self.put(0, length);
            self.put(value + 1, length + 1);
        }

        /// As a unit, with the bytes that keep start codes out of it.
        fn unit(mut self) -> Vec<u8> {
            self.0.push(true);
            let bytes = self
                .0
                .chunks(8)
                .map(|bits| (0..8).fold(0, |sum, bit| sum << 1 | u8::from(bits.get(bit) == Some(&true))));
            let (mut unit, mut zeros) = (vec![0, 0, 1, 0x67], 0);
            for byte in bytes {
                if zeros == 2 && byte <= 3 {
                    unit.push(3);
                    zeros = 0;
                }
                zeros = if byte == 0 { zeros + 1 } else { 0 };
                unit.push(byte);
            }
            unit
        }
    }

    /// A set in which optional fields are there by the bits of `shape`.
    fn set(shape: u32, numbers: &[u32], signal: Option<(bool, Option<u8>)>) -> Vec<u8> {
        let mut numbers = numbers.iter().copied().cycle();
        let mut next = || numbers.next().unwrap();
        let has = |bit: u32| shape >> bit & 1;
        let mut bits = Written::default();
        let high = has(0) == 1;
        bits.put(if high { 100 } else { 77 }, 8);
        bits.put(0, 16);
        bits.number(0);
        if high {
            [1, 0, 0].into_iter().for_each(|number| bits.number(number));
            bits.put(0, 1);
            bits.put(has(1), 1);
            for list in 0..8 * has(1) {
                bits.put(has(2 + list), 1);
                let (mut last, mut scale) = (8_i64, 8_i64);
                for _ in 0..has(2 + list) * if list < 6 { 16 } else { 64 } {
                    if scale != 0 {
                        let coded = next() % 256;
                        bits.number(coded);
                        let coded = i64::from(coded);
                        scale =
                            (last + if coded % 2 == 1 { (coded + 1) / 2 } else { -coded / 2 } + 256) % 256;
                    }
                    last = if scale == 0 { last } else { scale };
                }
            }
        }
        bits.number(next());
        let order = if has(10) == 1 { 1 } else { 2 * has(11) };
        bits.number(order);
        match order {
            0 => bits.number(next()),
            1 => {
                bits.put(1, 1);
                bits.number(next());
                bits.number(next());
                bits.number(3);
                (0..3).for_each(|_| bits.number(next()));
            }
            _ => {}
        }
        bits.number(next());
        bits.put(0, 1);
        bits.number(next());
        bits.number(next());
        bits.put(has(12), 1);
        if has(12) == 0 {
            bits.put(1, 1);
        }
        bits.put(1, 1);
        bits.put(has(13), 1);
        (0..4 * has(13)).for_each(|_| bits.number(next()));
        bits.put(u32::from(signal.is_some() || has(14) == 1), 1);
        if signal.is_none() && has(14) == 0 {
            return bits.unit();
        }
        bits.put(has(15), 1);
        if has(15) == 1 {
            bits.put(if has(16) == 1 { 255 } else { 1 }, 8);
            bits.put(0, 32 * has(16));
        }
        bits.put(has(17), 1);
        bits.put(1, has(17));
        bits.put(u32::from(signal.is_some()), 1);
        if let Some((full_range, matrix)) = signal {
            bits.put(5, 3);
            bits.put(u32::from(full_range), 1);
            bits.put(u32::from(matrix.is_some()), 1);
            if let Some(matrix) = matrix {
                bits.put(0x0101, 16);
                bits.put(u32::from(matrix), 8);
            }
        }
        bits.unit()
    }

    proptest! {
        #[test]
        fn the_fields_are_found_behind_any_others(
            shape: u32,
            numbers in proptest::collection::vec(0..70_000_u32, 1..40),
            full_range: bool,
            matrix in proptest::option::of(prop_oneof![0..12_u8, any::<u8>()]),
        ) {
            let coded = |matrix| Colours::Coded(Coding { matrix, full_range });
            let expected = match matrix {
                None | Some(2 | 5 | 6) => coded(Matrix::Bt601),
                Some(1) => coded(Matrix::Bt709),
                Some(other) => Colours::Matrix(other),
            };
            prop_assert_eq!(colours(&set(shape, &numbers, Some((full_range, matrix)))), Some(expected));
            prop_assert_eq!(colours(&set(shape, &numbers, None)), Some(Colours::default()));
        }

        #[test]
        fn any_bytes_are_read_to_an_end(bytes in proptest::collection::vec(prop_oneof![0..4_u8, any::<u8>()], 0..400)) {
            colours(&bytes);
            of_set(&bytes);
            // A profile with lists of scales.
            of_set(&[&[0x67, 100, 0, 0][..], &bytes].concat());
        }
    }

    #[test]
    fn sets_before_the_first_slice_are_read_and_have_to_agree() {
        let [limited, full] = [false, true].map(|full| set(0, &[1], Some((full, Some(1)))));
        let slice = [0, 0, 1, 0x65, 1, 2];
        let coded = |full_range| Colours::Coded(Coding { matrix: Matrix::Bt709, full_range });
        assert_eq!(colours(&[&full[..], &full, &slice].concat()), Some(coded(true)));
        assert_eq!(colours(&[&limited[..], &slice, &full].concat()), Some(coded(false)));
        assert_eq!(colours(&[&limited[..], &full].concat()), Some(Colours::Several));
        assert_eq!(colours(&slice), None);
        assert_eq!(colours(&[0, 0, 1]), None);
        assert!(Colours::Matrix(9).coding().unwrap_err().contains("BT.2020"));
    }
}
