//! The virtual machine that a script runs in, and its limits.
//!
//! The order matters: first everything a script can call is installed, then the machine is sandboxed, then scripts
//! are loaded. Luau then knows that the functions cannot change and compiles scripts to fast native code.
//!
//! What a script cannot do: read or write files, start processes, use the network, read the clock, draw random numbers
//! that do not come from the run's seed, load compiled code, or change the globals of another script.
//!
//! What is left that differs between runs: the text of a table or function (`tostring({})`) is its address, and `pairs`
//! visits keys that are tables or functions in the order of theirs. Keys that are numbers or texts have a fixed
//! order.

use std::ffi::c_int;
use std::panic::{AssertUnwindSafe, catch_unwind};

use mlua::chunk::Compiler;
use mlua::{Function, IntoLuaMulti, Lua, LuaOptions, MultiValue, StdLib, Value, ffi};
use pdk_notice::eprintln;
use pdk_sdk::error::{Error, Result};

use crate::limits::{Limits, MEMORY_VARIABLE, TIME_VARIABLE};
use crate::watchdog::{Registration, Stop};
use crate::{arithmetic, bounds, chunk, failure};

/// A virtual machine for one script.
pub struct Sandbox {
    // Dropped first: the watchdog must not look into a machine that is gone.
    registration: Registration,
    handler: Function,
    limits: Limits,
    lua: Lua,
}

impl Sandbox {
    /// A machine with Luau's own harmless libraries: `string`, `table`, `math`, `buffer`, `bit32`, `utf8`, `coroutine`.
    ///
    /// # Errors
    /// If the memory limit leaves no room for them, or the watchdog thread cannot be started.
    pub fn new(limits: Limits) -> Result<Self> {
        Self::with_api(limits, |_| Ok(()))
    }

    /// A machine in which `install` adds globals before they are frozen.
    ///
    /// # Errors
    /// As [`Sandbox::new`], and what `install` returns.
    pub fn with_api(limits: Limits, install: impl FnOnce(&Lua) -> mlua::Result<()>) -> Result<Self> {
        let set_up = || -> mlua::Result<(Lua, Function)> {
            let libraries = StdLib::STRING
                | StdLib::TABLE
                | StdLib::MATH
                | StdLib::BUFFER
                | StdLib::BIT
                | StdLib::UTF8
                | StdLib::COROUTINE;
            let lua = Lua::new_with(libraries, LuaOptions::default())?;
            let globals = lua.globals();
            for removed in REMOVED {
                globals.raw_set(*removed, mlua::Nil)?;
            }
            globals.raw_set("print", lua.create_function(print)?)?;
            arithmetic::install(&lua)?;
            bounds::install(&lua)?;
            install(&lua)?;
            // SAFETY: the handler keeps to the calling convention and leaves its argument as its result.
            let handler = unsafe { lua.create_c_function(failure::handler)? };
            lua.sandbox(true)?;
            lua.set_compiler(
                Compiler::new()
                    .set_optimization_level(2)
                    // With the names of variables, for `Kept`.
                    .set_debug_level(2)
                    .set_type_info_level(1)
                    .set_disabled_builtins(arithmetic::disabled_builtins()),
            );
            lua.set_memory_limit(limits.memory_bytes)?;
            Ok((lua, handler))
        };
        let (lua, handler) = set_up().map_err(|error| {
            Error::new(format!("the virtual machine for scripts cannot be set up: {error}"))
        })?;
        Ok(Self { registration: Registration::new(&lua)?, handler, limits, lua })
    }

    /// The machine, to make values in.
    pub fn lua(&self) -> &Lua {
        &self.lua
    }

    /// Asks `stop` every few milliseconds while a script of this machine runs; where it answers, the script is ended, and the
    /// call returns that error. May be set once. `stop` is called by another thread and must neither wait nor panic.
    pub fn stop_when(&mut self, stop: Stop) {
        self.registration.stop_when(stop);
    }

    /// Gives the scripts of this machine other limits.
    ///
    /// # Errors
    /// If they use more memory than they may from now on.
    pub fn set_limits(&mut self, script: &str, limits: Limits) -> Result<()> {
        if limits == self.limits {
            return Ok(());
        }
        if limits.memory_bytes < self.lua.used_memory() {
            self.make(script, |lua| lua.gc_collect().and_then(|()| lua.gc_collect()))?;
        }
        self.limits = limits;
        self.make(script, |lua| lua.set_memory_limit(limits.memory_bytes))?;
        if limits.memory_bytes < self.lua.used_memory() {
            failure::forget_location();
            return Err(self.out_of_memory(script));
        }
        Ok(())
    }

    /// Compiles the text of a script. `script` is its name in errors, usually its path.
    ///
    /// # Errors
    /// Names the line that cannot be compiled.
    pub fn load(&self, script: &str, source: &[u8]) -> Result<Function> {
        failure::forget_location();
        chunk::load(&self.lua, script, source, None).map_err(|error| self.explain(script, &error))
    }

