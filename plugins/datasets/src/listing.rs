//! The pictures of a folder, in the order in which people number them.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

/// How the names of pictures end.
const ENDINGS: [&str; 5] = ["jpg", "jpeg", "png", "bmp", "webp"];

/// Whether a file is a picture by its name.
pub fn is_picture(name: &Path) -> bool {
    ends_in(name, &ENDINGS)
}

/// Whether a file's name has one of these endings.
pub fn ends_in(name: &Path, endings: &[&str]) -> bool {
    let ending = name.extension().and_then(|ending| ending.to_str());
    ending.is_some_and(|ending| endings.iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

/// The names in a folder, in their order.
///
/// # Errors
/// If it cannot be listed.
pub fn names(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).place("cannot list it")? {
        names.push(PathBuf::from(entry.place("cannot list it")?.file_name()));
    }
    names.sort_by(|a, b| in_order(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(names)
}

/// Compares names so that numbers in them count as numbers: `frame_9` comes before `frame_10`.
pub fn in_order(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a.as_bytes(), b.as_bytes());
    while let ([first, ..], [second, ..]) = (left, right) {
        let order = if first.is_ascii_digit() && second.is_ascii_digit() {
            let (number, behind) = number(left);
            let (other, behind_other) = self::number(right);
            (left, right) = (behind, behind_other);
            number.len().cmp(&other.len()).then_with(|| number.cmp(other))
        } else {
            (left, right) = (&left[1..], &right[1..]);
            first.cmp(second)
        };
        if order != Ordering::Equal {
            return order;
        }
    }
    // Such as `1` and `01`, which are different names.
    left.len().cmp(&right.len()).then_with(|| a.cmp(b))
}

/// The digits at the beginning without leading zeros, and what stands behind them.
fn number(text: &[u8]) -> (&[u8], &[u8]) {
    let end = text.iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(text.len());
    let zeros = text[..end].iter().take_while(|byte| **byte == b'0').count();
    (&text[zeros..end], &text[end..])
}

/// The last number in the stem of a name.
pub fn last_number(name: &Path) -> Option<u64> {
    let stem = name.file_stem()?.to_str()?;
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let begin = stem[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| at + stem[at..].chars().next().map_or(1, char::len_utf8));
    stem[begin..end].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_in_the_order_of_their_numbers() {
        let mut names = ["a10.png", "a9.png", "a09.png", "a1b2", "a1b10", "b", "a", "10", "9"];
        names.sort_by(|a, b| in_order(a, b));
        assert_eq!(names, ["9", "10", "a", "a1b2", "a1b10", "a09.png", "a9.png", "a10.png", "b"]);
    }

    #[test]
    fn the_number_of_a_frame_is_the_last_in_its_name() {
        let number = |name: &str| last_number(Path::new(name));
        assert_eq!(number("cam2_frame_0017.jpg"), Some(17));
        assert_eq!(number("17.jpg"), Some(17));
        assert_eq!(number("ä17x.jpg"), Some(17));
        assert_eq!((number("none.jpg"), number("")), (None, None));
    }
}
