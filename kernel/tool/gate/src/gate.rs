//! Drives the scenarios of a suite with both drivers until the decision is clear.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pdk_components::catalog::Catalog;
use pdk_model::component::ComponentSpec;
use pdk_model::outcome::{Cause, Outcome};
use pdk_model::scenario::{Mode, Scenario, ScenarioId};
use pdk_pipeline::program::Program;
use pdk_pipeline::run::Options;
use pdk_record::directory::VERDICT;
use pdk_record::ledger::Line;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_session::session::{Submission, Ticket};
use serde::Serialize;
use serde_json::json;

use crate::judge::{Decision, Judge};
use crate::loaded::Loaded;
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
    /// How many drives were looked at, and how many the budget has.
    pub drives: (usize, usize),
    /// How many drives were in a record that was named.
    pub known: usize,
    /// The folder of the record; none if all drives were known.
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
    pub cause: Cause,
    /// When, in seconds.
    pub time: f64,
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
pub fn run(loaded: &Loaded, named: [&str; 2], options: Options) -> Result<Judged> {
    let mut program = Program::start("pdk gate", loaded.text.clone(), options)?;
    let mut conduct =
        Conduct { loaded, entries: Vec::new(), failures: Vec::new(), known: 0, drivers: BTreeMap::new() };
    let conducted = conduct.all(&mut program, named);
    let (sides, decision, mut warnings) = match conducted {
        Ok(found) => found,
        Err(error) => {
            let finished = program.finish(Err(error));
            return Err(finished
                .failure
                .unwrap_or_else(|| Error::new("the gate came to nothing, which is a defect in pdk")));
        }
    };
    let verdict = conduct.verdict(&program, &sides, decision);
    let written = match program.record() {
        Some(_) => program.save(VERDICT, &verdict),
        None => Ok(()),
    };
    let finished = program.finish(written);
    if let Some(failure) = finished.failure {
        return Err(failure);
    }
    warnings.extend(finished.warnings);
    let budget = steps(loaded)
        .map(|step| step.map(|step| if step.is_pair() { 2 } else { 1 }))
        .sum::<Result<usize>>()?;
    for failure in &mut conduct.failures {
        if failure.record == Path::new("") {
            failure.record = finished.record.clone().unwrap_or_default();
        }
    }
    Ok(Judged {
        drives: (verdict.entries.len(), budget),
        verdict,
        failures: conduct.failures,
        known: conduct.known,
        record: finished.record,
        speed: finished.speed,
        warnings,
    })
}

/// The scenario of a step with a driver in it.
///
/// # Errors
/// If there is no such simulator.
pub fn driven_by(step: &Step, driver: &ComponentSpec, catalog: &Catalog) -> Result<Scenario> {
    let mut scenario = step.scenario.clone();
    scenario.driver = driver.clone();
    // A simulator with its own clock does not wait.
    if !catalog.get(Kind::Simulator, &scenario.simulator.name)?.description.clock.is_stepped() {
        scenario.mode = Mode::Realtime;
    }
    Ok(scenario)
}

/// What is known of a drive.
enum Drive {
    Known(Box<Line>),
    Submitted(Ticket),
}

/// A scenario of the suite that is being driven.
struct UnderWay {
    step: Step,
    drives: Vec<(Role, Drive)>,
}

struct Conduct<'a> {
    loaded: &'a Loaded,
    entries: Vec<Entry>,
    failures: Vec<NewFailure>,
    /// How many drives were known before.
    known: usize,
    /// Each driver as scenarios have it, with its files.
    drivers: BTreeMap<Role, (ComponentSpec, BTreeMap<String, String>)>,
}

type Found = ([(Role, Side); 2], Decision, Vec<String>);

