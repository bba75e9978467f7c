//! The session's thread: gives jobs to workers, writes the ledger, and answers.

mod answers;
mod book;
mod ending;
mod jobs;
mod tally;
mod workers;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use pdk_model::component::ComponentSpec;
use pdk_model::outcome::Outcome;
use pdk_model::scenario::ScenarioId;
use pdk_sdk::describe::Parameter;
use pdk_sdk::error::{Error, Result};

use self::book::Book;
use self::jobs::{Jobs, Task};
pub use self::tally::Shared;
use self::tally::Tally;
use self::workers::Workers;
use crate::connection::{Connection, Pool};
use crate::interrupt::{self, Wish};
use crate::submission::{Event, Options, Reply, Request, Ticket, WaitingSubmission};
use pdk_loop::protocol::{Answer, Drive, Driven, Job, Ready, Work};
use pdk_loop::recorder::write_trace;

/// How often the session looks up where nothing happens.
const TICK: Duration = Duration::from_millis(50);
/// The most further events between two syncs of the ledger.
const MOST_TOGETHER: usize = 64;

/// What the session's thread owns.
pub struct Dispatch {
    options: Options,
    workers: Workers,
    jobs: Jobs,
    book: Book,
    tally: Tally,
    answers: Sender<(Ticket, Result<Reply>)>,
    /// Answers that wait until the lines of which they speak are on the disk.
    unsent: Vec<(Ticket, Result<Reply>)>,
    /// Whether no more requests come.
    closed: bool,
    /// Why nothing more can be done.
    broken: Option<Error>,
}

impl Dispatch {
    /// A dispatch that hears its workers through `sender`.
    pub fn new(
        options: Options,
        sender: Sender<Event>,
        answers: Sender<(Ticket, Result<Reply>)>,
        shared: Arc<Shared>,
    ) -> Self {
        Self {
            workers: Workers::new(&options, sender),
            jobs: Jobs::default(),
            book: Book::default(),
            tally: Tally::new(shared),
            options,
            answers,
            unsent: Vec::new(),
            closed: false,
            broken: None,
        }
    }

    /// Works until nothing is wanted any more; `introduce` is called with what the first worker has.
    pub fn serve(mut self, events: &Receiver<Event>, introduce: &Sender<Result<Ready>>) {
        let mut introduce = Some(introduce);
        // What runs left in shared memory that were killed with all of their workers. What cannot be removed does no harm.
        let _ = pdk_bus::sweep();
        if let Err(error) = self.workers.connect() {
            self.fail(error, &mut introduce);
        }
        let mut announced = Wish::None;
        loop {
            match events.recv_timeout(TICK) {
                Ok(event) => self.take(event, &mut introduce),
                Err(RecvTimeoutError::Disconnected) => self.closed = true,
                Err(RecvTimeoutError::Timeout) => {}
            }
            // What has come by then is recorded together, since a disk takes its time for each sync.
            let (began, mut others) = (Instant::now(), events.try_iter().take(MOST_TOGETHER));
            while !self.closed && began.elapsed() < TICK {
                let Some(event) = others.next() else { break };
                self.take(event, &mut introduce);
            }
            if self.closed {
                self.send(&mut introduce);
                break;
            }
            let wish = interrupt::wish();
            if wish > announced {
                announced = wish;
                self.interrupted(wish, &mut introduce);
            }
            if announced == Wish::Finish {
                self.stop_waiting();
            }
            if let Err(error) = self.look_for_silent() {
                self.fail(error, &mut introduce);
            }
            if announced == Wish::None
                && let Err(error) = self.give()
            {
                self.fail(error, &mut introduce);
            }
            self.tally.measure(self.workers.busy());
            self.send(&mut introduce);
        }
        self.leave(events);
    }

