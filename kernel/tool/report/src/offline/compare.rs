//! Two drivers on the same frames of a recording: by how much their errors differ, and how sure that is.

use std::collections::{BTreeMap, BTreeSet};

use pdk_statistics::{CONFIDENCE, Estimate, blocks, paired};
use serde::Serialize;

use crate::color::Hue;
use crate::heat::{self, Cell, Columns, Entry, Grid, Ramp};
use crate::offline::by_severity;
use crate::text::{count, number, percent, signed};
use crate::view::{Evaluation, EvaluationCell};

/// A driver beside the one that it is compared with.
#[derive(Debug, Serialize)]
pub struct Comparison {
    /// The driver that is compared with.
    pub base: String,
    /// The driver that is compared.
    pub other: String,
    /// The recording.
    dataset: String,
    /// What is compared: the error, or the drift if no steering was recorded.
    pub measure: &'static str,
    /// The error of the other less that of the base.
    pub grid: Grid,
    /// Rows of the table: all perturbations together, and each.
    pub rows: Vec<Row>,
}

/// A perturbation over all levels that both drivers have.
#[derive(Debug, Serialize)]
pub struct Row {
    /// The perturbation; all together if it is the first row.
    pub perturbation: String,
    base: String,
    other: String,
    difference: String,
    interval: String,
    effect_size: String,
    worse: String,
    /// The figures behind the texts.
    #[serde(skip)]
    pub figures: Figures,
}

/// How two drivers differ on the frames that both have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    /// The mean error of each.
    pub base: f64,
    /// That of the driver that is compared.
    pub other: f64,
    /// The second less the first, with its interval; infinite if the frames are too few.
    pub difference: Estimate,
    /// The rank-biserial correlation over frames: positive if the other is further off.
    pub effect_size: f64,
    /// The share of frames on which the other is further off.
    pub worse: f64,
    /// Frames that both have.
    pub frames: usize,
}

impl Figures {
    /// Whether the frames say how sure the difference is.
    fn is_known(&self) -> bool {
        self.difference.low.is_finite() && self.difference.high.is_finite()
    }

    fn interval(&self) -> String {
        match self.is_known() {
            true => format!("{} to {}", signed(self.difference.low), signed(self.difference.high)),
            false => String::new(),
        }
    }
}

/// The evaluations that are compared: each with the first on the same recording, if that is one of another driver.
pub fn pairs(evaluations: &[Evaluation]) -> Vec<(&Evaluation, &Evaluation)> {
    let first =
        |evaluation: &Evaluation| evaluations.iter().find(|first| first.dataset == evaluation.dataset);
    let pair = |evaluation| Some((first(evaluation)?, evaluation));
    let differ = |(first, evaluation): &(&Evaluation, &Evaluation)| first.driver != evaluation.driver;
    evaluations.iter().filter_map(pair).filter(differ).collect()
}

/// How two drivers differ under these perturbations, or under all, and at this level, or at all. Each frame has the mean over what both
/// have of it, and frames that follow each other resemble each other. None if both have no frame.
pub fn differ(
    base: &Evaluation,
    other: &Evaluation,
    wanted: impl Fn(&EvaluationCell) -> bool,
) -> Option<Figures> {
    let cells = |evaluation: &Evaluation| -> BTreeMap<(String, u64), Vec<(usize, f64)>> {
        let own = evaluation.cells.iter().filter(|cell| wanted(cell));
        own.map(|cell| ((cell.perturbation.clone(), heat::key(cell.level)), cell.frames.clone())).collect()
    };
    let theirs = cells(base);
    // The sums of both over what both have of a frame, and how much that is.
    let mut frames: BTreeMap<usize, (f64, f64, f64)> = BTreeMap::new();
    for (cell, ours) in cells(other) {
        let Some(theirs) = theirs.get(&cell) else { continue };
        let known: BTreeMap<usize, f64> = theirs.iter().copied().collect();
        for (frame, ours) in ours {
            if let Some(theirs) = known.get(&frame) {
                let sums = frames.entry(frame).or_default();
                *sums = (sums.0 + theirs, sums.1 + ours, sums.2 + 1.0);
            }
        }
    }
    let means: Vec<(f64, f64)> = frames.values().map(|(a, b, count)| (a / count, b / count)).collect();
    let differences: Vec<f64> = means.iter().map(|(base, other)| other - base).collect();
    let difference = blocks::mean(&differences, blocks::length(&differences), CONFIDENCE)?;
    let mean = |of: fn(&(f64, f64)) -> f64| means.iter().map(of).sum::<f64>() / means.len() as f64;
    Some(Figures {
        base: mean(|means| means.0),
        other: mean(|means| means.1),
        difference,
        effect_size: paired::effect_size(&differences),
        worse: differences.iter().filter(|difference| **difference > 0.0).count() as f64 / means.len() as f64,
        frames: means.len(),
    })
}

