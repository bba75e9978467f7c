//! A driver that takes part: by its name, by the file of its network, or by a record of its drives.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pdk_components::catalog::Catalog;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::{Scenario, ScenarioId};
use pdk_record::directory::{MANIFEST, RunDirectory, SCENARIOS, VERDICT};
use pdk_record::ledger::Line;
use pdk_record::located::Located;
use pdk_record::manifest::ComponentRecord;
use pdk_replay::replay::Replay;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_session::session::Session;
use serde_json::Value;

use crate::came::{BlockOutcome, Came};
use crate::kept;
use crate::role::Role;
use crate::verdict::{DriverRecord, Verdict};

/// A driver that takes part.
#[derive(Debug, Clone)]
pub struct Side {
    /// As the user named it.
    pub named: String,
    /// The driver.
    pub driver: ComponentSpec,
    /// What came of scenarios that need not be driven again.
    pub known: BTreeMap<ScenarioId, Came>,
    /// The record that they are in.
    pub record: Option<PathBuf>,
    /// The components with which they were driven.
    pub components: Vec<ComponentRecord>,
}

impl Side {
    /// Finds a driver, and says what of its record cannot be used.
    ///
    /// # Errors
    /// If the text names no driver, or the record is damaged or does not say which of several drivers is meant.
    pub fn find(named: &str, session: &mut Session) -> Result<(Self, Vec<String>)> {
        let path = Path::new(named);
        if path.join(MANIFEST).is_file() {
            return Self::of_record(named, session);
        }
        let driver = match named.trim_start().starts_with('{') {
            true => {
                let value: Value = serde_json::from_str(named)
                    .map_err(|error| Error::new(format!("the driver {named} is not JSON ({error})")))?;
                ComponentSpec::from_json("driver", &value)?
            }
            false if path.is_file() => of_file(path, session.catalog())?,
            false if path.is_dir() => {
                return Err(Error::new(format!(
                    "{named} is a folder without a record of a run; name a folder with a {MANIFEST}"
                )));
            }
            false => ComponentSpec::parse("driver", named)?,
        };
        session.catalog().get(Kind::Driver, &driver.name).map_err(|error| {
            let sentence = format!("{error}; a network is named by its file, which {named} is not");
            Error::of(error.kind(), if path.extension().is_some() { sentence } else { error.to_string() })
        })?;
        let side = Self {
            named: named.to_owned(),
            driver,
            known: BTreeMap::new(),
            record: None,
            components: Vec::new(),
        };
        Ok((side, Vec::new()))
    }

    fn of_record(named: &str, session: &mut Session) -> Result<(Self, Vec<String>)> {
        let folder = Path::new(named);
        if let Some(blocks) = kept::read(folder)? {
            return Self::of_blocks(named, blocks, session.catalog());
        }
        if let Some(driver) = evaluated(folder)? {
            return Ok(Self::recorded(named, driver, BTreeMap::new(), Vec::new(), None));
        }
        let replay = Replay::open(folder, &[])?;
        let known: BTreeMap<ScenarioId, Line> = replay.lines().map(|line| (line.id, line.clone())).collect();
        let driver = driver_of(folder, &known)?;
        let changes = replay.changes(session).unwrap_or_else(|error| vec![error.to_string()]);
        let known = known.into_values().filter_map(came).collect();
        let components = replay.manifest().components.clone();
        Ok(Self::recorded(named, driver, known, components, changes.into_iter().next()))
    }

    /// Of the record of a gate on recordings, the driver is the new one. A block has the id of what is in its recording and in the files of the
    /// driver, so only the components may be others.
    fn of_blocks(
        named: &str,
        blocks: BTreeMap<ScenarioId, BlockOutcome>,
        catalog: &Catalog,
    ) -> Result<(Self, Vec<String>)> {
        let verdict = Verdict::read(&Path::new(named).join(VERDICT)).map_err(|error| {
            Error::new(format!(
                "{error}; the gate came to no verdict, so run it again with --out and this folder"
            ))
        })?;
        let changed = verdict.changes(catalog).into_iter().next();
        let known = blocks.into_iter().map(|(id, outcome)| (id, Came::Block(outcome))).collect();
        let DriverRecord { component, files, .. } = verdict.new;
        let driver = located(Path::new(named), component, files)?;
        Ok(Self::recorded(named, driver, known, verdict.components, changed))
    }