    fn take(&mut self, event: Event, introduce: &mut Option<&Sender<Result<Ready>>>) {
        match event {
            Event::Close => self.closed = true,
            Event::Submit(ticket, request) => self.submit(ticket, request),
            Event::Record(record) => self.book.record = Some(record),
            Event::Finish(done) => {
                self.send(introduce);
                // The requester may be gone.
                let _ = done.send(self.book.finish());
            }
            Event::Worker(connection, found) => {
                if let Err(error) = self.hear(connection, *found, introduce) {
                    self.fail(error, introduce);
                }
            }
        }
    }

    fn submit(&mut self, ticket: Ticket, request: Request) {
        if let Some(error) = &self.broken {
            return self.answer(ticket, Err(error.clone()));
        }
        if interrupt::wish() != Wish::None {
            return self.answer(ticket, Err(interrupt::error()));
        }
        let (simulator, task) = match request {
            Request::Work(work) => {
                let simulator = match &*work {
                    Work::Drive(drive) => Some(drive.scenario.simulator.clone()),
                    _ => None,
                };
                (simulator, Task::new(Some(work), None, ticket))
            }
            Request::Submission(submission) => match self.admit(ticket, &submission) {
                Ok(Some(simulator)) => (Some(simulator), Task::new(None, Some(submission), ticket)),
                Ok(None) => return,
                Err(error) => return self.answer(ticket, Err(error)),
            },
        };
        let external =
            simulator.and_then(|simulator| Some((self.workers.external.get(&simulator.name)?, simulator)));
        let first_only = self.options.pool == Pool::Usual
            && external.as_ref().is_some_and(|(by, simulator)| !by.is_empty() && !is_launched(simulator, by));
        self.jobs.add(Task { external: external.is_some(), first_only, ..task });
    }

    /// The simulator of a scenario that is to be driven; none if the scenario is in the ledger, or being driven.
    fn admit(&mut self, ticket: Ticket, submission: &WaitingSubmission) -> Result<Option<ComponentSpec>> {
        if let Some(task) = self.jobs.of_scenario(&submission.id) {
            task.waiting.push(ticket);
            return Ok(None);
        }
        if let Some((outcome, before)) = self.book.look_up(&submission.id)? {
            self.answer(ticket, Ok(Reply::Recorded(outcome, before)));
            return Ok(None);
        }
        Ok(Some(submission.read()?.scenario.simulator))
    }

    /// Gives what waits to slots that have nothing to do, and starts workers while there are too few.
    fn give(&mut self) -> Result<()> {
        let mut at = 0;
        while let Some(number) = self.jobs.queue.get(at).copied() {
            let Some(task) = self.jobs.tasks.get_mut(&number) else {
                self.jobs.queue.remove(at);
                continue;
            };
            let first_only = task.first_only;
            if let Some(error) = self.workers.out.get(&0).filter(|_| first_only) {
                return Err(error.clone());
            }
            let may = |connection: &&Connection| {
                !connection.is_out() && (!first_only || connection.first_slot == 0)
            };
            let free = self
                .workers
                .connections
                .iter()
                .enumerate()
                .filter(|(_, connection)| may(connection))
                .find_map(|(c, connection)| Some((c, connection.free_slot()?)));
            let Some((place, slot)) = free else {
                let there = self.workers.connections.iter().filter(may).count();
                let starting =
                    self.workers.connections.iter().filter(|connection| connection.slots.is_none()).count();
                let most = if first_only { 1 } else { self.workers.most() };
                if starting < self.jobs.queue.len() && there < most {
                    self.workers.connect()?;
                } else if first_only {
                    // Behind it there may be one for the others.
                    at += 1;
                } else {
                    return Ok(());
                }
                continue;
            };
            self.jobs.queue.remove(at);
            task.tries += 1;
            task.began = false;
            (task.given, task.heard) = (Instant::now(), Instant::now());
            if let (None, Some(submission)) = (&task.work, &task.submission) {
                task.work = Some(Box::new(Work::Drive(Box::new(self.book.drive(submission)?))));
            }
            let Some(work) = task.work.clone() else {
                return Err(Error::new("there is nothing to do for a job, which is a defect in pdk"));
            };
            let scenario = match (&task.submission, &*work) {
                (Some(submission), _) => Some(submission.id),
                (None, Work::Drive(drive)) => Some(drive.scenario.id()),
                _ => None,
            };
            let connection = &mut self.workers.connections[place];
            let job = Job {
                number,
                slot: connection.first_slot + slot as u32,
                scenario,
                moved: false,
                work: *work,
            };
            connection.give(slot, &job, &self.options.pool)?;
        }
        Ok(())
    }

