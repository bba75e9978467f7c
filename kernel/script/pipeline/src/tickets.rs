//! The tickets that a pipeline has been given, as the numbers that it knows.

use std::collections::BTreeSet;

use pdk_sdk::error::{Error, Result};
use pdk_session::session::Ticket;
use serde_json::Value;

use crate::host::Host;

/// Tickets by number, from 1.
pub struct Tickets {
    /// The function that takes them, for errors.
    function: &'static str,
    tickets: Vec<Ticket>,
    /// Those whose outcomes have not been taken.
    open: BTreeSet<Ticket>,
}

impl Tickets {
    /// None yet; `function` is what errors call the function that takes one.
    pub fn new(function: &'static str) -> Self {
        Self { function, tickets: Vec::new(), open: BTreeSet::new() }
    }

    /// Takes a ticket, which is later than those before it, and returns its number.
    pub fn add(&mut self, ticket: Ticket) -> u64 {
        self.tickets.push(ticket);
        self.open.insert(ticket);
        self.tickets.len() as u64
    }

    /// The ticket with a number.
    pub fn ticket(&self, number: &Value) -> Option<Ticket> {
        let place = usize::try_from(number.as_u64()?.checked_sub(1)?).ok()?;
        self.tickets.get(place).copied()
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
        outcome["ticket"] = self.tickets.binary_search(&ticket).ok().map(|place| place + 1).into();
        Ok(outcome)
    }

    /// How many outcomes have not been taken.
    pub fn open(&self) -> usize {
        self.open.len()
    }
}
