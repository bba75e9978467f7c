//! What `pdk.session` returns: an object to submit scenarios to and to wait for outcomes with.

use mlua::{ExternalError, Lua, UserData, UserDataMethods, UserDataRegistry, Value as LuaValue};
use pdk_lua::{ApiClass, ApiMethod};
use pdk_sdk::error::{Error, Result};

use crate::bridge::{all_outcomes, frames_of, outcome, with_host};
use crate::levels;
use crate::requests::Defaults;
use crate::tickets::Tickets;
use crate::values::{entries, from_lua};

/// A session as a script sees it.
pub struct SessionObject {
    defaults: Defaults,
    simulator: Option<LuaValue>,
    duration: Option<LuaValue>,
    tickets: Tickets,
}

impl SessionObject {
    /// A session whose scenarios have these defaults; simulator and duration also as the script wrote them.
    pub fn new(defaults: Defaults, simulator: Option<LuaValue>, duration: Option<LuaValue>) -> Self {
        Self { defaults, simulator, duration, tickets: Tickets::new("session:wait") }
    }

    fn submit(&mut self, lua: &Lua, scenario: &LuaValue) -> mlua::Result<u64> {
        let defaults = |field: &str| {
            let own = if field == "simulator" { &self.simulator } else { &self.duration };
            Ok(own.clone().unwrap_or(LuaValue::Nil))
        };
        let scenario = levels::evaluated(lua, scenario, |own| frames_of(lua, own, &defaults))?;
        let place = "session:submit";
        let table = from_lua(&scenario, place).map_err(ExternalError::into_lua_err)?;
        let submission = self.defaults.submission(place, table).map_err(ExternalError::into_lua_err)?;
        let ticket = with_host(lua, |host| host.submit_one(submission))?;
        Ok(self.tickets.add(ticket))
    }
}

/// The entries of the list that a method takes.
fn list_of(value: &LuaValue, place: &str) -> Result<Vec<LuaValue>> {
    match value {
        LuaValue::Table(list) => entries(list, place)?.collect(),
        other => Err(Error::new(format!("{place} takes a list of scenarios, not a {}", other.type_name()))),
    }
}

/// Its class in Lua.
pub const SESSION: ApiClass<SessionObject> = ApiClass {
    name: "Session",
    doc: "Scenarios on their way to outcomes. What is submitted is driven as workers get free, while the pipeline goes on; what \
          the script has not waited for is driven before the run ends.",
    properties: &[],
    methods: &[
        ApiMethod {
            name: "submit",
            signature: "(scenario: Scenario) -> number",
            doc: "Submits a scenario, and returns a ticket for its outcome without waiting.",
            add: |registry, name| {
                registry
                    .add_method_mut(name, |lua, session, scenario: LuaValue| session.submit(lua, &scenario));
            },
        },
        ApiMethod {
            name: "wait",
            signature: "(ticket: number) -> Outcome",
            doc: "Waits for the outcome of a ticket.",
            add: |registry, name| {
                registry.add_method_mut(name, |lua, session, ticket: LuaValue| {
                    let number = from_lua(&ticket, "session:wait").map_err(ExternalError::into_lua_err)?;
                    outcome(lua, |host| session.tickets.wait(host, &number))
                });
            },
        },
        ApiMethod {
            name: "next",
            signature: "() -> (Outcome & { ticket: number })?",
            doc: "Waits for the next outcome. If several are there already, the one that was submitted first comes first. \
                  Returns nil if all have been taken. What comes first depends on the machine: a pipeline whose way depends \
                  on it takes another one each time.",
            add: |registry, name| {
                registry
                    .add_method_mut(name, |lua, session, ()| outcome(lua, |host| session.tickets.next(host)));
            },
        },
        ApiMethod {
            name: "drive",
            signature: "(scenarios: { Scenario }) -> { Outcome }",
            doc: "Submits scenarios, waits for all, and returns the outcomes in their order.",
            add: |registry, name| {
                registry.add_method_mut(name, |lua, session, scenarios: LuaValue| {
                    let scenarios =
                        list_of(&scenarios, "session:drive").map_err(ExternalError::into_lua_err)?;
                    let tickets = scenarios
                        .iter()
                        .map(|scenario| session.submit(lua, scenario))
                        .collect::<mlua::Result<Vec<u64>>>()?;
                    all_outcomes(lua, tickets, |host, ticket| session.tickets.wait(host, &ticket.into()))
                });
            },
        },
        ApiMethod {
            name: "pending",
            signature: "() -> number",
            doc: "How many submissions there are whose outcomes have not been taken.",
            add: |registry, name| {
                registry.add_method(name, |_, session, ()| Ok(session.tickets.open()));
            },
        },
    ],
};

impl UserData for SessionObject {
    fn register(registry: &mut UserDataRegistry<Self>) {
        SESSION.register(registry);
        SESSION.refuse_unknown(registry, "session");
    }
}