    /// A driver with what came of its scenarios, unless something is different since.
    fn recorded(
        named: &str,
        driver: ComponentSpec,
        known: BTreeMap<ScenarioId, Came>,
        components: Vec<ComponentRecord>,
        changed: Option<String>,
    ) -> (Self, Vec<String>) {
        let mut side =
            Self { named: named.to_owned(), driver, known, record: Some(named.into()), components };
        let told = changed.map(|change| {
            side.known.clear();
            side.components.clear();
            format!("the drives in {named} are not used but driven again, because something is different since: {change}")
        });
        (side, told.into_iter().collect())
    }
}

/// What came of a recorded drive; none if a component failed, which decides nothing, so that it is driven again.
fn came(line: Line) -> Option<(ScenarioId, Came)> {
    let came = Came::Drive(Box::new(line.outcome));
    came.error().is_none().then_some((line.id, came))
}

/// The driver of a record that holds evaluations of one driver and nothing else; none of another record.
fn evaluated(folder: &Path) -> Result<Option<ComponentSpec>> {
    if folder.join(SCENARIOS).is_file() {
        return Ok(None);
    }
    let Some(manifest) = RunDirectory::open(folder)?.manifest()? else { return Ok(None) };
    let mut drivers: Vec<ComponentSpec> =
        manifest.evaluations.into_iter().filter_map(|evaluation| evaluation.driver).collect();
    drivers.dedup();
    let files = manifest.files.into_iter().filter(|file| file.group.is_empty());
    let files = files.map(|file| (file.path.to_string_lossy().into_owned(), file.blake3)).collect();
    match drivers.len() {
        1 => drivers.pop().map(|driver| located(folder, driver, files)).transpose(),
        _ => Ok(None),
    }
}

/// A driver of a record with its files where they are as seen from here.
fn located(folder: &Path, driver: ComponentSpec, files: BTreeMap<String, String>) -> Result<ComponentSpec> {
    let Some(manifest) = RunDirectory::open(folder)?.manifest()? else { return Ok(driver) };
    let scenario = Scenario { files, ..Scenario::new(ComponentSpec::new(""), driver) };
    Ok(Located::new(folder, &manifest).scenario(&scenario)?.driver)
}

/// The driver that a record is about: the new one of a gate, or the only one.
fn driver_of(folder: &Path, known: &BTreeMap<ScenarioId, Line>) -> Result<ComponentSpec> {
    let verdict = folder.join(VERDICT);
    if verdict.is_file() {
        let new = Verdict::read(&verdict)?.entries.into_iter().find(|entry| entry.driver == Role::New);
        if let Some(line) = new.and_then(|entry| known.get(&entry.id)) {
            return Ok(line.scenario.driver.clone());
        }
    }
    let mut drivers: Vec<&ComponentSpec> = Vec::new();
    for line in known.values() {
        if !drivers.contains(&&line.scenario.driver) {
            drivers.push(&line.scenario.driver);
        }
    }
    match drivers.as_slice() {
        [driver] => Ok((*driver).clone()),
        several => {
            let names: Vec<String> = several.iter().map(|driver| driver.name.clone()).collect();
            Err(Error::new(format!(
                "the record {} has drives of several drivers ({}); name the record of one driver or of a gate",
                folder.display(),
                names.join(", ")
            )))
        }
    }
}

/// The driver that runs the network in a file.
fn of_file(file: &Path, catalog: &Catalog) -> Result<ComponentSpec> {
    let takes = catalog.of_kind(Kind::Driver).filter(|entry| entry.base.is_none()).find_map(|entry| {
        let drop_in = entry.description.drop_in.as_ref().filter(|drop_in| drop_in.takes(file))?;
        Some((entry.description.name.clone(), drop_in.parameter.clone()))
    });
    let (name, parameter) = takes.ok_or_else(|| {
        Error::new(format!(
            "no driver takes the file {}; name a network, a driver or the record of a run",
            file.display()
        ))
    })?;
    let mut driver = ComponentSpec::new(name);
    driver.parameters.insert(parameter, Value::from(file.to_string_lossy()));
    Ok(driver)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_drive_in_which_a_component_failed_is_not_known() {
        let line = |cause: &str| -> Line {
            let value = json!({
                "id": "00000000000000000000000000000001", "name": "x", "images_every": 0, "success": false, "cause": cause,
                "time": 1.0, "frames": 5, "progress": 0.5, "mean_cross_track_error": 0.1, "max_cross_track_error": 0.2, "digest": "",
                "scenario": {"simulator": {"name": "flat"}, "driver": {"name": "x"}, "duration": 1.0, "seed": 0},
            });
            serde_json::from_value(value).unwrap()
        };
        let failed = line("lane_departure");
        assert_eq!(came(failed.clone()).map(|(id, _)| id), Some(failed.id));
        assert!(came(line("error")).is_none());
    }
}
