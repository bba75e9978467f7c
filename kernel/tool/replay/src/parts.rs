//! What a record was made with: where it is looked for, and what is different of it since then.

use std::collections::BTreeSet;
use std::path::Path;

use pdk_components::catalog::{Catalog, drop_in_name};
use pdk_components::inspection;
use pdk_components::registry::is_mask_script;
use pdk_components::search_path::{SearchPath, is_script};
use pdk_model::component::ComponentSpec;
use pdk_record::files::{FileRecord, recorded};
use pdk_record::manifest::{ComponentRecord, InUse, Machine, Manifest, components_of};
use pdk_record::settle;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::input_files::InputFiles;

use crate::recorded::Recorded;

/// Says of a driver what it is like once it is made.
pub type Info<'a> = dyn FnMut(&ComponentSpec) -> Result<Vec<(String, String)>> + 'a;

/// Lists the files that a component reads.
pub type Inputs<'a> = dyn FnMut(Kind, &ComponentSpec) -> Result<Vec<InputFiles>> + 'a;

/// The components that scenarios need.
fn components(scenarios: &[Recorded]) -> BTreeSet<(Kind, String)> {
    let all = scenarios.iter().flat_map(|recorded| components_of(&recorded.line.scenario));
    all.map(|(kind, component)| (kind, component.name)).collect()
}

/// Where a record has those of its components from that are not in the catalog: to be searched after the places that the catalog was
/// made from.
///
/// A record may come from anyone, and what it says of itself too. So libraries are among these places only if pdk has opened them on
/// this machine before and they have the recorded content, and scripts, which run in a sandbox, only if they have that content.
/// All others are listed in `asks`. Files that components show, such as pictures and networks, are data.
#[derive(Debug, Default, PartialEq)]
pub struct Further {
    /// What can be loaded; with `trusted`, all that there is.
    pub places: SearchPath,
    /// What would be loaded besides, a clause each.
    pub asks: Vec<String>,
}

impl Further {
    /// What the components of these scenarios need that are not in the catalog. `trusted` says that the user agrees to all of it.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn new(
        manifest: &Manifest,
        scenarios: &[Recorded],
        catalog: &Catalog,
        trusted: bool,
    ) -> Result<Self> {
        let mut further = Self::default();
        let needed = components(scenarios);
        for (kind, name) in needed.iter().filter(|(kind, name)| is_missing(catalog, *kind, name)) {
            let known = manifest.components.iter().find(|c| c.kind == *kind && c.name == *name);
            // What the catalog was made from has been loaded already.
            let is_new = |file: &&FileRecord| {
                catalog.entries().iter().all(|entry| recorded(&entry.file) != file.path)
                    && file.path.is_file()
            };
            if let Some(file) = known.map(|component| &component.file).filter(is_new) {
                let asks = asks(file)?.map(|asks| format!("{asks}, for the {kind} `{name}`"));
                if asks.is_none() || trusted {
                    further.places.plugins.push(file.path.clone());
                }
                further.asks.extend(asks);
            }
            // A file of the user's that a component shows has the component's name.
            let shown = manifest.files.iter().map(|file| file.path.as_path());
            for path in shown.filter(|path| drop_in_name(path) == *name) {
                let mut drop_ins =
                    catalog.of_kind(*kind).filter_map(|entry| entry.description.drop_in.as_ref());
                if drop_ins.any(|drop_in| drop_in.takes(path)) {
                    further.places.drop_ins.extend(path.parent().map(Path::to_owned));
                }
            }
        }
        further.places.plugins.sort();
        further.places.plugins.dedup();
        further.places.drop_ins.sort();
        further.places.drop_ins.dedup();
        Ok(further)
    }
}

/// Whether a component is not in the catalog. A mask that is a script is named by its path.
fn is_missing(catalog: &Catalog, kind: Kind, name: &str) -> bool {
    !is_mask_script(kind, name) && catalog.get(kind, name).is_err()
}

/// Why a recorded library or script is not loaded without the user's word, as a clause that names it; none if it is.
fn asks(file: &FileRecord) -> Result<Option<String>> {
    let what = if is_script(&file.path) { "script" } else { "library" };
    let path = std::path::absolute(&file.path).unwrap_or_else(|_| file.path.clone());
    let is_recorded = FileRecord::of(&path)?.blake3 == file.blake3;
    Ok(match (is_recorded, is_script(&path) || inspection::is_known(&path)) {
        (true, true) => None,
        (false, _) => Some(format!("the {what} {}, whose content is not the recorded one", path.display())),
        (true, false) => Some(format!("the {what} {}", path.display())),
    })
}

