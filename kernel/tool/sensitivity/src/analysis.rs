//! All that is found out about a drive.

use std::ops::Range;

use pdk_components::registry::Registry;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::Scenario;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::FrameBuf;

use crate::least::{Found, least};
use crate::rehearsal::{Driven, Rehearsal};
use crate::span::shortest;
use crate::sweep::{Sensitivity, courses, sweep};
use crate::windows::{Window, reach, windows};

/// The share of the influence of a level that counts as most of it.
pub const SHARE: f64 = 0.5;

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
    /// The least change with which it leaves its lane, if that was searched for.
    pub least: Option<Found>,
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
    /// Differentiates a drive, which has to come out with this digest. `progress` is called for each frame, with what is being done.
    ///
    /// # Errors
    /// If the drive cannot be put back, is not the recorded one, has no error to differentiate, or a component fails.
    pub fn new(
        registry: &Registry,
        scenario: &Scenario,
        digest: &str,
        with_least: bool,
        progress: &mut dyn FnMut(&'static str),
    ) -> Result<Self> {
        if scenario.perturbations.is_empty() {
            return Err(Error::new(
                "it has no perturbations, so there are no levels to differentiate by; name a scenario that has",
            ));
        }
        let mut rehearsal = Rehearsal::new(registry, scenario)?;
        let mut chain = rehearsal.chain(&scenario.perturbations)?;
        let driven = rehearsal.drive(&mut chain, &mut || progress("driving"))?;
        Rehearsal::check_same(&driven, digest)?;
        if driven.worst().0 == 0 {
            return Err(Error::new(
                "its cross-track error is largest at its start, where no level has had an effect yet",
            ));
        }
        let courses = courses(&rehearsal)?;
        let sensitivity = sweep(&mut rehearsal, &courses, &driven, &mut || progress("going back"))?;
        let mut perturbations = Vec::new();
        for place in 0..courses.len() {
            let windows = windows(&mut rehearsal, &driven, &sensitivity, place, &mut || {
                progress("checking by drives")
            })?;
            perturbations.push(OfPerturbation::new(&mut rehearsal, &driven, &sensitivity, place, windows)?);
        }
        let least = match with_least {
            true => Some(least(&mut rehearsal, &driven, &sensitivity, &mut || progress("searching"))?),
            false => None,
        };
        let rate = rehearsal.camera().rate;
        Ok(Self { driven, rate, sensitivity, perturbations, least })
    }

    /// The scenario on other courses.
    pub fn with_courses(&self, scenario: &Scenario, courses: &[crate::course::Course]) -> Scenario {
        let applied = courses.iter().zip(&scenario.perturbations);
        let perturbations: Vec<AppliedPerturbation> =
            applied.map(|(course, applied)| course.apply(applied)).collect();
        Scenario { perturbations, ..scenario.clone() }
    }
}

impl OfPerturbation {
    fn new(
        rehearsal: &mut Rehearsal<'_>,
        driven: &Driven,
        sensitivity: &Sensitivity,
        place: usize,
        windows: Vec<Window>,
    ) -> Result<Self> {
        let worst = sensitivity.worst;
        let holds = worst - reach(&windows, worst)..worst;
        let influence = &sensitivity.influence[place][holds.clone()];
        let decides = shortest(influence, holds.start, SHARE);
        let strongest = decides.clone().and_then(|span| {
            let size = |frame: &usize| sensitivity.influence[place][*frame].abs();
            span.max_by(|a, b| size(a).total_cmp(&size(b)))
        });
        let frame = match strongest {
            Some(frame) => {
                let place = &driven.places[frame];
                rehearsal.restore(place.frame, &place.saved)?;
                rehearsal.render(place)?;
                Some(rehearsal.raw().clone())
            }
            None => None,
        };
        Ok(Self { windows, holds, decides, frame })
    }
}
