//! The way back through a drive, from the frame of the largest error to the start; or from the last of several frames whose errors count.

use pdk_chain::chain::Chain;
use pdk_sdk::describe::ActsOn;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Control, State};

use crate::course::{Course, on_courses};
use crate::regions::{Gathered, Regions};
use crate::rehearsal::{Decision, Driven, Place, Rehearsal};
use crate::variant::Variant;

/// By how much controls are changed.
const STEP_OF_CONTROL: f64 = 1e-4;
/// The part of a number's step by which the next state is differentiated, which is computed with 64 bits; a camera's frame needs all of the step.
const PART_FOR_MOTION: f64 = 1e-3;

/// How the largest cross-track error of a drive changes.
#[derive(Debug, Clone)]
pub struct Sensitivity {
    /// The frame of the largest error.
    pub worst: usize,
    /// That error in metres, without its sign.
    pub error: f64,
    /// Its side: 1 for the right, -1 for the left.
    pub side: f64,
    /// For each perturbation of the scenario, metres for one level at each frame before the worst.
    pub influence: Vec<Vec<f64>>,
    /// The courses of the perturbations.
    pub courses: Vec<Course>,
    /// Where in the frames it comes from, for each perturbation; or why that is not known.
    pub regions: Result<Vec<Regions>, String>,
}

/// The courses of the perturbations of a scenario.
///
/// # Errors
/// If one has frames without a level.
pub fn courses(rehearsal: &Rehearsal<'_>) -> Result<Vec<Course>> {
    let (frames, rate) = (rehearsal.frames(), rehearsal.camera().rate);
    rehearsal.scenario().perturbations.iter().map(|applied| Course::of(applied, frames, rate)).collect()
}

/// Goes back through a drive with these courses.
///
/// # Errors
/// If a component fails, or what happens at a frame does not follow from that frame alone.
pub fn sweep(
    rehearsal: &mut Rehearsal<'_>,
    courses: &[Course],
    driven: &Driven,
    frame_done: &mut dyn FnMut(),
) -> Result<Sensitivity> {
    let perturbations = on_courses(&rehearsal.scenario().perturbations, courses);
    let (worst, error) = driven.worst();
    let side = driven.places[worst].state.cross_track_error.signum();
    let mut chain = rehearsal.chain(&perturbations)?;
    let mut variants = courses
        .iter()
        .enumerate()
        .map(|(number, course)| Variant::new(rehearsal, &perturbations, number, course))
        .collect::<Result<Vec<_>>>()?;
    let mut influence = vec![vec![0.0; worst]; perturbations.len()];
    let mut regions = Gathered::new(rehearsal, courses.len(), worst);
    let weight = |frame| if frame == worst { side } else { 0.0 };
    go_back(rehearsal, &mut chain, driven, &weight, &mut |rehearsal, _, at| {
        let At { frame, place, decision, of_control } = *at;
        regions.differentiate(rehearsal, place, decision)?;
        for (number, (variant, influence)) in variants.iter_mut().zip(&mut influence).enumerate() {
            let distance = variant.distance(frame);
            let [low, high] = &mut variant.chains;
            let low = rehearsal.decide_alone(low, place)?.applied;
            regions.keep(rehearsal);
            let high = rehearsal.decide_alone(high, place)?.applied;
            influence[frame] = of_control.of(low, high) / distance;
            regions.add(rehearsal, number, frame, of_control.of_steering() / distance);
        }
        frame_done();
        Ok(())
    })?;
    let (courses, regions) = (courses.to_vec(), regions.all());
    Ok(Sensitivity { worst, error, side, influence, courses, regions })
}

/// A frame on the way back.
pub struct At<'a> {
    /// Its number.
    pub frame: usize,
    /// What decides all that follows.
    pub place: &'a Place,
    /// What was decided there.
    pub decision: &'a Decision,
    /// How the measure changes with the control that is applied there.
    pub of_control: OfControl,
}

