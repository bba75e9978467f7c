//! What was recorded with a frame, and in which units: steering, throttle, brake and speed.

use pdk_sdk::prelude::*;

/// What was recorded with a frame; not a number if it was not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Label {
    /// -1 (full left) to 1 (full right).
    pub steering: f64,
    /// -1 (full brake) to 1 (full throttle).
    pub throttle: f64,
    /// Metres per second.
    pub speed: f64,
}

impl Label {
    /// Nothing was recorded.
    pub const NONE: Self = Self { steering: f64::NAN, throttle: f64::NAN, speed: f64::NAN };
}

/// The smallest and the largest of the numbers; what is not a number does not count. Without any, the smallest is larger than the largest.
pub fn range(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    numbers
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), number| (low.min(number), high.max(number)))
}

/// How recorded numbers become those of pdk.
#[derive(Debug, Clone, Copy)]
pub struct Units {
    /// The recorded number that is full steering to the right.
    full_lock: f64,
    /// Metres per second of one unit of speed.
    speed: f64,
    /// The name of that unit.
    speed_name: &'static str,
}

/// Units of speed, with their metres per second.
const SPEEDS: [(&str, f64); 3] = [("m/s", 1.0), ("km/h", 1.0 / 3.6), ("mph", 0.44704)];

impl Units {
    /// The parameters that choose the units. `speed` is the unit of speed by default.
    pub fn parameters(speed: &str) -> [Parameter; 2] {
        let mut units = vec![speed];
        units.extend(SPEEDS.iter().map(|(name, _)| *name).filter(|name| *name != speed));
        [
            Parameter::number(
                "full_lock",
                1.0,
                "the recorded steering that is full steering to the right: 1 for values from -1 to 1, the steering angle in degrees or \
                 radians otherwise; negative if the recording counts to the left",
            ),
            Parameter::choice("speed_unit", &units, "the unit of the recorded speed"),
        ]
    }

    /// The units that the configuration asks for.
    ///
    /// # Errors
    /// If full steering is zero.
    pub fn new(config: &Config) -> Result<Self> {
        Self::of(config, config.number("full_lock"))
    }

    /// The units that the configuration asks for, with this full steering to the right.
    ///
    /// # Errors
    /// If it is zero.
    pub fn of(config: &Config, full_lock: f64) -> Result<Self> {
        if full_lock == 0.0 {
            return Err(Error::new(
                "full_lock is 0; give the recorded steering that is full steering to the right",
            ));
        }
        let unit = config.text("speed_unit");
        let (speed_name, speed) = SPEEDS.into_iter().find(|(name, _)| *name == unit).unwrap_or(SPEEDS[0]);
        Ok(Self { full_lock, speed, speed_name })
    }

    /// Steering from -1 to 1, of what was recorded.
    pub fn steering(&self, recorded: f64) -> f64 {
        recorded / self.full_lock
    }

    /// Speed in metres per second, of what was recorded.
    pub fn speed(&self, recorded: f64) -> f64 {
        recorded * self.speed
    }

    /// Says what is done to the steering, which lies between these recorded values.
    ///
    /// # Errors
    /// If it goes beyond full steering.
    pub fn describe_steering(&self, lowest: f64, highest: f64) -> Result<String> {
        let beyond = [lowest, highest].into_iter().find(|value| self.steering(*value).abs() > 1.0);
        match beyond {
            None => Ok(format!("{lowest} to {highest}, divided by full_lock = {}", self.full_lock)),
            Some(value) => Err(Error::new(format!(
                "the recorded steering goes from {lowest} to {highest}, and {value} is beyond full_lock = {}; set `full_lock` to the \
                 recorded value of full steering to the right, such as 25 for degrees or 0.44 for radians",
                self.full_lock
            ))),
        }
    }

    /// The name of the unit of speed.
    pub fn speed_name(&self) -> &'static str {
        self.speed_name
    }
}

/// Throttle and brake as one number from -1 to 1; not a number if neither was recorded.
///
/// # Errors
/// If it is outside.
pub fn pedals(throttle: f64, brake: f64) -> Result<f64> {
    let both = match (throttle.is_nan(), brake.is_nan()) {
        (false, false) => throttle - brake,
        (false, true) => throttle,
        (true, false) => -brake,
        (true, true) => return Ok(f64::NAN),
    };
    match (-1.0..=1.0).contains(&both) {
        true => Ok(both),
        false => Err(Error::new(format!("the throttle is {both}, but has to be from -1 to 1"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::serde_json::{Value, json};

    fn units(given: Value) -> Result<Units> {
        let description =
            Units::parameters("m/s").into_iter().fold(Description::dataset("d", ""), Description::parameter);
        Units::new(&Config::check(&description, given.as_object().unwrap()).unwrap())
    }

    #[test]
    fn the_scale_of_the_steering_is_stated_and_never_guessed() {
        let plain = units(json!({})).unwrap();
        assert_eq!(plain.steering(0.5), 0.5);
        let error = plain.describe_steering(-25.0, 24.0).unwrap_err().to_string();
        assert!(error.contains("goes from -25 to 24") && error.contains("set `full_lock`"), "{error}");
        let degrees = units(json!({"full_lock": -25})).unwrap();
        assert_eq!((degrees.steering(25.0), degrees.steering(-5.0)), (-1.0, 0.2));
        assert_eq!(degrees.describe_steering(-25.0, 24.0).unwrap(), "-25 to 24, divided by full_lock = -25");
        assert!(units(json!({"full_lock": 0})).is_err());
    }

    #[test]
    fn speeds_are_in_metres_per_second() {
        assert_eq!(units(json!({})).unwrap().speed(3.0), 3.0);
        assert!((units(json!({"speed_unit": "km/h"})).unwrap().speed(36.0) - 10.0).abs() < 1e-12);
        assert!((units(json!({"speed_unit": "mph"})).unwrap().speed(10.0) - 4.4704).abs() < 1e-12);
    }

    #[test]
    fn the_brake_counts_against_the_throttle() {
        assert_eq!(pedals(0.5, 0.25).unwrap(), 0.25);
        assert_eq!(pedals(0.5, f64::NAN).unwrap(), 0.5);
        assert_eq!(pedals(f64::NAN, 1.0).unwrap(), -1.0);
        assert!(pedals(f64::NAN, f64::NAN).unwrap().is_nan());
        assert!(pedals(2.0, 0.0).is_err());
    }
}
