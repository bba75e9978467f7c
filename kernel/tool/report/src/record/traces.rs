//! What the traces of scenarios tell: the roads, where the vehicle was, and the last recorded frames of the failures that a page
//! shows. Each trace is read once, on all processors.

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::path::Path;

use pdk_record::directory::RunDirectory;
use pdk_record::ledger::Line;
use pdk_record::trace::ending::{BEFORE, before_the_last};
use pdk_record::trace::reader::{Entry, Owner, TraceImage, TraceReader};
use pdk_record::trace::step::{ImageTopic, Step};
use pdk_sdk::error::Result;

use crate::closed_loop::worst_failures;
use crate::telemetry::samples;
use crate::view::{Drive, Place, Shot};

/// Pictures of this many bytes make a page that is still handy: in a page a third more.
const BUDGET: usize = 6 << 20;
/// This many traces that cannot be read are warned of one by one.
const WARNINGS: usize = 3;

/// Adds to the scenarios of these lines what their traces tell, with frames for the worst failures of each drive, `most` of all.
/// A scenario whose trace cannot be read goes without and says why; so do the warnings that are returned.
pub fn add(directory: &RunDirectory, lines: &[Line], drives: &mut [Drive], most: usize) -> Vec<String> {
    let each = (most / drives.len().max(1)).max(1);
    let shown: Vec<(usize, usize)> = drives
        .iter()
        .enumerate()
        .flat_map(|(place, drive)| {
            worst_failures(drive, each).into_iter().map(move |scenario| (place, scenario))
        })
        .collect();
    let with_shots: BTreeSet<u64> =
        shown.iter().map(|(drive, scenario)| drives[*drive].scenarios[*scenario].index).collect();
    let numbers: Vec<u64> = (0..lines.len() as u64).collect();
    let mut traces = pdk_parallel::map(&numbers, |number| {
        let line = &lines[*number as usize];
        Some(read(&directory.trace_path(&line.id), Owner::of(line), with_shots.contains(number)))
    });
    let (mut warnings, mut unreadable) = (Vec::new(), 0_usize);
    for drive in drives.iter_mut() {
        let mut roads: HashMap<String, Option<usize>> = HashMap::new();
        for scenario in &mut drive.scenarios {
            match traces.get_mut(scenario.index as usize).and_then(Option::take) {
                Some(Ok(Trace { path, road: waypoints, shots })) => {
                    (scenario.path, scenario.shots) = (path, shots);
                    scenario.road = *roads.entry(waypoints).or_insert_with_key(|waypoints| {
                        let points = road(waypoints).unwrap_or_else(|error| {
                            warnings.push(format!(
                                "scenario {} is shown without its road: {error}",
                                scenario.index
                            ));
                            None
                        })?;
                        // Heights may be drawn anew for each repeat; from above it is the same road.
                        let known = drive.roads.iter().position(|road| *road == points);
                        Some(known.unwrap_or_else(|| {
                            drive.roads.push(points);
                            drive.roads.len() - 1
                        }))
                    });
                }
                Some(Err(error)) => {
                    unreadable += 1;
                    if unreadable <= WARNINGS {
                        let number = scenario.index;
                        warnings.push(format!("scenario {number} is shown without its path: {error}"));
                    }
                    scenario.unreadable = error.to_string();
                }
                None => {}
            }
        }
    }
    if unreadable > WARNINGS {
        warnings.push(format!(
            "{} more scenarios are shown without their paths, because their traces cannot be read; the page says which",
            unreadable - WARNINGS
        ));
    }
    let mut budget = BUDGET;
    for (drive, scenario) in shown {
        let shots = &mut drives[drive].scenarios[scenario].shots;
        // The last one tells most.
        while bytes(shots) > budget {
            shots.remove(0);
        }
        budget -= bytes(shots);
    }
    warnings
}

fn bytes(shots: &[Shot]) -> usize {
    shots.iter().map(|shot| shot.raw.len() + shot.perturbed.len() + shot.attention.len()).sum()
}

/// The centre line of a road, seen from above; none if the simulator did not report it.
fn road(waypoints: &str) -> Result<Option<Vec<[f64; 2]>>> {
    if waypoints.is_empty() {
        return Ok(None);
    }
    let points = pdk_road::parse(waypoints)?;
    Ok(Some(points.into_iter().map(|[x, _, z]| [x, z]).collect()))
}

