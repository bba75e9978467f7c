//! What the simulator says about the vehicle, as far as it is believed.

use pdk_components::held::Held;
use pdk_model::scenario::Scenario;
use pdk_sdk::describe::Clock;
use pdk_sdk::error::{Error, ErrorKind};
use pdk_sdk::prelude::{Simulator, State};
use pdk_sdk::timeline::{Timeline, Told};

use crate::fault::Fault;
use crate::way::Way;

/// A simulator may deliver this many times the frames that its rate and the time limit make, and this many more; a scenario
/// whose time does not advance would never end.
const PATIENT_FACTOR: u64 = 10;
const PATIENT_FRAMES: u64 = 1000;

/// About this many frames a scenario has at most.
pub fn expected_frames(scenario: &Scenario, rate: f64) -> u64 {
    (scenario.duration * rate).ceil() as u64 + 1
}

/// The motion of the vehicle in a scenario.
#[derive(Default)]
pub struct Motion {
    /// The last state that was judged.
    pub state: State,
    way: Way,
    /// The times of the states; none before the first one.
    timeline: Option<Timeline>,
    /// How many frames there may be.
    limit: u64,
    /// The time limit of the scenario, in seconds.
    duration: f64,
}

impl Motion {
    /// The motion in a scenario that begins now, in a simulator of this clock and rate.
    pub fn start(scenario: &Scenario, clock: Clock, rate: f64) -> Self {
        Self {
            timeline: Some(Timeline::new(clock, rate)),
            limit: PATIENT_FRAMES + PATIENT_FACTOR * expected_frames(scenario, rate),
            duration: scenario.duration,
            ..Self::default()
        }
    }

    /// How far the vehicle has driven by a state.
    pub fn reach(&mut self, state: &State) -> f64 {
        self.way.reach(state.time, state.speed)
    }

    /// Whether a scenario can be judged by a state: what a vehicle can do, and a time that goes on. Whatever simulator it comes
    /// from, it is believed nowhere else before. It is the state of frame `sequence`, after this many frames that were driven.
    ///
    /// # Errors
    /// Says what cannot be.
    pub fn believe(
        &mut self,
        state: &State,
        told: Told,
        [sequence, frames]: [u64; 2],
        simulator: &Held<dyn Simulator>,
    ) -> Result<(), Fault> {
        let nonsense = |error: Error| Fault::Component(error.at(simulator.label()));
        let goes_on = |timeline: &mut Timeline| timeline.go_on(state.time, told);
        let believed = state.check().and_then(|()| self.timeline.as_mut().map_or(Ok(()), goes_on));
        believed.map_err(|error| {
            let (kind, sentence) = (error.kind(), error.message());
            nonsense(Error::of(kind, format!("{sentence}, in the state of frame {sequence}")))
        })?;
        if frames > self.limit {
            return Err(nonsense(Error::of(
                ErrorKind::Nonsense,
                format!(
                    "after {} frames it says that {} s have passed of {} s, so its time does not advance",
                    self.limit, state.time, self.duration
                ),
            )));
        }
        Ok(())
    }
}
