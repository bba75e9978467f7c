//! Arrays in files of numpy (`.npy`), as numpy's documentation describes the format: a head that is a dictionary in Python, and the numbers.

use pdk_sdk::error::{Error, Result};

const MAGIC: &[u8] = b"\x93NUMPY";

/// An array of numbers, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// How many numbers it has along each axis.
    pub shape: Vec<usize>,
    /// The numbers.
    pub values: Vec<f64>,
}

/// What the header of a file says.
struct Header<'a> {
    /// The type of the numbers, such as `<f8`.
    kind: &'a str,
    columns_first: bool,
    shape: Vec<usize>,
    /// Where the numbers begin.
    numbers: usize,
}

fn wrong(why: &str) -> Error {
    Error::new(format!("it is not an array of numbers in numpy's format: {why}"))
}

fn cut() -> Error {
    wrong("it is cut off")
}

fn header(bytes: &[u8]) -> Result<Header<'_>> {
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| wrong("it begins with something else"))?;
    let (length, rest) = match rest {
        [1, _, a, b, rest @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), rest),
        [2 | 3, _, a, b, c, d, rest @ ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, rest),
        _ => return Err(wrong("its version is not 1, 2 or 3")),
    };
    let head = rest.get(..length).ok_or_else(cut)?;
    let head = std::str::from_utf8(head).map_err(|_| wrong("its header is not text"))?;
    let field = |name: &str| {
        let behind = head.split_once(&format!("'{name}'"))?.1.trim_start().strip_prefix(':')?;
        Some(behind.trim_start())
    };
    let kind = field("descr").and_then(|behind| behind.strip_prefix('\'')?.split_once('\''));
    let kind = kind.ok_or_else(|| wrong("its header has no type"))?.0;
    let columns_first = field("fortran_order").is_some_and(|behind| behind.starts_with("True"));
    let shape = field("shape").and_then(|behind| behind.strip_prefix('(')?.split_once(')'));
    let shape = shape.ok_or_else(|| wrong("its header has no shape"))?.0;
    let sides = shape.split(',').map(str::trim).filter(|side| !side.is_empty());
    let shape: Option<Vec<usize>> = sides.map(|side| side.parse().ok()).collect();
    let shape = shape.ok_or_else(|| wrong("its shape is not a list of whole numbers"))?;
    Ok(Header { kind, columns_first, shape, numbers: bytes.len() - rest.len() + length })
}

/// Reads the content of a file: numbers of up to eight bytes, in either order of bytes and of axes.
///
/// # Errors
/// If it is not such a file, or contains something other than numbers.
pub fn read(bytes: &[u8]) -> Result<Array> {
    let Header { kind, columns_first, shape, numbers } = header(bytes)?;
    let (number, size) = number(kind).ok_or_else(|| {
        wrong(&format!(
            "its type is `{kind}`, but has to be a real number; convert it with astype(numpy.float32)"
        ))
    })?;
    let count = shape.iter().try_fold(1_usize, |count, side| count.checked_mul(*side)).ok_or_else(cut)?;
    let wanted = count.checked_mul(size).ok_or_else(cut)?;
    let content = bytes.get(numbers..).and_then(|content| content.get(..wanted)).ok_or_else(cut)?;
    let values: Vec<f64> = content.chunks_exact(size).map(number).collect();
    Ok(match columns_first {
        true => Array { values: row_by_row(&values, &shape), shape },
        false => Array { shape, values },
    })
}

/// The content of a file with floating-point numbers in one row, in which those that `turned` names have the other sign.
///
/// # Errors
/// If it is not such a file.
pub fn with_other_sign(bytes: &[u8], turned: &dyn Fn(usize) -> bool) -> Result<Vec<u8>> {
    let Header { kind, numbers, .. } = header(bytes)?;
    // The sign is in the first byte, or in the last one.
    let (size, sign) = match kind {
        "<f8" => (8, 7),
        ">f8" => (8, 0),
        "<f4" => (4, 3),
        ">f4" => (4, 0),
        _ => {
            return Err(Error::new(
                "it is not an array of floating-point numbers, whose signs could be changed; convert it with astype(numpy.float64)",
            ));
        }
    };
    let mut written = bytes.to_vec();
    for (number, value) in written[numbers..].chunks_exact_mut(size).enumerate() {
        if turned(number) {
            value[sign] ^= 0x80;
        }
    }
    Ok(written)
}

/// How a number of a type is read, and how many bytes it has.
type Number = (Box<dyn Fn(&[u8]) -> f64>, usize);

