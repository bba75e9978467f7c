//! What was run: everything that has to be equal for two runs to be equal.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::path::{Path, PathBuf};

use pdk_components::catalog::{Catalog, Entry, PluginRecord};
use pdk_components::registry::is_mask_script;
use pdk_model::component::ComponentSpec;
use pdk_model::json::difference;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::region::Region;
use pdk_model::scenario::Scenario;
use pdk_model::shard::Shard;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::Result;
use pdk_sdk::input_files::InputFiles;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::evaluated::{EvaluationRecord, differs};
use crate::files::{FileRecord, recorded};
use crate::inputs::{self, Tick};

/// The manifest of a run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Manifest {
    /// The version of pdk.
    pub pdk: String,
    /// The seed that all random numbers come from.
    pub seed: u64,
    /// The pipeline.
    pub pipeline: Pipeline,
    /// The settings of the pipeline with what was overridden.
    pub settings: Value,
    /// The folder in which the run was started, as seen from the record's; empty if it is not one of those around it. Relative paths count
    /// from there.
    #[serde(default, skip_serializing_if = "is_empty")]
    pub folder: PathBuf,
    /// The folders that `--plugins` named.
    #[serde(default)]
    pub plugins: Vec<PathBuf>,
    /// The folders that `--drop-ins` named.
    #[serde(default)]
    pub drop_ins: Vec<PathBuf>,
    /// The components in use.
    pub components: Vec<ComponentRecord>,
    /// Models and other files that components were given.
    pub files: Vec<FileRecord>,
    /// The evaluations of datasets that were begun, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub evaluations: Vec<EvaluationRecord>,
    /// The machine.
    pub machine: Machine,
    /// Which part of the run it is; none if it is the whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<Shard>,
}

fn is_empty(path: &Path) -> bool {
    path.as_os_str().is_empty()
}

/// The pipeline of a run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Pipeline {
    /// The file, or the name of one that is part of pdk.
    pub path: PathBuf,
    /// Its text.
    pub source: String,
    /// The modules that it requires, with their texts, in the order in which they were first asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub modules: Vec<Module>,
}

/// A module that a pipeline requires.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Module {
    /// As the pipeline names it.
    pub name: String,
    /// Its text.
    pub source: String,
    /// BLAKE3 of its text, in hexadecimal.
    pub blake3: String,
}

impl Module {
    /// A module with this text.
    pub fn new(name: String, source: String) -> Self {
        let blake3 = blake3::hash(source.as_bytes()).to_hex().to_string();
        Self { name, source, blake3 }
    }
}

/// A component in use.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct ComponentRecord {
    /// Its kind.
    pub kind: Kind,
    /// Its name.
    pub name: String,
    /// The version of its algorithm.
    pub version: u32,
    /// The library or script that it comes from; a script that is part of pdk has `built-in:` and its name for a path.
    pub file: FileRecord,
    /// The plugin that the library is; none for a script.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plugin: Option<PluginRecord>,
    /// What it decided itself when it was made, such as the library that runs a network.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub info: Vec<(String, String)>,
}

/// The machine of a run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Machine {
    /// The operating system.
    pub system: String,
    /// The processor's architecture.
    pub architecture: String,
    /// The number of processors.
    pub processors: usize,
}

