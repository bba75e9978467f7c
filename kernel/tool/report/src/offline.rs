//! What perturbations do to predictions on a recording.

pub mod compare;
pub mod picture;
pub mod verdict;

use std::collections::HashMap;

use pdk_sdk::error::Result;
use serde::Serialize;

use crate::color::{Hue, LINES, NOMINAL};
use crate::curve::{Axes, Chart, Curve, chart};
use crate::heat::{self, Cell, Columns, Entry, Grid, Ramp};
use crate::text::{self, number};
use crate::view::{Evaluation, EvaluationCell};

/// Perturbations that have a curve of their own.
const CURVES: usize = 7;

/// What the page says about an evaluation.
#[derive(Debug, Serialize)]
pub struct Section {
    pub number: u64,
    pub driver: String,
    dataset: String,
    frames: usize,
    original_error: String,
    bad_frames: Vec<(String, String)>,
    pub error: Grid,
    pub drift: Grid,
    pub curves: Vec<Chart>,
    worst: Vec<WorstRow>,
}

#[derive(Debug, Serialize)]
struct WorstRow {
    frame: String,
    perturbation: String,
    level: String,
    truth: String,
    original: String,
    perturbed: String,
    worse: String,
}

impl EvaluationCell {
    /// What tells how much harm it does: the error, or the drift if no steering was recorded.
    fn harm(&self) -> f64 {
        if self.error.is_nan() { self.drift } else { self.error }
    }
}

/// The perturbations, the one with the largest mean error over its levels first.
fn by_severity(evaluation: &Evaluation) -> Vec<String> {
    let mut order: Vec<(String, f64, usize)> = Vec::new();
    for cell in &evaluation.cells {
        match order.iter_mut().find(|(name, ..)| *name == cell.perturbation) {
            Some((_, sum, count)) => {
                *sum += cell.harm();
                *count += 1;
            }
            None => order.push((cell.perturbation.clone(), cell.harm(), 1)),
        }
    }
    order.sort_by(|a, b| (b.1 / b.2 as f64).total_cmp(&(a.1 / a.2 as f64)));
    order.into_iter().map(|(name, ..)| name).collect()
}

/// What the colours and axes of all evaluations of a run stand for, so that they can be compared.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    /// The largest error of a cell, and without perturbation.
    error: f64,
    /// The largest drift of a cell.
    drift: f64,
    /// The largest error at a level.
    top: f64,
    /// The lowest and the highest level.
    levels: (f64, f64),
}

impl Scale {
    /// That of these evaluations.
    pub fn of(evaluations: &[Evaluation]) -> Self {
        let largest = |value: fn(&EvaluationCell) -> f64| {
            let means = evaluations
                .iter()
                .flat_map(|evaluation| Means::of(evaluation, |cell| (value(cell), None)).values());
            means.fold(0.0, f64::max)
        };
        let cells = || evaluations.iter().flat_map(|evaluation| &evaluation.cells);
        let levels = || cells().map(|cell| cell.level);
        let original = evaluations.iter().map(|evaluation| evaluation.original_error).fold(0.0, f64::max);
        Self {
            error: largest(|cell| cell.error).max(original),
            drift: largest(|cell| cell.drift),
            top: cells().map(|cell| cell.error).fold(original, f64::max),
            levels: (levels().fold(f64::INFINITY, f64::min), levels().fold(f64::NEG_INFINITY, f64::max)),
        }
    }
}

/// All that the page says about an evaluation.
///
/// # Errors
/// If a picture cannot be drawn.
pub fn section(evaluation: &Evaluation, scale: &Scale) -> Result<Section> {
    let order = by_severity(evaluation);
    Ok(Section {
        number: evaluation.number,
        driver: evaluation.driver.clone(),
        dataset: evaluation.dataset.clone(),
        frames: evaluation.frames,
        original_error: number(evaluation.original_error),
        bad_frames: evaluation.bad_frames.clone(),
        error: heat_map(
            &Means::of(evaluation, |cell| (cell.error, cell.error_interval)),
            &order,
            Some(evaluation.original_error),
            scale.error,
        ),
        drift: heat_map(
            &Means::of(evaluation, |cell| (cell.drift, cell.drift_interval)),
            &order,
            None,
            scale.drift,
        ),
        curves: curves(evaluation, &order, scale)?,
        worst: evaluation
            .worst
            .iter()
            .map(|worst| WorstRow {
                frame: worst.frame.clone(),
                perturbation: worst.perturbation.clone(),
                level: text::short(worst.level),
                truth: number(worst.truth),
                original: number(worst.original),
                perturbed: number(worst.perturbed),
                worse: number((worst.perturbed - worst.truth).abs() - (worst.original - worst.truth).abs()),
            })
            .collect(),
    })
}

/// The mean of a value in each cell of a table.
struct Means<'a> {
    columns: Columns,
    /// The row and the column of each, with the sum and the count of what goes into it, in the order in which these come.
    places: Vec<(&'a str, f64, f64, usize)>,
    /// The interval of one that is alone in its place.
    intervals: Vec<Option<(f64, f64)>>,
}

