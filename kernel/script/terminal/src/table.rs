//! Tables for people. A terminal shows them in boxes and wraps what does not fit; a file or another program gets one line for each
//! row, with columns in line and nothing drawn.

use std::fmt;
use std::io::IsTerminal;

pub use comfy_table::{Cell, CellAlignment};
use comfy_table::{ContentArrangement, Row, presets};

/// Spaces between the columns of a table that is not drawn.
const GAP: u16 = 2;

/// A table in the style of all of pdk's tables.
pub struct Table(comfy_table::Table);

/// An empty table for standard output.
pub fn table<'a>(header: impl IntoIterator<Item = &'a str>) -> Table {
    Table::new(header, std::io::stdout().is_terminal())
}

impl Table {
    /// An empty table, drawn as for a terminal or plain.
    pub fn new<'a>(header: impl IntoIterator<Item = &'a str>, is_drawn: bool) -> Self {
        let mut table = comfy_table::Table::new();
        table.set_header(header);
        if is_drawn {
            table.load_style(presets::UTF8_FULL_CONDENSED);
            // Wraps lines if the width of the terminal is known.
            table.set_content_arrangement(ContentArrangement::Dynamic);
        } else {
            table.load_style(presets::NOTHING);
            table.column_iter_mut().for_each(|column| _ = column.set_padding((0, GAP)));
        }
        Self(table)
    }

    /// Adds a row below the others.
    pub fn add_row(&mut self, row: impl Into<Row>) {
        self.0.add_row(row);
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.trim_fmt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(is_drawn: bool) -> String {
        let mut table = Table::new(["driver", "mean"], is_drawn);
        table.add_row([Cell::new("dave2"), Cell::new("0.12").set_alignment(CellAlignment::Right)]);
        table.add_row([Cell::new("lane keeper"), Cell::new("10.5").set_alignment(CellAlignment::Right)]);
        table.to_string()
    }

    #[test]
    fn a_table_for_a_program_has_a_line_for_each_row_and_nothing_drawn() {
        assert_eq!(shown(false), "driver       mean\ndave2        0.12\nlane keeper  10.5");
    }

    #[test]
    fn a_table_for_a_terminal_is_drawn() {
        let lines: Vec<_> = shown(true).lines().map(str::to_owned).collect();
        assert_eq!(lines.len(), 6);
        assert!(lines[0].starts_with('┌') && lines[3].contains("dave2"), "{lines:?}");
    }
}
