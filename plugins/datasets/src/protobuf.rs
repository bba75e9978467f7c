//! Messages in Protocol Buffers field by field, whatever they mean, so that one field can be another while all else stays.

use pdk_sdk::prelude::*;
use prost::encoding::{
    DecodeContext, WireType, decode_key, decode_varint, encode_key, encode_varint, skip_field,
};

/// A field as it is stored.
pub struct Field<'a> {
    /// Its number.
    pub number: u32,
    wire: WireType,
    /// All of it, its number included.
    whole: &'a [u8],
    /// What it says.
    pub content: &'a [u8],
}

/// The fields of a message in their order.
///
/// # Errors
/// If the message is damaged.
pub fn fields(message: &[u8]) -> Result<Vec<Field<'_>>> {
    let mut fields = Vec::new();
    let mut rest = message;
    while !rest.is_empty() {
        let begin = rest;
        let (number, wire) = decode_key(&mut rest).map_err(damaged)?;
        let mut content = rest;
        skip_field(wire, number, &mut rest, DecodeContext::default()).map_err(damaged)?;
        let end = content.len() - rest.len();
        if wire == WireType::LengthDelimited {
            let before = content.len();
            decode_varint(&mut content).map_err(damaged)?;
            content = &content[..end - (before - content.len())];
        } else {
            content = &content[..end];
        }
        fields.push(Field { number, wire, whole: &begin[..begin.len() - rest.len()], content });
    }
    Ok(fields)
}

/// The content of a field of bytes; none if the message has none.
///
/// # Errors
/// If the message is damaged.
pub fn bytes(message: &[u8], number: u32) -> Result<&[u8]> {
    let of = |field: &Field<'_>| field.number == number && field.wire == WireType::LengthDelimited;
    // Of several, the last one counts.
    Ok(fields(message)?.into_iter().rfind(of).map_or(&[], |field| field.content))
}

/// A message in which a field of bytes has others.
///
/// # Errors
/// If the message is damaged.
pub fn with_bytes(message: &[u8], number: u32, bytes: &[u8]) -> Result<Vec<u8>> {
    let mut written = Vec::with_capacity(message.len() + bytes.len());
    let mut is_there = false;
    let mut put = |written: &mut Vec<u8>| {
        if !std::mem::replace(&mut is_there, true) {
            encode_key(number, WireType::LengthDelimited, written);
            encode_varint(bytes.len() as u64, written);
            written.extend_from_slice(bytes);
        }
    };
    for field in fields(message)? {
        match field.number == number && field.wire == WireType::LengthDelimited {
            true => put(&mut written),
            false => written.extend_from_slice(field.whole),
        }
    }
    put(&mut written);
    Ok(written)
}

/// A message in which a number of 64 bits has the other sign; one that is not there is zero.
///
/// # Errors
/// If the message is damaged.
pub fn with_other_sign(message: &[u8], number: u32) -> Result<Vec<u8>> {
    let mut written = Vec::with_capacity(message.len());
    for field in fields(message)? {
        written.extend_from_slice(field.whole);
        if let (true, WireType::SixtyFourBit, Some(sign)) =
            (field.number == number, field.wire, written.last_mut())
        {
            *sign ^= 0x80;
        }
    }
    Ok(written)
}

/// What a message that cannot be decoded is called.
pub fn damaged(error: prost::DecodeError) -> Error {
    Error::new(format!("the message is damaged ({error})"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message;

    #[derive(Clone, PartialEq, prost::Message)]
    struct All {
        #[prost(double, tag = "1")]
        number: f64,
        #[prost(bytes = "vec", tag = "2")]
        data: Vec<u8>,
        #[prost(string, tag = "3")]
        text: String,
        #[prost(sint32, tag = "30")]
        small: i32,
    }

    #[test]
    fn one_field_is_another_and_the_rest_stays() {
        let all = All { number: -2.5, data: vec![1; 300], text: "frame".to_owned(), small: -7 };
        let message = all.encode_to_vec();
        assert_eq!(bytes(&message, 2).unwrap(), all.data);
        for data in [vec![], vec![9; 5], vec![3; 70_000]] {
            let written = All::decode(&with_bytes(&message, 2, &data).unwrap()[..]).unwrap();
            assert_eq!(written, All { data, ..all.clone() });
        }
        let turned = All::decode(&with_other_sign(&message, 1).unwrap()[..]).unwrap();
        assert_eq!(turned, All { number: 2.5, ..all.clone() });
        let none = All { number: 0.0, data: Vec::new(), ..all.clone() }.encode_to_vec();
        assert_eq!(with_other_sign(&none, 1).unwrap(), none);
        let written = All::decode(&with_bytes(&none, 2, &[1]).unwrap()[..]).unwrap();
        assert_eq!(written.data, [1]);
        for length in 1..message.len() {
            let _ = fields(&message[..length]);
        }
        assert!(with_bytes(&message[..40], 2, &[]).is_err());
    }
}
