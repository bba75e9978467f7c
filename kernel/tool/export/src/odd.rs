//! A record seen as an operational design domain: which of its attributes were driven, which failed, and which are open. As JSON for other
//! programs, and as a page.

use std::collections::{BTreeMap, BTreeSet};

use minijinja::{AutoEscape, Environment, UndefinedBehavior, context};
use pdk_model::level_scale::LevelScale;
use pdk_model::outcome::Verdict;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_record::ledger::Line;
use pdk_report::Evaluation;
use pdk_report::named::Named;
use pdk_sdk::error::{Error, Result};
use pdk_statistics::CONFIDENCE;
use pdk_statistics::drives::{Drives, share_over_roads};
use serde::Serialize;

use crate::domain::{Domain, Item, Meaning};

/// What the page and the file do not say.
const CLAIM: &str = "This page sorts what pdk drove by attributes of an operational design domain as ISO 34503:2023 sorts them, and by conditions that may \
                     trigger an insufficiency of a function that sees through a camera, as the analysis in clause 7 of ISO 21448:2022 looks for them. The names and the \
                     mapping are pdk's own. It claims no conformity with either standard, and a simulated perturbation is not the condition itself.";

/// A record seen as an operational design domain.
#[derive(Debug, Serialize)]
pub struct Odd {
    /// The version of this form.
    pub format: u32,
    /// What it does not claim.
    pub claim: &'static str,
    /// The record.
    pub record: String,
    /// The drivers.
    pub drivers: Vec<String>,
    /// Attributes of an operational design domain, sorted as ISO 34503 sorts them.
    pub attributes: Vec<Row>,
    /// Conditions that may trigger an insufficiency, for an analysis as in ISO 21448.
    pub triggers: Vec<Row>,
    /// Perturbations of the record that stand for nothing in the table.
    pub unlisted: BTreeSet<String>,
}

/// What is known of an attribute or a trigger.
#[derive(Debug, Serialize)]
pub struct Row {
    /// What it is.
    #[serde(flatten)]
    pub item: Item,
    /// What is known.
    pub state: State,
    /// What stood for it: perturbations, and simulators with their parameters.
    pub by: BTreeSet<String>,
    /// What each driver made of it.
    pub drivers: Vec<OfDriver>,
    /// Frames of recordings on which a driver's steering was looked at, by driver, with the highest level.
    pub recordings: Vec<OfRecording>,
}

/// What is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// A driver failed.
    Failed,
    /// No driver failed.
    Passed,
    /// A simulator showed it, but always under a perturbation, which may be what made a driver fail.
    Perturbed,
    /// It was seen on recordings alone, where nothing can fail.
    Recorded,
    /// Nothing was driven.
    Open,
}

impl State {
    fn text(self) -> &'static str {
        match self {
            Self::Failed => "failed",
            Self::Passed => "driven",
            Self::Perturbed => "under perturbations only",
            Self::Recorded => "recordings only",
            Self::Open => "open",
        }
    }
}

/// What a driver made of an attribute.
#[derive(Debug, Serialize)]
pub struct OfDriver {
    /// The driver.
    pub driver: String,
    /// Scenarios that say something about the driver.
    pub scenarios: u64,
    /// Those that it failed.
    pub failed: u64,
    /// On this many roads.
    pub roads: usize,
    /// The share of scenarios that it fails, over roads.
    pub share: Share,
    /// The lowest level of a perturbation at which it failed; none if it failed at none.
    pub failed_from: Option<f64>,
    /// The highest level of a perturbation that was driven; none if it was driven without one.
    pub driven_to: Option<f64>,
}

/// A share with its interval of 95 %.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Share {
    value: f64,
    low: f64,
    high: f64,
}

/// What a driver made of an attribute on recordings.
#[derive(Debug, Serialize)]
pub struct OfRecording {
    driver: String,
    frames: usize,
    driven_to: f64,
    /// The largest mean error of the steering at a level; none if no steering was recorded.
    steering_error: Option<f64>,
}

/// What is counted of a driver.
#[derive(Default)]
struct Count {
    roads: BTreeMap<String, Drives>,
    failed_from: Option<f64>,
    driven_to: Option<f64>,
}

/// What is counted of an attribute.
#[derive(Default)]
struct Counts {
    by: BTreeSet<String>,
    drivers: BTreeMap<String, Count>,
    recordings: BTreeMap<String, OfRecording>,
    /// Whether a simulator showed it under a perturbation.
    perturbed: bool,
}

