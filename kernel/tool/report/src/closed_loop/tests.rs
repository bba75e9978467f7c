//! What a page says about drives.

use super::*;
use crate::closed_loop::curves::survival;
use crate::heat::{self, Cell};

fn scenario(name: Option<&str>, level: f64, verdict: Verdict, time: f64) -> Scenario {
    Scenario {
        name: name.unwrap_or("nominal").to_owned(),
        perturbation: name.map(str::to_owned),
        level: name.map(|_| level),
        verdict,
        cause: "lane departure".into(),
        time,
        progress: time / 10.0,
        mean_error: 1.0 / time,
        ..Scenario::default()
    }
}

fn drive() -> Drive {
    use Verdict::{Passed, Unsafe, Void};
    let scenarios = vec![
        scenario(None, 0.0, Passed, 10.0),
        scenario(Some("fog"), 1.0, Passed, 10.0),
        scenario(Some("fog"), 2.0, Unsafe, 5.0),
        scenario(Some("rain"), 1.0, Unsafe, 4.0),
        scenario(Some("rain"), 1.0, Unsafe, 2.0),
        scenario(Some("rain"), 2.0, Void, 1.0),
    ];
    Drive { scenarios, ..Drive::default() }
}

/// A perturbation at levels 1, 2 and 4 on some roads, failing from a level on.
fn on_roads(roads: usize, fails: &[(&str, f64)]) -> Drive {
    let of = |name: Option<&str>, level: f64, road: usize, failed: bool| Scenario {
        road_id: road.to_string(),
        ..scenario(name, level, if failed { Verdict::Unsafe } else { Verdict::Passed }, 5.0)
    };
    let mut scenarios = Vec::new();
    for road in 0..roads {
        scenarios.push(of(None, 0.0, road, false));
        for (name, from) in fails {
            scenarios.extend([1.0, 2.0, 4.0].map(|level| of(Some(name), level, road, level >= *from)));
        }
    }
    Drive { driver: "dave2".into(), scenarios, ..Drive::default() }
}

#[test]
fn three_sentences_say_what_breaks_the_driver_from_which_level_on_and_how_sure_that_is() {
    let drive = on_roads(10, &[("fog", 2.0), ("rain", 4.0), ("snow", 9.0)]);
    assert_eq!(
        verdict(&[drive]),
        [
            "dave2 fails under 2 of 3 perturbations: fog from level 1.5 on (95 %: 1 to 2) and rain from level 3 on (2 to 4).",
            "100 scenarios were driven, and 30 failed (30 %), none of the 10 without perturbation.",
            "This was seen on 10 roads: what failed on none of them may still fail on up to 28 % of all roads (95 %).",
        ]
    );
    let few = verdict(&[on_roads(2, &[("fog", 2.0), ("snow", 9.0)])]);
    assert_eq!(few[0], "dave2 fails under 1 of 2 perturbations: fog from level 1.5 on.");
    assert_eq!(few[2], "2 roads are too few for an interval of these levels; drive 4 or more.");
    let none = verdict(&[on_roads(8, &[("fog", 9.0), ("snow", 9.0)])]);
    assert_eq!(none[0], "dave2 survives all 2 perturbations up to level 4.");
    assert_eq!(
        none[1],
        "The largest deviation comes with fog: 0.200 m from the middle of the lane on average."
    );
    assert_eq!(none[2], "32 scenarios were driven, and none failed.".replace("32", "56"));
}

#[test]
fn on_one_road_no_sentence_claims_more_than_was_seen() {
    assert_eq!(
        verdict(&[Drive { driver: "dave2".into(), ..drive() }]),
        [
            "dave2 fails under 2 of 2 perturbations: rain (already at level 1) and fog (survived level 1, failed level 2).",
            "6 scenarios were driven, and 3 failed (60 %), but not the one without perturbation; in 1 a component \
             failed, which says nothing about the driver.",
            "All of this happened on one road, which says nothing about others.",
        ]
    );
    let alone = Drive { scenarios: drive().scenarios[..1].to_vec(), ..Drive::default() };
    assert_eq!(verdict(&[alone]), ["1 scenario was driven, and none failed."]);
}

