//! Rows of tables in files of SQLite, as the documentation of its file format has them.

use pdk_sdk::prelude::*;

/// A value of a row.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// None, and the number of the row in its own column.
    Null,
    /// A whole number.
    Whole(i64),
    /// A number.
    Real(f64),
    /// Text or bytes.
    Bytes(Vec<u8>),
}

impl Value {
    /// The whole number that it is.
    pub fn whole(&self) -> Option<i64> {
        match self {
            Self::Whole(number) => Some(*number),
            _ => None,
        }
    }

    /// The text that it is.
    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Bytes(bytes) => std::str::from_utf8(bytes).ok(),
            _ => None,
        }
    }
}

/// Bytes of a row of this length that lie in its page, by the rules of the format; the others lie in further pages.
pub fn own_part(length: usize, usable: usize) -> usize {
    let room = usable - 35;
    if length <= room {
        return length;
    }
    let fewest = (usable - 12) * 32 / 255 - 23;
    let some = fewest + (length - fewest) % (usable - 4);
    if some <= room { some } else { fewest }
}

/// A whole number of one to nine bytes.
///
/// # Errors
/// If it is cut off.
pub fn varint(bytes: &mut &[u8]) -> Result<i64> {
    let mut number: u64 = 0;
    for place in 0..9 {
        let (&byte, rest) = bytes.split_first().ok_or_else(|| damaged("a number is cut off"))?;
        *bytes = rest;
        if place == 8 {
            return Ok((number << 8 | u64::from(byte)) as i64);
        }
        number = number << 7 | u64::from(byte & 0x7f);
        if byte < 0x80 {
            break;
        }
    }
    Ok(number as i64)
}

/// The values of a row: first the kinds of all, then what they are.
///
/// # Errors
/// If the row is damaged.
pub fn values(content: &[u8]) -> Result<Vec<Value>> {
    let mut kinds = content;
    let head = usize::try_from(varint(&mut kinds)?).unwrap_or(usize::MAX);
    let mut rest = content.get(head..).ok_or_else(|| damaged("a row is cut off"))?;
    let end = rest.len();
    let mut values = Vec::new();
    while kinds.len() > end {
        let kind = varint(&mut kinds)?;
        let size = size_of_kind(kind)?;
        let (own, behind) = rest.split_at_checked(size).ok_or_else(|| damaged("a value is cut off"))?;
        rest = behind;
        values.push(match kind {
            0 => Value::Null,
            8 => Value::Whole(0),
            9 => Value::Whole(1),
            1..=6 => Value::Whole(whole(own)),
            7 => Value::Real(f64::from_bits(whole(own) as u64)),
            _ => Value::Bytes(own.to_vec()),
        });
    }
    Ok(values)
}

/// A whole number of up to eight bytes, the first of which has the sign.
fn whole(bytes: &[u8]) -> i64 {
    let sign = if bytes.first().is_some_and(|first| *first >= 0x80) { -1 } else { 0 };
    bytes.iter().fold(sign, |number, byte| number << 8 | i64::from(*byte))
}

/// Bytes of a value of this kind.
fn size_of_kind(kind: i64) -> Result<usize> {
    Ok(match kind {
        0 | 8 | 9 => 0,
        1..=4 => kind as usize,
        5 => 6,
        6 | 7 => 8,
        12.. => usize::try_from((kind - 12) / 2).unwrap_or(usize::MAX),
        _ => return Err(damaged("a value is of a kind that does not exist")),
    })
}

/// The content of a row with another blob in a column.
///
/// # Errors
/// If the row is damaged.
pub fn with_blob(content: &[u8], column: usize, blob: &[u8]) -> Result<Vec<u8>> {
    let mut kinds = content;
    let head = usize::try_from(varint(&mut kinds)?).unwrap_or(usize::MAX);
    let body = content.get(head..).ok_or_else(|| damaged("a row is cut off"))?;
    let (mut written, mut at, mut number) = (Vec::new(), 0, 0);
    let mut place = None;
    while kinds.len() > body.len() {
        let kind = varint(&mut kinds)?;
        let size = size_of_kind(kind)?;
        if number == column {
            place = Some(at..at + size);
            put_varint(12 + 2 * blob.len() as u64, &mut written);
        } else {
            put_varint(kind as u64, &mut written);
        }
        (at, number) = (at + size, number + 1);
    }
    let place = place.filter(|place| place.end <= body.len()).ok_or_else(|| damaged("a row is cut off"))?;
    // The length of the head counts itself.
    let mut length = written.len() + 1;
    while varint_length(length as u64) + written.len() != length {
        length = varint_length(length as u64) + written.len();
    }
    let mut row = Vec::with_capacity(length + body.len() + blob.len());
    put_varint(length as u64, &mut row);
    row.extend(written);
    row.extend_from_slice(&body[..place.start]);
    row.extend_from_slice(blob);
    row.extend_from_slice(&body[place.end..]);
    Ok(row)
}

fn varint_length(number: u64) -> usize {
    let mut bytes = Vec::new();
    put_varint(number, &mut bytes);
    bytes.len()
}

/// Writes a whole number of one to nine bytes: seven bits in each, and eight in a ninth.
pub fn put_varint(number: u64, into: &mut Vec<u8>) {
    if number >> 56 != 0 {
        into.extend((0..8).map(|place| (number >> (57 - 7 * place)) as u8 | 0x80));
        into.push(number as u8);
        return;
    }
    let groups = (1..9).find(|groups| number >> (7 * groups) == 0).unwrap_or(8);
    into.extend((0..groups).rev().map(|group| {
        let more = if group > 0 { 0x80 } else { 0 };
        (number >> (7 * group)) as u8 & 0x7f | more
    }));
}

/// The error for a file that is not as it has to be.
pub fn damaged(what: &str) -> Error {
    Error::new(format!("it is damaged: {what}; copy it again"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_any_length_are_read_as_they_were_written() {
        for number in (0..64).flat_map(|bit| [1_u64 << bit, (1 << bit) - 1, u64::MAX >> bit]) {
            let mut bytes = Vec::new();
            put_varint(number, &mut bytes);
            assert_eq!((varint(&mut &bytes[..]).unwrap() as u64, bytes.len() <= 9), (number, true));
        }
    }
}
