//! The tables of a page as plain data, for other programs and for papers.

use crate::closed_loop::failing::failing;
use crate::conclusions::conclusions;
use crate::heat::{Cell as HeatCell, Grid};
use crate::text::{level, number, p_value, percent, short, signed, signed_percent};
use crate::view::{Drive, Evaluation, Run};
use crate::{closed_loop, compare, offline, road, tasks};
use pdk_sdk::error::Result;

/// A table.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Its name, which files are named after.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// The names of its columns.
    pub columns: Vec<String>,
    /// Its rows, as long as the columns.
    pub rows: Vec<Vec<Cell>>,
}

/// A cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Nothing.
    Empty,
    /// A text.
    Text(String),
    /// A number.
    Number {
        /// As it was computed; none if there is none, such as the level of what never fails.
        value: Option<f64>,
        /// As a person reads it.
        shown: String,
    },
}

impl Cell {
    fn text(text: &str) -> Self {
        Self::Text(text.to_owned())
    }

    fn number(value: f64, shown: fn(f64) -> String) -> Self {
        Self::Number { value: Some(value).filter(|value| value.is_finite()), shown: shown(value) }
    }

    fn count(count: usize) -> Self {
        Self::number(count as f64, short)
    }

    /// A number that there may be none of.
    fn known(value: Option<f64>, shown: fn(f64) -> String) -> Self {
        value.map_or(Self::Empty, |value| Self::number(value, shown))
    }

    /// A level; none is beyond all that were driven.
    fn level(value: Option<f64>, beyond: &str) -> Self {
        Self::Number { value, shown: value.map_or_else(|| beyond.to_owned(), level) }
    }
}

/// The tables of a run.
///
/// # Errors
/// If what they come from cannot be computed.
pub fn tables(run: &Run) -> Result<Vec<Table>> {
    let mut tables: Vec<Table> = failing_levels(&run.drives).into_iter().collect();
    let classes = road::classes(&run.drives);
    for (place, drive) in run.drives.iter().enumerate() {
        let suffix = suffix(place, run.drives.len());
        let section = closed_loop::section(drive, &run.drives, &classes)?;
        let of = format!("{} in {}, {}", drive.driver, drive.simulator, drive.mode);
        tables.push(of_grid(
            &format!("failed{suffix}"),
            &format!("Share of drives that failed: {of}"),
            &section.failed,
        ));
        let title = format!("Mean absolute cross-track error in m of drives that reached the end: {of}");
        tables.push(of_grid(&format!("error{suffix}"), &title, &section.error));
        tables.extend(certainty(drive, &suffix, &of));
        tables.push(scenarios(drive, &suffix, &of));
    }
    let pairs = compare::pairs(&run.drives);
    for (place, (base, other)) in pairs.iter().enumerate() {
        tables.extend(compared(base, other, &suffix(place, pairs.len())));
    }
    let scale = offline::Scale::of(&run.evaluations);
    for (place, evaluation) in run.evaluations.iter().enumerate() {
        let suffix = suffix(place, run.evaluations.len());
        let section = offline::section(evaluation, &scale)?;
        let of = match evaluation.driver.is_empty() {
            true => String::new(),
            false => format!(": {}", evaluation.driver),
        };
        let error = format!("Mean absolute steering error against the recorded truth{of}");
        tables.push(of_grid(&format!("steering-error{suffix}"), &error, &section.error));
        let drift = format!("Mean absolute drift from the steering without perturbation{of}");
        tables.push(of_grid(&format!("steering-drift{suffix}"), &drift, &section.drift));
        tables.push(intervals(evaluation, &suffix, &of));
    }
    let pairs = offline::compare::pairs(&run.evaluations);
    for (place, (base, other)) in pairs.iter().enumerate() {
        tables.extend(compared_offline(base, other, &suffix(place, pairs.len())));
    }
    for (place, task) in run.tasks.iter().enumerate() {
        let (section, suffix) = (tasks::section(task), suffix(place, run.tasks.len()));
        for (number, (name, grid)) in section.grids.iter().enumerate() {
            let title = format!("{name} of {}", section.name);
            tables.push(of_grid(&format!("task{suffix}-{}", number + 1), &title, grid));
        }
    }
    Ok(tables)
}

