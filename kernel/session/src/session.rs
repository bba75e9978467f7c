//! A session: gives jobs to workers and takes what they come to, as long as a pipeline lives.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use pdk_components::catalog::Catalog;
use pdk_model::component::ComponentSpec;
use pdk_model::search::Candidate;
use pdk_record::directory::RunDirectory;
use pdk_record::ledger::Ledger;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Place, Result};
use pdk_sdk::input_files::InputFiles;

use crate::connection::Pool;
use crate::dispatch::{Dispatch, Shared};
use crate::submission::{Event, Record, Request};
pub use crate::submission::{
    Options, Performance, Reply, Submission, Ticket, WaitingSubmission, WrittenOutcome,
};
use pdk_loop::protocol::{Drive, EvaluateFrames, Made, Make, Ready, SearchStep, StartSearch, Work};

/// The session's handle, which the pipeline holds.
pub struct Session {
    requests: Sender<Event>,
    answers: Receiver<(Ticket, Result<Reply>)>,
    /// What came before anybody asked for it.
    early: BTreeMap<Ticket, Result<Reply>>,
    /// Tickets whose answers have not been taken.
    open: BTreeSet<Ticket>,
    next: u64,
    catalog: Catalog,
    refused: Vec<String>,
    passed_over: Vec<(String, String)>,
    slots: usize,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    options: Options,
    /// The session that reads files on this machine, where the workers of this one may be on others.
    here: Option<Box<Session>>,
}

impl Session {
    /// Starts a session with its first worker, and waits until that has told which components there are.
    ///
    /// # Errors
    /// If the worker cannot be started, or is of another version.
    pub fn start(options: Options) -> Result<Self> {
        let connections = options.pool.connections();
        let (requests, events) = mpsc::channel();
        let (answer, answers) = mpsc::channel();
        let (introduce, introduced) = mpsc::channel();
        let shared = Arc::new(Shared::default());
        let dispatch = Dispatch::new(options.clone(), requests.clone(), answer, Arc::clone(&shared));
        let thread = std::thread::Builder::new()
            .name("session".into())
            .spawn(move || dispatch.serve(&events, &introduce))
            .place("cannot start the thread of the session")?;
        let mut session = Self {
            requests,
            answers,
            early: BTreeMap::new(),
            open: BTreeSet::new(),
            next: 0,
            catalog: Catalog::default(),
            refused: Vec::new(),
            passed_over: Vec::new(),
            slots: 0,
            shared,
            thread: Some(thread),
            options,
            here: None,
        };
        let ready: Ready = introduced.recv().map_err(|_| gone())??;
        session.slots = connections * ready.slots as usize;
        (session.catalog, session.refused) = (ready.catalog, ready.refused);
        session.passed_over = ready.passed_over;
        Ok(session)
    }

    /// The components there are.
    pub fn catalog(&self) -> &Catalog {
        &self.catalog
    }

    /// What was found but cannot be used, one sentence each.
    pub fn refused(&self) -> &[String] {
        &self.refused
    }

    /// How many jobs are done at the same time, once all workers are there.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// Records what is submitted from now on, and answers from the ledger what is there already. Scenarios in which a component
    /// failed are driven again, unless errors are kept.
    pub fn record(&mut self, directory: RunDirectory, ledger: Ledger, keep_errors: bool) {
        // Fails only where the thread is gone, which shows with the next answer.
        let _ = self.requests.send(Event::Record(Record { directory, ledger, keep_errors }));
    }

    /// Submits a scenario, which is recorded.
    pub fn submit(&mut self, submission: WaitingSubmission) -> Ticket {
        self.request(Request::Submission(submission))
    }

    /// A ticket for a scenario that another process drives: its answer is [`Reply::Elsewhere`], at once.
    pub fn set_aside(&mut self) -> Ticket {
        let ticket = self.ticket();
        self.early.insert(ticket, Ok(Reply::Elsewhere));
        ticket
    }

    /// Submits a scenario that is driven without being recorded, with a trace where the caller wants it.
    pub fn drive(&mut self, drive: Drive) -> Ticket {
        self.request(Request::Work(Box::new(Work::Drive(Box::new(drive)))))
    }

    /// Submits frames of a dataset.
    pub fn evaluate(&mut self, frames: EvaluateFrames) -> Ticket {
        self.request(Request::Work(Box::new(Work::Evaluate(Box::new(frames)))))
    }

    /// Makes a component, and says what it is like.
    ///
    /// # Errors
    /// If there is no such component, or it refuses its parameters.
    pub fn make(&mut self, kind: Kind, component: &ComponentSpec) -> Result<Made> {
        self.catalog.check(kind, &component.name, &component.parameters).map_err(|error| {
            // It may be there and broken.
            match self.passed_over.iter().find(|(name, _)| *name == component.name) {
                Some((_, reason)) if self.catalog.get(kind, &component.name).is_err() => {
                    Error::of(error.kind(), format!("{error}; {reason}"))
                }
                _ => error,
            }
        })?;
        let make = Make { kind, component: component.clone() };
        let ticket = self.request(Request::Work(Box::new(Work::Make(make))));
        match self.wait(ticket, &mut |_| {})? {
            Reply::Made(made) => Ok(made),
            Reply::Failed(failure) => Err(failure.into()),
            _ => Err(Error::new(format!("making {kind} `{}` gave something else", component.name))),
        }
    }