/// The programs that the components of these scenarios start, a clause each.
pub fn programs(scenarios: &[Recorded], catalog: &Catalog) -> Vec<String> {
    let mut programs = BTreeSet::new();
    for Recorded { line, .. } in scenarios {
        for (kind, ComponentSpec { name, parameters }) in components_of(&line.scenario) {
            let Ok(entry) = catalog.get(kind, &name) else { continue };
            let words = entry.description.parameters.iter().filter_map(|parameter| {
                let words =
                    parameter.program(parameters.get(&parameter.name).unwrap_or(&parameter.default))?;
                // As JSON, in which it is clear where an argument ends.
                Some((&parameter.name, serde_json::to_string(&words).ok()?))
            });
            programs.extend(words.map(|(parameter, words)| {
                format!("the program {words}, `{parameter}` of the {kind} `{name}`")
            }));
        }
    }
    programs.into_iter().collect()
}

/// What is different of pdk, the components and their files since a record was made, one clause each. `info` is asked about
/// every driver once, `inputs` about every component.
///
/// # Errors
/// If a component that the scenarios need is missing, or one of its files cannot be read.
pub fn changes(
    manifest: &Manifest,
    scenarios: &[Recorded],
    catalog: &Catalog,
    info: &mut Info<'_>,
    inputs: &mut Inputs<'_>,
) -> Result<Vec<String>> {
    for (kind, name) in components(scenarios) {
        if !is_mask_script(kind, &name) {
            catalog.get(kind, &name).map_err(|error| missing(manifest, kind, &name, &error))?;
        }
    }
    for Recorded { line, .. } in scenarios {
        settle::check(catalog, &line.scenario)
            .map_err(|error| error.at(format!("scenario `{}`", line.name)))?;
    }
    let mut changes = Vec::new();
    let mut in_use = InUse::default();
    let mut asked: BTreeSet<(Kind, String)> = BTreeSet::new();
    let mut drivers: Vec<(&ComponentSpec, Vec<(String, String)>)> = Vec::new();
    for Recorded { line, .. } in scenarios {
        let driver = &line.scenario.driver;
        let known = drivers.iter().position(|(known, _)| *known == driver);
        let place = known.unwrap_or_else(|| {
            let said = info(driver).unwrap_or_else(|error| {
                // It may have failed in the run as well, so it is for the outcomes to say what that means.
                changes.push(format!("the driver `{}` cannot be made here ({error})", driver.name));
                said_before(manifest, driver)
            });
            drivers.push((driver, said));
            drivers.len() - 1
        });
        in_use.add_scenario(catalog, &line.scenario, drivers[place].1.clone())?;
        for (kind, component) in components_of(&line.scenario) {
            if !asked.insert((kind, component.to_string())) {
                continue;
            }
            match inputs(kind, &component) {
                Ok(groups) => in_use.add_input_files(&groups, &mut |_, _| Ok(()))?,
                Err(error) => changes.push(format!(
                    "the files of the {kind} `{}` cannot be listed here ({error})",
                    component.name
                )),
            }
        }
    }
    let here = Manifest {
        pdk: env!("CARGO_PKG_VERSION").to_owned(),
        components: in_use.components(),
        files: in_use.files(),
        machine: Machine::this(),
        ..manifest.clone()
    };
    if manifest.pdk != here.pdk {
        changes.push(format!("the version of pdk was {} and is {}", manifest.pdk, here.pdk));
    }
    changes.extend(here.changed_parts(manifest, false));
    let noted: BTreeSet<&Path> = here.files.iter().map(|file| file.path.as_path()).collect();
    let gone = |file: &&FileRecord| !noted.contains(file.path.as_path()) && !file.path.exists();
    let gone = manifest.files.iter().filter(gone);
    changes.extend(gone.map(|file| format!("the file {} no longer exists", file.path.display())));
    Ok(changes)
}

/// What a driver said of itself when the record was made.
fn said_before(manifest: &Manifest, driver: &ComponentSpec) -> Vec<(String, String)> {
    let same = |c: &&ComponentRecord| c.kind == Kind::Driver && c.name == driver.name;
    manifest.components.iter().find(same).map_or_else(Vec::new, |component| component.info.clone())
}

/// The message about a component that is missing.
fn missing(manifest: &Manifest, kind: Kind, name: &str, error: &Error) -> Error {
    let shown = manifest.files.iter().find(|file| drop_in_name(&file.path) == name);
    let recorded = manifest.components.iter().find(|c| c.kind == kind && c.name == name);
    let from = shown.or(recorded.map(|component| &component.file));
    let from = from.map_or_else(String::new, |file| format!(" from {}", file.path.display()));
    // A file of the user's is not to be had from anybody else.
    let plugin = recorded.filter(|_| shown.is_none());
    let origin = plugin.and_then(|component| component.origin(&manifest.pdk));
    let remedy = match plugin.and_then(|component| component.plugin.as_ref()) {
        Some(plugin) if plugin.built_in => "replay it with that version",
        Some(_) => "install it with `pdk plugin add FILE`, or name its folder with --plugins",
        None => "name the folder in which it lies with --plugins or --drop-ins",
    };
    let origin = origin.map_or_else(String::new, |origin| format!(", {origin}"));
    Error::of(error.kind(), format!("{error}; the record has it{from}{origin}: {remedy}"))
}