/// Looks at a record.
pub fn odd(domain: &Domain, record: &str, lines: &[Line], evaluations: &[Evaluation]) -> Odd {
    let (mut attributes, mut triggers) = (BTreeMap::new(), BTreeMap::new());
    let mut unlisted = BTreeSet::new();
    let mut drivers = BTreeSet::new();
    let named = Named::of(lines.iter().map(|line| &line.scenario.driver));
    for line in lines {
        let meaning = domain.of_perturbations(&line.scenario);
        unlisted.extend(meaning.unlisted.iter().cloned());
        let verdict = line.outcome.cause.verdict();
        if verdict == Verdict::Void {
            continue;
        }
        let driver = named.name(&line.scenario.driver);
        drivers.insert(driver.clone());
        count(&mut attributes, &meaning.attributes, line, &driver, verdict.failed());
        count(&mut triggers, &meaning.triggers, line, &driver, verdict.failed());
        // Under a perturbation, what the simulator shows need not be what made the driver fail.
        let shown = domain.of_simulator(&line.scenario);
        for (counts, ids) in [(&mut attributes, &shown.attributes), (&mut triggers, &shown.triggers)] {
            match line.scenario.perturbations.is_empty() {
                true => count(counts, ids, line, &driver, verdict.failed()),
                false => shown_only(counts, ids),
            }
        }
    }
    for evaluation in evaluations {
        let driver = if evaluation.driver.is_empty() { "a driver" } else { &evaluation.driver };
        drivers.insert(driver.to_owned());
        for cell in &evaluation.cells {
            let mut meaning = Meaning::default();
            // A label may go on with parameters.
            let is_name = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
            let end = cell.perturbation.find(|letter| !is_name(letter)).unwrap_or(cell.perturbation.len());
            domain.add_perturbation(&cell.perturbation[..end], &mut meaning);
            unlisted.extend(meaning.unlisted.iter().cloned());
            for (counts, ids) in [(&mut attributes, &meaning.attributes), (&mut triggers, &meaning.triggers)]
            {
                for (id, by) in ids {
                    let counts: &mut Counts = counts.entry(id.clone()).or_default();
                    counts.by.extend(by.iter().cloned());
                    counts.recorded(driver, evaluation.frames, cell.level, cell.error);
                }
            }
        }
    }
    Odd {
        format: 1,
        claim: CLAIM,
        record: record.to_owned(),
        drivers: drivers.into_iter().collect(),
        attributes: rows(&domain.attributes, attributes),
        triggers: rows(&domain.triggers, triggers),
        unlisted,
    }
}

/// Notes what a simulator showed under a perturbation.
fn shown_only(all: &mut BTreeMap<String, Counts>, ids: &BTreeMap<String, BTreeSet<String>>) {
    for (id, by) in ids {
        let counts = all.entry(id.clone()).or_default();
        counts.by.extend(by.iter().cloned());
        counts.perturbed = true;
    }
}

fn count(
    all: &mut BTreeMap<String, Counts>,
    ids: &BTreeMap<String, BTreeSet<String>>,
    line: &Line,
    driver: &str,
    failed: bool,
) {
    for (id, by) in ids {
        let counts = all.entry(id.clone()).or_default();
        counts.by.extend(by.iter().cloned());
        let count = counts.drivers.entry(driver.to_owned()).or_default();
        count.roads.entry(line.scenario.road.to_string()).or_default().add(failed);
        // The level counts only for what a perturbation stands for.
        let perturbations = line.scenario.perturbations.iter().filter(|applied| by.contains(&applied.name));
        for level in perturbations.filter_map(published) {
            count.driven_to = Some(count.driven_to.map_or(level, |to| to.max(level)));
            if failed {
                count.failed_from = Some(count.failed_from.map_or(level, |from| from.min(level)));
            }
        }
    }
}

/// The published level of a perturbation, if it is the same all the time.
fn published(applied: &AppliedPerturbation) -> Option<f64> {
    let level = applied.level.constant()?;
    match &applied.level_scale {
        Some(LevelScale::Measured(scale)) => scale.published(level),
        _ => Some(level),
    }
}

impl Counts {
    fn recorded(&mut self, driver: &str, frames: usize, level: f64, error: f64) {
        let new =
            || OfRecording { driver: driver.to_owned(), frames, driven_to: level, steering_error: None };
        let of = self.recordings.entry(driver.to_owned()).or_insert_with(new);
        of.frames = of.frames.max(frames);
        of.driven_to = of.driven_to.max(level);
        if error.is_finite() {
            of.steering_error = Some(of.steering_error.map_or(error, |largest| largest.max(error)));
        }
    }
}

