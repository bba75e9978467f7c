//! The session's thread: gives jobs to workers, writes the ledger, and answers.

mod answers;
mod ending;

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::sync::atomic::AtomicU64;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use pdk_model::component::ComponentSpec;
use pdk_model::outcome::Cause;
use pdk_model::scenario::ScenarioId;
use pdk_notice::eprintln;
use pdk_record::directory::RunDirectory;
use pdk_record::ledger::{Ledger, Line};
use pdk_record::trace::reader::Owner;
use pdk_sdk::describe::Parameter;
use pdk_sdk::error::{Error, Result};

use crate::connection::{Connection, Pool};
use crate::interrupt::{self, Wish};
use crate::submission::{Options, Performance, Reply, Submission, Ticket};
use pdk_loop::lines::Found;
use pdk_loop::protocol::{Drive, FromWorker, Hello, Job, Ready, VERSION, Work};

/// How often the session looks up where nothing happens.
const TICK: Duration = Duration::from_millis(50);

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
    /// Record scenarios from now on.
    Record(Record),
    /// Put the ledger in order.
    Finish(Sender<Result<()>>),
    /// Nobody wants anything any more.
    Close,
    /// A worker says something, on this connection.
    Worker(u64, Found<FromWorker>),
}

/// Where scenarios are recorded.
pub struct Record {
    /// The folder.
    pub directory: RunDirectory,
    /// The ledger in it.
    pub ledger: Ledger,
    /// Whether scenarios in which a component failed in an earlier session are answered from the ledger, rather than driven again.
    pub keep_errors: bool,
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
    record: Option<Record>,
    /// The scenarios in the order in which they were submitted first.
    order: Vec<ScenarioId>,
    /// Those that were driven, rather than found in the ledger.
    driven: HashSet<ScenarioId>,
    connections: Vec<Connection>,
    /// How many connections there were.
    opened: u64,
    /// The slots that are given nothing any more, and what their machine lacks for what they were given.
    out: BTreeMap<u32, Error>,
    /// How many workers in a row were killed before they were ready.
    stillborn: u32,
    /// The simulators that are programs of their own, with the parameters by which pdk starts one for each worker. Without them the
    /// user has started one, or some.
    external: HashMap<String, Vec<Parameter>>,
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
            out: BTreeMap::new(),
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
                Ok(Event::Record(record)) => self.record = Some(record),
                Ok(Event::Finish(done)) => {
                    let finished = match &mut self.record {
                        Some(record) => record.ledger.finish(&self.order),
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
        let is_out = |slot: &u32| self.options.pool.is_here() && self.out.contains_key(slot);
        let free = (0..).find(|slot| !taken.contains(slot) && !is_out(slot)).unwrap_or_default();
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
        let external = simulator.and_then(|simulator| Some((simulator, self.external.get(&simulator.name)?)));
        let first_only = self.options.pool == Pool::Usual
            && external.is_some_and(|(simulator, by)| !by.is_empty() && !is_launched(simulator, by));
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
        let Some(Record { directory, ledger, keep_errors }) = &self.record else {
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
        // What failed in an earlier session may go better now.
        let counts = |line: &Line| !before || *keep_errors || line.outcome.cause != Cause::Error;
        let known = ledger.get(&id)?.filter(counts);
        let trace = directory.trace(&id)?;
        // Nor is a scenario done whose trace is not there or not whole.
        let known = known.filter(|line| {
            !before
                || match pdk_record::trace::reader::check(&trace, Owner::of(line)) {
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

    /// How many connections there may be at a time: on this machine none for slots that are out.
    fn most_connections(&self) -> usize {
        let most = self.options.pool.connections();
        if self.options.pool.is_here() { most - self.out.len().min(most) } else { most }
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
            if let Some(error) = self.out.get(&0).filter(|_| first_only) {
                return Err(error.clone());
            }
            let may = |connection: &&Connection| {
                !connection.is_out() && (!first_only || connection.first_slot == 0)
            };
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
                let most = if first_only { 1 } else { self.most_connections() };
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
            let job = Job::new(number, connection.first_slot + slot as u32, task.work.clone());
            connection.give(slot, &job);
        }
        Ok(())
    }
}

/// Whether pdk starts the simulator itself, by one of these parameters, so that every worker has its own.
fn is_launched(simulator: &ComponentSpec, by: &[Parameter]) -> bool {
    by.iter().any(|parameter| {
        simulator.parameters.get(&parameter.name).is_some_and(|value| parameter.program(value).is_some())
    })
}

/// The reason of an error about a trace, without what the user could do, which is being done.
fn because(error: &Error) -> String {
    error.message().split(';').next().unwrap_or_default().to_owned()
}
