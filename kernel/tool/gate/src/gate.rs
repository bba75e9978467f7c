//! Gives the scenarios of a suite to both drivers until the decision is clear.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::time::Instant;

use pdk_model::component::ComponentSpec;
use pdk_model::scenario::{Scenario, ScenarioId};
use pdk_pipeline::program::Program;
use pdk_pipeline::run::Options;
use pdk_record::directory::VERDICT;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_session::session::{Submission, Ticket};
use serde::Serialize;
use serde_json::json;

use crate::came::{BlockOutcome, Came, Ending};
use crate::driven::driven_by;
use crate::judge::{Decision, Judge};
use crate::kept::Kept;
use crate::loaded::Loaded;
use crate::repeats::{self, Drove};
use crate::role::Role;
use crate::side::Side;
use crate::step::{Step, steps};
use crate::stretch::Stretch;
use crate::suite::Undecided;
use crate::verdict::{DriverRecord, Entry, SuiteRecord, Verdict, seen};

/// What a gate came to.
#[derive(Debug)]
pub struct Judged {
    /// The verdict.
    pub verdict: Verdict,
    /// What the suite says of requirements that are neither shown to be met nor shown not to be met.
    pub undecided: Undecided,
    /// The scenarios that the new driver fails and the old one does not.
    pub failures: Vec<NewFailure>,
    /// How many drives or blocks were looked at, and how many the budget has.
    pub drives: (usize, usize),
    /// How many of them were in a record that was named.
    pub known: usize,
    /// The folder of the record; none if all was known.
    pub record: Option<PathBuf>,
    /// How fast it went, a line each.
    pub speed: Vec<String>,
    /// What did not go well, a sentence each.
    pub warnings: Vec<String>,
}

/// A scenario that the new driver fails and the old one does not.
#[derive(Debug, Clone, Serialize)]
pub struct NewFailure {
    /// What tables call it.
    pub title: String,
    /// The id of the new driver's scenario.
    pub id: ScenarioId,
    /// How it ended.
    pub cause: Ending,
    /// How it ended, in a clause with a number.
    pub said: String,
    /// The record that it is in.
    pub record: PathBuf,
    /// A clip of it, once one was made.
    pub clip: Option<PathBuf>,
    /// The scenario.
    #[serde(skip)]
    pub scenario: Scenario,
}

/// Decides whether the new driver passes a suite.
///
/// # Errors
/// If a driver or a component does not work, or the run was interrupted.
pub fn run(mut loaded: Loaded, named: [&str; 2], options: Options) -> Result<Judged> {
    let mut program = Program::start("pdk gate", loaded.text.clone(), options)?;
    let mut conduct = Conduct::default();
    let conducted = conduct.all(&mut program, &mut loaded, named);
    let (sides, decision, mut warnings) = match conducted {
        Ok(found) => found,
        Err(error) => {
            let finished = program.finish(Err(error));
            return Err(finished
                .failure
                .unwrap_or_else(|| Error::new("the gate came to nothing, which is a defect in pdk")));
        }
    };
    let verdict = conduct.verdict(&program, &loaded, &sides, decision);
    let written = match program.record() {
        Some(_) => program.save(VERDICT, &verdict),
        None => Ok(()),
    };
    let finished = program.finish(written);
    if let Some(failure) = finished.failure {
        return Err(failure);
    }
    warnings.extend(finished.warnings);
    for failure in &mut conduct.failures {
        if failure.record == Path::new("") {
            failure.record = finished.record.clone().unwrap_or_default();
        }
    }
    let mut speed = conduct.blocks.speed();
    speed.extend(finished.speed);
    Ok(Judged {
        drives: (verdict.entries.len(), conduct.budget),
        verdict,
        undecided: loaded.suite.test.undecided,
        failures: conduct.failures,
        known: conduct.known,
        record: finished.record,
        speed,
        warnings,
    })
}

/// What is known of a scenario that a driver was given.
enum State {
    Known(Box<Came>),
    Driven(Ticket),
    Evaluated(Ticket),
}

/// A scenario that a driver was given.
struct Given {
    scenario: Scenario,
    state: State,
}

/// A scenario of the suite that is under way.
struct UnderWay {
    step: Step,
    /// How often each driver drives it at most.
    most: u64,
    /// The drives of the old and of the new driver, which may be repeated.
    given: BTreeMap<Role, Vec<Given>>,
}

