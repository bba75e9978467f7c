//! Simulators: components that render frames and move the vehicle.

pub use pdk_model::camera::Camera;
pub use pdk_model::scenario::Scenario;
pub use pdk_model::state::State;
use pdk_ops::FrameMut;

use crate::driver::Control;
use crate::error::{Error, Result};

/// What a simulator is asked for besides frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Annotations {
    /// [`labels`](Simulator::labels).
    pub labels: bool,
    /// [`depth`](Simulator::depth).
    pub depth: bool,
}

/// Renders what the ego vehicle's camera sees and moves the vehicle.
///
/// The loop calls [`reset`](Simulator::reset) once a scenario, then [`frame`](Simulator::frame) and
/// [`act`](Simulator::act) in turn, once a step. In real time it calls `act` several times in a row where the driver was
/// still at work while frames went by.
///
/// A simulator with its own clock ([`Clock::Own`](crate::describe::Clock::Own)) goes on whatever the loop does. It is driven in real time
/// only, and `act` is called once a step: it applies the control, waits for the next frame after that, and returns its state. Frames
/// that came while the driver was at work are skipped; where one of them has a state that ends the scenario, that state is
/// returned instead. How many were skipped follows from the time in the state.
pub trait Simulator: Send {
    /// Size and rate of the camera. It does not change while the instance lives.
    fn camera(&self) -> Camera;

    /// Puts the vehicle at the start of a scenario. `slot` is the number of the worker that drives it, from 0: two that
    /// drive at the same time have different ones, so that each can take a network port of its own. Nothing else may
    /// depend on it. What reaches a plugin has no perturbations: a simulator shows the same world whatever is done to its
    /// pictures.
    ///
    /// # Errors
    /// If the scenario cannot be built or the simulator does not answer.
    fn reset(&mut self, scenario: &Scenario, slot: u32) -> Result<State>;

    /// Writes what the camera sees now, and returns the state that belongs to it.
    ///
    /// # Errors
    /// If the simulator does not deliver a frame.
    fn frame(&mut self, into: FrameMut<'_>) -> Result<State>;

    /// Applies a control, moves the simulation on by one frame, and returns the state after that: the one that the next
    /// [`frame`](Simulator::frame) returns as well. So every state is judged, also that of a frame that is not used.
    ///
    /// # Errors
    /// If the simulator does not take the control.
    fn act(&mut self, control: Control) -> Result<State>;

    /// The centre line of the driven lane as `[x, height, z]` in metres, for the record; empty if it is not known.
    fn waypoints(&self) -> Vec<[f64; 3]> {
        Vec::new()
    }

    /// What a simulator that is a program of its own has told of itself by now, such as its version: names and values for people.
    fn info(&self) -> Vec<(String, String)> {
        Vec::new()
    }

    /// Says which annotations will be asked for in the scenarios that follow, before [`reset`](Simulator::reset): a simulator that
    /// needs a sensor of its own for them has time to make one. By default, none are asked for.
    fn annotate(&mut self, annotations: Annotations) {
        let _ = annotations;
    }

    /// What the simulator can tell apart in its frames, 256 at most; empty if it labels nothing. If it fits, the names are
    /// `sky`, `road`, `marking`, `vehicle`, `pedestrian`, `vegetation`, `building` and `ground`, so that users find the same ones
    /// everywhere. They do not change while the instance lives.
    fn label_names(&self) -> Vec<String> {
        Vec::new()
    }

    /// Writes for each pixel of the frame that was rendered last the place of what it shows among
    /// [`label_names`](Simulator::label_names), row by row. It is called behind [`frame`](Simulator::frame) if it is needed.
    ///
    /// # Errors
    /// If the simulator labels nothing, or fails.
    fn labels(&mut self, into: &mut [u8]) -> Result<()> {
        let _ = into;
        Err(Error::new("it does not label its frames"))
    }

    /// Writes for each pixel of the frame that was rendered last how far away it is along the optical axis, in metres, row by row;
    /// infinite for the sky. It is called behind [`frame`](Simulator::frame) if it is needed.
    ///
    /// # Errors
    /// If the simulator does not know depths, or fails.
    fn depth(&mut self, into: &mut [f32]) -> Result<()> {
        let _ = into;
        Err(no_depth())
    }
}

/// The error of a simulator that does not know depths.
pub(crate) fn no_depth() -> Error {
    Error::new(
        "it does not tell how far away pixels are, which `nearer`, `farther` and `depth=simulator` need; use a simulator that does",
    )
}
