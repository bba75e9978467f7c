//! Replays recorded scenarios from their record alone, and says whether everything is as it was, bit for bit.
//!
//! Nothing of the pipeline runs: the line of a scenario holds its simulator, driver, road and perturbations with sampled
//! courses, and the manifest the seed. They go through the same loop as in a run, before another [witness](drive::Witness).

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};

use crate::component::ComponentSpec;
use crate::drive::{self, Outcome, Plan};
use crate::record::manifest::{FileRecord, InUse, Machine, Manifest};
use crate::record::{RESULTS, RunDirectory, SCENARIOS};
use crate::registry::{Registry, SearchPath};
use crate::watchdog::Patience;

mod clip;
mod compare;
mod gauge;

use compare::Compare;
pub use compare::{Compared, Difference, Finding};

/// Recorded scenarios to replay.
pub struct Replay {
    directory: RunDirectory,
    manifest: Manifest,
    /// The scenarios by their numbers.
    outcomes: BTreeMap<u64, Outcome>,
    /// The same as plans: all scenarios of one have simulator and driver in common.
    plans: Vec<(Plan, Vec<u64>)>,
}

/// How scenarios are replayed.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The number of scenarios that are driven at the same time.
    pub threads: usize,
    /// How long one call of a component may take.
    pub patience: Patience,
    /// The video to write; there may be one scenario only then.
    pub clip: Option<PathBuf>,
}

/// What replays came to.
#[derive(Debug)]
pub struct Replayed {
    /// What there is to say of each scenario, in order.
    pub scenarios: Vec<Compared>,
    /// Frames that were driven.
    pub frames: u64,
    /// Wall time of driving in seconds.
    pub wall_seconds: f64,
}

impl Replay {
    /// Opens the record of a run. `wanted` are the numbers of scenarios; where there are none, all are wanted.
    ///
    /// # Errors
    /// Where the folder holds no scenarios of the closed loop, is damaged, or has no scenario of a wanted number.
    pub fn open(folder: &Path, wanted: &[u64]) -> Result<Self> {
        let directory = RunDirectory::open(folder)?;
        let shown = folder.display();
        if !folder.join(SCENARIOS).is_file() {
            return Err(Error::new(match folder.join(RESULTS).is_file() {
                true => format!(
                    "{shown} holds results of pdk.evaluate only; what can be replayed are the scenarios of pdk.drive"
                ),
                false => format!("{shown} holds no scenarios: its run ended before the first was over"),
            }));
        }
        let record = directory.read()?;
        let mut outcomes = record.outcomes;
        let (Some(first), Some(last)) = (outcomes.keys().next().copied(), outcomes.keys().last().copied())
        else {
            return Err(Error::new(format!(
                "{shown} holds no scenarios: its run ended before the first was over"
            )));
        };
        if let Some(missing) = wanted.iter().find(|index| !outcomes.contains_key(index)) {
            return Err(Error::new(format!(
                "{shown} holds no scenario {missing}; it has {} of them, from {first} to {last}",
                outcomes.len()
            )));
        }
        if !wanted.is_empty() {
            outcomes.retain(|index, _| wanted.contains(index));
        }
        let mut plans: Vec<(Plan, Vec<u64>)> = Vec::new();
        for (index, outcome) in &outcomes {
            let (Some(simulator), Some(driver), Some(images_every)) =
                (&outcome.simulator, &outcome.driver, outcome.images_every)
            else {
                return Err(Error::new(format!(
                    "scenario {index} of {shown} was recorded by a version of pdk that did not note simulator and driver; \
                     run its pipeline again"
                )));
            };
            let fits = |plan: &Plan| {
                plan.simulator == *simulator
                    && plan.driver == *driver
                    && plan.images_every == images_every
                    && plan.mode == outcome.mode
            };
            let known = plans.iter().position(|(plan, _)| fits(plan));
            let place = known.unwrap_or_else(|| {
                let (simulator, driver) = (simulator.clone(), driver.clone());
                let (scenarios, mode) = (Vec::new(), outcome.mode);
                plans.push((Plan { simulator, driver, scenarios, images_every, mode }, Vec::new()));
                plans.len() - 1
            });
            plans[place].0.scenarios.push(outcome.scenario.clone());
            plans[place].1.push(*index);
        }
        Ok(Self { directory, manifest: record.manifest, outcomes, plans })
    }

    /// The number of scenarios.
    pub fn count(&self) -> usize {
        self.outcomes.len()
    }

    /// The components that the scenarios need.
    fn components(&self) -> BTreeSet<(Kind, &str)> {
        let mut needed = BTreeSet::new();
        for (plan, _) in &self.plans {
            needed.insert((Kind::Simulator, plan.simulator.name.as_str()));
            needed.insert((Kind::Driver, plan.driver.name.as_str()));
            let perturbations = plan.scenarios.iter().flat_map(|scenario| &scenario.perturbations);
            needed.extend(perturbations.map(|p| (Kind::Perturbation, p.name.as_str())));
        }
        needed
    }

