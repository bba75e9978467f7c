//! The values of a component's parameters, checked against its description.

use pdk_model::perturbation::MODIFIERS;
use serde_json::{Map, Value};

use crate::describe::{Description, Kind, LEVELS, Parameter, ParameterType, along_levels};
use crate::error::{Error, ErrorKind, Result};
use crate::suggest::nearest;

/// Checked values of a component's parameters.
#[derive(Debug, Clone, Default)]
pub struct Config {
    values: Map<String, Value>,
}

impl Config {
    /// Checks what the user set against the description and fills in the defaults.
    ///
    /// A parameter that has no effect with the choices made, see [`Parameter::only_for`], gets no value.
    ///
    /// # Errors
    /// Names the parameter that is unknown, missing, of the wrong type, out of range or without effect, and what is allowed.
    pub fn check(description: &Description, given: &Map<String, Value>) -> Result<Self> {
        for name in given.keys() {
            if !description.parameters.iter().any(|p| &p.name == name) {
                return Err(unknown_parameter(description, name));
            }
        }
        let mut values = Map::new();
        for parameter in &description.parameters {
            let effective = has_effect(description, parameter, given);
            match given.get(&parameter.name) {
                Some(_) if !effective => return Err(without_effect(description, parameter)),
                Some(value) => {
                    check_value(parameter, value)
                        .map_err(|e| e.at(format!("{} `{}`", description.kind, description.name)))?;
                    values.insert(parameter.name.clone(), as_kept(parameter, value));
                }
                None if parameter.levels.is_some() || !effective => {}
                None if parameter.is_required() => {
                    return Err(mistake(format!(
                        "{} `{}` needs the parameter `{}` ({})",
                        description.kind, description.name, parameter.name, parameter.doc
                    )));
                }
                None => {
                    values.insert(parameter.name.clone(), parameter.default.clone());
                }
            }
        }
        Ok(Self { values })
    }

    /// The value as it was given, or its default; null for a parameter that follows the intensity.
    pub fn value(&self, name: &str) -> &Value {
        self.values.get(name).unwrap_or(&Value::Null)
    }

    /// A number or integer; what is not in the description is 0.
    pub fn number(&self, name: &str) -> f64 {
        self.value(name).as_f64().unwrap_or_default()
    }

    /// A whole number; what is not in the description is 0.
    pub fn integer(&self, name: &str) -> i64 {
        let value = self.value(name);
        value.as_i64().unwrap_or_else(|| value.as_f64().unwrap_or_default() as i64)
    }

    /// True or false; what is not in the description is false.
    pub fn boolean(&self, name: &str) -> bool {
        self.value(name).as_bool().unwrap_or_default()
    }

    /// A text, path or choice; what is not in the description is empty.
    pub fn text(&self, name: &str) -> &str {
        self.value(name).as_str().unwrap_or_default()
    }

    /// Everything, as a JSON object.
    pub fn values(&self) -> &Map<String, Value> {
        &self.values
    }
}

/// The values that a perturbation sees for one frame: what the user set, what follows the intensity, the defaults.
/// One number for each parameter in the order of the description; what is not a number is 0 (a choice: its place).
pub fn frame_values(description: &Description, config: &Config, intensity: f64, into: &mut Vec<f64>) {
    into.clear();
    into.extend(description.parameters.iter().map(|parameter| match config.values.get(&parameter.name) {
        Some(Value::Number(number)) => number.as_f64().unwrap_or_default(),
        Some(Value::Bool(set)) => f64::from(u8::from(*set)),
        Some(Value::Array(levels)) => {
            let mut values = [0.0; LEVELS];
            for (value, level) in values.iter_mut().zip(levels) {
                *value = level.as_f64().unwrap_or_default();
            }
            parameter.in_range(along_levels(&values, intensity), intensity)
        }
        Some(Value::String(text)) => match &parameter.kind {
            ParameterType::Choice { options } => options.iter().position(|o| o == text).unwrap_or(0) as f64,
            _ => 0.0,
        },
        _ => parameter.at_intensity(intensity).unwrap_or_default(),
    }));
}

