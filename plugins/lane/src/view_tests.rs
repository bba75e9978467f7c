//! Tests of what shows at the edges of the view: vehicles that pass, and the ground of cameras that look up or far down.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

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
