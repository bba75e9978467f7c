//! The road of a scenario, as a pipeline wrote it.

use pdk_sdk::error::{Error, Result};
use serde_json::Value;

/// Checks a road that a pipeline wrote for a simulator, as far as it has the form that `pdk.road` returns: roads of other forms are the simulator's,
/// and so is what it drives on.
///
/// # Errors
/// If an angle or a length is not a number; `place` says in which scenario.
pub fn check(place: &str, road: &Value) -> Result<()> {
    let wrong = |what: &str, value: &Value, expected: &str| {
        Err(Error::new(format!("{place}: `road.{what}` is {value}, but has to be {expected}")))
    };
    let of_numbers = |field: &str, list: &[Value]| match list.iter().position(|value| !value.is_number()) {
        Some(index) => wrong(&format!("{field}[{}]", index + 1), &list[index], "a number"),
        None => Ok(()),
    };
    match &road["angles"] {
        Value::Null => return Ok(()),
        Value::Array(angles) => of_numbers("angles", angles)?,
        other => return wrong("angles", other, "a list: { ... }"),
    }
    match &road["segment"] {
        Value::Null | Value::Number(_) => Ok(()),
        Value::Array(lengths) => of_numbers("segment", lengths),
        other => wrong("segment", other, "a number or a list of numbers"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_types_in_a_road_of_angles_are_checked_and_other_roads_are_the_simulators() {
        let error = |road: Value| check("x", &road).unwrap_err().to_string();
        assert_eq!(
            error(json!({"angles": [0, "x"]})),
            "x: `road.angles[2]` is \"x\", but has to be a number"
        );
        assert_eq!(error(json!({"angles": [null]})), "x: `road.angles[1]` is null, but has to be a number");
        assert_eq!(error(json!({"angles": 3})), "x: `road.angles` is 3, but has to be a list: { ... }");
        assert_eq!(
            error(json!({"angles": [0], "segment": [true]})),
            "x: `road.segment[1]` is true, but has to be a number"
        );
        assert_eq!(
            error(json!({"angles": [0], "segment": "25"})),
            "x: `road.segment` is \"25\", but has to be a number or a list of numbers"
        );
        for road in [
            json!({"angles": [0, 170.5, -900], "segment": 25, "heights": "x"}),
            json!({"angles": []}),
            json!({"segment": "A1"}),
            json!("Town01"),
            json!([["a"]]),
            Value::Null,
        ] {
            check("x", &road).unwrap();
        }
    }
}