/// Goes back through a drive with this chain, and calls `visit` at each frame, which is the one that was rendered and decided on last. What is
/// differentiated is the sum of the cross-track errors of all frames, each with this weight.
///
/// # Errors
/// If a component fails, or what happens at a frame does not follow from that frame alone.
pub fn go_back(
    rehearsal: &mut Rehearsal<'_>,
    chain: &mut Chain,
    driven: &Driven,
    weight: &dyn Fn(usize) -> f64,
    visit: &mut dyn FnMut(&mut Rehearsal<'_>, &mut Chain, &At<'_>) -> Result<()>,
) -> Result<()> {
    let Some(last) = (0..driven.places.len()).rev().find(|frame| weight(*frame) != 0.0) else {
        return Ok(());
    };
    let mut adjoint = Adjoint::none(rehearsal);
    adjoint.add_error(rehearsal, &driven.places[last], weight(last))?;
    for frame in (0..last).rev() {
        let (place, decision) = (&driven.places[frame], &driven.decisions[frame]);
        rehearsal.restore(place.frame, &place.saved)?;
        let state = rehearsal.render(place)?;
        let again = rehearsal.decide_alone(chain, place)?;
        if again != *decision || state != place.state {
            return Err(not_alone(rehearsal, place, decision, &again));
        }
        // It moves the simulation, and leaves the frame that was rendered.
        let of_control = adjoint.of_control(rehearsal, place, decision)?;
        visit(rehearsal, chain, &At { frame, place, decision, of_control })?;
        adjoint.step(rehearsal, chain, place, decision, of_control)?;
        adjoint.add_error(rehearsal, place, weight(frame))?;
    }
    Ok(())
}

/// The error if what happens at a frame does not follow from that frame alone.
fn not_alone(rehearsal: &Rehearsal<'_>, place: &Place, driven: &Decision, again: &Decision) -> Error {
    let named = |what: ActsOn| format!("the perturbation {}", rehearsal.acting_on(what).join(" or "));
    let who = if driven.frame_hash != again.frame_hash {
        named(ActsOn::Frame)
    } else if driven.observed != again.observed {
        named(ActsOn::Observation)
    } else if driven.control != again.control {
        format!("the driver `{}`", rehearsal.scenario().driver.name)
    } else {
        named(ActsOn::Control)
    };
    Error::new(format!(
        "{who} remembers earlier frames: the frame at {:.2} s comes out differently if it is looked at by itself; the derivative of a drive is for \
         drives in which every frame counts for itself",
        place.state.time
    ))
}

/// How the measure changes with each number of the control that is applied.
#[derive(Debug, Clone, Copy)]
pub struct OfControl([f64; 2]);

impl OfControl {
    /// How the measure changes with the steering.
    pub fn of_steering(self) -> f64 {
        self.0[0]
    }

    /// How much more the measure is with one control than with another.
    pub fn of(self, low: Control, high: Control) -> f64 {
        let (low, high) = (low.numbers(), high.numbers());
        self.0.iter().zip(low).zip(high).map(|((by, low), high)| by * (high - low)).sum()
    }
}

/// How the measure changes with each number that the simulator saves, at some frame.
struct Adjoint {
    /// Metres for one unit of each number.
    by: Vec<f64>,
    /// The periods of the numbers that are angles; 0 for others.
    periods: Vec<f64>,
}

impl Adjoint {
    /// With nothing that changes.
    fn none(rehearsal: &Rehearsal<'_>) -> Self {
        let periods = rehearsal.numbers().iter().map(|number| number.period).collect();
        Self { by: vec![0.0; rehearsal.numbers().len()], periods }
    }

