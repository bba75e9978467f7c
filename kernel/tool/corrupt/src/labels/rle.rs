//! Masks as COCO packs them: lengths of runs of 0 and 1 by turns, column by column; also as text, six bits a character.

use pdk_sdk::error::{Error, Result};
use serde_json::{Value, json};

/// Reads a mask: its value for each pixel, row by row.
///
/// # Errors
/// If it is not such a mask, or has another number of pixels.
pub fn read(packed: &Value) -> Result<(Vec<bool>, [usize; 2])> {
    let wrong = || Error::new("a mask in `segmentation` has no `size` and `counts` that fit each other");
    let length =
        |place: usize| packed["size"][place].as_u64().and_then(|length| usize::try_from(length).ok());
    let (height, width) = (length(0).ok_or_else(wrong)?, length(1).ok_or_else(wrong)?);
    let counts: Vec<usize> = match &packed["counts"] {
        Value::Array(counts) => counts
            .iter()
            .map(|count| count.as_u64().map(|count| count as usize))
            .collect::<Option<_>>()
            .ok_or_else(wrong)?,
        Value::String(text) => unpacked(text).ok_or_else(wrong)?,
        _ => return Err(wrong()),
    };
    let side = |length: usize| u32::try_from(length).map_err(|_| wrong());
    pdk_image::check_size(side(width)?, side(height)?)?;
    let pixels = width.checked_mul(height).ok_or_else(wrong)?;
    if counts.iter().try_fold(0usize, |sum, count| sum.checked_add(*count)) != Some(pixels) {
        return Err(wrong());
    }
    let mut mask = vec![false; pixels];
    let (mut place, mut value) = (0, false);
    for count in counts {
        if value {
            (place..place + count).for_each(|at| mask[at % height * width + at / height] = true);
        }
        place += count;
        value = !value;
    }
    Ok((mask, [width, height]))
}

/// Packs a mask as `like` was: as text, or as a list of lengths.
pub fn write(mask: &[bool], [width, height]: [usize; 2], like: &Value) -> Value {
    let (mut counts, mut run, mut value) = (Vec::new(), 0usize, false);
    for at in 0..mask.len() {
        if mask[at % height * width + at / height] != value {
            counts.push(std::mem::take(&mut run));
            value = !value;
        }
        run += 1;
    }
    counts.push(run);
    match like["counts"].is_string() {
        true => json!({ "size": [height, width], "counts": packed(&counts) }),
        false => json!({ "size": [height, width], "counts": counts }),
    }
}

/// The lengths in a text: numbers of five bits a character, the lowest first, each from the fourth on as the difference from the one
/// before the last.
fn unpacked(text: &str) -> Option<Vec<usize>> {
    let mut counts: Vec<i64> = Vec::new();
    let mut bytes = text.bytes();
    while bytes.len() > 0 {
        let (mut value, mut shift) = (0i64, 0);
        loop {
            let bits = i64::from(bytes.next()?.checked_sub(48)?);
            if bits > 63 || shift > 50 {
                return None;
            }
            value |= (bits & 31) << shift;
            shift += 5;
            if bits & 32 == 0 {
                if bits & 16 != 0 {
                    value |= -1 << shift;
                }
                break;
            }
        }
        if counts.len() > 2 {
            value += counts[counts.len() - 2];
        }
        counts.push(value);
    }
    counts.into_iter().map(|count| usize::try_from(count).ok()).collect()
}

fn packed(counts: &[usize]) -> String {
    let mut text = String::new();
    for (place, &count) in counts.iter().enumerate() {
        let mut value = count as i64 - if place > 2 { counts[place - 2] as i64 } else { 0 };
        loop {
            let bits = value & 31;
            value >>= 5;
            let more = if bits & 16 != 0 { value != -1 } else { value != 0 };
            text.push(char::from((bits | if more { 32 } else { 0 }) as u8 + 48));
            if !more {
                break;
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_survive_both_ways_of_packing() {
        let size = [7, 5];
        for seed in 0..40u64 {
            let mask: Vec<bool> =
                (0..35).map(|at| (at * 7919 + seed * 104_729) % (2 + seed % 5) == 0).collect();
            for like in [json!({"counts": ""}), json!({"counts": []})] {
                let packed = write(&mask, size, &like);
                assert_eq!(read(&packed).unwrap(), (mask.clone(), size), "{packed}");
            }
        }
    }

    #[test]
    fn a_packed_text_is_that_of_the_published_tools() {
        // By pycocotools: encode of a mask of 3 rows and 4 columns with its second column set, and of 40 x 60 with a box.
        let mut mask = vec![false; 12];
        for at in [1, 5, 9] {
            mask[at] = true;
        }
        assert_eq!(write(&mask, [4, 3], &json!({"counts": ""}))["counts"], "336");
        assert_eq!(read(&json!({"size": [3, 4], "counts": "336"})).unwrap().0, mask);
    }

    #[test]
    fn a_mask_of_any_size_takes_no_memory_before_it_is_looked_at() {
        let large = json!({"size": [4_000_000_000_u64, 4_000_000_000_u64], "counts": [16_000_000_000_000_000_000_u64]});
        assert!(read(&large).unwrap_err().message().contains("megapixels"));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        for packed in
            [json!({}), json!({"size": [2, 2], "counts": [3]}), json!({"size": [2, 2], "counts": "~"})]
        {
            assert!(read(&packed).is_err(), "{packed}");
        }
    }
}
