//! What perturbations were measured for: scales on which a level means the same for each of them.

use pdk_model::level_scale::{LevelScale, MeasuredScale};
use pdk_model::perturbation::AppliedPerturbation;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::config::Config;
use crate::describe::Description;
use crate::error::{Error, ErrorKind, Result};
use crate::suggest;

/// A scale that a perturbation was measured for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The parameters with which it was measured.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub parameters: Map<String, Value>,
    /// Where the levels lie.
    pub scale: MeasuredScale,
}

/// The scale that the level of a perturbation is on, of those that it was measured for; none if it is on the published one. It may not reach its
/// level.
///
/// # Errors
/// If the perturbation was not measured for it as it is used here.
pub fn of(
    description: &Description,
    scales: &[Measured],
    applied: &AppliedPerturbation,
) -> Result<Option<MeasuredScale>> {
    let Some(scale) = &applied.level_scale else { return Ok(None) };
    let place = |error: Error| error.at(format_args!("perturbation `{}`", applied.name));
    let measured = match scale {
        LevelScale::Measured(measured) => measured.clone(),
        LevelScale::Named(name) => named(description, scales, name, &applied.parameters).map_err(place)?,
    };
    if measured.version != description.version {
        let sentence = format!(
            "scale `{}` was measured with its version {}, and this is version {}; measure it again with `pdk calibrate`",
            measured.name, measured.version, description.version
        );
        return Err(place(Error::of(ErrorKind::Configuration, sentence)));
    }
    Ok(Some(measured))
}

/// The same, of which it reaches its level.
///
/// # Errors
/// Also if it does not.
pub fn reached(
    description: &Description,
    scales: &[Measured],
    applied: &AppliedPerturbation,
) -> Result<Option<MeasuredScale>> {
    let measured = of(description, scales, applied)?;
    let checked = measured.as_ref().map_or(Ok(()), |measured| measured.check(&applied.level));
    checked.map_err(|error| error.at(format_args!("perturbation `{}`", applied.name)))?;
    Ok(measured)
}

/// What was measured for a perturbation with these parameters.
fn named(
    description: &Description,
    scales: &[Measured],
    name: &str,
    parameters: &Map<String, Value>,
) -> Result<MeasuredScale> {
    let mut of_name = scales.iter().filter(|measured| measured.scale.name == name).peekable();
    if of_name.peek().is_none() {
        let hint = match scales.is_empty() {
            true => "it was measured for none; `pdk calibrate` measures one".to_owned(),
            false => suggest::hint(name, scales.iter().map(|measured| measured.scale.name.as_str())),
        };
        return Err(Error::of(ErrorKind::Configuration, format!("it has no scale `{name}`; {hint}")));
    }
    let wanted = complete(description, parameters);
    let found = of_name.find(|measured| complete(description, &measured.parameters) == wanted);
    found.map(|measured| measured.scale.clone()).ok_or_else(|| {
        let sentence = format!(
            "it was not measured for scale `{name}` with these parameters; leave them out, or measure a scale of your own with `pdk calibrate`"
        );
        Error::of(ErrorKind::Configuration, sentence)
    })
}

/// Parameters with the defaults of those that are not set, and numbers however they are written. What the description does not allow is refused
/// elsewhere.
fn complete(description: &Description, given: &Map<String, Value>) -> Vec<(String, Value)> {
    let values =
        Config::check(description, given).map_or_else(|_| given.clone(), |config| config.values().clone());
    let plain = |value: Value| value.as_f64().map_or(value, Value::from);
    let mut all: Vec<_> = values.into_iter().map(|(name, value)| (name, plain(value))).collect();
    all.sort_by(|a, b| a.0.cmp(&b.0));
    all
}