/// The type of this name; none if it is not one of real numbers.
fn number(kind: &str) -> Option<Number> {
    let (order, kind) = kind.split_at_checked(1)?;
    let is_big = match order {
        "<" | "|" | "=" => false,
        ">" => true,
        _ => return None,
    };
    /// Reads a number of N bytes.
    fn of<const N: usize>(is_big: bool, read: impl Fn([u8; N]) -> f64 + 'static) -> Number {
        let one = move |bytes: &[u8]| {
            let mut ordered = [0; N];
            ordered.copy_from_slice(bytes);
            if is_big {
                ordered.reverse();
            }
            read(ordered)
        };
        (Box::new(one), N)
    }
    Some(match kind {
        "f2" => of(is_big, |bytes| half(u16::from_le_bytes(bytes))),
        "f4" => of(is_big, |bytes| f64::from(f32::from_le_bytes(bytes))),
        "f8" => of(is_big, f64::from_le_bytes),
        "u1" | "b1" => of(is_big, |[byte]: [u8; 1]| f64::from(byte)),
        "u2" => of(is_big, |bytes| f64::from(u16::from_le_bytes(bytes))),
        "u4" => of(is_big, |bytes| f64::from(u32::from_le_bytes(bytes))),
        "u8" => of(is_big, |bytes| u64::from_le_bytes(bytes) as f64),
        "i1" => of(is_big, |[byte]: [u8; 1]| f64::from(byte as i8)),
        "i2" => of(is_big, |bytes| f64::from(i16::from_le_bytes(bytes))),
        "i4" => of(is_big, |bytes| f64::from(i32::from_le_bytes(bytes))),
        "i8" => of(is_big, |bytes| i64::from_le_bytes(bytes) as f64),
        _ => return None,
    })
}

/// A number of half precision.
fn half(bits: u16) -> f64 {
    let (sign, exponent, fraction) = (bits >> 15, i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let magnitude = match exponent {
        0 => fraction / 1024.0 * 2.0_f64.powi(-14),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2.0_f64.powi(exponent - 15),
    };
    if sign == 1 { -magnitude } else { magnitude }
}

/// Numbers row by row that were column by column.
fn row_by_row(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let mut strides = Vec::with_capacity(shape.len());
    let mut stride = 1;
    for side in shape {
        strides.push(stride);
        stride *= side;
    }
    let mut place = vec![0; shape.len()];
    let mut ordered = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        ordered.push(values[place.iter().zip(&strides).map(|(at, stride)| at * stride).sum::<usize>()]);
        for axis in (0..shape.len()).rev() {
            place[axis] += 1;
            if place[axis] < shape[axis] {
                break;
            }
            place[axis] = 0;
        }
    }
    ordered
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(head: &str, numbers: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([1, 0]);
        bytes.extend((head.len() as u16).to_le_bytes());
        bytes.extend(head.as_bytes());
        bytes.extend(numbers);
        bytes
    }

    #[test]
    fn numbers_are_read_in_either_order() {
        let head = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n";
        let floats: Vec<u8> = (0..6).flat_map(|n| (n as f32 + 0.5).to_le_bytes()).collect();
        let array = read(&file(head, &floats)).unwrap();
        assert_eq!((array.shape, array.values), (vec![2, 3], vec![0.5, 1.5, 2.5, 3.5, 4.5, 5.5]));
        let head = "{'descr': '>u2', 'fortran_order': True, 'shape': (2, 3), }\n";
        let words: Vec<u8> = [0, 3, 1, 4, 2, 5_u16].into_iter().flat_map(u16::to_be_bytes).collect();
        assert_eq!(read(&file(head, &words)).unwrap().values, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let head = "{'descr': '<f2', 'fortran_order': False, 'shape': (5,), }\n";
        let halves = [0x3c00, 0xc000, 0x0001, 0x7c00, 0x3555_u16].map(u16::to_le_bytes).concat();
        let found = read(&file(head, &halves)).unwrap().values;
        assert_eq!(found[..4], [1.0, -2.0, 2.0_f64.powi(-24), f64::INFINITY]);
        assert!((found[4] - 1.0 / 3.0).abs() < 1e-4);
    }

    #[test]
    fn what_is_not_an_array_of_numbers_is_refused() {
        let head = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n";
        for (bytes, part) in [
            (b"PK\x03\x04".to_vec(), "begins with something else"),
            (file(head, &[0; 23]), "it is cut off"),
            (file(&head.replace("<f4", "|O"), &[0; 24]), "its type is `|O`"),
            (file(&head.replace("2, 3", "a"), &[0; 24]), "not a list of whole numbers"),
            (file(&head.replace("2, 3", "18446744073709551615, 2"), &[]), "it is cut off"),
            (file("{}", &[]), "no type"),
        ] {
            let error = read(&bytes).unwrap_err();
            assert!(error.message().contains(part), "{error}");
        }
    }

    #[test]
    fn numbers_have_the_other_sign_in_either_order_of_bytes() {
        for (kind, bytes) in [("<f8", 0.5_f64.to_le_bytes()), (">f8", 0.5_f64.to_be_bytes())] {
            let head = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (3,), }}\n");
            let content = file(&head, &bytes.repeat(3));
            let written = with_other_sign(&content, &|number| number != 1).unwrap();
            assert_eq!(read(&written).unwrap().values, [-0.5, 0.5, -0.5]);
            let whole = file(&head.replace("f8", "i8"), &bytes.repeat(3));
            assert!(
                with_other_sign(&whole, &|_| true).is_err()
                    && with_other_sign(&content[..9], &|_| true).is_err()
            );
        }
    }
}
