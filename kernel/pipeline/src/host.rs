//! What stands behind the global `pdk` of one pipeline: its settings, the session, and the record.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use pdk_core::directory::{MANIFEST, PERFORMANCE, RESULTS, RunDirectory, SHARD, SUMMARY};
use pdk_core::ledger::{Ledger, Line};
use pdk_core::manifest::{InUse, Machine, Manifest, Module, Pipeline};
use pdk_core::merge::ShardList;
use pdk_core::search_path::SearchPath;
use pdk_core::suggest;
use pdk_model::component::ComponentSpec;
use pdk_model::outcome::{Cause, Verdict};
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::{Scenario, ScenarioId};
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_session::connection::Pool;
use pdk_session::drive::expected_frames;
use pdk_session::interrupt::{self, Wish};
use pdk_session::protocol::{Evaluation, Made};
use pdk_session::session::{Options, Reply, Session, Submission, Ticket};
use pdk_session::stages::LoopTimes;
use serde_json::{Map, Value, json};

use crate::evaluation::{self, Results};
use crate::follow::{Audience, Progress};
use crate::naming::run_name;
use crate::requests::{DatasetSpec, Defaults, Evaluate};
use crate::settings::{self, COMMON, Common, Override};
use crate::{road, table, tables};

/// The folder for records where the user names none.
const RUNS: &str = "runs";

