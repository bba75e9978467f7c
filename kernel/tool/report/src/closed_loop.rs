//! What was driven: which perturbations make the driver fail, how soon, and where.

mod curves;
pub mod failing;
mod luck;
mod maps;
#[cfg(test)]
mod tests;
mod verdict;

use std::collections::BTreeMap;

use pdk_sdk::error::Result;
use serde::Serialize;

use crate::closed_loop::curves::curves;
use crate::closed_loop::luck::Luck;
use crate::closed_loop::maps::{grids, largest_error};
pub use crate::closed_loop::verdict::verdict;
use crate::color::{ORDERED, Rgb};
use crate::conclusions::{Conclusions, conclusions};
use crate::curve::Chart;
use crate::heat::Grid;
use crate::road::{self, Picture};
use crate::tally::{by_severity, levels};
use crate::text::{self, count, number, percent};
use crate::tracks::Tracks;
use crate::view::{Drive, Measures, Scenario, Verdict};

/// Roads that have a picture.
const PICTURES: usize = 24;
/// The name of what is not perturbed.
const NO_PERTURBATION: &str = "no perturbation";

/// What the page says about scenarios with one simulator and one driver.
#[derive(Debug, Serialize)]
pub struct Section {
    simulator: String,
    driver: String,
    mode: String,
    /// The picture of failing levels, if it is not shared with other drives.
    pub failing: Option<Tracks>,
    pub failed: Grid,
    pub error: Grid,
    pub conclusions: Conclusions,
    luck: Option<Luck>,
    pub curves: Vec<Chart>,
    pub roads: Vec<Picture>,
    /// The sentence about roads without a picture.
    road_note: String,
    classes: Vec<Class>,
    failures: Vec<Failure>,
    failure_note: String,
    scenarios: Vec<ScenarioRow>,
    /// Whether levels were chosen by what failed.
    levels_chosen: bool,
    /// Whether a vehicle stopped.
    with_stopped: bool,
    /// Whether there are roads, skipped frames and clips to tell in the table.
    with_roads: bool,
    with_skipped: bool,
    with_clips: bool,
}

/// A colour of the driven lines.
#[derive(Debug, Serialize)]
struct Class {
    color: Rgb,
    text: String,
}

/// A failure with its last frames.
#[derive(Debug, Serialize)]
struct Failure {
    title: String,
    text: String,
    shots: Vec<Shot>,
    replay: String,
    clip: String,
}

#[derive(Debug, Serialize)]
struct Shot {
    time: String,
    raw: String,
    perturbed: String,
    attention: String,
}

#[derive(Debug, Serialize)]
struct ScenarioRow {
    index: u64,
    name: String,
    road: String,
    mark: &'static str,
    cause: String,
    error: String,
    unreadable: String,
    failed: bool,
    time: String,
    skipped_frames: u64,
    progress: String,
    mean_error: String,
    max_error: String,
    over_line: String,
    lateral_acceleration: String,
    jerk: String,
    replay: String,
    clip: String,
}

/// The positions of the failures that tell most: those that came soonest on their road, of each perturbation one before
/// a second of any.
pub fn worst_failures(drive: &Drive, most: usize) -> Vec<usize> {
    let scenarios = &drive.scenarios;
    let mut failed: Vec<usize> = (0..scenarios.len()).filter(|&i| scenarios[i].verdict.failed()).collect();
    failed.sort_by(|&a, &b| scenarios[a].progress.total_cmp(&scenarios[b].progress).then(a.cmp(&b)));
    let mut seen: BTreeMap<&Option<String>, usize> = BTreeMap::new();
    let mut rounds: Vec<(usize, usize)> = Vec::new();
    for position in failed {
        let before = seen.entry(&scenarios[position].perturbation).or_default();
        rounds.push((*before, position));
        *before += 1;
    }
    // Keeps the order within a round.
    rounds.sort_by_key(|(round, _)| *round);
    rounds.into_iter().take(most).map(|(_, position)| position).collect()
}

/// All that the page says about a drive, one of `all` of the run. `classes` are the edges of the colours of cross-track errors.
///
/// # Errors
/// If a picture cannot be drawn.
pub fn section(drive: &Drive, all: &[Drive], classes: &[f64]) -> Result<Section> {
    let order: Vec<String> =
        by_severity([drive.scenarios.as_slice()]).into_iter().map(|(name, _)| name).collect();
    let chosen = levels([drive.scenarios.as_slice()]);
    // All drives of a run have one scale, so that drivers can be compared.
    let compared = || all.iter().chain([drive]);
    let (failed, error) = grids(drive, &order, &chosen, largest_error(compared()));
    let end = compared().flat_map(|drive| &drive.scenarios).map(|scenario| scenario.time).fold(0.0, f64::max);
    let mut roads = road::pictures(drive, classes);
    let road_note = road_note(drive, roads.len());
    roads.truncate(PICTURES);
    let shown: Vec<&Scenario> = drive.scenarios.iter().filter(|s| !s.shots.is_empty()).collect();
    let all_failed = drive.scenarios.iter().filter(|s| s.verdict.failed()).count();
    let failure_note = match (all_failed, shown.len()) {
        (0, _) => "No scenario failed.".to_owned(),
        (_, 0) => "There are no frames of the failures: they failed before the first, or their traces cannot be read.".to_owned(),
        (all, shown) if shown < all => format!(
            "These are {shown} of {all} failures: those that came soonest on their road, one of each perturbation first. \
             The others are in the table of scenarios."
        ),
        _ => String::new(),
    };
    let mut failures: Vec<(usize, Failure)> = Vec::new();
    let rank = worst_failures(drive, usize::MAX);
    for (position, scenario) in drive.scenarios.iter().enumerate().filter(|(_, s)| !s.shots.is_empty()) {
        let place = rank.iter().position(|&ranked| ranked == position).unwrap_or(usize::MAX);
        failures.push((place, failure(scenario)));
    }
    failures.sort_by_key(|(place, _)| *place);
    Ok(Section {
        simulator: drive.simulator.clone(),
        driver: drive.driver.clone(),
        mode: drive.mode.clone(),
        failing: if all.len() > failing::TOGETHER { failing::picture(&[drive]) } else { None },
        failed,
        error,
        conclusions: conclusions(drive),
        luck: luck::luck(drive),
        curves: if all_failed > 0 { curves(drive, &order, &chosen, end)? } else { Vec::new() },
        roads,
        road_note,
        classes: legend(classes),
        failures: failures.into_iter().map(|(_, failure)| failure).collect(),
        failure_note,
        scenarios: drive.scenarios.iter().map(scenario_row).collect(),
        levels_chosen: !chosen.is_empty(),
        with_stopped: drive.scenarios.iter().any(|s| s.verdict == Verdict::Stopped),
        with_roads: drive.roads.len() > 1,
        with_skipped: drive.scenarios.iter().any(|s| s.skipped_frames > 0),
        with_clips: drive.scenarios.iter().any(|s| !s.clip.is_empty()),
    })
}

