//! The arguments of host functions, checked with errors that say what is wanted.

use mlua::Value;

use crate::failure::type_of;

/// A finite number. `call` is how the script calls the function: `image:blur`.
pub(super) fn number(call: &str, name: &str, value: &Value) -> mlua::Result<f64> {
    match value {
        Value::Number(number) if number.is_finite() => Ok(*number),
        Value::Integer(number) => Ok(*number as f64),
        Value::Number(number) => Err(mlua::Error::runtime(format!(
            "{call} needs `{name}` to be a finite number, but it is {number}"
        ))),
        _ => Err(wrong(call, name, "a number", value)),
    }
}

/// A number from `low` to `high`.
pub(super) fn within(call: &str, name: &str, value: &Value, low: f64, high: f64) -> mlua::Result<f64> {
    let number = number(call, name, value)?;
    if (low..=high).contains(&number) {
        return Ok(number);
    }
    Err(mlua::Error::runtime(format!("{call} needs `{name}` to be from {low} to {high}, but it is {number}")))
}

/// A whole number of 32 bits.
pub(super) fn whole(call: &str, name: &str, value: &Value) -> mlua::Result<i32> {
    let number = within(call, name, value, f64::from(i32::MIN), f64::from(i32::MAX))?;
    if number.fract() == 0.0 {
        return Ok(number as i32);
    }
    Err(mlua::Error::runtime(format!("{call} needs `{name}` to be a whole number, but it is {number}")))
}

/// The error for a value of another type.
pub(super) fn wrong(call: &str, name: &str, expected: &str, value: &Value) -> mlua::Error {
    let found = match value {
        Value::Nil => "is missing".to_owned(),
        other => format!("is {}", type_of(other)),
    };
    mlua::Error::runtime(format!("{call} needs `{name}` to be {expected}, but it {found}"))
}
