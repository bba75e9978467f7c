//! The part of a drive that a perturbation is limited to: a span of time, a box in its frames, and what is left out of both.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::error::{Error, Result};

/// A span of time, and a box in its frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Span {
    /// When it begins, in seconds.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub from: f64,
    /// When it is over, in seconds; a frame at that time is not in it. Without, it lasts to the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<f64>,
    /// Left, top, right and bottom of the box in its frames, as shares of the width and height. Without, it is all of them.
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub area: Option<[f64; 4]>,
}

fn is_zero(from: &f64) -> bool {
    *from == 0.0
}

impl Span {
    fn from_json(value: &Value) -> std::result::Result<Self, String> {
        let span: Self = serde_json::from_value(value.clone()).map_err(|error| error.to_string())?;
        let Self { from, to, area } = span;
        if !(from >= 0.0 && from.is_finite()) {
            Err("`from` has to be 0 or more".to_owned())
        } else if to.is_some_and(|to| to.is_nan() || to <= from) {
            Err("it is over before it begins".to_owned())
        } else if area.is_some_and(|area| area.iter().any(|side| !(0.0..=1.0).contains(side))) {
            Err("the sides of its box have to be shares of the frame from 0 to 1".to_owned())
        } else if area.is_some_and(|[left, top, right, bottom]| left >= right || top >= bottom) {
            Err("its box is empty; the order is left, top, right, bottom".to_owned())
        } else {
            Ok(span)
        }
    }

    /// Whether a time in seconds is in the span.
    pub fn contains(&self, time: f64) -> bool {
        time >= self.from && self.to.is_none_or(|to| time < to)
    }
}

/// A part of a drive.
// Read by `from_json`: serde does not refuse unknown fields of an object that is flattened.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Value")]
pub struct During {
    /// What is perturbed.
    #[serde(flatten)]
    pub span: Span,
    /// What is left out of that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub except: Option<Span>,
}

impl TryFrom<Value> for During {
    type Error = Error;

    fn try_from(value: Value) -> Result<Self> {
        Self::from_json(&value)
    }
}

impl During {
    /// Reads a part from a script or the command line.
    ///
    /// # Errors
    /// If it is not one, or is empty.
    pub fn from_json(value: &Value) -> Result<Self> {
        let read = |table: &Map<String, Value>| {
            let mut table = table.clone();
            let except = table.shift_remove("except").as_ref().map(Span::from_json).transpose();
            let except = except.map_err(|error| format!("`except`: {error}"))?;
            Ok(Self { span: Span::from_json(&Value::Object(table))?, except })
        };
        let read = value.as_object().ok_or_else(|| "it is not a table".to_owned()).and_then(read);
        read.map_err(|error: String| {
            Error::new(format!(
                "`during` is {value}: {error}; write {{ from = seconds, to = seconds, box = {{ left, top, right, bottom }}, except = {{ ... }} }}, of \
                 which any may be left out"
            ))
        })
    }
}

impl During {
    /// Whether nothing of the frame at this time, in seconds, is perturbed.
    pub fn spares(&self, time: f64) -> bool {
        let left_out = self.except.is_some_and(|except| except.area.is_none() && except.contains(time));
        left_out || !self.span.contains(time)
    }

    /// Whether it limits frames to a part of their pixels.
    pub fn has_box(&self) -> bool {
        self.span.area.is_some() || self.except.is_some_and(|except| except.area.is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_is_written_is_read_back() {
        for value in [
            json!({"from": 2.0, "to": 3.5}),
            json!({"to": 3.5, "box": [0.0, 0.5, 1.0, 1.0], "except": {"from": 1.0, "box": [0.0, 0.5, 0.5, 1.0]}}),
            json!({}),
        ] {
            let during = During::from_json(&value).unwrap();
            assert_eq!(serde_json::to_value(during).unwrap(), value);
            assert_eq!(serde_json::from_value::<During>(value).unwrap(), during);
        }
    }

    #[test]
    fn a_span_begins_with_its_first_time_and_ends_before_its_last() {
        let span = Span { from: 1.0, to: Some(2.0), area: None };
        assert_eq!([0.9, 1.0, 1.9, 2.0].map(|time| span.contains(time)), [false, true, true, false]);
        assert!(Span { from: 1.0, ..Span::default() }.contains(1e9));
    }

    #[test]
    fn mistakes_are_named() {
        let error = |value: Value| During::from_json(&value).unwrap_err().to_string();
        assert!(error(json!({"form": 1})).contains("unknown field `form`"));
        let read = |value: Value| serde_json::from_value::<During>(value).map_err(|error| error.to_string());
        assert!(read(json!({"form": 1})).unwrap_err().contains("unknown field `form`"));
        assert!(read(json!({"except": {"form": 1}})).unwrap_err().contains("unknown field `form`"));
        assert!(error(json!(3)).contains("it is not a table"));
        assert!(error(json!({"from": -1})).contains("`from` has to be 0 or more"));
        assert!(error(json!({"from": 2, "to": 2})).contains("over before it begins"));
        assert!(error(json!({"box": [0, 0, 2, 1]})).contains("shares of the frame"));
        assert!(error(json!({"except": {"box": [0, 1, 1, 0]}})).contains("`except`: its box is empty"));
    }
}
