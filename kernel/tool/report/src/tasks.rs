//! What perturbations do to a predictor, by the numbers of its metric.

use serde::Serialize;

use crate::color::Hue;
use crate::heat::{Cell, Columns, Entry, Grid, Ramp, key};
use crate::text::{number, was};
use crate::view::{Task, TaskNumber};

/// What the page says about an evaluation of a predictor.
#[derive(Debug, Serialize)]
pub struct Section {
    number: u64,
    pub name: String,
    /// A table for each number of the metric.
    pub grids: Vec<(String, Grid)>,
    bad_frames: Vec<(String, String)>,
}

/// The sentence on top of the page.
pub fn verdict(task: &Task) -> String {
    let bad = match task.bad_frames.len() {
        0 => String::new(),
        bad => format!(" ({} left out)", was(bad, "picture")),
    };
    let first = task.numbers.first().and_then(|first| Some((&first.name, first.original?)));
    let said = first.map_or_else(String::new, |(name, original)| {
        format!("; {name} is {} without perturbation", number(original))
    });
    format!("{} evaluated for {}{bad}{said}.", was(task.frames, "picture"), task.name)
}

/// All that the page says about it.
pub fn section(task: &Task) -> Section {
    Section {
        number: task.number,
        name: task.name.clone(),
        grids: task.numbers.iter().map(|number| (number.name.clone(), grid(number))).collect(),
        bad_frames: task.bad_frames.clone(),
    }
}

/// A table of a number. Its colours say how far it is from what it is without perturbation, because some numbers are better if they are
/// larger, and others if they are smaller.
fn grid(task: &TaskNumber) -> Grid {
    let columns = Columns::of(task.cells.iter().map(|(_, level, _)| *level));
    let from = task.original.unwrap_or_default();
    let largest = task.cells.iter().map(|(.., value)| (value - from).abs()).fold(0.0, f64::max);
    let cell = |value: f64, what: String| {
        let share = if largest > 0.0 { (value - from).abs() / largest } else { 0.0 };
        Cell::new(number(value), format!("{what}: {}", number(value)), Hue::Distance, share).of(Some(value))
    };
    let mut order: Vec<String> = Vec::new();
    // The place of each cell, with the values in it.
    let mut places: Vec<(&String, f64, Vec<f64>)> = Vec::new();
    for (label, level, value) in &task.cells {
        if !order.contains(label) {
            order.push(label.clone());
        }
        let column = columns.column(*level);
        match places.iter_mut().find(|(other, place, _)| (*other, key(*place)) == (label, key(column))) {
            Some((.., values)) => values.push(*value),
            None => places.push((label, column, vec![*value])),
        }
    }
    let mut entries: Vec<Entry> = Vec::new();
    for (label, column, values) in places {
        let what = match values.len() {
            1 => format!("{label} at level {}", columns.name(column)),
            several => format!("{label} at level {}, the mean of {several} levels", columns.name(column)),
        };
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        entries.push(Entry { row: Some(label.clone()), level: Some(column), cell: cell(mean, what) });
    }
    entries.extend(task.original.map(|value| Entry {
        row: None,
        level: None,
        cell: cell(value, "without perturbation".to_owned()),
    }));
    let legend = Ramp::new(Hue::Distance, "as without perturbation", &format!("{} off", number(largest)));
    columns.grid(&entries, &order, vec![legend])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_tables_that_show_what_changed() {
        let miou = TaskNumber {
            name: "miou".into(),
            original: Some(0.75),
            cells: vec![("fog".into(), 1.0, 0.7), ("fog".into(), 4.0, 0.25), ("rain".into(), 4.0, 0.75)],
        };
        let task = Task {
            name: "segmentation".into(),
            frames: 3,
            numbers: vec![miou],
            bad_frames: vec![("a.png".into(), "it is empty".into())],
            ..Task::default()
        };
        assert_eq!(
            verdict(&task),
            "3 pictures were evaluated for segmentation (1 picture was left out); miou is 0.750 without perturbation."
        );
        let section = section(&task);
        let (name, grid) = &section.grids[0];
        assert_eq!((name.as_str(), grid.rows[0].label.as_str(), grid.rows.len()), ("miou", "fog", 2));
        let worst = grid.rows[0].cells[1].as_ref().unwrap();
        assert_eq!(worst.text, "0.250");
        let nominal = grid.nominal.as_ref().unwrap();
        assert_eq!(grid.rows[1].cells[1].as_ref().unwrap().shade, nominal.shade);
        assert_ne!(worst.shade, nominal.shade);
    }

    #[test]
    fn a_column_of_several_levels_has_their_mean() {
        let cells = (0..41).map(|tenth| ("fog".into(), f64::from(tenth) / 10.0, f64::from(tenth))).collect();
        let grid = grid(&TaskNumber { name: "miou".into(), original: Some(0.0), cells });
        assert_eq!(grid.columns[1].as_deref(), Some("1 to below 2"));
        let means: Vec<f64> = grid.rows[0].cells.iter().flatten().filter_map(|cell| cell.value).collect();
        assert_eq!(means, [4.5, 14.5, 24.5, 34.5, 40.0]);
        let title = &grid.rows[0].cells[1].as_ref().unwrap().title;
        assert!(title.contains("the mean of 10 levels"), "{title}");
    }
}
