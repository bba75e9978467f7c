//! Intensities, also those that change over time.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::{Error, Result};

mod frames;

pub use frames::{FrameLevels, MOST_FRAMES};

/// The number of published intensity levels: 0, 1, 2, 3 and 4.
pub const LEVELS: usize = 5;
/// The highest intensity.
pub const MAX_INTENSITY: f64 = (LEVELS - 1) as f64;
/// The intensity if none is named: the middle of the scale.
pub const DEFAULT_LEVEL: f64 = MAX_INTENSITY / 2.0;

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
    /// Any course, given by the level of every frame, as a function of time is recorded.
    Frames {
        /// The levels.
        frames: FrameLevels,
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
    #[serde(default, skip_serializing_if = "Option::is_none")]
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
    /// If it is neither a number from 0 to 4 nor a course of such numbers.
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
        if let Some(place) = first_null(value) {
            return Err(Error::new(format!(
                "the level of `{what}` has null at `{place}`, which numbers become that are not finite; all its numbers have \
                 to be finite"
            )));
        }
        let level: Self = serde_json::from_value(value.clone()).map_err(|_| {
            Error::new(format!(
                "the level of `{what}` is {value}, but has to be a number from 0 to {MAX_INTENSITY}, \
                 {{ ramp = {{ from, to, start, end }} }}, {{ pulse = {{ level, rest, period, duration, start }} }}, \
                 {{ points = {{ {{ time, level }}, ... }} }}, {{ frames = {{ rate, levels }} }} or a function of time"
            ))
        })?;
        level.check(what)?;
        Ok(level)
    }

    /// Checks a level that was not read by [`Level::from_json`]; `what` is what the error calls the perturbation.
    ///
    /// # Errors
    /// If a level is not from 0 to 4, or the course is none.
    pub fn check(&self, what: &str) -> Result<()> {
        if let Some(wrong) = self.values().iter().find(|level| !(0.0..=MAX_INTENSITY).contains(*level)) {
            return Err(out_of_range(what, &wrong.to_string()));
        }
        let times: Vec<f64> = match self {
            Level::Constant(_) => Vec::new(),
            Level::Ramp { ramp } => vec![ramp.start, ramp.end],
            Level::Pulse { pulse } => vec![pulse.start, pulse.period, pulse.duration],
            Level::Points { points } => points.iter().map(|[time, _]| *time).collect(),
            Level::Frames { frames } => vec![frames.rate],
        };
        let mistake = match self {
            _ if !times.iter().all(|time| time.is_finite()) => "its times have to be finite",
            Level::Ramp { ramp } if ramp.end <= ramp.start => "its ramp has to end after it starts",
            Level::Pulse { pulse } if !(pulse.duration > 0.0 && pulse.duration <= pulse.period) => {
                "its pulse has to last more than 0 s and no longer than its period"
            }
            Level::Points { points } if points.is_empty() => "its course has no points",
            Level::Points { points } if !points.is_sorted_by(|a, b| a[0] < b[0]) => {
                "the times of its points have to rise"
            }
            Level::Frames { frames } if frames.levels.is_empty() => "its frames have no levels",
            Level::Frames { frames } if frames.rate <= 0.0 => {
                "its frames have to have a rate of more than 0 a second"
            }
            _ => return Ok(()),
        };
        Err(Error::new(format!("the level of `{what}`: {mistake}")))
    }

    /// The level at a time in seconds; none if the frame is to be left as it is.
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
                let before = next.checked_sub(1).and_then(|before| points.get(before));
                match (before, points.get(next)) {
                    (Some([start, from]), Some([end, to])) => {
                        Some(from + (to - from) * ((time - start) / (end - start)))
                    }
                    (before, after) => before.or(after).map(|[_, level]| *level),
                }
            }
            Level::Frames { frames } => frames.at(time),
        }
    }

    /// The levels that it is made of: it never goes below the least or above the greatest of them.
    pub fn values(&self) -> Vec<f64> {
        match self {
            Level::Constant(level) => vec![*level],
            Level::Ramp { ramp } => vec![ramp.from, ramp.to],
            Level::Pulse { pulse } => std::iter::once(pulse.level).chain(pulse.rest).collect(),
            Level::Points { points } => points.iter().map(|[_, level]| *level).collect(),
            Level::Frames { frames } => frames.levels.clone(),
        }
    }

    /// The level, if it is the same all the time.
    pub fn constant(&self) -> Option<f64> {
        match self {
            Level::Constant(level) => Some(*level),
            _ => None,
        }
    }
}

/// Where a value has a null: `pulse.rest`, `points[2][1]` as Lua counts.
fn first_null(value: &Value) -> Option<String> {
    let join = |place: String, inner: String| match inner.is_empty() || inner.starts_with('[') {
        true => place + &inner,
        false => place + "." + &inner,
    };
    match value {
        Value::Null => Some(String::new()),
        Value::Array(items) => items
            .iter()
            .enumerate()
            .find_map(|(i, item)| first_null(item).map(|inner| join(format!("[{}]", i + 1), inner))),
        Value::Object(fields) => {
            fields.iter().find_map(|(key, item)| first_null(item).map(|inner| join(key.clone(), inner)))
        }
        _ => None,
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
        assert_eq!(Level::Points { points: Vec::new() }.at(1.0), None);
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
        assert!(error(json!({"frames": {"rate": 0, "levels": [1]}})).contains("a rate of more than 0"));
        assert!(error(json!({"frames": {"rate": 20, "levels": []}})).contains("have no levels"));
        assert!(error(json!({"frames": {"rate": 20, "levels": [1, [5, 3]]}})).contains("is 5,"));
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused_by_name() {
        let error = |value: Value| Level::from_json("fog", &value).unwrap_err().to_string();
        let nan = f64::NAN;
        for (value, place) in [
            (json!({"ramp": {"from": nan, "to": 4, "end": 1}}), "ramp.from"),
            (json!({"pulse": {"level": 3, "rest": nan, "period": 2, "duration": 1}}), "pulse.rest"),
            (json!({"points": [[0, 1], [1, nan]]}), "points[2][2]"),
            (json!({"frames": {"rate": 20, "levels": [0, nan]}}), "frames.levels[2]"),
        ] {
            let error = error(value);
            assert!(error.starts_with(&format!("the level of `fog` has null at `{place}`")), "{error}");
        }
        assert!(error(json!(nan)).contains("is null, but has to be a number"));
        for times in [[0.0, f64::INFINITY], [f64::NEG_INFINITY, 1.0], [nan, 1.0]] {
            let points = times.map(|time| [time, 1.0]).to_vec();
            assert!(Level::Points { points }.check("fog").unwrap_err().message().contains("to be finite"));
        }
        assert!(Level::Constant(nan).check("fog").is_err());
    }

    #[test]
    fn what_is_recorded_is_read_back() {
        for value in [
            json!(2.5),
            json!({"ramp": {"from": 0.0, "to": 4.0, "start": 0.0, "end": 1.0}}),
            json!({"pulse": {"level": 3, "period": 2, "duration": 0.5, "start": 1}}),
            json!({"pulse": {"level": 3, "rest": 1, "period": 2, "duration": 0.5, "start": 1}}),
            json!({"points": [[0, 1], [2, 3]]}),
            json!({"frames": {"rate": 20, "levels": [0, [2.5, 10], 1]}}),
        ] {
            let before = level(value);
            let recorded = serde_json::to_value(&before).unwrap();
            assert_eq!(serde_json::from_value::<Level>(recorded.clone()).unwrap(), before);
            // And by the door for what users write, through which a recorded scenario can come back.
            assert_eq!(level(recorded), before);
        }
    }
}