/// What came of all drives of a scenario by one driver.
struct Driven {
    entries: Vec<Entry>,
    /// The last one of those that ended as most did, with its scenario.
    telling: Option<(Came, Scenario)>,
}

/// Blocks of recordings in the record.
#[derive(Default)]
struct Blocks {
    kept: Option<Kept>,
    /// Frames that drivers decided on, and since when.
    frames: usize,
    since: Option<Instant>,
}

impl Blocks {
    /// The file in the folder of the record.
    fn kept(&mut self, record: &Path) -> Result<&mut Kept> {
        match &mut self.kept {
            Some(kept) => Ok(kept),
            empty => Ok(empty.insert(Kept::open(record)?)),
        }
    }

    fn speed(&self) -> Vec<String> {
        let Some(since) = self.since.filter(|_| self.frames > 0) else { return Vec::new() };
        let seconds = since.elapsed().as_secs_f64();
        vec![format!(
            "{} frames in {seconds:.1} s: {:.0} a second",
            self.frames,
            self.frames as f64 / seconds
        )]
    }
}

#[derive(Default)]
struct Conduct {
    entries: Vec<Entry>,
    failures: Vec<NewFailure>,
    /// How many drives or blocks all scenarios take, each once.
    budget: usize,
    /// How many outcomes were known before.
    known: usize,
    blocks: Blocks,
    /// Each driver as scenarios have it, with its files.
    drivers: BTreeMap<Role, (ComponentSpec, BTreeMap<String, String>)>,
}

type Found = ([(Role, Side); 2], Decision, Vec<String>);

impl Conduct {
    fn all(&mut self, program: &mut Program, loaded: &mut Loaded, named: [&str; 2]) -> Result<Found> {
        let (old, mut told) = Side::find(named[0], program.session())?;
        let (new, more) = Side::find(named[1], program.session())?;
        told.extend(more);
        for side in [&old, &new] {
            program.check(Kind::Driver, &side.driver)?;
        }
        program.settings(json!({"suite": loaded.named(), "old": old.named, "new": new.named}))?;
        let catalog = program.catalog().clone();
        for text in &loaded.suite.perturbations {
            for applied in loaded.suite.levels_of(text)? {
                catalog.level_scale(&applied)?;
            }
        }
        loaded.open(&catalog, &mut |dataset| program.recording(dataset))?;
        // A scenario that cannot be drawn is reported before the first drive, and not in the place of a verdict.
        self.budget = steps(loaded)
            .map(|step| step.map(|step| if step.is_pair() { 2 } else { 1 }))
            .sum::<Result<usize>>()?;
        let sides = [(Role::Old, old), (Role::New, new)];
        let decision = self.decide(program, loaded, &sides)?;
        Ok((sides, decision, told))
    }

    /// Looks at scenarios in their order, while later ones are under way. What is submitted depends on what was looked at alone, so
    /// the record is the same on any number of workers.
    fn decide(
        &mut self,
        program: &mut Program,
        loaded: &Loaded,
        sides: &[(Role, Side); 2],
    ) -> Result<Decision> {
        let mut judge = Judge::new(loaded);
        let mut waiting: VecDeque<UnderWay> = VecDeque::new();
        let mut steps = steps(loaded);
        let ahead = loaded.suite.test.ahead;
        // A worker keeps a driver and a recording from one block to the next, so blocks of one driver are submitted together.
        let together = if loaded.suite.is_recorded() { ahead } else { 1 };
        loop {
            while waiting.len() + together <= ahead {
                let next: Vec<Step> = steps.by_ref().take(together).collect::<Result<_>>()?;
                if next.is_empty() {
                    break;
                }
                self.submit(program, loaded, sides, next, &mut waiting)?;
            }
            let Some(under_way) = waiting.pop_front() else { break };
            self.look(program, loaded, &mut judge, sides, under_way)?;
            if judge.is_over() {
                break;
            }
        }
        Ok(judge.decide())
    }

