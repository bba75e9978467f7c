//! `require`: what a pipeline shares with others.
//!
//! `require("./name")` is a file beside the one that asks, `require("@pdk/name")` one of the library that comes with pdk. A
//! module is run once, in the virtual machine of the pipeline and under its limits, with globals of its own.
//!
//! Modules are run without a protected call in between, so that an error has the place where it was raised, and a script that
//! is stuck in one is ended there.

use std::collections::HashMap;
use std::ffi::{CStr, c_int, c_void};
use std::mem::MaybeUninit;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use mlua::{Function, LightUserData, Lua, LuaString, RegistryKey, Table, Value, ffi};
use pdk_components::product::BuiltInScript;

use crate::chunk;
use crate::failure::type_of;
use crate::places::{Found, Places, Root};

/// How deep modules may require each other; the stack of host functions ends not far beyond.
const DEEPEST: usize = 32;

/// The modules of a pipeline. A clone is of the same ones.
#[derive(Clone)]
pub struct Modules(Arc<Mutex<State>>);

/// A module that was asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Loaded {
    /// As the script names it.
    pub name: String,
    /// The text that was run.
    pub source: String,
}

struct State {
    places: Places,
    /// Where relative names of a file begin, by its name in Luau. Not in here: the pipeline.
    bases: HashMap<Vec<u8>, Base>,
    /// Every module that was found, by its file.
    modules: HashMap<PathBuf, Entry>,
    /// In the order in which they were first asked for.
    loaded: Vec<Loaded>,
    /// Those that are being run, the outermost first.
    running: Vec<PathBuf>,
    /// Whether a virtual machine has them.
    installed: bool,
}

/// The folder of a file that asks.
#[derive(Clone)]
struct Base {
    root: Root,
    folder: PathBuf,
}

struct Entry {
    name: String,
    /// How Luau calls it.
    chunk: Function,
    /// What it returned.
    value: Option<RegistryKey>,
}

impl Modules {
    /// The modules of a pipeline in `folder`, which has none if it is part of pdk, and those of the library.
    pub fn new(folder: Option<&Path>, library: &'static [BuiltInScript]) -> Self {
        Self(Arc::new(Mutex::new(State {
            places: Places::new(folder, library),
            bases: HashMap::new(),
            modules: HashMap::new(),
            loaded: Vec::new(),
            running: Vec::new(),
            installed: false,
        })))
    }

    /// Sets the global `require`. To be used in [`Sandbox::with_api`](crate::Sandbox::with_api).
    ///
    /// # Errors
    /// If another virtual machine has these modules, or this one is out of memory.
    pub fn install(&self, lua: &Lua) -> mlua::Result<()> {
        if std::mem::replace(&mut self.state().installed, true) {
            return Err(mlua::Error::runtime("these modules are already in a virtual machine"));
        }
        let begin = {
            let modules = self.clone();
            lua.create_function(move |lua, (source, name): (Option<LuaString>, Value)| {
                modules.begin(lua, source, &name)
            })?
        };
        let end = {
            let modules = self.clone();
            lua.create_function(move |lua, value: mlua::Variadic<Value>| modules.end(lua, &value))?
        };
        let state = LightUserData(Arc::as_ptr(&self.0).cast_mut().cast());
        // SAFETY: the three values on the stack become the upvalues of the closure. The state lives for as long as it, because
        // the first of them holds it.
        let require = unsafe {
            lua.exec_raw::<Function>((begin, end, state), |lua| {
                ffi::lua_pushcclosurek(lua, require, c"require".as_ptr(), 3, None);
            })?
        };
        lua.globals().set("require", require)
    }

    /// The modules that were asked for, in the order in which they first were.
    pub fn loaded(&self) -> Vec<Loaded> {
        self.loaded_since(0)
    }

    /// Those of them behind the first ones, of which there are this many.
    pub fn loaded_since(&self, known: usize) -> Vec<Loaded> {
        self.state().loaded.iter().skip(known).cloned().collect()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        lock(&self.0)
    }

    /// Finds a module: its value if it has been run, else nothing and the function that runs it.
    fn begin(&self, lua: &Lua, source: Option<LuaString>, name: &Value) -> mlua::Result<(Value, Value)> {
        let Value::String(name) = name else {
            return Err(mlua::Error::runtime(format!(
                "require takes the name of a module, as in require(\"./name\"), not {}",
                type_of(name)
            )));
        };
        let mut state = self.state();
        let base = source.and_then(|source| state.bases.get(&*source.as_bytes()).cloned());
        let found = state
            .places
            .find(base.as_ref().map(|base| (base.root, base.folder.as_path())), &name.to_string_lossy());
        let found = found.map_err(|error| mlua::Error::runtime(error.message()))?;
        if let Some(known) = state.modules.get(&found.file) {
            if let Some(value) = &known.value {
                return Ok((lua.registry_value(value)?, Value::Nil));
            }
            if let Some(first) = state.running.iter().position(|file| *file == found.file) {
                let names = state.running[first..].iter().chain([&found.file]);
                let names: Vec<_> = names.map(|file| state.modules[file].name.as_str()).collect();
                return Err(mlua::Error::runtime(format!(
                    "modules require each other in a circle: {}; move what they share into one that requires none of them",
                    names.join(" -> ")
                )));
            }
        }
        if state.running.len() == DEEPEST {
            return Err(mlua::Error::runtime(format!(
                "modules require each other more than {DEEPEST} deep, down to {}; require some of them from the pipeline",
                found.name
            )));
        }
        let known = state.modules.get(&found.file).map(|known| known.chunk.clone());
        let chunk = match known {
            Some(chunk) => chunk,
            None => state.load(lua, &found)?,
        };
        state.running.push(found.file);
        Ok((Value::Nil, Value::Function(chunk)))
    }

