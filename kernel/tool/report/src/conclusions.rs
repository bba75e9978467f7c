//! What can be concluded, and how sure it is: perturbations in groups, the levels at which they make the driver fail, and differences
//! to a clear view and to another driver. Roads are the unit throughout.

use std::collections::{BTreeMap, BTreeSet};

use pdk_statistics::CONFIDENCE;
use pdk_statistics::Estimate;
use pdk_statistics::groups::groups;
use pdk_statistics::level::{FailingLevel, Trial, failing_level};
use pdk_statistics::paired::{Paired, compare};
use serde::Serialize;

use crate::tally::{Tally, by_severity};
use crate::text::{p_value, percent, signed_percent};
use crate::view::{Drive, Verdict};

/// What a share can be.
const SHARE: (f64, f64) = (0.0, 1.0);

/// What can be concluded about a drive.
#[derive(Debug, Serialize)]
pub struct Conclusions {
    /// A row for each perturbation, the worst first.
    pub rows: Vec<Row>,
    /// The highest level that was driven.
    pub highest: String,
    /// How many roads there are.
    pub roads: usize,
    /// Whether there is only one, from which nothing follows about others.
    is_on_one_road: bool,
    /// Whether there are several groups, vehicles that stopped, and vehicles that were too slow.
    with_groups: bool,
    with_stopped: bool,
    with_late: bool,
}

/// A perturbation.
#[derive(Debug, Serialize)]
pub struct Row {
    /// Rows of a group cannot be told apart.
    pub group: usize,
    /// The perturbation.
    pub perturbation: String,
    /// The figures behind the texts.
    #[serde(skip)]
    pub figures: Figures,
    failed: String,
    share: String,
    interval: String,
    stopped: usize,
    late: usize,
    fails_at: String,
    level_interval: String,
    /// Less the share that failed without perturbation on the same roads.
    difference: Difference,
}

/// What a row is made of.
#[derive(Debug)]
pub struct Figures {
    /// Drives that failed, and all that say something.
    pub drives: (usize, usize),
    /// The share of levels that fail.
    pub share: Option<Estimate>,
    /// What it fails more often than without perturbation.
    pub difference: Option<Paired>,
}

/// A difference as a table has it.
#[derive(Debug, Default, Serialize)]
pub struct Difference {
    /// The mean difference.
    pub value: String,
    /// Its interval.
    pub interval: String,
    /// The rank-biserial correlation.
    pub effect_size: String,
    /// The p-value.
    pub p: String,
}

/// What can be concluded about a drive.
pub fn conclusions(drive: &Drive) -> Conclusions {
    let order = by_severity([drive.scenarios.as_slice()]);
    let roads = roads(drive);
    let trials = trials(drive);
    let nominal = Tally::of(drive.scenarios.iter().filter(|s| s.perturbation.is_none()));
    let shares: Vec<Vec<Option<f64>>> = order.iter().map(|(_, tally)| tally.shares(&roads)).collect();
    let groups = groups(&shares, CONFIDENCE);
    let highest = drive.scenarios.iter().filter_map(|s| s.level).fold(0.0, f64::max);
    let rows = order
        .iter()
        .zip(&shares)
        .zip(groups)
        .filter(|(((_, tally), _), _)| tally.judged > 0)
        .map(|(((name, tally), shares), group)| {
            let found = failing_level(&on_roads(&trials, name, &roads), CONFIDENCE);
            let estimate = tally.estimate();
            let (fails_at, level_interval) = found.map_or_else(Default::default, |found| told(&found));
            let paired = compare(shares, &nominal.shares(&roads), SHARE, CONFIDENCE);
            Row {
                group,
                perturbation: name.clone(),
                figures: Figures {
                    drives: (tally.failed, tally.judged),
                    share: estimate,
                    difference: paired,
                },
                failed: format!("{} of {}", tally.failed, tally.judged),
                share: estimate.map_or_else(String::new, |share| percent(share.value)),
                interval: estimate.map_or_else(String::new, |share| interval(&share, percent)),
                stopped: tally.stopped,
                late: tally.late,
                fails_at,
                level_interval,
                difference: difference(paired),
            }
        })
        .collect();
    let rows: Vec<Row> = rows;
    Conclusions {
        // One road has no share that could differ from others, no interval and no test.
        is_on_one_road: roads.len() < 2,
        with_groups: rows.iter().any(|row| row.group > 1),
        with_stopped: rows.iter().any(|row| row.stopped > 0),
        with_late: rows.iter().any(|row| row.late > 0),
        rows: if roads.len() < 2 { Vec::new() } else { rows },
        highest: crate::text::short(highest),
        roads: roads.len(),
    }
}

/// The roads of a drive, in a fixed order.
pub fn roads(drive: &Drive) -> Vec<String> {
    let roads: BTreeSet<&String> = drive.scenarios.iter().map(|scenario| &scenario.road_id).collect();
    roads.into_iter().cloned().collect()
}

/// Drives by perturbation and road, as far as they have one level; those of each seed by themselves, which had the same luck.
pub type Trials<'a> = BTreeMap<(&'a str, &'a str), BTreeMap<u64, Vec<Trial>>>;

