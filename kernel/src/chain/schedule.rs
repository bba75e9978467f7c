//! Intensities that change over time.

use pdk_sdk::error::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::MAX_INTENSITY;

/// An intensity: a number, or a course over simulation time. Times are seconds since the start of the scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Level {
    /// The same all the time.
    Constant(f64),
    /// Rises or falls evenly, and stays before and after.
    Ramp {
        /// The ramp.
        ramp: Ramp,
    },
    /// Goes on and off.
    Pulse {
        /// The pulse.
        pulse: Pulse,
    },
    /// Any course, given by points between which it is linear; before the first and after the last it stays.
    Points {
        /// `[time, level]`, with rising times.
        points: Vec<[f64; 2]>,
    },
}

/// A level that rises or falls evenly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// The level at the start.
    pub from: f64,
    /// The level at the end.
    pub to: f64,
    /// When it starts, in seconds.
    #[serde(default)]
    pub start: f64,
    /// When it ends, in seconds.
    pub end: f64,
}

/// A level that goes on and off.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pulse {
    /// The level while it is on.
    pub level: f64,
    /// The level while it is off; without it the frame is left as it is.
    #[serde(default)]
    pub rest: Option<f64>,
    /// Seconds from one start to the next.
    pub period: f64,
    /// Seconds for which it is on.
    pub duration: f64,
    /// When it is on for the first time, in seconds.
    #[serde(default)]
    pub start: f64,
}

impl Level {
    /// Reads a level from a script or the command line.
    ///
    /// # Errors
    /// Where it is neither a number from 0 to 4 nor a course of such numbers.
    pub fn from_json(what: &str, value: &Value) -> Result<Self> {
        if !value.is_number() && !value.is_object() {
            let shown = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            return Err(out_of_range(what, &shown));
        }
        if let Some(courses) = value.as_object().filter(|courses| courses.len() > 1) {
            let courses: Vec<_> = courses.keys().map(|course| format!("`{course}`")).collect();
            return Err(Error::new(format!(
                "the level of `{what}` has {}; it takes one course only",
                courses.join(" and ")
            )));
        }
        let level: Self = serde_json::from_value(value.clone()).map_err(|_| {
            Error::new(format!(
                "the level of `{what}` is {value}, but has to be a number from 0 to {MAX_INTENSITY}, \
                 {{ ramp = {{ from, to, start, end }} }}, {{ pulse = {{ level, rest, period, duration, start }} }}, \
                 {{ points = {{ {{ time, level }}, ... }} }} or a function of time"
            ))
        })?;
        level.check(what)?;
        Ok(level)
    }

    fn check(&self, what: &str) -> Result<()> {
        let levels: Vec<f64> = match self {
            Level::Constant(level) => vec![*level],
            Level::Ramp { ramp } => vec![ramp.from, ramp.to],
            Level::Pulse { pulse } => std::iter::once(pulse.level).chain(pulse.rest).collect(),
            Level::Points { points } => points.iter().map(|[_, level]| *level).collect(),
        };
        if let Some(wrong) = levels.iter().find(|level| !(0.0..=MAX_INTENSITY).contains(*level)) {
            return Err(out_of_range(what, &wrong.to_string()));
        }
        let mistake = match self {
            Level::Ramp { ramp } if ramp.end <= ramp.start => "its ramp has to end after it starts",
            Level::Pulse { pulse } if !(pulse.duration > 0.0 && pulse.duration <= pulse.period) => {
                "its pulse has to last more than 0 s and no longer than its period"
            }
            Level::Points { points } if points.is_empty() => "its course has no points",
            Level::Points { points } if !points.is_sorted_by(|a, b| a[0] < b[0]) => {
                "the times of its points have to rise"
            }
            _ => return Ok(()),
        };
        Err(Error::new(format!("the level of `{what}`: {mistake}")))
    }

    /// The level at a time in seconds; none where the frame is to be left as it is.
    pub fn at(&self, time: f64) -> Option<f64> {
        match self {
            Level::Constant(level) => Some(*level),
            Level::Ramp { ramp } => {
                let share = ((time - ramp.start) / (ramp.end - ramp.start)).clamp(0.0, 1.0);
                Some(ramp.from + (ramp.to - ramp.from) * share)
            }
            Level::Pulse { pulse } => {
                let since = time - pulse.start;
                let on =
                    since >= 0.0 && since - (since / pulse.period).floor() * pulse.period < pulse.duration;
                if on { Some(pulse.level) } else { pulse.rest }
            }
            Level::Points { points } => {
                let next = points.partition_point(|[at, _]| *at <= time);
                let (Some(before), Some(after)) = (points.get(next.wrapping_sub(1)), points.get(next)) else {
                    return points.get(next.min(points.len() - 1)).map(|[_, level]| *level);
                };
                let share = (time - before[0]) / (after[0] - before[0]);
                Some(before[1] + (after[1] - before[1]) * share)
            }
        }
    }

    /// The level, where it is the same all the time.
    pub fn constant(&self) -> Option<f64> {
        match self {
            Level::Constant(level) => Some(*level),
            _ => None,
        }
    }
}

fn out_of_range(what: &str, shown: &str) -> Error {
    Error::new(format!("the level in `{what}` is {shown}, but has to be a number from 0 to {MAX_INTENSITY}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn level(value: Value) -> Level {
        Level::from_json("fog", &value).unwrap()
    }

    #[test]
    fn courses_are_what_they_say() {
        let ramp = level(json!({"ramp": {"from": 0, "to": 4, "start": 2, "end": 6}}));
        assert_eq!([0.0, 3.0, 9.0].map(|t| ramp.at(t)), [Some(0.0), Some(1.0), Some(4.0)]);
        let pulse = level(json!({"pulse": {"level": 3, "period": 2, "duration": 0.5, "start": 1}}));
        assert_eq!([0.9, 1.2, 1.6, 3.4].map(|t| pulse.at(t)), [None, Some(3.0), None, Some(3.0)]);
        let points = level(json!({"points": [[1, 0], [2, 4], [4, 2]]}));
        assert_eq!([0.0, 1.5, 3.0, 9.0].map(|t| points.at(t)), [Some(0.0), Some(2.0), Some(3.0), Some(2.0)]);
        assert_eq!(level(json!({"points": [[1, 3]]})).at(0.0), Some(3.0));
        assert_eq!(level(json!(2)).at(7.0), Some(2.0));
    }

    #[test]
    fn mistakes_are_named() {
        let error = |value: Value| Level::from_json("fog", &value).unwrap_err().to_string();
        assert!(error(json!(9)).ends_with("is 9, but has to be a number from 0 to 4"));
        assert!(error(json!({"ramp": {"from": 0, "to": 5, "end": 1}})).contains("is 5,"));
        assert!(error(json!({"ramp": {"from": 0, "to": 4, "end": 0}})).contains("end after it starts"));
        assert!(error(json!({"points": [[2, 1], [1, 1]]})).contains("have to rise"));
        let both = json!({"ramp": {"from": 0, "to": 4, "end": 1}, "pulse": {"level": 3, "period": 2, "duration": 1}});
        assert_eq!(error(both), "the level of `fog` has `ramp` and `pulse`; it takes one course only");
        assert!(error(json!({"wave": 3})).contains("or a function of time"));
    }

    #[test]
    fn what_is_recorded_is_read_back() {
        for value in [json!(2.5), json!({"ramp": {"from": 0.0, "to": 4.0, "start": 0.0, "end": 1.0}})] {
            let before = level(value);
            let after: Level = serde_json::from_value(serde_json::to_value(&before).unwrap()).unwrap();
            assert_eq!(before, after);
        }
    }
}