    /// Calls a function of a script within the limits and returns its first result.
    ///
    /// # Errors
    /// One sentence with the script's name and line: what the script raised, or which limit it ran into. The machine can
    /// be used afterwards.
    pub fn call(&self, script: &str, function: &Function, arguments: impl IntoLuaMulti) -> Result<Value> {
        failure::forget_location();
        let running = self.registration.start(self.limits.time, self.limits.renewed);
        let mut status: c_int = ffi::LUA_OK;
        // A panic of a host function travels through the script as an error and comes out here again.
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let mut values = arguments.into_lua_multi(&self.lua)?;
            values.push_front(Value::Function(function.clone()));
            values.push_front(Value::Function(self.handler.clone()));
            // SAFETY: the stack holds the handler, the function and its arguments; the protected call replaces all but
            // the handler by one value. The closure owns nothing that an unwinding error would leak.
            unsafe {
                self.lua.exec_raw::<Value>(values, |state| {
                    let arguments = ffi::lua_gettop(state) - 2;
                    status = ffi::lua_pcall(state, arguments, 1, 1);
                    ffi::lua_remove(state, 1);
                })
            }
        }));
        let (rang, stopped) = (running.rang(), running.stopped());
        drop(running);
        if rang {
            return Err(stopped.unwrap_or_else(|| self.out_of_time(script)));
        }
        match outcome {
            Ok(Ok(value)) if status == ffi::LUA_OK => Ok(value),
            Ok(Ok(Value::Error(error))) => Err(self.explain(script, &error)),
            Ok(Ok(_)) if status == ffi::LUA_ERRMEM => Err(self.out_of_memory(script)),
            Ok(Ok(raised)) => Err(failure::raised(script, &raised)),
            Ok(Err(error)) => Err(self.explain(script, &error)),
            Err(panic) => {
                let text = panic
                    .downcast_ref::<String>()
                    .map(String::as_str)
                    .or_else(|| panic.downcast_ref::<&str>().copied())
                    .unwrap_or("without a message");
                Err(Error::new(format!("a host function failed, which is a defect in pdk: {text}"))
                    .at(failure::location(script)))
            }
        }
    }

    /// Makes a value for a script outside of a call.
    ///
    /// # Errors
    /// If memory runs out, in one sentence.
    pub fn make<T>(&self, script: &str, make: impl FnOnce(&Lua) -> mlua::Result<T>) -> Result<T> {
        failure::forget_location();
        make(&self.lua).map_err(|error| self.explain(script, &error))
    }

    /// The sentence for an error of the binding.
    fn explain(&self, script: &str, error: &mlua::Error) -> Error {
        if failure::is_memory(error) { self.out_of_memory(script) } else { failure::binding(script, error) }
    }

    fn out_of_time(&self, script: &str) -> Error {
        let seconds = (self.limits.time.as_secs_f64() * 1000.0).round() / 1000.0;
        let used = match self.limits.renewed {
            true => format!("computed for more than {seconds} s at a stretch"),
            false => format!("used more than {seconds} s of processor time"),
        };
        Error::new(format!("{used}; make the loop shorter or raise the limit with {TIME_VARIABLE}"))
            .at(failure::location(script))
    }

    fn out_of_memory(&self, script: &str) -> Error {
        let error = Error::new(format!(
            "used more than {} MiB of memory; keep less or raise the limit with {MEMORY_VARIABLE}",
            (self.limits.memory_bytes as f64 / f64::from(1 << 20) * 10.0).round() / 10.0
        ))
        .at(failure::location(script));
        // Two rounds: what is finalized in the first is freed in the second. Should it fail, the next call says so.
        let _ = self.lua.gc_collect().and_then(|()| self.lua.gc_collect());
        error
    }
}

/// The longest line that a script prints, in bytes.
const LONGEST_LINE: usize = 1 << 20;

/// Globals that a script gets no sight of.
const REMOVED: &[&str] = &[
    // Load code.
    "loadstring",
    "require",
    // Look at the collector, whose state differs between runs.
    "collectgarbage",
    "gcinfo",
    // Reach into functions and turn off their optimization.
    "getfenv",
    "setfenv",
    "newproxy",
    "_VERSION",
];

/// `print`: a line on standard error, because standard output is for results.
fn print(_: &Lua, values: MultiValue) -> mlua::Result<()> {
    let mut line = String::new();
    for (index, value) in values.iter().enumerate() {
        if index > 0 {
            line.push('\t');
        }
        line.push_str(&value.to_string()?);
        // It lies outside of the script's memory.
        if line.len() > LONGEST_LINE {
            return Err(mlua::Error::runtime(format!(
                "print takes at most {LONGEST_LINE} bytes at once; print less"
            )));
        }
    }
    eprintln!("{line}");
    Ok(())
}

#[cfg(test)]
mod tests;
