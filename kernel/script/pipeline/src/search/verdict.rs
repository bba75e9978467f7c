//! What became of a candidate: read from what the pipeline's functions return, and from outcomes.

use pdk_sdk::error::{Error, Result};
use serde_json::{Map, Value};

use crate::fields::Fields;
use crate::search::request::PLACE;

/// What became of a candidate.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Verdict {
    /// The objectives, as the pipeline sees them; none if they could not be had.
    pub objectives: Option<Vec<f64>>,
    /// By how much each constraint is violated.
    pub violations: Vec<f64>,
    /// Whether it shows what is searched for.
    pub critical: bool,
    /// Why there are no objectives, where there should be some.
    pub failure: Option<String>,
    /// The outcome of its scenario.
    pub outcome: Option<Value>,
}

impl Verdict {
    /// That of a candidate that could not be evaluated.
    pub fn failed(reason: impl Into<String>) -> Self {
        Self { failure: Some(reason.into()), ..Self::default() }
    }

    /// What `evaluate` or `outcome` returned. What it leaves out is taken from the outcome of the scenario, if there is one.
    ///
    /// # Errors
    /// If it is not such a table, or an objective is missing.
    pub fn read(
        function: &str,
        returned: Value,
        objectives: &[String],
        outcome: Option<Value>,
    ) -> Result<Self> {
        let place = format!("{PLACE}: what `{function}` returns");
        let mut fields = Fields::new(&*place, returned, &["objectives", "critical", "violations"])?;
        let given = fields.any("objectives");
        let given = match &given {
            Value::Object(given) => Some(given),
            Value::Null => None,
            Value::Array(list) if list.is_empty() => None,
            other => {
                return Err(Error::new(format!(
                    "{place}: `objectives` is {other}, but has to be a table of numbers, as in {{ error = 1 }}"
                )));
            }
        };
        if let Some(unknown) = given.and_then(|given| given.keys().find(|name| !objectives.contains(name))) {
            return Err(Error::new(format!("{place}: `{unknown}` is not an objective of the search")));
        }
        let value = |name: &String| {
            let own = given.and_then(|given| given.get(name));
            let own = own.map(|own| own.as_f64()).or_else(|| Some(measured(outcome.as_ref()?, name)));
            own.flatten().ok_or_else(|| match &outcome {
                Some(outcome) => Error::new(format!(
                    "{PLACE}: `{name}` is not a number of an outcome, which has {}; name one, or return it from a function `outcome`",
                    numbers(outcome).join(", ")
                )),
                None => Error::new(format!("{place}: the objective `{name}` is missing, or no number")),
            })
        };
        let values = objectives.iter().map(value).collect::<Result<Vec<f64>>>()?;
        let critical = match fields.any("critical") {
            Value::Null => outcome.as_ref().is_some_and(|outcome| outcome["success"] == false),
            Value::Bool(critical) => critical,
            other => {
                return Err(Error::new(format!(
                    "{place}: `critical` is {other}, but has to be true or false"
                )));
            }
        };
        let violations = fields.list("violations")?.unwrap_or_default();
        let violations: Option<Vec<f64>> = violations.iter().map(Value::as_f64).collect();
        let violations = violations
            .ok_or_else(|| Error::new(format!("{place}: `violations` has to be a list of numbers")))?;
        Ok(Self { objectives: Some(values), violations, critical, failure: None, outcome })
    }

    /// What became of a scenario; `judged` is what the function `outcome` made of it.
    ///
    /// # Errors
    /// As for [`Verdict::read`].
    pub fn of_scenario(outcome: Value, judged: Value, objectives: &[String]) -> Result<Self> {
        if outcome["cause"] == "error" {
            let failure = outcome["error"].as_str().unwrap_or("a component failed").to_owned();
            return Ok(Self { failure: Some(failure), outcome: Some(outcome), ..Self::default() });
        }
        let judged = if judged.is_null() { Value::Object(Map::new()) } else { judged };
        Self::read("outcome", judged, objectives, Some(outcome))
    }
}

/// A number of an outcome: one of its fields, or one that follows from them.
///
/// - `time_to_failure`: the share of the road that is left, which is larger the earlier the driver failed.
/// - `criticality`: negative where the driver failed, and the less the earlier; else the nearer to 0 the nearer it came to the edge of
///   the lane.
fn measured(outcome: &Value, name: &str) -> Option<f64> {
    let number = |field: &str| outcome[field].as_f64();
    match name {
        "time_to_failure" => Some(1.0 - number("progress")?),
        "criticality" => Some(match outcome["success"] == true {
            true => 1.0 / (1.0 + number("max_cross_track_error")?),
            false => number("progress")? - 2.0,
        }),
        "number" => None,
        name => number(name),
    }
}

fn numbers(outcome: &Value) -> Vec<&str> {
    let fields = outcome.as_object().into_iter().flatten();
    let own =
        fields.filter(|(name, value)| value.is_number() && *name != "number").map(|(name, _)| name.as_str());
    own.chain(["time_to_failure", "criticality"]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn outcome(success: bool, progress: f64) -> Value {
        json!({"number": 3, "success": success, "cause": "lane_departure", "progress": progress, "max_cross_track_error": 1.0})
    }

    #[test]
    fn objectives_come_from_functions_and_from_outcomes() {
        let names = ["criticality", "mine", "time_to_failure"].map(str::to_owned);
        let judged = json!({"objectives": {"mine": 7}});
        let failed = Verdict::of_scenario(outcome(false, 0.25), judged.clone(), &names).unwrap();
        assert_eq!(failed.objectives, Some(vec![-1.75, 7.0, 0.75]));
        assert!(failed.critical);
        let success = Verdict::of_scenario(outcome(true, 1.0), judged, &names).unwrap();
        assert_eq!(success.objectives, Some(vec![0.5, 7.0, 0.0]));
        assert!(!success.critical);
    }

    #[test]
    fn what_is_missing_is_named() {
        let names = ["speed".to_owned()];
        let error = |function: &str, returned, outcome| {
            Verdict::read(function, returned, &names, outcome).unwrap_err().to_string()
        };
        assert!(
            error("evaluate", json!({"objectives": {}}), None).contains("the objective `speed` is missing")
        );
        assert!(
            error("evaluate", json!({"objectives": 3}), None)
                .contains("`objectives` is 3, but has to be a table")
        );
        assert!(
            error("evaluate", json!({"objectives": {"sped": 1}}), None)
                .contains("`sped` is not an objective")
        );
        assert!(
            error("outcome", json!({}), Some(outcome(true, 1.0)))
                .contains("which has progress, max_cross_track_error")
        );
        assert!(
            error("evaluate", json!({"objectives": {"speed": 1}, "critical": 1}), None)
                .contains("true or false")
        );
    }
}
