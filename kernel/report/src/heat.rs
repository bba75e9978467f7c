//! Perturbations by levels as a table whose cells are coloured.

use serde::Serialize;

use crate::color::{self, Rgb};
use crate::text;

/// A measurement that goes into a cell.
pub struct Entry {
    /// The row; none for what is not perturbed.
    pub row: Option<String>,
    /// The column; none where the level is no single one.
    pub level: Option<f64>,
    /// The number and its colour.
    pub cell: Cell,
}

/// A cell.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cell {
    /// The number.
    pub text: String,
    /// What it says, as a sentence.
    pub title: String,
    /// The ground.
    pub ground: Rgb,
    /// The text's colour on it.
    pub ink: Rgb,
}

/// A table.
#[derive(Debug, Clone, Serialize)]
pub struct Grid {
    /// The levels of the columns; none for the column of those that have no single one.
    pub columns: Vec<Option<String>>,
    /// The row of what is not perturbed, over all columns.
    pub nominal: Option<Cell>,
    /// The other rows.
    pub rows: Vec<Row>,
    /// What the lightest and the darkest colour stand for.
    pub legend: (String, String),
}

/// A row: a cell for each column, or none where nothing was measured.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The perturbation.
    pub label: String,
    /// Its cells.
    pub cells: Vec<Option<Cell>>,
}

impl Cell {
    /// A cell with the colour of a share from 0 to 1.
    pub fn new(text: String, title: String, share: f64) -> Self {
        let ground = color::ramp(share);
        Self { text, title, ground, ink: color::ink(ground) }
    }
}

/// Puts measurements into a table; the rows come in this order.
pub fn grid(entries: &[Entry], order: &[String], legend: (String, String)) -> Grid {
    let mut levels: Vec<f64> = entries.iter().filter_map(|entry| entry.level).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let mut columns: Vec<Option<f64>> = levels.into_iter().map(Some).collect();
    if entries.iter().any(|entry| entry.row.is_some() && entry.level.is_none()) {
        columns.push(None);
    }
    let find = |row: &str, level: &Option<f64>| {
        let same = |entry: &&Entry| entry.row.as_deref() == Some(row) && entry.level == *level;
        entries.iter().find(same).map(|entry| entry.cell.clone())
    };
    Grid {
        nominal: entries.iter().find(|entry| entry.row.is_none()).map(|entry| entry.cell.clone()),
        rows: order
            .iter()
            .map(|row| Row {
                label: row.clone(),
                cells: columns.iter().map(|level| find(row, level)).collect(),
            })
            .collect(),
        columns: columns.iter().map(|level| level.map(text::short)).collect(),
        legend,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_measurement_is_in_its_cell() {
        let entry = |row: Option<&str>, level: Option<f64>, text: &str| Entry {
            row: row.map(str::to_owned),
            level,
            cell: Cell::new(text.to_owned(), String::new(), 0.5),
        };
        let entries = [
            entry(None, None, "n"),
            entry(Some("fog"), Some(4.0), "f4"),
            entry(Some("rain"), Some(0.5), "r"),
            entry(Some("fog"), None, "f"),
        ];
        let order = ["rain".to_owned(), "fog".to_owned()];
        let grid = grid(&entries, &order, Default::default());
        assert_eq!(grid.columns, [Some("0.5".to_owned()), Some("4".to_owned()), None]);
        assert_eq!(grid.nominal.map(|cell| cell.text).as_deref(), Some("n"));
        let texts: Vec<Vec<String>> = grid
            .rows
            .iter()
            .map(|row| row.cells.iter().map(|c| c.as_ref().map_or("-", |c| &c.text).to_owned()).collect())
            .collect();
        assert_eq!(texts, [["r", "-", "-"], ["-", "f4", "f"]]);
    }

    #[test]
    fn without_schedules_there_is_no_column_for_them() {
        let cell = Cell::new("1".into(), String::new(), 1.0);
        let entries = [
            Entry { row: None, level: None, cell: cell.clone() },
            Entry { row: Some("a".into()), level: Some(1.0), cell },
        ];
        assert_eq!(grid(&entries, &["a".into()], Default::default()).columns, [Some("1".to_owned())]);
    }
}
