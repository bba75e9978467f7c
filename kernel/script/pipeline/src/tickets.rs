//! The tickets that a pipeline has been given, as the numbers that it knows.

use std::collections::{BTreeMap, BTreeSet};

use pdk_sdk::error::{Error, Result};
use pdk_session::session::Ticket;
use serde_json::Value;

use crate::host::Host;

/// Tickets by number, from 1.
pub struct Tickets {
    /// The function that takes them, for errors.
    function: &'static str,
    tickets: BTreeMap<u64, Ticket>,
    /// The same the other way round.
    numbers: BTreeMap<Ticket, u64>,
    /// Those whose outcomes have not been taken.
    open: BTreeSet<Ticket>,
}

impl Tickets {
    /// None yet; `function` is what errors call the function that takes one.
    pub fn new(function: &'static str) -> Self {
        Self { function, tickets: BTreeMap::new(), numbers: BTreeMap::new(), open: BTreeSet::new() }
    }

    /// Takes a ticket, and returns its number.
    pub fn add(&mut self, ticket: Ticket) -> u64 {
        let number = self.tickets.len() as u64 + 1;
        self.tickets.insert(number, ticket);
        self.numbers.insert(ticket, number);
        self.open.insert(ticket);
        number
    }

    /// The ticket with a number.
    pub fn ticket(&self, number: &Value) -> Option<Ticket> {
        number.as_u64().and_then(|number| self.tickets.get(&number)).copied()
    }

    /// Waits for the outcome of a ticket.
    ///
    /// # Errors
    /// If there is no such ticket, or the scenario came to nothing.
    pub fn wait(&mut self, host: &mut Host, number: &Value) -> Result<Value> {
        let ticket = self.ticket(number).ok_or_else(|| {
            Error::new(format!(
                "{} takes a ticket that was given for a scenario, not {number}",
                self.function
            ))
        })?;
        let outcome = host.wait(ticket);
        self.open.remove(&ticket);
        outcome
    }

    /// Waits for the next outcome, with its ticket; null where all have been taken.
    ///
    /// # Errors
    /// If the scenario came to nothing.
    pub fn next(&mut self, host: &mut Host) -> Result<Value> {
        let Some((ticket, outcome)) = host.next(&self.open)? else { return Ok(Value::Null) };
        self.open.remove(&ticket);
        let mut outcome = outcome?;
        outcome["ticket"] = self.numbers.get(&ticket).copied().into();
        Ok(outcome)
    }

    /// How many outcomes have not been taken.
    pub fn open(&self) -> usize {
        self.open.len()
    }
}
