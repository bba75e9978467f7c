//! The workers of a session: the connections to them, and the slots that are out of use.

use std::collections::{BTreeMap, HashMap};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use pdk_loop::protocol::{Hello, MINOR, VERSION};
use pdk_sdk::describe::Parameter;
use pdk_sdk::error::{Error, Result};

use crate::connection::{Connection, Pool};
use crate::submission::{Event, Options};

/// The workers there are.
pub struct Workers {
    pool: Pool,
    hello: Hello,
    sender: Sender<Event>,
    /// The connections that are open.
    pub connections: Vec<Connection>,
    /// How many connections there were.
    opened: u64,
    /// The slots that are given nothing any more, and what their machine lacks for what they were given.
    pub out: BTreeMap<u32, Error>,
    /// How many workers in a row were killed before they were ready.
    pub stillborn: u32,
    /// The simulators that are programs of their own, with the parameters by which pdk starts one for each worker. Without them the
    /// user has started one, or some.
    pub external: HashMap<String, Vec<Parameter>>,
}

impl Workers {
    /// None yet; what they say goes to `sender`.
    pub fn new(options: &Options, sender: Sender<Event>) -> Self {
        let hello = Hello {
            protocol: VERSION,
            minor: MINOR,
            run: options.run.clone(),
            patience: options.limits.patience.as_secs_f64(),
            memory: options.limits.memory,
            search: options.search.absolute(),
        };
        Self {
            pool: options.pool.clone(),
            hello,
            sender,
            connections: Vec::new(),
            opened: 0,
            out: BTreeMap::new(),
            stillborn: 0,
            external: HashMap::new(),
        }
    }

    /// Starts another worker.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn connect(&mut self) -> Result<()> {
        let taken: Vec<u32> = self.connections.iter().map(|connection| connection.first_slot).collect();
        let is_out = |slot: &u32| self.pool.is_here() && self.out.contains_key(slot);
        let free = (0..).find(|slot| !taken.contains(slot) && !is_out(slot)).unwrap_or_default();
        let number = self.opened;
        self.opened += 1;
        let sender = self.sender.clone();
        let wrap = |number, found| Event::Worker(number, Box::new(found));
        let connection = Connection::open(&self.pool, &self.hello, number, free, sender, wrap)?;
        self.connections.push(connection);
        Ok(())
    }

    /// How many connections there may be at a time: on this machine none for slots that are out.
    pub fn most(&self) -> usize {
        let most = self.pool.connections();
        if self.pool.is_here() { most - self.out.len().min(most) } else { most }
    }

    /// How many slots are at work.
    pub fn busy(&self) -> usize {
        self.connections.iter().map(|connection| connection.jobs().len()).sum()
    }

    /// Says to all workers that there are no more jobs, and ends those that have not left by then.
    pub fn let_go(&mut self, limit: Duration) {
        leave(&mut self.connections, limit);
        self.connections.clear();
    }
}

/// Says to workers that there are no more jobs, and ends those that have not left by then.
pub fn leave(connections: &mut [Connection], limit: Duration) {
    connections.iter_mut().for_each(Connection::close);
    let until = Instant::now() + limit;
    for connection in connections {
        connection.wait(until.saturating_duration_since(Instant::now()));
    }
}
