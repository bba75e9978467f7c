//! What becomes of a drive if one angle of its road is changed a little, by drives.
//!
//! A road has a few angles, so driving it again with one of them changed costs less than a way back through the drive would, and shows what
//! happens, not a prediction of it. Changes to the left and to the right are seldom opposite: a vehicle that meets a bend a little earlier or
//! later sees other frames.

use pdk_model::outcome::Cause;
use pdk_sdk::error::Result;
use serde_json::{Value, json};

use crate::rehearsal::{Driven, Rehearsal};

/// By how many degrees an angle is changed.
pub const TURN: f64 = 1.0;

/// A bend of the road, which may be straight: one of its nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Bend {
    /// Its number, from 1.
    pub node: usize,
    /// Its angle, positive to the right.
    pub degrees: f64,
    /// The drives with the angle [`TURN`] degrees further to the left, and to the right; or why the simulator refuses such a road.
    pub turned: [Result<Turned>; 2],
}

/// How a drive ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turned {
    /// Why it ended.
    pub cause: Cause,
    /// When, in seconds.
    pub time: f64,
    /// Its largest cross-track error in metres.
    pub error: f64,
}

impl Turned {
    /// The end of a drive.
    pub fn of(driven: &Driven) -> Self {
        let time = driven.places.last().map_or(0.0, |place| place.state.time);
        Self { cause: driven.cause, time, error: driven.worst().1 }
    }
}

/// The nodes of a road that is given by angles, up to the last one whose angle changes a frame of the drive; none if the road is given in another
/// way. The simulation is put back onto its own road.
///
/// # Errors
/// If a component fails.
pub fn bends(
    rehearsal: &mut Rehearsal<'_>,
    driven: &Driven,
    frame_done: &mut dyn FnMut(),
) -> Result<Vec<Bend>> {
    let road = rehearsal.scenario().road.clone();
    let perturbations = rehearsal.scenario().perturbations.clone();
    let angles: Option<Vec<f64>> =
        road.get("angles").and_then(Value::as_array).and_then(|all| all.iter().map(Value::as_f64).collect());
    let mut bends = Vec::new();
    for (place, degrees) in angles.unwrap_or_default().into_iter().enumerate() {
        let mut seen = false;
        let mut turn = |by: f64| -> Result<Result<Turned>> {
            let mut other = road.clone();
            other["angles"][place] = json!(degrees + by);
            let start = match rehearsal.start_on(other) {
                Ok(start) => start,
                Err(refused) => {
                    seen = true;
                    return Ok(Err(refused));
                }
            };
            let mut chain = rehearsal.chain(&perturbations)?;
            let again = rehearsal.drive_from(start, &mut chain, frame_done)?;
            let [before, after] =
                [driven, &again].map(|drive| drive.decisions.iter().map(|one| one.frame_hash));
            seen |= !before.eq(after);
            Ok(Ok(Turned::of(&again)))
        };
        let turned = [turn(-TURN)?, turn(TURN)?];
        if !seen {
            break;
        }
        bends.push(Bend { node: place + 1, degrees, turned });
    }
    rehearsal.start_on(road)?;
    Ok(bends)
}
