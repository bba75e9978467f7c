//! Perturbations by levels as a table whose cells are coloured.

use std::collections::{BTreeSet, HashMap};

use pdk_model::level::MAX_INTENSITY;
use serde::Serialize;

use crate::color::{Hue, Shade};
use crate::text;

/// If there are more different levels than this, a column has all from one whole level to below the next.
pub const MOST_COLUMNS: usize = 20;

/// Which levels go into one column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Columns {
    /// Each has its own.
    Exact,
    /// Those from one whole level to below the next share one.
    Whole,
}

/// A measurement that goes into a cell.
pub struct Entry {
    /// The row; none for what is not perturbed.
    pub row: Option<String>,
    /// The column; none if the level is not a single one.
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
    /// Its colour.
    pub shade: Shade,
    /// The number as it was computed; none if nothing was measured.
    #[serde(skip)]
    pub value: Option<f64>,
    /// Whether some of its drives failed, although its number is about the others.
    pub mixed: bool,
}

/// A ramp in the legend.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ramp {
    /// What its colours say.
    pub hue: Hue,
    /// What its first colour stands for; empty if only its last is explained.
    pub least: String,
    /// What its last colour stands for.
    pub most: String,
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
    /// What the colours stand for.
    pub legend: Vec<Ramp>,
}

/// A row: a cell for each column, or none if nothing was measured.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The perturbation.
    pub label: String,
    /// Its cells.
    pub cells: Vec<Option<Cell>>,
}

impl Cell {
    /// A cell with the colour of a share from 0 to 1.
    pub fn new(text: String, title: String, hue: Hue, share: f64) -> Self {
        Self { text, title, shade: Shade::new(hue, share), value: None, mixed: false }
    }

    /// With the number as it was computed.
    pub fn of(self, value: Option<f64>) -> Self {
        Self { value: value.filter(|value| value.is_finite()), ..self }
    }
}

impl Ramp {
    /// One from the least to the most.
    pub fn new(hue: Hue, least: &str, most: &str) -> Self {
        Self { hue, least: least.to_owned(), most: most.to_owned() }
    }
}

impl Columns {
    /// As many as can be read, for these levels.
    pub fn of(levels: impl IntoIterator<Item = f64>) -> Self {
        let mut different = BTreeSet::new();
        for level in levels {
            different.insert(key(level));
            if different.len() > MOST_COLUMNS {
                return Self::Whole;
            }
        }
        Self::Exact
    }

    /// The column of a level as a number, which is the smallest level in it.
    pub fn column(self, level: f64) -> f64 {
        match self {
            Self::Exact => level,
            Self::Whole => level.floor(),
        }
    }

    /// What a column is called.
    pub fn name(self, column: f64) -> String {
        match self {
            Self::Whole if column < MAX_INTENSITY => {
                format!("{} to below {}", text::short(column), text::short(column + 1.0))
            }
            _ => text::short(column),
        }
    }

    /// Puts measurements into a table, of which each has the place of a [column](Columns::column); the rows come in this order. Where
    /// two have one place, the first counts.
    pub fn grid(self, entries: &[Entry], order: &[String], legend: Vec<Ramp>) -> Grid {
        let mut levels: Vec<f64> = entries.iter().filter_map(|entry| entry.level).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        let mut places: Vec<Option<f64>> = levels.into_iter().map(Some).collect();
        if entries.iter().any(|entry| entry.row.is_some() && entry.level.is_none()) {
            places.push(None);
        }
        let mut cells: HashMap<(&str, Option<u64>), &Cell> = HashMap::new();
        for entry in entries {
            if let Some(row) = &entry.row {
                cells.entry((row, entry.level.map(key))).or_insert(&entry.cell);
            }
        }
        let row = |label: &String| Row {
            label: label.clone(),
            cells: places
                .iter()
                .map(|level| cells.get(&(label.as_str(), level.map(key))).copied().cloned())
                .collect(),
        };
        Grid {
            nominal: entries.iter().find(|entry| entry.row.is_none()).map(|entry| entry.cell.clone()),
            rows: order.iter().map(row).collect(),
            columns: places.iter().map(|level| level.map(|level| self.name(level))).collect(),
            legend,
        }
    }
}

/// A column as a key of a map.
pub fn key(column: f64) -> u64 {
    // 0 and -0 are the same.
    (column + 0.0).to_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_measurement_is_in_its_cell() {
        let entry = |row: Option<&str>, level: Option<f64>, text: &str| Entry {
            row: row.map(str::to_owned),
            level,
            cell: Cell::new(text.to_owned(), String::new(), Hue::Failed, 0.5),
        };
        // The two zeros are one level.
        assert_eq!(key(0.0), key(-0.0));
        let entries = [
            entry(None, None, "n"),
            entry(Some("fog"), Some(4.0), "f4"),
            entry(Some("rain"), Some(0.5), "r"),
            entry(Some("fog"), None, "f"),
        ];
        let order = ["rain".to_owned(), "fog".to_owned()];
        let grid = Columns::Exact.grid(&entries, &order, Default::default());
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
        let cell = Cell::new("1".into(), String::new(), Hue::Failed, 1.0);
        let entries = [
            Entry { row: None, level: None, cell: cell.clone() },
            Entry { row: Some("a".into()), level: Some(1.0), cell },
        ];
        let grid = Columns::Exact.grid(&entries, &["a".into()], Default::default());
        assert_eq!(grid.columns, [Some("1".to_owned())]);
    }

    #[test]
    fn many_levels_share_columns() {
        let few = (0..20).map(|place| f64::from(place) * 0.2);
        assert_eq!(Columns::of(few.clone().chain(few)), Columns::Exact);
        let many = (0..=40).map(|place| f64::from(place) * 0.1);
        let columns = Columns::of(many.clone());
        assert_eq!(columns, Columns::Whole);
        let places: BTreeSet<u64> = many.map(|level| columns.column(level).to_bits()).collect();
        let names: Vec<String> =
            places.into_iter().map(|place| columns.name(f64::from_bits(place))).collect();
        assert_eq!(names, ["0 to below 1", "1 to below 2", "2 to below 3", "3 to below 4", "4"]);
    }
}