/// Whether a parameter has an effect with the choices that are given, or made by default.
fn has_effect(description: &Description, parameter: &Parameter, given: &Map<String, Value>) -> bool {
    parameter.only_for.as_ref().is_none_or(|condition| {
        let default =
            || description.parameters.iter().find(|p| p.name == condition.parameter).map(|p| &p.default);
        let chosen = given.get(&condition.parameter).or_else(default).and_then(Value::as_str);
        chosen == Some(&condition.option)
    })
}

fn without_effect(description: &Description, parameter: &Parameter) -> Error {
    let condition = parameter.only_for.as_ref().map(ToString::to_string).unwrap_or_default();
    mistake(format!(
        "{} `{}`: parameter `{}` has an effect only with {condition}; set that too, or leave it out",
        description.kind, description.name, parameter.name
    ))
}

fn unknown_parameter(description: &Description, name: &str) -> Error {
    let Description { kind, name: component, .. } = description;
    let parameters: Vec<_> = description.parameters.iter().map(|p| p.name.as_str()).collect();
    let modifiers: Vec<_> = match kind {
        // They are written like parameters.
        Kind::Perturbation => MODIFIERS.iter().map(|modifier| modifier.name).collect(),
        _ => Vec::new(),
    };
    if let Some(meant) = nearest(name, parameters.iter().chain(&modifiers).copied()) {
        return mistake(format!("{kind} `{component}` has no parameter `{name}`; did you mean `{meant}`?"));
    }
    let mut known = vec![parameters.join(", ")];
    if !modifiers.is_empty() {
        known.push(format!("the modifiers {}", modifiers.join(", ")));
    }
    known.retain(|names| !names.is_empty());
    mistake(match known.is_empty() {
        true => format!("{kind} `{component}` has no parameters, so `{name}` cannot be set"),
        false => format!("{kind} `{component}` has no parameter `{name}`; it has {}", known.join(", and ")),
    })
}

/// The value as components get it. A text may be given as a number, such as that of a column: `steering=2`.
fn as_kept(parameter: &Parameter, value: &Value) -> Value {
    match (&parameter.kind, value) {
        (ParameterType::Text, Value::Number(number)) => Value::String(number.to_string()),
        _ => value.clone(),
    }
}

fn check_value(parameter: &Parameter, value: &Value) -> Result<()> {
    // What follows the intensity may be given a course of its own.
    if let (Some(_), Value::Array(levels)) = (&parameter.levels, value) {
        if levels.len() != LEVELS {
            return Err(mistake(format!(
                "parameter `{}` has a list of {} values, but has to have one for each of the {LEVELS} levels",
                parameter.name,
                levels.len()
            )));
        }
        return levels.iter().try_for_each(|level| match level {
            Value::Array(_) => Err(mistake(format!(
                "parameter `{}` has lists in its list, but has to have a number for each level",
                parameter.name
            ))),
            level => check_value(parameter, level),
        });
    }
    let wrong = |expected: String| {
        Err(mistake(format!("parameter `{}` is {value}, but has to be {expected}", parameter.name)))
    };
    match &parameter.kind {
        ParameterType::Number { min, max } => match value.as_f64() {
            Some(v) if v.is_finite() && v >= *min && v <= *max => Ok(()),
            _ => wrong(format!("a number{}", range_text(*min, *max, f64::MIN, f64::MAX))),
        },
        ParameterType::Integer { min, max } => match value.as_f64() {
            Some(v) if v.fract() == 0.0 && v >= *min as f64 && v <= *max as f64 => Ok(()),
            _ => wrong(format!(
                "a whole number{}",
                range_text(*min as f64, *max as f64, i64::MIN as f64, i64::MAX as f64)
            )),
        },
        ParameterType::Boolean if value.is_boolean() => Ok(()),
        ParameterType::Boolean => wrong("true or false".into()),
        ParameterType::Choice { options } => match value.as_str() {
            Some(v) if options.iter().any(|o| o == v) => Ok(()),
            Some(v) if parameter.stands_for.values().any(|meaning| meaning == v) => Ok(()),
            Some(v) if !parameter.stands_for.is_empty() && v.contains('/') => Err(not_here(parameter, v)),
            _ => wrong(format!("one of {}", options.join(", "))),
        },
        ParameterType::Text if value.is_string() || value.is_number() => Ok(()),
        ParameterType::Path if value.is_string() => Ok(()),
        ParameterType::Text => wrong("a text".into()),
        ParameterType::Path => wrong("a path".into()),
        ParameterType::Json => Ok(()),
    }
}

