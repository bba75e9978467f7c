//! Fields of a Protocol Buffers message, read without knowing its schema:
//! <https://protobuf.dev/programming-guides/encoding>.

/// The value of a field as it lies in the message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wire<'a> {
    /// Whole numbers, truth values and enumerations.
    Varint(u64),
    /// Eight bytes, such as a 64-bit floating-point number.
    Fixed64(u64),
    /// A text, bytes or a message.
    Bytes(&'a [u8]),
    /// Four bytes, such as a 32-bit floating-point number.
    Fixed32(u32),
}

impl<'a> Wire<'a> {
    /// A 64-bit floating-point number.
    pub fn double(self) -> Option<f64> {
        match self {
            Wire::Fixed64(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// A whole number.
    pub fn whole(self) -> Option<u64> {
        match self {
            Wire::Varint(value) => Some(value),
            _ => None,
        }
    }

    /// Bytes.
    pub fn bytes(self) -> Option<&'a [u8]> {
        match self {
            Wire::Bytes(bytes) => Some(bytes),
            _ => None,
        }
    }

    /// A text.
    pub fn text(self) -> Option<&'a str> {
        self.bytes().and_then(|bytes| std::str::from_utf8(bytes).ok())
    }
}

/// The fields of a message in the order in which they lie there: number and value. A message that ends within a field
/// gives none as its last.
pub fn fields(message: &[u8]) -> impl Iterator<Item = Option<(u64, Wire<'_>)>> {
    let mut rest = message;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let field = field(&mut rest);
        if field.is_none() {
            rest = &[];
        }
        Some(field)
    })
}

fn field<'a>(rest: &mut &'a [u8]) -> Option<(u64, Wire<'a>)> {
    let tag = varint(rest)?;
    let value = match tag & 7 {
        0 => Wire::Varint(varint(rest)?),
        1 => Wire::Fixed64(u64::from_le_bytes(chunk(rest)?)),
        2 => {
            let length = usize::try_from(varint(rest)?).ok()?;
            Wire::Bytes(rest.split_off(..length)?)
        }
        5 => Wire::Fixed32(u32::from_le_bytes(chunk(rest)?)),
        _ => return None,
    };
    Some((tag >> 3, value))
}

/// The next this many bytes.
fn chunk<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (chunk, tail) = rest.split_first_chunk()?;
    *rest = tail;
    Some(*chunk)
}

/// Seven bits a byte, the lowest first; the eighth says that more follow.
fn varint(rest: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = *rest.split_off_first()?;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_all_kinds_are_read() {
        // 1: 300, 2: "ab", 3: 1.0 as a double, 4: 7 as four bytes.
        let mut message = vec![0x08, 0xac, 0x02, 0x12, 2, b'a', b'b', 0x19];
        message.extend(1f64.to_le_bytes());
        message.extend([0x25, 7, 0, 0, 0]);
        let read: Vec<_> = fields(&message).collect::<Option<_>>().unwrap();
        assert_eq!(
            read,
            [
                (1, Wire::Varint(300)),
                (2, Wire::Bytes(b"ab")),
                (3, Wire::Fixed64(1f64.to_bits())),
                (4, Wire::Fixed32(7)),
            ]
        );
        let complete = |length: usize| fields(&message[..length]).all(|field| field.is_some());
        let ends: Vec<_> = (0..=message.len()).filter(|&length| complete(length)).collect();
        assert_eq!(ends, [0, 3, 7, 16, 21]);
        // Numbers of more than ten bytes, groups, and a length that no message has.
        for damaged in [&[0xff_u8; 12][..], &[0x0b], &[0x12, 0xff, 0xff, 0xff, 0xff, 0x0f]] {
            assert_eq!(fields(damaged).collect::<Vec<_>>(), [None]);
        }
    }
}