/// What tells the tables of one of several drives from those of the others.
pub fn suffix(place: usize, of: usize) -> String {
    if of > 1 { format!("-{}", place + 1) } else { String::new() }
}

fn columns(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

/// From which level on each perturbation makes each driver fail; none if nothing was driven at levels.
fn failing_levels(drives: &[Drive]) -> Option<Table> {
    let row = |drive: &Drive| {
        let of = |found: crate::closed_loop::failing::Failing| {
            let beyond = format!("above {}", short(found.highest));
            let one_road = found.roads < 2;
            // On one road there is no interval, and what was survived and failed there stands in its place.
            let low = if one_road { Cell::known(found.low, level) } else { Cell::level(found.low, &beyond) };
            vec![
                Cell::text(&drive.driver),
                Cell::text(&drive.simulator),
                Cell::text(&found.name),
                Cell::level(found.level, "never"),
                low,
                Cell::level(found.high, &beyond),
                Cell::count(found.roads),
                Cell::count(found.drives),
            ]
        };
        failing(drive).into_iter().map(of).collect::<Vec<_>>()
    };
    let rows: Vec<Vec<Cell>> = drives.iter().flat_map(row).collect();
    (!rows.is_empty()).then(|| Table {
        name: "failing-levels".to_owned(),
        title: "Level from which on a perturbation makes a driver fail, with its interval of 95 % over roads"
            .to_owned(),
        columns: columns(&["driver", "simulator", "perturbation", "level", "low", "high", "roads", "drives"]),
        rows,
    })
}

/// A heat map as a table.
fn of_grid(name: &str, title: &str, grid: &Grid) -> Table {
    let cell = |cell: &Option<HeatCell>| match cell {
        None => Cell::Empty,
        Some(cell) => Cell::Number { value: cell.value, shown: cell.text.clone() },
    };
    let named = |level: &Option<String>| match level {
        None => "as given".to_owned(),
        Some(level) => format!("level {level}"),
    };
    let nominal = grid.nominal.iter().map(|nominal| {
        let cells = grid.columns.iter().map(|_| cell(&Some(nominal.clone())));
        std::iter::once(Cell::text("no perturbation")).chain(cells).collect()
    });
    let rows = grid
        .rows
        .iter()
        .map(|row| std::iter::once(Cell::text(&row.label)).chain(row.cells.iter().map(cell)).collect());
    Table {
        name: name.to_owned(),
        title: title.to_owned(),
        columns: std::iter::once("perturbation".to_owned()).chain(grid.columns.iter().map(named)).collect(),
        rows: nominal.chain(rows).collect(),
    }
}

/// How sure differences are; none on one road.
fn certainty(drive: &Drive, suffix: &str, of: &str) -> Option<Table> {
    let found = conclusions(drive);
    let rows: Vec<Vec<Cell>> = found
        .rows
        .iter()
        .map(|row| {
            let figures = &row.figures;
            let paired = figures.difference;
            vec![
                Cell::count(row.group),
                Cell::text(&row.perturbation),
                Cell::count(figures.drives.0),
                Cell::count(figures.drives.1),
                Cell::known(figures.share.map(|share| share.value), percent),
                Cell::known(figures.share.map(|share| share.low), percent),
                Cell::known(figures.share.map(|share| share.high), percent),
                Cell::known(paired.map(|paired| paired.difference.value), signed_percent),
                Cell::known(paired.map(|paired| paired.difference.low), signed_percent),
                Cell::known(paired.map(|paired| paired.difference.high), signed_percent),
                Cell::known(paired.map(|paired| paired.effect_size), number),
                Cell::known(paired.map(|paired| paired.p), p_value),
            ]
        })
        .collect();
    (!rows.is_empty()).then(|| Table {
        name: format!("certainty{suffix}"),
        title: format!(
            "Share of levels that fail, and difference to drives without perturbation, with intervals of 95 % over roads: {of}"
        ),
        columns: columns(&[
            "group", "perturbation", "failed", "drives", "failing levels", "low", "high", "more than without",
            "difference low", "difference high", "effect size", "p",
        ]),
        rows,
    })
}

/// By how much a driver differs from another one; none if they have nothing in common.
fn compared(base: &Drive, other: &Drive, suffix: &str) -> Option<Table> {
    let found = compare::comparison(base, other)?;
    let row = |row: &compare::Row| {
        let (base, other, paired) = &row.figures;
        vec![
            Cell::text(&row.perturbation),
            Cell::number(*base, percent),
            Cell::number(*other, percent),
            Cell::number(paired.difference.value, signed_percent),
            Cell::number(paired.difference.low, signed_percent),
            Cell::number(paired.difference.high, signed_percent),
            Cell::number(paired.effect_size, number),
            Cell::number(paired.p, p_value),
            Cell::count(paired.roads),
        ]
    };
    Some(Table {
        name: format!("compared{suffix}"),
        title: format!(
            "Share of levels that {} and {} fail, with intervals of 95 % over roads",
            found.base, found.other
        ),
        columns: columns(&[
            "perturbation",
            "base",
            "other",
            "difference",
            "low",
            "high",
            "effect size",
            "p",
            "roads",
        ]),
        rows: found.rows.iter().map(row).collect(),
    })
}

/// By how much the errors of two drivers on the same frames differ; none if they have no frame in common.
fn compared_offline(base: &Evaluation, other: &Evaluation, suffix: &str) -> Option<Table> {
    let found = offline::compare::comparison(base, other)?;
    let finite = |end: f64| Cell::known(Some(end).filter(|end| end.is_finite()), signed);
    let row = |row: &offline::compare::Row| {
        let figures = &row.figures;
        vec![
            Cell::text(&row.perturbation),
            Cell::number(figures.base, number),
            Cell::number(figures.other, number),
            Cell::number(figures.difference.value, signed),
            finite(figures.difference.low),
            finite(figures.difference.high),
            Cell::number(figures.effect_size, number),
            Cell::number(figures.worse, percent),
            Cell::count(figures.frames),
        ]
    };
    Some(Table {
        name: format!("steering-compared{suffix}"),
        title: format!(
            "Mean absolute {} of {} and {} on the same frames, with intervals of 95 %",
            found.measure, found.base, found.other
        ),
        columns: columns(&[
            "perturbation",
            "base",
            "other",
            "difference",
            "low",
            "high",
            "effect size",
            "other further off",
            "frames",
        ]),
        rows: found.rows.iter().map(row).collect(),
    })
}

fn scenarios(drive: &Drive, suffix: &str, of: &str) -> Table {
    let row = |scenario: &crate::view::Scenario| {
        vec![
            Cell::number(scenario.index as f64, short),
            Cell::text(&scenario.name),
            scenario.road.map_or(Cell::Empty, |road| Cell::count(road + 1)),
            Cell::text(&scenario.cause),
            Cell::number(scenario.time, number),
            Cell::number(scenario.progress, percent),
            Cell::number(scenario.mean_error, number),
            Cell::number(scenario.max_error, number),
            Cell::known(scenario.measures.map(|measures| measures.over_line_seconds), number),
        ]
    };
    Table {
        name: format!("scenarios{suffix}"),
        title: format!("Scenarios: {of}"),
        columns: columns(&[
            "number",
            "scenario",
            "road",
            "outcome",
            "time s",
            "driven",
            "mean XTE m",
            "max XTE m",
            "over line s",
        ]),
        rows: drive.scenarios.iter().map(row).collect(),
    }
}

/// Errors and drifts with their intervals.
fn intervals(evaluation: &Evaluation, suffix: &str, of: &str) -> Table {
    let finite = |end: Option<f64>| Cell::known(end.filter(|end| end.is_finite()), number);
    let row = |cell: &crate::view::EvaluationCell| {
        vec![
            Cell::text(&cell.perturbation),
            Cell::number(cell.level, short),
            Cell::number(cell.error, number),
            finite(cell.error_interval.map(|ends| ends.0)),
            finite(cell.error_interval.map(|ends| ends.1)),
            Cell::number(cell.drift, number),
            finite(cell.drift_interval.map(|ends| ends.0)),
            finite(cell.drift_interval.map(|ends| ends.1)),
        ]
    };
    Table {
        name: format!("steering{suffix}"),
        title: format!("Mean absolute steering error and drift, with intervals of 95 %{of}"),
        columns: columns(&[
            "perturbation",
            "level",
            "error",
            "error low",
            "error high",
            "drift",
            "drift low",
            "drift high",
        ]),
        rows: evaluation.cells.iter().map(row).collect(),
    }
}
