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
use pdk_sdk::describe::Parameter;
use pdk_sdk::error::{Error, Result};

use self::book::Book;
use self::jobs::{Jobs, Task};
pub use self::tally::Shared;
use self::tally::Tally;
use self::workers::Workers;
use crate::connection::{Connection, Pool};
use crate::interrupt::{self, Wish};
use crate::submission::{Event, Options, Reply, Request, Submission, Ticket};
use pdk_loop::protocol::{Answer, Drive, Driven, Job, Ready, Work};
use pdk_loop::recorder::write_trace;

/// How often the session looks up where nothing happens.
const TICK: Duration = Duration::from_millis(50);

/// What the session's thread owns.
pub struct Dispatch {
    options: Options,
    workers: Workers,
    jobs: Jobs,
    book: Book,
    tally: Tally,
    answers: Sender<(Ticket, Result<Reply>)>,
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
                Ok(Event::Close) | Err(RecvTimeoutError::Disconnected) => break,
                Ok(Event::Submit(ticket, request)) => self.submit(ticket, request),
                Ok(Event::Record(record)) => self.book.record = Some(record),
                Ok(Event::Finish(done)) => {
                    // The requester may be gone.
                    let _ = done.send(self.book.finish());
                }
                Ok(Event::Worker(connection, found)) => {
                    if let Err(error) = self.hear(connection, found, &mut introduce) {
                        self.fail(error, &mut introduce);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
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
        }
        self.leave(events);
    }

    fn submit(&mut self, ticket: Ticket, request: Request) {
        if let Some(error) = &self.broken {
            return self.answer(ticket, Err(error.clone()));
        }
        if interrupt::wish() != Wish::None {
            return self.answer(ticket, Err(interrupt::error()));
        }
        let (work, submission) = match request {
            Request::Work(work) => (*work, None),
            Request::Submission(submission) => match self.admit(ticket, &submission) {
                Ok(Some(work)) => (work, Some(submission)),
                Ok(None) => return,
                Err(error) => return self.answer(ticket, Err(error)),
            },
        };
        let simulator = match &work {
            Work::Drive(drive) => Some(&drive.scenario.simulator),
            _ => None,
        };
        let external =
            simulator.and_then(|simulator| Some((simulator, self.workers.external.get(&simulator.name)?)));
        let first_only = self.options.pool == Pool::Usual
            && external.is_some_and(|(simulator, by)| !by.is_empty() && !is_launched(simulator, by));
        let external = external.is_some();
        self.jobs.add(Task { external, first_only, ..Task::new(work, submission, ticket) });
    }

    /// What there is to do for a scenario; nothing if it is in the ledger, or being driven.
    fn admit(&mut self, ticket: Ticket, submission: &Submission) -> Result<Option<Work>> {
        if let Some(task) = self.jobs.of_scenario(&submission.scenario.id()) {
            task.waiting.push(ticket);
            return Ok(None);
        }
        let (known, trace) = self.book.look_up(&submission.scenario.id())?;
        if let Some((line, before)) = known {
            self.answer(ticket, Ok(Reply::Recorded(Arc::new(line), before)));
            return Ok(None);
        }
        let Submission { scenario, name, images_every } = submission.clone();
        let trace = Some(std::path::absolute(&trace).unwrap_or(trace));
        Ok(Some(Work::Drive(Box::new(Drive {
            scenario,
            name,
            trace,
            images_every,
            skips: None,
            view: None,
        }))))
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
            let connection = &mut self.workers.connections[place];
            let job = Job::new(number, connection.first_slot + slot as u32, task.work.clone());
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
                let Some(submission) = &task.submission else {
                    self.finish(number, Ok(Reply::Driven(Box::new(driven))));
                    return Ok(());
                };
                complete_trace(&task.work, &driven.outcome)?;
                let line = self.book.add(submission, driven.outcome)?;
                self.finish(number, Ok(Reply::Recorded(Arc::new(line), false)));
            }
            Answer::Evaluated(evaluated) => {
                self.finish(number, Ok(Reply::Evaluated(Box::new(evaluated))));
            }
            Answer::Made(made) => self.finish(number, Ok(Reply::Made(made))),
            Answer::InputFiles(files) => self.finish(number, Ok(Reply::InputFiles(files))),
            Answer::Proposed(candidates) => self.finish(number, Ok(Reply::Proposed(candidates))),
            // A pool has given the scenario up.
            Answer::Failed(failure) if matches!(task.work, Work::Drive(_)) => {
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

    fn answer(&self, ticket: Ticket, answer: Result<Reply>) {
        // The requester may be gone.
        let _ = self.answers.send((ticket, answer));
    }
}

/// Whether pdk starts the simulator itself, by one of these parameters, so that every worker has its own.
fn is_launched(simulator: &ComponentSpec, by: &[Parameter]) -> bool {
    by.iter().any(|parameter| {
        simulator.parameters.get(&parameter.name).is_some_and(|value| parameter.program(value).is_some())
    })
}

/// Writes the trace of a scenario that a pool has given up: the process that was to write it was lost.
fn complete_trace(work: &Work, outcome: &Outcome) -> Result<()> {
    match (work, &outcome.error) {
        (Work::Drive(drive), Some(message)) if drive.trace.as_ref().is_some_and(|path| !path.exists()) => {
            write_trace(drive, message)
        }
        _ => Ok(()),
    }
}
