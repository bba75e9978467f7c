//! Two drivers on the same roads: what each fails, by how much they differ and how sure that is, and which scenarios one of them fails
//! and the other does not.

use std::collections::{BTreeMap, BTreeSet};

use pdk_statistics::CONFIDENCE;
use pdk_statistics::level::fails_at;
use pdk_statistics::paired::{Paired, compare};
use serde::Serialize;

use crate::color::{Hue, LINES, Rgb};
use crate::conclusions::{Difference, Trials, difference, roads, trials};
use crate::heat::{Cell, Columns, Entry, Grid, MOST_COLUMNS, Ramp, key};
use crate::road::{self, Picture};
use crate::tally::{by_severity, levels};
use crate::text::{count, percent, short};
use crate::view::{Drive, Scenario, Verdict};

/// Scenarios in the list of those that only one of them fails.
const LISTED: usize = 20;
/// Pictures of drives laid over each other.
const OVERLAYS: usize = 6;
/// The colours of the base and of the other.
const COLORS: [Rgb; 2] = [LINES[0], LINES[1]];
/// What a share can be.
const SHARE: (f64, f64) = (0.0, 1.0);

/// A driver beside the one that it is compared with.
#[derive(Debug, Serialize)]
pub struct Comparison {
    /// The driver that is compared with.
    pub base: String,
    /// The driver that is compared.
    pub other: String,
    /// What both have in common.
    place: String,
    /// Where each fails, and the share of the other less that of the base, on the same roads and levels.
    pub grids: [Grid; 3],
    /// Rows of the table: a perturbation, what each fails, and by how much the other fails more often.
    pub rows: Vec<Row>,
    /// How many scenarios both drove, and how many of these both fail, only one, or none.
    outcomes: [usize; 5],
    /// Scenarios that only the other fails, and those that only the base fails, with the command that replays the failure.
    only_other: Vec<(String, String)>,
    only_base: Vec<(String, String)>,
    /// How many more there are of each.
    more: (usize, usize),
    /// Drives of both laid over each other, of scenarios that only one of them fails.
    roads: Vec<Picture>,
    /// The colours of both in these pictures.
    colors: [Rgb; 2],
}

/// A perturbation that both drove.
#[derive(Debug, Serialize)]
pub struct Row {
    /// The perturbation; all together if it is the first row.
    pub perturbation: String,
    /// The share of levels that each fails.
    base: String,
    other: String,
    /// How they differ.
    difference: Difference,
    /// The figures behind the texts.
    #[serde(skip)]
    pub figures: (f64, f64, Paired),
}

/// The drives that are compared: each with the first in the same simulator and mode, if that is another driver.
pub fn pairs(drives: &[Drive]) -> Vec<(&Drive, &Drive)> {
    let first = |drive: &Drive| {
        drives.iter().find(|first| first.simulator == drive.simulator && first.mode == drive.mode)
    };
    let pair = |drive| Some((first(drive)?, drive)).filter(|(first, drive)| !std::ptr::eq(*first, *drive));
    drives.iter().filter_map(pair).collect()
}

