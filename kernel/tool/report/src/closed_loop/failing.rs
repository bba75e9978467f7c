//! The level from which on each perturbation makes a driver fail, and the picture of these levels.

use std::collections::BTreeMap;

use pdk_statistics::CONFIDENCE;
use pdk_statistics::level::{Trial, failing_level};

use crate::color::LINES;
use crate::conclusions::{Trials, on_roads, roads, told, trials};
use crate::tally::by_severity;
use crate::text::{count, short};
use crate::tracks::{self, Row, Track, Tracks};
use crate::view::Drive;

/// Drives that share a picture; more are shown one by one.
pub const TOGETHER: usize = 4;
/// With fewer roads the interval reaches over all levels.
pub const FEWEST_ROADS: usize = 4;

/// What is known about the level from which on a perturbation makes a driver fail.
#[derive(Debug, Clone, PartialEq)]
pub struct Failing {
    /// The perturbation.
    pub name: String,
    /// The level; none if it is not reached.
    pub level: Option<f64>,
    /// The ends of its interval, none if above all levels. On a single road, which has no interval: the highest level below the failures
    /// that was survived, none if there is none, and the lowest that failed.
    pub low: Option<f64>,
    /// The upper end.
    pub high: Option<f64>,
    /// The highest level at which it was driven, which may lie below that of others.
    pub highest: f64,
    /// On how many roads it was driven.
    pub roads: usize,
    /// How many drives tell it.
    pub drives: usize,
    /// Whether anything failed at all.
    pub any_failed: bool,
}

impl Failing {
    /// The level and its interval as texts.
    pub fn told(&self) -> (String, String) {
        if self.roads > 1 {
            let found = pdk_statistics::level::FailingLevel {
                level: self.level,
                low: self.low,
                high: self.high,
                highest: self.highest,
                drives: self.drives,
            };
            return told(&found);
        }
        let level = match (self.low, self.high) {
            (_, None) => "never".to_owned(),
            (None, Some(failed)) => format!("{} or less", short(failed)),
            (Some(survived), Some(failed)) => format!("{} to {}", short(survived), short(failed)),
        };
        (level, String::new())
    }

    /// How bad it is, larger is less bad.
    fn rank(&self, highest: f64) -> f64 {
        self.level.unwrap_or(highest + 1.0)
    }
}

/// The highest level that was driven.
pub fn highest<'a>(drives: impl IntoIterator<Item = &'a Drive>) -> f64 {
    let levels = drives.into_iter().flat_map(|drive| drive.scenarios.iter().filter_map(|s| s.level));
    levels.fold(0.0, f64::max)
}

/// What is known of each perturbation that was driven at single levels, the worst first.
pub fn failing(drive: &Drive) -> Vec<Failing> {
    let (roads, trials) = (roads(drive), trials(drive));
    let of = |name: &String| found(name, &roads, &trials);
    let order = by_severity([drive.scenarios.as_slice()]);
    let mut all: Vec<Failing> = order.iter().filter_map(|(name, _)| of(name)).collect();
    let highest = highest([drive]);
    all.sort_by(|a, b| a.rank(highest).total_cmp(&b.rank(highest)));
    all
}

fn found(name: &str, roads: &[String], trials: &Trials<'_>) -> Option<Failing> {
    let on_roads = on_roads(trials, name, roads);
    let driven: Vec<_> = on_roads.into_iter().filter(|seeds| !seeds.is_empty()).collect();
    let found = failing_level(&driven, CONFIDENCE)?;
    let all: Vec<Trial> = driven.iter().flatten().flatten().copied().collect();
    let failed = all.iter().filter(|trial| trial.failed).map(|trial| trial.level);
    let lowest = failed.min_by(f64::total_cmp);
    let survived = all.iter().filter(|trial| !trial.failed).map(|trial| trial.level);
    let below = survived.filter(|level| lowest.is_some_and(|lowest| *level < lowest));
    let (level, low, high) = match driven.len() {
        1 => (lowest, below.max_by(f64::total_cmp), lowest),
        _ => (found.level, found.low, found.high),
    };
    Some(Failing {
        name: name.to_owned(),
        level,
        low,
        high,
        highest: found.highest,
        roads: driven.len(),
        drives: found.drives,
        any_failed: lowest.is_some(),
    })
}

