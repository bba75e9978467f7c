//! What a search is about: a space of typed ranges, candidates in it, and how they did.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::canonical::canonical;
use crate::error::{Error, ErrorKind, Result};

/// Whole numbers beyond this are not exact as floating-point numbers.
const LARGEST_WHOLE: i64 = 1 << 53;

/// What a strategy searches, and for what.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Problem {
    /// Where candidates come from.
    pub space: Space,
    /// The names of the objectives; all are minimised.
    pub objectives: Vec<String>,
    /// How many distinct candidates will be evaluated at most; none if something else ends the search.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evaluations: Option<u64>,
}

/// The values that the variables of a search may take.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Space {
    /// The variables, in an order that strategies keep to.
    pub variables: Vec<Variable>,
    /// What has to hold between them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constraints: Vec<Constraint>,
}

/// One dimension of a space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// The values that it may take.
    #[serde(flatten)]
    pub range: Range,
}

/// The values that a variable may take. Each has a *position*, a number: that of an integer or a real is the value itself, that
/// of an entry of a list is its place from 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Range {
    /// A whole number within `min..=max`.
    Integer {
        /// The smallest.
        min: i64,
        /// The largest.
        max: i64,
    },
    /// A number within `min..=max`.
    Real {
        /// The smallest.
        min: f64,
        /// The largest.
        max: f64,
    },
    /// One of a list in which neighbours are alike, such as perturbations ranked by their effect.
    Ordinal {
        /// The list.
        values: Vec<Value>,
    },
    /// One of a list whose order has no meaning.
    Choice {
        /// The list.
        values: Vec<Value>,
    },
}

/// A linear constraint: the sum of weights times positions is at most a bound.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Constraint {
    /// The weight of each variable that takes part.
    pub weights: BTreeMap<String, f64>,
    /// The bound.
    pub at_most: f64,
}

/// What a strategy proposes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Its number in the search: 0, 1, 2 ... in the order in which the strategy proposes.
    pub id: u64,
    /// A value for each variable.
    pub values: Map<String, Value>,
}

/// How a candidate did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluated {
    /// The number of the candidate.
    pub id: u64,
    /// A finite number for each objective, smaller is better; empty if there is none.
    pub objectives: Vec<f64>,
    /// By how much each constraint is violated; 0 where it holds.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub violations: Vec<f64>,
    /// Whether it shows what is searched for, such as a driver that fails.
    #[serde(default)]
    pub critical: bool,
    /// Why there are no objectives, if there are none although it was to be evaluated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

impl Evaluated {
    /// The sum of all violations: 0 for a candidate that keeps the constraints, infinite for one without objectives.
    pub fn violation(&self) -> f64 {
        let sum: f64 = self.violations.iter().map(|violation| violation.max(0.0)).sum();
        if self.objectives.is_empty() && sum == 0.0 { f64::INFINITY } else { sum }
    }
}

impl Space {
    /// Makes sure that something can be searched.
    ///
    /// # Errors
    /// If there is no variable, two have one name, a range is empty or not finite, or a constraint names a variable without
    /// an order.
    pub fn check(&self) -> Result<()> {
        if self.variables.is_empty() {
            return Err(mistake(
                "the space has no variables; give it at least one, as in x = { real = { 0, 1 } }",
            ));
        }
        let mut names = BTreeSet::new();
        for variable in &self.variables {
            if !names.insert(variable.name.as_str()) {
                return Err(mistake(format!("the space has two variables `{}`; rename one", variable.name)));
            }
            variable.range.check().map_err(|error| error.at(format_args!("variable `{}`", variable.name)))?;
        }
        for constraint in &self.constraints {
            for (name, weight) in &constraint.weights {
                let variable = self.variables.iter().find(|variable| variable.name == *name);
                match variable.map(|variable| &variable.range) {
                    None => {
                        return Err(mistake(format!(
                            "a constraint names `{name}`, which is not a variable of the space"
                        )));
                    }
                    Some(Range::Choice { .. }) => {
                        return Err(mistake(format!(
                            "a constraint names `{name}`, a choice, whose values have no order; use a function instead"
                        )));
                    }
                    Some(_) if !weight.is_finite() => {
                        return Err(mistake(format!("the weight of `{name}` in a constraint is {weight}")));
                    }
                    Some(_) => {}
                }
            }
            if !constraint.at_most.is_finite() {
                return Err(mistake(format!("the bound of a constraint is {}", constraint.at_most)));
            }
        }
        Ok(())
    }

    /// How many different candidates there are; none if a variable is real, or they are more than 2^53.
    pub fn size(&self) -> Option<u64> {
        self.variables.iter().try_fold(1u64, |size, variable| {
            size.checked_mul(variable.range.size()?).filter(|&size| size <= LARGEST_WHOLE as u64)
        })
    }

    /// The values at these positions, one for each variable: brought into the range, and where only some positions have a value,
    /// rounded to the nearest.
    pub fn values(&self, positions: &[f64]) -> Map<String, Value> {
        let values = self.variables.iter().zip(positions);
        values.map(|(variable, &position)| (variable.name.clone(), variable.range.value(position))).collect()
    }

