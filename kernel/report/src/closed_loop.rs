//! What was driven: which perturbations make the driver fail, how soon, and where.

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, HashMap};

use pdk_sdk::error::Result;
use serde::Serialize;

use crate::color::{LINES, NOMINAL, ORDERED, Rgb};
use crate::conclusions::{Conclusions, conclusions};
use crate::curve::{Axes, Chart, Curve, chart};
use crate::heat::{self, Cell, Columns, Grid};
use crate::road::{self, Picture};
use crate::tally::{Tally, by_severity};
use crate::text::{self, count, number, percent, was};
use crate::view::{Drive, Measures, Scenario, Verdict};

/// Perturbations that have a curve of their own.
const CURVES: usize = 7;
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
    failed: Grid,
    error: Grid,
    conclusions: Conclusions,
    curves: Vec<Chart>,
    roads: Vec<Picture>,
    /// What is said about roads without a picture.
    road_note: String,
    classes: Vec<Class>,
    failures: Vec<Failure>,
    failure_note: String,
    scenarios: Vec<ScenarioRow>,
    /// Whether a vehicle only stopped.
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

/// The two sentences on top of the page.
pub fn verdict(drives: &[Drive]) -> Vec<String> {
    let all = || drives.iter().flat_map(|drive| &drive.scenarios);
    let (tally, total) = (Tally::of(all()), all().count());
    let void = total - tally.judged;
    let mut first = match (tally.judged, tally.failed) {
        (0, _) => format!("{} driven, but none to its end", was(total, "scenario")),
        (_, 0) => format!("{} driven, and none failed", was(total, "scenario")),
        (_, failed) => {
            format!(
                "{} driven, and {failed} failed ({})",
                was(total, "scenario"),
                percent(tally.share_of_drives())
            )
        }
    };
    let nominal = Tally::of(all().filter(|scenario| scenario.perturbation.is_none()));
    if nominal.judged > 0 && nominal.judged < tally.judged && tally.failed > 0 {
        first += &match (nominal.judged, nominal.failed) {
            (1, 0) => ", but not the one without perturbation".to_owned(),
            (1, _) => ", the one without perturbation among them".to_owned(),
            (judged, 0) => format!(", none of the {judged} without perturbation"),
            (judged, failed) => format!(", {failed} of the {judged} without perturbation"),
        };
    }
    if tally.stopped > 0 {
        first += &match tally.stopped {
            all if all == tally.failed => {
                "; no vehicle left its lane or hit anything: they stopped".to_owned()
            }
            stopped => format!("; in {stopped} of these the vehicle only stopped"),
        };
    }
    if void > 0 {
        first += &format!("; in {void} a component failed, which says nothing about the driver");
    }
    let mut sentences = vec![first + "."];
    if let Some((name, worst)) = by_severity(drives.iter().map(|drive| drive.scenarios.as_slice())).first() {
        let failing = all().filter(|s| s.verdict.failed() && s.perturbation.as_ref() == Some(name));
        let lowest = failing.filter_map(|s| s.level).min_by(f64::total_cmp);
        let from = match lowest {
            None => String::new(),
            Some(level) if worst.failed == 1 => format!(", at level {}", text::short(level)),
            Some(level) => format!(", the first at level {}", text::short(level)),
        };
        sentences.push(match (worst.judged, worst.failed) {
            (0, _) => format!("Nothing can be said about {name}."),
            (_, 0) => format!(
                "The largest deviation comes with {name}: {} m from the middle of the lane on average.",
                number(worst.mean_error().unwrap_or_default())
            ),
            (judged, failed) => {
                format!("The worst perturbation is {name}: {failed} of {judged} failed{from}.")
            }
        });
    }
    sentences
}