/// What two drivers differ by; none if they have no perturbation on the same road.
pub fn comparison<'a>(base: &'a Drive, other: &'a Drive) -> Option<Comparison> {
    let shared = Shared::of(base, other);
    let rows = shared.rows();
    if rows.is_empty() {
        return None;
    }
    let (outcomes, only_other, only_base) = outcomes(base, other);
    let overlay = |(a, b): &(&Scenario, &Scenario)| {
        let centre = drive_road(base, a).or_else(|| drive_road(other, b))?;
        // As the one that failed is called.
        let name = if a.verdict.failed() { &a.name } else { &b.name };
        road::overlay(centre, &[(*a, COLORS[0]), (*b, COLORS[1])], name)
    };
    // As many of each kind, as far as there are.
    let shown = only_other.iter().take(OVERLAYS / 2).chain(only_base.iter().take(OVERLAYS / 2));
    let roads: Vec<Picture> = shown.filter_map(overlay).collect();
    let more = (only_other.len().saturating_sub(LISTED), only_base.len().saturating_sub(LISTED));
    let only = |pairs: Vec<(&'a Scenario, &'a Scenario)>, second: bool| {
        pairs.into_iter().map(|(a, b)| if second { b } else { a }).collect::<Vec<_>>()
    };
    let listed = |all: Vec<&Scenario>| {
        let told = |scenario: &&Scenario| (scenario.name.clone(), scenario.replay.clone());
        all.iter().take(LISTED).map(told).collect()
    };
    Some(Comparison {
        base: base.driver.clone(),
        other: other.driver.clone(),
        place: format!("{}, {}", base.simulator, base.mode),
        grids: shared.grids(),
        rows,
        outcomes,
        only_other: listed(only(only_other, true)),
        only_base: listed(only(only_base, false)),
        more,
        roads,
        colors: COLORS,
    })
}

/// The centre line of the road of a scenario.
fn drive_road<'a>(drive: &'a Drive, scenario: &Scenario) -> Option<&'a [[f64; 2]]> {
    Some(drive.roads.get(scenario.road?)?.as_slice())
}

/// Whether the other driver is better or worse, as a sentence; none if nothing can be compared.
pub fn sentence(base: &Drive, other: &Drive) -> Option<String> {
    let shared = Shared::of(base, other);
    let (theirs, ours, Paired { difference, p, roads, .. }) = shared.all()?;
    let told = format!(
        "{} fails {} of the levels and {} {} (difference {:+.0} %, 95 %: {:+.0} to {:+.0} %, p {p:.3}, {})",
        other.driver,
        percent(ours),
        base.driver,
        percent(theirs),
        100.0 * difference.value,
        100.0 * difference.low,
        100.0 * difference.high,
        count(roads, "road")
    );
    Some(match (difference.low > 0.0, difference.high < 0.0) {
        (true, _) => format!("{} is worse than {}: {told}.", other.driver, base.driver),
        (_, true) => format!("{} is better than {}: {told}.", other.driver, base.driver),
        _ => format!("{} and {} cannot be told apart: {told}.", other.driver, base.driver),
    })
}

/// What both drove.
struct Shared<'a> {
    base: (&'a Drive, Trials<'a>),
    other: (&'a Drive, Trials<'a>),
    /// Roads that both drove.
    roads: Vec<String>,
    /// The perturbations under which both drove, the worst first.
    names: Vec<String>,
    levels: Vec<f64>,
}

impl<'a> Shared<'a> {
    fn of(base: &'a Drive, other: &'a Drive) -> Self {
        let both = [base.scenarios.as_slice(), other.scenarios.as_slice()];
        let known: BTreeSet<String> = roads(other).into_iter().collect();
        let names = |drive: &Drive| -> BTreeSet<String> {
            drive
                .scenarios
                .iter()
                .filter(|s| s.level.is_some())
                .filter_map(|s| s.perturbation.clone())
                .collect()
        };
        let common = &names(base) & &names(other);
        let mut driven = levels(both);
        if driven.is_empty() {
            driven = both.iter().flat_map(|scenarios| scenarios.iter().filter_map(|s| s.level)).collect();
            driven.sort_by(f64::total_cmp);
            driven.dedup_by_key(|level| key(*level));
        }
        if driven.len() > MOST_COLUMNS {
            driven = driven.into_iter().map(f64::floor).collect();
            driven.dedup();
        }
        Self {
            base: (base, trials(base)),
            other: (other, trials(other)),
            roads: roads(base).into_iter().filter(|road| known.contains(road)).collect(),
            names: by_severity(both)
                .into_iter()
                .map(|(name, _)| name)
                .filter(|name| common.contains(name))
                .collect(),
            levels: driven,
        }
    }