impl Manifest {
    /// This manifest with what a recorded one of the same run says besides: its machine, and the components and files that this
    /// one has not come to yet.
    ///
    /// # Errors
    /// If the two are not of the same run: says what differs, first the recorded value.
    pub fn continuing(mut self, recorded: &Manifest) -> Result<Self, String> {
        let differs = |what: &str, was: &dyn Display, is: &dyn Display| Err(differs(what, was, is));
        if self.pdk != recorded.pdk {
            return differs("the version of pdk", &recorded.pdk, &self.pdk);
        }
        if self.seed != recorded.seed {
            return differs("the seed", &recorded.seed, &self.seed);
        }
        if self.shard != recorded.shard {
            let said = |shard: Option<Shard>| shard.map_or("the whole".to_owned(), |shard| shard.to_string());
            return differs("the part of the run", &said(recorded.shard), &said(self.shard));
        }
        let (was, is) = (&recorded.pipeline, &self.pipeline);
        if was.source != is.source {
            return Err(format!("the text of the pipeline {} has changed", is.path.display()));
        }
        for module in &is.modules {
            if was.modules.iter().any(|known| known.name == module.name && known.blake3 != module.blake3) {
                return Err(format!("the text of the module {} has changed", module.name));
            }
        }
        // As it comes out of the file.
        let settings = serde_json::to_string(&self.settings).and_then(|text| serde_json::from_str(&text));
        let settings: Value = settings.map_err(|error| error.to_string())?;
        if let Some((name, was, is)) = difference("", &recorded.settings, &settings) {
            return differs(&format!("the setting {name}"), &was, &is);
        }
        if let Some(difference) = self.changed_parts(recorded, true).into_iter().next() {
            return Err(difference);
        }
        for (number, (is, was)) in self.evaluations.iter().zip(&recorded.evaluations).enumerate() {
            if let Some(difference) = is.difference(number, was).map_err(|error| error.to_string())? {
                return Err(difference);
            }
        }
        self.machine = recorded.machine.clone();
        self.components.extend(recorded.components.iter().cloned());
        self.components.sort();
        self.components.dedup();
        self.files.extend(recorded.files.iter().cloned());
        self.files.sort();
        self.files.dedup();
        self.evaluations.extend(recorded.evaluations.iter().skip(self.evaluations.len()).cloned());
        Ok(self)
    }

    /// What is different of the components and files that both manifests have, one clause each: versions, contents, what
    /// components say of themselves, and, where they count, the places where components lie.
    pub fn changed_parts(&self, recorded: &Manifest, places_count: bool) -> Vec<String> {
        let mut changed = Vec::new();
        // A library holds many components, and its changed content is reported once.
        let mut other_files: BTreeMap<&Path, (Vec<String>, &ComponentRecord)> = BTreeMap::new();
        for component in &self.components {
            let same = |c: &&ComponentRecord| c.kind == component.kind && c.name == component.name;
            let Some(first) = recorded.components.iter().find(same) else { continue };
            let name = format!("the {} `{}`", component.kind, component.name);
            if first.version != component.version {
                changed.push(differs(&format!("the version of {name}"), &first.version, &component.version));
            }
            if first.file.blake3 != component.file.blake3 {
                let (names, _) =
                    other_files.entry(&component.file.path).or_insert_with(|| (Vec::new(), first));
                if !names.contains(&name) {
                    names.push(name.clone());
                }
            }
            if places_count && first.file.path != component.file.path {
                let (was, is) = (first.file.path.display(), component.file.path.display());
                changed.push(differs(&format!("the path of {name}"), &was, &is));
            }
            // Such as the library that runs a network. Others may come with later drives.
            let said_again = |c: &ComponentRecord| {
                recorded.components.iter().filter(same).any(|known| known.info == c.info)
            };
            if !self.components.iter().filter(same).any(said_again) {
                let text = |info: &[(String, String)]| {
                    info.iter().map(|(key, value)| format!("{key} {value}")).collect::<Vec<_>>().join(", ")
                };
                changed.push(differs(
                    &format!("what {name} says of itself"),
                    &format!("`{}`", text(&first.info)),
                    &format!("`{}`", text(&component.info)),
                ));
            }
        }
        for (path, (names, first)) in other_files {
            let (names, path) = (names.join(", "), path.display());
            let other = first
                .origin(&recorded.pdk)
                .map_or_else(|| "another".to_owned(), |origin| format!("not that of {origin}"));
            changed.push(format!("the file of {names}, {path}, is {other}"));
        }
        let (groups, files): (Vec<_>, Vec<_>) = self.files.iter().partition(|file| !file.group.is_empty());
        let mut named: Vec<&Path> = Vec::new();
        for file in files.into_iter().chain(groups) {
            // A group adds nothing if one of its files has been named.
            if !file.group.is_empty() && named.iter().any(|path| path.starts_with(&file.path)) {
                continue;
            }
            if recorded.files.contains(file) {
                continue;
            }
            // A folder may have several groups of one kind, such as two files with labels, of which each is used when it is come to.
            let other = |known: &&FileRecord| {
                known.path == file.path && known.group == file.group && !self.files.contains(known)
            };
            let mut others = recorded.files.iter().filter(other);
            let first = others.next();
            let alike = first.into_iter().chain(others).find(|known| known.count == file.count);
            if let Some(difference) = alike.or(first).and_then(|known| file.difference(known)) {
                named.push(&file.path);
                changed.push(difference);
            }
        }
        changed.dedup();
        changed
    }
}

