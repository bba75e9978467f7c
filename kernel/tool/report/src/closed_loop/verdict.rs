//! The sentences on top of the page: what breaks the driver, from which level on, and how sure that is.

use pdk_model::outcome::failing_unperturbed;
use pdk_statistics::CONFIDENCE;
use pdk_statistics::share::share;

use crate::closed_loop::failing::{FEWEST_ROADS, Failing, TOGETHER, failing};
use crate::closed_loop::luck::luck;
use crate::compare;
use crate::conclusions::roads;
use crate::tally::{Tally, by_severity};
use crate::text::{self, count, number, percent};
use crate::view::{Drive, Scenario};

/// Perturbations that a sentence names.
const NAMED: usize = 3;

/// The sentences about these drives.
pub fn verdict(drives: &[Drive]) -> Vec<String> {
    let mut sentences: Vec<String> = drives.iter().filter_map(about_nominal).collect();
    let all = || drives.iter().flat_map(|drive| &drive.scenarios);
    let tally = Tally::of(all());
    if drives.len() <= TOGETHER {
        let one_simulator = drives.iter().all(|drive| drive.simulator == drives[0].simulator);
        sentences.extend(drives.iter().filter_map(|drive| {
            let place = if one_simulator { String::new() } else { format!(" in {}", drive.simulator) };
            broken_by(drive, &place)
        }));
        sentences.extend(compare::pairs(drives).into_iter().filter_map(|(a, b)| compare::sentence(a, b)));
    }
    if tally.failed == 0 {
        sentences.extend(largest_deviation(drives));
    } else if sentences.is_empty() {
        sentences.extend(worst(drives));
    }
    sentences.push(counted(drives, &tally));
    sentences.extend(certainty(drives));
    sentences.extend(drives.iter().filter_map(luck).map(|luck| luck.sentence));
    sentences
}

/// What breaks a driver, and from which level on. None if nothing was driven at levels.
fn broken_by(drive: &Drive, place: &str) -> Option<String> {
    let found = failing(drive);
    let most = found.iter().map(|found| found.roads).max()?;
    let driver = &drive.driver;
    let broken: Vec<&Failing> = found.iter().filter(|found| found.level.is_some()).collect();
    let sometimes: Vec<&Failing> =
        found.iter().filter(|found| found.level.is_none() && found.any_failed).collect();
    let all = match found.len() {
        1 => format!("the perturbation {}", found[0].name),
        several => format!("all {several} perturbations"),
    };
    if broken.is_empty() && sometimes.is_empty() {
        let [least, most] =
            [f64::min, f64::max].map(|pick| found.iter().map(|found| found.highest).reduce(pick));
        let [least, most] = [least, most].map(|level| text::short(level.unwrap_or_default()));
        return Some(match least == most {
            true => format!("{driver}{place} survives {all} up to level {most}."),
            false => format!(
                "{driver}{place} survives {all}, each up to the highest level driven, {least} to {most}."
            ),
        });
    }
    let mut levels: Vec<String> = broken
        .iter()
        .take(NAMED)
        .enumerate()
        .map(|(number, found)| {
            let (level, interval) = found.told();
            match (most, number) {
                (1, _) => format!("{} ({})", found.name, on_one_road(found)),
                (few, _) if few < FEWEST_ROADS => format!("{} from level {level} on", found.name),
                (_, 0) => format!("{} from level {level} on (95 %: {interval})", found.name),
                _ => format!("{} from level {level} on ({interval})", found.name),
            }
        })
        .collect();
    if broken.len() > NAMED {
        levels.push(format!("{} more", broken.len() - NAMED));
    }
    let of = format!("{} of {}", broken.len(), count(found.len(), "perturbation"));
    let first = match (broken.len(), found.len()) {
        (0, _) => format!(
            "{driver}{place} fails half of the time under none of {}",
            count(found.len(), "perturbation")
        ),
        (1, 1) => format!("{driver}{place} fails under {}", levels[0]),
        _ => format!("{driver}{place} fails under {of}: {}", listed(&levels)),
    };
    let names: Vec<String> = sometimes.iter().take(NAMED).map(|found| found.name.clone()).collect();
    let more = match sometimes.len() {
        0 => String::new(),
        few if few <= NAMED => format!("; under {} it fails in some drives", listed(&names)),
        many => format!("; under {many} others it fails in some drives"),
    };
    Some(format!("{first}{more}."))
}

/// What is known of a level on a single road.
fn on_one_road(found: &Failing) -> String {
    match (found.low, found.high) {
        (Some(survived), Some(failed)) => {
            format!("survived level {}, failed level {}", text::short(survived), text::short(failed))
        }
        (_, Some(failed)) => format!("already at level {}", text::short(failed)),
        _ => "never".to_owned(),
    }
}

