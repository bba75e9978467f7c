//! What was recorded with a frame, as JSON: what was not recorded is not a number, and is left out.

use pdk_sdk::prelude::Control;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Serialize, Deserialize)]
struct Recorded {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    steering: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    throttle: Option<f64>,
}

/// Writes what was recorded.
///
/// # Errors
/// If it cannot be written.
pub fn serialize<S: Serializer>(control: &Control, serializer: S) -> Result<S::Ok, S::Error> {
    let number = |number: f64| (!number.is_nan()).then_some(number);
    Recorded { steering: number(control.steering), throttle: number(control.throttle) }.serialize(serializer)
}

/// Reads what was recorded.
///
/// # Errors
/// If it is something else.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Control, D::Error> {
    let Recorded { steering, throttle } = Recorded::deserialize(deserializer)?;
    Ok(Control { steering: steering.unwrap_or(f64::NAN), throttle: throttle.unwrap_or(f64::NAN) })
}
