//! How a drive changes with the picture that its last perturbation shows, such as a patch on the road.
//!
//! At each frame of a drive, the way back says how the cross-track errors that follow change with the steering. The exact gradient of the driver's
//! network says how the steering changes with each byte of the frame, and the perturbation says how the frame changes with the picture. Together
//! they are the derivative of a drive with respect to its picture, as far as the picture acts through the steering. So a picture that follows it
//! learns what moves the vehicle in the end, and not what moves the steering at single frames, which the driver makes good at the next one.

use pdk_model::outcome::Cause;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::error::Result;
use pdk_sdk::prelude::Control;

use crate::rehearsal::{Driven, Rehearsal};
use crate::sweep::{At, go_back};

/// By how much the driver's steering is changed to see what becomes of it on its way to the vehicle.
const STEP_OF_STEERING: f64 = 0.01;

/// The mean cross-track error of a drive to a side, 1 for the right, in metres.
pub fn mean_error(driven: &Driven, side: f64) -> f64 {
    let errors: f64 = driven.places.iter().map(|place| place.state.cross_track_error).sum();
    side * errors / driven.places.len() as f64
}

/// Whether the vehicle left its lane to a side.
pub fn left_to(driven: &Driven, side: f64) -> bool {
    let last = driven.places.last().map_or(0.0, |place| place.state.cross_track_error);
    driven.cause == Cause::LaneDeparture && side * last > 0.0
}

/// How the mean cross-track error of a drive to a side changes with each of the `count` values of the picture that the last of these perturbations
/// shows, as far as the picture acts through the steering.
///
/// # Errors
/// If a component fails, the driver has no gradient, no picture is shown, or what happens at a frame does not follow from that frame alone.
pub fn slopes(
    rehearsal: &mut Rehearsal<'_>,
    perturbations: &[AppliedPerturbation],
    driven: &Driven,
    side: f64,
    count: usize,
    frame_done: &mut dyn FnMut(),
) -> Result<Vec<f64>> {
    let mut chain = rehearsal.chain(perturbations)?;
    let mut of_frame = vec![0.0; rehearsal.raw().data().len()];
    let mut of_picture = vec![0.0f32; count];
    let mut sums = vec![0.0; count];
    let weight = side / driven.places.len() as f64;
    go_back(rehearsal, &mut chain, driven, &|_| weight, &mut |rehearsal, chain, at| {
        let At { place, decision, of_control, .. } = *at;
        rehearsal.gradient(place, decision, &mut of_frame)?;
        of_picture.fill(0.0);
        rehearsal.picture_gradient(chain, place, &of_frame, &mut of_picture)?;
        let Control { steering, .. } = decision.control;
        let mut applied = |by: f64| {
            rehearsal.applied(chain, place, Control { steering: steering + by, ..decision.control })
        };
        let (low, high) = (applied(-STEP_OF_STEERING)?, applied(STEP_OF_STEERING)?);
        let of_steering = of_control.of(low, high) / (2.0 * STEP_OF_STEERING);
        sums.iter_mut().zip(&of_picture).for_each(|(sum, of)| *sum += of_steering * f64::from(*of));
        frame_done();
        Ok(())
    })?;
    Ok(sums)
}
