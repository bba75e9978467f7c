//! Tests of conditions: of what they add to a scene, to the camera and to the vehicle.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, json};

use crate::conditions::NAMES;
use crate::road::{Layout, Road};
use crate::tests::{frame_after, guide, lane_with, scenario};

/// The last state of a drive by the autopilot.
fn autopilot_drives(parameters: Value, seed: u64) -> State {
    let mut simulator = lane_with(parameters).unwrap();
    let mut state = simulator.reset(&scenario(Value::Null, seed), 0).unwrap();
    while !state.finished && !state.lane_departure && !state.collision && state.time < 90.0 {
        state = simulator.act(Control { steering: 1.0, throttle: -1.0 }).unwrap();
    }
    state
}

#[test]
fn the_autopilot_drives_every_road_in_all_conditions() {
    for conditions in NAMES {
        for (seed, swing) in (0..4).flat_map(|seed| [(seed, 0.0), (seed, 1.2)]) {
            let parameters = json!({
                "conditions": conditions, "autopilot": true, "autopilot_swing": swing, "width": 16, "height": 8,
            });
            let state = autopilot_drives(parameters, seed);
            assert!(state.finished && !state.collision, "{conditions} {seed} {swing}: {state:?}");
        }
    }
}

#[test]
fn every_processor_draws_the_same() {
    for conditions in NAMES {
        for light in ["day", "night"] {
            let drawn = || {
                let parameters = json!({"conditions": conditions, "light": light, "width": 171, "height": 93, "parked": 30});
                frame_after(&mut lane_with(parameters).unwrap(), 5, 30)
            };
            assert!(drawn() == crate::simd::portably(drawn), "{conditions} {light}");
        }
    }
}

#[test]
fn a_scenario_is_the_same_whatever_came_before_in_all_conditions() {
    for conditions in NAMES {
        let made = || lane_with(json!({"conditions": conditions, "width": 160, "height": 80})).unwrap();
        let expected = frame_after(&mut made(), 7, 25);
        let mut used = made();
        assert!(frame_after(&mut used, 8, 13) != expected);
        assert!(frame_after(&mut used, 7, 25) == expected);
        let mut again = FrameBuf::new(160, 80);
        used.frame(again.as_mut()).unwrap();
        assert!(again == expected, "noise is that of the frame's number");
    }
}

#[test]
fn controls_come_into_effect_later() {
    let heading = |delay: f64| {
        let parameters = json!({"width": 8, "height": 6, "control_delay": delay, "rate": 20});
        let mut simulator = lane_with(parameters).unwrap();
        let mut state = simulator.reset(&scenario(json!({"angles": [0, 0, 0, 0]}), 0), 0).unwrap();
        let mut headings = vec![state.heading];
        for _ in 0..8 {
            state = simulator.act(Control { steering: 0.5, throttle: 0.0 }).unwrap();
            headings.push(state.heading);
        }
        headings
    };
    let (at_once, later) = (heading(0.0), heading(0.2));
    assert!(at_once[1] > 0.0 && later[4] == 0.0 && later[5] > 0.0, "{at_once:?} {later:?}");
    // The speed has changed a little by then.
    assert!((later[8] - at_once[4]).abs() < 0.01 * at_once[4]);
}

#[test]
fn what_was_added_is_labelled_and_its_distance_known() {
    let straight = json!({"angles": [0, 0, 0, 0, 0, 0], "segment": 40});
    let parameters = json!({
        "conditions": "standard", "light": "day", "parked": 60, "signs": 60, "trees": 0, "oncoming": 0, "crests": 0,
    });
    let mut simulator = lane_with(parameters).unwrap();
    let names = simulator.label_names();
    let camera = simulator.camera();
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut frame = FrameBuf::new(width, height);
    let (mut labels, mut depth) = (vec![0; width * height], vec![0.0; width * height]);
    let (mut vehicles, mut signs) = (0, 0);
    for seed in 0..6 {
        let mut state = simulator.reset(&scenario(straight.clone(), seed), 0).unwrap();
        for _ in 0..60 {
            state = simulator.act(guide(&simulator, &state)).unwrap();
        }
        simulator.frame(frame.as_mut()).unwrap();
        simulator.labels(&mut labels).unwrap();
        simulator.depth(&mut depth).unwrap();
        for (i, label) in labels.iter().enumerate() {
            let name = names[usize::from(*label)].as_str();
            assert!((name == "sky") == depth[i].is_infinite(), "{name} at {}", depth[i]);
            vehicles += usize::from(name == "vehicle");
            signs += usize::from(name == "traffic_sign");
            // Both stand on the ground, at the distance of the row on which they do, or nearer than what they hide.
            if name == "vehicle" || name == "traffic_sign" {
                assert!((1.0..260.0).contains(&depth[i]));
                let below = (i / width + 1..height).map(|y| y * width + i % width);
                let foot = below.clone().find(|&j| {
                    !["vehicle", "traffic_sign"].contains(&names[usize::from(labels[j])].as_str())
                });
                if let Some(foot) = foot.filter(|foot| {
                    ["ground", "road", "marking"].contains(&names[usize::from(labels[*foot])].as_str())
                }) {
                    assert!(depth[foot] < depth[i] * 1.25 + 5.0, "{name}: {} on {}", depth[i], depth[foot]);
                }
            }
        }
    }
    assert!(vehicles > 300 && signs > 100, "{vehicles} {signs}");
}

