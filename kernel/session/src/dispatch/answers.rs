//! What workers say, and what happens if one is lost or silent: what it was at is done again.

use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use pdk_notice::eprintln;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_supervise::supervisor::is_from_outside;

use super::Dispatch;
use crate::connection::{Connection, Pool};
use crate::interrupt::{self, Wish};
use pdk_loop::lines::Found;
use pdk_loop::protocol::{Answer, Done, Driven, FromWorker, Ready, Work};
use pdk_loop::recorder::write_trace;

/// How often a job is given away whose worker was lost, and a worker started that is killed before it is ready.
const TRIES: u32 = 3;
/// How much longer than its calls a worker of this machine may take to be ready, or to report on its job.
const GRACE: Duration = Duration::from_secs(30);
/// After this time pdk reports what it is waiting for.
const TOLD: Duration = Duration::from_secs(10);

impl Dispatch {
    /// Takes in what a worker sends on a connection; `introduce` is called with what the first one has.
    pub(super) fn hear(
        &mut self,
        number: u64,
        found: Found<FromWorker>,
        introduce: &mut Option<&Sender<Result<Ready>>>,
    ) -> Result<()> {
        let Some(place) = self.workers.connections.iter().position(|connection| connection.number == number)
        else {
            return Ok(());
        };
        let name = self.options.pool.name();
        match found {
            Found::Message(FromWorker::Ready(ready)) => {
                self.workers.connections[place].ready(&ready, &self.options.pool, &self.workers.out)?;
                self.workers.stillborn = 0;
                let simulators = ready.catalog.of_kind(Kind::Simulator);
                for description in simulators.map(|entry| &entry.description).filter(|found| found.external) {
                    let starting =
                        description.parameters.iter().filter(|parameter| parameter.starts_program).cloned();
                    self.workers.external.insert(description.name.clone(), starting.collect());
                }
                if let Some(introduce) = introduce.take() {
                    let _ = introduce.send(Ok(ready));
                }
                Ok(())
            }
            Found::Message(FromWorker::Progress(progress)) => {
                self.tally.count(progress.frames);
                if let Some(task) = self.jobs.tasks.get_mut(&progress.number) {
                    task.heard = Instant::now();
                    task.began |= progress.frames > 0;
                }
                Ok(())
            }
            Found::Message(FromWorker::Done(Done { number, answer: Answer::Broken(failure) })) => {
                self.take_out(place, number, failure.into())
            }
            Found::Message(FromWorker::Done(done)) => {
                self.workers.connections[place].release(done.number);
                self.done(done.number, done.answer)
            }
            Found::Message(FromWorker::Trouble(sentence)) => {
                self.tally.note(sentence);
                Ok(())
            }
            Found::Message(FromWorker::Failed(reason)) => Err(Error::new(reason)),
            Found::Nonsense(_, Some(message))
                if self.workers.connections[place].leaves_out(&message, &self.options.pool) =>
            {
                Ok(())
            }
            Found::Nonsense(error, _) => {
                Err(Error::of(ErrorKind::Nonsense, format!("{name} says what is not a message ({error})")))
            }
            Found::End => {
                let mut connection = self.workers.connections.remove(place);
                let end = connection.wait(Duration::from_secs(1));
                if connection.slots.is_some() {
                    return self.lost(&connection, &said(end));
                }
                // That came from outside, as a rule.
                let killed = end.and_then(|status| status.signal()).is_some_and(is_from_outside);
                self.workers.stillborn += 1;
                if !killed || self.workers.stillborn == TRIES {
                    let sentence = match end {
                        Some(end) => {
                            format!("{name} ended before it was ready ({end}); see its output above")
                        }
                        None => format!(
                            "{name} closed its output before it was ready, and did not end; it has to answer there"
                        ),
                    };
                    return Err(Error::of(ErrorKind::Lost, sentence));
                }
                // Later ones are started when there is work for them.
                if introduce.is_some() { self.workers.connect() } else { Ok(()) }
            }
        }
    }

