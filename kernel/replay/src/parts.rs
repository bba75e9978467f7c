//! What a record was made with: where it is looked for, and what is different of it since then.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use pdk_core::catalog::{Catalog, drop_in_name};
use pdk_core::manifest::{ComponentRecord, FileRecord, InUse, Machine, Manifest};
use pdk_core::search_path::SearchPath;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::Scenario;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};

use crate::recorded::Recorded;

/// Says of a driver what it is like once it is made.
pub type Info<'a> = dyn FnMut(&ComponentSpec) -> Result<Vec<(String, String)>> + 'a;

/// The components that scenarios need.
fn components(scenarios: &[Recorded]) -> BTreeSet<(Kind, &str)> {
    let mut needed = BTreeSet::new();
    for Recorded { line, .. } in scenarios {
        let Scenario { simulator, driver, perturbations, .. } = &line.scenario;
        needed.insert((Kind::Simulator, simulator.name.as_str()));
        needed.insert((Kind::Driver, driver.name.as_str()));
        needed.extend(perturbations.iter().map(|p| (Kind::Perturbation, p.name.as_str())));
    }
    needed
}

/// Where a record has those of its components from that are not in the catalog: to be looked through after the places that the
/// catalog was made from. None where nothing is missing, or nothing else can be found.
pub fn further_places(manifest: &Manifest, scenarios: &[Recorded], catalog: &Catalog) -> Option<SearchPath> {
    let needed = components(scenarios);
    let missing: Vec<_> =
        needed.into_iter().filter(|(kind, name)| catalog.get(*kind, name).is_err()).collect();
    if missing.is_empty() {
        return None;
    }
    let given = |folders: &[PathBuf]| folders.iter().filter(|folder| folder.exists()).cloned().collect();
    let overlays: Vec<PathBuf> = given(&manifest.overlays);
    let mut places = SearchPath {
        plugins: given(&manifest.plugins),
        drop_ins: overlays.into_iter().map(|folder| ("overlays".to_owned(), folder)).collect(),
        beside: Vec::new(),
    };
    for (kind, name) in missing {
        let recorded = manifest.components.iter().filter(|c| c.kind == kind && c.name == name);
        let files = recorded.map(|component| &component.file.path).filter(|path| path.is_file());
        let elsewhere = files.filter(|path| !manifest.plugins.iter().any(|folder| path.starts_with(folder)));
        places.plugins.extend(elsewhere.cloned());
        // A file of the user's that a component shows has the component's name.
        let shown = manifest.files.iter().map(|file| file.path.as_path());
        for path in shown.filter(|path| path.is_file() && drop_in_name(path) == name) {
            let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
            let drop_ins = catalog.of_kind(kind).filter_map(|entry| entry.description.drop_in.as_ref());
            let fitting = drop_ins.filter(|drop_in| drop_in.endings.contains(&ending));
            let parent = path.parent().map(Path::to_owned);
            places
                .drop_ins
                .extend(fitting.filter_map(|drop_in| Some((drop_in.folder.clone(), parent.clone()?))));
        }
    }
    places.plugins.sort();
    places.plugins.dedup();
    places.drop_ins.sort();
    places.drop_ins.dedup();
    (!places.plugins.is_empty() || !places.drop_ins.is_empty()).then_some(places)
}

/// What is different of pdk, the components and their files since a record was made, one clause each. `info` is asked about
/// every driver once.
///
/// # Errors
/// Where a component that the scenarios need is missing, or one of its files cannot be read.
pub fn changes(
    manifest: &Manifest,
    scenarios: &[Recorded],
    catalog: &Catalog,
    info: &mut Info<'_>,
) -> Result<Vec<String>> {
    for (kind, name) in components(scenarios) {
        catalog.get(kind, name).map_err(|error| missing(manifest, kind, name, &error))?;
    }
    let mut changes = Vec::new();
    let mut in_use = InUse::default();
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
    changes.extend(gone.map(|file| format!("the file {} is not there any more", file.path.display())));
    Ok(changes)
}

/// What a driver said of itself when the record was made.
fn said_before(manifest: &Manifest, driver: &ComponentSpec) -> Vec<(String, String)> {
    let same = |c: &&ComponentRecord| c.kind == Kind::Driver && c.name == driver.name;
    manifest.components.iter().find(same).map_or_else(Vec::new, |component| component.info.clone())
}

/// What is said of a component that is not there.
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
        None => "name the folder in which it lies with --plugins or --overlays",
    };
    let origin = origin.map_or_else(String::new, |origin| format!(", {origin}"));
    Error::of(error.kind(), format!("{error}; the record has it{from}{origin}: {remedy}"))
}