    /// Notes what the innermost running module returned.
    fn end(&self, lua: &Lua, returned: &[Value]) -> mlua::Result<Value> {
        let mut state = self.state();
        let file = state.running.last().cloned();
        let entry = file.and_then(|file| state.modules.get_mut(&file));
        let entry =
            entry.ok_or_else(|| mlua::Error::runtime("no module is running, which is a defect in pdk"))?;
        let found = match returned {
            [value @ (Value::Table(_) | Value::Function(_))] => {
                entry.value = Some(lua.create_registry_value(value)?);
                return Ok(value.clone());
            }
            [] => "nothing".to_owned(),
            [other] => type_of(other),
            several => format!("{} values", several.len()),
        };
        Err(mlua::Error::runtime(format!(
            "the module {} returns {found}, but has to return one table or function",
            entry.name
        )))
    }
}

impl State {
    /// Reads and compiles a module.
    fn load(&mut self, lua: &Lua, found: &Found) -> mlua::Result<Function> {
        let source = found.read().map_err(|error| mlua::Error::runtime(error.message()))?;
        let chunk = chunk::load(lua, &found.shown, source.as_bytes(), Some(environment(lua)?))?;
        let base = Base { root: found.root, folder: found.folder.clone() };
        self.bases.insert(format!("@{}", found.shown).into_bytes(), base);
        let entry = Entry { name: found.name.clone(), chunk: chunk.clone(), value: None };
        self.modules.insert(found.file.clone(), entry);
        self.loaded.push(Loaded { name: found.name.clone(), source });
        Ok(chunk)
    }
}

fn lock(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Globals of its own for a module: it sees those that the host made, and not those of other scripts.
fn environment(lua: &Lua) -> mlua::Result<Table> {
    let globals = lua.globals();
    let shared = match globals.metatable() {
        Some(metatable) => metatable.raw_get::<Value>("__index")?,
        None => Value::Table(globals),
    };
    let metatable = lua.create_table()?;
    metatable.raw_set("__index", shared)?;
    metatable.raw_set("__metatable", false)?;
    metatable.set_readonly(true);
    let environment = lua.create_table()?;
    environment.set_metatable(Some(metatable))?;
    // What it sees cannot change, so Luau may look it up once.
    environment.set_safeenv(true);
    Ok(environment)
}

/// Ends a module's run, however that comes about: an error unwinds through here.
struct Running<'a> {
    state: &'a Mutex<State>,
    depth: usize,
}

impl Drop for Running<'_> {
    fn drop(&mut self) {
        lock(self.state).running.truncate(self.depth);
    }
}

/// What a script calls.
unsafe extern "C-unwind" fn require(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: Luau passes the running state, whose closure has the upvalues that `Modules::install` gave it. Luau raises errors as
    // C++ exceptions, which drop what is alive; nothing here holds the lock while Luau runs.
    unsafe {
        ffi::lua_settop(state, 1);
        ffi::lua_pushvalue(state, ffi::lua_upvalueindex(1));
        push_source(state);
        ffi::lua_pushvalue(state, 1);
        let modules = ffi::lua_tolightuserdata(state, ffi::lua_upvalueindex(3));
        let modules: &Mutex<State> = &*modules.cast::<c_void>().cast();
        let running = Running { state: modules, depth: lock(modules).running.len() };
        ffi::lua_call(state, 2, 2);
        if ffi::lua_isnil(state, -1) != 0 {
            ffi::lua_pop(state, 1);
            return 1;
        }
        let first = ffi::lua_gettop(state);
        ffi::lua_call(state, 0, ffi::LUA_MULTRET);
        // There may be many.
        ffi::lua_rawcheckstack(state, 2);
        ffi::lua_pushvalue(state, ffi::lua_upvalueindex(2));
        ffi::lua_insert(state, first);
        let returned = ffi::lua_gettop(state) - first;
        ffi::lua_call(state, returned, 1);
        drop(running);
        1
    }
}

/// Pushes the name of the file that asks, or nil where no function written in Lua does.
///
/// # Safety
/// `state` is a running Lua state.
unsafe fn push_source(state: *mut ffi::lua_State) {
    for level in 1.. {
        let mut info = MaybeUninit::<ffi::lua_Debug>::zeroed();
        // SAFETY: all zeros is a valid `lua_Debug`, and Lua fills in what is asked for; the source is a text that ends in zero and
        // lives as long as its function.
        unsafe {
            if ffi::lua_getinfo(state, level, c"s".as_ptr(), info.as_mut_ptr()) == 0 {
                break;
            }
            let info = info.assume_init_ref();
            if CStr::from_ptr(info.what) != c"C" {
                ffi::lua_pushstring_(state, info.source);
                return;
            }
        }
    }
    // SAFETY: there is room for one more value than the function has.
    unsafe { ffi::lua_pushnil(state) }
}

#[cfg(test)]
mod library;
#[cfg(test)]
mod tests;