#[test]
fn on_one_road_there_is_no_table_of_certainty() {
    let of = |roads| {
        let drive = on_roads(roads, &[("fog", 2.0)]);
        serde_json::to_value(section(&drive, std::slice::from_ref(&drive), &[0.1]).unwrap()).unwrap()
    };
    let (one, many) = (of(1), of(8));
    assert_eq!(one["conclusions"]["is_on_one_road"], true);
    assert_eq!(one["conclusions"]["rows"].as_array().map(Vec::len), Some(0));
    assert_eq!(many["conclusions"]["is_on_one_road"], false);
    assert_eq!(many["conclusions"]["rows"].as_array().map(Vec::len), Some(1));
}

#[test]
fn a_drive_that_was_survived_far_from_the_middle_does_not_look_like_a_failure() {
    use crate::color::Hue;
    let mut drive = drive();
    drive.scenarios[1].mean_error = 1.12;
    let section = section(&drive, &[], &[0.1]).unwrap();
    let hue = |row: usize, column: usize| section.error.rows[row].cells[column].as_ref().unwrap().shade.hue;
    // Fog is the second row: survived at level 1, the lane left at level 2.
    assert_eq!((hue(1, 0), hue(1, 1)), (Hue::Distance, Hue::Failed));
    let mut stopped = drive.clone();
    stopped.scenarios[2].verdict = Verdict::Stopped;
    let section = super::section(&stopped, &[], &[0.1]).unwrap();
    assert_eq!(section.error.rows[1].cells[1].as_ref().unwrap().shade.hue, Hue::Stopped);
    assert!(section.error.legend.iter().any(|ramp| ramp.most == "all stopped"));
}

#[test]
fn two_drivers_are_drawn_on_one_scale() {
    let (mut first, mut second) = (drive(), drive());
    first.scenarios.iter_mut().for_each(|scenario| scenario.mean_error = 0.5);
    second
        .scenarios
        .iter_mut()
        .for_each(|scenario| (scenario.mean_error, scenario.time) = (3.0, 2.0 * scenario.time));
    let all = [first, second];
    let [first, second] = [0, 1].map(|number| section(&all[number], &all, &[0.1]).unwrap());
    assert_eq!(first.error.legend, second.error.legend);
    let ground = |section: &Section| section.error.nominal.as_ref().unwrap().shade;
    assert_ne!(ground(&first), ground(&second), "half a metre is less than three");
    // The axis of time ends at the same place: a curve that ends at 10 s is half as long.
    let alone = section(&all[0], &[], &[0.1]).unwrap();
    assert_ne!(first.curves[0].body, alone.curves[0].body);
}

#[test]
fn a_driver_that_fails_without_perturbation_is_named_first() {
    let mut drive = Drive { driver: "dave2".into(), ..drive() };
    drive.scenarios[0].verdict = Verdict::Unsafe;
    let said = verdict(std::slice::from_ref(&drive));
    assert_eq!(
        said[0],
        "dave2 fails its only drive without any perturbation, so its failures under perturbations say little about these."
    );
    assert!(said[2].starts_with("6 scenarios were driven, and 4 failed (80 %); in 1"), "{said:?}");
    drive.scenarios[0].verdict = Verdict::Late;
    assert_eq!(
        verdict(std::slice::from_ref(&drive))[0],
        "dave2 runs out of time in its only drive without any perturbation, so its failures under perturbations say little about these; \
         raise `duration`."
    );
    drive.scenarios.push(scenario(None, 0.0, Verdict::Unsafe, 10.0));
    assert!(verdict(std::slice::from_ref(&drive))[0].starts_with(
        "dave2 fails 2 of 2 drives without any perturbation, 1 of them because the time ran out, so"
    ));
    drive.scenarios[0].verdict = Verdict::Unsafe;
    drive.scenarios.push(scenario(None, 0.0, Verdict::Passed, 10.0));
    assert!(verdict(&[drive])[0].starts_with("dave2 fails 2 of 3 drives without any perturbation, so"));
}

