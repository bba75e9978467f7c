//! Messages of ROS 2 as they are stored: common data representation (CDR) as of OMG's DDSI-RTPS, in which numbers lie at multiples of
//! their size.

use pdk_sdk::prelude::*;

/// Bytes before the fields of a message.
const HEAD: usize = 4;

/// Reads the fields of a message one after the other.
pub struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    is_little: bool,
}

impl<'a> Cdr<'a> {
    /// A message with its header of four bytes.
    ///
    /// # Errors
    /// If it has none.
    pub fn new(message: &'a [u8]) -> Result<Self> {
        match message {
            // Plain CDR, big-endian and little-endian.
            [0, order @ (0 | 1), _, _, bytes @ ..] => Ok(Self { bytes, at: 0, is_little: *order == 1 }),
            [_, _, _, _, ..] => Err(Error::new("the message is not in plain CDR")),
            _ => Err(cut_off()),
        }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let bytes = self.bytes.get(self.at..).and_then(|rest| rest.get(..count)).ok_or_else(cut_off)?;
        self.at += count;
        Ok(bytes)
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N]> {
        self.at = self.at.next_multiple_of(N);
        let mut bytes: [u8; N] = self.take(N)?.try_into().map_err(|_| cut_off())?;
        if !self.is_little {
            bytes.reverse();
        }
        Ok(bytes)
    }

    /// Where in the message the next field is looked for.
    pub fn place(&self) -> usize {
        HEAD + self.at
    }

    /// Passes a number of this many bytes, and tells where in the message its sign is.
    ///
    /// # Errors
    /// If the message ends before it.
    pub fn pass_sign(&mut self, bytes: usize) -> Result<usize> {
        self.at = self.at.next_multiple_of(bytes);
        let begin = self.place();
        self.take(bytes)?;
        Ok(if self.is_little { begin + bytes - 1 } else { begin })
    }

    /// A byte.
    pub fn byte(&mut self) -> Result<u8> {
        Ok(u8::from_le_bytes(self.number()?))
    }

    /// A whole number of 32 bits.
    pub fn u32(&mut self) -> Result<u32> {
        Ok(u32::from_le_bytes(self.number()?))
    }

    /// A number of 32 bits.
    pub fn f32(&mut self) -> Result<f64> {
        Ok(f64::from(f32::from_le_bytes(self.number()?)))
    }

    /// A number of 64 bits.
    pub fn f64(&mut self) -> Result<f64> {
        Ok(f64::from_le_bytes(self.number()?))
    }

    /// Bytes of any number.
    pub fn bytes(&mut self) -> Result<&'a [u8]> {
        let count = self.u32()? as usize;
        self.take(count)
    }

    /// A text, which ends with a zero.
    pub fn text(&mut self) -> Result<&'a str> {
        let bytes = self.bytes()?;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        std::str::from_utf8(bytes).map_err(|_| Error::new("a text in the message is not UTF-8"))
    }

    /// A `std_msgs/Header`: its time in nanoseconds.
    pub fn header(&mut self) -> Result<u64> {
        let seconds = self.u32()? as i32;
        let nanoseconds = self.u32()?;
        self.text()?;
        Ok(u64::try_from(seconds).unwrap_or_default() * 1_000_000_000 + u64::from(nanoseconds))
    }
}

/// A message in which the field of bytes at this place has others. Only bytes or a text may follow it, whose length lies at a multiple of its size.
///
/// # Errors
/// If the message ends before the field does.
pub fn with_bytes(message: &[u8], place: usize, bytes: &[u8]) -> Result<Vec<u8>> {
    let mut cdr = Cdr::new(message)?;
    cdr.at = place - HEAD;
    cdr.bytes()?;
    let behind = message.get(HEAD + cdr.at.next_multiple_of(4)..).unwrap_or_default();
    let mut written = message[..place.min(message.len())].to_vec();
    let length =
        u32::try_from(bytes.len()).map_err(|_| Error::new("the picture is too large for a message"))?;
    align(&mut written);
    written.extend(if cdr.is_little { length.to_le_bytes() } else { length.to_be_bytes() });
    written.extend_from_slice(bytes);
    if !behind.is_empty() {
        align(&mut written);
        written.extend_from_slice(behind);
    }
    Ok(written)
}

/// Fills up to where a length may lie.
fn align(message: &mut Vec<u8>) {
    message.resize(HEAD + (message.len() - HEAD).next_multiple_of(4), 0);
}

fn cut_off() -> Error {
    Error::new("the message is cut off")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_lie_at_multiples_of_their_size_in_either_order() {
        let little = [
            0, 1, 0, 0, 7, 0, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xf8, 0x3f,
        ];
        let mut cdr = Cdr::new(&little[..28]).unwrap();
        assert_eq!((cdr.byte().unwrap(), cdr.text().unwrap()), (7, "a"));
        // Padding to the next multiple of eight, and too little behind it.
        assert_eq!(cdr.f64().unwrap(), 0.0);
        assert!(cdr.f64().is_err());
        let big = [0, 0, 0, 0, 0, 0, 0, 1, 0x3f, 0xc0, 0, 0];
        let mut cdr = Cdr::new(&big).unwrap();
        assert_eq!((cdr.u32().unwrap(), cdr.f32().unwrap()), (1, 1.5));
        assert!(Cdr::new(&[0, 3, 0, 0]).is_err() && Cdr::new(&[0]).is_err());
        let mut cdr = Cdr::new(&big).unwrap();
        assert_eq!((cdr.pass_sign(4).unwrap(), cdr.pass_sign(4).unwrap(), cdr.place()), (4, 8, 12));
        assert_eq!(Cdr::new(&little).unwrap().pass_sign(8).unwrap(), 11);
        let huge = [0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff, 1];
        assert!(Cdr::new(&huge).unwrap().bytes().is_err());
    }

    #[test]
    fn bytes_are_exchanged_whatever_comes_behind_them() {
        for (message, expected) in [
            (&[0, 1, 0, 0, 2, 0, 0, 0, 7, 8][..], &[0, 1, 0, 0, 3, 0, 0, 0, 1, 2, 3][..]),
            (
                &[0, 0, 0, 0, 0, 0, 0, 2, 7, 8, 0, 0, 0, 0, 0, 1, 9],
                &[0, 0, 0, 0, 0, 0, 0, 3, 1, 2, 3, 0, 0, 0, 0, 1, 9],
            ),
        ] {
            assert_eq!(with_bytes(message, 4, &[1, 2, 3]).unwrap(), expected);
            assert!(with_bytes(&message[..9], 4, &[1]).is_err());
        }
        // The field before it ends where no length may lie.
        let odd = [0, 1, 0, 0, 1, 0, 0, 0, b'a', 0, 0, 0, 1, 0, 0, 0, 7];
        assert_eq!(with_bytes(&odd, 9, &[8, 9]).unwrap()[8..], [b'a', 0, 0, 0, 2, 0, 0, 0, 8, 9]);
    }
}