    /// The positions of values, in the order of the variables.
    ///
    /// # Errors
    /// If a variable has no value, one that is out of its range, or there is a value without a variable.
    pub fn positions(&self, values: &Map<String, Value>) -> Result<Vec<f64>> {
        if let Some(unknown) = values.keys().find(|name| self.variables.iter().all(|v| v.name != **name)) {
            return Err(nonsense(format!(
                "it has a value for `{unknown}`, which is not a variable of the space"
            )));
        }
        let position = |variable: &Variable| match values.get(&variable.name) {
            None => Err(nonsense(format!("it has no value for `{}`", variable.name))),
            Some(value) => variable.range.position(value).ok_or_else(|| {
                nonsense(format!("`{}` is {value}, but has to be {}", variable.name, variable.range))
            }),
        };
        self.variables.iter().map(position).collect()
    }

    /// A position of a variable as a share of its range, 0 to 1; 0 in a range of one value.
    pub fn share(&self, variable: usize, position: f64) -> f64 {
        let (low, high) = self.variables[variable].range.bounds();
        if high > low { (position - low) / (high - low) } else { 0.0 }
    }

    /// How far two candidates are apart, by their positions: the root of the mean square over the variables, in shares of their
    /// ranges; different choices are 1 apart.
    pub fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let square = |(i, variable): (usize, &Variable)| match variable.range {
            Range::Choice { .. } => f64::from(u8::from(a[i] != b[i])),
            _ => {
                let difference = self.share(i, a[i]) - self.share(i, b[i]);
                difference * difference
            }
        };
        let squares: f64 = self.variables.iter().enumerate().map(square).sum();
        libm::sqrt(squares / self.variables.len() as f64)
    }

    /// By how much values at these positions violate each constraint; 0 where it holds.
    pub fn violations(&self, positions: &[f64]) -> Vec<f64> {
        let position = |name: &str| {
            let place = self.variables.iter().position(|variable| variable.name == name);
            place.and_then(|place| positions.get(place)).copied().unwrap_or_default()
        };
        let violation = |constraint: &Constraint| {
            let sum: f64 = constraint.weights.iter().map(|(name, weight)| weight * position(name)).sum();
            (sum - constraint.at_most).max(0.0)
        };
        self.constraints.iter().map(violation).collect()
    }
}

impl Range {
    /// The smallest and the largest position.
    pub fn bounds(&self) -> (f64, f64) {
        match self {
            Range::Integer { min, max } => (*min as f64, *max as f64),
            Range::Real { min, max } => (*min, *max),
            Range::Ordinal { values } | Range::Choice { values } => (0.0, values.len() as f64 - 1.0),
        }
    }

    /// Whether only whole positions have a value.
    pub fn is_discrete(&self) -> bool {
        !matches!(self, Range::Real { .. })
    }

    /// How many values there are; none for a real.
    pub fn size(&self) -> Option<u64> {
        let (low, high) = self.bounds();
        self.is_discrete().then_some((high - low) as u64 + 1)
    }

    /// The value at a position, which is brought into the range and, for all but a real, rounded.
    pub fn value(&self, position: f64) -> Value {
        let (low, high) = self.bounds();
        // A position that is not a number has no nearest one.
        let within = if position.is_nan() { low } else { position.clamp(low, high) };
        match self {
            Range::Integer { .. } => (libm::round(within) as i64).into(),
            Range::Real { .. } => within.into(),
            Range::Ordinal { values } | Range::Choice { values } => {
                values.get(libm::round(within) as usize).cloned().unwrap_or_default()
            }
        }
    }

    /// The position of a value; none if it is out of the range.
    pub fn position(&self, value: &Value) -> Option<f64> {
        match self {
            Range::Integer { .. } | Range::Real { .. } => {
                let (low, high) = self.bounds();
                let whole = |v: &f64| !self.is_discrete() || v.fract() == 0.0;
                value.as_f64().filter(|v| *v >= low && *v <= high).filter(whole)
            }
            Range::Ordinal { values } | Range::Choice { values } => {
                let value = canonical(value);
                values.iter().position(|entry| canonical(entry) == value).map(|place| place as f64)
            }
        }
    }

    fn check(&self) -> Result<()> {
        match self {
            Range::Integer { min, max } if min > max => {
                Err(mistake(format!("the range {min} to {max} is empty; put the smaller number first")))
            }
            Range::Integer { min, max } if *min < -LARGEST_WHOLE || *max > LARGEST_WHOLE => {
                Err(mistake(format!("the range {min} to {max} is too large; stay within 2^53")))
            }
            Range::Real { min, max } if !min.is_finite() || !max.is_finite() => {
                Err(mistake(format!("the range {min} to {max} is not finite")))
            }
            Range::Real { min, max } if min >= max => {
                Err(mistake(format!("the range {min} to {max} is empty; put the smaller number first")))
            }
            Range::Real { min, max } if !(max - min).is_finite() => {
                Err(mistake(format!("the range {min} to {max} is too large")))
            }
            Range::Ordinal { values } | Range::Choice { values } => {
                let mut seen = BTreeSet::new();
                match values.iter().find(|value| !seen.insert(canonical(value))) {
                    _ if values.is_empty() => Err(mistake("the list of values is empty; name at least one")),
                    Some(twice) => Err(mistake(format!("{twice} occurs twice in the list of values"))),
                    None => Ok(()),
                }
            }
            _ => Ok(()),
        }
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Range::Integer { min, max } => write!(f, "a whole number from {min} to {max}"),
            Range::Real { min, max } => write!(f, "a number from {min} to {max}"),
            Range::Ordinal { values } | Range::Choice { values } => {
                let texts: Vec<String> = values.iter().map(label).collect();
                write!(f, "one of {}", texts.join(", "))
            }
        }
    }
}