/// The sentence about this many scenarios whose road or path is not in the pictures.
fn road_note(drive: &Drive, pictures: usize) -> String {
    let mut sentences = Vec::new();
    if pictures > PICTURES {
        let more = pictures - PICTURES;
        sentences.push(format!(
            "These are the {PICTURES} roads with the most failures; {more} more are in the table."
        ));
    }
    let without = || drive.scenarios.iter().filter(|s| s.road.is_none());
    let unreadable = without().filter(|s| !s.unreadable.is_empty()).count();
    // If a component takes its process along there is nothing in the trace.
    let void = without()
        .filter(|s| s.unreadable.is_empty() && s.verdict == Verdict::Void && s.path.is_empty())
        .count();
    match without().count() - unreadable - void {
        0 => {}
        _ if drive.roads.is_empty() => sentences.push("The simulator does not report its roads.".to_owned()),
        unknown => {
            sentences
                .push(format!("The simulator did not report the road of {}.", count(unknown, "scenario")));
        }
    }
    if void > 0 {
        sentences.push(format!(
            "Of {}, in which a component failed, there is nothing to draw.",
            count(void, "scenario")
        ));
    }
    if unreadable > 0 {
        sentences.push(format!(
            "{} shown without a path, because the trace cannot be read: the table of scenarios says why.",
            match unreadable {
                1 => "1 scenario is".to_owned(),
                several => format!("{several} scenarios are"),
            }
        ));
    }
    sentences.join(" ")
}

fn legend(edges: &[f64]) -> Vec<Class> {
    let below = |i: usize| text::short(edges[i]);
    let last = edges.len();
    (0..=last)
        .zip(ORDERED)
        .map(|(i, color)| Class {
            color,
            text: match i {
                0 if last > 0 => format!("up to {} m", below(0)),
                i if i == last && last > 0 => format!("over {} m", below(last - 1)),
                i => format!("to {} m", below(i.min(last.saturating_sub(1)))),
            },
        })
        .collect()
}

fn failure(scenario: &Scenario) -> Failure {
    Failure {
        title: format!("Scenario {}: {}", scenario.index, scenario.name),
        text: format!(
            "{} after {} s, {} of the road; largest cross-track error {} m",
            scenario.cause,
            number(scenario.time),
            percent(scenario.progress),
            number(scenario.max_error)
        ),
        shots: scenario
            .shots
            .iter()
            .map(|shot| Shot {
                time: format!("{:.2}", shot.time),
                raw: picture(&shot.raw),
                perturbed: picture(&shot.perturbed),
                attention: picture(&shot.attention),
            })
            .collect(),
        replay: scenario.replay.clone(),
        clip: scenario.clip.clone(),
    }
}

/// A picture as an address; none is empty.
fn picture(jpeg: &[u8]) -> String {
    if jpeg.is_empty() { String::new() } else { text::jpeg(jpeg) }
}

fn scenario_row(scenario: &Scenario) -> ScenarioRow {
    let failed = scenario.verdict.failed();
    let measured = |of: fn(&Measures) -> f64| scenario.measures.map_or_else(String::new, |m| number(of(&m)));
    ScenarioRow {
        index: scenario.index,
        name: scenario.name.clone(),
        road: scenario.road.map(|road| (road + 1).to_string()).unwrap_or_default(),
        mark: match scenario.verdict {
            Verdict::Passed => "✓",
            Verdict::Unsafe => "✗",
            Verdict::Stopped => "■",
            Verdict::Late => "▷",
            Verdict::Void => "–",
        },
        cause: scenario.cause.clone(),
        error: scenario.error.clone(),
        unreadable: scenario.unreadable.clone(),
        failed,
        time: format!("{:.1}", scenario.time),
        skipped_frames: scenario.skipped_frames,
        progress: percent(scenario.progress),
        mean_error: number(scenario.mean_error),
        max_error: number(scenario.max_error),
        over_line: measured(|measures| measures.over_line_seconds),
        lateral_acceleration: measured(|measures| measures.rms_lateral_acceleration),
        jerk: measured(|measures| measures.rms_jerk),
        replay: if failed { scenario.replay.clone() } else { String::new() },
        clip: scenario.clip.clone(),
    }
}