/// What a run came to.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The folder of the record; none where the pipeline neither drove nor evaluated.
    pub record: Option<PathBuf>,
    /// The table at the end; in a part of a run, what belongs to the part.
    pub summary: Value,
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
    /// Those that panicked then, took their process along or did not come back, and how.
    fatal: BTreeMap<(Kind, String), Error>,
    /// What was submitted under each ticket.
    submitted: BTreeMap<Ticket, Submitted>,
    /// The numbers of the scenarios, in the order in which they were submitted first, which is that of the ledger in the end.
    numbers: BTreeMap<ScenarioId, usize>,
    /// What came of it, as far as anybody has taken it; nothing where another part of the run drives it.
    outcomes: BTreeMap<Ticket, Result<Option<Line>>>,
    evaluations: Vec<Value>,
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
    /// The folders that `--plugins` and `--overlays` named.
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
            fatal: BTreeMap::new(),
            submitted: BTreeMap::new(),
            numbers: BTreeMap::new(),
            outcomes: BTreeMap::new(),
            evaluations: Vec::new(),
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

    /// Begins a search with a strategy: a component, which gets a session of one worker on this machine that it has to itself, or
    /// none.
    pub(crate) fn begin_search(
        &mut self,
        name: Option<&str>,
        strategy: Option<&ComponentSpec>,
    ) -> Result<BegunSearch> {
        self.refuse_part("pdk.search decides by outcomes what to drive next")?;
        let number = self.searches;
        self.searches += 1;
        let name = match (name, number) {
            (Some(name), _) => name.to_owned(),
            (None, 0) => "search".to_owned(),
            (None, _) => format!("search-{}", number + 1),
        };
        tables::checked_name(&Value::String(format!("{name}.json")))?;
        if let Some(strategy) = strategy {
            let catalog = self.session.catalog();
            catalog.check(Kind::Search, &strategy.name, &strategy.parameters)?;
            self.in_use.add(catalog, Kind::Search, &strategy.name, &strategy.parameters, Vec::new())?;
        }
        self.begin()?;
        let session = match strategy {
            None => None,
            Some(_) => Some(match self.strategist.take() {
                Some(session) => session,
                None => Session::start(Options {
                    run: format!("{}-search{number}", run_name(&self.pipeline.path)),
                    pool: Pool::Here(1),
                    limits: self.common.limits,
                    search: self.search.clone(),
                })?,
            }),
        };
        Ok(BegunSearch { name, number, seed: self.common.seed, slots: self.session.slots(), session })
    }

    /// Ends a search: its files go into the record, and its session is kept for the next one.
    pub(crate) fn end_search(
        &mut self,
        name: &str,
        found: &Value,
        table: &str,
        session: Option<Session>,
    ) -> Result<()> {
        self.strategist = session.or(self.strategist.take());
        if let Some(directory) = &self.directory {
            directory.write_json(&format!("{name}.json"), found)?;
            directory.write_text(&format!("{name}.csv"), table)?;
        }
        Ok(())
    }

    /// Says no where only a part of the run is wanted, because of `reason`.
    fn refuse_part(&self, reason: &str) -> Result<()> {
        match self.common.shard {
            None => Ok(()),
            Some(_) => Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "{reason}, so a part of it cannot be run alone; leave out --shard, and use --pool for several machines"
                ),
            )),
        }
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

    /// Submits scenarios, after making sure that their components can be made.
    pub(crate) fn submit(&mut self, submissions: Vec<Submission>) -> Result<Vec<Ticket>> {
        for Submission { scenario, .. } in &submissions {
            self.check(scenario)?;
        }
        self.begin()?;
        self.open_ledger()?;
        let mut tickets = Vec::with_capacity(submissions.len());
        for submission in submissions {
            // A simulator that cannot be made has no rate, and its scenarios no frames.
            let simulator = submission.scenario.simulator.clone();
            let rate =
                self.try_to_make(Kind::Simulator, &simulator)?.camera.map_or(0.0, |camera| camera.rate);
            let expected = expected_frames(&submission.scenario, rate);
            if self.outcomes.len() == self.submitted.len() {
                self.progress = progress(self.audience);
                (self.before, self.spared) = (self.session.frames(), 0);
            }
            let (id, count) = (submission.scenario.id(), self.numbers.len());
            let number = *self.numbers.entry(id).or_insert(count);
            let name = submission.name.clone();
            let (ticket, expected) = match self.common.shard.is_none_or(|shard| shard.has(number)) {
                true => (self.session.submit(submission), expected),
                false => (self.session.set_aside(), 0),
            };
            self.progress.add(expected);
            self.submitted.insert(ticket, Submitted { number, id, name, expected });
            tickets.push(ticket);
        }
        Ok(tickets)
    }

    /// Waits for an outcome.
    pub(crate) fn wait(&mut self, ticket: Ticket) -> Result<Value> {
        if !self.outcomes.contains_key(&ticket) {
            let (progress, before, spared) = (&self.progress, self.before, self.spared);
            let mut tick = |frames: u64| progress.set(frames - before + spared);
            let reply = self.session.wait(ticket, &mut tick);
            self.take(ticket, reply);
        }
        self.row(ticket)
    }

    /// An outcome that was taken, as scripts see it.
    fn row(&self, ticket: Ticket) -> Result<Value> {
        match (self.outcomes.get(&ticket), self.submitted.get(&ticket)) {
            (Some(Ok(Some(line))), Some(submitted)) => Ok(outcome_row(line, submitted)),
            (Some(Ok(None)), Some(submitted)) => Ok(row_of_elsewhere(submitted)),
            (Some(Err(error)), _) => Err(error.clone()),
            _ => Err(Error::new("nothing was submitted under this ticket")),
        }
    }

    /// Waits for the next of several outcomes, as they come; none where there is none left.
    pub(crate) fn next(&mut self, among: &BTreeSet<Ticket>) -> Result<Option<(Ticket, Result<Value>)>> {
        let taken = self.take_next(among)?;
        Ok(taken.map(|ticket| (ticket, self.row(ticket))))
    }

    /// Takes the next of several outcomes, as they come.
    fn take_next(&mut self, among: &BTreeSet<Ticket>) -> Result<Option<Ticket>> {
        let (progress, before, spared) = (&self.progress, self.before, self.spared);
        let mut tick = |frames: u64| progress.set(frames - before + spared);
        let Some((ticket, reply)) = self.session.next(among, &mut tick)? else { return Ok(None) };
        self.take(ticket, reply);
        Ok(Some(ticket))
    }

    fn take(&mut self, ticket: Ticket, reply: Result<Reply>) {
        let line = reply.and_then(|reply| match reply {
            Reply::Recorded(line, known) => {
                let driven = if known { 0 } else { line.outcome.frames };
                let submitted = self.submitted.get(&ticket);
                self.kept.extend(submitted.filter(|_| known).map(|submitted| submitted.number));
                let expected = submitted.map_or(0, |submitted| submitted.expected);
                self.spared += expected.saturating_sub(driven);
                Ok(Some(*line))
            }
            Reply::Elsewhere => Ok(None),
            _ => Err(Error::new("a scenario came to something else, which is a defect in pdk")),
        });
        self.outcomes.insert(ticket, line);
        if self.outcomes.len() == self.submitted.len() {
            self.progress.finish();
        }
    }

    /// `pdk.drive`: submits all, and waits for all.
    pub(crate) fn drive(&mut self, request: Value) -> Result<Value> {
        let submissions = self.defaults().drive(request)?;
        let tickets = self.submit(submissions)?;
        // All of them, also where one of them is an error: then nothing of this drive is still under way when the script goes on.
        let rows: Vec<Result<Value>> = tickets.into_iter().map(|ticket| self.wait(ticket)).collect();
        rows.into_iter().collect::<Result<_>>().map(Value::Array)
    }

    /// Frames a second of a simulator's camera.
    pub(crate) fn rate(&mut self, simulator: &ComponentSpec) -> Result<f64> {
        let made = self.try_to_make(Kind::Simulator, simulator)?;
        made.camera.map(|camera| camera.rate).ok_or_else(|| {
            Error::new(format!(
                "the simulator `{}` did not tell its camera, so a level cannot be a function of time",
                simulator.name
            ))
        })
    }

    /// What a component is like; each is made once.
    fn make(&mut self, kind: Kind, component: &ComponentSpec) -> Result<Made> {
        let key = (kind, serde_json::to_string(component)?);
        if let Some(made) = self.made.get(&key) {
            return Ok(made.clone());
        }
        let made = self.session.make(kind, component)?;
        self.made.insert(key, made.clone());
        Ok(made)
    }

    /// As [`make`](Self::make), for a scenario: a component that cannot be made is an error at once, but one that panics, takes its
    /// process along or does not come back is the outcome of each scenario that needs it.
    fn try_to_make(&mut self, kind: Kind, component: &ComponentSpec) -> Result<Made> {
        let key = (kind, serde_json::to_string(component)?);
        if self.fatal.contains_key(&key) {
            return Ok(Made::default());
        }
        match self.make(kind, component) {
            Err(error)
                if matches!(error.kind(), ErrorKind::Lost | ErrorKind::Late | ErrorKind::Panic)
                    && interrupt::wish() == Wish::None =>
            {
                self.fatal.insert(key, error);
                Ok(Made::default())
            }
            made => made,
        }
    }

    /// Makes sure that a scenario's components can be made, and notes them.
    fn check(&mut self, scenario: &Scenario) -> Result<()> {
        self.try_to_make(Kind::Simulator, &scenario.simulator)?;
        let info = self.try_to_make(Kind::Driver, &scenario.driver)?.info;
        for component in components(&scenario.perturbations) {
            self.try_to_make(Kind::Perturbation, &component)?;
        }
        self.in_use.add_scenario(self.session.catalog(), scenario, info)
    }

    /// `pdk.evaluate`: the offline loop.
    pub(crate) fn evaluate(&mut self, request: Value) -> Result<Value> {
        self.refuse_part("pdk.evaluate goes through the frames of a dataset one after the other")?;
        let Evaluate { dataset, driver, cells, frames } = Evaluate::from_json(request)?;
        let (reader, available) = self.open_dataset(&dataset)?;
        let info = self.make(Kind::Driver, &driver)?.info;
        for component in components(&cells) {
            self.make(Kind::Perturbation, &component)?;
        }
        let catalog = self.session.catalog();
        self.in_use.add(catalog, Kind::Dataset, &reader.name, &reader.parameters, Vec::new())?;
        self.in_use.add(catalog, Kind::Driver, &driver.name, &driver.parameters, info)?;
        self.in_use.add_perturbations(catalog, &cells)?;
        self.begin()?;
        let results = match &mut self.results {
            Some(results) => results,
            None => {
                let folder = self.directory.as_ref().map(RunDirectory::path).unwrap_or(Path::new(""));
                self.results.insert(Results::open(&folder.join(RESULTS))?)
            }
        };
        let frames = frames.unwrap_or(usize::MAX).min(available);
        let bar = Progress::new(self.audience, "{pos}/{len} frames, {eta} left");
        bar.add(frames as u64);
        let job = evaluation::Job {
            evaluation: Evaluation { dataset: reader, driver, perturbations: cells, seed: self.common.seed },
            frames,
            number: self.evaluations.len() as u64,
            workers: self.session.slots(),
            results,
            progress: &mut |done| bar.set(done),
        };
        let evaluated = evaluation::evaluate(&mut self.session, job);
        bar.finish();
        let (summary, performance) = evaluated?;
        for bad in &summary.bad_frames {
            self.warnings.push(format!("{} was left out: {}", bad.frame, bad.error));
        }
        let summary = serde_json::to_value(summary)?;
        self.evaluations.push(summary.clone());
        if performance.perturbed_frames > 0 {
            self.speed.push(format!(
                "{} perturbed frames in {:.1} s: {:.0} a second",
                performance.perturbed_frames, performance.wall_seconds, performance.frames_per_second
            ));
        }
        self.evaluation_times.push(serde_json::to_value(performance)?);
        Ok(summary)
    }

    /// The reader of a dataset, and how many frames it finds.
    fn open_dataset(&mut self, dataset: &DatasetSpec) -> Result<(ComponentSpec, usize)> {
        let frames = |made: Made| made.frames.unwrap_or_default();
        let path = match dataset {
            DatasetSpec::Reader(reader) => {
                return Ok((reader.clone(), frames(self.make(Kind::Dataset, reader)?)));
            }
            DatasetSpec::Path(path) => path,
        };
        let readers: Vec<String> = self
            .session
            .catalog()
            .of_kind(Kind::Dataset)
            .map(|entry| entry.description.name.clone())
            .collect();
        let mut reasons = Vec::new();
        for name in readers {
            let parameters = Map::from_iter([("path".to_owned(), Value::String(path.clone()))]);
            let reader = ComponentSpec { name, parameters };
            match self.make(Kind::Dataset, &reader) {
                Ok(made) => return Ok((reader, frames(made))),
                Err(error) => reasons.push(error.to_string()),
            }
        }
        Err(Error::new(match reasons.is_empty() {
            true => format!("cannot open the dataset {path}: no dataset reader is installed"),
            false => format!("cannot open the dataset {path}: {}", reasons.join("; ")),
        }))
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
            overlays: self.given.1.clone(),
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
            self.session.record(directory, ledger);
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

    /// Completes the record after the pipeline has come to its end, or to an error. Of several failures the first in this
    /// order is reported: that of the script, that of the record, those of scenarios, a setting that the pipeline does not
    /// have.
    pub fn finish(mut self, script: Result<()>) -> Finished {
        let rest = match script.is_ok() || interrupt::wish() == Wish::Finish {
            true => self.take_rest(),
            false => Ok(()),
        };
        self.progress.finish();
        let own = self.outcomes.iter().filter(|(_, outcome)| matches!(outcome, Ok(Some(_))));
        let rows: Vec<Value> = own.filter_map(|(ticket, _)| self.row(*ticket).ok()).collect();
        // A scenario that was asked for several times is one.
        let (all, failed) = (self.numbers.len(), self.failed());
        let summary = json!({ "outcomes": rows, "evaluations": self.evaluations });
        let whole = script.is_ok() && rest.is_ok();
        let written =
            self.complete(&summary).and_then(|()| if whole { self.complete_part() } else { Ok(()) });
        let mut troubles = self.unnoticed();
        for trouble in self.session.end() {
            if !troubles.contains(&trouble) {
                troubles.push(trouble);
            }
        }
        if !self.kept.is_empty() {
            self.speed
                .insert(0, format!("{} of {all} scenarios were in the record already", self.kept.len()));
        }
        let scenarios = failed.first().map(|first| {
            Error::new(format!(
                "{} of {all} scenarios could not be driven because a component failed; the first: {first}",
                failed.len(),
            ))
        });
        let trouble = troubles.first().map(|first| {
            Error::new(format!(
                "{first}; what was recorded is kept, but what was computed in the same process before may be wrong"
            ))
        });
        self.warnings.extend(troubles.into_iter().skip(1));
        let overrides = self.check_overrides().err();
        let failures = [script.err(), rest.err(), written.err(), scenarios, trouble, overrides];
        Finished {
            record: self.directory.as_ref().map(|directory| directory.path().to_owned()),
            summary,
            speed: self.speed,
            warnings: self.warnings,
            failure: failures.into_iter().flatten().next(),
        }
    }

    /// The scenarios in which a component failed, in the order of submission, each once.
    fn failed(&self) -> Vec<String> {
        let mut failed = BTreeMap::new();
        for (ticket, line) in &self.outcomes {
            if let (Ok(Some(line)), Some(Submitted { number, name, .. })) = (line, self.submitted.get(ticket))
                && line.outcome.cause == Cause::Error
                && let Some(error) = &line.outcome.error
            {
                failed.entry(*number).or_insert_with(|| format!("scenario {number} `{name}`: {error}"));
            }
        }
        failed.into_values().collect()
    }

    /// How components went wrong when they were made although a scenario went well with them, as one does that crashes only when it
    /// is dropped.
    fn unnoticed(&self) -> Vec<String> {
        let spec = |component: &ComponentSpec| serde_json::to_string(component).unwrap_or_default();
        let mut good = BTreeSet::new();
        let lines = self.outcomes.values().flatten().flatten();
        for line in lines.filter(|line| line.outcome.cause != Cause::Error) {
            good.insert((Kind::Simulator, spec(&line.scenario.simulator)));
            good.insert((Kind::Driver, spec(&line.scenario.driver)));
            let perturbations = components(&line.scenario.perturbations);
            good.extend(perturbations.iter().map(|component| (Kind::Perturbation, spec(component))));
        }
        let of_good = self.fatal.iter().filter(|(component, _)| good.contains(*component));
        of_good.map(|(_, error)| error.to_string()).collect()
    }

    /// Takes the outcomes that nobody has waited for: all where the script came to its end, and what was in flight where the user
    /// interrupted it. After an error of the script there is nobody who wants them.
    fn take_rest(&mut self) -> Result<()> {
        let rest: BTreeSet<Ticket> =
            self.submitted.keys().filter(|ticket| !self.outcomes.contains_key(ticket)).copied().collect();
        let mut result = Ok(());
        while let Some(ticket) = self.take_next(&rest)? {
            result = result.and(self.row(ticket).map(drop));
        }
        result
    }

    /// Notes in the record of a part which scenarios the whole run has, so that parts which went different ways are not put together.
    fn complete_part(&mut self) -> Result<()> {
        let (Some(directory), Some(shard)) = (&self.directory, self.common.shard) else { return Ok(()) };
        let mut all: Vec<(&usize, &ScenarioId)> =
            self.numbers.iter().map(|(id, number)| (number, id)).collect();
        all.sort_unstable();
        let scenarios: Vec<ScenarioId> = all.into_iter().map(|(_, id)| *id).collect();
        let own = (0..scenarios.len()).filter(|number| shard.has(*number)).count();
        self.speed.push(format!("part {shard} of the run: {own} of {} scenarios", scenarios.len()));
        directory.write_json(SHARD, &ShardList { shard, scenarios })
    }

    fn complete(&mut self, summary: &Value) -> Result<()> {
        let Some(directory) = &self.directory else { return Ok(()) };
        self.session.finish()?;
        directory.write_json(SUMMARY, summary)?;
        let total = self.session.performance();
        self.warnings.extend(total.noticed());
        let stages = total.times.summary();
        // The times of the process that drove are worth more than those of one that did not.
        if stages.steps == 0
            && self.evaluation_times.is_empty()
            && directory.path().join(PERFORMANCE).is_file()
        {
            return Ok(());
        }
        if stages.overruns > 0 {
            self.warnings.push(format!(
                "{} of {} steps in real time took longer than a frame lasts; {PERFORMANCE} has the times of the stages",
                stages.overruns, stages.steps
            ));
        }
        let drive = (stages.steps > 0).then(|| {
            let (wall, LoopTimes { steps, .. }) = (total.wall_seconds, &stages);
            let (rate, factor) = (*steps as f64 / wall, total.simulated_seconds / wall);
            self.speed.push(format!(
                "{steps} frames in {wall:.1} s: {rate:.0} a second, {factor:.1} times real time"
            ));
            json!({
                "workers": total.slots, "wall_seconds": wall, "frames_per_second": rate,
                "real_time_factor": factor, "stages": stages,
            })
        });
        let started = self.started.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs();
        let performance = json!({
            "started_unix_seconds": started, "drive": drive, "evaluations": self.evaluation_times,
        });
        directory.write_json(PERFORMANCE, &performance)
    }
}

