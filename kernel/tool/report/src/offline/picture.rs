//! The picture of what each perturbation does to predictions at the level at which it does most.

use std::collections::BTreeMap;

use crate::color::LINES;
use crate::offline::by_severity;
use crate::road::round_step;
use crate::text::{number, short};
use crate::tracks::{self, Row, Track, Tracks};
use crate::view::{Evaluation, EvaluationCell};

/// Lines of the scale.
const TICKS: f64 = 4.0;

/// The picture of some evaluations on one scale; none if there are none, or more than there are colours.
pub fn picture(evaluations: &[Evaluation]) -> Option<Tracks> {
    let cells = || evaluations.iter().flat_map(|evaluation| &evaluation.cells);
    if evaluations.len() > LINES.len() || cells().next().is_none() {
        return None;
    }
    // If one has no recorded steering, only drifts can be compared.
    let by_drift = cells().any(|cell| cell.error.is_nan());
    let value = |cell: &EvaluationCell| if by_drift { cell.drift } else { cell.error };
    let ends = |cell: &EvaluationCell| {
        let interval = if by_drift { cell.drift_interval } else { cell.error_interval };
        interval.filter(|(low, high)| low.is_finite() && high.is_finite())
    };
    let worst: Vec<BTreeMap<&str, &EvaluationCell>> = evaluations
        .iter()
        .map(|evaluation| {
            let mut worst: BTreeMap<&str, &EvaluationCell> = BTreeMap::new();
            for cell in &evaluation.cells {
                let known = worst.entry(&cell.perturbation).or_insert(cell);
                if value(cell) > value(known) {
                    *known = cell;
                }
            }
            worst
        })
        .collect();
    let largest = worst.iter().flat_map(BTreeMap::values).map(|cell| ends(cell).map_or(value(cell), |e| e.1));
    let step = round_step(largest.fold(0.0, f64::max) / TICKS);
    let end = step * TICKS;
    let place = |value: f64| tracks::place(value, end, false);
    let mut names: Vec<(f64, String)> = Vec::new();
    for name in evaluations.iter().flat_map(by_severity) {
        if !names.iter().any(|(_, known)| *known == name) {
            let values = worst.iter().filter_map(|of| of.get(name.as_str())).map(|cell| value(cell));
            names.push((values.fold(0.0, f64::max), name));
        }
    }
    names.sort_by(|a, b| b.0.total_cmp(&a.0));
    let track = |cell: &EvaluationCell, evaluation: &Evaluation| {
        let (low, high) = ends(cell).unwrap_or((value(cell), value(cell)));
        let interval = match ends(cell) {
            Some(_) => format!("{} to {}", number(low), number(high)),
            None => String::new(),
        };
        let sure = if interval.is_empty() { String::new() } else { format!(" (95 %: {interval})") };
        let driver = if evaluation.driver.is_empty() { "" } else { ", " };
        Track {
            at: Some(place(value(cell))),
            low: place(low),
            high: place(high),
            is_open: false,
            is_reached: true,
            text: format!("{} at level {}", number(value(cell)), short(cell.level)),
            interval,
            sentence: format!(
                "{}{driver}{}: {} at level {}{sure}",
                cell.perturbation,
                evaluation.driver,
                number(value(cell)),
                short(cell.level)
            ),
        }
    };
    let rows = names.into_iter().map(|(_, name)| Row {
        tracks: worst
            .iter()
            .zip(evaluations)
            .map(|(of, evaluation)| of.get(name.as_str()).map(|cell| track(cell, evaluation)))
            .collect(),
        label: name,
    });
    let rows = rows.collect();
    let original = match evaluations {
        [one] if !by_drift && one.original_error.is_finite() => Some(one.original_error),
        _ => None,
    };
    let measure = if by_drift { "drift from the steering without perturbation" } else { "steering error" };
    Some(Tracks {
        title: format!("Mean absolute {measure} at the worst level of each perturbation, the worst first"),
        note: match original {
            Some(error) => format!(
                "A dot is the mean over frames, a bar its interval of 95 %, and the line the error without perturbation, {}.",
                number(error)
            ),
            None => "A dot is the mean over frames, a bar its interval of 95 %.".to_owned(),
        },
        scale: measure.to_owned(),
        ticks: (0..=TICKS as u32)
            .map(|number| step * f64::from(number))
            .map(|value| (short(value), place(value)))
            .collect(),
        beyond: None,
        reference: original.map(|error| (format!("without perturbation: {}", number(error)), place(error))),
        series: match evaluations {
            [_] => Vec::new(),
            _ => evaluations
                .iter()
                .zip('A'..)
                .zip(LINES)
                .map(|((evaluation, key), color)| (key.to_string(), evaluation.driver.clone(), color))
                .collect(),
        },
        rows,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evaluation(driver: &str, errors: &[(&str, f64, f64)]) -> Evaluation {
        let cell = |(name, level, error): &(&str, f64, f64)| EvaluationCell {
            perturbation: (*name).to_owned(),
            level: *level,
            error: *error,
            drift: 2.0 * error,
            error_interval: Some((error / 2.0, 2.0 * error)),
            drift_interval: None,
            frames: Vec::new(),
        };
        Evaluation {
            driver: driver.into(),
            original_error: 0.1,
            cells: errors.iter().map(cell).collect(),
            ..Evaluation::default()
        }
    }

    #[test]
    fn each_perturbation_is_shown_at_its_worst_level_on_one_scale() {
        let one = evaluation("a", &[("fog", 1.0, 0.3), ("fog", 4.0, 0.2), ("rain", 4.0, 0.4)]);
        let picture = picture(std::slice::from_ref(&one)).unwrap();
        let texts: Vec<&str> = picture
            .rows
            .iter()
            .flat_map(|row| &row.tracks)
            .flatten()
            .map(|track| track.text.as_str())
            .collect();
        assert_eq!(texts, ["0.400 at level 4", "0.300 at level 1"]);
        assert_eq!(picture.rows[0].tracks[0].as_ref().unwrap().interval, "0.200 to 0.800");
        assert_eq!(picture.reference.as_ref().unwrap().0, "without perturbation: 0.100");
        let other = evaluation("b", &[("rain", 4.0, 0.8)]);
        let both = super::picture(&[one, other]).unwrap();
        let at = |row: usize, of: usize| both.rows[row].tracks[of].as_ref().unwrap().high;
        assert!(at(0, 1) > at(0, 0) && both.series.len() == 2 && both.reference.is_none());
    }

    #[test]
    fn without_recorded_steering_drifts_are_shown() {
        let mut one = evaluation("a", &[("fog", 1.0, 0.3)]);
        one.cells[0].error = f64::NAN;
        let picture = picture(&[one]).unwrap();
        assert!(
            picture.title.contains("drift")
                && picture.rows[0].tracks[0].as_ref().unwrap().interval.is_empty()
        );
        assert!(super::picture(&[]).is_none());
    }
}