#[test]
fn stopping_is_a_failure_of_its_own() {
    let mut drive = drive();
    drive.scenarios[2].verdict = Verdict::Stopped;
    assert!(
        verdict(std::slice::from_ref(&drive))[1]
            .contains("; in 1 of the failed ones the vehicle stopped; in 1 a")
    );
    let section = section(&drive, &[], &[0.1]).unwrap();
    let fog = section.failed.rows.iter().find(|row| row.label == "fog").unwrap();
    assert_eq!(fog.cells[1].as_ref().unwrap().text, "stopped");
    assert_eq!(section.scenarios[2].mark, "■");
    drive.scenarios.truncate(3);
    assert!(
        verdict(std::slice::from_ref(&drive))[1]
            .contains("no vehicle left its lane or hit anything: they stopped.")
    );
    drive.scenarios[2].verdict = Verdict::Late;
    assert!(
        verdict(std::slice::from_ref(&drive))[1]
            .contains("no vehicle left its lane or hit anything: they ran out of time.")
    );
    assert_eq!(super::section(&drive, &[], &[0.1]).unwrap().scenarios[2].mark, "▷");
}

#[test]
fn the_heat_map_counts_what_says_something_about_the_driver() {
    let section = section(&drive(), &[], &[0.1]).unwrap();
    assert_eq!(section.failed.columns, ["1", "2"].map(|level| Some(level.to_owned())));
    let rows = |grid: &Grid| {
        let text = |cell: &Option<Cell>| cell.as_ref().map_or(String::new(), |cell| cell.text.clone());
        let row = |row: &heat::Row| (row.label.clone(), row.cells.iter().map(text).collect::<Vec<_>>());
        grid.rows.iter().map(row).collect::<Vec<_>>()
    };
    let expected = |name: &str, cells: [&str; 2]| (name.to_owned(), cells.map(str::to_owned).to_vec());
    assert_eq!(rows(&section.failed), [expected("rain", ["2/2", "–"]), expected("fog", ["ok", "failed"])]);
    assert_eq!(
        rows(&section.error),
        [expected("rain", ["✗ 3.00 s", "–"]), expected("fog", ["0.100", "✗ 5.00 s"])]
    );
    assert_eq!(section.failed.nominal.unwrap().text, "ok");
    let legend: Vec<&str> = section.error.legend.iter().map(|ramp| ramp.most.as_str()).collect();
    assert_eq!(legend, ["1.00 m", "all failed"]);
    assert_eq!(section.curves.len(), 2);
    assert_eq!(section.scenarios.len(), 6);
}

#[test]
fn the_heat_map_of_many_levels_has_a_column_for_each_whole_one() {
    use Verdict::{Passed, Unsafe};
    let at = |place: u32| {
        let verdict = if place < 30 { Passed } else { Unsafe };
        scenario(Some("fog"), f64::from(place) / 10.0, verdict, 10.0)
    };
    let drive = Drive { scenarios: (0..=40).map(at).collect(), ..Drive::default() };
    let grid = section(&drive, &[], &[0.1]).unwrap().failed;
    let columns: Vec<&str> = grid.columns.iter().flatten().map(String::as_str).collect();
    assert_eq!(columns, ["0 to below 1", "1 to below 2", "2 to below 3", "3 to below 4", "4"]);
    let cells: Vec<&str> = grid.rows[0].cells.iter().flatten().map(|cell| cell.text.as_str()).collect();
    assert_eq!(cells, ["0/10", "0/10", "0/10", "10/10", "failed"]);
}

