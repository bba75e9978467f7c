//! Perturbations by levels: the share that failed, and the mean cross-track error.

use std::collections::{BTreeSet, HashMap};

use pdk_statistics::level::{Trial, fails_at};

use crate::closed_loop::NO_PERTURBATION;
use crate::color::Hue;
use crate::conclusions::{Trials, trials};
use crate::heat::{self, Cell, Columns, Grid, Ramp};
use crate::tally::{Tally, levels};
use crate::text::{number, percent};
use crate::view::{Drive, Scenario};

/// What is in a cell.
struct Counted<'a> {
    /// The perturbation; none for what is not perturbed.
    name: Option<&'a String>,
    /// The column; none if the level is not a single one.
    level: Option<f64>,
    tally: Tally,
    /// Scenarios, also those in which a component failed.
    total: usize,
}

/// The heat maps of a drive: the share that failed, and the mean cross-track error. `chosen` are the levels over which shares are
/// taken where levels were chosen by what failed: then the share at a level is that of all roads on which drives tell it, also drives
/// at other levels. Else a cell counts its drives. `largest` is the error that the darkest colour stands for.
pub fn grids(drive: &Drive, order: &[String], chosen: &[f64], largest: f64) -> (Grid, Grid) {
    let columns = columns(drive, chosen);
    let cells = counted(drive, order, columns, chosen);
    let trials = trials(drive);
    let (mut failed, mut error, mut hues) = (Vec::new(), Vec::new(), Vec::new());
    for Counted { name, level, tally, total } in cells {
        let what = match (name, level) {
            (None, _) => NO_PERTURBATION.to_owned(),
            (Some(name), None) => name.clone(),
            (Some(name), Some(level)) => format!("{name} at level {}", columns.name(level)),
        };
        let void = match total - tally.judged {
            0 => String::new(),
            void => format!("; in {void} a component failed"),
        };
        let title = format!("{what}: {}{void}", tally.told());
        let entry = |cell: Cell| heat::Entry { row: name.cloned(), level, cell };
        let (cause, mark) = cause(&tally);
        hues.push(cause);
        let (text, share, value) = match name.zip(level.filter(|_| !chosen.is_empty())) {
            Some((name, level)) => match share_at(&trials, name, level) {
                Some(share) => (percent(share), share, Some(share)),
                None => ("–".to_owned(), 0.0, None),
            },
            None => {
                let share = tally.share_of_drives();
                (share_of_drives(&tally), share, (tally.judged > 0).then_some(share))
            }
        };
        failed.push(entry(Cell::new(text, title.clone(), cause, share).of(value)));
        // A drive that was cut short has no mean that could be compared: where all were, it is how soon.
        let cell = match (tally.mean_error(), tally.time_to_failure()) {
            (None, None) => Cell::new("–".to_owned(), title, Hue::Distance, 0.0),
            (None, Some(seconds)) => Cell::new(format!("{mark} {} s", number(seconds)), title, cause, 1.0),
            (Some(metres), None) => Cell::new(number(metres), title, Hue::Distance, metres / largest),
            (Some(metres), Some(_)) => Cell {
                mixed: true,
                ..Cell::new(format!("{} {mark}", number(metres)), title, Hue::Distance, metres / largest)
            },
        };
        // What was not driven has no error.
        if total > 0 {
            error.push(entry(cell.of(tally.mean_error())));
        }
    }
    let of_cause =
        |hue: Hue, least: &str, most: &str| hues.contains(&hue).then(|| Ramp::new(hue, least, most));
    let causes = |least: &str| {
        let all = [
            of_cause(Hue::Failed, least, "all failed"),
            of_cause(Hue::Stopped, "", "all stopped"),
            of_cause(Hue::Late, "", "all out of time"),
        ];
        all.into_iter().flatten().collect::<Vec<_>>()
    };
    let distance = Ramp::new(Hue::Distance, "0 m", &format!("{} m", number(largest)));
    let any_failed = drive.scenarios.iter().any(|scenario| scenario.verdict.failed());
    let ends = if any_failed { causes("") } else { Vec::new() };
    (
        columns.grid(&failed, order, causes("none failed")),
        columns.grid(&error, order, [vec![distance], ends].concat()),
    )
}

