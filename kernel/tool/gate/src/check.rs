//! Whether a suite makes sense.

use pdk_model::described::Field;
use pdk_model::level::Level;
use pdk_model::outcome::{Measures, Outcome};
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::Scenario;
use pdk_pipeline::readers::DatasetSpec;
use pdk_sdk::error::{Error, Result};
use serde_json::Value;

use crate::came::BLOCK_MEASURES;
use crate::requirement::{By, Kind, Requirement};
use crate::stretch::{Recording, Stretch};
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
    if test.repeats.is_some_and(|repeats| !(1..=100).contains(&repeats)) {
        return wrong("`repeats` has to be from 1 to 100".to_owned());
    }
    if !suite.draws() && suite.scenarios.is_empty() {
        return wrong(
            "it has neither a [[place]] or a [[recording]] to draw scenarios from nor a [[scenario]]; write one"
                .to_owned(),
        );
    }
    if suite.draws() && perturbations.is_empty() && *nominal < 1.0 {
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
    for (number, place) in (1..).zip(places) {
        let at = format!("[[place]] {number}");
        let Scenario { duration, failure, .. } = place.scenario().map_err(|error| error.at(&at))?;
        failure.check().map_err(|error| error.at(&at))?;
        if duration.is_nan() || duration <= 0.0 {
            return wrong(format!("{at}: `duration` is {duration} s, but has to be more than 0"));
        }
        let Roads { segments, segment, limit } = place.road;
        if !(2..=200).contains(&segments) || !(1.0..=1000.0).contains(&segment) || limit > 90 {
            return wrong(format!(
                "a road has {segments} segments of {segment} m and angles up to {limit} degrees, but has to have 2 to 200 of 1 to 1000 m \
                 and angles up to 90 degrees"
            ));
        }
    }
    check_recordings(suite)?;
    suite.required().iter().try_for_each(|requirement| check_requirement(requirement, suite))
}

/// Whether what a suite says of recordings makes sense, and its fixed scenarios go with them.
///
/// # Errors
/// Names the first thing that is not right.
fn check_recordings(suite: &Suite) -> Result<()> {
    for Recording { dataset, block, steering_error, .. } in &suite.recordings {
        DatasetSpec::from_json(dataset)?;
        if !(1..=MOST).contains(block) {
            return Err(Error::new(format!("`block` is {block}, but has to be from 1 to {MOST} frames")));
        }
        check_steering_error(*steering_error)?;
    }
    let mut on_road = None;
    for number in 0..suite.scenarios.len() {
        let scenario = suite.fixed(number)?;
        let place = format!("[[scenario]] {}", number + 1);
        let Some(Stretch { steering_error, .. }) = Stretch::of(&scenario) else {
            on_road.get_or_insert(place);
            continue;
        };
        check_steering_error(steering_error).map_err(|error| error.at(&place))?;
        if scenario.perturbations.len() > 1 {
            return Err(Error::new(format!(
                "{place} has several perturbations, but a block of a recording goes through one at most"
            )));
        }
    }
    let recorded = suite.is_recorded();
    if let (true, Some(place)) = (recorded, on_road) {
        return Err(Error::new(format!(
            "{place} is driven on a road, and other scenarios of the suite are blocks of recordings; write a suite of each"
        )));
    }
    match recorded && !suite.places.is_empty() {
        true => Err(Error::new("it has roads in a [[place]] as well as recordings; write a suite of each")),
        false => Ok(()),
    }
}

fn check_steering_error(limit: f64) -> Result<()> {
    match limit > 0.0 && limit.is_finite() {
        true => Ok(()),
        false => Err(Error::new(format!("`steering_error` is {limit}, but has to be more than 0"))),
    }
}

/// Whether it makes sense in a suite.
///
/// # Errors
/// If not.
fn check_requirement(requirement: &Requirement, suite: &Suite) -> Result<()> {
    let title = requirement.title(suite.drawn());
    let wrong = |sentence: &str| Err(Error::new(format!("the requirement `{title}` {sentence}")));
    let draws = suite.draws();
    match &requirement.kind {
        Kind::NotWorse { .. } if !draws => wrong(
            "is a test, for which scenarios have to be drawn; write a [[place]] or a [[recording]], or require `passes`",
        ),
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
        Kind::Measure { .. } if !draws => {
            wrong("needs scenarios, which are drawn for a [[place]] or from a [[recording]]; write one")
        }
        Kind::Measure { below: None, above: None, .. } => wrong("has no limit; write `below` or `above`"),
        Kind::Measure { on: [need, of], .. } if *need == 0 || need > of || *of > MOST => {
            wrong("has a wrong `on`; write [9, 10] for nine of ten roads")
        }
        Kind::Measure { measure, at, .. } => {
            at.iter()
                .try_for_each(|at| AppliedPerturbation::from_json(&Value::from(at.as_str())).map(drop))?;
            let known = if suite.is_recorded() { BLOCK_MEASURES.to_vec() } else { measures() };
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