/// What two drivers differ by; none if they have no frame under the same perturbation at the same level.
pub fn comparison(base: &Evaluation, other: &Evaluation) -> Option<Comparison> {
    let row = |perturbation: &str, figures: Figures| Row {
        perturbation: perturbation.to_owned(),
        base: number(figures.base),
        other: number(figures.other),
        difference: signed(figures.difference.value),
        interval: figures.interval(),
        effect_size: format!("{:.2}", figures.effect_size),
        worse: percent(figures.worse),
        figures,
    };
    let all = row("all", differ(base, other, |_| true)?);
    let names = shared(base, other);
    let single = names
        .iter()
        .filter_map(|name| Some(row(name, differ(base, other, |cell| cell.perturbation == *name)?)));
    Some(Comparison {
        base: base.driver.clone(),
        other: other.driver.clone(),
        dataset: other.dataset.clone(),
        measure: measure(base, other),
        grid: grid(base, other, &names),
        rows: std::iter::once(all).chain(single).collect(),
    })
}

/// The perturbations that both have, the worst first.
fn shared(base: &Evaluation, other: &Evaluation) -> Vec<String> {
    let known: BTreeSet<String> = base.cells.iter().map(|cell| cell.perturbation.clone()).collect();
    by_severity(other).into_iter().filter(|name| known.contains(name)).collect()
}

fn measure(base: &Evaluation, other: &Evaluation) -> &'static str {
    let unknown = |evaluation: &Evaluation| evaluation.cells.iter().any(|cell| cell.error.is_nan());
    match unknown(base) || unknown(other) {
        true => "drift from the steering without perturbation",
        false => "steering error",
    }
}

fn grid(base: &Evaluation, other: &Evaluation, names: &[String]) -> Grid {
    let columns = Columns::of(other.cells.iter().map(|cell| cell.level));
    let mut found = Vec::new();
    for name in names {
        let of_name = other.cells.iter().filter(|cell| cell.perturbation == *name);
        let places: BTreeMap<u64, f64> = of_name
            .map(|cell| columns.column(cell.level))
            .map(|column| (heat::key(column), column))
            .collect();
        for (key, column) in places {
            let wanted = |cell: &EvaluationCell| {
                cell.perturbation == *name && heat::key(columns.column(cell.level)) == key
            };
            found.extend(differ(base, other, wanted).map(|figures| (name, column, figures)));
        }
    }
    let largest = found.iter().map(|(.., figures)| figures.difference.value.abs()).fold(0.0, f64::max);
    let entries: Vec<Entry> = found
        .iter()
        .map(|(name, column, figures)| {
            let value = figures.difference.value;
            let interval = figures.interval();
            let sure = if interval.is_empty() {
                String::new()
            } else {
                format!(", 95 % of the difference: {interval}")
            };
            let title = format!(
                "{name} at level {}: {} is off by {}, {} by {}{sure}",
                columns.name(*column),
                base.driver,
                number(figures.base),
                other.driver,
                number(figures.other)
            );
            let hue = if value > 0.0 { Hue::Failed } else { Hue::Better };
            let share = if largest > 0.0 { value.abs() / largest } else { 0.0 };
            let cell = Cell::new(signed(value), title, hue, share).of(Some(value));
            Entry { row: Some((*name).clone()), level: Some(*column), cell }
        })
        .collect();
    let legend = vec![
        Ramp::new(Hue::Better, "no difference", &format!("less by {}", number(largest))),
        Ramp::new(Hue::Failed, "no difference", &format!("more by {}", number(largest))),
    ];
    columns.grid(&entries, names, legend)
}