/// The trials of a drive.
pub fn trials(drive: &Drive) -> Trials<'_> {
    let mut trials = Trials::new();
    for scenario in drive.scenarios.iter().filter(|scenario| scenario.verdict != Verdict::Void) {
        if let (Some(perturbation), Some(level)) = (&scenario.perturbation, scenario.level) {
            let trial = Trial { level, failed: scenario.verdict.failed() };
            let on_road = trials.entry((perturbation, &scenario.road_id)).or_default();
            on_road.entry(scenario.seed).or_default().push(trial);
        }
    }
    trials
}

/// Those of a perturbation on each of these roads, with each of their seeds.
pub fn on_roads(trials: &Trials<'_>, perturbation: &str, roads: &[String]) -> Vec<Vec<Vec<Trial>>> {
    let on_road = |road: &String| {
        let of_seeds = trials.get(&(perturbation, road.as_str())).into_iter().flat_map(BTreeMap::values);
        of_seeds.cloned().collect()
    };
    roads.iter().map(on_road).collect()
}

fn interval(estimate: &Estimate, written: fn(f64) -> String) -> String {
    format!("{} to {}", written(estimate.low), written(estimate.high))
}

/// A failing level and its interval.
pub fn told(found: &FailingLevel) -> (String, String) {
    let of = |level: Option<f64>| match level {
        Some(level) => crate::text::level(level),
        None => format!("above {}", crate::text::short(found.highest)),
    };
    let level = found.level.map_or("never".to_owned(), crate::text::level);
    let interval = match found.low {
        Some(_) => format!("{} to {}", of(found.low), of(found.high)),
        None => of(None),
    };
    (level, interval)
}

/// A difference as texts; empty if there is none.
pub fn difference(paired: Option<Paired>) -> Difference {
    let Some(Paired { difference, effect_size, p, .. }) = paired else { return Difference::default() };
    Difference {
        value: signed_percent(difference.value),
        interval: interval(&difference, percent),
        effect_size: format!("{effect_size:.2}"),
        p: p_value(p),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Scenario;

    /// Ten roads, five levels: the perturbation `name` fails from a level on.
    fn drive(driver: &str, fails: &[(&str, f64)]) -> Drive {
        let mut scenarios = Vec::new();
        for road in 0..10 {
            let at = |name: Option<&str>, level: f64, failed: bool| Scenario {
                perturbation: name.map(str::to_owned),
                level: name.map(|_| level),
                road_id: road.to_string(),
                verdict: if failed { Verdict::Unsafe } else { Verdict::Passed },
                time: 5.0,
                ..Scenario::default()
            };
            scenarios.push(at(None, 0.0, false));
            for (name, from) in fails {
                scenarios.extend((0..5).map(f64::from).map(|level| at(Some(name), level, level >= *from)));
            }
        }
        Drive { simulator: "lane".into(), driver: driver.into(), scenarios, ..Drive::default() }
    }

    #[test]
    fn those_that_never_fail_share_a_group_and_say_how_often_they_may() {
        let drive = drive("a", &[("fog", 2.0), ("rain", 9.0), ("snow", 9.0)]);
        let found = conclusions(&drive);
        let told: Vec<_> = found
            .rows
            .iter()
            .map(|row| (row.group, row.perturbation.as_str(), row.fails_at.as_str(), row.interval.as_str()))
            .collect();
        assert_eq!(told[0].0, 1);
        assert_eq!((told[0].1, told[0].2), ("fog", "1.5"));
        assert_eq!(told[1], (2, "rain", "never", "0 % to 28 %"));
        assert_eq!((told[2].0, told[2].1), (2, "snow"));
        assert_eq!(found.rows[1].level_interval, "above 4");
        assert_eq!(
            (found.rows[0].difference.value.as_str(), found.rows[0].difference.effect_size.as_str()),
            ("+60 %", "1.00")
        );
        assert_eq!(found.rows[1].difference.value, "0 %");
        assert_eq!((found.roads, found.highest.as_str()), (10, "4"));
    }

    #[test]
    fn a_bisection_that_only_went_on_where_drives_failed_says_no_more_than_all_levels() {
        // Of three repeats on each road one fails, from level 2 on.
        let mut scenarios = Vec::new();
        for (road, seed) in (0..8).flat_map(|road| (0..3).map(move |seed| (road, seed))) {
            let levels: &[f64] = if seed == 0 { &[4.0, 0.0, 2.0, 1.0] } else { &[4.0] };
            scenarios.extend(levels.iter().map(|&level| Scenario {
                perturbation: Some("fog".into()),
                level: Some(level),
                road_id: road.to_string(),
                seed,
                verdict: if seed == 0 && level >= 2.0 { Verdict::Unsafe } else { Verdict::Passed },
                time: 5.0,
                ..Scenario::default()
            }));
        }
        let drive = Drive { simulator: "lane".into(), driver: "a".into(), scenarios, ..Drive::default() };
        let found = conclusions(&drive);
        let row = &found.rows[0];
        assert_eq!((row.failed.as_str(), row.share.as_str()), ("16 of 48", "20 %"));
        assert_eq!((row.fails_at.as_str(), row.level_interval.as_str()), ("never", "above 4"));
    }
}
