//! How the largest error of a drive changes with each bend of its road, by drives.
//!
//! A road has a few bends, so driving it again with one of them changed costs less than a way back through the drive would, and shows what
//! happens, not a prediction of it. The changes to both sides are reported as they are: they are seldom opposite, since a vehicle that meets
//! a bend a little earlier or later sees other frames.

use pdk_sdk::error::Result;
use serde_json::{Value, json};

use crate::course::on_courses;
use crate::rehearsal::{Driven, Rehearsal};
use crate::sweep::Sensitivity;
use crate::windows::NOTHING;

/// By how many degrees a bend is changed.
pub const TURN: f64 = 1.0;
/// For how many seconds behind the frame of the largest error a drive on a changed road is driven, since there it may come later.
const LATER: f64 = 1.0;

/// A bend of the road.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    /// The number of its node, from 1.
    pub node: usize,
    /// Its angle, positive to the right.
    pub degrees: f64,
    /// By how many metres the error is larger with the angle [`TURN`] degrees further to the left, and to the right; none if the simulator refuses
    /// such a road.
    pub turned: [Option<f64>; 2],
}

impl Bend {
    /// The largest change that was driven, in metres.
    pub fn effect(&self) -> f64 {
        self.turned.iter().flatten().map(|change| change.abs()).fold(0.0, f64::max)
    }

    /// Whether that is more than nothing.
    pub fn matters(&self) -> bool {
        self.effect() >= NOTHING
    }
}

/// The bends of a road that is given by angles, up to the last one that the camera saw before the largest error; none if the road is given in another
/// way. The simulation is put back onto its own road.
///
/// # Errors
/// If a component fails.
pub fn bends(
    rehearsal: &mut Rehearsal<'_>,
    driven: &Driven,
    sensitivity: &Sensitivity,
    frame_done: &mut dyn FnMut(),
) -> Result<Vec<Bend>> {
    let road = rehearsal.scenario().road.clone();
    let angles: Option<Vec<f64>> =
        road.get("angles").and_then(Value::as_array).and_then(|all| all.iter().map(Value::as_f64).collect());
    let mut bends = Vec::new();
    for (place, degrees) in angles.unwrap_or_default().into_iter().enumerate() {
        let mut turned = [None; 2];
        let mut seen = false;
        for (by, change) in [-TURN, TURN].into_iter().zip(&mut turned) {
            let mut other = road.clone();
            other["angles"][place] = json!(degrees + by);
            match on_road(rehearsal, &other, driven, sensitivity, frame_done)? {
                Some((error, same)) => {
                    *change = Some(error - sensitivity.error);
                    seen |= !same;
                }
                None => seen = true,
            }
        }
        if !seen {
            break;
        }
        bends.push(Bend { node: place + 1, degrees, turned });
    }
    rehearsal.start_on(road)?;
    Ok(bends)
}

/// The largest error of a drive on another road, towards the same side, and whether the driver saw the same frames. It is driven on also if
/// the vehicle left its lane before. None if the simulator refuses the road.
fn on_road(
    rehearsal: &mut Rehearsal<'_>,
    road: &Value,
    driven: &Driven,
    sensitivity: &Sensitivity,
    frame_done: &mut dyn FnMut(),
) -> Result<Option<(f64, bool)>> {
    let perturbations = on_courses(&rehearsal.scenario().perturbations, &sensitivity.courses);
    let mut chain = rehearsal.chain(&perturbations)?;
    // Its own road was accepted by the same call.
    let Ok(mut place) = rehearsal.start_on(road.clone()) else { return Ok(None) };
    let later = (LATER * rehearsal.camera().rate).round() as usize;
    let end = (sensitivity.worst + later).min(driven.decisions.len() - 1);
    let (mut same, mut error) = (true, f64::NEG_INFINITY);
    for before in &driven.decisions[..end] {
        rehearsal.render(&place)?;
        let decision = rehearsal.decide_alone(&mut chain, &place)?;
        same &= decision.frame_hash == before.frame_hash;
        place = rehearsal.act(&place, decision.applied)?;
        error = error.max(sensitivity.side * place.state.cross_track_error);
        frame_done();
    }
    Ok(Some((error, same)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_side_with_the_larger_effect_counts() {
        let bend = |left, right| Bend { node: 1, degrees: 5.0, turned: [left, right] };
        assert_eq!(bend(Some(0.05), Some(-0.1)).effect(), 0.1);
        assert_eq!(bend(None, Some(-0.1)).effect(), 0.1);
        assert!(!bend(Some(1e-6), None).matters() && bend(None, Some(-0.1)).matters());
    }
}
