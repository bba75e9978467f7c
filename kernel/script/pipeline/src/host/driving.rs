//! Scenarios: checked, submitted, and what came of them.

use std::collections::BTreeSet;

use pdk_loop::drive::expected_frames;
use pdk_loop::protocol::Made;
use pdk_model::component::ComponentSpec;
use pdk_model::outcome::Cause;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::Scenario;
use pdk_record::manifest::components_of;
use pdk_record::settle::Settler;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_session::interrupt::{self, Wish};
use pdk_session::session::{Reply, Submission, Ticket, WaitingSubmission};
use serde_json::Value;

use super::Host;
use super::scenarios::Came;
use crate::follow::Audience;
use crate::outcomes::{Submitted, outcome_row, row_of_elsewhere};

/// A scenario that can be submitted.
pub(crate) struct Prepared {
    waiting: WaitingSubmission,
    /// What is kept of it, but for its number.
    submitted: Submitted,
}

impl Host {
    /// Settles a scenario, and makes sure that its components can be made.
    pub(crate) fn prepare(&mut self, mut submission: Submission) -> Result<Prepared> {
        stop_if_dropped()?;
        let Submission { scenario, name, .. } = &mut submission;
        let was_named_after_itself = *name == scenario.default_name();
        self.settler().scenario(scenario);
        if was_named_after_itself {
            *name = scenario.default_name();
        }
        let simulator = self.check(scenario)?;
        // A simulator that cannot be made has no rate, and its scenarios no frames.
        let expected = expected_frames(scenario, simulator.camera.map_or(0.0, |camera| camera.rate));
        let unperturbed = scenario.perturbations.is_empty().then(|| scenario.driver.name.as_str().into());
        let fatal = self.components.fatal_of(scenario)?.into();
        let waiting = submission.waiting()?;
        let submitted = Submitted {
            number: 0,
            id: waiting.id,
            name: submission.name.into(),
            expected,
            unperturbed,
            fatal,
        };
        Ok(Prepared { waiting, submitted })
    }

    /// Submits scenarios.
    pub(crate) fn submit(&mut self, prepared: Vec<Prepared>) -> Result<Vec<Ticket>> {
        self.begin()?;
        self.record.open_ledger(&mut self.session, self.setup.common.keep_errors)?;
        let mut tickets = Vec::with_capacity(prepared.len());
        for Prepared { waiting, mut submitted } in prepared {
            stop_if_dropped()?;
            if self.scenarios.are_over() {
                self.frames.restart(self.setup.audience, self.session.frames());
            }
            submitted.number = self.scenarios.number(waiting.id);
            let ticket = match self.setup.common.shard.is_none_or(|shard| shard.has(submitted.number)) {
                true => self.session.submit(waiting),
                false => {
                    submitted.expected = 0;
                    self.session.set_aside()
                }
            };
            self.frames.expect(submitted.expected);
            self.scenarios.submitted.insert(ticket, submitted);
            tickets.push(ticket);
        }
        Ok(tickets)
    }

    /// Prepares a scenario and submits it.
    pub(crate) fn submit_one(&mut self, submission: Submission) -> Result<Ticket> {
        let prepared = self.prepare(submission)?;
        let none = || Error::new("a scenario got no ticket, which is a defect in pdk");
        self.submit(vec![prepared])?.pop().ok_or_else(none)
    }

