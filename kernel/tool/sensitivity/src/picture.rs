//! A picture that a perturbation of drives shows, such as a patch on the road, trained by the derivative of the drives.
//!
//! At each frame of a drive, the way back says how the cross-track errors that follow change with the steering. The exact gradient of the driver's
//! network says how the steering changes with each byte of the frame, and the perturbation says how the frame changes with the picture. Together
//! they are the derivative of a drive with respect to its picture. A step along it, another drive, and so on: so the picture learns what moves the
//! vehicle in the end, not what moves the steering at single frames, which the driver makes good at the next one.

use pdk_model::outcome::Cause;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::FrameBuf;

use crate::rehearsal::{Driven, Rehearsal};
use crate::sweep::{At, go_back};

/// The share of the direction that is kept from step to step.
const MOMENTUM: f64 = 0.9;
/// The first step, in grey levels; later ones are shorter, down to none.
const STEP: f32 = 25.0;

/// A picture in training.
pub struct Training {
    size: [usize; 2],
    values: Vec<f32>,
    direction: Vec<f64>,
}

impl Training {
    /// Begins with a picture.
    pub fn new(picture: &FrameBuf) -> Self {
        let values: Vec<f32> = picture.data().iter().map(|byte| f32::from(*byte)).collect();
        let direction = vec![0.0; values.len()];
        Self { size: [picture.width(), picture.height()], values, direction }
    }

    /// The picture as it is now.
    ///
    /// # Errors
    /// Never, as there are three values for each pixel.
    pub fn picture(&self) -> Result<FrameBuf> {
        let bytes = self.values.iter().map(|value| value.round_ties_even() as u8).collect();
        FrameBuf::from_vec(bytes, self.size[0], self.size[1]).map_err(Error::new)
    }

    /// Drives with the picture, which the scenario's last perturbation shows, and goes a step along the derivative, if the vehicle stays in its
    /// lane: `share` of the longest step, so that the vehicle drives further to `side`, 1 for the right. Returns the drive.
    ///
    /// # Errors
    /// If a component fails, the driver has no gradient, or no picture is shown.
    pub fn step(
        &mut self,
        rehearsal: &mut Rehearsal<'_>,
        perturbations: &[AppliedPerturbation],
        side: f64,
        share: f32,
        frame_done: &mut dyn FnMut(),
    ) -> Result<Driven> {
        let mut chain = rehearsal.chain(perturbations)?;
        let driven = rehearsal.drive(&mut chain, frame_done)?;
        if driven.cause == Cause::LaneDeparture {
            return Ok(driven);
        }
        let slopes = self.slopes(rehearsal, perturbations, &driven, side, frame_done)?;
        // By Dong et al., Boosting Adversarial Attacks with Momentum, 2018.
        let size: f64 = slopes.iter().map(|slope| slope.abs()).sum::<f64>().max(f64::MIN_POSITIVE);
        let scale = slopes.len() as f64 / size;
        for ((value, direction), slope) in self.values.iter_mut().zip(&mut self.direction).zip(&slopes) {
            *direction = *direction * MOMENTUM + slope * scale;
            let by = if *direction == 0.0 { 0.0 } else { (STEP * share).copysign(*direction as f32) };
            *value = (*value + by).clamp(0.0, 255.0);
        }
        Ok(driven)
    }

    /// How the mean cross-track error of a drive to a side changes with each value of the picture.
    fn slopes(
        &self,
        rehearsal: &mut Rehearsal<'_>,
        perturbations: &[AppliedPerturbation],
        driven: &Driven,
        side: f64,
        frame_done: &mut dyn FnMut(),
    ) -> Result<Vec<f64>> {
        let mut chain = rehearsal.chain(perturbations)?;
        let mut of_frame = vec![0.0; rehearsal.raw().data().len()];
        let mut of_picture = vec![0.0f32; self.values.len()];
        let mut sums = vec![0.0; self.values.len()];
        let count = driven.places.len() as f64;
        let weight = |frame| if frame == 0 { 0.0 } else { side / count };
        go_back(rehearsal, &mut chain, driven, &weight, &mut |rehearsal, chain, at| {
            let At { place, decision, of_control, .. } = *at;
            rehearsal.gradient(place, decision, &mut of_frame)?;
            of_picture.fill(0.0);
            rehearsal.picture_gradient(chain, place, &of_frame, &mut of_picture)?;
            let of_steering = of_control.of_steering();
            sums.iter_mut().zip(&of_picture).for_each(|(sum, of)| *sum += of_steering * f64::from(*of));
            frame_done();
            Ok(())
        })?;
        Ok(sums)
    }
}
