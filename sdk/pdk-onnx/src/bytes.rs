//! The bytes of elements, as files hold them.

use crate::element::Element;
use crate::narrow::Narrow;

/// Whether elements are integers of 4 bits, of which two share a byte.
pub(crate) fn is_packed(element: Element) -> bool {
    matches!(element.0, 21 | 22)
}

/// The number of bytes of an element; nothing for texts, rare types and those of which two share a byte.
pub(crate) fn width(element: Element) -> Option<usize> {
    match element.0 {
        2 | 3 | 9 | 17..=20 => Some(1),
        4 | 5 | 10 | 16 => Some(2),
        1 | 6 | 12 => Some(4),
        7 | 11 | 13 => Some(8),
        _ => None,
    }
}

/// The bytes of numbers, the least significant first. Two integers of 4 bits share a byte, the first of them in its lower half.
pub(crate) fn bytes(element: Element, values: &[f64]) -> Vec<u8> {
    if is_packed(element) {
        let nibble = |value: Option<&f64>| value.map_or(0, |value| *value as i8 as u8 & 15);
        return values.chunks(2).map(|pair| nibble(pair.first()) | nibble(pair.get(1)) << 4).collect();
    }
    values.iter().flat_map(|&value| bytes_of(element, value)).collect()
}

fn bytes_of(element: Element, value: f64) -> Vec<u8> {
    match (element.0, Narrow::of(element.0)) {
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
    Narrow::of(element.0).map(|narrow| narrow.read(bits))
}

/// This many integers of 4 bits, of which two share a byte.
pub(crate) fn nibbles(element: Element, bytes: impl Iterator<Item = u8>, count: usize) -> Vec<f64> {
    bytes
        .flat_map(|byte| [byte, byte >> 4])
        .map(|nibble| element.wrapped(nibble.into()))
        .take(count)
        .collect()
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

    #[test]
    fn every_type_is_written_as_it_is_read() {
        let types = [1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13, 16, 17, 18, 19, 20, 21, 22];
        for element in types.map(Element) {
            let tensor = Tensor { element, shape: vec![3], values: vec![0.0, 1.0, 1.0] };
            assert_eq!(Tensor::from_proto(&tensor.to_proto("w")).unwrap(), tensor);
        }
    }

    #[test]
    fn two_integers_of_4_bits_share_a_byte() {
        let read = |element, bytes: &[u8], count| nibbles(Element(element), bytes.iter().copied(), count);
        assert_eq!(read(21, &[0x21, 0xf3], 3), [1.0, 2.0, 3.0]);
        assert_eq!(read(22, &[0xf8], 2), [-8.0, -1.0]);
        assert_eq!(bytes(Element(22), &[-8.0, -1.0, 3.0]), [0xf8, 3]);
    }
}
