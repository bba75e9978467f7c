//! All that is found out about a drive.

use std::ops::Range;

use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::FrameBuf;

use crate::rehearsal::{Driven, Rehearsal};
use crate::span::shortest;
use crate::sweep::{Sensitivity, courses, sweep};
use crate::windows::{NOTHING, Window, reach, windows};

/// The share of the influence of a level that counts as most of it.
pub const SHARE: f64 = 0.5;

/// The share of an influence that the cells of the frame may be off.
const MISSING: f64 = 0.5;

/// What was found out about a drive.
pub struct Analysis {
    /// The drive.
    pub driven: Driven,
    /// Frames a second.
    pub rate: f64,
    /// Its derivative.
    pub sensitivity: Sensitivity,
    /// What is known of each perturbation.
    pub perturbations: Vec<OfPerturbation>,
}

/// What is known of a perturbation.
pub struct OfPerturbation {
    /// The drives that the derivative was compared with.
    pub windows: Vec<Window>,
    /// The frames before the largest error for which the derivative holds.
    pub holds: Range<usize>,
    /// The shortest span of these frames with [`SHARE`] of the influence; none if there is no influence.
    pub decides: Option<Range<usize>>,
    /// The frame of that span with the largest influence, as the camera saw it.
    pub frame: Option<FrameBuf>,
}

impl Analysis {
    /// Differentiates a drive. `progress` is called for each frame, with what is being done.
    ///
    /// # Errors
    /// If there is no error to differentiate, or a component fails.
    pub fn new(
        rehearsal: &mut Rehearsal<'_>,
        driven: Driven,
        progress: &mut dyn FnMut(&'static str),
    ) -> Result<Self> {
        if driven.worst().0 == 0 {
            return Err(Error::new(
                "its cross-track error is largest at its start, where no level has had an effect yet; name a drive that starts nearer to the middle of \
                 its lane",
            ));
        }
        let courses = courses(rehearsal)?;
        let sensitivity = sweep(rehearsal, &courses, &driven, &mut || progress("going back"))?;
        let mut perturbations = Vec::new();
        for number in 0..courses.len() {
            let check = &mut || progress("checking by drives");
            let windows = windows(rehearsal, &driven, &sensitivity, number, check)?;
            perturbations.push(OfPerturbation::new(rehearsal, &driven, &sensitivity, number, windows)?);
        }
        let rate = rehearsal.camera().rate;
        Ok(Self { driven, rate, sensitivity, perturbations })
    }

    /// How the influence of a perturbation in its decisive span is spread over the cells of the frame, row by row. None if it is not known, or if the
    /// cells do not add up to it: what comes through the throttle, or through a control that is changed on its way, has no place in the frames.
    pub fn cells(&self, number: usize) -> Option<Vec<f64>> {
        let span = self.perturbations[number].decides.clone()?;
        let cells = self.sensitivity.regions.as_ref().ok()?[number].over(span.clone());
        let of_cells: f64 = cells.iter().sum();
        let all: f64 = self.sensitivity.influence[number][span].iter().sum();
        ((of_cells - all).abs() <= MISSING * all.abs()).then_some(cells)
    }
}

/// Drives a recorded scenario.
///
/// # Errors
/// If it has no perturbations, a component fails, or the drive comes out with another digest than this.
pub fn driven(
    rehearsal: &mut Rehearsal<'_>,
    digest: &str,
    progress: &mut dyn FnMut(&'static str),
) -> Result<Driven> {
    let perturbations = rehearsal.scenario().perturbations.clone();
    if perturbations.is_empty() {
        return Err(Error::new(
            "it has no perturbations, so there are no levels to differentiate by; name a scenario that has",
        ));
    }
    let mut chain = rehearsal.chain(&perturbations)?;
    let driven = rehearsal.drive(&mut chain, &mut || progress("driving"))?;
    Rehearsal::check_same(&driven, digest)?;
    Ok(driven)
}

impl OfPerturbation {
    fn new(
        rehearsal: &mut Rehearsal<'_>,
        driven: &Driven,
        sensitivity: &Sensitivity,
        number: usize,
        windows: Vec<Window>,
    ) -> Result<Self> {
        let worst = sensitivity.worst;
        let holds = worst - reach(&windows, worst)..worst;
        let influence = &sensitivity.influence[number];
        let all: f64 = influence[holds.clone()].iter().map(|by| by.abs()).sum();
        let decides = match all < NOTHING {
            true => None,
            false => shortest(&influence[holds.clone()], holds.start, SHARE),
        };
        let strongest = decides
            .clone()
            .and_then(|span| span.max_by(|a, b| influence[*a].abs().total_cmp(&influence[*b].abs())));
        let frame = match strongest.map(|frame| &driven.places[frame]) {
            Some(place) => {
                rehearsal.restore(place.frame, &place.saved)?;
                rehearsal.render(place)?;
                Some(rehearsal.raw().clone())
            }
            None => None,
        };
        Ok(Self { windows, holds, decides, frame })
    }
}
