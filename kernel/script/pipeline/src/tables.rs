//! What a pipeline reports of its own: free tables for people, and files in the record.

use pdk_record::directory;
use pdk_sdk::error::{Error, Result};
use pdk_terminal::table::{Cell, CellAlignment, table};
use serde_json::Value;

/// Checks the name of a file that a pipeline adds to its record.
///
/// # Errors
/// If it is not a plain name that ends in `.json`, or one of the record's own.
pub fn checked_name(name: &Value) -> Result<&str> {
    let plain = |name: &&str| {
        name.strip_suffix(".json").is_some_and(|stem| !stem.is_empty())
            && !name.starts_with('.')
            && name.len() <= 100
            && name.chars().all(|c| c.is_ascii_alphanumeric() || "._-".contains(c))
    };
    let Some(name) = name.as_str().filter(plain) else {
        return Err(Error::new(format!(
            "pdk.save: {name} is not a name for a file in the record; write letters, digits, `_` and `-`, as in \"ranking.json\""
        )));
    };
    match directory::is_own(name) {
        true => {
            Err(Error::new(format!("pdk.save: {name} is a file of the record itself; choose another name")))
        }
        false => Ok(name),
    }
}

/// Renders a table of its own making: `{ header, rows }`.
///
/// # Errors
/// If the header is not a list of texts, or a row no list as long as the header.
pub fn render(header: &Value, rows: &Value) -> Result<String> {
    let texts: Option<Vec<&str>> =
        header.as_array().filter(|h| !h.is_empty()).and_then(|h| h.iter().map(Value::as_str).collect());
    let header = texts.ok_or_else(|| {
        Error::new(
            "pdk.table: the header is not a list of texts; write one such as { \"driver\", \"level\" }",
        )
    })?;
    let rows = rows.as_array().ok_or_else(|| {
        Error::new("pdk.table: the rows are not a list of lists; write one such as { { \"nominal\", 2 } }")
    })?;
    let columns = header.len();
    let mut table = table(header);
    for (i, row) in rows.iter().enumerate() {
        let cells = row.as_array().filter(|cells| cells.len() == columns).ok_or_else(|| {
            Error::new(format!("pdk.table: row {} has to be a list of {columns} texts or numbers", i + 1))
        })?;
        table.add_row(cells.iter().map(cell));
    }
    Ok(table.to_string())
}

/// Numbers to the right: whole ones as they are, others with three digits.
fn cell(value: &Value) -> Cell {
    match value {
        Value::String(text) => Cell::new(text),
        Value::Null => Cell::new(""),
        Value::Number(number) => {
            let text = match number.as_f64() {
                Some(number) if number.fract() != 0.0 => format!("{number:.3}"),
                Some(number) => format!("{number:.0}"),
                None => number.to_string(),
            };
            Cell::new(text).set_alignment(CellAlignment::Right)
        }
        other => Cell::new(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn names_that_would_leave_or_harm_the_record_are_refused() {
        for name in ["../a.json", "a/b.json", ".json", ".a.json", "a.txt", "", "ä.json"] {
            assert!(checked_name(&json!(name)).unwrap_err().to_string().contains("is not a name"), "{name}");
        }
        for name in ["manifest.json", "Summary.json", "performance.json", "shard.json"] {
            assert!(checked_name(&json!(name)).unwrap_err().to_string().contains("of the record itself"));
        }
        assert!(checked_name(&json!(3)).is_err());
        assert_eq!(checked_name(&json!("ranking-2.json")).unwrap(), "ranking-2.json");
    }

    #[test]
    fn a_free_table_has_its_columns() {
        let text = render(&json!(["name", "n"]), &json!([["fog", 0.25], ["rain", 3.0]])).unwrap();
        for part in ["name", "fog", "0.250", " 3"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(render(&json!(["a"]), &json!([["b", 1]])).unwrap_err().to_string().contains("row 1"));
        assert!(render(&json!([]), &json!([])).is_err());
    }
}
