//! Which perturbations at which levels a dataset is perturbed with.

use std::collections::BTreeSet;

use pdk_components::catalog::Catalog;
use pdk_model::level::LEVELS;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::text::split_outside_brackets;
use pdk_preview::preview;
use pdk_sdk::config::Config;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use serde_json::Map;

/// The suite of all perturbations that are in the default set.
pub const DEFAULT_SUITE: &str = "default";

/// A perturbation at a level.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// The perturbation.
    pub applied: AppliedPerturbation,
    /// Its folder in the result: `NAME/LEVEL`.
    pub folder: String,
}

/// Reads the conditions that a user names: `A@1..4,B@3`, with parameters as `A@2,parameter=value`. Without a level it is every level.
///
/// # Errors
/// If one of them is not a perturbation, or two have the same folder.
pub fn named(catalog: &Catalog, texts: &[String]) -> Result<Vec<Condition>> {
    let mut conditions = Vec::new();
    for text in texts {
        let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
        for part in split_outside_brackets(text) {
            match groups.last_mut() {
                Some((_, parameters)) if part.contains('=') => parameters.push(part),
                _ => groups.push((part, Vec::new())),
            }
        }
        for (head, parameters) in groups {
            let (name, levels) =
                head.split_once('@').map_or((head, None), |(name, levels)| (name, Some(levels)));
            let behind: String = parameters.iter().map(|parameter| format!(",{parameter}")).collect();
            for level in levels.map_or_else(|| Ok(all_levels()), |levels| range(head, levels))? {
                conditions.push(condition(catalog, &format!("{name}@{level}{behind}"))?);
            }
        }
    }
    checked(conditions)
}

/// A suite of perturbations.
#[derive(Debug, Clone, Copy, Default)]
pub struct Suite<'a> {
    /// [`DEFAULT_SUITE`], or a family.
    pub name: &'a str,
    /// `LEVEL` or `FROM..TO`; none for all levels.
    pub levels: Option<&'a str>,
    /// The scale that the levels are on; none for the published one.
    pub level_scale: Option<&'a str>,
    /// Perturbations that are left out.
    pub without: &'a [String],
}

/// The conditions of a suite, and the perturbations that do not reach all of its levels on its scale, which are left out.
///
/// # Errors
/// If there is no such suite, or the levels are not `LEVEL` or `FROM..TO`.
pub fn suite(catalog: &Catalog, suite: &Suite<'_>) -> Result<(Vec<Condition>, Vec<String>)> {
    let Suite { name, without, .. } = *suite;
    let levels = suite.levels.map_or_else(|| Ok(all_levels()), |levels| range("--levels", levels))?;
    let scale = suite.level_scale.map(|scale| format!(",level_scale={scale}")).unwrap_or_default();
    let of_suite = |family: &str, default: bool| match name {
        DEFAULT_SUITE => default,
        name => family == name,
    };
    let usable = preview::usable(catalog, true);
    let members: Vec<_> = usable
        .iter()
        .filter(|found| of_suite(&found.family, found.default) && catalog_has(catalog, &found.name))
        .collect();
    if members.is_empty() {
        let families: BTreeSet<&str> =
            usable.iter().map(|found| found.family.as_str()).filter(|family| !family.is_empty()).collect();
        let families: Vec<_> = families.into_iter().map(|family| format!("`{family}`")).collect();
        return Err(Error::new(format!(
            "there is no suite `{name}`; the suites are `{DEFAULT_SUITE}`, and the families {}",
            families.join(", ")
        )));
    }
    let (mut conditions, mut left_out) = (Vec::new(), Vec::new());
    for member in members.iter().filter(|member| !without.contains(&member.name)) {
        // What has to be set stays out: there is no value to set.
        if Config::check(member, &Map::new()).is_err() {
            continue;
        }
        let at_all =
            levels.iter().map(|level| condition(catalog, &format!("{}@{level}{scale}", member.name)));
        match at_all.collect::<Result<Vec<_>>>() {
            Ok(at_all) => conditions.extend(at_all),
            Err(error) if suite.level_scale.is_some() => left_out.push(error.to_string()),
            Err(error) => return Err(error),
        }
    }
    // If all are left out, the first says why.
    match (conditions.is_empty(), left_out.first()) {
        (true, Some(first)) => Err(Error::new(first.clone())),
        _ => Ok((checked(conditions)?, left_out)),
    }
}

/// Whether it is a component of its own, and not made from a file of the user's, which a suite of one name is not to depend on.
fn catalog_has(catalog: &Catalog, name: &str) -> bool {
    catalog.get(Kind::Perturbation, name).is_ok_and(|entry| entry.base.is_none())
}

fn all_levels() -> Vec<String> {
    (0..LEVELS).map(|level| level.to_string()).collect()
}

/// The levels of `2.5` or `1..4`, whose ends belong to it.
fn range(of: &str, text: &str) -> Result<Vec<String>> {
    let Some((from, to)) = text.split_once("..") else { return Ok(vec![text.to_owned()]) };
    match (from.parse::<usize>(), to.parse::<usize>()) {
        (Ok(from), Ok(to)) if from <= to && to < LEVELS => {
            Ok((from..=to).map(|level| level.to_string()).collect())
        }
        _ => Err(Error::new(format!(
            "`{text}` of `{of}` is not a range of levels; write FROM..TO with whole numbers from 0 to {}",
            LEVELS - 1
        ))),
    }
}

fn condition(catalog: &Catalog, text: &str) -> Result<Condition> {
    let applied = AppliedPerturbation::parse(text)?;
    catalog.check(Kind::Perturbation, &applied.name, &applied.parameters)?;
    catalog.level_scale(&applied)?;
    let Some(level) = applied.level.constant() else {
        return Err(Error::new(format!(
            "`{text}` changes its level over time, and a perturbed dataset has one level a folder; name a number"
        )));
    };
    let fit = |c: char| if c.is_ascii_alphanumeric() || "_.,=+-".contains(c) { c } else { '_' };
    let name: String = applied.label().chars().filter(|c| *c != '"').map(fit).collect();
    Ok(Condition { folder: format!("{name}/{level}"), applied })
}

/// Refuses two conditions in one folder.
fn checked(conditions: Vec<Condition>) -> Result<Vec<Condition>> {
    let mut folders = BTreeSet::new();
    match conditions.iter().find(|condition| !folders.insert(condition.folder.as_str())) {
        Some(twice) => Err(Error::new(format!("`{}` is named twice; leave one out", twice.applied))),
        None if conditions.is_empty() => {
            Err(Error::new("nothing is named to perturb with; use --with or --suite"))
        }
        None => Ok(conditions),
    }
}