impl<'a> Means<'a> {
    fn of(evaluation: &'a Evaluation, value: impl Fn(&EvaluationCell) -> (f64, Option<(f64, f64)>)) -> Self {
        let columns = Columns::of(evaluation.cells.iter().map(|cell| cell.level));
        let mut places: Vec<(&str, f64, f64, usize)> = Vec::new();
        let mut intervals: Vec<Option<(f64, f64)>> = Vec::new();
        let mut known: HashMap<(&str, u64), usize> = HashMap::new();
        for cell in &evaluation.cells {
            let column = columns.column(cell.level);
            let place = *known.entry((&cell.perturbation, heat::key(column))).or_insert_with(|| {
                places.push((&cell.perturbation, column, 0.0, 0));
                intervals.push(None);
                places.len() - 1
            });
            let (value, interval) = value(cell);
            places[place].2 += value;
            places[place].3 += 1;
            intervals[place] = interval.filter(|_| places[place].3 == 1);
        }
        Self { columns, places, intervals }
    }

    /// The means.
    fn values(&self) -> Vec<f64> {
        self.places.iter().map(|(.., sum, count)| sum / *count as f64).collect()
    }
}

/// A table of means; `largest` is what its darkest colour stands for.
fn heat_map(means: &Means<'_>, order: &[String], nominal: Option<f64>, largest: f64) -> Grid {
    let cell = |value: f64, what: String| {
        let share = if largest > 0.0 { value / largest } else { 0.0 };
        Cell::new(number(value), format!("{what}: {}", number(value)), Hue::Distance, share).of(Some(value))
    };
    let mut entries: Vec<Entry> = means
        .places
        .iter()
        .zip(means.values())
        .zip(&means.intervals)
        .map(|(((perturbation, column, ..), mean), interval)| {
            let interval = interval.map_or_else(String::new, |(low, high)| {
                format!(" (95 %: {} to {})", number(low), number(high))
            });
            let level = means.columns.name(*column);
            Entry {
                row: Some((*perturbation).to_owned()),
                level: Some(*column),
                cell: cell(mean, format!("{perturbation} at level {level}{interval}")),
            }
        })
        .collect();
    entries.extend(nominal.map(|value| Entry {
        row: None,
        level: None,
        cell: cell(value, "without perturbation".to_owned()),
    }));
    means.columns.grid(&entries, order, vec![Ramp::new(Hue::Distance, "0", &number(largest))])
}