/// What a trace tells.
struct Trace {
    path: Vec<Place>,
    road: String,
    /// The last recorded frame and, as far as there are, those some time before.
    shots: Vec<Shot>,
}

fn read(path: &Path, owner: Owner, with_shots: bool) -> Result<Trace> {
    let (mut steps, mut road, mut recent): (Vec<Step>, _, _) = (Vec::new(), String::new(), VecDeque::new());
    for entry in TraceReader::of(path, owner)? {
        match entry? {
            Entry::Step(step) => steps.push(step),
            Entry::Road(waypoints) => road = waypoints,
            Entry::Image(image) if with_shots => keep(&mut recent, image),
            Entry::Image(_) | Entry::Event(_) => {}
        }
    }
    let place = |step: Step| {
        let [x, _, z] = step.state.position;
        Place { x, z, error: step.state.cross_track_error }
    };
    let recent: Vec<Shot> = recent.into_iter().map(|(_, shot)| shot).collect();
    let times: Vec<f64> = recent.iter().map(|shot| shot.time).collect();
    Ok(Trace {
        path: samples(&steps).into_iter().map(place).collect(),
        road,
        shots: before_the_last(&times).into_iter().map(|position| recent[position].clone()).collect(),
    })
}

/// Keeps an image, and forgets those that are older than any that is shown.
fn keep(recent: &mut VecDeque<(u64, Shot)>, image: TraceImage) {
    if recent.back().is_none_or(|(sequence, _)| *sequence != image.sequence) {
        recent.push_back((image.sequence, Shot { time: image.time(), ..Shot::default() }));
        let oldest = image.time() - BEFORE[0];
        while recent.get(1).is_some_and(|(_, shot)| shot.time <= oldest) {
            recent.pop_front();
        }
    }
    if let Some((_, shot)) = recent.back_mut() {
        match image.topic {
            ImageTopic::Raw => shot.raw = image.jpeg,
            ImageTopic::Perturbed => shot.perturbed = image.jpeg,
            ImageTopic::Attention => shot.attention = image.jpeg,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Scenario, Verdict};
    use pdk_record::trace::writer;
    use pdk_sdk::prelude::{FrameBuf, State};

    fn line(number: u64) -> Line {
        let value = serde_json::json!({
            "id": format!("{number:032x}"), "name": "x", "images_every": 0, "success": false,
            "cause": "time_out", "time": 1.0, "frames": 20, "progress": 0.5, "mean_cross_track_error": 0.1,
            "max_cross_track_error": 0.2, "digest": "",
            "scenario": {"simulator": {"name": "lane"}, "driver": {"name": "d"}, "duration": 1.0, "seed": 0},
        });
        serde_json::from_value(value).unwrap()
    }

    fn create(directory: &RunDirectory, line: &Line) -> writer::Trace {
        writer::Trace::create(&directory.trace(&line.id).unwrap(), &line.id).unwrap()
    }

    /// A trace with a step and an image every tenth of a second, up to this time.
    fn write(directory: &RunDirectory, line: &Line, seconds: u64, road: &str) {
        let mut trace = create(directory, line);
        trace.event(0.0, false, "x").unwrap();
        let frame = FrameBuf::new(16, 8);
        for sequence in 0..=seconds * 10 {
            let time = sequence as f64 / 10.0;
            let state =
                State { time, position: [0.5, 9.0, time], cross_track_error: -0.5, ..State::default() };
            trace.step(&Step { sequence, state, ..Step::default() }).unwrap();
            for topic in [ImageTopic::Raw, ImageTopic::Perturbed] {
                trace.image(topic, sequence, time, frame.as_ref()).unwrap();
            }
        }
        if !road.is_empty() {
            trace.road(road).unwrap();
        }
        trace.finish().unwrap();
    }

    fn drives(count: u64) -> Vec<Drive> {
        let failed = |index: u64| Scenario { index, verdict: Verdict::Unsafe, ..Scenario::default() };
        vec![Drive { scenarios: (0..count).map(failed).collect(), ..Drive::default() }]
    }

    fn directory(name: &str) -> RunDirectory {
        let folder = std::env::temp_dir().join(format!("pdk-traces-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        RunDirectory::create(&folder).unwrap()
    }

    #[test]
    fn the_last_frame_and_those_before_it_are_shown() {
        let directory = directory("shots");
        let lines: Vec<Line> = (0..4).map(line).collect();
        for (line, seconds) in lines.iter().zip([5, 1, 0, 5]) {
            write(&directory, line, seconds, "");
        }
        let mut drives = drives(4);
        assert!(add(&directory, &lines, &mut drives, 3).is_empty());
        let times = |scenario: usize| {
            let shots = &drives[0].scenarios[scenario].shots;
            assert!(shots.iter().all(|shot| !shot.raw.is_empty() && !shot.perturbed.is_empty()));
            shots.iter().map(|shot| shot.time).collect::<Vec<_>>()
        };
        assert_eq!(times(0), [3.0, 4.0, 5.0]);
        assert_eq!(times(1), [0.0, 1.0]);
        assert_eq!(times(2), [0.0]);
        assert!(times(3).is_empty(), "there are as many as are wanted already");
        std::fs::remove_dir_all(directory.path()).unwrap();
    }

    #[test]
    fn paths_are_the_telemetry_and_roads_are_shared() {
        let directory = directory("paths");
        let lines: Vec<Line> = (0..5).map(line).collect();
        for (line, road) in lines.iter().zip(["0,0,0@1,5,20", "", "0,0,0@1,5,20", "0,0,inf", "0,1,0@1,3,20"])
        {
            write(&directory, line, 1, road);
        }
        let mut drives = drives(5);
        let warnings = add(&directory, &lines, &mut drives, 1);
        assert_eq!(drives[0].roads, [[[0.0, 0.0], [1.0, 20.0]]]);
        let roads: Vec<_> = drives[0].scenarios.iter().map(|scenario| scenario.road).collect();
        assert_eq!(roads, [Some(0), None, Some(0), None, Some(0)], "heights make no other road");
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(warnings[0].starts_with("scenario 3 is shown without its road: "), "{warnings:?}");
        let path = &drives[0].scenarios[1].path;
        let ahead: Vec<f64> = path.iter().map(|place| place.z).collect();
        // One every quarter of a second, and the last.
        assert_eq!(ahead, [0.0, 0.3, 0.5, 0.8, 1.0]);
        assert!(path.iter().all(|place| (place.x, place.error) == (0.5, -0.5)));
        std::fs::remove_dir_all(directory.path()).unwrap();
    }

    #[test]
    fn what_cannot_be_read_is_left_out_and_said() {
        let directory = directory("damaged");
        let lines: Vec<Line> = (0..7).map(line).collect();
        write(&directory, &lines[0], 1, "0,0,0@1,5,20");
        // A component took its process along: the trace says so and nothing else.
        let mut lost = create(&directory, &lines[1]);
        lost.event(0.0, false, "x").unwrap();
        lost.event(0.0, true, "driver `d`: it aborts").unwrap();
        lost.finish().unwrap();
        let cut = directory.trace(&lines[2].id).unwrap();
        write(&directory, &lines[2], 1, "");
        let whole = std::fs::read(&cut).unwrap();
        std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
        let mut drives = drives(7);
        let warnings = add(&directory, &lines, &mut drives, 6);
        let unreadable: Vec<bool> =
            drives[0].scenarios.iter().map(|scenario| !scenario.unreadable.is_empty()).collect();
        assert_eq!(unreadable, [false, false, true, true, true, true, true]);
        let scenarios = &drives[0].scenarios;
        assert!(!scenarios[0].path.is_empty() && scenarios[1..].iter().all(|s| s.path.is_empty()));
        assert!(scenarios[1].road.is_none() && scenarios[1].shots.is_empty());
        assert_eq!(warnings.len(), 4, "{warnings:?}");
        assert!(warnings[0].starts_with("scenario 2 is shown without its path: the trace "), "{warnings:?}");
        assert!(warnings[0].contains("is cut off") || warnings[0].contains("is damaged"), "{warnings:?}");
        assert!(warnings[1].contains("is missing"), "{warnings:?}");
        assert!(warnings[3].starts_with("2 more scenarios are shown without their paths"), "{warnings:?}");
        std::fs::remove_dir_all(directory.path()).unwrap();
    }
}