fn rows(items: &[Item], mut counted: BTreeMap<String, Counts>) -> Vec<Row> {
    let row = |item: &Item| {
        let Counts { by, drivers, recordings, perturbed } = counted.remove(&item.id).unwrap_or_default();
        let drivers: Vec<OfDriver> =
            drivers.into_iter().filter_map(|(driver, count)| of_driver(driver, count)).collect();
        let state = match (drivers.is_empty(), recordings.is_empty()) {
            (false, _) if drivers.iter().any(|driver| driver.failed > 0) => State::Failed,
            (false, _) => State::Passed,
            (true, _) if perturbed => State::Perturbed,
            (true, false) => State::Recorded,
            (true, true) => State::Open,
        };
        Row { item: item.clone(), state, by, drivers, recordings: recordings.into_values().collect() }
    };
    items.iter().map(row).collect()
}

fn of_driver(driver: String, count: Count) -> Option<OfDriver> {
    let roads: Vec<Drives> = count.roads.into_values().collect();
    let share = share_over_roads(&roads, CONFIDENCE)?;
    Some(OfDriver {
        driver,
        scenarios: roads.iter().map(|drives| drives.of).sum(),
        failed: roads.iter().map(|drives| drives.failed).sum(),
        roads: roads.len(),
        share: Share { value: share.value, low: share.low, high: share.high },
        failed_from: count.failed_from,
        driven_to: count.driven_to,
    })
}

#[derive(Serialize)]
struct ShownRow {
    group: String,
    name: String,
    state: &'static str,
    class: State,
    by: String,
    lines: Vec<String>,
}

/// The page.
///
/// # Errors
/// If it cannot be made.
pub fn html(odd: &Odd) -> Result<String> {
    let place = |error: minijinja::Error| Error::new(format!("cannot make the page ({error:#})"));
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.set_trim_blocks(true);
    environment.set_lstrip_blocks(true);
    environment.add_template("odd.html", include_str!("template/odd.html")).map_err(place)?;
    let counted = |rows: &[Row], what: &str| {
        let of = |state: State| rows.iter().filter(|row| row.state == state).count();
        let was = |count: usize| if count == 1 { "1 was".to_owned() } else { format!("{count} were") };
        let more = [
            (State::Perturbed, "shown under perturbations only"),
            (State::Recorded, "seen on recordings only"),
        ];
        let more = more.iter().filter(|(state, _)| of(*state) > 0);
        let more: String = more.map(|(state, words)| format!("{} {words}, ", was(of(*state)))).collect();
        let failures = match of(State::Failed) {
            0 => "without failures".to_owned(),
            failed => format!("with failures in {failed}"),
        };
        let open = match of(State::Open) {
            1 => "1 is".to_owned(),
            open => format!("{open} are"),
        };
        let driven = was(of(State::Failed) + of(State::Passed));
        format!("Of {} {what}, {driven} driven, {failures}; {more}{open} open.", rows.len())
    };
    let page = context! {
        title => odd.record,
        drivers => odd.drivers.join(", "),
        claim => odd.claim,
        sentences => [
            counted(&odd.attributes, "attributes"),
            counted(&odd.triggers, "conditions that may trigger an insufficiency"),
        ],
        tables => [
            ("Attributes of the operational design domain", shown(&odd.attributes)),
            ("Conditions that may trigger an insufficiency", shown(&odd.triggers)),
        ],
        unlisted => odd.unlisted.iter().cloned().collect::<Vec<_>>().join(", "),
        style => pdk_report::style()?,
    };
    environment.get_template("odd.html").and_then(|template| template.render(page)).map_err(place)
}

