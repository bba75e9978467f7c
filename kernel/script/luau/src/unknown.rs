//! Names that are not there: an error says what was probably meant, where Lua would say nothing, or that nothing cannot be called.

use mlua::{AnyUserData, Function, Lua, MetaMethod, Table, UserDataMethods, UserDataRegistry, Value};
use pdk_sdk::suggest;

use crate::failure::type_of;

/// The error for a name that is not there; `owner` has the `known` ones, which are of this `sort`.
pub(crate) fn unknown(owner: &str, sort: &str, name: &Value, known: &[String]) -> mlua::Error {
    let wanted = match name {
        Value::String(name) => name.to_string_lossy(),
        _ => String::new(),
    };
    let remedy = suggest::hint(&wanted, known.iter().map(String::as_str));
    mlua::Error::runtime(format!("{owner} has no {sort} {}; {remedy}", shown(name)))
}

/// A name in an error.
pub(crate) fn shown(name: &Value) -> String {
    match name {
        Value::String(name) => format!("`{}`", name.to_string_lossy()),
        other => format!("for {}", type_of(other)),
    }
}

/// A function for `__index` that knows these names: a table need not have all of them, and has no others.
///
/// # Errors
/// If the virtual machine is out of memory.
pub fn index(
    lua: &Lua,
    owner: &'static str,
    sort: &'static str,
    known: Vec<String>,
) -> mlua::Result<Function> {
    lua.create_function(move |_, (_, name): (Value, Value)| -> mlua::Result<Value> {
        let is_known = matches!(&name, Value::String(name) if known.iter().any(|known| *name == *known));
        if is_known { Ok(Value::Nil) } else { Err(unknown(owner, sort, &name, &known)) }
    })
}

/// A metatable for tables that have these names and no others, of which some may be left out. `owner` is what errors call such a table.
///
/// # Errors
/// If the virtual machine is out of memory.
pub fn strict(lua: &Lua, owner: &'static str, sort: &'static str, known: Vec<String>) -> mlua::Result<Table> {
    let metatable = lua.create_table()?;
    metatable.raw_set("__index", index(lua, owner, sort, known)?)?;
    metatable.raw_set("__metatable", false)?;
    Ok(metatable)
}

/// As [`strict`], for tables that a script is handed: `refused` is the error of a name that it wants to add, given what [`unknown`] is given.
pub(crate) fn closed(
    lua: &Lua,
    owner: &'static str,
    sort: &'static str,
    known: Vec<String>,
    refused: fn(&str, &str, &Value, &[String]) -> mlua::Error,
) -> mlua::Result<Table> {
    let metatable = strict(lua, owner, sort, known.clone())?;
    let add = lua.create_function(move |_, (_, name, _): (Value, Value, Value)| -> mlua::Result<()> {
        Err(refused(owner, sort, &name, &known))
    })?;
    metatable.raw_set("__newindex", add)?;
    metatable.set_readonly(true);
    Ok(metatable)
}

/// Refuses what a class does not have.
pub fn refuse_unknown<T: 'static>(
    registry: &mut UserDataRegistry<T>,
    owner: &'static str,
    known: Vec<String>,
) {
    registry.add_meta_function(
        MetaMethod::Index,
        move |_, (_, name): (AnyUserData, Value)| -> mlua::Result<Value> {
            Err(unknown(owner, "method or field", &name, &known))
        },
    );
}
