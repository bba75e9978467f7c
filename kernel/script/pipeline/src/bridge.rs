//! How a script reaches the host: values cross as JSON, and the time that the host takes is not the script's.

use mlua::{ExternalError, Function, Lua, MultiValue, Table, Value as LuaValue};
use pdk_lua::unknown::{index, strict};
use pdk_lua::without_clock;
use pdk_model::component::ComponentSpec;
use pdk_sdk::error::{Error, Result};
use serde_json::Value;

use crate::host::Host;
use crate::values::{from_lua, to_lua};

/// Where the metatable of outcomes is kept in a virtual machine.
const OUTCOME: &str = "pdk outcome";
/// The field of an outcome that says whose it is.
const TICKET: &str = "ticket";

/// A function of the host as a Lua function: values cross as JSON, and the time it takes is not the script's.
pub fn function<const N: usize>(
    lua: &Lua,
    name: &'static str,
    work: fn(&mut Host, [Value; N]) -> Result<Value>,
) -> mlua::Result<Function> {
    lua.create_function(move |lua, arguments: MultiValue| {
        let mut given = arguments.into_iter();
        let mut values = [const { Value::Null }; N];
        for (number, value) in values.iter_mut().enumerate() {
            let place = if N == 1 { name.to_owned() } else { format!("{name}: argument {}", number + 1) };
            let argument = given.next().unwrap_or(LuaValue::Nil);
            *value = from_lua(&argument, &place).map_err(ExternalError::into_lua_err)?;
        }
        call(lua, |host| work(host, values))
    })
}

/// `pdk.settings`: a misspelt setting would be nil, with which a request takes its default.
pub fn settings(lua: &Lua, defaults: &LuaValue) -> mlua::Result<LuaValue> {
    let defaults = from_lua(defaults, "pdk.settings").map_err(ExternalError::into_lua_err)?;
    let settings = call(lua, |host| host.settings(defaults))?;
    if let LuaValue::Table(table) = &settings {
        let names = table.pairs::<String, LuaValue>().map(|pair| Ok(pair?.0));
        let metatable = lua.create_table()?;
        // Not protected: a script may clone the table.
        metatable.raw_set(
            "__index",
            index(lua, "the pipeline", "setting", names.collect::<mlua::Result<_>>()?)?,
        )?;
        table.set_metatable(Some(metatable))?;
    }
    Ok(settings)
}

/// Calls the host, and hands its result to the script.
pub fn call(lua: &Lua, work: impl FnOnce(&mut Host) -> Result<Value>) -> mlua::Result<LuaValue> {
    let result = with_host(lua, work)?;
    to_lua(lua, &result)
}

/// Calls the host, and hands the outcome that it returns to the script.
pub fn outcome(lua: &Lua, work: impl FnOnce(&mut Host) -> Result<Value>) -> mlua::Result<LuaValue> {
    let result = with_host(lua, work)?;
    outcome_to_lua(lua, &result)
}

/// Waits for the outcomes of these tickets, and hands them to the script one by one, since there may be many. If one of them is an error, the
/// others are waited for as well: then nothing is under way any more when the script goes on.
pub fn all_outcomes<T>(
    lua: &Lua,
    tickets: Vec<T>,
    mut wait: impl FnMut(&mut Host, T) -> Result<Value>,
) -> mlua::Result<LuaValue> {
    let mut list = lua.create_table();
    for ticket in tickets {
        let outcome = match &list {
            Ok(_) => outcome(lua, |host| wait(host, ticket)),
            Err(_) => with_host(lua, |host| wait(host, ticket)).map(|_| LuaValue::Nil),
        };
        list = list.and_then(|list| list.raw_push(outcome?).map(|()| list));
    }
    list.map(LuaValue::Table)
}

/// An outcome for a script, for which a field that outcomes do not have is an error.
pub fn outcome_to_lua(lua: &Lua, result: &Value) -> mlua::Result<LuaValue> {
    let value = to_lua(lua, result)?;
    let (Some(fields), Some(table)) = (result.as_object(), value.as_table()) else { return Ok(value) };
    let metatable = match lua.named_registry_value::<Option<Table>>(OUTCOME)? {
        Some(metatable) => metatable,
        None => {
            // Also the fields that say nothing, which Lua does not see. The ticket belongs to outcomes of `next` alone.
            let mut known: Vec<String> = fields.keys().cloned().collect();
            if !fields.contains_key(TICKET) {
                known.push(TICKET.to_owned());
            }
            let metatable = strict(lua, "an outcome", "field", known)?;
            lua.set_named_registry_value(OUTCOME, &metatable)?;
            metatable
        }
    };
    table.set_metatable(Some(metatable))?;
    Ok(value)
}

/// Calls the host. The time it takes is not the script's.
pub fn with_host<T>(lua: &Lua, work: impl FnOnce(&mut Host) -> Result<T>) -> mlua::Result<T> {
    let mut host = lua
        .app_data_mut::<Host>()
        .ok_or_else(|| Error::new("this function is available only in pipelines").into_lua_err())?;
    without_clock(|| work(&mut host)).map_err(ExternalError::into_lua_err)
}

/// Rate and duration of a scenario, with what it leaves to its defaults.
pub fn frames_of(
    lua: &Lua,
    scenario: &Table,
    defaults: &dyn Fn(&str) -> mlua::Result<LuaValue>,
) -> mlua::Result<(f64, f64)> {
    let field = |name: &str| match scenario.raw_get::<LuaValue>(name)? {
        LuaValue::Nil => defaults(name),
        own => Ok(own),
    };
    let simulator = from_lua(&field("simulator")?, "simulator").map_err(ExternalError::into_lua_err)?;
    let simulator = ComponentSpec::from_json("simulator", &simulator).map_err(ExternalError::into_lua_err)?;
    let duration = field("duration")?;
    let duration = duration.as_f64().or(duration.as_i64().map(|whole| whole as f64));
    let rate = with_host(lua, |host| host.rate(&simulator))?;
    Ok((rate, duration.unwrap_or(pdk_model::scenario::DEFAULT_DURATION)))
}