/// A value of a list as people read it.
pub fn label(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Something that only the user can correct.
fn mistake(sentence: impl Into<String>) -> Error {
    Error::of(ErrorKind::Configuration, sentence)
}

/// Something that a strategy cannot have meant.
fn nonsense(sentence: String) -> Error {
    Error::of(ErrorKind::Nonsense, sentence)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn space() -> Space {
        serde_json::from_value(json!({
            "variables": [
                {"name": "turns", "type": "integer", "min": 0, "max": 8},
                {"name": "level", "type": "real", "min": 0.5, "max": 4.0},
                {"name": "perturbation", "type": "ordinal", "values": ["fog", "rain", "snow"]},
                {"name": "light", "type": "choice", "values": ["day", 2]},
            ],
            "constraints": [{"weights": {"turns": 1.0, "level": 2.0}, "at_most": 10.0}],
        }))
        .unwrap()
    }

    #[test]
    fn positions_become_values_and_values_positions() {
        let space = space();
        space.check().unwrap();
        let values = space.values(&[7.5, 9.0, 1.49, 0.51]);
        assert_eq!(
            Value::Object(values.clone()),
            json!({"turns": 8, "level": 4.0, "perturbation": "rain", "light": 2})
        );
        assert_eq!(space.positions(&values).unwrap(), [8.0, 4.0, 1.0, 1.0]);
        assert_eq!(space.values(&[f64::NAN; 4])["turns"], 0);
        assert_eq!(space.size(), None);
        assert_eq!(Space { variables: space.variables[2..].to_vec(), constraints: vec![] }.size(), Some(6));
        assert_eq!(space.violations(&[8.0, 4.0, 0.0, 0.0]), [6.0]);
        assert_eq!(space.violations(&[1.0, 1.0, 0.0, 0.0]), [0.0]);
    }

    #[test]
    fn values_out_of_range_are_named() {
        let error = |change: Value| {
            let mut values = json!({"turns": 1, "level": 1, "perturbation": "fog", "light": "day"});
            change.as_object().unwrap().iter().for_each(|(name, value)| values[name] = value.clone());
            let mut values = values.as_object().unwrap().clone();
            values.retain(|_, value| !value.is_null());
            space().positions(&values).unwrap_err()
        };
        assert_eq!(
            error(json!({"turns": 9})).message(),
            "`turns` is 9, but has to be a whole number from 0 to 8"
        );
        assert_eq!(error(json!({"turns": 1.5})).kind(), ErrorKind::Nonsense);
        assert_eq!(
            error(json!({"perturbation": "x"})).message(),
            "`perturbation` is \"x\", but has to be one of fog, rain, snow"
        );
        assert_eq!(error(json!({"level": null})).message(), "it has no value for `level`");
        assert!(error(json!({"other": 1})).message().contains("not a variable of the space"));
    }

    #[test]
    fn spaces_in_which_nothing_can_be_searched_are_refused() {
        let error = |variable: Value| {
            let variables = match variable {
                Value::Null => json!([]),
                variable => json!([{"name": "a", "type": "real", "min": 0, "max": 1}, variable]),
            };
            let space: Space = serde_json::from_value(json!({ "variables": variables })).unwrap();
            space.check().unwrap_err().to_string()
        };
        assert!(error(Value::Null).starts_with("the space has no variables"));
        for (variable, said) in [
            (json!({"name": "a", "type": "integer", "min": 0, "max": 1}), "two variables `a`"),
            (
                json!({"name": "b", "type": "integer", "min": 2, "max": 1}),
                "variable `b`: the range 2 to 1 is empty",
            ),
            (json!({"name": "b", "type": "real", "min": 1, "max": 1}), "is empty"),
            (json!({"name": "b", "type": "real", "min": -1e308, "max": 1e308}), "too large"),
            (json!({"name": "b", "type": "integer", "min": 0, "max": i64::MAX}), "within 2^53"),
            (json!({"name": "b", "type": "choice", "values": []}), "the list of values is empty"),
            (json!({"name": "b", "type": "ordinal", "values": [1, 1.0]}), "occurs twice"),
        ] {
            let error = error(variable);
            assert!(error.contains(said), "{error}");
        }
        let mut choice = space();
        choice.constraints[0].weights.insert("light".into(), 1.0);
        assert!(choice.check().unwrap_err().message().contains("a choice, whose values have no order"));
    }
}