    /// The files that a component would read on this machine, besides those that its parameters name.
    ///
    /// # Errors
    /// If there is no such component, it refuses its parameters, or its files cannot be listed.
    pub fn input_files(&mut self, kind: Kind, component: &ComponentSpec) -> Result<Vec<InputFiles>> {
        if matches!(self.options.pool, Pool::Command(_)) {
            let here = match &mut self.here {
                Some(here) => here,
                None => {
                    let run = format!("{}-files", self.options.run);
                    let options = Options { run, pool: Pool::Here(1), ..self.options.clone() };
                    self.here.insert(Box::new(Self::start(options)?))
                }
            };
            return here.input_files(kind, component);
        }
        let make = Make { kind, component: component.clone() };
        let ticket = self.request(Request::Work(Box::new(Work::InputFiles(make))));
        match self.wait(ticket, &mut |_| {})? {
            Reply::InputFiles(files) => Ok(files),
            Reply::Failed(failure) => Err(failure.into()),
            _ => Err(Error::new(
                "listing the files of a component gave something else, which is a defect in pdk",
            )),
        }
    }

    /// Takes a step of a search, and returns the candidates that were asked for. Only in a session of this machine's single worker,
    /// which keeps the strategy from one step to the next.
    ///
    /// # Errors
    /// What the strategy says, or how it ended.
    pub fn search(&mut self, step: SearchStep) -> Result<Vec<Candidate>> {
        if let Some(StartSearch { strategy, .. }) = &step.start {
            self.catalog.check(Kind::Search, &strategy.name, &strategy.parameters)?;
        }
        let ticket = self.request(Request::Work(Box::new(Work::Search(Box::new(step)))));
        match self.wait(ticket, &mut |_| {})? {
            Reply::Proposed(candidates) => Ok(candidates),
            Reply::Failed(failure) => Err(failure.into()),
            _ => Err(Error::new("a step of a search gave something else, which is a defect in pdk")),
        }
    }

    fn ticket(&mut self) -> Ticket {
        let ticket = Ticket(self.next);
        self.next += 1;
        self.open.insert(ticket);
        ticket
    }

    fn request(&mut self, request: Request) -> Ticket {
        let ticket = self.ticket();
        // Fails only where the thread is gone, which shows with the next answer.
        let _ = self.requests.send(Event::Submit(ticket, request));
        ticket
    }

    /// The answer to a submission; `tick` is called now and then with the number of frames driven since the session began.
    ///
    /// # Errors
    /// What went wrong with it, beyond what a component did in a scenario, which is its outcome.
    pub fn wait(&mut self, ticket: Ticket, tick: &mut dyn FnMut(u64)) -> Result<Reply> {
        loop {
            if let Some(answer) = self.early.remove(&ticket) {
                self.open.remove(&ticket);
                return answer;
            }
            if !self.open.contains(&ticket) {
                return Err(Error::new("the answer to this submission was taken already"));
            }
            self.receive(tick)?;
        }
    }

    /// The next answer to any of these; none if all of theirs have been taken. If several are there already, the one to the earliest
    /// submission comes first.
    ///
    /// # Errors
    /// If the session is over.
    pub fn next(
        &mut self,
        among: &BTreeSet<Ticket>,
        tick: &mut dyn FnMut(u64),
    ) -> Result<Option<(Ticket, Result<Reply>)>> {
        loop {
            // Either may be large.
            let come = match self.early.len() < among.len() {
                true => self.early.keys().find(|ticket| among.contains(ticket)),
                false => among.iter().find(|ticket| self.early.contains_key(ticket)),
            };
            let come = come.copied();
            if let Some(answer) = come.and_then(|ticket| Some((ticket, self.early.remove(&ticket)?))) {
                self.open.remove(&answer.0);
                return Ok(Some(answer));
            }
            if self.open.is_disjoint(among) {
                return Ok(None);
            }
            self.receive(tick)?;
        }
    }

    fn receive(&mut self, tick: &mut dyn FnMut(u64)) -> Result<()> {
        match self.answers.recv_timeout(Duration::from_millis(100)) {
            Ok((ticket, answer)) => {
                self.early.insert(ticket, answer);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(gone()),
        }
        tick(self.frames());
        Ok(())
    }

    /// Frames that were driven or evaluated so far.
    pub fn frames(&self) -> u64 {
        self.shared.frames.load(Ordering::Relaxed)
    }

    /// What all scenarios took so far.
    pub fn performance(&self) -> Performance {
        self.shared.performance.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Puts the ledger in the order of submission.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(&mut self) -> Result<()> {
        let (done, finished) = mpsc::channel();
        self.requests.send(Event::Finish(done)).map_err(|_| gone())?;
        finished.recv().map_err(|_| gone())?
    }
}

impl Session {
    /// Ends the session: all workers leave. Returns which components ended their process outside of a job, such as when an instance
    /// was dropped, a sentence each.
    pub fn end(&mut self) -> Vec<String> {
        // If the thread is gone already, its workers are as well.
        let _ = self.requests.send(Event::Close);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        let troubles = self.shared.troubles.lock().unwrap_or_else(PoisonError::into_inner);
        let said = |(sentence, times): (&String, &u64)| match times {
            1 => sentence.clone(),
            times => format!("{sentence}, {times} times"),
        };
        troubles.iter().map(said).collect()
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.end();
    }
}

fn gone() -> Error {
    Error::of(ErrorKind::Lost, "the session is over, which is a defect in pdk")
}
