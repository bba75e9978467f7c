//! pdk's own messages in a trace: described and encoded as Protocol Buffers from a list of their fields, so that the fields of
//! a state are written down in one place only, `pdk_model`.

/// A field of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// A 64-bit floating-point number.
    Double(&'static str),
    /// True or false.
    Bool(&'static str),
    /// A whole number.
    Whole(&'static str),
    /// A text.
    Text(&'static str),
}

impl Field {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Double(name) | Self::Bool(name) | Self::Whole(name) | Self::Text(name) => name,
        }
    }

    /// Its type in `descriptor.proto`.
    fn type_number(self) -> u64 {
        match self {
            Self::Double(_) => 1,
            Self::Whole(_) => 4,
            Self::Bool(_) => 8,
            Self::Text(_) => 9,
        }
    }
}

/// Wire types: <https://protobuf.dev/programming-guides/encoding>.
const VARINT: u64 = 0;
const FIXED64: u64 = 1;
const LENGTH: u64 = 2;

/// The schema of a message with these fields, numbered from 1: a `FileDescriptorSet` with one file.
pub fn schema(package: &str, name: &str, fields: &[Field]) -> Vec<u8> {
    let mut message = Vec::new();
    put_text(&mut message, 1, name);
    for (number, field) in (1..).zip(fields) {
        let mut described = Vec::new();
        put_text(&mut described, 1, field.name());
        put_whole(&mut described, 3, number);
        // The label: optional.
        put_whole(&mut described, 4, 1);
        put_whole(&mut described, 5, field.type_number());
        put_text(&mut described, 10, field.name());
        put_bytes(&mut message, 2, &described);
    }
    let mut file = Vec::new();
    put_text(&mut file, 1, &format!("{package}/{name}.proto"));
    put_text(&mut file, 2, package);
    put_bytes(&mut file, 4, &message);
    put_text(&mut file, 12, "proto3");
    let mut set = Vec::new();
    put_bytes(&mut set, 1, &file);
    set
}

/// Adds a number; zeros are written as well, since a minus before them counts.
pub fn put_double(to: &mut Vec<u8>, number: u64, value: f64) {
    put_varint(to, number << 3 | FIXED64);
    to.extend(value.to_bits().to_le_bytes());
}

/// Adds a whole number, or 0 or 1 for false or true.
pub fn put_whole(to: &mut Vec<u8>, number: u64, value: u64) {
    put_varint(to, number << 3 | VARINT);
    put_varint(to, value);
}

/// Adds a text.
pub fn put_text(to: &mut Vec<u8>, number: u64, value: &str) {
    put_bytes(to, number, value.as_bytes());
}

fn put_bytes(to: &mut Vec<u8>, number: u64, value: &[u8]) {
    put_varint(to, number << 3 | LENGTH);
    put_varint(to, value.len() as u64);
    to.extend(value);
}

/// Seven bits a byte, the lowest first; the eighth says that more follow.
fn put_varint(to: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        to.push(value as u8 | 0x80);
        value >>= 7;
    }
    to.push(value as u8);
}