    /// The share of drives under different luck that fail at a level of a road, as far as drives tell.
    fn share_at(trials: &Trials<'_>, name: &str, road: &str, level: f64) -> Option<f64> {
        let seeds = trials.get(&(name, road))?;
        let failed: Vec<f64> = seeds
            .values()
            .filter_map(|trials| fails_at(trials, level))
            .map(|fails| f64::from(u8::from(fails)))
            .collect();
        (!failed.is_empty()).then(|| mean(&failed))
    }

    /// What each fails at these perturbations and levels, on each road: the mean over those of which both tell it.
    fn shares(&self, names: &[String], levels: &[f64]) -> (Vec<Option<f64>>, Vec<Option<f64>>) {
        let of_road = |road: &String| {
            let (mut base, mut other) = (Vec::new(), Vec::new());
            for name in names {
                for level in levels {
                    let at = |trials| Self::share_at(trials, name, road, *level);
                    if let (Some(a), Some(b)) = (at(&self.base.1), at(&self.other.1)) {
                        base.push(a);
                        other.push(b);
                    }
                }
            }
            (!base.is_empty()).then(|| (mean(&base), mean(&other)))
        };
        let shares: Vec<Option<(f64, f64)>> = self.roads.iter().map(of_road).collect();
        (shares.iter().map(|s| s.map(|s| s.0)).collect(), shares.iter().map(|s| s.map(|s| s.1)).collect())
    }

    /// The mean share of each, and by how much the other fails more.
    fn differ(&self, names: &[String], levels: &[f64]) -> Option<(f64, f64, Paired)> {
        let (base, other) = self.shares(names, levels);
        let paired = compare(&other, &base, SHARE, CONFIDENCE)?;
        let over_roads = |shares: &[Option<f64>]| mean(&shares.iter().copied().flatten().collect::<Vec<_>>());
        Some((over_roads(&base), over_roads(&other), paired))
    }

    fn all(&self) -> Option<(f64, f64, Paired)> {
        self.differ(&self.names, &self.levels)
    }

    fn rows(&self) -> Vec<Row> {
        let row = |perturbation: &str, figures: (f64, f64, Paired)| Row {
            perturbation: perturbation.to_owned(),
            base: percent(figures.0),
            other: percent(figures.1),
            difference: difference(Some(figures.2)),
            figures,
        };
        let all = self.all().map(|figures| row("all", figures));
        let single = self.names.iter().filter_map(|name| {
            let figures = self.differ(std::slice::from_ref(name), &self.levels)?;
            Some(row(name, figures))
        });
        all.into_iter().chain(single).collect()
    }

