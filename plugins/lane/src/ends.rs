//! Straight road before a scenario's own. What goes behind a road of angles is part of its layout: [`pdk_road::read_with_end`].

use pdk_road::distance;

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
