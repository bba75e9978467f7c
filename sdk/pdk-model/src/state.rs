//! The state of the ego vehicle.

use serde::{Deserialize, Serialize};

/// The state of the ego vehicle at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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

impl State {
    /// The names of its numbers, in the order of [`State::numbers`].
    pub const NUMBERS: [&str; 9] =
        ["time", "x", "height", "z", "heading", "speed", "cross_track_error", "progress", "vehicle_ahead"];

    /// The names of its flags, in the order of [`State::flags`].
    pub const FLAGS: [&str; 3] = ["lane_departure", "collision", "finished"];

    /// Its numbers, in the order of [`State::NUMBERS`].
    pub fn numbers(&self) -> [f64; 9] {
        let [x, height, z] = self.position;
        let Self { time, heading, speed, cross_track_error, progress, vehicle_ahead, .. } = *self;
        [time, x, height, z, heading, speed, cross_track_error, progress, vehicle_ahead]
    }

    /// Its flags, in the order of [`State::FLAGS`].
    pub fn flags(&self) -> [bool; 3] {
        [self.lane_departure, self.collision, self.finished]
    }

    /// The state of these numbers and flags, in the order of [`State::NUMBERS`] and [`State::FLAGS`].
    pub fn from_parts(numbers: [f64; 9], flags: [bool; 3]) -> Self {
        let [time, x, height, z, heading, speed, cross_track_error, progress, vehicle_ahead] = numbers;
        let [lane_departure, collision, finished] = flags;
        Self {
            time,
            position: [x, height, z],
            heading,
            speed,
            cross_track_error,
            progress,
            vehicle_ahead,
            lane_departure,
            collision,
            finished,
        }
    }

    /// Whether a scenario can be judged by it: all numbers are finite, except that the road ahead may be free.
    pub fn is_finite(&self) -> bool {
        let [others @ .., vehicle_ahead] = self.numbers();
        others.iter().all(|number| number.is_finite())
            && !vehicle_ahead.is_nan()
            && vehicle_ahead > f64::NEG_INFINITY
    }
}

impl Default for State {
    /// At the start, at rest, on a free road.
    fn default() -> Self {
        let mut numbers = [0.0; 9];
        numbers[8] = free_road();
        Self::from_parts(numbers, [false; 3])
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
    use serde_json::Value;

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

    #[test]
    fn the_parts_are_those_that_are_named_and_make_the_state_again() {
        for flag in 0..3 {
            let flags = std::array::from_fn(|other| other == flag);
            let numbers = std::array::from_fn(|i| i as f64 + 0.5);
            let state = State::from_parts(numbers, flags);
            assert_eq!((state.numbers(), state.flags()), (numbers, flags));
            let mut written = serde_json::to_value(state).unwrap();
            let position = written["position"].take();
            for (name, number) in State::NUMBERS.into_iter().zip(numbers) {
                let found = match ["x", "height", "z"].iter().position(|axis| *axis == name) {
                    Some(axis) => &position[axis],
                    None => &written[name],
                };
                assert_eq!(found, number, "{name}");
            }
            for (name, set) in State::FLAGS.into_iter().zip(flags) {
                assert_eq!(written[name], set, "{name}");
            }
            // The position counts as one field.
            let fields = State::NUMBERS.len() - 2 + State::FLAGS.len();
            assert_eq!(written.as_object().unwrap().len(), fields);
        }
    }

    #[test]
    fn a_number_that_is_not_finite_is_noticed_except_for_a_free_road() {
        assert!(State::default().is_finite());
        for (place, name) in State::NUMBERS.into_iter().enumerate() {
            for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut numbers = [1.0; 9];
                numbers[place] = wrong;
                let free = name == "vehicle_ahead" && wrong == f64::INFINITY;
                assert_eq!(State::from_parts(numbers, [false; 3]).is_finite(), free, "{name} {wrong}");
            }
        }
    }
}
