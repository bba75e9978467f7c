//! What counts as a failure.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::state::State;

/// What counts as a failure, besides a collision and the time limit, which always do.
///
/// The published tool ends a drive where the absolute cross-track error reaches 2 m (DonkeyCar, in a lane of 4 m) or 4 m (Udacity,
/// on a road of 8 m), and where the vehicle makes no progress.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FailureCriteria {
    /// The absolute cross-track error in metres at which the vehicle has left its lane; none if the simulator says that itself,
    /// as `lane` does at 2 m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lane_departure: Option<f64>,
    /// Whether the error has to reach that or to exceed it.
    #[serde(skip_serializing_if = "is_at_least")]
    pub comparison: Comparison,
    /// A vehicle that is slower than this stands still, in metres a second.
    #[serde(skip_serializing_if = "is_standstill_speed")]
    pub standstill_speed: f64,
    /// This many seconds of standing still end a drive.
    #[serde(skip_serializing_if = "is_standstill_seconds")]
    pub standstill_seconds: f64,
    /// The absolute cross-track error in metres at which a wheel is over the line, which is measured and ends nothing: 1.1 for a
    /// vehicle 1.8 m wide in a lane of 4 m.
    #[serde(skip_serializing_if = "is_over_line")]
    pub over_line: f64,
}

/// How a measurement is compared with a limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Comparison {
    /// The limit itself is too much, as in the published tool.
    #[default]
    AtLeast,
    /// The limit itself is allowed.
    MoreThan,
}

impl Comparison {
    /// All comparisons.
    pub const ALL: [Self; 2] = [Self::AtLeast, Self::MoreThan];

    /// The name as users write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::AtLeast => "at_least",
            Self::MoreThan => "more_than",
        }
    }

    /// Whether a value is too much.
    pub fn exceeds(self, value: f64, limit: f64) -> bool {
        match self {
            Self::AtLeast => value >= limit,
            Self::MoreThan => value > limit,
        }
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Comparison {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|comparison| comparison.name() == name).ok_or_else(|| {
            let [one, other] = Self::ALL;
            Error::new(format!("`comparison` is `{name}`, but has to be {one} or {other}"))
        })
    }
}

const DEFAULT: FailureCriteria = FailureCriteria {
    lane_departure: None,
    comparison: Comparison::AtLeast,
    standstill_speed: 0.1,
    standstill_seconds: 5.0,
    over_line: 1.1,
};

impl Default for FailureCriteria {
    fn default() -> Self {
        DEFAULT
    }
}

impl FailureCriteria {
    /// Whether nothing is set, which scenarios leave unsaid.
    pub fn is_default(&self) -> bool {
        *self == DEFAULT
    }

    /// Whether the vehicle has left its lane.
    pub fn departed(&self, state: &State) -> bool {
        match self.lane_departure {
            Some(limit) => self.comparison.exceeds(state.cross_track_error.abs(), limit),
            None => state.lane_departure,
        }
    }

    /// Whether drives can be judged by it.
    ///
    /// # Errors
    /// Names the number that is out of range.
    pub fn check(&self) -> Result<()> {
        let numbers = [
            ("lane_departure", self.lane_departure.unwrap_or(1.0), "m"),
            ("standstill_speed", self.standstill_speed, "m/s"),
            ("standstill_seconds", self.standstill_seconds, "s"),
            ("over_line", self.over_line, "m"),
        ];
        match numbers.into_iter().find(|(_, number, _)| !(*number > 0.0 && number.is_finite())) {
            Some((name, number, unit)) => Err(Error::new(format!(
                "`{name}` in `failure` is {number} {unit}, but has to be more than 0 and finite"
            ))),
            None => Ok(()),
        }
    }
}

// What scenarios leave unsaid is not part of their ids.
fn is_at_least(comparison: &Comparison) -> bool {
    *comparison == DEFAULT.comparison
}

fn is_standstill_speed(speed: &f64) -> bool {
    *speed == DEFAULT.standstill_speed
}

fn is_standstill_seconds(seconds: &f64) -> bool {
    *seconds == DEFAULT.standstill_seconds
}

fn is_over_line(metres: &f64) -> bool {
    *metres == DEFAULT.over_line
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_is_not_said_is_the_default() {
        assert_eq!(serde_json::to_value(FailureCriteria::default()).unwrap(), json!({}));
        assert_eq!(serde_json::from_value::<FailureCriteria>(json!({})).unwrap(), FailureCriteria::default());
        let own = json!({"lane_departure": 4.0, "comparison": "more_than", "standstill_speed": 0.2, "standstill_seconds": 3.0, "over_line": 1.5});
        let criteria: FailureCriteria = serde_json::from_value(own.clone()).unwrap();
        assert_eq!(serde_json::to_value(criteria).unwrap(), own);
        assert!(!criteria.is_default() && FailureCriteria::default().is_default());
        assert!(serde_json::from_value::<FailureCriteria>(json!({"lane_departed": 4})).is_err());
    }

    #[test]
    fn a_limit_is_reached_or_exceeded() {
        for (comparison, at_the_limit) in [(Comparison::AtLeast, true), (Comparison::MoreThan, false)] {
            assert_eq!(comparison.name().parse(), Ok(comparison));
            assert_eq!(comparison.exceeds(2.0, 2.0), at_the_limit);
            assert!(comparison.exceeds(2.1, 2.0) && !comparison.exceeds(1.9, 2.0));
        }
        assert!("above".parse::<Comparison>().unwrap_err().to_string().contains("at_least or more_than"));
    }

    #[test]
    fn a_number_that_cannot_be_is_named() {
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let criteria = FailureCriteria { lane_departure: Some(wrong), ..DEFAULT };
            assert!(
                criteria.check().unwrap_err().to_string().starts_with("`lane_departure` in `failure` is")
            );
            assert!(FailureCriteria { standstill_seconds: wrong, ..DEFAULT }.check().is_err());
        }
        assert!(DEFAULT.check().is_ok());
    }
}