    /// Gives scenarios to the old driver and then to the new one.
    fn submit(
        &mut self,
        program: &mut Program,
        loaded: &Loaded,
        sides: &[(Role, Side); 2],
        steps: Vec<Step>,
        waiting: &mut VecDeque<UnderWay>,
    ) -> Result<()> {
        let begin = waiting.len();
        for step in steps {
            let most = repeats::most(&loaded.suite, &step.scenario, program.catalog())?;
            waiting.push_back(UnderWay { step, most, given: BTreeMap::new() });
        }
        for (role, side) in sides {
            for UnderWay { step, most, given } in waiting.range_mut(begin..) {
                for repeat in 0..Drove::at_first(*most) {
                    if step.is_pair() || *role == Role::New {
                        let new = self.give(program, loaded, (*role, side), step, repeat)?;
                        given.entry(*role).or_default().push(new);
                    }
                }
            }
        }
        Ok(())
    }

    fn give(
        &mut self,
        program: &mut Program,
        loaded: &Loaded,
        (role, side): (Role, &Side),
        step: &Step,
        repeat: u64,
    ) -> Result<Given> {
        let mut scenario = driven_by(step, (&side.driver, repeat), program.catalog())?;
        program.settle(&mut scenario);
        loaded.opened.note_content(&mut scenario);
        let id = scenario.id();
        let state = if let Some(came) = side.known.get(&id) {
            State::Known(Box::new(came.clone()))
        } else if let Some(stretch) = Stretch::of(&scenario) {
            let job = stretch.job(&scenario);
            match self.blocks.kept(program.use_for(&job)?)?.get(&id) {
                Some(outcome) => State::Known(Box::new(Came::Block(outcome.clone()))),
                None => {
                    self.blocks.since.get_or_insert_with(Instant::now);
                    State::Evaluated(program.evaluate(job))
                }
            }
        } else {
            let name = called(step, role, repeat);
            let submission = Submission { scenario: scenario.clone(), name, images_every: 0 };
            State::Driven(program.submit(submission)?)
        };
        Ok(Given { scenario, state })
    }

    /// What came of a scenario, and whether it was known before.
    fn take(
        &mut self,
        program: &mut Program,
        step: &Step,
        role: Role,
        given: &Given,
    ) -> Result<(Came, bool)> {
        Ok(match &given.state {
            State::Known(came) => ((**came).clone(), true),
            State::Driven(ticket) => (Came::Drive(Box::new(program.wait(*ticket)?)), false),
            State::Evaluated(ticket) => {
                let frames = program.evaluated(*ticket)?;
                let stretch = Stretch::of(&given.scenario)
                    .ok_or_else(|| Error::new("a block lost its frames, which is a defect in pdk"))?;
                let outcome = BlockOutcome::of(&stretch, &frames)?;
                self.blocks.frames += outcome.frames;
                if let Some(kept) = &mut self.blocks.kept {
                    kept.add(&called(step, role, 0), &given.scenario, &outcome)?;
                }
                (Came::Block(outcome), false)
            }
        })
    }

    fn look(
        &mut self,
        program: &mut Program,
        loaded: &Loaded,
        judge: &mut Judge,
        sides: &[(Role, Side); 2],
        mut under_way: UnderWay,
    ) -> Result<()> {
        let mut all: BTreeMap<Role, Driven> = BTreeMap::new();
        for (role, side) in sides {
            if let Some(given) = under_way.given.remove(role) {
                let UnderWay { step, most, .. } = &under_way;
                all.insert(*role, self.drives(program, loaded, (*role, side), (step, *most), given)?);
            }
        }
        let step = &under_way.step;
        let old = all.remove(&Role::Old).map(|driven| driven.entries);
        let Some(Driven { entries: new, telling }) = all.remove(&Role::New) else {
            return Err(Error::new("the new driver did not drive, which is a defect in pdk"));
        };
        let seen = seen(old.as_deref(), &new);
        let passed = seen.old.as_ref().is_some_and(|old| !old.has_failed());
        if let (true, true, Some((came, scenario))) = (passed, seen.new.has_failed(), telling) {
            let (id, new) = (scenario.id(), &sides[1].1);
            // What this gate's own record has may have been known before, too.
            let record = new.record.clone().filter(|_| new.known.contains_key(&id)).unwrap_or_default();
            self.failures.push(NewFailure {
                title: step.title(),
                id,
                cause: came.ending(),
                said: came.said(),
                record,
                clip: None,
                scenario,
            });
        }
        judge.look(step, &seen);
        self.entries.extend(old.into_iter().flatten().chain(new));
        Ok(())
    }

