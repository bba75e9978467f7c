//! Tests of what shows at the edges of the view: vehicles that pass, and the ground of cameras that look up or far down.

use pdk_sdk::camera::Mounting;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::camera::Projection;
use crate::labels::Label;
use crate::tests::{lane_with, scenario};

/// Standing still, so that nothing else in the labels changes.
const BRAKED: Control = Control { steering: 0.0, throttle: -1.0 };

#[test]
fn an_oncoming_vehicle_leaves_the_view_bit_by_bit() {
    let parameters = json!({
        "initial_speed": 0, "oncoming": 20, "parked": 0, "rate": 100, "width": 320, "height": 160,
    });
    let mut simulator = lane_with(parameters).unwrap();
    simulator.reset(&scenario(json!({"angles": [0, 0, 0, 0, 0, 0]}), 3), 0).unwrap();
    let mut frame = FrameBuf::new(320, 160);
    let mut labels = vec![0; 320 * 160];
    let (mut most, mut before, mut passed) = (0, 0, 0);
    for time in 0..2_000 {
        simulator.frame(frame.as_mut()).unwrap();
        simulator.labels(&mut labels).unwrap();
        // The left quarter shows what is nearer than some 10 m.
        let left = labels.chunks(320).flat_map(|row| &row[..80]);
        let count = left.filter(|label| **label == Label::Vehicle.number()).count();
        // It comes 9 cm nearer between two frames.
        assert!(count + 700 > before, "{before} pixels, then {count} at frame {time}");
        most = most.max(count);
        passed += usize::from(count == 0 && before > 0);
        before = count;
        simulator.act(BRAKED).unwrap();
    }
    assert!(most > 2_000 && passed > 1, "{most} pixels at most, {passed} vehicles passed");
}

#[test]
fn below_the_horizon_there_is_ground_however_the_camera_is_mounted() {
    let mut straight_down = 0;
    for size in [[64, 32], [48, 96]] {
        for (field_of_view, height, pitch) in [20.0, 130.0]
            .into_iter()
            .flat_map(|view| [0.3, 1.5, 4.0].map(|height| (view, height)))
            .flat_map(|(view, height)| [-10.0, 0.0, 25.0].map(|pitch| (view, height, pitch)))
        {
            let [width, rows] = size;
            let parameters = json!({
                "width": width, "height": rows, "oncoming": 0, "field_of_view": field_of_view, "camera_height": height,
                "camera_pitch": pitch,
            });
            let mut simulator = lane_with(parameters.clone()).unwrap();
            simulator.reset(&scenario(json!({"angles": [0, 0, 0, 0]}), 1), 0).unwrap();
            let mut frame = FrameBuf::new(width, rows);
            simulator.frame(frame.as_mut()).unwrap();
            let (mut labels, mut depth) = (vec![0; width * rows], vec![0.0; width * rows]);
            simulator.labels(&mut labels).unwrap();
            simulator.depth(&mut depth).unwrap();
            let projection = Projection::new(width, rows, Mounting { field_of_view, height, pitch });
            let ground = projection.horizon_on(0.0).max(-1.0) + 1.0;
            for y in ground.ceil() as usize..rows {
                let row = y * width..(y + 1) * width;
                assert!(!labels[row.clone()].contains(&Label::Sky.number()), "row {y} of {parameters}");
                assert!(depth[row].iter().all(|depth| *depth > 0.0), "row {y} of {parameters}");
            }
            straight_down += usize::from(projection.ground(rows as f64).is_some_and(|edge| edge.ahead < 0.0));
        }
    }
    assert!(straight_down > 0, "the lowest row of some cameras shows what is behind them");
}
