//! Arrays of numpy with numbers of the other sign.

use pdk_sdk::prelude::*;

/// The content of a file of numpy with floating-point numbers in one row, in which those that `turned` names have the other sign.
///
/// # Errors
/// If it is not such a file.
pub fn with_other_sign(content: &[u8], turned: &dyn Fn(usize) -> bool) -> Result<Vec<u8>> {
    let wrong = || {
        Error::new(
            "it is not an array of floating-point numbers, whose signs could be changed; convert it with astype(numpy.float64)",
        )
    };
    let (head, length) = match content.get(6..12).ok_or_else(wrong)? {
        [1, _, a, b, ..] => (10, usize::from(u16::from_le_bytes([*a, *b]))),
        [2 | 3, _, a, b, c, d] => (12, u32::from_le_bytes([*a, *b, *c, *d]) as usize),
        _ => return Err(wrong()),
    };
    let text =
        content.get(head..head + length).and_then(|head| std::str::from_utf8(head).ok()).ok_or_else(wrong)?;
    let kind =
        text.split_once("'descr'").and_then(|(_, behind)| behind.split('\'').nth(1)).ok_or_else(wrong)?;
    // The sign is in the first byte, or in the last one.
    let (size, sign) = match kind {
        "<f8" => (8, 7),
        ">f8" => (8, 0),
        "<f4" => (4, 3),
        ">f4" => (4, 0),
        _ => return Err(wrong()),
    };
    let mut written = content.to_vec();
    for (number, value) in written[head + length..].chunks_exact_mut(size).enumerate() {
        if turned(number) {
            value[sign] ^= 0x80;
        }
    }
    Ok(written)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_truth::npy;

    #[test]
    fn numbers_have_the_other_sign_in_either_order_of_bytes() {
        for (kind, bytes) in [("<f8", 0.5_f64.to_le_bytes()), (">f8", 0.5_f64.to_be_bytes())] {
            let head = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (3,), }}\n");
            let mut content = b"\x93NUMPY\x01\x00".to_vec();
            content.extend((head.len() as u16).to_le_bytes());
            content.extend(head.bytes());
            content.extend(bytes.repeat(3));
            let written = with_other_sign(&content, &|number| number != 1).unwrap();
            assert_eq!(npy::read(&written).unwrap().values, [-0.5, 0.5, -0.5]);
            let whole = String::from_utf8_lossy(&content).replace("f8", "i8").into_bytes();
            assert!(
                with_other_sign(&whole, &|_| true).is_err()
                    && with_other_sign(&content[..9], &|_| true).is_err()
            );
        }
    }
}
