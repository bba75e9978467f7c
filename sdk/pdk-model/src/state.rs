//! The state of the ego vehicle.

use serde::{Deserialize, Serialize};

use crate::error::{Error, ErrorKind, Result};

/// The largest coordinate in metres: above those of all systems of coordinates for maps, which begin far away.
const FARTHEST: f64 = 1e8;

/// What the numbers of a state may be, in the order of [`State::NUMBERS`], and their units. A vehicle that drives backwards may have a
/// speed below zero, and one that has run into the vehicle ahead a free distance below zero.
const BOUNDS: [(f64, f64, &str); 9] = [
    (0.0, 1e6, " s"),
    (-FARTHEST, FARTHEST, " m"),
    (-FARTHEST, FARTHEST, " m"),
    (-FARTHEST, FARTHEST, " m"),
    (-1e6, 1e6, " rad"),
    (-1000.0, 1000.0, " m/s"),
    (-1e5, 1e5, " m"),
    (0.0, 1.0, ""),
    (-FARTHEST, f64::INFINITY, " m"),
];

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
    /// Free distance to the vehicle ahead in metres, bumper to bumper; infinite (in JSON: null) if there is none.
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

    /// Whether a vehicle can be in this state. Numbers far outside of what a vehicle can do are a defect of the simulator, and what is
    /// computed from them would be infinite.
    ///
    /// # Errors
    /// Names the first number that cannot be, and its bounds.
    pub fn check(&self) -> Result<()> {
        for ((name, number), (least, most, unit)) in Self::NUMBERS.into_iter().zip(self.numbers()).zip(BOUNDS)
        {
            if !(least..=most).contains(&number) {
                let name = name.replace('_', " ");
                let sentence = match most.is_finite() {
                    true => {
                        format!("its {name} is {number:?}{unit}, but has to be from {least} to {most}{unit}")
                    }
                    false => format!("its {name} is {number:?}{unit}, but has to be at least {least}{unit}"),
                };
                return Err(Error::of(ErrorKind::Nonsense, sentence));
            }
        }
        Ok(())
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
    fn what_cannot_be_is_named_with_its_bounds() {
        assert_eq!(State::default().check(), Ok(()));
        for (place, name) in State::NUMBERS.into_iter().enumerate() {
            let with = |number: f64| {
                let mut numbers = State::default().numbers();
                numbers[place] = number;
                State::from_parts(numbers, [false; 3]).check()
            };
            let (least, most, _) = BOUNDS[place];
            for right in [least, most, 0.5] {
                assert_eq!(with(right), Ok(()), "{name} {right}");
            }
            for wrong in [f64::NAN, f64::NEG_INFINITY, f64::MIN, least - 1.0] {
                let error = with(wrong).unwrap_err();
                assert_eq!(error.kind(), ErrorKind::Nonsense);
                assert!(
                    error.message().starts_with(&format!("its {} is ", name.replace('_', " "))),
                    "{error}"
                );
            }
            if most.is_finite() {
                assert!(
                    [most * 1.001, f64::MAX, f64::INFINITY].map(with).iter().all(Result::is_err),
                    "{name}"
                );
            }
        }
        let fast = State { speed: 1e200, ..State::default() };
        assert_eq!(
            fast.check().unwrap_err().message(),
            "its speed is 1e200 m/s, but has to be from -1000 to 1000 m/s"
        );
    }
}