    /// Takes what came of a scenario that a driver was given, and repeats it until its verdict is stable.
    fn drives(
        &mut self,
        program: &mut Program,
        loaded: &Loaded,
        (role, side): (Role, &Side),
        (step, most): (&Step, u64),
        mut given: Vec<Given>,
    ) -> Result<Driven> {
        let mut driven = Driven { entries: Vec::new(), telling: None };
        let mut drove = Drove::default();
        let mut came_of: Vec<(Came, Scenario)> = Vec::new();
        loop {
            for Given { scenario, state } in given.drain(..) {
                let (came, known) =
                    self.came(program, step, role, &Given { scenario: scenario.clone(), state })?;
                self.known += usize::from(known);
                self.drivers
                    .entry(role)
                    .or_insert_with(|| (scenario.driver.clone(), files_of_driver(&scenario)));
                let repeat = driven.entries.len() as u64;
                let entry = Entry::new(loaded, step, (role, repeat), scenario.id(), &came);
                drove.0.push(entry.failed());
                driven.entries.push(entry);
                came_of.push((came, scenario));
            }
            if drove.is_over(most) {
                break;
            }
            given.push(self.give(program, loaded, (role, side), step, drove.0.len() as u64)?);
        }
        let as_most = |(came, _): &(Came, Scenario)| came.ending().failed() == drove.has_failed();
        driven.telling = came_of.into_iter().rfind(as_most);
        Ok(driven)
    }

    /// What came of a scenario, and whether it was known before.
    ///
    /// # Errors
    /// If a component failed: then nothing can be decided.
    fn came(
        &mut self,
        program: &mut Program,
        step: &Step,
        role: Role,
        given: &Given,
    ) -> Result<(Came, bool)> {
        let undecided = |reason: &str| {
            format!(
                "nothing can be decided, because a component failed in `{}` with the {} driver: {reason}",
                step.title(),
                role.text()
            )
        };
        let (came, known) = self.take(program, step, role, given).map_err(|error| match given.state {
            State::Evaluated(_) => Error::of(error.kind(), undecided(error.message())),
            State::Known(_) | State::Driven(_) => error,
        })?;
        match came.error() {
            Some(reason) => Err(Error::new(undecided(reason))),
            None => Ok((came, known)),
        }
    }

    fn verdict(
        &mut self,
        program: &Program,
        loaded: &Loaded,
        sides: &[(Role, Side); 2],
        decision: Decision,
    ) -> Verdict {
        let used = program.used();
        let mut components = used.components;
        for (_, side) in sides {
            components.extend(side.components.iter().cloned());
        }
        components.sort();
        components.dedup();
        let mut settled = used.settled;
        settled.sort();
        let driver = |place: usize| {
            let (role, side) = &sides[place];
            let unused = || (side.driver.clone(), BTreeMap::new());
            let (component, files) = self.drivers.get(role).cloned().unwrap_or_else(unused);
            DriverRecord { named: side.named.clone(), component, files }
        };
        let suite = &loaded.suite;
        Verdict {
            format: 0,
            pdk: env!("CARGO_PKG_VERSION").to_owned(),
            suite: SuiteRecord {
                name: suite.name.clone(),
                version: suite.version,
                named: loaded.named(),
                blake3: loaded.hash.clone(),
            },
            old: driver(0),
            new: driver(1),
            recordings: loaded.opened.recordings.clone(),
            settled,
            components,
            decision,
            entries: std::mem::take(&mut self.entries),
            root: String::new(),
        }
        .sealed()
    }
}

/// What the record calls a scenario with a driver.
fn called(step: &Step, role: Role, repeat: u64) -> String {
    let again = if repeat > 0 { format!(", repeat {}", repeat + 1) } else { String::new() };
    format!("{}, {} driver{again}", step.title(), role.text())
}

/// The files of a scenario that are its driver's.
fn files_of_driver(scenario: &Scenario) -> BTreeMap<String, String> {
    let driver = &scenario.driver;
    let names = |text: &str| {
        driver.name == text || driver.parameters.values().any(|value| value.as_str() == Some(text))
    };
    scenario
        .files
        .iter()
        .filter(|(text, _)| names(text))
        .map(|(text, hash)| (text.clone(), hash.clone()))
        .collect()
}