/// The picture of the failing levels of some drives on one scale; none if no perturbation has levels.
pub fn picture(drives: &[&Drive]) -> Option<Tracks> {
    let highest = highest(drives.iter().copied());
    let of_drives: Vec<BTreeMap<String, Failing>> = drives
        .iter()
        .map(|drive| failing(drive).into_iter().map(|found| (found.name.clone(), found)).collect())
        .collect();
    let order = by_severity(drives.iter().map(|drive| drive.scenarios.as_slice()));
    let mean = |name: &String| {
        let ranks: Vec<f64> = of_drives.iter().filter_map(|of| Some(of.get(name)?.rank(highest))).collect();
        (!ranks.is_empty()).then(|| ranks.iter().sum::<f64>() / ranks.len() as f64)
    };
    let mut names: Vec<(f64, String)> =
        order.into_iter().filter_map(|(name, _)| Some((mean(&name)?, name))).collect();
    names.sort_by(|a, b| a.0.total_cmp(&b.0));
    if names.is_empty() {
        return None;
    }
    let one_simulator = drives.iter().all(|drive| drive.simulator == drives[0].simulator);
    let series = match drives {
        [_] => Vec::new(),
        _ => drives
            .iter()
            .zip('A'..)
            .zip(LINES)
            .map(|((drive, key), color)| (key.to_string(), title(drive, one_simulator), color))
            .collect(),
    };
    let rows = names
        .into_iter()
        .map(|(_, name)| Row {
            tracks: of_drives
                .iter()
                .zip(drives)
                .map(|(of, drive)| of.get(&name).map(|found| track(found, drive, highest)))
                .collect(),
            label: name,
        })
        .collect();
    let whole = (0..=highest.floor() as u32).map(f64::from);
    let one_road = of_drives.iter().flat_map(BTreeMap::values).all(|found| found.roads < 2);
    Some(Tracks {
        title: "Level from which on the driver fails, the worst perturbation first".to_owned(),
        note: match one_road {
            true => "There is one road, so there are no intervals: a bar lies between the highest level that was survived there and the lowest \
                     that failed."
                .to_owned(),
            false => format!(
                "A dot is the level at which the probability of failing reaches one half, a bar its interval of 95 %. A ring stands for a \
                 driver that does not fail half of the time up to {}; its interval may reach down to levels at which it could.",
                match of_drives.iter().flat_map(BTreeMap::values).all(|found| found.highest == highest) {
                    true => format!("level {}", short(highest)),
                    false => "the highest level at which the perturbation was driven".to_owned(),
                }
            ),
        },
        scale: "level".to_owned(),
        ticks: whole.map(|level| (short(level), tracks::place(level, highest, true))).collect(),
        beyond: Some(("above".to_owned(), tracks::limit())),
        reference: None,
        series,
        rows,
    })
}

fn title(drive: &Drive, one_simulator: bool) -> String {
    match one_simulator {
        true => drive.driver.clone(),
        false => format!("{} in {}", drive.driver, drive.simulator),
    }
}