/// The error over the level for the worst perturbations, with that of the original frames.
fn curves(evaluation: &Evaluation, order: &[String], scale: &Scale) -> Result<Vec<Chart>> {
    let Scale { top, levels: (low, high), .. } = *scale;
    // Over a single level there is no course.
    if !(low < high && top > 0.0) {
        return Ok(Vec::new());
    }
    let original = evaluation.original_error;
    let mut curves = vec![Curve {
        key: "–".to_owned(),
        name: "no perturbation".to_owned(),
        points: vec![(low, original), (high, original)],
        band: Vec::new(),
        color: NOMINAL,
    }];
    for ((name, color), key) in order.iter().take(CURVES).zip(LINES).zip('A'..) {
        let own = evaluation.cells.iter().filter(|cell| cell.perturbation == *name);
        let mut points: Vec<_> = own.map(|cell| (cell.level, cell.error)).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        curves.push(Curve { key: key.to_string(), name: name.clone(), points, band: Vec::new(), color });
    }
    let axes = Axes {
        x: "level",
        x_range: (low, high),
        y: "steering error",
        top,
        share: false,
        label: "Mean absolute steering error over the level",
    };
    Ok(vec![chart(&curves, &axes)?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::verdict::verdict;

    fn evaluation() -> Evaluation {
        let cell = |name: &str, level: f64, error: f64| EvaluationCell {
            perturbation: name.to_owned(),
            level,
            error,
            drift: error / 2.0,
            drift_interval: Some((error / 4.0, error)),
            ..EvaluationCell::default()
        };
        Evaluation {
            frames: 3,
            bad_frames: vec![("a.jpg".into(), "it is empty".into())],
            original_error: 0.1,
            cells: vec![
                cell("fog", 0.0, 0.1),
                cell("fog", 4.0, 0.2),
                cell("rain", 0.0, 0.3),
                cell("rain", 4.0, 0.4),
            ],
            ..Evaluation::default()
        }
    }

    /// The section about a single evaluation.
    fn alone(evaluation: &Evaluation) -> Section {
        section(evaluation, &Scale::of(std::slice::from_ref(evaluation))).unwrap()
    }

    #[test]
    fn two_networks_are_named_and_drawn_on_one_scale() {
        let (mut first, mut second) = (evaluation(), evaluation());
        first.driver = "onnx (model=a.onnx)".to_owned();
        second.driver = "onnx (model=b.onnx)".to_owned();
        second
            .cells
            .iter_mut()
            .for_each(|cell| (cell.error, cell.drift) = (4.0 * cell.error, 3.0 * cell.drift));
        let scale = Scale::of(&[first.clone(), second.clone()]);
        let (mild, strong) = (section(&first, &scale).unwrap(), section(&second, &scale).unwrap());
        assert_eq!((&*mild.driver, &*strong.driver), ("onnx (model=a.onnx)", "onnx (model=b.onnx)"));
        for (mild, strong) in [(&mild.error, &strong.error), (&mild.drift, &strong.drift)] {
            assert_eq!(mild.legend, strong.legend);
            assert_ne!(
                mild.rows[0].cells[1].as_ref().unwrap().shade,
                strong.rows[0].cells[1].as_ref().unwrap().shade
            );
        }
        // A value has one colour in both: rain at level 4 of the first is as much as fog at level 0 of the second.
        let ground = |section: &Section, row: usize, column: usize| {
            section.error.rows[row].cells[column].as_ref().unwrap().shade
        };
        assert_eq!(ground(&mild, 0, 1), ground(&strong, 1, 0));
        let sentences = verdict(&[first, second]);
        assert!(
            sentences[3].starts_with("With onnx (model=b.onnx), 3 frames were evaluated"),
            "{sentences:?}"
        );
        assert!(
            sentences[1].starts_with("With onnx (model=b.onnx), the worst perturbation is rain: at level 4"),
            "{sentences:?}"
        );
    }

    #[test]
    fn two_sentences_say_what_came_out() {
        assert_eq!(
            verdict(&[evaluation()]),
            [
                "The worst perturbation is rain: at level 4 the steering is off by 0.400, 4.0 times as much as without.",
                "3 frames were evaluated under 2 perturbations (1 frame was left out); without perturbation the steering \
                 is off by 0.100 on average.",
            ]
        );
    }

    #[test]
    fn a_driver_that_is_worse_than_a_constant_is_named_first() {
        let evaluation = Evaluation { frames: 40, constant_error: 0.05, ..evaluation() };
        assert_eq!(
            verdict(std::slice::from_ref(&evaluation))[0],
            "The driver is worse than a constant on the frames as they are (0.100 against 0.050 on average), so what perturbations do to \
             it says nothing."
        );
    }

    #[test]
    fn the_worst_perturbation_comes_first_in_both_tables() {
        let section = alone(&evaluation());
        for (grid, first) in [(&section.error, "0.300"), (&section.drift, "0.150")] {
            assert_eq!(grid.columns, ["0", "4"].map(|level| Some(level.to_owned())));
            assert_eq!(grid.rows[0].label, "rain");
            assert_eq!(grid.rows[0].cells[0].as_ref().unwrap().text, first);
        }
        assert_eq!(section.error.nominal.unwrap().text, "0.100");
        assert!(section.drift.nominal.is_none());
        let title = &section.drift.rows[0].cells[1].as_ref().unwrap().title;
        assert_eq!(title, "rain at level 4 (95 %: 0.100 to 0.400): 0.200");
        assert_eq!(section.curves[0].legend.len(), 3);
    }

    #[test]
    fn a_recording_without_steering_is_ordered_by_drift() {
        let mut evaluation = evaluation();
        evaluation.original_error = f64::NAN;
        evaluation.cells.iter_mut().for_each(|cell| cell.error = f64::NAN);
        assert_eq!(
            verdict(std::slice::from_ref(&evaluation)),
            [
                "The worst perturbation is rain: at level 4 the steering drifts by 0.200 (95 %: 0.100 to 0.400).",
                "3 frames were evaluated under 2 perturbations (1 frame was left out); no steering was recorded to compare \
                 with.",
            ]
        );
        assert_eq!(alone(&evaluation).drift.rows[0].label, "rain");
    }

    #[test]
    fn a_column_of_many_levels_has_their_mean() {
        let mut evaluation = evaluation();
        let cell = |place: u32| EvaluationCell {
            perturbation: "fog".into(),
            level: f64::from(place) / 10.0,
            error: f64::from(place),
            ..EvaluationCell::default()
        };
        evaluation.cells = (0..=40).map(cell).collect();
        let grid = alone(&evaluation).error;
        assert_eq!(grid.columns.len(), 5);
        assert_eq!(grid.columns[3].as_deref(), Some("3 to below 4"));
        let cells: Vec<&str> = grid.rows[0].cells.iter().flatten().map(|cell| cell.text.as_str()).collect();
        assert_eq!(cells, ["4.50", "14.5", "24.5", "34.5", "40.0"]);
        assert_eq!(grid.rows[0].cells[3].as_ref().unwrap().title, "fog at level 3 to below 4: 34.5");
    }

    #[test]
    fn a_single_level_has_no_course() {
        let mut evaluation = evaluation();
        evaluation.cells.retain(|cell| cell.level == 0.0);
        assert!(alone(&evaluation).curves.is_empty());
    }
}