    /// Settles what scenarios and evaluations leave to the machine.
    pub(super) fn settler(&mut self) -> Settler<'_> {
        Settler {
            catalog: self.session.catalog(),
            wanted: self.setup.common.wanted(),
            settled: &mut self.components.settled,
            contents: &mut self.components.contents,
        }
    }

    /// Waits for an outcome.
    pub(crate) fn wait(&mut self, ticket: Ticket) -> Result<Value> {
        if !self.scenarios.outcomes.contains_key(&ticket) {
            let record = self.record.directory.as_ref().map(|directory| directory.path());
            let reply = self.session.wait(ticket, &mut self.frames.tick(record, self.scenarios.count()));
            self.take(ticket, reply);
        }
        self.row(ticket)
    }

    /// Notes that the program which submitted a scenario got its outcome, so that its failure is not a failure of the run.
    pub(crate) fn hand_over(&mut self, ticket: Ticket) {
        self.scenarios.hand_over(ticket);
    }

    /// An outcome that was taken, as scripts see it.
    pub(super) fn row(&self, ticket: Ticket) -> Result<Value> {
        match (self.scenarios.outcomes.get(&ticket), self.scenarios.submitted.get(&ticket)) {
            (Some(Ok(Some(came))), Some(submitted)) => Ok(outcome_row(&came.outcome.read()?, submitted)),
            (Some(Ok(None)), Some(submitted)) => Ok(row_of_elsewhere(submitted)),
            (Some(Err(error)), _) => Err(error.clone()),
            _ => Err(Error::new("nothing was submitted under this ticket")),
        }
    }

    /// Waits for the next of several outcomes; none if all have been taken. If several are there already, the earliest submission comes
    /// first.
    pub(crate) fn next(&mut self, among: &BTreeSet<Ticket>) -> Result<Option<(Ticket, Result<Value>)>> {
        let taken = self.take_next(among)?;
        Ok(taken.map(|ticket| (ticket, self.row(ticket))))
    }

    /// Takes the next of several outcomes, as they come.
    pub(super) fn take_next(&mut self, among: &BTreeSet<Ticket>) -> Result<Option<Ticket>> {
        let record = self.record.directory.as_ref().map(|directory| directory.path());
        let mut tick = self.frames.tick(record, self.scenarios.count());
        let Some((ticket, reply)) = self.session.next(among, &mut tick)? else {
            return Ok(None);
        };
        drop(tick);
        self.take(ticket, reply);
        Ok(Some(ticket))
    }

    fn take(&mut self, ticket: Ticket, reply: Result<Reply>) {
        let line = reply.and_then(|reply| match reply {
            Reply::Recorded(written, known) => {
                let outcome = written.read()?;
                let driven = if known { 0 } else { outcome.frames };
                let submitted = self.scenarios.submitted.get(&ticket);
                self.scenarios.kept.extend(submitted.filter(|_| known).map(|submitted| submitted.number));
                let expected = submitted.map_or(0, |submitted| submitted.expected);
                self.frames.spare(expected, driven);
                let error = outcome.error.filter(|_| outcome.cause == Cause::Error);
                Ok(Some(Came { outcome: written, error }))
            }
            Reply::Elsewhere => Ok(None),
            _ => Err(Error::new("a scenario came to something else, which is a defect in pdk")),
        });
        self.scenarios.outcomes.insert(ticket, line);
        if self.scenarios.are_over() {
            self.frames.finish();
        }
    }

    /// Frames a second of a simulator's camera.
    pub(crate) fn rate(&mut self, simulator: &ComponentSpec) -> Result<f64> {
        let made = self.try_to_make(Kind::Simulator, simulator)?;
        made.camera.map(|camera| camera.rate).ok_or_else(|| {
            Error::new(format!(
                "the simulator `{}` did not describe its camera, so a level cannot be a function of time",
                simulator.name
            ))
        })
    }

    /// What a component is like; each is made once.
    pub(super) fn make(&mut self, kind: Kind, component: &ComponentSpec) -> Result<Made> {
        self.components.make(&mut self.session, kind, component)
    }

    /// As [`make`](Self::make), for a scenario.
    pub(crate) fn try_to_make(&mut self, kind: Kind, component: &ComponentSpec) -> Result<Made> {
        self.components.try_to_make(&mut self.session, kind, component)
    }

    /// Makes sure that a scenario's components can be made, and notes them. Returns what its simulator is like.
    fn check(&mut self, scenario: &Scenario) -> Result<Made> {
        let simulator = self.try_to_make(Kind::Simulator, &scenario.simulator)?;
        let info = self.try_to_make(Kind::Driver, &scenario.driver)?.info;
        for component in components(&scenario.perturbations) {
            self.try_to_make(Kind::Perturbation, &component)?;
        }
        self.check_levels(&scenario.perturbations)?;
        for (kind, component) in components_of(scenario) {
            self.note_files(kind, &component)?;
        }
        self.record.in_use.add_scenario(self.session.catalog(), scenario, info)?;
        Ok(simulator)
    }

    /// Makes sure that perturbations reach their levels on the scales that these are on.
    pub(super) fn check_levels(&self, applied: &[AppliedPerturbation]) -> Result<()> {
        applied.iter().try_for_each(|applied| self.session.catalog().level_scale(applied).map(drop))
    }

    /// Notes the files that a component reads, once.
    pub(super) fn note_files(&mut self, kind: Kind, component: &ComponentSpec) -> Result<()> {
        if !self.components.is_unread(kind, component)? {
            return Ok(());
        }
        let groups = self.session.input_files(kind, component)?;
        let bar = pdk_terminal::progress(
            self.setup.audience != Audience::Person,
            "{pos}/{len} files read, {eta} left",
        );
        let read = self.record.in_use.add_input_files(&groups, &mut |done, all| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
            match interrupt::wish() {
                Wish::None => Ok(()),
                Wish::Finish | Wish::Drop => Err(interrupt::error()),
            }
        });
        bar.finish_and_clear();
        read
    }
}

/// The error of a run that the user wants to end at once. Whatever goes through many scenarios asks at each.
pub fn stop_if_dropped() -> Result<()> {
    match interrupt::wish() {
        Wish::Drop => Err(interrupt::error()),
        Wish::Finish | Wish::None => Ok(()),
    }
}

/// What perturbations are made from.
pub(super) fn components(applied: &[AppliedPerturbation]) -> Vec<ComponentSpec> {
    let component = |applied: &AppliedPerturbation| ComponentSpec {
        name: applied.name.clone(),
        parameters: applied.parameters.clone(),
    };
    applied.iter().map(component).collect()
}
