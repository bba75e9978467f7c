//! What stands behind the global `pdk` of one pipeline: its settings, the session, and the record.

pub(crate) mod driving;
mod evaluating;
mod finishing;
mod searching;
mod summary;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use pdk_components::search_path::SearchPath;
use pdk_components::suggest;
use pdk_loop::protocol::Made;
use pdk_model::scenario::ScenarioId;
use pdk_record::directory::{MANIFEST, RunDirectory};
use pdk_record::ledger::{Ledger, Line};
use pdk_record::manifest::{InUse, Machine, Manifest, Module, Pipeline};
use pdk_record::merge::EvaluatedFrames;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_session::session::{Session, Ticket};
use serde_json::{Map, Value};

use crate::evaluation::Results;
use crate::follow::{Audience, Progress};
use crate::requests::Defaults;
use crate::settings::{self, COMMON, Common, Override};
use crate::{road, table, tables};

pub use summary::Summary;

/// The folder for records where the user names none.
const RUNS: &str = "runs";

/// What a run came to.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The folder of the record; none where the pipeline neither drove nor evaluated.
    pub record: Option<PathBuf>,
    /// The table at the end; in a part of a run, what belongs to the part.
    pub summary: Summary,
    /// How fast it went, a line each, for people.
    pub speed: Vec<String>,
    /// What did not go well without ending the run, one sentence each.
    pub warnings: Vec<String>,
    /// Why the run counts as failed: an error of the script, or one that did not end it.
    pub failure: Option<Error>,
}

/// The state behind the global `pdk` of one pipeline.
pub struct Host {
    session: Session,
    pipeline: Pipeline,
    /// The modules that were required so far.
    modules: Box<dyn Fn() -> Vec<Module> + Send>,
    /// The folders that were named on the command line, for the manifest.
    given: (Vec<PathBuf>, Vec<PathBuf>),
    /// Where components are looked for, for the process of a strategy.
    search: SearchPath,
    /// The session of that process, between two searches.
    strategist: Option<Session>,
    /// How many searches were begun.
    searches: u64,
    common: Common,
    overrides: Vec<Override>,
    audience: Audience,
    settings: Option<Value>,
    directory: Option<RunDirectory>,
    /// Whether the session has the ledger, which only scenarios need.
    has_ledger: bool,
    /// The manifest that an earlier process left in the folder.
    earlier: Option<Manifest>,
    manifest: Option<Value>,
    in_use: InUse,
    /// What components said when they were made, by kind and what they were made from.
    made: BTreeMap<(Kind, String), Made>,
    /// The components whose files have been noted, as there.
    read: BTreeSet<(Kind, String)>,
    /// Those that panicked then, took their process along or did not come back, and how.
    fatal: BTreeMap<(Kind, String), Error>,
    /// What was submitted under each ticket.
    submitted: BTreeMap<Ticket, Submitted>,
    /// The numbers of the scenarios, in the order in which they were submitted first, which is that of the ledger in the end.
    numbers: BTreeMap<ScenarioId, usize>,
    /// What came of it, as far as anybody has taken it; nothing where another part of the run drives it.
    outcomes: BTreeMap<Ticket, Result<Option<Arc<Line>>>>,
    /// What scenarios and evaluations left to the machine, such as the engine of networks, and what it was.
    settled: Vec<(String, String)>,
    /// The numbers of the scenarios whose outcomes a program was handed, which knows from them what failed.
    handed_over: BTreeSet<usize>,
    evaluations: Vec<Value>,
    /// What each of them went through.
    evaluated: Vec<EvaluatedFrames>,
    evaluation_times: Vec<Value>,
    results: Option<Results>,
    speed: Vec<String>,
    warnings: Vec<String>,
    /// The numbers of the scenarios whose outcomes were in the ledger already.
    kept: BTreeSet<usize>,
    progress: Progress,
    /// Frames that scenarios did not need, and those that were driven before the bar began.
    spared: u64,
    before: u64,
    started: SystemTime,
}

/// A scenario that was submitted.
#[derive(Debug, Clone)]
struct Submitted {
    /// Its number in the run, which is its place in the ledger in the end.
    number: usize,
    /// What tells it from others.
    id: ScenarioId,
    /// What the pipeline calls it this time.
    name: String,
    /// How many frames it may have.
    expected: u64,
}

/// A search that was begun.
pub(crate) struct BegunSearch {
    /// What it is called.
    pub name: String,
    /// The number of the search in its run, from 0.
    pub number: u64,
    /// The seed of the run.
    pub seed: u64,
    /// How many scenarios are driven at the same time.
    pub slots: usize,
    /// Whether the strategy learns nothing.
    pub baseline: bool,
    /// The session of the strategy, where it is a component.
    pub session: Option<Session>,
}

