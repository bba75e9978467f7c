//! The session's thread: gives jobs to workers, writes the ledger, and answers.

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use pdk_core::directory::RunDirectory;
use pdk_core::eprintln;
use pdk_core::ledger::{Ledger, Line};
use pdk_core::supervisor::is_from_outside;
use pdk_model::component::ComponentSpec;
use pdk_model::outcome::Outcome;
use pdk_model::scenario::ScenarioId;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Result};
use serde_json::Value;

use crate::connection::{Connection, Pool};
use crate::interrupt::{self, Wish};
use crate::lines::Found;
use crate::protocol::{Answer, Drive, Driven, FromWorker, Hello, Job, Ready, VERSION, Work};
use crate::recorder::write_trace;
use crate::submission::{Options, Performance, Reply, Submission, Ticket};

/// How often a job is given away whose worker was lost, and a worker started that is killed before it is ready.
const TRIES: u32 = 3;
/// How long a worker may take to leave that has nothing to do any more: longer than it gives its own process.
const LEAVE: Duration = Duration::from_secs(12);
/// How long a worker may take to leave whose work nobody wants any more.
const DROP: Duration = Duration::from_secs(3);
/// How long what a worker said last may be on its way.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// How often the session looks up where nothing happens.
const TICK: Duration = Duration::from_millis(50);
/// How much longer than its calls may take a worker of this machine may take to be ready, or to say something of its job.
const GRACE: Duration = Duration::from_secs(30);
/// The parameter by which pdk starts a simulator for each worker; without it the user has started one, or some.
const LAUNCH: &str = "launch";
/// A scenario of which no frame has come for so long waits for its simulator. Workers tell of frames five times a second.
const UNDER_WAY: Duration = Duration::from_secs(1);
/// After so long the user is told what is being waited for.
const TOLD: Duration = Duration::from_secs(10);

/// What the handle sees of the thread's work.
#[derive(Default)]
pub struct Shared {
    /// Frames that were driven or evaluated.
    pub frames: AtomicU64,
    /// What all scenarios took.
    pub performance: Mutex<Performance>,
    /// Components that took their process along outside of any job's outcome, a sentence each, and how often.
    pub troubles: Mutex<BTreeMap<String, u64>>,
}

/// What the thread is told.
pub enum Event {
    /// Somebody wants something.
    Submit(Ticket, Request),
    /// Record scenarios in this folder from now on.
    Record(Box<RunDirectory>, Ledger),
    /// Put the ledger in order.
    Finish(Sender<Result<()>>),
    /// Nobody wants anything any more.
    Close,
    /// A worker says something, on this connection.
    Worker(u64, Found<FromWorker>),
}

/// Something that somebody wants.
pub enum Request {
    /// A scenario, to be recorded.
    Submission(Box<Submission>),
    /// Anything else.
    Work(Box<Work>),
}

/// A job and who waits for it.
struct Task {
    work: Work,
    /// For a scenario that is recorded: what its line needs.
    submission: Option<Box<Submission>>,
    waiting: Vec<Ticket>,
    /// How often it was given away.
    tries: u32,
    /// Whether its simulator is a program of its own, which may be waited for.
    external: bool,
    /// Whether only the first slot may do it.
    first_only: bool,
    /// When it was given away last, and whether frames have come of it since.
    given: Instant,
    began: bool,
    /// When its worker last said something of it.
    heard: Instant,
}

/// What the session's thread owns.
pub struct Dispatch {
    options: Options,
    hello: Hello,
    sender: Sender<Event>,
    answers: Sender<(Ticket, Result<Reply>)>,
    shared: Arc<Shared>,
    record: Option<(RunDirectory, Ledger)>,
    /// The scenarios in the order in which they were submitted first.
    order: Vec<ScenarioId>,
    /// Those that were driven, rather than found in the ledger.
    driven: HashSet<ScenarioId>,
    connections: Vec<Connection>,
    /// How many connections there were.
    opened: u64,
    /// How many workers in a row were killed before they were ready.
    stillborn: u32,
    /// The simulators that are programs of their own, and whether pdk can start one for each worker.
    external: HashMap<String, bool>,
    tasks: HashMap<u64, Task>,
    /// The scenarios among them.
    scenarios: HashMap<ScenarioId, u64>,
    next: u64,
    queue: VecDeque<u64>,
    /// Why nothing more can be done.
    broken: Option<Error>,
    /// Since when at least one slot has been at work.
    busy_since: Option<Instant>,
}

