//! What a script changes that acts on controls, or on what the driver gets besides the frame.

use mlua::{Lua, LuaString, Table, Value};
use pdk_sdk::describe::ActsOn;
use pdk_sdk::driver::{Control, DriveContext};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::signals::Numbers;

use crate::failure::type_of;
use crate::unknown;

/// The table that a script changes in place, used again for every frame.
pub(crate) struct ScriptSignal {
    pub table: Table,
    names: [LuaString; 2],
}

impl ScriptSignal {
    /// The table of what a perturbation acts on.
    pub fn new(lua: &Lua, acts_on: ActsOn) -> mlua::Result<Self> {
        let (owner, names) = match acts_on {
            ActsOn::Control => ("the control", Control::NUMBERS),
            ActsOn::Observation | ActsOn::Frame => ("what the driver gets", DriveContext::NUMBERS),
        };
        let table = lua.create_table()?;
        let known = names.map(str::to_owned).to_vec();
        let metatable = unknown::closed(lua, owner, "field", known, unknown::unknown)?;
        table.set_metatable(Some(metatable))?;
        let [first, second] = names;
        Ok(Self { table, names: [lua.create_string(first)?, lua.create_string(second)?] })
    }

    /// Puts numbers into the table.
    pub fn set(&self, numbers: Numbers) -> mlua::Result<()> {
        self.write(&self.table, numbers)
    }

    /// The numbers as the script left them.
    ///
    /// # Errors
    /// If one is not a number any more.
    pub fn get(&self) -> Result<Numbers> {
        let mut numbers = [0.0; 2];
        for (number, name) in numbers.iter_mut().zip(&self.names) {
            *number = match self.table.raw_get::<Value>(name).place("the table that it changes")? {
                Value::Number(number) => number,
                Value::Integer(number) => number as f64,
                other => {
                    let name = name.to_string_lossy();
                    return Err(Error::new(format!(
                        "it leaves `{name}` as {}, but it has to be a number",
                        type_of(&other)
                    )));
                }
            };
        }
        Ok(numbers)
    }

    /// Puts numbers into another table, one of `cx.history`.
    pub fn write(&self, table: &Table, numbers: Numbers) -> mlua::Result<()> {
        for (name, number) in self.names.iter().zip(numbers) {
            table.raw_set(name, number)?;
        }
        Ok(())
    }
}

/// What a script's function returned, which has to be nothing.
pub(crate) fn returned_nothing(returned: &Value, script: &str) -> Result<()> {
    match returned {
        Value::Nil => Ok(()),
        other => Err(Error::new(format!(
            "it returns {}, but has to change the table in place and return nothing",
            type_of(other)
        ))),
    }
    .place(script)
}