fn shown(rows: &[Row]) -> Vec<ShownRow> {
    let percent = |share: f64| format!("{:.0}", 100.0 * share);
    let count = |number: usize, noun: &str| format!("{number} {noun}{}", if number == 1 { "" } else { "s" });
    let levels = |from: Option<f64>, to: Option<f64>| match (from, to) {
        (_, None) => String::new(),
        (None, Some(to)) => format!("; driven to level {to}"),
        (Some(from), Some(to)) => format!("; failed from level {from} on, driven to {to}"),
    };
    let of_driver = |of: &OfDriver| {
        format!(
            "{}: {} of {} on {} failed ({} %, 95 %: {} to {} %){}",
            of.driver,
            of.failed,
            count(of.scenarios as usize, "scenario"),
            count(of.roads, "road"),
            percent(of.share.value),
            percent(of.share.low),
            percent(of.share.high),
            levels(of.failed_from, of.driven_to)
        )
    };
    let of_recording = |of: &OfRecording| {
        let error = of.steering_error.map(|error| format!(", steering off by up to {error:.3} on average"));
        let error = error.unwrap_or_default();
        format!(
            "{}: {}{error}{}",
            of.driver,
            count(of.frames, "recorded frame"),
            levels(None, Some(of.driven_to))
        )
    };
    let row = |row: &Row| ShownRow {
        group: row.item.group.clone(),
        name: row.item.name.clone(),
        state: row.state.text(),
        class: row.state,
        by: row.by.iter().cloned().collect::<Vec<_>>().join(", "),
        lines: row.drivers.iter().map(of_driver).chain(row.recordings.iter().map(of_recording)).collect(),
    };
    rows.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::tests::SMALL;
    use serde_json::json;

    fn line(road: u32, perturbations: serde_json::Value, cause: &str) -> Line {
        let value = json!({
            "id": "00".repeat(16), "name": "x", "images_every": 0, "success": cause == "finished", "cause": cause, "time": 1.0, "frames": 5,
            "progress": 0.5, "mean_cross_track_error": 0.1, "max_cross_track_error": 0.2, "digest": "",
            "scenario": {
                "simulator": {"name": "flat", "parameters": {"light": "dark", "haze": 0}}, "driver": {"name": "<x>"},
                "road": {"angles": [road]}, "perturbations": perturbations, "duration": 10, "seed": 1,
            },
        });
        serde_json::from_value(value).unwrap()
    }

    #[test]
    fn what_was_driven_what_failed_and_what_is_open() {
        let mist = |level: f64| json!([{"name": "mist", "level": level}]);
        let lines = [
            line(1, mist(1.0), "finished"),
            line(1, mist(3.0), "lane_departure"),
            line(2, mist(2.0), "lane_departure"),
            line(2, json!([{"name": "own", "level": 1}]), "finished"),
            line(4, json!([]), "finished"),
            line(3, mist(0.0), "error"),
        ];
        let found = odd(&Domain::parse(SMALL).unwrap(), "runs/a", &lines, &[]);
        let [fog, dark, works] = &found.attributes[..] else { panic!("{found:?}") };
        assert_eq!((fog.state, dark.state, works.state), (State::Failed, State::Passed, State::Open));
        let of = &fog.drivers[0];
        assert_eq!((of.scenarios, of.failed, of.roads), (3, 2, 2));
        assert_eq!((of.failed_from, of.driven_to), (Some(2.0), Some(3.0)));
        // A light has no level, and what fails in the mist says nothing of it.
        assert_eq!((dark.drivers[0].scenarios, dark.drivers[0].driven_to), (1, None));
        let without = odd(&Domain::parse(SMALL).unwrap(), "runs/a", &lines[..3], &[]);
        assert!(without.attributes[1].state == State::Perturbed && without.attributes[1].drivers.is_empty());
        let page = html(&without).unwrap();
        let sentence = "Of 3 attributes, 1 was driven, with failures in 1; 1 was shown under perturbations only, 1 is open.";
        assert!(page.contains(sentence), "{page}");
        let page = html(&odd(&Domain::parse(SMALL).unwrap(), "runs/a", &lines[4..5], &[])).unwrap();
        assert!(page.contains("Of 3 attributes, 1 was driven, without failures; 2 are open."), "{page}");
        assert_eq!(found.unlisted.iter().collect::<Vec<_>>(), ["own"]);
        let page = html(&found).unwrap();
        assert!(page.contains("Of 3 attributes, 2 were driven, with failures in 1; 1 is open."), "{page}");
        assert!(page.contains("fog &amp; mist") && page.contains("&lt;x&gt;") && !page.contains("<x>"));
        assert!(page.contains("It claims no conformity"), "{page}");
    }

    #[test]
    fn recordings_are_seen_and_nothing_fails_on_them() {
        let cell = |level: f64, error: f64| pdk_report::EvaluationCell {
            perturbation: "mist(size=3)".into(),
            level,
            error,
            ..Default::default()
        };
        let evaluation = Evaluation {
            driver: "x".into(),
            frames: 40,
            cells: vec![cell(1.0, 0.1), cell(3.0, 0.4), cell(2.0, f64::NAN)],
            ..Evaluation::default()
        };
        let found = odd(&Domain::parse(SMALL).unwrap(), "runs/a", &[], &[evaluation]);
        let fog = &found.attributes[0];
        assert!(fog.state == State::Recorded && fog.drivers.is_empty());
        assert_eq!((fog.recordings[0].frames, fog.recordings[0].driven_to), (40, 3.0));
        assert_eq!(fog.recordings[0].steering_error, Some(0.4));
    }
}