/// All that the page says about a drive, one of `all` of the run. `classes` are the edges of the colours of cross-track errors.
///
/// # Errors
/// Where a picture cannot be drawn.
pub fn section(drive: &Drive, all: &[Drive], classes: &[f64]) -> Result<Section> {
    let order: Vec<String> =
        by_severity([drive.scenarios.as_slice()]).into_iter().map(|(name, _)| name).collect();
    let (failed, error) = grids(drive, &order);
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
        failed,
        error,
        conclusions: conclusions(drive, all),
        curves: if all_failed > 0 { curves(drive, &order)? } else { Vec::new() },
        roads,
        road_note,
        classes: legend(classes),
        failures: failures.into_iter().map(|(_, failure)| failure).collect(),
        failure_note,
        scenarios: drive.scenarios.iter().map(scenario_row).collect(),
        with_stopped: drive.scenarios.iter().any(|s| s.verdict == Verdict::Stopped),
        with_roads: drive.roads.len() > 1,
        with_skipped: drive.scenarios.iter().any(|s| s.skipped_frames > 0),
        with_clips: drive.scenarios.iter().any(|s| !s.clip.is_empty()),
    })
}

/// What is said about scenarios whose road or path is not in the pictures, of which there are so many.
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
    // Where a component takes its process along there is nothing in the trace.
    let void = without()
        .filter(|s| s.unreadable.is_empty() && s.verdict == Verdict::Void && s.path.is_empty())
        .count();
    match without().count() - unreadable - void {
        0 => {}
        _ if drive.roads.is_empty() => sentences.push("The simulator does not tell its roads.".to_owned()),
        unknown => {
            sentences.push(format!("Of {} the simulator did not tell the road.", count(unknown, "scenario")));
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

/// The heat maps: the share that failed, and the mean cross-track error.
fn grids(drive: &Drive, order: &[String]) -> (Grid, Grid) {
    let columns = Columns::of(drive.scenarios.iter().filter_map(|scenario| scenario.level));
    // In the order in which they come first.
    let mut cells: Vec<(Option<&String>, Option<f64>, Tally, usize)> = Vec::new();
    let mut known: HashMap<(Option<&String>, Option<u64>), usize> = HashMap::new();
    for scenario in &drive.scenarios {
        let perturbation = scenario.perturbation.as_ref();
        let level = perturbation.and(scenario.level).map(|level| columns.column(level));
        let place = *known.entry((perturbation, level.map(heat::key))).or_insert_with(|| {
            cells.push((perturbation, level, Tally::default(), 0));
            cells.len() - 1
        });
        let (.., tally, total) = &mut cells[place];
        tally.add(scenario);
        *total += 1;
    }
    let largest = cells.iter().filter_map(|(.., tally, _)| tally.mean_error()).fold(0.0, f64::max);
    let (mut failed, mut error) = (Vec::new(), Vec::new());
    for (name, level, tally, total) in cells {
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
        let share = match (tally.judged, tally.failed, tally.stopped) {
            (0, ..) => "–".to_owned(),
            (1, 0, _) => "ok".to_owned(),
            (1, _, 0) => "failed".to_owned(),
            (1, ..) => "stopped".to_owned(),
            (judged, failed, 0) => format!("{failed}/{judged}"),
            (judged, failed, stopped) => format!("{failed}/{judged} ({stopped} st.)"),
        };
        // A drive that was cut short has no mean that could be compared: where all were, it is how soon.
        let (shown, depth) = match (tally.mean_error(), tally.time_to_failure()) {
            (None, None) => ("–".to_owned(), 0.0),
            (None, Some(seconds)) => (format!("✗ {} s", number(seconds)), 1.0),
            (Some(metres), time) => {
                let mark = if time.is_some() { " ✗" } else { "" };
                (format!("{}{mark}", number(metres)), if largest > 0.0 { metres / largest } else { 0.0 })
            }
        };
        let push = |entries: &mut Vec<heat::Entry>, text: String, share: f64| {
            entries.push(heat::Entry {
                row: name.cloned(),
                level,
                cell: Cell::new(text, title.clone(), share),
            });
        };
        push(&mut failed, share, tally.share_of_drives());
        push(&mut error, shown, depth);
    }
    (
        columns.grid(&failed, order, ("none failed".to_owned(), "all failed".to_owned())),
        columns.grid(&error, order, ("0 m".to_owned(), format!("{} m, or all failed", number(largest)))),
    )
}

/// Shares that are still driving, over time: by level, and for the worst perturbations.
fn curves(drive: &Drive, order: &[String]) -> Result<Vec<Chart>> {
    let end = drive.scenarios.iter().map(|scenario| scenario.time).fold(0.0, f64::max);
    if end <= 0.0 {
        return Ok(Vec::new());
    }
    let curve = |key: String, name: String, color: Rgb, in_group: &dyn Fn(&Scenario) -> bool| {
        let group: Vec<&Scenario> =
            drive.scenarios.iter().filter(|s| s.verdict != Verdict::Void && in_group(s)).collect();
        let points = survival(&group, end);
        let name = format!("{name} ({})", group.len());
        (!group.is_empty()).then_some(Curve { key, name, points, band: Vec::new(), color })
    };
    let nominal =
        || curve("–".to_owned(), NO_PERTURBATION.to_owned(), NOMINAL, &|s| s.perturbation.is_none());
    let axes = |label| Axes {
        x: "simulation time in s",
        x_range: (0.0, end),
        y: "still driving",
        top: 1.0,
        share: true,
        label,
    };

    let mut by_level: Vec<Curve> = nominal().into_iter().collect();
    let whole = drive.scenarios.iter().filter_map(|s| s.level).all(|level| level.fract() == 0.0);
    for (step, color) in ORDERED.iter().enumerate() {
        let name = match (whole, step + 1 == ORDERED.len()) {
            (true, _) | (_, true) => format!("level {step}"),
            (false, false) => format!("level {step} to below {}", step + 1),
        };
        by_level.extend(curve(step.to_string(), name, *color, &|s| {
            s.perturbation.is_some() && s.level.is_some_and(|level| level.floor() as usize == step)
        }));
    }
    by_level.extend(curve("~".to_owned(), "as scheduled".to_owned(), LINES[3], &|s| {
        s.perturbation.is_some() && s.level.is_none()
    }));

    let mut worst: Vec<Curve> = nominal().into_iter().collect();
    let failing = |name: &&String| {
        drive.scenarios.iter().any(|s| s.verdict.failed() && s.perturbation.as_ref() == Some(*name))
    };
    for ((name, color), key) in order.iter().filter(failing).take(CURVES).zip(LINES).zip('A'..) {
        worst.extend(curve(key.to_string(), name.clone(), color, &|s| s.perturbation.as_ref() == Some(name)));
    }
    let label = match order.iter().filter(failing).count() > CURVES {
        true => "Share of scenarios still driving, for the worst perturbations",
        false => "Share of scenarios still driving, by perturbation with failures",
    };
    Ok(vec![
        chart(&by_level, &axes("Share of scenarios still driving, by level"))?,
        chart(&worst, &axes(label))?,
    ])
}

/// The share that has not failed, over time, as corners of a line of steps. Who reached the end of the road counts as still
/// driving.
fn survival(group: &[&Scenario], end: f64) -> Vec<(f64, f64)> {
    let mut times: Vec<f64> = group.iter().filter(|s| s.verdict.failed()).map(|s| s.time).collect();
    times.sort_by(f64::total_cmp);
    let mut points = vec![(0.0, 1.0)];
    let share = |failed: usize| 1.0 - failed as f64 / group.len().max(1) as f64;
    for (failed, time) in times.into_iter().enumerate() {
        points.extend([(time, share(failed)), (time, share(failed + 1))]);
    }
    let last = points[points.len() - 1].1;
    points.push((end, last));
    points
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