/// What it takes to make a host.
pub struct Parts {
    /// The session.
    pub session: Session,
    /// The pipeline.
    pub pipeline: Pipeline,
    /// Tells which modules were required so far.
    pub modules: Box<dyn Fn() -> Vec<Module> + Send>,
    /// The folders that `--plugins` and `--drop-ins` named.
    pub given: (Vec<PathBuf>, Vec<PathBuf>),
    /// Where components are looked for.
    pub search: SearchPath,
    /// The settings that every pipeline has.
    pub common: Common,
    /// What `--set` puts in the place of the pipeline's own settings.
    pub overrides: Vec<Override>,
    /// Who follows the run.
    pub audience: Audience,
}

impl Host {
    /// The host for one pipeline.
    pub fn new(parts: Parts) -> Self {
        let Parts { session, pipeline, modules, given, search, common, overrides, audience } = parts;
        Self {
            session,
            pipeline,
            modules,
            given,
            search,
            strategist: None,
            searches: 0,
            common,
            overrides,
            audience,
            settings: None,
            directory: None,
            has_ledger: false,
            earlier: None,
            manifest: None,
            in_use: InUse::default(),
            made: BTreeMap::new(),
            read: BTreeSet::new(),
            fatal: BTreeMap::new(),
            submitted: BTreeMap::new(),
            numbers: BTreeMap::new(),
            outcomes: BTreeMap::new(),
            settled: Vec::new(),
            handed_over: BTreeSet::new(),
            evaluations: Vec::new(),
            evaluated: Vec::new(),
            evaluation_times: Vec::new(),
            results: None,
            speed: Vec::new(),
            warnings: Vec::new(),
            kept: BTreeSet::new(),
            progress: progress(audience),
            spared: 0,
            before: 0,
            started: SystemTime::now(),
        }
    }

    /// `pdk.settings`: the defaults with what the command line puts in their place.
    pub(crate) fn settings(&mut self, defaults: Value) -> Result<Value> {
        if self.settings.is_some() {
            return Err(Error::new("pdk.settings may be called once; put all settings into one table"));
        }
        if let Some((name, meaning)) = COMMON.iter().find(|(name, _)| defaults.get(name).is_some()) {
            return Err(Error::new(format!(
                "`{name}` is a setting that every pipeline has ({meaning}); leave it out of pdk.settings"
            )));
        }
        if self.directory.is_some() {
            return Err(Error::new(
                "pdk.settings has to come before the first pdk.drive or pdk.evaluate, because the record begins there",
            ));
        }
        let settings = settings::apply(defaults, &self.overrides)?;
        self.settings = Some(settings.clone());
        Ok(settings)
    }

    /// Notes what did not go well without ending the run.
    pub(crate) fn warn(&mut self, sentence: String) {
        self.warnings.push(sentence);
    }

    /// How many scenarios are driven at the same time, once all workers are there.
    pub(crate) fn slots(&self) -> usize {
        self.session.slots()
    }

    /// The components there are.
    pub(crate) fn catalog(&self) -> Result<Value> {
        Ok(serde_json::to_value(self.session.catalog())?)
    }

    /// What scenarios have where nobody says it.
    pub(crate) fn defaults(&self) -> Defaults {
        let simulators = self.session.catalog().of_kind(Kind::Simulator);
        let own_clock = simulators.filter(|entry| !entry.description.clock.is_stepped());
        Defaults::new(self.common.seed, own_clock.map(|entry| entry.description.name.clone()).collect())
    }

    /// `pdk.show`: a table of what `pdk.drive` or `pdk.evaluate` returned.
    pub(crate) fn show(&self, result: &Value) -> Result<()> {
        let text = table::render(result)?;
        self.print(&text);
        Ok(())
    }

    /// `pdk.table`: a table of the pipeline's own making.
    pub(crate) fn table(&self, header: &Value, rows: &Value) -> Result<()> {
        let text = tables::render(header, rows)?;
        self.print(&text);
        Ok(())
    }

    fn print(&self, text: &str) {
        // What a part shows is not what the whole will show.
        if self.common.shard.is_none() {
            self.progress.print(text);
        }
    }

    /// `pdk.save`: a file in the record.
    pub(crate) fn save(&self, name: &Value, value: &Value) -> Result<()> {
        let name = tables::checked_name(name)?;
        let directory = self.directory.as_ref().ok_or_else(|| {
            Error::new("pdk.save has to come after the first pdk.drive or pdk.evaluate, because the record begins there")
        })?;
        directory.write_json(name, value)
    }

