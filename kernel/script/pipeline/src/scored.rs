//! An evaluation whose metric is a function of the pipeline: the function gets the outputs for each picture, and returns numbers.

use mlua::{ExternalError, Function, Lua, Table, Value as LuaValue};
use pdk_sdk::error::{Error, Result};
use serde_json::{Value, json};

use crate::bridge::{call, with_host};
use crate::evaluation::TaskFrame;
use crate::values::{from_lua, to_lua};

/// What errors call the result of a metric.
const RETURNED: &str = "what `score` of the task returned";

/// The function `score` of the task of a request, and the request without it; none if it has none.
///
/// # Errors
/// If the virtual machine is out of memory.
pub fn score_of(lua: &Lua, request: &LuaValue) -> mlua::Result<Option<(LuaValue, Function)>> {
    let Some(table) = request.as_table() else { return Ok(None) };
    let LuaValue::Table(task) = table.raw_get::<LuaValue>("task")? else { return Ok(None) };
    let LuaValue::Function(score) = task.raw_get::<LuaValue>("score")? else { return Ok(None) };
    let task = without(lua, &task, "score")?;
    let request = without(lua, table, "task")?;
    request.raw_set("task", task)?;
    Ok(Some((LuaValue::Table(request), score)))
}

fn without(lua: &Lua, table: &Table, field: &str) -> mlua::Result<Table> {
    let copy = lua.create_table()?;
    for pair in table.pairs::<LuaValue, LuaValue>() {
        let (key, value) = pair?;
        if key.as_string().is_none_or(|key| key != field) {
            copy.raw_set(key, value)?;
        }
    }
    Ok(copy)
}

/// Evaluates with a function of the pipeline.
///
/// # Errors
/// What the function fails with, and what keeps pictures from being evaluated.
pub fn conduct(lua: &Lua, request: Value, score: &Function) -> mlua::Result<LuaValue> {
    let mut run = with_host(lua, |host| host.begin_task(request))?;
    while let Some(mut piece) = with_host(lua, |host| host.next_piece(&mut run))? {
        for frame in &mut piece.frames {
            let TaskFrame::Good { original, perturbed, .. } = frame else { continue };
            for kept in std::iter::once(original).chain(perturbed) {
                let scored: LuaValue = score.call(to_lua(lua, kept)?)?;
                *kept = numbers(&scored).map_err(ExternalError::into_lua_err)?;
            }
        }
        with_host(lua, |host| host.keep_piece(&mut run, piece))?;
    }
    call(lua, |host| host.finish_task(run))
}

/// What a function returned: numbers by name.
fn numbers(scored: &LuaValue) -> Result<Value> {
    from_lua(scored, RETURNED).and_then(named)
}

/// What a metric returned, as numbers by name: a number alone is the score.
///
/// # Errors
/// If it is neither a number nor a table of numbers.
pub fn named(returned: Value) -> Result<Value> {
    match &returned {
        Value::Number(_) => Ok(json!({ "score": returned })),
        Value::Object(numbers) if !numbers.is_empty() && numbers.values().all(Value::is_number) => {
            Ok(returned)
        }
        _ => Err(Error::new(format!(
            "{RETURNED} is {returned}, but has to be a number, or a table of numbers such as {{ error = 0.5 }}"
        ))),
    }
}