    /// Where the record has components from that are not in the registry: to be looked through after the places that the
    /// registry was made from. None where nothing is missing, or nothing else can be found.
    pub fn further_places(&self, registry: &Registry) -> Option<SearchPath> {
        let missing =
            || self.components().into_iter().filter(|(kind, name)| registry.get(*kind, name).is_err());
        missing().next()?;
        let Manifest { plugins, overlays, .. } = &self.manifest;
        let given = |folders: &[PathBuf]| folders.iter().filter(|folder| folder.exists()).cloned().collect();
        let folders: Vec<PathBuf> = given(overlays);
        let mut places = SearchPath {
            plugins: given(plugins),
            drop_ins: folders.into_iter().map(|folder| ("overlays", folder)).collect(),
        };
        for (kind, name) in missing() {
            let recorded = self.manifest.components.iter().filter(|c| c.kind == kind && c.name == name);
            let files = recorded.map(|component| &component.file.path).filter(|path| path.is_file());
            let elsewhere = files.filter(|path| !plugins.iter().any(|folder| path.starts_with(folder)));
            places.plugins.extend(elsewhere.cloned());
            // A file of the user's that a component shows has the component's name.
            let shown = self.manifest.files.iter().map(|file| file.path.as_path());
            let shown = shown.filter(|path| path.is_file() && Registry::drop_in_name(path) == name);
            places
                .drop_ins
                .extend(shown.filter_map(Path::parent).map(|folder| ("overlays", folder.to_owned())));
        }
        places.plugins.sort();
        places.plugins.dedup();
        places.drop_ins.sort();
        places.drop_ins.dedup();
        (!places.plugins.is_empty() || !places.drop_ins.is_empty()).then_some(places)
    }

    /// What is different of pdk, the components and their files since the record was made, one clause each.
    ///
    /// # Errors
    /// Where a component that the scenarios need is missing or cannot be made.
    pub fn changes(&self, registry: &Registry, patience: Patience) -> Result<Vec<String>> {
        for (kind, name) in self.components() {
            registry.get(kind, name).map(drop).map_err(|error| {
                let shown = self.manifest.files.iter().find(|file| Registry::drop_in_name(&file.path) == name);
                let recorded = self.manifest.components.iter().find(|c| c.kind == kind && c.name == name);
                let from = shown.or(recorded.map(|component| &component.file));
                let from = from.map_or_else(String::new, |file| format!(" from {}", file.path.display()));
                Error::new(format!(
                    "{error}; the record has it{from}: name the folder in which it lies with --plugins or --overlays"
                ))
            })?;
        }
        let mut in_use = InUse::default();
        for (plan, _) in &self.plans {
            let components: [(Kind, &ComponentSpec); 2] =
                [(Kind::Simulator, &plan.simulator), (Kind::Driver, &plan.driver)];
            let perturbations = plan.scenarios.iter().flat_map(|scenario| &scenario.perturbations);
            in_use.add_all(registry, components, perturbations, patience)?;
        }
        let here = Manifest {
            pdk: env!("CARGO_PKG_VERSION").to_owned(),
            components: in_use.components(),
            files: in_use.files(),
            machine: Machine::this(),
            ..self.manifest.clone()
        };
        let mut changes = Vec::new();
        if self.manifest.pdk != here.pdk {
            changes.push(format!("the version of pdk was {} and is {}", self.manifest.pdk, here.pdk));
        }
        changes.extend(here.changed_parts(&self.manifest, false));
        let noted: BTreeSet<&Path> = here.files.iter().map(|file| file.path.as_path()).collect();
        let gone = |file: &&FileRecord| !noted.contains(file.path.as_path()) && !file.path.exists();
        let gone = self.manifest.files.iter().filter(gone);
        changes.extend(gone.map(|file| format!("the file {} is not there any more", file.path.display())));
        Ok(changes)
    }

    /// Drives the scenarios again and compares.
    ///
    /// # Errors
    /// Where a component cannot be made, or the video cannot be written. What is wrong with a trace is said of its scenario.
    pub fn drive(
        &self,
        registry: &Registry,
        settings: &Settings,
        progress: &ProgressBar,
    ) -> Result<Replayed> {
        let drive_settings = drive::Settings {
            seed: self.manifest.seed,
            threads: settings.threads,
            patience: settings.patience,
            run_id: drive::run_id(Path::new("replay")),
        };
        let mut replayed = Replayed { scenarios: Vec::new(), frames: 0, wall_seconds: 0.0 };
        for (plan, indexes) in &self.plans {
            let scenarios: Vec<_> = indexes.iter().copied().zip(&plan.scenarios).collect();
            let witness = || Ok(Compare::new(&self.directory, &self.outcomes, settings.clip.as_deref()));
            let (compared, performance) =
                drive::drive_all(registry, plan, &scenarios, &drive_settings, witness, progress)?;
            replayed.scenarios.extend(compared);
            replayed.frames += performance.stages.steps;
            replayed.wall_seconds += performance.wall_seconds;
        }
        replayed.scenarios.sort_by_key(|compared| compared.index);
        Ok(replayed)
    }
}
