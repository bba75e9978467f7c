//! Compiles the text of a script.

use mlua::chunk::ChunkMode;
use mlua::{Function, Lua, Table, ffi};

use crate::power;

/// The largest script, in bytes. The compiler's own memory is not limited, but proportional to this.
pub(crate) const LARGEST_SCRIPT: usize = 1 << 20;

/// Compiles a script, but does not run it. `script` is its name in errors; its globals are those of the machine if it has no
/// environment of its own.
///
/// # Errors
/// Names the line that cannot be compiled.
pub(crate) fn load(
    lua: &Lua,
    script: &str,
    source: &[u8],
    environment: Option<Table>,
) -> mlua::Result<Function> {
    if source.len() > LARGEST_SCRIPT {
        return Err(mlua::Error::runtime(format!(
            "the script has {} bytes, but {LARGEST_SCRIPT} are allowed; split it",
            source.len()
        )));
    }
    let compile = || {
        // Never what was compiled before: the virtual machine trusts it.
        lua.load(source).set_name(format!("@{script}")).set_mode(ChunkMode::Text).into_function()
    };
    let function = match environment {
        None => compile()?,
        Some(environment) => {
            // Luau looks up what a script uses while it loads it, and in the globals of the machine whatever the environment.
            let globals = lua.globals();
            set_globals(lua, environment)?;
            let function = compile();
            set_globals(lua, globals)?;
            function?
        }
    };
    // After the compiler, which has the better messages for what is not Lua at all.
    power::check(script, source).map_err(|error| mlua::Error::runtime(error.message()))?;
    Ok(function)
}

/// Sets what scripts that are loaded from now on have for globals. The binding refuses this in a sandbox.
fn set_globals(lua: &Lua, globals: Table) -> mlua::Result<()> {
    // SAFETY: the table is the only value on the stack and is taken from it.
    unsafe { lua.exec_raw::<()>(globals, |state| ffi::lua_replace(state, ffi::LUA_GLOBALSINDEX)) }
}
