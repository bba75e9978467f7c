//! Gives the scenarios of a suite to both drivers until the decision is clear.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::time::Instant;

use pdk_model::component::ComponentSpec;
use pdk_model::scenario::{Scenario, ScenarioId};
use pdk_pipeline::program::Program;
use pdk_pipeline::run::Options;
use pdk_record::directory::VERDICT;
use pdk_sdk::error::{Error, Result};
use pdk_session::session::{Submission, Ticket};
use serde::Serialize;
use serde_json::json;

use crate::came::{BlockOutcome, Came, Ending};
use crate::driven::driven_by;
use crate::judge::{Decision, Judge};
use crate::kept::Kept;
use crate::loaded::Loaded;
use crate::recording::Stretch;
use crate::role::Role;
use crate::side::Side;
use crate::step::{Step, steps};
use crate::verdict::{DriverRecord, Entry, SuiteRecord, Verdict, seen};

/// What a gate came to.
#[derive(Debug)]
pub struct Judged {
    /// The verdict.
    pub verdict: Verdict,
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
    let budget = steps(&loaded)
        .map(|step| step.map(|step| if step.is_pair() { 2 } else { 1 }))
        .sum::<Result<usize>>()?;
    for failure in &mut conduct.failures {
        if failure.record == Path::new("") {
            failure.record = finished.record.clone().unwrap_or_default();
        }
    }
    let mut speed = conduct.blocks.speed();
    speed.extend(finished.speed);
    Ok(Judged {
        drives: (verdict.entries.len(), budget),
        verdict,
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
    role: Role,
    scenario: Scenario,
    state: State,
}

/// A scenario of the suite that is under way.
struct UnderWay {
    step: Step,
    given: Vec<Given>,
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
    /// The file in the record, which is begun when it is first needed.
    fn kept(&mut self, program: &mut Program) -> Result<&mut Kept> {
        match &mut self.kept {
            Some(kept) => Ok(kept),
            empty => Ok(empty.insert(Kept::open(program.begin()?)?)),
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
        program.settings(json!({"suite": loaded.named(), "old": old.named, "new": new.named}))?;
        let catalog = program.catalog().clone();
        loaded.open(&catalog, &mut |dataset| program.recording(dataset))?;
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
            let Some(UnderWay { step, given }) = waiting.pop_front() else { break };
            self.look(program, loaded, &mut judge, sides, &step, given)?;
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
        waiting.extend(steps.into_iter().map(|step| UnderWay { step, given: Vec::new() }));
        for (role, side) in sides {
            for UnderWay { step, given } in waiting.range_mut(begin..) {
                if step.is_pair() || *role == Role::New {
                    given.push(self.give(program, loaded, (*role, side), step)?);
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
    ) -> Result<Given> {
        let mut scenario = driven_by(step, &side.driver, program.catalog())?;
        program.settle(&mut scenario);
        loaded.opened.note_content(&mut scenario);
        let id = scenario.id();
        let state = if let Some(came) = side.known.get(&id) {
            State::Known(Box::new(came.clone()))
        } else if let Some(stretch) = Stretch::of(&scenario) {
            match self.blocks.kept(program)?.get(&id) {
                Some(outcome) => State::Known(Box::new(Came::Block(outcome.clone()))),
                None => {
                    self.blocks.since.get_or_insert_with(Instant::now);
                    State::Evaluated(program.evaluate(stretch.job(&scenario))?)
                }
            }
        } else {
            let name = called(step, role);
            let submission = Submission { scenario: scenario.clone(), name, images_every: 0 };
            let ticket = program.submit(vec![submission])?.first().copied();
            State::Driven(
                ticket.ok_or_else(|| Error::new("a scenario got no ticket, which is a defect in pdk"))?,
            )
        };
        Ok(Given { role, scenario, state })
    }

    /// What came of a scenario, and whether it was known before.
    fn take(&mut self, program: &mut Program, step: &Step, given: &Given) -> Result<(Came, bool)> {
        Ok(match &given.state {
            State::Known(came) => ((**came).clone(), true),
            State::Driven(ticket) => (Came::Drive(Box::new(program.wait(*ticket)?.outcome.clone())), false),
            State::Evaluated(ticket) => {
                let frames = program.evaluated(*ticket)?;
                let stretch = Stretch::of(&given.scenario)
                    .ok_or_else(|| Error::new("a block lost its frames, which is a defect in pdk"))?;
                let outcome = BlockOutcome::of(&stretch, &frames)?;
                self.blocks.frames += outcome.frames;
                self.blocks.kept(program)?.add(&called(step, given.role), &given.scenario, &outcome)?;
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
        step: &Step,
        given: Vec<Given>,
    ) -> Result<()> {
        let mut entries: BTreeMap<Role, (Entry, Came)> = BTreeMap::new();
        let mut failed = None;
        for given in given {
            let role = given.role;
            let undecided = |reason: &str| {
                Error::new(format!(
                    "nothing can be decided, because a component failed in `{}` with the {} driver: {reason}",
                    step.title(),
                    role.text()
                ))
            };
            let (came, known) = self.take(program, step, &given).map_err(|error| {
                match matches!(given.state, State::Evaluated(_)) {
                    true => Error::of(error.kind(), undecided(error.message()).message()),
                    false => error,
                }
            })?;
            if let Some(reason) = came.error() {
                return Err(undecided(reason));
            }
            let Given { scenario, .. } = given;
            self.known += usize::from(known);
            self.drivers.entry(role).or_insert_with(|| (scenario.driver.clone(), files_of_driver(&scenario)));
            entries.insert(role, (Entry::new(loaded, step, role, scenario.id(), &came), came));
            if role == Role::New {
                failed = Some((scenario, known));
            }
        }
        let old = entries.get(&Role::Old).map(|(entry, _)| entry);
        let Some((new, came)) = entries.get(&Role::New) else {
            return Err(Error::new("the new driver did not drive, which is a defect in pdk"));
        };
        judge.look(step, seen(old, new));
        let passed = old.is_some_and(|old| !old.failed());
        if let (true, true, Some((scenario, known))) = (passed, new.failed(), failed) {
            let record = sides[1].1.record.clone().filter(|_| known).unwrap_or_default();
            self.failures.push(NewFailure {
                title: step.title(),
                id: new.id,
                cause: came.ending(),
                said: came.said(),
                record,
                clip: None,
                scenario,
            });
        }
        self.entries.extend(entries.into_values().map(|(entry, _)| entry));
        Ok(())
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
fn called(step: &Step, role: Role) -> String {
    format!("{}, {} driver", step.title(), role.text())
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