#[test]
fn what_the_pictures_leave_out_is_reported() {
    let mut drive = drive();
    let pictures = 1;
    assert_eq!(
        road_note(&drive, 0),
        "The simulator does not report its roads. Of 1 scenario, in which a component failed, there is nothing to draw."
    );
    drive.roads.push(vec![[0.0, 0.0], [0.0, 50.0]]);
    drive.scenarios.iter_mut().for_each(|scenario| scenario.road = Some(0));
    assert_eq!(road_note(&drive, pictures), "");
    for scenario in &mut drive.scenarios[..2] {
        (scenario.road, scenario.unreadable) = (None, "the trace is missing".to_owned());
    }
    let unreadable = "2 scenarios are shown without a path, because the trace cannot be read: the table of scenarios says why.";
    assert_eq!(road_note(&drive, pictures), unreadable);
    assert_eq!(section(&drive, &[], &[0.1]).unwrap().scenarios[1].unreadable, "the trace is missing");
    drive.scenarios[2].road = None;
    let unknown = "The simulator did not report the road of 1 scenario.";
    assert_eq!(road_note(&drive, pictures), format!("{unknown} {unreadable}"));
    let many = "These are the 24 roads with the most failures; 6 more are in the table.";
    assert_eq!(road_note(&drive, 30), format!("{many} {unknown} {unreadable}"));
}

#[test]
fn where_levels_were_chosen_the_map_tells_the_share_of_roads() {
    use Verdict::{Passed, Unsafe};
    // Roads a and b fail from level 2 on, c and d never: by bisection.
    let at = |road: &str, level: f64| {
        let fails = "ab".contains(road) && level >= 2.0;
        let verdict = if fails { Unsafe } else { Passed };
        Scenario {
            road_id: road.into(),
            ..scenario(Some("fog"), level, verdict, if fails { 4.0 } else { 10.0 })
        }
    };
    let driven = [
        ("a", 4.0),
        ("b", 4.0),
        ("c", 4.0),
        ("d", 4.0),
        ("a", 0.0),
        ("b", 0.0),
        ("a", 2.0),
        ("b", 2.0),
        ("a", 1.0),
    ];
    let mut scenarios: Vec<_> = driven.iter().map(|(road, level)| at(road, *level)).collect();
    scenarios.push(scenario(None, 0.0, Passed, 10.0));
    let drive = Drive { scenarios, ..Drive::default() };
    let section = section(&drive, &[], &[0.1]).unwrap();
    let cells = |grid: &Grid| -> Vec<String> {
        grid.rows[0].cells.iter().flatten().map(|cell| cell.text.clone()).collect()
    };
    assert_eq!(section.failed.columns.iter().flatten().collect::<Vec<_>>(), ["0", "1", "2", "3", "4"]);
    // At level 1 nothing says how b would go; at 2 and 4 c and d survive.
    assert_eq!(cells(&section.failed), ["0 %", "0 %", "50 %", "50 %", "50 %"]);
    assert_eq!(cells(&section.error)[2], "✗ 4.00 s");
    // One chart, of the level at which all roads were driven.
    assert_eq!(section.curves.len(), 1);
    assert_eq!(
        section.curves[0].label,
        "Share of scenarios still driving at level 4, by perturbation with failures"
    );
}

#[test]
fn survival_falls_with_every_failure() {
    let drive = drive();
    let group: Vec<&Scenario> = drive.scenarios[1..5].iter().collect();
    let points = survival(&group, 10.0);
    let expected =
        [(0.0, 1.0), (2.0, 1.0), (2.0, 0.75), (4.0, 0.75), (4.0, 0.5), (5.0, 0.5), (5.0, 0.25), (10.0, 0.25)];
    assert_eq!(points, expected);
}

#[test]
fn every_perturbation_shows_a_failure_before_any_shows_two() {
    assert_eq!(worst_failures(&drive(), 6), [4, 2, 3]);
    assert_eq!(worst_failures(&drive(), 2), [4, 2]);
}

#[test]
fn classes_are_named_by_their_edges() {
    let texts: Vec<_> = legend(&[0.5, 1.0, 1.5, 2.0]).into_iter().map(|class| class.text).collect();
    assert_eq!(texts, ["up to 0.5 m", "to 1 m", "to 1.5 m", "to 2 m", "over 2 m"]);
}