    /// The machine of a slot cannot do what it was given, or its set-up is wrong, which says nothing about the job: the slot is given
    /// nothing any more, and the job goes to another one.
    ///
    /// # Errors
    /// What the slot's machine lacks, where no other one is left.
    fn take_out(&mut self, place: usize, number: u64, error: Error) -> Result<()> {
        let Some(slot) = self.workers.connections[place].take_out(number) else { return Ok(()) };
        self.workers.out.insert(slot, error.clone());
        let is_out = self.workers.connections[place].is_out();
        let none_left = match self.options.pool.is_here() {
            true => self.workers.most() == 0,
            false => is_out,
        };
        let first_only = self.jobs.tasks.get(&number).is_some_and(|task| task.first_only);
        if none_left || first_only {
            return Err(error);
        }
        if is_out {
            // It leaves, and is gone when its output ends.
            self.workers.connections[place].close();
        }
        eprintln!("pdk: warning: worker {slot} gets nothing more to do, and others do its work: {error}");
        if interrupt::wish() != Wish::None {
            // Nothing is given away any more.
            self.drop_tasks(vec![number]);
        } else if let Some(task) = self.jobs.tasks.get_mut(&number) {
            // It was not lost over the job.
            task.tries -= 1;
            self.jobs.queue.push_front(number);
        }
        Ok(())
    }

    /// A worker is gone: what it was at is done again by another one.
    ///
    /// # Errors
    /// If what came of it cannot be recorded.
    pub(super) fn lost(&mut self, connection: &Connection, end: &str) -> Result<()> {
        let _ = pdk_bus::sweep_run(&self.options.run);
        for number in connection.jobs().into_iter().rev() {
            let Some(task) = self.jobs.tasks.get(&number) else { continue };
            if interrupt::wish() != Wish::None {
                // Nothing is given away any more.
                self.finish(number, Err(interrupt::error()));
                continue;
            }
            if task.tries < TRIES {
                self.jobs.queue.push_front(number);
                continue;
            }
            let message =
                format!("{} was lost {TRIES} times over it (the last: {end})", self.options.pool.name());
            let answer = match task.work.as_deref() {
                Some(Work::Drive(drive)) => match write_trace(drive, &drive.scenario.id(), &message) {
                    Ok(()) => Answer::Driven(Driven::lost(ErrorKind::Lost, message, 0)),
                    Err(error) => Answer::Broken(error.into()),
                },
                _ => Answer::Failed(Error::of(ErrorKind::Lost, message).into()),
            };
            self.done(number, answer)?;
        }
        Ok(())
    }

    /// Ends what has been silent for longer than all of its calls may take: a worker of this machine says something five times a
    /// second. A pool may take its time, such as a cluster that is busy; pdk reports that it is waiting.
    pub(super) fn look_for_silent(&mut self) -> Result<()> {
        let patience = self.options.limits.patience;
        let (Pool::Here(_) | Pool::Usual) = self.options.pool else {
            for connection in
                self.workers.connections.iter_mut().filter(|connection| connection.slots.is_none())
            {
                if connection.opened.elapsed() > TOLD && !std::mem::replace(&mut connection.told, true) {
                    eprintln!("pdk: waiting for {} to be ready", self.options.pool.name());
                }
            }
            return Ok(());
        };
        let limit = |work: Option<&Work>| {
            // Making components, or the calls for one frame, of which a worker tells when it is done.
            let calls = if matches!(work, Some(Work::Evaluate(_))) { 8 } else { 4 };
            patience.saturating_mul(calls).saturating_add(GRACE)
        };
        let silent = self.workers.connections.iter().position(|connection| {
            let starting =
                connection.slots.is_none() && connection.opened.elapsed() > patience.saturating_add(GRACE);
            let late = |number: &u64| {
                self.jobs
                    .tasks
                    .get(number)
                    .is_some_and(|task| task.heard.elapsed() > limit(task.work.as_deref()))
            };
            starting || connection.jobs().iter().any(late)
        });
        let Some(place) = silent else { return Ok(()) };
        let connection = self.workers.connections.remove(place);
        if connection.slots.is_none() {
            let waited = connection.opened.elapsed().as_secs();
            return Err(Error::of(ErrorKind::Late, format!("a worker has not been ready for {waited} s")));
        }
        self.lost(&connection, "it stopped responding")
    }
}

/// How a worker ended, in words.
fn said(end: Option<ExitStatus>) -> String {
    end.map_or_else(|| "it closed its output and did not end".to_owned(), |status| status.to_string())
}
