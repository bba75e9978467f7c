//! How a session ends: on its own, on the user's wish, or because nothing more can be done.

use std::collections::HashSet;
use std::sync::mpsc::{Receiver, Sender};
use std::time::Duration;

use pdk_sdk::error::{Error, Result};

use super::Dispatch;
use super::jobs::Task;
use super::workers::leave;
use crate::connection::Connection;
use crate::interrupt::{self, Wish};
use crate::submission::Event;
use pdk_loop::lines::Found;
use pdk_loop::protocol::{FromWorker, Ready};

/// How long a worker may take to leave that has nothing to do any more: longer than it gives its own process.
const LEAVE: Duration = Duration::from_secs(12);
/// How long a worker whose work is not wanted any more may take to leave.
const DROP: Duration = Duration::from_secs(3);
/// How long what a worker said last may be on its way.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// A scenario of which no frame has come for this long waits for its simulator. Workers report frames five times a second;
/// on a busy machine a simulator takes seconds to its first.
const UNDER_WAY: Duration = Duration::from_secs(10);

impl Dispatch {
    /// Nothing more can be done: every requester gets the error.
    pub(super) fn fail(&mut self, error: Error, introduce: &mut Option<&Sender<Result<Ready>>>) {
        if let Some(introduce) = introduce.take() {
            let _ = introduce.send(Err(error.clone()));
        }
        self.jobs.queue.clear();
        let tasks: Vec<u64> = self.jobs.tasks.keys().copied().collect();
        for number in tasks {
            self.finish(number, Err(error.clone()));
        }
        self.workers.let_go(DROP);
        self.broken.get_or_insert(error);
    }

    /// The user wants an end.
    pub(super) fn interrupted(&mut self, wish: Wish, introduce: &mut Option<&Sender<Result<Ready>>>) {
        if let Some(introduce) = introduce.take() {
            // Nothing has begun.
            let _ = introduce.send(Err(interrupt::error()));
        }
        let dropped: Vec<u64> = match wish {
            Wish::Drop => {
                self.workers.let_go(DROP);
                self.jobs.tasks.keys().copied().collect()
            }
            Wish::Finish | Wish::None => self.jobs.queue.iter().copied().collect(),
        };
        self.jobs.queue.clear();
        self.drop_tasks(dropped);
    }

    /// These are not done: every requester that waits for them gets the error.
    pub(super) fn drop_tasks(&mut self, numbers: Vec<u64>) {
        for number in numbers {
            // Its worker may have completed the trace just before it left; without a line it is of no scenario.
            if let Some(Task { submission: Some(submission), .. }) = self.jobs.tasks.get(&number)
                && let Some(record) = &self.book.record
                && !record.ledger.has(&submission.id)
            {
                let _ = std::fs::remove_file(record.directory.trace_path(&submission.id));
            }
            self.finish(number, Err(interrupt::error()));
        }
    }

    /// Ends the workers that wait for a simulator: nothing is in flight there yet that could be finished.
    pub(super) fn stop_waiting(&mut self) {
        let is_waiting = |number: &u64| {
            self.jobs
                .tasks
                .get(number)
                .is_some_and(|task| task.external && !task.began && task.given.elapsed() > UNDER_WAY)
        };
        let (mut waiting, others) =
            std::mem::take(&mut self.workers.connections).into_iter().partition::<Vec<_>, _>(|connection| {
                let jobs = connection.jobs();
                !jobs.is_empty() && jobs.iter().all(is_waiting)
            });
        self.workers.connections = others;
        if waiting.is_empty() {
            return;
        }
        leave(&mut waiting, DROP);
        self.drop_tasks(waiting.iter().flat_map(Connection::jobs).collect());
    }

    /// Ends the session. Workers say what happened when their components took leave.
    pub(super) fn leave(&mut self, events: &Receiver<Event>) {
        let mut speaking: HashSet<u64> =
            self.workers.connections.iter().map(|connection| connection.number).collect();
        self.workers.let_go(LEAVE);
        while !speaking.is_empty() {
            match events.recv_timeout(LAST_WORDS) {
                Ok(Event::Worker(number, found)) => match *found {
                    Found::Message(FromWorker::Trouble(sentence)) => self.tally.note(sentence),
                    Found::End => {
                        speaking.remove(&number);
                    }
                    _ => {}
                },
                Ok(_) => {}
                Err(_) => break,
            }
        }
        if let Some(record) = &self.book.record {
            record.directory.remove_partial_traces();
        }
        let _ = pdk_bus::sweep_run(&self.options.run);
    }
}