    fn grids(&self) -> [Grid; 3] {
        let mut entries: [Vec<Entry>; 3] = Default::default();
        for name in &self.names {
            for level in &self.levels {
                let figures = self.differ(std::slice::from_ref(name), std::slice::from_ref(level));
                let Some((base, other, paired)) = figures else { continue };
                let at = format!("{name} at level {}", short(*level));
                let on = count(paired.roads, "road");
                let more = paired.difference.value;
                let hue = if more > 0.0 { Hue::Failed } else { Hue::Better };
                let told = format!(
                    "{at}: {} fails on {}, {} on {}; 95 % of the difference: {:+.0} to {:+.0} %; {on} that both drove",
                    self.base.0.driver,
                    percent(base),
                    self.other.0.driver,
                    percent(other),
                    100.0 * paired.difference.low,
                    100.0 * paired.difference.high
                );
                let alone = |drive: &Drive, share: f64| {
                    let title = format!("{at}: {} fails on {} of {on}", drive.driver, percent(share));
                    Cell::new(percent(share), title, Hue::Failed, share).of(Some(share))
                };
                let text = if more == 0.0 { "0".to_owned() } else { format!("{:+.0} %", 100.0 * more) };
                let cells = [
                    alone(self.base.0, base),
                    alone(self.other.0, other),
                    Cell::new(text, told, hue, more.abs()).of(Some(more)),
                ];
                for (entries, cell) in entries.iter_mut().zip(cells) {
                    entries.push(Entry { row: Some(name.clone()), level: Some(*level), cell });
                }
            }
        }
        let share = vec![Ramp::new(Hue::Failed, "none failed", "all failed")];
        let difference = vec![
            Ramp::new(Hue::Better, "no difference", "fails nowhere, the other everywhere"),
            Ramp::new(Hue::Failed, "no difference", "fails everywhere, the other nowhere"),
        ];
        let legends = [share.clone(), share, difference];
        let mut grids = entries.iter().zip(legends);
        std::array::from_fn(|_| match grids.next() {
            Some((entries, legend)) => Columns::Exact.grid(entries, &self.names, legend),
            None => Columns::Exact.grid(&[], &[], Vec::new()),
        })
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The same scenario as the base and as the other drove it.
type Pairs<'a> = Vec<(&'a Scenario, &'a Scenario)>;

/// Of the scenarios that both drove: how many there are, how many both fail, only the other, only the base, and none; then those that
/// only one of them fails. Repeats are paired by their numbers.
fn outcomes<'a>(base: &'a Drive, other: &'a Drive) -> ([usize; 5], Pairs<'a>, Pairs<'a>) {
    type Key<'a> = (&'a str, Option<&'a str>, Option<u64>, u64);
    let of = |drive: &'a Drive| {
        let mut scenarios: BTreeMap<Key<'a>, Vec<&'a Scenario>> = BTreeMap::new();
        for scenario in drive.scenarios.iter().filter(|s| s.verdict != Verdict::Void) {
            let place = (
                scenario.road_id.as_str(),
                scenario.perturbation.as_deref(),
                scenario.level.map(key),
                scenario.repeat,
            );
            scenarios.entry(place).or_default().push(scenario);
        }
        scenarios
    };
    let others = of(other);
    let (mut counts, mut only_other, mut only_base) = ([0; 5], Vec::new(), Vec::new());
    for (place, ours) in of(base) {
        for (base, other) in ours.iter().zip(others.get(&place).into_iter().flatten()) {
            counts[0] += 1;
            match (base.verdict.failed(), other.verdict.failed()) {
                (true, true) => counts[1] += 1,
                (false, true) => {
                    counts[2] += 1;
                    only_other.push((*base, *other));
                }
                (true, false) => {
                    counts[3] += 1;
                    only_base.push((*base, *other));
                }
                (false, false) => counts[4] += 1,
            }
        }
    }
    (counts, only_other, only_base)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten roads, five levels: each perturbation fails from a level on.
    fn drive(driver: &str, fails: &[(&str, f64)]) -> Drive {
        let at = |name: &str, road: usize, level: f64, failed: bool| Scenario {
            name: format!("{name}@{level}"),
            perturbation: Some(name.to_owned()),
            level: Some(level),
            road_id: road.to_string(),
            verdict: if failed { Verdict::Unsafe } else { Verdict::Passed },
            replay: format!("replay {driver}"),
            ..Scenario::default()
        };
        let levels = || (0..5).map(f64::from);
        let scenarios = fails.iter().flat_map(|(name, from)| {
            (0..10).flat_map(move |road| levels().map(move |level| at(name, road, level, level >= *from)))
        });
        Drive {
            simulator: "lane".into(),
            driver: driver.into(),
            scenarios: scenarios.collect(),
            ..Drive::default()
        }
    }

