//! What there is to do, and what waits to be given away.

use std::collections::{HashMap, VecDeque};
use std::time::Instant;

use pdk_loop::protocol::Work;
use pdk_model::scenario::ScenarioId;

use crate::submission::{Ticket, WaitingSubmission};

/// A job and who waits for it.
pub struct Task {
    /// What there is to do; none for a scenario that is recorded, until it is given away.
    pub work: Option<Box<Work>>,
    /// A scenario that is recorded, as it waits.
    pub submission: Option<WaitingSubmission>,
    /// Who waits for it.
    pub waiting: Vec<Ticket>,
    /// How often it was given away.
    pub tries: u32,
    /// Whether its simulator is a program of its own, which may be waited for.
    pub external: bool,
    /// Whether only the first slot may do it.
    pub first_only: bool,
    /// When it was given away last.
    pub given: Instant,
    /// Whether frames have come of it since.
    pub began: bool,
    /// When its worker last said something of it.
    pub heard: Instant,
}

impl Task {
    /// A task for the holder of this ticket.
    pub fn new(work: Option<Box<Work>>, submission: Option<WaitingSubmission>, ticket: Ticket) -> Self {
        let now = Instant::now();
        Self {
            work,
            submission,
            waiting: vec![ticket],
            tries: 0,
            external: false,
            first_only: false,
            given: now,
            began: false,
            heard: now,
        }
    }
}

/// The tasks by their numbers.
#[derive(Default)]
pub struct Jobs {
    /// All of them.
    pub tasks: HashMap<u64, Task>,
    /// Those that wait for a slot, in their order.
    pub queue: VecDeque<u64>,
    /// The scenarios among them.
    scenarios: HashMap<ScenarioId, u64>,
    next: u64,
}

impl Jobs {
    /// Adds a task at the end of the queue.
    pub fn add(&mut self, task: Task) {
        let number = self.next;
        self.next += 1;
        if let Some(submission) = &task.submission {
            self.scenarios.insert(submission.id, number);
        }
        self.tasks.insert(number, task);
        self.queue.push_back(number);
    }

    /// The task that drives a scenario.
    pub fn of_scenario(&mut self, id: &ScenarioId) -> Option<&mut Task> {
        self.tasks.get_mut(self.scenarios.get(id)?)
    }

    /// Takes out a task that is over.
    pub fn remove(&mut self, number: u64) -> Option<Task> {
        let task = self.tasks.remove(&number)?;
        if let Some(submission) = &task.submission {
            self.scenarios.remove(&submission.id);
        }
        Some(task)
    }
}
