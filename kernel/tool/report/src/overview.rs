//! How several drivers, or one in several conditions, differ: the level from which on each perturbation makes each of them fail.

use std::collections::BTreeSet;

use pdk_statistics::CONFIDENCE;
use pdk_statistics::level::{FailingLevel, failing_level};
use serde::Serialize;

use crate::color::Hue;
use crate::conclusions::{Trials, on_roads, roads, told, trials};
use crate::heat::{Cell, Ramp, Row};
use crate::text;
use crate::view::Drive;

/// A column for each drive, a row for each perturbation.
#[derive(Debug, Serialize)]
pub struct Overview {
    /// Simulators, each with the number of its columns.
    simulators: Vec<(String, usize)>,
    /// The driver of each column.
    drivers: Vec<String>,
    /// The perturbations, the worst first.
    rows: Vec<Row>,
    /// What the colours stand for.
    legend: Vec<Ramp>,
}

/// What the page says about all drives of a run together; nothing if there is only one, or nothing was perturbed.
pub fn overview(drives: &[Drive]) -> Option<Overview> {
    let scenarios = || drives.iter().flat_map(|drive| &drive.scenarios);
    let names: BTreeSet<&String> =
        scenarios().filter(|s| s.level.is_some()).filter_map(|s| s.perturbation.as_ref()).collect();
    if drives.len() < 2 || names.is_empty() {
        return None;
    }
    let highest = scenarios().filter_map(|s| s.level).fold(0.0, f64::max);
    // One that never fails counts as if it failed at the level behind the highest.
    let depth = |found: &FailingLevel| 1.0 - found.level.unwrap_or(highest + 1.0) / (highest + 1.0);
    let of_drives: Vec<(Vec<String>, Trials<'_>)> =
        drives.iter().map(|drive| (roads(drive), trials(drive))).collect();
    let mut rows: Vec<(f64, Row)> = Vec::new();
    for name in names {
        let found: Vec<Option<(FailingLevel, usize)>> = of_drives
            .iter()
            .map(|(roads, trials)| {
                let trials = on_roads(trials, name, roads);
                let driven = trials.iter().filter(|trials| !trials.is_empty()).count();
                failing_level(&trials, CONFIDENCE).map(|found| (found, driven))
            })
            .collect();
        let depths: Vec<f64> = found.iter().flatten().map(|(found, _)| depth(found)).collect();
        if depths.is_empty() {
            continue;
        }
        let cells = found
            .iter()
            .zip(drives)
            .map(|(found, drive)| {
                let (found, roads) = found.as_ref()?;
                let (level, interval) = told(found);
                let title = format!(
                    "{name}, {} in {}: fails from level {level} on (95 %: {interval}), {} on {}",
                    drive.driver,
                    drive.simulator,
                    text::count(found.drives, "drive"),
                    text::count(*roads, "road")
                );
                let shown = found.level.map_or("–".to_owned(), |level| format!("{level:.1}"));
                Some(Cell::new(shown, title, Hue::Failed, depth(found)).of(found.level))
            })
            .collect();
        rows.push((depths.iter().sum::<f64>() / depths.len() as f64, Row { label: name.clone(), cells }));
    }
    rows.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    let mut simulators: Vec<(String, usize)> = Vec::new();
    for drive in drives {
        match simulators.last_mut().filter(|(last, _)| *last == drive.simulator) {
            Some((_, columns)) => *columns += 1,
            None => simulators.push((drive.simulator.clone(), 1)),
        }
    }
    Some(Overview {
        simulators,
        drivers: drives.iter().map(|drive| drive.driver.clone()).collect(),
        rows: rows.into_iter().map(|(_, row)| row).collect(),
        legend: vec![Ramp::new(
            Hue::Failed,
            &format!("survives level {}", text::short(highest)),
            "fails at level 0",
        )],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Scenario, Verdict};

    /// Four roads, five levels: each perturbation fails from a level on.
    fn drive(simulator: &str, driver: &str, fails: &[(&str, f64)]) -> Drive {
        let at = |name: &str, road: usize, level: f64, failed: bool| Scenario {
            perturbation: Some(name.to_owned()),
            level: Some(level),
            road_id: road.to_string(),
            verdict: if failed { Verdict::Unsafe } else { Verdict::Passed },
            ..Scenario::default()
        };
        let levels = || (0..5).map(f64::from);
        let scenarios = fails.iter().flat_map(|(name, from)| {
            (0..4).flat_map(move |road| levels().map(move |level| at(name, road, level, level >= *from)))
        });
        Drive {
            simulator: simulator.into(),
            driver: driver.into(),
            scenarios: scenarios.collect(),
            ..Drive::default()
        }
    }

    #[test]
    fn each_drive_has_a_column_and_the_worst_comes_first() {
        let drives = [
            drive("easy", "a", &[("fog", 3.0), ("rain", 9.0)]),
            drive("easy", "b", &[("fog", 1.0), ("rain", 4.0), ("snow", 0.0)]),
            drive("hard", "a", &[("fog", 2.0)]),
        ];
        let found = overview(&drives).unwrap();
        assert_eq!(found.simulators, [("easy".to_owned(), 2), ("hard".to_owned(), 1)]);
        assert_eq!(found.drivers, ["a", "b", "a"]);
        let rows: Vec<(&str, Vec<&str>)> = found
            .rows
            .iter()
            .map(|row| {
                let texts = row.cells.iter().map(|cell| cell.as_ref().map_or("", |cell| cell.text.as_str()));
                (row.label.as_str(), texts.collect())
            })
            .collect();
        assert_eq!(
            rows,
            [
                ("snow", vec!["", "0.0", ""]),
                ("fog", vec!["2.5", "0.5", "1.5"]),
                ("rain", vec!["–", "3.5", ""])
            ]
        );
        let title = &found.rows[1].cells[0].as_ref().unwrap().title;
        assert!(
            title.starts_with("fog, a in easy: fails from level 2.5 on (95 %: ")
                && title.ends_with("20 drives on 4 roads"),
            "{title}"
        );
        assert!(overview(&drives[..1]).is_none());
    }
}