    #[test]
    fn drivers_are_compared_where_both_drove() {
        let (a, b) = (drive("a", &[("fog", 3.0), ("rain", 9.0)]), drive("b", &[("fog", 2.0)]));
        let found = comparison(&a, &b).unwrap();
        assert_eq!((found.base.as_str(), found.other.as_str()), ("a", "b"));
        let rows: Vec<_> =
            found.rows.iter().map(|row| (row.perturbation.as_str(), row.difference.value.as_str())).collect();
        assert_eq!(rows, [("all", "+20 %"), ("fog", "+20 %")]);
        assert_eq!(found.rows[1].difference.p, "< 0.001");
        let texts = |grid: &Grid| -> Vec<String> {
            grid.rows[0].cells.iter().flatten().map(|cell| cell.text.clone()).collect()
        };
        assert_eq!(texts(&found.grids[0]), ["0 %", "0 %", "0 %", "100 %", "100 %"]);
        assert_eq!(texts(&found.grids[2]), ["0", "0", "+100 %", "0", "0"]);
        assert_eq!(found.outcomes, [50, 20, 10, 0, 20]);
        assert_eq!((found.only_other.len(), found.only_other[0].1.as_str()), (10, "replay b"));
        assert!(found.only_base.is_empty() && found.roads.is_empty(), "no simulator reported a road");
    }

    #[test]
    fn repeats_are_paired_by_their_numbers_though_one_is_void() {
        let repeats = |driver: &str, verdicts: [Verdict; 3]| {
            let mut drive = drive(driver, &[("fog", 9.0)]);
            drive.scenarios.truncate(1);
            let one = drive.scenarios.remove(0);
            drive.scenarios = (0..)
                .zip(verdicts)
                .map(|(repeat, verdict)| Scenario { repeat, verdict, ..one.clone() })
                .collect();
            drive
        };
        let base = repeats("a", [Verdict::Void, Verdict::Unsafe, Verdict::Passed]);
        let other = repeats("b", [Verdict::Passed, Verdict::Unsafe, Verdict::Passed]);
        let (counts, only_other, only_base) = outcomes(&base, &other);
        assert_eq!((counts, only_other.len(), only_base.len()), ([2, 1, 0, 0, 1], 0, 0));
    }

    #[test]
    fn drives_that_only_one_fails_are_laid_over_each_other() {
        let (mut a, mut b) = (drive("a", &[("fog", 3.0)]), drive("b", &[("fog", 2.0)]));
        for drive in [&mut a, &mut b] {
            drive.roads = vec![vec![[0.0, 0.0], [0.0, 50.0]]];
            for scenario in &mut drive.scenarios {
                let place = |z: f64| crate::view::Place { x: 0.5, z, error: 0.5 };
                (scenario.road, scenario.path) = (Some(0), vec![place(0.0), place(30.0)]);
            }
        }
        let found = comparison(&a, &b).unwrap();
        assert_eq!(found.roads.len(), OVERLAYS / 2);
        let road = &found.roads[0];
        assert!(COLORS.iter().all(|color| road.body.contains(&color.to_string())), "{}", road.body);
        assert_eq!((road.caption.as_str(), road.body.matches("class=\"mark\"").count()), ("fog@2", 1));
    }

    #[test]
    fn a_sentence_says_which_one_is_better_or_that_nothing_says_it() {
        let (a, b) = (drive("a", &[("fog", 3.0)]), drive("b", &[("fog", 1.0)]));
        let worse = sentence(&a, &b).unwrap();
        assert!(
            worse.starts_with(
                "b is worse than a: b fails 80 % of the levels and a 40 % (difference +40 %, 95 %: +"
            ),
            "{worse}"
        );
        assert!(
            sentence(&b, &a)
                .unwrap()
                .starts_with("a is better than b: a fails 40 % of the levels and b 80 %")
        );
        assert!(
            sentence(&a, &drive("c", &[("fog", 3.0)])).unwrap().starts_with("c and a cannot be told apart")
        );
        assert!(sentence(&a, &drive("d", &[("snow", 3.0)])).is_none());
    }

    #[test]
    fn a_driver_is_compared_with_the_first_in_its_simulator() {
        let other = Drive { simulator: "other".into(), ..drive("a", &[]) };
        let drives = [drive("a", &[]), drive("b", &[]), other, drive("c", &[])];
        let names: Vec<_> =
            pairs(&drives).into_iter().map(|(a, b)| (a.driver.as_str(), b.driver.as_str())).collect();
        assert_eq!(names, [("a", "b"), ("a", "c")]);
    }
}
