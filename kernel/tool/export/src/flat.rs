//! Lines of a record as flat CSV: a line for each, a column for each field. The fields of objects, and of objects in a list, have dots in
//! their names; other lists are JSON.

use std::collections::HashMap;

use pdk_sdk::error::{Place, Result};
use serde_json::Value;

/// The fields of a line, in order.
pub type Fields = Vec<(String, String)>;

/// The fields of a JSON value.
pub fn fields(value: &Value) -> Fields {
    let mut fields = Vec::new();
    add(&mut fields, "", value);
    fields
}

fn add(fields: &mut Fields, name: &str, value: &Value) {
    let below = |part: &str| if name.is_empty() { part.to_owned() } else { format!("{name}.{part}") };
    match value {
        Value::Object(object) => object.iter().for_each(|(key, value)| add(fields, &below(key), value)),
        Value::Array(list) if !list.is_empty() && list.iter().all(Value::is_object) => {
            list.iter().enumerate().for_each(|(place, value)| add(fields, &below(&place.to_string()), value));
        }
        Value::String(text) => fields.push((name.to_owned(), text.clone())),
        Value::Null => fields.push((name.to_owned(), String::new())),
        other => fields.push((name.to_owned(), other.to_string())),
    }
}

/// The lines as CSV. A column comes where the first line that has it has it; a field that a line lacks is empty.
///
/// # Errors
/// If they cannot be written.
pub fn csv(lines: &[Fields]) -> Result<Vec<u8>> {
    let mut columns: Vec<&str> = Vec::new();
    let mut known: HashMap<&str, usize> = HashMap::new();
    for line in lines {
        // A new one stands behind the one that it follows in its line.
        let mut after = 0;
        for (name, _) in line {
            match known.get(name.as_str()) {
                Some(place) => after = place + 1,
                None => {
                    columns.insert(after, name);
                    known = columns.iter().enumerate().map(|(place, name)| (*name, place)).collect();
                    after += 1;
                }
            }
        }
    }
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(&columns).map_err(std::io::Error::from)?;
    let mut row: Vec<&str> = Vec::new();
    for line in lines {
        row.clear();
        row.resize(columns.len(), "");
        for (name, value) in line {
            if let Some(place) = known.get(name.as_str()) {
                row[*place] = value;
            }
        }
        writer.write_record(&row).map_err(std::io::Error::from)?;
    }
    writer.into_inner().map_err(|error| error.into_error()).place("cannot write CSV")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn each_field_has_a_column_and_each_line_its_values() {
        let lines = [
            json!({"id": "a", "road": {"angles": [0, 1.5]}, "perturbations": [{"name": "fog", "level": 2.0}], "end": true}),
            json!({"id": "b,\"", "road": {"angles": [], "segment": 25}, "end": false, "error": "two\nlines"}),
        ];
        let text = String::from_utf8(csv(&lines.map(|line| fields(&line))).unwrap()).unwrap();
        assert_eq!(
            text,
            "id,road.angles,road.segment,perturbations.0.name,perturbations.0.level,end,error\n\
             a,\"[0,1.5]\",,fog,2.0,true,\n\
             \"b,\"\"\",[],25,,,false,\"two\nlines\"\n"
        );
    }

    #[test]
    fn without_lines_there_is_an_empty_file() {
        assert!(csv(&[]).unwrap().len() <= 3);
    }
}