    /// A worker has done a job: what came of it is recorded.
    ///
    /// # Errors
    /// If it cannot be recorded: then nothing that comes can.
    fn done(&mut self, number: u64, answer: Answer) -> Result<()> {
        let Some(task) = self.jobs.tasks.get(&number) else { return Ok(()) };
        match answer {
            Answer::Driven(driven) => {
                self.tally.add(&driven);
                let (Some(submission), Some(Work::Drive(drive))) = (&task.submission, task.work.as_deref())
                else {
                    self.finish(number, Ok(Reply::Driven(Box::new(driven))));
                    return Ok(());
                };
                complete_trace(drive, &submission.id, &driven.outcome)?;
                let outcome = self.book.add(submission.id, drive, driven.outcome)?;
                self.finish(number, Ok(Reply::Recorded(outcome, false)));
            }
            Answer::Evaluated(evaluated) => {
                self.finish(number, Ok(Reply::Evaluated(Box::new(evaluated))));
            }
            Answer::Made(made) => self.finish(number, Ok(Reply::Made(made))),
            Answer::InputFiles(files) => self.finish(number, Ok(Reply::InputFiles(files))),
            Answer::Proposed(candidates) => self.finish(number, Ok(Reply::Proposed(candidates))),
            // A pool has given the scenario up.
            Answer::Failed(failure) if matches!(task.work.as_deref(), Some(Work::Drive(_))) => {
                return self.done(number, Answer::Driven(Driven::lost(failure.kind, failure.message, 0)));
            }
            Answer::Failed(failure) => self.finish(number, Ok(Reply::Failed(failure))),
            Answer::Broken(failure) => return Err(failure.into()),
        }
        Ok(())
    }

    /// A task is over: everybody who waits for it gets the answer.
    fn finish(&mut self, number: u64, answer: Result<Reply>) {
        let Some(task) = self.jobs.remove(number) else { return };
        for ticket in task.waiting {
            self.answer(ticket, answer.clone());
        }
    }

    fn answer(&mut self, ticket: Ticket, answer: Result<Reply>) {
        self.unsent.push((ticket, answer));
    }

    /// Sends the answers, once what they speak of is on the disk.
    fn send(&mut self, introduce: &mut Option<&Sender<Result<Ready>>>) {
        if let Err(error) = self.book.sync() {
            let tickets = std::mem::take(&mut self.unsent).into_iter().map(|(ticket, _)| ticket);
            self.unsent = tickets.map(|ticket| (ticket, Err(error.clone()))).collect();
            self.fail(error, introduce);
        }
        for answer in self.unsent.drain(..) {
            // The requester may be gone.
            let _ = self.answers.send(answer);
        }
    }
}

/// Whether pdk starts the simulator itself, by one of these parameters, so that every worker has its own.
fn is_launched(simulator: &ComponentSpec, by: &[Parameter]) -> bool {
    by.iter().any(|parameter| {
        simulator.parameters.get(&parameter.name).is_some_and(|value| parameter.program(value).is_some())
    })
}

/// Writes the trace of a scenario that a pool has given up: the process that was to write it was lost.
fn complete_trace(drive: &Drive, id: &ScenarioId, outcome: &Outcome) -> Result<()> {
    match &outcome.error {
        Some(message) if drive.trace.as_ref().is_some_and(|path| !path.exists()) => {
            write_trace(drive, id, message)
        }
        _ => Ok(()),
    }
}
