//! CSV files with steering of the other sign: the cells alone are changed, so that the rest of the file stays as it was.

use std::ops::Range;

use pdk_sdk::prelude::*;

use crate::table::Table;

impl Table {
    /// The text of the file, in which a column has the other sign in the rows that `turned` names.
    ///
    /// # Errors
    /// If the text is not that of the table.
    pub fn with_other_sign(
        &self,
        text: &str,
        column: usize,
        turned: &dyn Fn(usize) -> bool,
    ) -> Result<String> {
        let begin = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
        let start = |row: usize| match self.rows.get(row) {
            Some((place, _)) => begin + place.byte() as usize,
            None => text.len(),
        };
        let changed = || Error::new("it has changed while it was read; run the command again");
        let mut written = String::with_capacity(text.len() + self.rows.len());
        let mut at = 0;
        for row in (0..self.rows.len()).filter(|row| turned(*row)) {
            let lines = text.get(start(row)..start(row + 1)).ok_or_else(changed)?;
            let Some(cell) = cell(lines, self.separator, column) else { continue };
            let cell = start(row) + cell.start..start(row) + cell.end;
            let value = &text[cell.clone()];
            // Zero has no sign, and an empty cell is not a number.
            if value.parse::<f64>().is_ok_and(|value| value != 0.0) {
                written += &text[at..cell.start];
                match value.strip_prefix('-') {
                    Some(positive) => written += positive,
                    None => {
                        written.push('-');
                        written += value.trim_start_matches('+');
                    }
                }
                at = cell.end;
            }
        }
        written += &text[at..];
        Ok(written)
    }
}

/// Where a cell of the row at the beginning of a text is, without spaces and quotes around it.
fn cell(text: &str, separator: char, column: usize) -> Option<Range<usize>> {
    let mut begin = 0;
    // What is passed over before a row: empty lines and comments.
    for line in text.split_inclusive('\n') {
        if !line.trim_end_matches(['\r', '\n']).is_empty() && !line.starts_with('#') {
            break;
        }
        begin += line.len();
    }
    let (mut number, mut quoted) = (0, false);
    let mut from = begin;
    let mut end = text.len();
    for (place, c) in text[begin..].char_indices() {
        let at = begin + place;
        match c {
            '"' => quoted = !quoted,
            '\n' if !quoted => {
                end = at;
                break;
            }
            c if c == separator && !quoted => {
                if number == column {
                    end = at;
                    break;
                }
                (number, from) = (number + 1, at + 1);
            }
            _ => {}
        }
    }
    let bare = |c: char| c.is_whitespace() || c == '"';
    let cell = text.get(from..end).filter(|_| number == column)?;
    let before = cell.len() - cell.trim_start_matches(bare).len();
    Some(from + before..from + before + cell.trim_matches(bare).len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inside::Inside;
    use std::path::Path;

    #[test]
    fn steering_has_the_other_sign_and_every_other_byte_stays() {
        let dir = tempfile::tempdir().unwrap();
        for (text, turned) in [
            (
                "frame,steering,note\n0,0.5,a\n1,-0.25,b\n2,0,c\n3,,d\n",
                "frame,steering,note\n0,-0.5,a\n1,0.25,b\n2,0,c\n3,,d\n",
            ),
            (
                "\u{feff}note;steering\r\n\"a;b\"; \"+0.5\" \r\n\r\n# c\r\nx;1e-3",
                "\u{feff}note;steering\r\n\"a;b\"; \"-0.5\" \r\n\r\n# c\r\nx;-1e-3",
            ),
            ("steering\n0.5\n0.25\n-1\n", "steering\n-0.5\n-0.25\n1\n"),
        ] {
            let negative = |text: &str, rows: &dyn Fn(usize) -> bool| {
                std::fs::write(dir.path().join("t.csv"), text).unwrap();
                let table = Table::read(&Inside::new(dir.path()).unwrap(), Path::new("t.csv")).unwrap();
                table.with_other_sign(text, table.named("steering").unwrap(), rows).unwrap()
            };
            assert_eq!(negative(text, &|_| true), turned);
            assert_eq!(negative(turned, &|_| true), text.replace('+', ""));
            assert_eq!(negative(text, &|_| false), text);
            let first = negative(text, &|row| row == 0);
            assert!(first != text && first != turned, "{first}");
        }
    }
}
