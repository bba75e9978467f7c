//! Whether a suite makes sense.

use pdk_model::component::ComponentSpec;
use pdk_model::described::Field;
use pdk_model::level::Level;
use pdk_model::outcome::{Measures, Outcome};
use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::error::{Error, Result};
use serde_json::Value;

use crate::requirement::{By, Kind, Requirement};
use crate::suite::{MOST, Roads, Suite};

/// Checks what a suite says.
///
/// # Errors
/// Names the first thing that is not right.
pub fn check(suite: &Suite) -> Result<()> {
    let Suite { name, perturbations, levels, nominal, places, test, .. } = suite;
    let wrong = |sentence: String| Err(Error::new(sentence));
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c)) {
        return wrong(format!("`name` is `{name}`, but has to be of letters, digits, `_` and `-`"));
    }
    for (field, number) in [("nominal", *nominal), ("tolerated", test.tolerated), ("alpha", test.alpha)] {
        if !(0.0..=1.0).contains(&number) {
            return wrong(format!("`{field}` is {number}, but has to be from 0 to 1"));
        }
    }
    if test.tolerated == 0.0 || test.alpha == 0.0 || test.tolerated == 1.0 || test.alpha == 1.0 {
        return wrong("`tolerated` and `alpha` have to lie between 0 and 1, such as 0.1 and 0.05".to_owned());
    }
    if !(1..=MOST).contains(&test.pairs) || !(1..=MOST).contains(&test.ahead) {
        return wrong(format!("`pairs` and `ahead` have to be from 1 to {MOST}"));
    }
    if places.is_empty() && suite.scenarios.is_empty() {
        return wrong(
            "it has neither a [[place]] to draw scenarios for nor a [[scenario]]; write one".to_owned(),
        );
    }
    if !places.is_empty() && perturbations.is_empty() && *nominal < 1.0 {
        return wrong("`perturbations` is empty; name at least one, or set `nominal` to 1".to_owned());
    }
    for perturbation in perturbations {
        if suite.levels_of(perturbation)?.is_empty() {
            return wrong(format!(
                "`levels` is empty, but `{perturbation}` has no level; write levels such as [1, 2]"
            ));
        }
    }
    for level in levels {
        Level::from_json("levels", &Value::from(*level))?;
    }
    for place in places {
        ComponentSpec::from_json("simulator", &place.simulator)?;
        place.failure.check()?;
        if place.duration.is_nan() || place.duration <= 0.0 {
            return wrong(format!("`duration` is {} s, but has to be more than 0", place.duration));
        }
        let Roads { segments, segment, limit } = place.road;
        if !(2..=200).contains(&segments) || !(1.0..=1000.0).contains(&segment) || limit > 90 {
            return wrong(format!(
                "a road has {segments} segments of {segment} m and angles up to {limit} degrees, but has to have 2 to 200 of 1 to 1000 m \
                 and angles up to 90 degrees"
            ));
        }
    }
    for number in 0..suite.scenarios.len() {
        suite.fixed(number)?;
    }
    suite.required().iter().try_for_each(|requirement| check_requirement(requirement, suite))
}

/// Whether it makes sense in a suite.
///
/// # Errors
/// If not.
fn check_requirement(requirement: &Requirement, suite: &Suite) -> Result<()> {
    let title = requirement.title();
    let wrong = |sentence: &str| Err(Error::new(format!("the requirement `{title}` {sentence}")));
    let draws = !suite.places.is_empty();
    match &requirement.kind {
        Kind::NotWorse { .. } if !draws => {
            wrong("is a test, for which scenarios have to be drawn; write a [[place]], or require `passes`")
        }
        Kind::NotWorse { tolerated: Some(tolerated), .. } if !(*tolerated > 0.0 && *tolerated < 1.0) => {
            wrong("has a `tolerated` that is not between 0 and 1")
        }
        Kind::NotWorse { by: By::Perturbation, .. } if suite.perturbations.is_empty() => {
            wrong("goes by perturbation, but the suite has none; add some to `perturbations`")
        }
        Kind::NotWorse { by: By::Level, .. } if suite.perturbations.is_empty() => {
            wrong("goes by level, but the suite has no perturbation; add some to `perturbations`")
        }
        Kind::Passes { .. } if suite.scenarios.is_empty() => {
            wrong("is about fixed scenarios, but the suite has no [[scenario]]; add one")
        }
        Kind::Measure { .. } if !draws => wrong("needs roads, which are drawn for a [[place]]; write one"),
        Kind::Measure { below: None, above: None, .. } => wrong("has no limit; write `below` or `above`"),
        Kind::Measure { on: [need, of], .. } if *need == 0 || need > of || *of > MOST => {
            wrong("has a wrong `on`; write [9, 10] for nine of ten roads")
        }
        Kind::Measure { measure, at, .. } => {
            at.iter()
                .try_for_each(|at| AppliedPerturbation::from_json(&Value::from(at.as_str())).map(drop))?;
            let known = measures();
            match known.contains(&measure.as_str()) {
                true => Ok(()),
                false => wrong(&format!("names no measure of outcomes; they are {}", known.join(", "))),
            }
        }
        _ => Ok(()),
    }
}

/// The numbers that outcomes have.
fn measures() -> Vec<&'static str> {
    let numbers = |field: &&Field| field.json.starts_with("number");
    Outcome::FIELDS.iter().chain(Measures::FIELDS).filter(numbers).map(|field| field.name).collect()
}