/// Whether the other driver steers better or worse, as a sentence; none if nothing can be compared.
pub fn sentence(base: &Evaluation, other: &Evaluation) -> Option<String> {
    let figures = differ(base, other, |_| true)?;
    let (ours, theirs) = (&other.driver, &base.driver);
    let by = measure(base, other);
    let told = format!(
        "under perturbations the mean {by} of {ours} is {} and that of {theirs} {}",
        number(figures.other),
        number(figures.base)
    );
    let frames = count(figures.frames, "frame");
    if !figures.is_known() {
        return Some(format!(
            "{frames} are too few to say whether {ours} steers better than {theirs}: {told}."
        ));
    }
    let sure =
        format!("difference {}, 95 %: {}, {frames}", signed(figures.difference.value), figures.interval());
    Some(match (figures.difference.low > 0.0, figures.difference.high < 0.0) {
        (true, _) => format!("{ours} steers worse than {theirs}: {told} ({sure})."),
        (_, true) => format!("{ours} steers better than {theirs}: {told} ({sure})."),
        _ => format!("{ours} and {theirs} cannot be told apart: {told} ({sure})."),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors on 60 frames under two perturbations; `more` is what they are larger by under fog.
    fn evaluation(driver: &str, more: f64, frames: usize) -> Evaluation {
        let cell = |name: &str, level: f64, more: f64| {
            let frames: Vec<(usize, f64)> = (0..frames)
                .map(|frame| (frame, 0.1 * level + more + 0.01 * f64::from((frame * 7 % 5) as u32)))
                .collect();
            EvaluationCell {
                perturbation: name.to_owned(),
                level,
                error: frames.iter().map(|frame| frame.1).sum::<f64>() / frames.len() as f64,
                frames,
                ..EvaluationCell::default()
            }
        };
        Evaluation {
            driver: driver.into(),
            dataset: "tape".into(),
            frames,
            cells: vec![cell("fog", 1.0, more), cell("fog", 2.0, more), cell("rain", 1.0, 0.0)],
            ..Evaluation::default()
        }
    }

    #[test]
    fn frames_are_paired_and_a_sentence_says_which_one_is_better() {
        let (a, b) = (evaluation("a", 0.0, 60), evaluation("b", 0.3, 60));
        let found = comparison(&a, &b).unwrap();
        let rows: Vec<[&str; 4]> = found
            .rows
            .iter()
            .map(|row| [&*row.perturbation, &*row.difference, &*row.effect_size, &*row.worse])
            .collect();
        let expected = [
            ["all", "+0.200", "1.00", "100 %"],
            ["fog", "+0.300", "1.00", "100 %"],
            ["rain", "0.000", "0.00", "0 %"],
        ];
        assert_eq!(rows, expected);
        let texts: Vec<&str> = found
            .grid
            .rows
            .iter()
            .flat_map(|row| &row.cells)
            .flatten()
            .map(|cell| cell.text.as_str())
            .collect();
        assert_eq!(texts, ["+0.300", "+0.300", "0.000"]);
        let worse = sentence(&a, &b).unwrap();
        assert!(
            worse.starts_with("b steers worse than a: under perturbations the mean steering error of b is"),
            "{worse}"
        );
        assert!(worse.ends_with("(difference +0.200, 95 %: +0.200 to +0.200, 60 frames)."), "{worse}");
        assert!(sentence(&b, &a).unwrap().starts_with("a steers better than b"));
        assert!(sentence(&a, &evaluation("c", 0.0, 60)).unwrap().starts_with("c and a cannot be told apart"));
    }

    #[test]
    fn a_column_of_several_levels_has_their_mean_difference() {
        let [a, b] = [0.0, 1.0].map(|slope| {
            let mut evaluation = evaluation("a", 0.0, 60);
            let one = evaluation.cells.remove(0);
            let at = |tenth: u32| {
                let level = f64::from(tenth) / 10.0;
                let frames =
                    one.frames.iter().map(|(frame, error)| (*frame, error + slope * level)).collect();
                EvaluationCell { level, frames, ..one.clone() }
            };
            evaluation.cells = (0..41).map(at).collect();
            evaluation
        });
        let grid = grid(&a, &b, &["fog".to_owned()]);
        let found: Vec<f64> = grid.rows[0].cells.iter().flatten().filter_map(|cell| cell.value).collect();
        let close = |(found, expected): (&f64, f64)| (found - expected).abs() < 1e-9;
        assert!(found.len() == 5 && found.iter().zip([0.45, 1.45, 2.45, 3.45, 4.0]).all(close), "{found:?}");
    }

    #[test]
    fn only_what_both_have_is_compared() {
        let (a, mut b) = (evaluation("a", 0.0, 60), evaluation("b", 0.3, 60));
        // The first half of the frames could not be read, and one perturbation is another.
        b.cells.iter_mut().for_each(|cell| cell.frames.retain(|(frame, _)| *frame >= 30));
        b.cells[2].perturbation = "snow".into();
        let figures = differ(&a, &b, |_| true).unwrap();
        assert_eq!(figures.frames, 30);
        assert!((figures.difference.value - 0.3).abs() < 1e-12);
        assert_eq!(comparison(&a, &b).unwrap().rows.len(), 2);
        b.cells.truncate(0);
        assert!(comparison(&a, &b).is_none() && sentence(&a, &b).is_none());
    }

    #[test]
    fn few_frames_say_nothing_and_other_recordings_are_not_compared() {
        let (a, b) = (evaluation("a", 0.0, 2), evaluation("b", 0.3, 2));
        assert!(
            sentence(&a, &b)
                .unwrap()
                .starts_with("2 frames are too few to say whether b steers better than a")
        );
        let all = [
            a.clone(),
            b.clone(),
            Evaluation { dataset: "other".into(), ..b.clone() },
            Evaluation { driver: "a".into(), ..b },
        ];
        let names: Vec<(&str, &str)> =
            pairs(&all).iter().map(|(a, b)| (a.driver.as_str(), b.driver.as_str())).collect();
        assert_eq!(names, [("a", "b")]);
    }
}
