//! Messages of ROS 2 as they are stored: common data representation (CDR) as of OMG's DDSI-RTPS, in which numbers lie at multiples of
//! their size.

use pdk_sdk::prelude::*;

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
        let huge = [0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff, 1];
        assert!(Cdr::new(&huge).unwrap().bytes().is_err());
    }
}
