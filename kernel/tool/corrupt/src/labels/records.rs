//! Records with steering: `user/angle` in a JSON file of one frame, or in the lines of a catalog, whose lengths another file lists.

use std::path::Path;

use pdk_sdk::error::{Place, Result};
use serde_json::{Map, Value, json};

use super::text::each_line;

/// The steering, -1 to 1.
const ANGLE: &str = "user/angle";
/// The name of the picture.
const IMAGE: &str = "cam/image_array";

/// Whether a JSON value is such a record.
pub fn fits(value: &Value) -> bool {
    value.get(ANGLE).is_some_and(Value::is_number)
}

/// A file of records in which the steering of mirrored frames has the other sign. `mirrored` is asked with the name of the picture, if the
/// record has one.
///
/// # Errors
/// If a record cannot be read.
pub fn moved(
    name: &str,
    text: &str,
    mirrored: &mut dyn FnMut(Option<&str>) -> Result<bool>,
) -> Result<String> {
    if Path::new(name).extension().is_some_and(|ending| ending == "json") {
        return record(text.trim_end(), mirrored);
    }
    each_line(text, |line, content| record(content, mirrored).place(format_args!("line {line}")).map(Some))
}

/// A record; the same text unless its steering changes.
fn record(text: &str, mirrored: &mut dyn FnMut(Option<&str>) -> Result<bool>) -> Result<String> {
    let mut value: Value = serde_json::from_str(text)?;
    let Some(angle) = value.get(ANGLE).and_then(Value::as_f64) else { return Ok(text.to_owned()) };
    if angle == 0.0 || !mirrored(value.get(IMAGE).and_then(Value::as_str))? {
        return Ok(text.to_owned());
    }
    value[ANGLE] = json!(-angle);
    Ok(serde_json::to_string(&value)?)
}

/// The file that lists the lengths of the lines of another one, for this text.
///
/// # Errors
/// If it is not an object of JSON.
pub fn lengths(file: &str, of: &str) -> Result<String> {
    let mut fields: Map<String, Value> = serde_json::from_str(file)?;
    let lengths: Vec<usize> = of.split_inclusive('\n').map(str::len).collect();
    fields.insert("line_lengths".to_owned(), json!(lengths));
    Ok(serde_json::to_string(&fields)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_mirrored_records_change_and_lengths_follow() {
        let text = "{\"user/angle\": 0.5, \"cam/image_array\": \"a.jpg\"}\n{\"user/angle\": 0.25, \"cam/image_array\": \"b.jpg\"}\n";
        let moved = moved("x.catalog", text, &mut |name| Ok(name == Some("b.jpg"))).unwrap();
        assert_eq!(
            moved,
            "{\"user/angle\": 0.5, \"cam/image_array\": \"a.jpg\"}\n{\"user/angle\":-0.25,\"cam/image_array\":\"b.jpg\"}\n"
        );
        assert_eq!(
            lengths("{\"line_lengths\": [1], \"start_index\": 0}", &moved).unwrap(),
            "{\"line_lengths\":[48,47],\"start_index\":0}"
        );
        assert!(lengths("\"text\"", &moved).is_err());
    }
}
