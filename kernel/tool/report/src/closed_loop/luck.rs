//! Drives of the same scenario that came out differently, as in a simulator with its own clock: how often, and how much of what
//! perturbations do is more than that.

use std::collections::BTreeMap;

use pdk_statistics::drives::Drives;
use pdk_statistics::repeats::{Apart, apart, flips};
use pdk_statistics::{CONFIDENCE, Estimate};
use serde::Serialize;

use crate::tally::by_severity;
use crate::text::{count, percent, signed_percent};
use crate::view::{Drive, Verdict};

/// What is known of drives that were repeated.
#[derive(Debug, Serialize)]
pub struct Luck {
    /// How often a second drive comes out differently, as a sentence.
    pub sentence: String,
    /// A row for each perturbation that was repeated on roads on which a clear view was repeated as well.
    pub rows: Vec<Row>,
}

/// A perturbation beside a clear view.
#[derive(Debug, Serialize)]
pub struct Row {
    perturbation: String,
    differ: String,
    luck: String,
    beyond: String,
    interval: String,
    roads: usize,
}

/// A scenario: its road, its perturbation, its level and its seed.
type Key<'a> = (&'a str, Option<&'a str>, Option<u64>, u64);

/// What is known of a drive; none if no scenario was repeated.
pub fn luck(drive: &Drive) -> Option<Luck> {
    let mut repeats: BTreeMap<Key<'_>, BTreeMap<u64, bool>> = BTreeMap::new();
    for scenario in drive.scenarios.iter().filter(|scenario| scenario.verdict != Verdict::Void) {
        let level = scenario.level.map(f64::to_bits);
        let key = (scenario.road_id.as_str(), scenario.perturbation.as_deref(), level, scenario.seed);
        repeats.entry(key).or_default().insert(scenario.repeat, scenario.verdict.failed());
    }
    let scenarios: BTreeMap<Key<'_>, Drives> = repeats
        .into_iter()
        .map(|(key, drives)| {
            let failed = drives.values().filter(|failed| **failed).count() as u64;
            (key, Drives { failed, of: drives.len() as u64 })
        })
        .collect();
    let of = |wanted: &dyn Fn(&Key<'_>) -> bool| -> Vec<Drives> {
        scenarios.iter().filter(|(key, _)| wanted(key)).map(|(_, drives)| *drives).collect()
    };
    let all = flips(&of(&|_| true), CONFIDENCE)?;
    let repeated = scenarios.values().filter(|drives| drives.of > 1).count();
    let parts = [("with a clear view", false), ("under perturbations", true)];
    let parts: Vec<String> = parts
        .iter()
        .filter_map(|(words, perturbed)| {
            let found = flips(&of(&|key| key.1.is_some() == *perturbed), CONFIDENCE)?;
            Some(format!("{words} in {}", told(&found)))
        })
        .collect();
    let parts = if parts.len() > 1 { format!(": {}", parts.join(", ")) } else { String::new() };
    let sentence = format!(
        "Of {} that {} drove again, a second drive came out differently in {} (95 %: {} to {} %){parts}.",
        count(repeated, "scenario"),
        drive.driver,
        percent(all.value),
        whole(all.low),
        whole(all.high)
    );
    let order = by_severity([drive.scenarios.as_slice()]);
    let row = |(name, _): &(String, _)| {
        let found = beside_clear(&scenarios, name)?;
        Some(Row {
            perturbation: name.clone(),
            differ: told(&found.differ),
            luck: told(&found.luck),
            beyond: signed_percent(found.beyond.value),
            interval: format!("{:+.0} to {:+.0} %", 100.0 * found.beyond.low, 100.0 * found.beyond.high),
            roads: found.units,
        })
    };
    Some(Luck { sentence, rows: order.iter().filter_map(row).collect() })
}

fn told(found: &Estimate) -> String {
    format!("{} ({} to {} %)", percent(found.value), whole(found.low), whole(found.high))
}

/// A share in percent without its sign.
fn whole(share: f64) -> String {
    format!("{:.0}", 100.0 * share)
}

/// A perturbation beside a clear view on the same roads.
fn beside_clear(scenarios: &BTreeMap<Key<'_>, Drives>, name: &str) -> Option<Apart> {
    let mut roads: BTreeMap<&str, Vec<(Drives, Drives)>> = BTreeMap::new();
    let clear = scenarios.iter().filter(|((_, perturbation, ..), _)| perturbation.is_none());
    for ((road, ..), clear) in clear {
        let perturbed = scenarios
            .iter()
            .filter(|((other, perturbation, ..), _)| other == road && *perturbation == Some(name));
        roads.entry(road).or_default().extend(perturbed.map(|(_, drives)| (*clear, *drives)));
    }
    let units: Vec<Vec<(Drives, Drives)>> = roads.into_values().collect();
    apart(&units, CONFIDENCE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Scenario;

    /// Twelve roads, each driven by turns: `failed` says for a perturbation and the number of a drive whether it fails.
    fn drive(repeats: u32, failed: impl Fn(usize, Option<&str>, u32) -> bool) -> Drive {
        let mut scenarios = Vec::new();
        for road in 0..12 {
            for perturbation in [None, Some("fog"), Some("rain")] {
                for number in 0..repeats {
                    let verdict = match failed(road, perturbation, number) {
                        true => Verdict::Unsafe,
                        false => Verdict::Passed,
                    };
                    scenarios.push(Scenario {
                        perturbation: perturbation.map(str::to_owned),
                        level: perturbation.map(|_| 2.0),
                        road_id: road.to_string(),
                        seed: 7,
                        repeat: u64::from(number),
                        verdict,
                        ..Scenario::default()
                    });
                }
            }
        }
        Drive { driver: "x".into(), scenarios, ..Drive::default() }
    }

    #[test]
    fn luck_and_what_a_perturbation_does_are_apart() {
        // On every other road drives fail by turns, whatever they see. Under fog, all fail.
        let by_turns = |road: usize, number: u32| road.is_multiple_of(2) && number.is_multiple_of(2);
        let found = luck(&drive(2, |road, perturbation, number| match perturbation {
            Some("fog") => true,
            _ => by_turns(road, number),
        }))
        .unwrap();
        assert!(
            found.sentence.starts_with(
                "Of 36 scenarios that x drove again, a second drive came out differently in 33 % ("
            ),
            "{}",
            found.sentence
        );
        assert!(found.sentence.contains("%): with a clear view in 50 % ("), "{}", found.sentence);
        let rows: Vec<(&str, &str)> =
            found.rows.iter().map(|row| (row.perturbation.as_str(), row.beyond.as_str())).collect();
        // Half of the roads: (1 - 1/2)^2 less what two drives estimate of 1/2, and the other half: 1.
        assert_eq!(rows[0].0, "fog");
        assert!(
            found.rows[0].differ.starts_with("75 %") && found.rows[0].luck.starts_with("25 %"),
            "{found:?}"
        );
        assert_eq!(rows[0].1, "+50 %");
        assert!(found.rows[1].beyond.starts_with("-25 %") || found.rows[1].beyond == "0 %", "{found:?}");
    }

    #[test]
    fn drives_that_were_not_repeated_say_nothing() {
        assert!(luck(&drive(1, |_, _, _| true)).is_none());
    }
}