impl ComponentRecord {
    /// The very plugin that it was in, with its hash and where to get it; none if it was in a script. `pdk` is the version of
    /// pdk then.
    pub fn origin(&self, pdk: &str) -> Option<String> {
        let PluginRecord { name, version, homepage, built_in } = self.plugin.as_ref()?;
        let place = match homepage.as_str() {
            _ if *built_in => format!("which came with pdk {pdk}"),
            "" => "to be had from its author".to_owned(),
            homepage => format!("to be had at {homepage}"),
        };
        Some(format!("the plugin {name} {version} (BLAKE3 {}), {place}", self.file.blake3))
    }
}

impl Machine {
    /// This machine.
    pub fn this() -> Self {
        Self {
            system: std::env::consts::OS.to_owned(),
            architecture: std::env::consts::ARCH.to_owned(),
            processors: std::thread::available_parallelism().map_or(1, usize::from),
        }
    }
}

/// All components that a scenario uses, with their parameters.
pub fn components_of(scenario: &Scenario) -> Vec<(Kind, ComponentSpec)> {
    let Scenario { simulator, driver, perturbations, .. } = scenario;
    let mut components = vec![(Kind::Simulator, simulator.clone()), (Kind::Driver, driver.clone())];
    components.extend(components_of_all(perturbations));
    components
}

/// All components that perturbations use, with their parameters: masks and saliency methods besides themselves.
pub fn components_of_all(applied: &[AppliedPerturbation]) -> Vec<(Kind, ComponentSpec)> {
    let mut components = Vec::new();
    for AppliedPerturbation { name, parameters, selection, attention, .. } in applied {
        components
            .push((Kind::Perturbation, ComponentSpec { name: name.clone(), parameters: parameters.clone() }));
        if let Some(selection) = selection {
            components.extend(selection.mask.iter().map(|mask| (Kind::Mask, mask.clone())));
            components.extend(selection.by.iter().map(|by| (Kind::Saliency, by.clone())));
        }
        components.extend(attention.iter().map(|attention| (Kind::Saliency, attention.by.clone())));
    }
    components
}

/// What may be a path in the value of a parameter: a text, or each of a list, such as a program and its arguments.
fn texts(value: &Value) -> Vec<&str> {
    match value {
        Value::Array(list) => list.iter().filter_map(Value::as_str).collect(),
        value => value.as_str().into_iter().collect(),
    }
}

/// What tells a group of files from the others.
fn group_key(group: &InputFiles) -> (PathBuf, String, Vec<PathBuf>) {
    let mut names = group.names.clone();
    names.sort();
    names.dedup();
    (recorded(&group.folder), group.what.clone(), names)
}

/// The components and files that a run uses, collected while it is set up.
#[derive(Debug, Default)]
pub struct InUse {
    components: BTreeSet<ComponentRecord>,
    files: BTreeSet<FileRecord>,
    /// The groups of files that were read, by folder, kind and sorted names, each with its hash.
    groups: BTreeMap<(PathBuf, String, Vec<PathBuf>), String>,
}

impl InUse {
    /// Notes a component with what it says of itself once it is made, and its files: those among its parameters, and the one
    /// that a drop-in is made from.
    ///
    /// # Errors
    /// If the component does not exist, or one of its files cannot be read.
    pub fn add(
        &mut self,
        catalog: &Catalog,
        kind: Kind,
        name: &str,
        parameters: &Map<String, Value>,
        info: Vec<(String, String)>,
    ) -> Result<()> {
        if is_mask_script(kind, name) {
            return self.add_file(Path::new(name));
        }
        let entry = catalog.get(kind, name)?;
        let known = self.components.iter().any(|c| c.kind == kind && c.name == name && c.info == info);
        if !known {
            let code = catalog.code_of(entry);
            self.components.insert(ComponentRecord {
                kind,
                name: name.to_owned(),
                version: entry.description.version,
                file: self.hashed(code)?,
                plugin: code.plugin.clone(),
                info,
            });
        }
        // The component lists the files of a folder itself.
        if entry.base.is_some() && !entry.file.is_dir() {
            self.add_file(&entry.file)?;
        }
        for path in parameters.values().flat_map(texts).map(Path::new).filter(|path| path.is_file()) {
            self.add_file(path)?;
        }
        Ok(())
    }

