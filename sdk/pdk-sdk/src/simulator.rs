//! Simulators: components that render frames and move the vehicle.

use abi_stable::StableAbi;
use pdk_ops::FrameMut;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::driver::Control;
use crate::error::Result;

/// Renders what the ego vehicle's camera sees and moves the vehicle.
///
/// The loop calls [`reset`](Simulator::reset) once a scenario, then [`frame`](Simulator::frame) and
/// [`act`](Simulator::act) in turn, once a step.
pub trait Simulator: Send {
    /// Size and rate of the camera. It does not change while the instance lives.
    fn camera(&self) -> Camera;

    /// Puts the vehicle at the start of a scenario.
    ///
    /// # Errors
    /// Where the scenario cannot be built or the simulator does not answer.
    fn reset(&mut self, scenario: &Scenario) -> Result<State>;

    /// Writes what the camera sees now, and returns the state that belongs to it.
    ///
    /// # Errors
    /// Where the simulator does not deliver a frame.
    fn frame(&mut self, into: FrameMut<'_>) -> Result<State>;

    /// Applies a control and moves the simulation on by one frame.
    ///
    /// # Errors
    /// Where the simulator does not take the control.
    fn act(&mut self, control: Control) -> Result<()>;

    /// The centre line of the driven lane as `[x, height, z]` in metres, for the record; empty where it is not known.
    fn waypoints(&self) -> Vec<[f64; 3]> {
        Vec::new()
    }
}

/// Size and rate of a simulator's camera.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, StableAbi, Serialize, Deserialize)]
pub struct Camera {
    /// Frame width in pixels.
    pub width: u32,
    /// Frame height in pixels.
    pub height: u32,
    /// Frames per second of simulation time.
    pub rate: f64,
}

/// What to drive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scenario {
    /// The number of the scenario in its run.
    pub index: u64,
    /// The seed for everything the simulator makes up itself.
    pub seed: u64,
    /// The road, in the simulator's own terms; null for the simulator's default road.
    #[serde(default)]
    pub road: Value,
    /// The time limit in seconds of simulation time.
    pub duration: f64,
}

/// The state of the ego vehicle at one moment.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, StableAbi, Serialize, Deserialize)]
pub struct State {
    /// Simulation time in seconds since the start of the scenario.
    pub time: f64,
    /// Position of the vehicle's centre in metres: x, height, z.
    pub position: [f64; 3],
    /// Heading in radians, clockwise seen from above, 0 towards +z.
    pub heading: f64,
    /// Speed in metres per second.
    pub speed: f64,
    /// Signed distance of the vehicle's centre from the lane's centre line in metres, positive to the right.
    pub cross_track_error: f64,
    /// The share of the road that has been driven, 0 to 1.
    pub progress: f64,
    /// Free distance to the vehicle ahead in metres, bumper to bumper; infinite (in JSON: null) where there is none.
    #[serde(default = "free_road", with = "null_where_infinite")]
    pub vehicle_ahead: f64,
    /// The vehicle has left its lane.
    pub lane_departure: bool,
    /// The vehicle has hit something.
    pub collision: bool,
    /// The vehicle has reached the end of the road.
    pub finished: bool,
}

impl Default for State {
    /// At the start, at rest, on a free road.
    fn default() -> Self {
        Self {
            time: 0.0,
            position: [0.0; 3],
            heading: 0.0,
            speed: 0.0,
            cross_track_error: 0.0,
            progress: 0.0,
            vehicle_ahead: free_road(),
            lane_departure: false,
            collision: false,
            finished: false,
        }
    }
}

fn free_road() -> f64 {
    f64::INFINITY
}

/// JSON has no infinity.
mod null_where_infinite {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        Some(*value).filter(|value| value.is_finite()).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_free_road_survives_json() {
        for vehicle_ahead in [f64::INFINITY, 12.5] {
            let state = State { vehicle_ahead, ..State::default() };
            let text = serde_json::to_string(&state).unwrap();
            assert_eq!(serde_json::from_str::<State>(&text).unwrap(), state);
            assert_eq!(text.contains("\"vehicle_ahead\":null"), vehicle_ahead.is_infinite());
        }
        let old = serde_json::to_value(State::default()).unwrap();
        let Value::Object(mut fields) = old else { panic!("a state is an object") };
        fields.remove("vehicle_ahead");
        assert_eq!(serde_json::from_value::<State>(fields.into()).unwrap(), State::default());
    }
}