    /// `pdk.road`: a road for scenarios.
    pub(crate) fn road(&self, request: Value) -> Result<Value> {
        road::make(request, self.common.seed)
    }

    /// `pdk.perturbations`: the names of the perturbations, all or those of the default set.
    pub(crate) fn perturbations(&self, all: bool) -> Vec<String> {
        let wanted = self.session.catalog().of_kind(Kind::Perturbation);
        wanted.filter(|c| all || c.description.default).map(|c| c.description.name.clone()).collect()
    }

    /// `pdk.draws`: whether a perturbation draws anything at random.
    ///
    /// # Errors
    /// Where there is none of this name.
    pub(crate) fn draws(&self, name: &Value) -> Result<bool> {
        let Some(name) = name.as_str() else {
            return Err(Error::new(format!("pdk.draws takes the name of a perturbation, not {name}")));
        };
        let mut all = self.session.catalog().of_kind(Kind::Perturbation);
        match all.find(|component| component.description.name == name) {
            Some(component) => {
                let description = &component.description;
                Ok(!(description.drawn_per_sequence.is_empty() && description.drawn_per_frame.is_empty()))
            }
            None => {
                let known = self.perturbations(true);
                Err(Error::new(format!(
                    "pdk.draws: there is no perturbation `{name}`; {}",
                    suggest::hint(name, known.iter().map(String::as_str))
                )))
            }
        }
    }

    /// `pdk.path`: a path that counts from the pipeline's folder.
    pub(crate) fn path(&self, relative: &str) -> String {
        let folder = self.pipeline.path.parent().unwrap_or(Path::new(""));
        folder.join(relative).to_string_lossy().into_owned()
    }

    /// Where the command line sets something although the pipeline has no settings of its own.
    fn check_overrides(&self) -> Result<()> {
        match self.settings {
            Some(_) => Ok(()),
            // Says that the setting does not exist.
            None => settings::apply(Value::Object(Map::new()), &self.overrides).map(drop),
        }
    }

    /// Writes down what is used from here on, before anything is computed with it.
    fn begin(&mut self) -> Result<()> {
        self.check_overrides()?;
        let directory = self.open_directory()?;
        self.pipeline.modules = (self.modules)();
        let manifest = Manifest {
            pdk: env!("CARGO_PKG_VERSION").to_owned(),
            seed: self.common.seed,
            pipeline: self.pipeline.clone(),
            settings: self.settings.clone().unwrap_or_default(),
            plugins: self.given.0.clone(),
            drop_ins: self.given.1.clone(),
            components: self.in_use.components(),
            files: self.in_use.files(),
            machine: Machine::this(),
            shard: self.common.shard,
        };
        let manifest = match &self.earlier {
            None => manifest,
            Some(earlier) => manifest.continuing(earlier).map_err(|difference| {
                // What another run recorded stays as it is.
                self.directory = None;
                Error::new(format!(
                    "the output folder {} holds the record of another run: {difference}; choose another with --out",
                    directory.path().display()
                ))
            })?,
        };
        let manifest = serde_json::to_value(manifest)?;
        if self.manifest.as_ref() != Some(&manifest) {
            directory.write_json(MANIFEST, &manifest)?;
            self.manifest = Some(manifest);
        }
        Ok(())
    }

    /// Hands the session the ledger, so that it records scenarios.
    fn open_ledger(&mut self) -> Result<()> {
        if let (Some(directory), false) = (self.directory.clone(), self.has_ledger) {
            directory.remove_partial_traces();
            // A record that is damaged stays as it is.
            let ledger = Ledger::open(&directory).inspect_err(|_| self.directory = None)?;
            self.session.record(directory, ledger, self.common.keep_errors);
            self.has_ledger = true;
        }
        Ok(())
    }

    /// The folder of the record, which is made when it is first needed.
    fn open_directory(&mut self) -> Result<RunDirectory> {
        if let Some(directory) = &self.directory {
            return Ok(directory.clone());
        }
        let directory = match &self.common.out {
            Some(path) => RunDirectory::create(path),
            None => RunDirectory::create_first(folders(&self.pipeline.path)),
        }?;
        self.earlier = directory.manifest()?;
        Ok(self.directory.insert(directory).clone())
    }
}

/// A bar for frames on the road.
fn progress(audience: Audience) -> Progress {
    Progress::new(audience, "{pos}/{len} frames, {per_sec}, {eta} left")
}

/// The folders `runs/NAME-N`, one after the other.
fn folders(pipeline: &Path) -> impl Iterator<Item = PathBuf> {
    let name = pipeline.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    (1..).map(move |number: u64| Path::new(RUNS).join(format!("{name}-{number}")))
}