/// A bar for frames on the road.
fn progress(audience: Audience) -> Progress {
    Progress::new(audience, "{pos}/{len} frames, {per_sec}, {eta} left")
}

/// What perturbations are made from.
fn components(applied: &[AppliedPerturbation]) -> Vec<ComponentSpec> {
    let component = |applied: &AppliedPerturbation| ComponentSpec {
        name: applied.name.clone(),
        parameters: applied.parameters.clone(),
    };
    applied.iter().map(component).collect()
}

/// What a pipeline and the summary see of an outcome.
fn outcome_row(line: &Line, submitted: &Submitted) -> Value {
    let outcome = &line.outcome;
    json!({
        "number": submitted.number,
        "id": line.id,
        "name": submitted.name,
        "success": outcome.success,
        "cause": outcome.cause,
        "verdict": outcome.cause.verdict(),
        "error": outcome.error,
        "time": outcome.time,
        "frames": outcome.frames,
        "skipped_frames": outcome.skipped_frames,
        "progress": outcome.progress,
        "mean_cross_track_error": outcome.mean_cross_track_error,
        "max_cross_track_error": outcome.max_cross_track_error,
        "measures": outcome.measures,
        "digest": outcome.digest,
    })
}

/// What a pipeline sees of a scenario that another part of the run drives: the fields of an outcome, which say nothing.
fn row_of_elsewhere(submitted: &Submitted) -> Value {
    let Submitted { number, id, name, .. } = submitted;
    json!({
        "number": number, "id": id, "name": name, "success": false, "cause": "elsewhere", "verdict": Verdict::Void,
        "error": null, "time": 0.0, "frames": 0, "skipped_frames": 0, "progress": 0.0,
        "mean_cross_track_error": 0.0, "max_cross_track_error": 0.0, "measures": null, "digest": "",
    })
}

/// The folders `runs/NAME-N`, one after the other.
fn folders(pipeline: &Path) -> impl Iterator<Item = PathBuf> {
    let name = pipeline.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    (1..).map(move |number: u64| Path::new(RUNS).join(format!("{name}-{number}")))
}
