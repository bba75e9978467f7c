//! What pipelines have and other scripts do not: `pdk` and `require`.
//!
//! A script that reaches for them is ended with an error that says so. That it did is noticed, because a script that was
//! only looked at is a pipeline then.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use mlua::{Lua, MetaMethod, MultiValue, UserData, UserDataMethods, Value};

use crate::failure::type_of;

/// Whether a script reached for something that only pipelines have.
#[derive(Clone, Default)]
pub(crate) struct Reached(Arc<AtomicBool>);

impl Reached {
    /// Forgets what happened so far. Luau looks up globals when it loads a script already, whether or not they are used.
    pub(crate) fn forget(&self) {
        self.0.store(false, Ordering::Relaxed);
    }

    /// Whether it did.
    pub(crate) fn get(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    fn refuse<T>(&self, what: &str) -> mlua::Result<T> {
        self.0.store(true, Ordering::Relaxed);
        Err(mlua::Error::runtime(format!("{what} is available only in pipelines, which `pdk run` runs")))
    }
}

/// Stands in for the table of all that a pipeline can call.
struct Pdk(Reached);

impl UserData for Pdk {
    fn add_methods<M: UserDataMethods<Self>>(methods: &mut M) {
        methods.add_meta_method(MetaMethod::Index, |_, this, name: Value| {
            this.0.refuse::<Value>(&match &name {
                Value::String(name) => format!("pdk.{}", name.to_string_lossy()),
                other => format!("pdk[{}]", type_of(other)),
            })
        });
    }
}

/// Sets the globals.
pub(crate) fn install(lua: &Lua) -> mlua::Result<Reached> {
    let reached = Reached::default();
    lua.globals().set("pdk", lua.create_userdata(Pdk(reached.clone()))?)?;
    let required = reached.clone();
    let require = lua.create_function(move |_, _: MultiValue| required.refuse::<Value>("require"))?;
    lua.globals().set("require", require)?;
    Ok(reached)
}
