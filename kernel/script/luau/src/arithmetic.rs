//! Mathematical functions that give the same bits everywhere.
//!
//! Luau takes `math.sin` and its like from the system's C library, whose last bit differs between systems. Scripts get
//! those of the `libm` crate instead, as every other part of pdk does. What is exact by definition (`math.sqrt`,
//! `math.floor`, `math.fmod`, ...) stays Luau's own and fast.

use std::ffi::c_int;

use mlua::{Lua, MultiValue, Table, ffi};

/// One replaced function of the `math` table.
struct Replacement {
    name: &'static str,
    /// How the compiler calls it, to keep it from using its own.
    builtin: &'static str,
    function: ffi::lua_CFunction,
}

macro_rules! replacements {
    ($($name:ident ($($argument:ident),+) = $body:expr;)+) => {
        $(unsafe extern "C-unwind" fn $name(state: *mut ffi::lua_State) -> c_int {
            // SAFETY: Luau passes the running state; nothing with a destructor is alive where a wrong argument
            // makes it unwind.
            unsafe {
                let mut index = 0;
                $(index += 1; let $argument = ffi::luaL_checknumber(state, index);)+
                let _ = index;
                ffi::lua_pushnumber(state, $body);
            }
            1
        })+

        const REPLACEMENTS: &[Replacement] = &[
            $(Replacement {
                name: stringify!($name),
                builtin: concat!("math.", stringify!($name)),
                function: $name,
            },)+
            Replacement { name: "log", builtin: "math.log", function: log },
        ];
    };
}

replacements! {
    acos(x) = libm::acos(x);
    asin(x) = libm::asin(x);
    atan(x) = libm::atan(x);
    atan2(y, x) = libm::atan2(y, x);
    cos(x) = libm::cos(x);
    cosh(x) = libm::cosh(x);
    exp(x) = libm::exp(x);
    log10(x) = libm::log10(x);
    pow(x, y) = libm::pow(x, y);
    sin(x) = libm::sin(x);
    sinh(x) = libm::sinh(x);
    tan(x) = libm::tan(x);
    tanh(x) = libm::tanh(x);
    // A product and a sum, which Luau's native code fuses into one operation on processors that can, and rounds once
    // instead of twice.
    lerp(a, b, t) = if t == 1.0 { b } else { a + (b - a) * t };
    map(x, in_low, in_high, low, high) = low + (x - in_low) * (high - low) / (in_high - in_low);
}

/// `math.log(x, base)`; the base is that of the natural logarithm if it is left out.
unsafe extern "C-unwind" fn log(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: as in `replacements`.
    unsafe {
        let x = ffi::luaL_checknumber(state, 1);
        let value = if ffi::lua_isnoneornil(state, 2) != 0 {
            libm::log(x)
        } else {
            let base = ffi::luaL_checknumber(state, 2);
            if base == 2.0 {
                libm::log2(x)
            } else if base == 10.0 {
                libm::log10(x)
            } else {
                libm::log(x) / libm::log(base)
            }
        };
        ffi::lua_pushnumber(state, value);
    }
    1
}

/// What the compiler must neither compute itself nor call directly.
pub(super) fn disabled_builtins() -> impl Iterator<Item = &'static str> {
    REPLACEMENTS.iter().map(|replacement| replacement.builtin)
}

/// Replaces the functions, and puts an error in the place of those that draw ambient random numbers.
pub(super) fn install(lua: &Lua) -> mlua::Result<()> {
    let math: Table = lua.globals().get("math")?;
    for replacement in REPLACEMENTS {
        // SAFETY: the functions above keep to the calling convention and leave one result.
        let function = unsafe { lua.create_c_function(replacement.function)? };
        math.raw_set(replacement.name, function)?;
    }
    for ambient in ["random", "randomseed", "noise"] {
        let refused = lua.create_function(move |_, _: MultiValue| -> mlua::Result<()> {
            Err(mlua::Error::runtime(format!(
                "math.{ambient} is not there, because what it draws cannot be repeated; a perturbation draws from \
                 cx.frame_random or cx.sequence_random"
            )))
        })?;
        math.raw_set(ambient, refused)?;
    }
    Ok(())
}
