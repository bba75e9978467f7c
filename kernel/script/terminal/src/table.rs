//! Tables for people. A terminal shows them in boxes and wraps what does not fit; a file or another program gets one line for each
//! row, with columns in line and nothing drawn.

use std::fmt;
use std::io::IsTerminal;

pub use comfy_table::{Cell, CellAlignment};
use comfy_table::{ColumnConstraint, ContentArrangement, Row, Width, presets};

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
        let mut table = self.0.clone();
        keep_words(&mut table);
        f.write_str(&table.trim_fmt())
    }
}

/// Makes columns at least as wide as their longest words, if the table still fits: all columns, or else the first one. A name that is broken
/// in two is hard to read and cannot be copied.
fn keep_words(table: &mut comfy_table::Table) {
    let is_drawn = matches!(table.content_arrangement(), ContentArrangement::Dynamic);
    let Some(width) = table.width().filter(|_| is_drawn) else { return };
    let longest = |column: usize| {
        let cells = table.column_cells_with_header_iter(column).flatten();
        let of_cell =
            |cell: &Cell| cell.content().split_whitespace().map(textwrap::core::display_width).max();
        cells.filter_map(of_cell).max().unwrap_or(1)
    };
    let longest: Vec<usize> = (0..table.column_iter().count()).map(longest).collect();
    // Each column has a space on both sides and a line before it, and a line stands behind the last one.
    let drawn = 1 + 3 * longest.len();
    let kept = match longest.as_slice() {
        all if all.iter().sum::<usize>() + drawn <= width.into() => all.len(),
        // The others need room as well.
        [first, ..] if 3 * first <= usize::from(width) => 1,
        _ => 0,
    };
    for (column, word) in table.column_iter_mut().zip(&longest).take(kept) {
        let width = u16::try_from(word + 2).unwrap_or(u16::MAX);
        column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(width)));
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
    fn words_are_not_broken_in_a_terminal_in_which_they_fit() {
        let within = |width: u16| {
            let mut table = Table::new(["perturbation", "what it does", "over the line"], true);
            table.add_row(["increase_brightness", "Adds to all values of the frame", "0.102"]);
            table.0.set_width(width);
            table.to_string()
        };
        for width in [48, 56, 80] {
            let lines = within(width);
            assert!(lines.lines().all(|line| line.chars().count() <= width.into()), "{lines}");
            for word in ["increase_brightness", "values", "frame", "over the line"] {
                let whole = word.split(' ').all(|word| lines.contains(word));
                assert!(whole, "{word} at {width}:\n{lines}");
            }
        }
        // Below that nothing is lost, and no line is too long.
        let lines = within(30);
        assert!(lines.lines().all(|line| line.chars().count() <= 30), "{lines}");
    }

    #[test]
    fn a_table_for_a_terminal_is_drawn() {
        let lines: Vec<_> = shown(true).lines().map(str::to_owned).collect();
        assert_eq!(lines.len(), 6);
        assert!(lines[0].starts_with('┌') && lines[3].contains("dave2"), "{lines:?}");
    }
}