/// What most of the failures of a cell are, and the mark of these.
fn cause(tally: &Tally) -> (Hue, &'static str) {
    match (2 * tally.stopped > tally.failed, 2 * tally.late > tally.failed) {
        (true, _) => (Hue::Stopped, "■"),
        (_, true) => (Hue::Late, "▷"),
        _ => (Hue::Failed, "✗"),
    }
}

/// The largest mean error in the cells of some drives, which are drawn on one scale. It is not below 1 m, so that small errors look small.
pub fn largest_error<'a>(drives: impl Iterator<Item = &'a Drive>) -> f64 {
    let of = |drive: &Drive| {
        let chosen = levels([drive.scenarios.as_slice()]);
        let cells = counted(drive, &[], columns(drive, &chosen), &chosen);
        cells.iter().filter_map(|cell| cell.tally.mean_error()).fold(1.0, f64::max)
    };
    drives.map(of).fold(1.0, f64::max)
}

/// The columns of a drive's tables.
fn columns(drive: &Drive, chosen: &[f64]) -> Columns {
    match chosen.is_empty() {
        true => Columns::of(drive.scenarios.iter().filter_map(|scenario| scenario.level)),
        false => Columns::Exact,
    }
}

/// The cells with what was driven, in the order in which they come first; then those of chosen levels at which nothing was.
fn counted<'a>(drive: &'a Drive, order: &'a [String], columns: Columns, chosen: &[f64]) -> Vec<Counted<'a>> {
    let mut cells: Vec<Counted<'a>> = Vec::new();
    let mut known: HashMap<(Option<&String>, Option<u64>), usize> = HashMap::new();
    let mut place = |name: Option<&'a String>, level: Option<f64>, scenario: Option<&Scenario>| {
        let place = *known.entry((name, level.map(heat::key))).or_insert_with(|| {
            cells.push(Counted { name, level, tally: Tally::default(), total: 0 });
            cells.len() - 1
        });
        if let Some(scenario) = scenario {
            cells[place].tally.add(scenario);
            cells[place].total += 1;
        }
    };
    for scenario in &drive.scenarios {
        let name = scenario.perturbation.as_ref();
        let level = name.and(scenario.level).map(|level| columns.column(level));
        if level.is_none_or(|level| chosen.is_empty() || chosen.contains(&level)) {
            place(name, level, Some(scenario));
        }
    }
    let leveled: BTreeSet<&String> = drive
        .scenarios
        .iter()
        .filter(|s| s.level.is_some())
        .filter_map(|s| s.perturbation.as_ref())
        .collect();
    for name in order.iter().filter(|name| leveled.contains(name)) {
        chosen.iter().for_each(|level| place(Some(name), Some(*level), None));
    }
    cells
}

/// What a cell says of its drives.
fn share_of_drives(tally: &Tally) -> String {
    match (tally.judged, tally.failed, tally.stopped, tally.late) {
        (0, ..) => "–".to_owned(),
        (1, 0, ..) => "ok".to_owned(),
        (1, _, 1, _) => "stopped".to_owned(),
        (1, _, _, 1) => "late".to_owned(),
        (1, ..) => "failed".to_owned(),
        (judged, failed, 0, 0) => format!("{failed}/{judged}"),
        (judged, failed, stopped, 0) => format!("{failed}/{judged} ({stopped} st.)"),
        (judged, failed, 0, late) => format!("{failed}/{judged} ({late} late)"),
        (judged, failed, stopped, late) => format!("{failed}/{judged} ({stopped} st., {late} late)"),
    }
}

/// The share of roads on which a perturbation makes the driver fail at a level, as far as drives tell; several under different luck on
/// a road count by their mean.
fn share_at(trials: &Trials<'_>, name: &str, level: f64) -> Option<f64> {
    let mean =
        |values: &[f64]| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
    let of = |trials: &Vec<Trial>| Some(f64::from(u8::from(fails_at(trials, level)?)));
    let roads = trials.iter().filter(|((of, _), _)| *of == name);
    let shares: Vec<f64> =
        roads.filter_map(|(_, seeds)| mean(&seeds.values().filter_map(of).collect::<Vec<_>>())).collect();
    mean(&shares)
}