#[test]
fn missing_paint_is_not_a_marking() {
    let markings = |missing: f64| {
        let parameters = json!({
            "conditions": "standard", "light": "overcast", "paint_missing": missing, "paint_wear": 0, "wetness": 0, "oncoming": 0,
            "parked": 0, "markings": "solid",
        });
        let mut simulator = lane_with(parameters).unwrap();
        let camera = simulator.camera();
        let mut labels = vec![0; (camera.width * camera.height) as usize];
        let marking = simulator.label_names().iter().position(|name| name == "marking").unwrap() as u8;
        let mut frame = FrameBuf::new(camera.width as usize, camera.height as usize);
        let mut state = simulator.reset(&scenario(Value::Null, 4), 0).unwrap();
        let mut count = 0;
        for _ in 0..200 {
            simulator.frame(frame.as_mut()).unwrap();
            simulator.labels(&mut labels).unwrap();
            count += labels.iter().filter(|label| **label == marking).count();
            state = simulator.act(guide(&simulator, &state)).unwrap();
        }
        count as f64
    };
    let [all, half, few] = [0.0, 0.5, 0.9].map(markings);
    assert!((0.3..0.7).contains(&(half / all)) && few < 0.3 * all, "{all} {half} {few}");
}

#[test]
fn a_driver_that_leaves_the_lane_hits_parked_vehicles() {
    let parameters = json!({"width": 8, "height": 6, "parked": 60, "oncoming": 0});
    let mut simulator = lane_with(parameters).unwrap();
    let straight = json!({"angles": [0, 0, 0, 0, 0, 0, 0, 0], "segment": 40});
    let mut state = simulator.reset(&scenario(straight, 1), 0).unwrap();
    while !state.collision {
        // Along the shoulder.
        let steering = 0.3 * (3.4 - state.cross_track_error) - 2.0 * state.heading;
        state = simulator.act(Control { steering: steering.clamp(-0.3, 0.3), throttle: 0.05 }).unwrap();
        assert!(!state.finished, "{state:?}");
    }
    assert!(state.cross_track_error > 1.9, "{state:?}");
}

#[test]
fn straight_ends_are_straight_and_every_segment_counts() {
    let layout = Layout { straight_ends: 24.0, ..Layout::default() };
    for road in [
        json!({"angles": [30, 0, -20, 10]}),
        json!({"angles": [30, 0, -20, 10], "segment": [20, 25, 30, 40]}),
    ] {
        let plain = Road::new(&road, 0, Layout::default()).unwrap();
        let ends = Road::new(&road, 0, layout).unwrap();
        let segments = if road.get("segment").is_some() { 40.0 } else { 25.0 };
        let more = ends.path.length() - plain.path.length();
        assert!((more - 24.0 - segments).abs() < 1.5, "{more}");
        let [x, z] = ends.path.direction(0);
        for along in [6.0, 12.0, 18.0, 23.0] {
            let [dx, dz] = ends.path.direction(ends.path.segment_at(along));
            assert!((dx - x).abs() < 1e-6 && (dz - z).abs() < 1e-6, "{along}: {dx} {dz}");
        }
    }
    let given = vec![[3.0, 1.0, 5.0], [3.0, 1.0, 6.3], [3.1, 1.0, 20.0], [9.0, 1.0, 60.0]];
    let ends = Road::new(&json!({"waypoints": given}), 0, layout).unwrap();
    assert!((ends.waypoints[0][2] - (5.0 - 24.0)).abs() < 1e-9 && ends.waypoints[0][0] == 3.0);
    let plain = Road::new(&json!({"waypoints": given}), 0, Layout::default()).unwrap();
    assert!((ends.path.length() - plain.path.length() - 24.0).abs() < 0.01);
}