fn track(found: &Failing, drive: &Drive, highest: f64) -> Track {
    let at = |level: Option<f64>| level.map_or(tracks::beyond(), |level| tracks::place(level, highest, true));
    let (text, interval) = found.told();
    let driven = format!("{} on {}", count(found.drives, "drive"), count(found.roads, "road"));
    let told = match (found.roads, found.level, found.low) {
        (1, None, _) => format!("survived every level up to {}", short(found.highest)),
        (1, Some(failed), None) => format!("failed level {}, the lowest that says it", short(failed)),
        (1, Some(failed), Some(survived)) => {
            format!("survived level {} and failed level {}", short(survived), short(failed))
        }
        (_, None, _) => {
            format!("does not fail half of the time up to level {} (95 %: {interval})", short(found.highest))
        }
        _ => format!("fails from level {text} on (95 %: {interval})"),
    };
    let single = found.roads == 1;
    let low = match (single, found.low, found.level) {
        // It may fail from the lowest level on.
        (true, None, Some(_)) => tracks::place(0.0, highest, true),
        (_, low, _) => at(low),
    };
    Track {
        at: (!single || found.level.is_none()).then(|| at(found.level)),
        low,
        high: at(found.high),
        is_open: found.high.is_none(),
        is_reached: found.level.is_some(),
        text,
        interval,
        sentence: format!("{}, {}: {told}; {driven}", found.name, drive.driver),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Scenario, Verdict};

    /// Drives at levels on some roads, of which a perturbation fails from a level on.
    fn drive(driver: &str, roads: usize, fails: &[(&str, f64)]) -> Drive {
        let at = |name: &str, road: usize, level: f64, failed: bool| Scenario {
            perturbation: Some(name.to_owned()),
            level: Some(level),
            road_id: road.to_string(),
            verdict: if failed { Verdict::Unsafe } else { Verdict::Passed },
            time: 5.0,
            ..Scenario::default()
        };
        let levels = || [1.0, 2.0, 4.0].into_iter();
        let scenarios = fails.iter().flat_map(|(name, from)| {
            (0..roads).flat_map(move |road| levels().map(move |level| at(name, road, level, level >= *from)))
        });
        Drive { driver: driver.into(), scenarios: scenarios.collect(), ..Drive::default() }
    }

    #[test]
    fn on_one_road_a_level_lies_between_what_was_survived_and_what_failed() {
        let drive = drive("a", 1, &[("rain", 9.0), ("snow", 4.0), ("fog", 0.0)]);
        let told: Vec<_> = failing(&drive).iter().map(|found| (found.name.clone(), found.told().0)).collect();
        let expected = [("fog", "1 or less"), ("snow", "2 to 4"), ("rain", "never")];
        assert_eq!(told, expected.map(|(name, level)| (name.to_owned(), level.to_owned())));
        let picture = picture(&[&drive]).unwrap();
        assert!(picture.note.contains("one road") && picture.series.is_empty());
        let [fog, snow, rain] = [0, 1, 2].map(|row: usize| picture.rows[row].tracks[0].clone().unwrap());
        assert!(fog.at.is_none() && fog.low < snow.low && fog.is_reached);
        assert!((snow.low, snow.high) == (tracks::place(2.0, 4.0, true), tracks::place(4.0, 4.0, true)));
        assert!(rain.at == Some(tracks::beyond()) && !rain.is_reached && rain.is_open);
        assert_eq!(snow.sentence, "snow, a: survived level 2 and failed level 4; 3 drives on 1 road");
    }

    #[test]
    fn what_was_driven_to_lower_levels_is_not_said_to_survive_higher_ones() {
        for (roads, survived) in [(1, "survived every level up to 2"), (10, "up to level 2")] {
            let mut drive = drive("a", roads, &[("fog", 9.0), ("rain", 9.0)]);
            drive.scenarios.retain(|s| s.perturbation.as_deref() != Some("fog") || s.level < Some(4.0));
            let picture = picture(&[&drive]).unwrap();
            let fog = picture.rows.iter().find(|row| row.label == "fog").unwrap();
            let sentence = &fog.tracks[0].as_ref().unwrap().sentence;
            assert!(sentence.contains(survived) && !sentence.contains('4'), "{sentence}");
            assert_eq!(failing(&drive).iter().map(|found| found.highest).fold(0.0, f64::max), 4.0);
        }
    }

    #[test]
    fn several_drives_share_one_scale() {
        let (a, b) = (drive("a", 10, &[("fog", 2.0), ("rain", 4.0)]), drive("b", 10, &[("rain", 1.0)]));
        let picture = picture(&[&a, &b]).unwrap();
        let labels: Vec<&str> = picture.rows.iter().map(|row| row.label.as_str()).collect();
        assert_eq!(labels, ["fog", "rain"]);
        assert!(picture.rows[0].tracks[1].is_none());
        let names: Vec<&str> = picture.series.iter().map(|(_, name, _)| name.as_str()).collect();
        assert_eq!(names, ["a", "b"]);
        let fog = picture.rows[0].tracks[0].as_ref().unwrap();
        assert_eq!((fog.text.as_str(), fog.interval.as_str()), ("1.5", "1 to 2"));
        assert!(picture.ticks.len() == 5 && fog.low < fog.at.unwrap() && fog.at.unwrap() < fog.high);
    }
}
