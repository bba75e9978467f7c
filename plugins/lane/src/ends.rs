//! Straight road before a scenario's own and behind it.

use pdk_road::distance;
use pdk_sdk::serde_json::{Value, json};

/// A road of angles that goes straight on behind its last node, so that the segment before that is driven too.
pub fn with_end(road: &Value, length: f64) -> Value {
    let mut road = road.clone();
    let count = road["angles"].as_array().map_or(0, Vec::len);
    let segment = road.get("segment").cloned().unwrap_or(json!(pdk_road::SEGMENT));
    if !segment.is_array() {
        road["segment"] = vec![segment; count].into();
    }
    let mut extend = |field: &str, value: Option<Value>| {
        if let Some(values) = road.get_mut(field).and_then(Value::as_array_mut) {
            let value = value.or_else(|| values.last().cloned()).unwrap_or_default();
            values.push(value);
        }
    };
    extend("angles", Some(json!(0)));
    extend("segment", Some(json!(length)));
    extend("heights", None);
    road
}

/// A road of waypoints with a straight piece before its start.
pub fn with_start(waypoints: Vec<[f64; 3]>, length: f64) -> Vec<[f64; 3]> {
    let (Some(&first), Some(&second)) = (waypoints.first(), waypoints.get(1)) else { return waypoints };
    let apart = distance([first[0], first[2]], [second[0], second[2]]);
    if apart == 0.0 {
        return waypoints;
    }
    // Points as far apart as those behind them, so that the curve through them is the one that was.
    let count = (length / apart.clamp(0.5, 5.0)).ceil();
    let back = |i: f64, axis: usize| first[axis] - (second[axis] - first[axis]) / apart * length * i / count;
    let before = (1..=count as usize).rev().map(|i| [back(i as f64, 0), first[1], back(i as f64, 2)]);
    before.chain(waypoints.iter().copied()).collect()
}