    /// Notes all that a scenario uses; `info` is what its driver says of itself.
    ///
    /// # Errors
    /// As for [`InUse::add`].
    pub fn add_scenario(
        &mut self,
        catalog: &Catalog,
        scenario: &Scenario,
        info: Vec<(String, String)>,
    ) -> Result<()> {
        let Scenario { simulator, driver, perturbations, .. } = scenario;
        self.add(catalog, Kind::Simulator, &simulator.name, &simulator.parameters, Vec::new())?;
        self.add(catalog, Kind::Driver, &driver.name, &driver.parameters, info)?;
        self.add_perturbations(catalog, perturbations)
    }

    /// Notes perturbations with their masks and the methods that choose their pixels.
    ///
    /// # Errors
    /// As for [`InUse::add`].
    pub fn add_perturbations(&mut self, catalog: &Catalog, applied: &[AppliedPerturbation]) -> Result<()> {
        for perturbation in applied {
            if let Some(Region::Mask(path)) = &perturbation.region {
                self.add_file(Path::new(path))?;
            }
            let AppliedPerturbation { name, parameters, selection, attention, .. } = perturbation;
            let chosen_by = selection.as_ref().and_then(|selection| selection.by.as_ref());
            if let Some(mask) = selection.as_ref().and_then(|selection| selection.mask.as_ref()) {
                self.add(catalog, Kind::Mask, &mask.name, &mask.parameters, Vec::new())?;
            }
            for by in chosen_by.into_iter().chain(attention.as_ref().map(|attention| &attention.by)) {
                self.add(catalog, Kind::Saliency, &by.name, &by.parameters, Vec::new())?;
            }
            self.add(catalog, Kind::Perturbation, name, parameters, Vec::new())?;
        }
        Ok(())
    }

    /// Notes a file.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn add_file(&mut self, path: &Path) -> Result<()> {
        let place = recorded(path);
        if !self.files.iter().any(|file| file.path == place) {
            self.files.insert(FileRecord::of(path)?);
        }
        Ok(())
    }

    /// Notes files that a component reads and its parameters do not name.
    ///
    /// # Errors
    /// An error of `tick`, which is called with the number of files of a group that have been read.
    pub fn add_input_files(&mut self, groups: &[InputFiles], tick: &mut Tick<'_>) -> Result<()> {
        for group in groups {
            let key = group_key(group);
            if self.groups.contains_key(&key) {
                continue;
            }
            let records = inputs::records(group, tick)?;
            self.groups.extend(records.first().map(|all| (key, all.blake3.clone())));
            self.files.extend(records);
        }
        Ok(())
    }

    /// The hash of a single file that was noted; none if it was not.
    pub fn hash_of(&self, path: &Path) -> Option<&str> {
        let place = recorded(path);
        let noted = self.files.iter().find(|file| file.path == place && file.group.is_empty());
        noted.map(|file| file.blake3.as_str())
    }

    /// The hash of a group of files that was noted; none if it was not.
    pub fn content_of(&self, group: &InputFiles) -> Option<&str> {
        self.groups.get(&group_key(group)).map(String::as_str)
    }

    /// The record of what has a component's code. A library, which many components share, is read once.
    fn hashed(&self, code: &Entry) -> Result<FileRecord> {
        if let Some(blake3) = &code.blake3 {
            return Ok(FileRecord::new(&code.file, blake3.clone()));
        }
        let place = recorded(&code.file);
        let known = self.components.iter().map(|component| &component.file);
        known.clone().find(|file| file.path == place).cloned().map_or_else(|| FileRecord::of(&code.file), Ok)
    }

    /// How many components and files there are; none is ever left out again.
    pub fn count(&self) -> usize {
        self.components.len() + self.files.len()
    }

    /// The components, in order.
    pub fn components(&self) -> Vec<ComponentRecord> {
        self.components.iter().cloned().collect()
    }

    /// The files, in order.
    pub fn files(&self) -> Vec<FileRecord> {
        self.files.iter().cloned().collect()
    }
}

#[cfg(test)]
mod tests;