impl Conduct<'_> {
    fn all(&mut self, program: &mut Program, named: [&str; 2]) -> Result<Found> {
        let (old, mut told) = Side::find(named[0], program.session())?;
        let (new, more) = Side::find(named[1], program.session())?;
        told.extend(more);
        program.settings(json!({"suite": self.loaded.named(), "old": old.named, "new": new.named}))?;
        let sides = [(Role::Old, old), (Role::New, new)];
        let decision = self.decide(program, &sides)?;
        Ok((sides, decision, told))
    }

    /// Looks at scenarios in their order, while later ones are being driven. What is submitted depends on what was looked at alone, so
    /// the record is the same on any number of workers.
    fn decide(&mut self, program: &mut Program, sides: &[(Role, Side); 2]) -> Result<Decision> {
        let loaded = self.loaded;
        let mut judge = Judge::new(&loaded.suite);
        let mut waiting: VecDeque<UnderWay> = VecDeque::new();
        let mut steps = steps(loaded);
        loop {
            while waiting.len() < loaded.suite.test.ahead
                && let Some(step) = steps.next()
            {
                waiting.push_back(self.submit(program, sides, step?)?);
            }
            let Some(UnderWay { step, drives }) = waiting.pop_front() else { break };
            self.look(program, &mut judge, sides, &step, drives)?;
            if judge.is_over() {
                break;
            }
        }
        Ok(judge.decide())
    }

    fn submit(&mut self, program: &mut Program, sides: &[(Role, Side); 2], step: Step) -> Result<UnderWay> {
        let mut drives = Vec::new();
        for (role, side) in sides.iter().filter(|(role, _)| step.is_pair() || *role == Role::New) {
            let mut scenario = driven_by(&step, &side.driver, program.catalog())?;
            program.settle(&mut scenario);
            let drive =
                match side.known.get(&scenario.id()) {
                    Some(line) => Drive::Known(Box::new(line.clone())),
                    None => {
                        let name = format!("{}, {} driver", step.title(), role.text());
                        let tickets = program.submit(vec![Submission { scenario, name, images_every: 0 }])?;
                        let ticket = tickets.first().copied();
                        Drive::Submitted(ticket.ok_or_else(|| {
                            Error::new("a scenario got no ticket, which is a defect in pdk")
                        })?)
                    }
                };
            drives.push((*role, drive));
        }
        Ok(UnderWay { step, drives })
    }

    fn look(
        &mut self,
        program: &mut Program,
        judge: &mut Judge,
        sides: &[(Role, Side); 2],
        step: &Step,
        drives: Vec<(Role, Drive)>,
    ) -> Result<()> {
        let mut entries: BTreeMap<Role, (Entry, Outcome)> = BTreeMap::new();
        let mut failed = None;
        for (role, drive) in drives {
            let (line, known) = match drive {
                Drive::Known(line) => (Arc::new(*line), true),
                Drive::Submitted(ticket) => (program.wait(ticket)?, false),
            };
            let Line { id, scenario, outcome, .. } = &*line;
            if outcome.cause == Cause::Error {
                let reason = outcome.error.clone().unwrap_or_default();
                return Err(Error::new(format!(
                    "nothing can be decided, because a component failed in `{}` with the {} driver: {reason}",
                    step.title(),
                    role.text()
                )));
            }
            self.known += usize::from(known);
            self.drivers.entry(role).or_insert_with(|| (scenario.driver.clone(), files_of_driver(scenario)));
            entries.insert(role, (Entry::new(self.loaded, step, role, *id, outcome), outcome.clone()));
            if role == Role::New {
                failed = Some((scenario.clone(), known));
            }
        }
        let old = entries.get(&Role::Old).map(|(entry, _)| entry);
        let Some((new, outcome)) = entries.get(&Role::New) else {
            return Err(Error::new("the new driver did not drive, which is a defect in pdk"));
        };
        judge.look(step, seen(old, new));
        let passed = old.is_some_and(|old| !old.failed());
        if let (true, true, Some((scenario, known))) = (passed, new.failed(), failed) {
            let record = sides[1].1.record.clone().filter(|_| known).unwrap_or_default();
            self.failures.push(NewFailure {
                title: step.title(),
                id: new.id,
                cause: outcome.cause,
                time: outcome.time,
                record,
                clip: None,
                scenario,
            });
        }
        self.entries.extend(entries.into_values().map(|(entry, _)| entry));
        Ok(())
    }

    fn verdict(&mut self, program: &Program, sides: &[(Role, Side); 2], decision: Decision) -> Verdict {
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
        let suite = &self.loaded.suite;
        Verdict {
            format: 0,
            pdk: env!("CARGO_PKG_VERSION").to_owned(),
            suite: SuiteRecord {
                name: suite.name.clone(),
                version: suite.version,
                named: self.loaded.named(),
                blake3: self.loaded.hash.clone(),
            },
            old: driver(0),
            new: driver(1),
            settled,
            components,
            decision,
            entries: std::mem::take(&mut self.entries),
            root: String::new(),
        }
        .sealed()
    }
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