    /// Adds the error at a frame itself, with a weight.
    fn add_error(&mut self, rehearsal: &mut Rehearsal<'_>, place: &Place, weight: f64) -> Result<()> {
        if weight == 0.0 {
            return Ok(());
        }
        for number in varied(rehearsal) {
            let step = number.step * PART_FOR_MOTION;
            let mut at = |step: f64| -> Result<State> {
                rehearsal.restore(place.frame, &moved(&place.saved, number.place, step))
            };
            let (low, high) = (at(-step)?, at(step)?);
            self.by[number.place] += weight * (high.cross_track_error - low.cross_track_error) / (2.0 * step);
        }
        Ok(())
    }

    /// What this comes to for numbers of the next frame that are so far apart.
    fn of(&self, low: &[f64], high: &[f64]) -> f64 {
        let numbers = low.iter().zip(high).zip(&self.periods);
        let apart = numbers.map(|((low, high), period)| match high - low {
            apart if *period > 0.0 => apart - period * (apart / period).round(),
            apart => apart,
        });
        self.by.iter().zip(apart).map(|(by, apart)| by * apart).sum()
    }

    /// How the measure changes with the control at the frame before.
    fn of_control(
        &self,
        rehearsal: &mut Rehearsal<'_>,
        place: &Place,
        decision: &Decision,
    ) -> Result<OfControl> {
        let mut of_control = [0.0; 2];
        for (number, of_control) in of_control.iter_mut().enumerate() {
            let mut at = |by: f64| -> Result<Vec<f64>> {
                let mut numbers = decision.applied.numbers();
                numbers[number] += by;
                rehearsal.restore(place.frame, &place.saved)?;
                Ok(rehearsal.act(place, Control::from_numbers(numbers))?.saved)
            };
            let (low, high) = (at(-STEP_OF_CONTROL)?, at(STEP_OF_CONTROL)?);
            *of_control = self.of(&low, &high) / (2.0 * STEP_OF_CONTROL);
        }
        Ok(OfControl(of_control))
    }

    /// Goes back by a frame, to `place`, which is the frame that was rendered last.
    fn step(
        &mut self,
        rehearsal: &mut Rehearsal<'_>,
        chain: &mut Chain,
        place: &Place,
        decision: &Decision,
        of_control: OfControl,
    ) -> Result<()> {
        let raw = rehearsal.raw().clone();
        let mut before = vec![0.0; self.by.len()];
        for number in varied(rehearsal) {
            let step = number.step * PART_FOR_MOTION;
            let mut at = |by: f64| -> Result<Vec<f64>> {
                rehearsal.restore(place.frame, &moved(&place.saved, number.place, by))?;
                Ok(rehearsal.act(place, decision.applied)?.saved)
            };
            let (low, high) = (at(-step)?, at(step)?);
            let by_motion = self.of(&low, &high) / (2.0 * step);
            let mut at = |by: f64| -> Result<Option<Control>> {
                rehearsal.restore(place.frame, &moved(&place.saved, number.place, by))?;
                let near = place.in_state(rehearsal.render(place)?);
                let same = *rehearsal.raw() == raw && near.state.speed == place.state.speed;
                if same { Ok(None) } else { Ok(Some(rehearsal.decide_alone(chain, &near)?.applied)) }
            };
            let (low, high) = (at(-number.step)?, at(number.step)?);
            let [low, high] = [low, high].map(|control| control.unwrap_or(decision.applied));
            before[number.place] = by_motion + of_control.of(low, high) / (2.0 * number.step);
        }
        self.by = before;
        Ok(())
    }
}

/// A number that the simulator saves and that is changed by itself.
struct Varied {
    place: usize,
    step: f64,
}

fn varied(rehearsal: &Rehearsal<'_>) -> Vec<Varied> {
    let varied = |(place, step): (usize, f64)| (step > 0.0).then_some(Varied { place, step });
    rehearsal.numbers().iter().map(|number| number.step).enumerate().filter_map(varied).collect()
}

/// The numbers with one of them changed.
fn moved(saved: &[f64], place: usize, by: f64) -> Vec<f64> {
    let mut moved = saved.to_vec();
    moved[place] += by;
    moved
}