/// `a`, `a and b`, `a, b and c`.
fn listed(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [before @ .., last] => format!("{} and {last}", before.join(", ")),
    }
}

/// A sentence about a driver that fails without perturbation, if others of its drives are perturbed.
fn about_nominal(drive: &Drive) -> Option<String> {
    let of = |perturbed: bool| {
        drive.scenarios.iter().filter(move |scenario| scenario.perturbation.is_some() == perturbed)
    };
    if Tally::of(of(true)).judged == 0 {
        return None;
    }
    failing_unperturbed(&drive.driver, of(false).map(|scenario| scenario.verdict))
}

/// The worst perturbation over several drives, or if there are no levels.
fn worst(drives: &[Drive]) -> Option<String> {
    let order = by_severity(drives.iter().map(|drive| drive.scenarios.as_slice()));
    let (name, worst) = order.first()?;
    let share = match worst.estimate().filter(|_| worst.roads() >= FEWEST_ROADS) {
        Some(share) => format!(
            " ({} of them, 95 %: {} to {})",
            percent(share.value),
            percent(share.low),
            percent(share.high)
        ),
        None => String::new(),
    };
    Some(match worst.judged {
        0 => format!("Nothing can be said about {name}."),
        judged => {
            format!("The worst perturbation is {name}: {} of {judged} drives failed{share}.", worst.failed)
        }
    })
}

/// What did not fail may still have gone astray.
fn largest_deviation(drives: &[Drive]) -> Option<String> {
    let order = by_severity(drives.iter().map(|drive| drive.scenarios.as_slice()));
    let (name, worst) = order.first()?;
    Some(format!(
        "The largest deviation comes with {name}: {} m from the middle of the lane on average.",
        number(worst.mean_error()?)
    ))
}

/// How many drives failed, and how.
fn counted(drives: &[Drive], tally: &Tally) -> String {
    let all = || drives.iter().flat_map(|drive| &drive.scenarios);
    let total = all().count();
    let void = total - tally.judged;
    let driven = |total: usize| text::was(total, "scenario");
    let mut told = match (tally.judged, tally.failed) {
        (0, _) => format!("{} driven, but none to its end", driven(total)),
        (_, 0) => format!("{} driven, and none failed", driven(total)),
        (_, failed) => {
            format!("{} driven, and {failed} failed ({})", driven(total), percent(tally.share_of_drives()))
        }
    };
    let nominal = Tally::of(all().filter(|scenario: &&Scenario| scenario.perturbation.is_none()));
    if nominal.judged > 0 && nominal.judged < tally.judged && tally.failed > 0 {
        told += &match (nominal.judged, nominal.failed) {
            (1, 0) => ", but not the one without perturbation".to_owned(),
            (judged, 0) => format!(", none of the {judged} without perturbation"),
            // A sentence of their own says it.
            _ => String::new(),
        };
    }
    let all_of = |part: usize| part == tally.failed;
    told += &match (tally.stopped, tally.late) {
        (0, 0) => String::new(),
        (stopped, 0) if all_of(stopped) => {
            "; no vehicle left its lane or hit anything: they stopped".to_owned()
        }
        (0, late) if all_of(late) => {
            "; no vehicle left its lane or hit anything: they ran out of time".to_owned()
        }
        (stopped, late) if all_of(stopped + late) => {
            format!("; no vehicle left its lane or hit anything: {stopped} stopped, {late} ran out of time")
        }
        (stopped, 0) => format!("; in {stopped} of the failed ones the vehicle stopped"),
        (0, late) => format!("; in {late} of the failed ones the vehicle ran out of time"),
        (stopped, late) => {
            format!("; in {stopped} of the failed ones the vehicle stopped, in {late} it ran out of time")
        }
    };
    if void > 0 {
        told += &format!("; in {void} a component failed, which says nothing about the driver");
    }
    told + "."
}

/// How far this goes beyond the roads that were driven. None if nothing was perturbed.
fn certainty(drives: &[Drive]) -> Option<String> {
    let perturbed = drives.iter().flat_map(|drive| &drive.scenarios).any(|s| s.perturbation.is_some());
    let driven = || drives.iter().map(|drive| roads(drive).len());
    let (fewest, most) = (driven().min().filter(|_| perturbed)?, driven().max()?);
    Some(match fewest {
        1 if most == 1 => "All of this happened on one road, which says nothing about others.".to_owned(),
        1 => "Some of this happened on one road alone, which says nothing about others.".to_owned(),
        few if few < FEWEST_ROADS => {
            format!("{few} roads are too few for an interval of these levels; drive {FEWEST_ROADS} or more.")
        }
        roads => format!(
            "This was seen on {roads} roads: what failed on none of them may still fail on up to {} of all roads (95 %).",
            percent(share(0, roads as u64, CONFIDENCE)?.high)
        ),
    })
}
