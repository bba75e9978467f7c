//! What inputs get besides the image: the speed, earlier controls, constants and state.

use pdk_sdk::error::Result;
use pdk_sdk::serde_json::Value;

use crate::given::Given;
use crate::reading::{known, numbers, table};
use crate::suggest::hint;

/// What an input gets.
#[derive(Debug, Clone, PartialEq)]
pub enum Gets {
    /// The image.
    Image,
    /// The vehicle's speed.
    Speed(Speed),
    /// The controls of the frames before: steering and throttle of each, the oldest first; zeros at the start.
    Controls,
    /// The same numbers with every frame: one for each of its values, or one for all.
    Constant(Vec<f32>),
}

/// How the speed becomes the number of an input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speed {
    /// Units per metre per second.
    pub unit: f64,
    /// A factor after the unit.
    pub scale: f64,
    /// What is added after the factor.
    pub offset: f64,
    /// Metres per second that stand for a speed that is not known.
    pub assumed: Option<f64>,
}

impl Speed {
    /// The speed in metres per second, without an assumption.
    pub const PLAIN: Self = Self { unit: 1.0, scale: 1.0, offset: 0.0, assumed: None };

    /// The number for a speed in metres per second.
    pub fn number(&self, speed: f64) -> f32 {
        (speed * self.unit * self.scale + self.offset) as f32
    }
}

/// Units of speed with how many of them are a metre per second.
const UNITS: [(&str, f64); 3] = [("m/s", 1.0), ("km/h", 3.6), ("mph", 3600.0 / 1609.344)];

/// What an input can get besides constants.
const VALUES: [&str; 3] = ["image", "speed", "controls"];

/// Reads the field `inputs`.
pub(crate) fn inputs(given: &Given) -> Result<Vec<(String, Gets)>> {
    let table = table(given, "inputs", "{ speed = \"speed\" }")?;
    table.into_iter().flatten().map(|(name, value)| Ok((name.clone(), gets(given, name, value)?))).collect()
}

/// What an input gets.
fn gets(given: &Given, name: &str, value: &Value) -> Result<Gets> {
    let wrong = |what: String| given.wrong("inputs", format_args!("for `{name}` {what}"));
    let named = |text: &str| match text {
        "image" => Ok(Gets::Image),
        "speed" => Ok(Gets::Speed(Speed::PLAIN)),
        "controls" => Ok(Gets::Controls),
        _ => Err(wrong(format!("has the value \"{text}\"; {}", hint(text, VALUES)))),
    };
    if let Some(list) = numbers(value).filter(|list| !list.is_empty()) {
        return Ok(Gets::Constant(list.iter().map(|number| *number as f32).collect()));
    }
    match value {
        Value::String(text) => named(text),
        Value::Object(table) => {
            let gets = named(table.get("value").and_then(Value::as_str).unwrap_or_default())?;
            let Gets::Speed(mut speed) = gets else {
                known(given, "inputs", table, &["value"])?;
                return Ok(gets);
            };
            known(given, "inputs", table, &["value", "unit", "scale", "offset", "assumed"])?;
            if let Some(unit) = table.get("unit") {
                let found = UNITS.iter().find(|(known, _)| unit.as_str() == Some(known));
                let units = UNITS.map(|(name, _)| name);
                speed.unit = found.map(|(_, factor)| *factor).ok_or_else(|| {
                    wrong(format!("has the unit {unit}; {}", hint(unit.as_str().unwrap_or_default(), units)))
                })?;
            }
            let number = |key: &str| match table.get(key) {
                None => Ok(None),
                Some(value) => match value.as_f64() {
                    Some(number) => Ok(Some(number)),
                    None => Err(wrong(format!("has {value} as `{key}`; write a number"))),
                },
            };
            speed.scale = number("scale")?.unwrap_or(1.0);
            speed.offset = number("offset")?.unwrap_or(0.0);
            speed.assumed = number("assumed")?;
            Ok(Gets::Speed(speed))
        }
        other => Err(wrong(format!("has the value {other}; write one of {}, or numbers", VALUES.join(", ")))),
    }
}

/// Reads the field `state`.
pub(crate) fn state(given: &Given) -> Result<Vec<(String, String)>> {
    let form = "{ h_in = \"h_out\" }";
    let pairs = table(given, "state", form)?.into_iter().flatten();
    pairs
        .map(|(input, output)| match output.as_str() {
            Some(output) => Ok((input.clone(), output.to_owned())),
            None => Err(given.wrong(
                "state",
                format_args!("gives {output} to `{input}`; write the name of an output, as in {form}"),
            )),
        })
        .collect()
}