impl Dispatch {
    /// A dispatch that hears its workers through `sender`.
    pub fn new(
        options: Options,
        sender: Sender<Event>,
        answers: Sender<(Ticket, Result<Reply>)>,
        shared: Arc<Shared>,
    ) -> Self {
        let hello = Hello {
            protocol: VERSION,
            run: options.run.clone(),
            patience: options.limits.patience.as_secs_f64(),
            memory: options.limits.memory,
            search: options.search.absolute(),
        };
        Self {
            options,
            hello,
            sender,
            answers,
            shared,
            record: None,
            order: Vec::new(),
            driven: HashSet::new(),
            connections: Vec::new(),
            opened: 0,
            stillborn: 0,
            external: HashMap::new(),
            tasks: HashMap::new(),
            scenarios: HashMap::new(),
            next: 0,
            queue: VecDeque::new(),
            broken: None,
            busy_since: None,
        }
    }

    /// Works until nobody wants anything any more; `introduce` is told what the first worker has.
    pub fn serve(mut self, events: &Receiver<Event>, introduce: &Sender<Result<Ready>>) {
        let mut introduce = Some(introduce);
        // What runs left in shared memory that were killed with all of their workers. What cannot be removed is in nobody's way.
        let _ = pdk_bus::sweep();
        if let Err(error) = self.connect() {
            self.fail(error, &mut introduce);
        }
        let mut announced = Wish::None;
        loop {
            match events.recv_timeout(TICK) {
                Ok(Event::Close) | Err(RecvTimeoutError::Disconnected) => break,
                Ok(Event::Submit(ticket, request)) => self.submit(ticket, request),
                Ok(Event::Record(directory, ledger)) => self.record = Some((*directory, ledger)),
                Ok(Event::Finish(done)) => {
                    let finished = match &mut self.record {
                        Some((_, ledger)) => ledger.finish(&self.order),
                        None => Ok(()),
                    };
                    // Whoever asked may have gone.
                    let _ = done.send(finished);
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
            self.measure();
        }
        self.leave(events);
    }

    /// Starts another worker.
    fn connect(&mut self) -> Result<()> {
        let taken: Vec<u32> = self.connections.iter().map(|connection| connection.first_slot).collect();
        let free = (0..).find(|slot| !taken.contains(slot)).unwrap_or_default();
        let number = self.opened;
        self.opened += 1;
        let connection = Connection::open(
            &self.options.pool,
            &self.hello,
            number,
            free,
            self.sender.clone(),
            Event::Worker,
        )?;
        self.connections.push(connection);
        Ok(())
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
        let number = self.next;
        self.next += 1;
        if let Some(submission) = &submission {
            self.scenarios.insert(submission.scenario.id(), number);
        }
        let simulator = match &work {
            Work::Drive(drive) => Some(&drive.scenario.simulator),
            _ => None,
        };
        let external =
            simulator.and_then(|simulator| Some((simulator, *self.external.get(&simulator.name)?)));
        let first_only = self.options.pool == Pool::Usual
            && external.is_some_and(|(simulator, can)| can && !is_launched(simulator));
        let task = Task {
            external: external.is_some(),
            first_only,
            given: Instant::now(),
            began: false,
            work,
            submission,
            waiting: vec![ticket],
            tries: 0,
            heard: Instant::now(),
        };
        self.tasks.insert(number, task);
        self.queue.push_back(number);
    }

    /// What there is to do for a scenario; nothing where it is in the ledger, or being driven.
    fn admit(&mut self, ticket: Ticket, submission: &Submission) -> Result<Option<Work>> {
        let id = submission.scenario.id();
        let Some((directory, ledger)) = &self.record else {
            return Err(Error::new(
                "a scenario was submitted before the record was opened, which is a defect in pdk",
            ));
        };
        if let Some(number) = self.scenarios.get(&id)
            && let Some(task) = self.tasks.get_mut(number)
        {
            task.waiting.push(ticket);
            return Ok(None);
        }
        let before = !self.driven.contains(&id);
        // What was lost in an earlier process may go better now.
        let known = ledger.get(&id)?.filter(|line| !before || !line.is_chance());
        let trace = directory.trace(&id)?;
        // Nor is a scenario done whose trace is not there or not whole.
        let known = known.filter(|line| {
            !before
                || match pdk_trace::reader::check(&trace) {
                    Err(error) => {
                        eprintln!(
                            "pdk: warning: scenario `{}` is driven again: {}",
                            line.name,
                            because(&error)
                        );
                        false
                    }
                    _ => true,
                }
        });
        self.order.push(id);
        if let Some(line) = known {
            self.answer(ticket, Ok(Reply::Recorded(Box::new(line), before)));
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
        while let Some(number) = self.queue.get(at).copied() {
            let Some(task) = self.tasks.get_mut(&number) else {
                self.queue.remove(at);
                continue;
            };
            let first_only = task.first_only;
            let may = |connection: &&Connection| !first_only || connection.first_slot == 0;
            let free = self
                .connections
                .iter()
                .enumerate()
                .filter(|(_, connection)| may(connection))
                .find_map(|(c, connection)| Some((c, connection.free_slot()?)));
            let Some((place, slot)) = free else {
                let there = self.connections.iter().filter(may).count();
                let starting =
                    self.connections.iter().filter(|connection| connection.slots.is_none()).count();
                let most = if first_only { 1 } else { self.options.pool.connections() };
                if starting < self.queue.len() && there < most {
                    self.connect()?;
                } else if first_only {
                    // Behind it there may be one for the others.
                    at += 1;
                } else {
                    return Ok(());
                }
                continue;
            };
            self.queue.remove(at);
            task.tries += 1;
            task.began = false;
            (task.given, task.heard) = (Instant::now(), Instant::now());
            let connection = &mut self.connections[place];
            let job = Job { number, slot: connection.first_slot + slot as u32, work: task.work.clone() };
            connection.give(slot, &job);
        }
        Ok(())
    }

    fn hear(
        &mut self,
        number: u64,
        found: Found<FromWorker>,
        introduce: &mut Option<&Sender<Result<Ready>>>,
    ) -> Result<()> {
        let Some(place) = self.connections.iter().position(|connection| connection.number == number) else {
            return Ok(());
        };
        let name = self.options.pool.name();
        match found {
            Found::Message(FromWorker::Ready(ready)) => {
                self.connections[place].ready(&ready, &self.options.pool)?;
                self.stillborn = 0;
                let simulators = ready.catalog.of_kind(Kind::Simulator);
                for description in simulators.map(|entry| &entry.description).filter(|found| found.external) {
                    let can = description.parameters.iter().any(|parameter| parameter.name == LAUNCH);
                    self.external.insert(description.name.clone(), can);
                }
                if let Some(introduce) = introduce.take() {
                    let _ = introduce.send(Ok(ready));
                }
                Ok(())
            }
            Found::Message(FromWorker::Progress(progress)) => {
                self.shared.frames.fetch_add(progress.frames, Ordering::Relaxed);
                if let Some(task) = self.tasks.get_mut(&progress.number) {
                    task.heard = Instant::now();
                    task.began |= progress.frames > 0;
                }
                Ok(())
            }
            Found::Message(FromWorker::Done(done)) => {
                self.connections[place].release(done.number);
                self.done(done.number, done.answer);
                Ok(())
            }
            Found::Message(FromWorker::Trouble(sentence)) => {
                self.note(sentence);
                Ok(())
            }
            Found::Message(FromWorker::Failed(reason)) => Err(Error::new(reason)),
            Found::Nonsense(error) => {
                Err(Error::of(ErrorKind::Nonsense, format!("{name} says what is not a message ({error})")))
            }
            Found::End => {
                let mut connection = self.connections.remove(place);
                let end = connection.wait(Duration::from_secs(1));
                if connection.slots.is_some() {
                    self.lost(&connection, &said(end));
                    return Ok(());
                }
                // That came from outside, as a rule.
                let killed = end.and_then(|status| status.signal()).is_some_and(is_from_outside);
                self.stillborn += 1;
                if !killed || self.stillborn == TRIES {
                    let sentence = format!(
                        "{name} ended before it was ready ({}); what it wrote above says why",
                        said(end)
                    );
                    return Err(Error::of(ErrorKind::Lost, sentence));
                }
                // Later ones are started where there is work for them.
                if introduce.is_some() { self.connect() } else { Ok(()) }
            }
        }
    }

    /// Ends what has been silent for longer than all of its calls may take: a worker of this machine says something five times a
    /// second. A pool may take its time, such as a cluster that is busy; the user is told that it is waited for.
    fn look_for_silent(&mut self) -> Result<()> {
        let patience = self.options.limits.patience;
        let (Pool::Here(_) | Pool::Usual) = self.options.pool else {
            for connection in self.connections.iter_mut().filter(|connection| connection.slots.is_none()) {
                if connection.opened.elapsed() > TOLD && !std::mem::replace(&mut connection.told, true) {
                    eprintln!("pdk: waiting for {} to be ready", self.options.pool.name());
                }
            }
            return Ok(());
        };
        let limit = |work: &Work| {
            let calls = match work {
                Work::Drive(_) | Work::Make(_) | Work::Search(_) => 4,
                Work::Evaluate(frame) => 4 + 2 * frame.evaluation.perturbations.len() as u32,
            };
            patience.saturating_mul(calls).saturating_add(GRACE)
        };
        let silent = self.connections.iter().position(|connection| {
            let starting =
                connection.slots.is_none() && connection.opened.elapsed() > patience.saturating_add(GRACE);
            let late = |number: &u64| {
                self.tasks.get(number).is_some_and(|task| task.heard.elapsed() > limit(&task.work))
            };
            starting || connection.jobs().iter().any(late)
        });
        let Some(place) = silent else { return Ok(()) };
        let connection = self.connections.remove(place);
        if connection.slots.is_none() {
            let waited = connection.opened.elapsed().as_secs();
            return Err(Error::of(ErrorKind::Late, format!("a worker has not been ready for {waited} s")));
        }
        self.lost(&connection, "it said nothing any more");
        Ok(())
    }

    /// A worker is gone: what it was at is done again by another one.
    fn lost(&mut self, connection: &Connection, end: &str) {
        let _ = pdk_bus::sweep_run(&self.options.run);
        for number in connection.jobs().into_iter().rev() {
            let Some(task) = self.tasks.get(&number) else { continue };
            if interrupt::wish() != Wish::None {
                // Nothing is given away any more.
                self.finish(number, Err(interrupt::error()));
                continue;
            }
            if task.tries < TRIES {
                self.queue.push_front(number);
                continue;
            }
            let message =
                format!("{} was lost {TRIES} times over it (the last: {end})", self.options.pool.name());
            let answer = match &task.work {
                Work::Drive(drive) => match write_trace(drive, &message) {
                    Ok(()) => Answer::Driven(Driven::lost(ErrorKind::Lost, message, 0)),
                    Err(error) => Answer::Broken(error.into()),
                },
                _ => Answer::Failed(Error::of(ErrorKind::Lost, message).into()),
            };
            self.done(number, answer);
        }
    }

    fn done(&mut self, number: u64, answer: Answer) {
        let Some(task) = self.tasks.get(&number) else { return };
        match answer {
            Answer::Driven(driven) => {
                self.add_up(&driven);
                let Some(submission) = &task.submission else {
                    return self.finish(number, Ok(Reply::Driven(Box::new(driven))));
                };
                let traced = complete_trace(&task.work, &driven.outcome);
                let line = line_of(submission, driven.outcome);
                let written = traced.and_then(|()| match &mut self.record {
                    Some((_, ledger)) => ledger.add(&line),
                    None => Ok(()),
                });
                self.driven.insert(line.id);
                self.finish(number, written.map(|()| Reply::Recorded(Box::new(line), false)));
            }
            Answer::Evaluated(evaluated) => {
                self.shared.frames.fetch_add(1, Ordering::Relaxed);
                self.finish(number, Ok(Reply::Evaluated(Box::new(evaluated))));
            }
            Answer::Made(made) => self.finish(number, Ok(Reply::Made(made))),
            Answer::Proposed(candidates) => self.finish(number, Ok(Reply::Proposed(candidates))),
            Answer::Failed(failure) => self.finish(number, Ok(Reply::Failed(failure))),
            Answer::Broken(failure) => self.finish(number, Err(failure.into())),
        }
    }

    /// A task is over: everybody who waits for it gets the answer.
    fn finish(&mut self, number: u64, answer: Result<Reply>) {
        let Some(task) = self.tasks.remove(&number) else { return };
        if let Some(submission) = &task.submission {
            self.scenarios.remove(&submission.scenario.id());
        }
        for ticket in task.waiting {
            self.answer(ticket, answer.clone());
        }
    }

    fn answer(&self, ticket: Ticket, answer: Result<Reply>) {
        // Whoever asked may have gone.
        let _ = self.answers.send((ticket, answer));
    }

    fn add_up(&self, driven: &Driven) {
        let mut performance = self.shared.performance.lock().unwrap_or_else(PoisonError::into_inner);
        performance.times.add(&driven.times);
        if driven.rate > 0.0 {
            performance.simulated_seconds += driven.outcome.frames as f64 / driven.rate;
        }
        for warning in &driven.warnings {
            *performance.warnings.entry(warning.clone()).or_default() += 1;
        }
    }

    /// Adds up the time in which there is work, and the slots that have some.
    fn measure(&mut self) {
        let busy: usize = self.connections.iter().map(|connection| connection.jobs().len()).sum();
        let mut performance = self.shared.performance.lock().unwrap_or_else(PoisonError::into_inner);
        performance.slots = performance.slots.max(busy);
        let now = Instant::now();
        if let Some(since) = self.busy_since {
            performance.wall_seconds += now.duration_since(since).as_secs_f64();
        }
        self.busy_since = (busy > 0).then_some(now);
    }

    /// Nothing more can be done: everybody is told so.
    fn fail(&mut self, error: Error, introduce: &mut Option<&Sender<Result<Ready>>>) {
        if let Some(introduce) = introduce.take() {
            let _ = introduce.send(Err(error.clone()));
        }
        self.queue.clear();
        let tasks: Vec<u64> = self.tasks.keys().copied().collect();
        for number in tasks {
            self.finish(number, Err(error.clone()));
        }
        self.let_go(DROP);
        self.broken.get_or_insert(error);
    }

    /// The user wants an end.
    fn interrupted(&mut self, wish: Wish, introduce: &mut Option<&Sender<Result<Ready>>>) {
        if let Some(introduce) = introduce.take() {
            // Nothing has begun.
            let _ = introduce.send(Err(interrupt::error()));
        }
        let dropped: Vec<u64> = match wish {
            Wish::Drop => {
                self.let_go(DROP);
                self.tasks.keys().copied().collect()
            }
            Wish::Finish | Wish::None => self.queue.iter().copied().collect(),
        };
        self.queue.clear();
        self.drop_tasks(dropped);
    }

    /// These are not done: everybody who waits for them is told so.
    fn drop_tasks(&mut self, numbers: Vec<u64>) {
        for number in numbers {
            // Its worker may have completed the trace just before it left; without a line it is of no scenario.
            if let Some(Task { work: Work::Drive(drive), submission: Some(submission), .. }) =
                self.tasks.get(&number)
                && let (Some(trace), Some((_, ledger))) = (&drive.trace, &self.record)
                && !ledger.has(&submission.scenario.id())
            {
                let _ = std::fs::remove_file(trace);
            }
            self.finish(number, Err(interrupt::error()));
        }
    }

    /// Says to all workers that there are no more jobs, and ends those that have not left by then.
    fn let_go(&mut self, limit: Duration) {
        self.connections.iter_mut().for_each(Connection::close);
        let until = Instant::now() + limit;
        for connection in &mut self.connections {
            connection.wait(until.saturating_duration_since(Instant::now()));
        }
        self.connections.clear();
    }

    /// Ends the workers that wait for a simulator: nothing is in flight there yet that could be finished.
    fn stop_waiting(&mut self) {
        let is_waiting = |number: &u64| {
            self.tasks
                .get(number)
                .is_some_and(|task| task.external && !task.began && task.given.elapsed() > UNDER_WAY)
        };
        let (mut waiting, others) =
            std::mem::take(&mut self.connections).into_iter().partition::<Vec<_>, _>(|connection| {
                let jobs = connection.jobs();
                !jobs.is_empty() && jobs.iter().all(is_waiting)
            });
        self.connections = others;
        if waiting.is_empty() {
            return;
        }
        waiting.iter_mut().for_each(Connection::close);
        let until = Instant::now() + DROP;
        for connection in &mut waiting {
            connection.wait(until.saturating_duration_since(Instant::now()));
        }
        self.drop_tasks(waiting.iter().flat_map(Connection::jobs).collect());
    }

    fn note(&self, trouble: String) {
        *self.shared.troubles.lock().unwrap_or_else(PoisonError::into_inner).entry(trouble).or_default() += 1;
    }

    /// Ends the session. Workers say what happened when their components took leave.
    fn leave(&mut self, events: &Receiver<Event>) {
        let mut speaking: HashSet<u64> =
            self.connections.iter().map(|connection| connection.number).collect();
        self.let_go(LEAVE);
        while !speaking.is_empty() {
            match events.recv_timeout(LAST_WORDS) {
                Ok(Event::Worker(_, Found::Message(FromWorker::Trouble(sentence)))) => self.note(sentence),
                Ok(Event::Worker(number, Found::End)) => {
                    speaking.remove(&number);
                }
                Ok(_) => {}
                Err(_) => break,
            }
        }
        if let Some((directory, _)) = &self.record {
            directory.remove_partial_traces();
        }
        let _ = pdk_bus::sweep_run(&self.options.run);
    }
}

/// Whether pdk starts the simulator itself, so that every worker has its own.
fn is_launched(simulator: &ComponentSpec) -> bool {
    match simulator.parameters.get(LAUNCH) {
        None | Some(Value::Null) => false,
        Some(Value::String(program)) => !program.is_empty(),
        Some(Value::Array(words)) => !words.is_empty(),
        Some(_) => true,
    }
}

/// The reason of an error about a trace, without what the user could do, which is being done.
fn because(error: &Error) -> String {
    error.message().split(';').next().unwrap_or_default().to_owned()
}

/// How a worker ended, in words.
fn said(end: Option<ExitStatus>) -> String {
    end.map_or_else(|| "it did not end by itself".to_owned(), |status| status.to_string())
}

/// Writes the trace of a scenario that a pool has given up: whoever was to write it was lost.
fn complete_trace(work: &Work, outcome: &Outcome) -> Result<()> {
    match (work, &outcome.error) {
        (Work::Drive(drive), Some(message)) if drive.trace.as_ref().is_some_and(|path| !path.exists()) => {
            write_trace(drive, message)
        }
        _ => Ok(()),
    }
}

fn line_of(submission: &Submission, outcome: Outcome) -> Line {
    let Submission { scenario, name, images_every } = submission.clone();
    Line { id: scenario.id(), name, scenario, images_every, outcome }
}