/// The error about a value that another machine has and this one does not.
fn not_here(parameter: &Parameter, value: &str) -> Error {
    let here: Vec<_> =
        parameter.stands_for.iter().map(|(option, meaning)| format!("{meaning} ({option})")).collect();
    mistake(format!(
        "parameter `{name}` is \"{value}\", which this machine does not have; it has {}; use a machine that has it, or choose another \
         `{name}`, which makes it another scenario",
        here.join(", "),
        name = parameter.name
    ))
}

/// Something that only the user can correct.
fn mistake(sentence: String) -> Error {
    Error::of(ErrorKind::Configuration, sentence)
}

fn range_text(min: f64, max: f64, lowest: f64, highest: f64) -> String {
    match (min > lowest, max < highest) {
        (true, true) => format!(" from {min} to {max}"),
        (true, false) => format!(" of at least {min}"),
        (false, true) => format!(" of at most {max}"),
        (false, false) => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn description() -> Description {
        Description::perturbation("fog", "Fog")
            .parameter(Parameter::by_level("strength", [0.1, 0.2, 0.3, 0.4, 0.5], "how much").range(0.0, 1.0))
            .parameter(Parameter::choice("mode", &["soft", "hard"], "edge"))
            .parameter(Parameter::integer("size", 3, "size").range(1.0, 9.0))
    }

    fn error(given: Value) -> String {
        Config::check(&description(), given.as_object().unwrap()).unwrap_err().to_string()
    }

    #[test]
    fn wrong_values_are_refused_with_what_is_allowed() {
        assert_eq!(
            error(json!({"strength": 2})),
            "perturbation `fog`: parameter `strength` is 2, but has to be a number from 0 to 1"
        );
        assert_eq!(
            error(json!({"mode": "odd"})),
            "perturbation `fog`: parameter `mode` is \"odd\", but has to be one of soft, hard"
        );
        assert!(error(json!({"size": 2.5})).ends_with("a whole number from 1 to 9"));
        assert_eq!(
            error(json!({"strenght": 1})),
            "perturbation `fog` has no parameter `strenght`; did you mean `strength`?"
        );
        assert_eq!(
            error(json!({"zzz": 1})),
            "perturbation `fog` has no parameter `zzz`; it has strength, mode, size, and the modifiers level, probability, region, \
             during, where, attention, level_scale, draws"
        );
        let of = |description: Description| {
            let given = json!({"probabilty": 0.5});
            Config::check(&description, given.as_object().unwrap()).unwrap_err().to_string()
        };
        assert_eq!(
            of(Description::perturbation("fog", "Fog")),
            "perturbation `fog` has no parameter `probabilty`; did you mean `probability`?"
        );
        assert_eq!(
            of(Description::driver("net", "A network")),
            "driver `net` has no parameters, so `probabilty` cannot be set"
        );
    }

    #[test]
    fn a_text_may_be_given_as_a_number() {
        let description = Description::dataset("csv", "").parameter(Parameter::text("steering", "a column"));
        let given =
            |value: Value| Config::check(&description, json!({"steering": value}).as_object().unwrap());
        assert_eq!(given(json!(2)).unwrap().text("steering"), "2");
        assert_eq!(given(json!(-0.25)).unwrap().text("steering"), "-0.25");
        assert_eq!(
            given(json!(true)).unwrap_err().to_string(),
            "dataset `csv`: parameter `steering` is true, but has to be a text"
        );
    }

    #[test]
    fn a_parameter_that_has_no_effect_with_the_choice_made_is_refused() {
        let description = description()
            .parameter(
                Parameter::by_level("softness", [1.0, 2.0, 3.0, 4.0, 5.0], "how soft")
                    .only_for("mode", "soft"),
            )
            .parameter(Parameter::number("teeth", 7.0, "how many").only_for("mode", "hard"));
        let check = |given: Value| Config::check(&description, given.as_object().unwrap());
        assert_eq!(
            check(json!({"mode": "hard", "softness": 2})).unwrap_err().to_string(),
            "perturbation `fog`: parameter `softness` has an effect only with mode=soft; set that too, or leave it out"
        );
        // The default choice counts as well.
        assert!(check(json!({"teeth": 3})).unwrap_err().to_string().contains("only with mode=hard"));
        assert!(
            check(json!({"softness": 2})).is_ok() && check(json!({"mode": "soft", "softness": 2})).is_ok()
        );
        assert!(check(json!({"mode": "hard", "teeth": 3})).is_ok());
        // An error in the choice itself comes first.
        assert!(
            check(json!({"mode": "odd", "softness": 2}))
                .unwrap_err()
                .to_string()
                .contains("one of soft, hard")
        );
        // What was checked once passes again, as it does on its way into a plugin, and what has no effect has no value.
        for given in [json!({}), json!({"mode": "hard"})] {
            let config = check(given).unwrap();
            assert_eq!(check(Value::Object(config.values().clone())).unwrap().values(), config.values());
            assert_eq!(config.value("teeth").is_null(), config.text("mode") == "soft");
        }
    }

    #[test]
    fn a_parameter_that_follows_the_intensity_may_be_given_a_course_of_its_own() {
        let description = description();
        let given = json!({"strength": [0.0, 0.1, 0.3, 0.6, 1.0]});
        let config = Config::check(&description, given.as_object().unwrap()).unwrap();
        let mut values = Vec::new();
        for (intensity, strength) in [(0.0, 0.0), (2.0, 0.3), (2.5, 0.45), (4.0, 1.0)] {
            frame_values(&description, &config, intensity, &mut values);
            assert!((values[0] - strength).abs() < 1e-12, "{intensity}: {values:?}");
        }
        assert!(error(json!({"strength": [0.1, 0.2]})).ends_with("one for each of the 5 levels"));
        assert!(
            error(json!({"strength": [0, 0, 0, 0, 2]})).ends_with("is 2, but has to be a number from 0 to 1")
        );
        assert!(error(json!({"strength": [0, 0, 0, 0, [1]]})).contains("lists in its list"));
        assert!(error(json!({"size": [1, 2, 3, 4, 5]})).ends_with("a whole number from 1 to 9"));
    }

    #[test]
    fn what_an_option_stands_for_is_allowed_and_that_of_another_machine_is_not() {
        let meanings = [("auto", "fast 1/v3"), ("fast", "fast 1/v3")];
        let meanings = meanings.map(|(option, meaning)| (option.to_owned(), meaning.to_owned()));
        let engine =
            Parameter::choice("engine", &["auto", "fast", "slow"], "who computes").stands_for(meanings);
        let description = Description::driver("net", "A network").parameter(engine);
        let check =
            |engine: &str| Config::check(&description, json!({"engine": engine}).as_object().unwrap());
        for allowed in ["auto", "fast", "slow", "fast 1/v3"] {
            assert_eq!(check(allowed).unwrap().text("engine"), allowed);
        }
        assert_eq!(
            check("fast 1/v2").unwrap_err().message(),
            "driver `net`: parameter `engine` is \"fast 1/v2\", which this machine does not have; it has fast 1/v3 (auto), fast 1/v3 \
             (fast); use a machine that has it, or choose another `engine`, which makes it another scenario"
        );
        assert!(check("quick").unwrap_err().message().ends_with("one of auto, fast, slow"));
    }

    #[test]
    fn frame_values_follow_the_intensity_unless_set() {
        let description = description();
        let mut values = Vec::new();
        let config = Config::check(&description, &Map::new()).unwrap();
        frame_values(&description, &config, 1.5, &mut values);
        assert!((values[0] - 0.25).abs() < 1e-12);
        assert_eq!(&values[1..], &[0.0, 3.0]);
        let given = json!({"strength": 0.9, "mode": "hard"});
        let config = Config::check(&description, given.as_object().unwrap()).unwrap();
        frame_values(&description, &config, 1.5, &mut values);
        assert_eq!(values, [0.9, 1.0, 3.0]);
    }
}
