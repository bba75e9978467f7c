//! Keeps Luau's own library within the time limit.
//!
//! Luau asks its interrupt function at loops and calls of a script, and while it matches patterns, but not inside of its other
//! library functions. Nearly all of them take time in proportion to memory, which is limited. Those that do not are replaced
//! here: by ones that need less time, that ask the interrupt function, or that refuse what would take too long.

use std::ffi::{CStr, c_int};

use memchr::memmem;
use mlua::{Function, Lua, Table, ffi};

use crate::watchdog::ask_interrupt;

/// The most bytes of a text times those of a pattern with a set: every character may be compared with the whole set before Luau
/// asks. That takes about half a second.
const MOST_COMPARISONS: usize = 1 << 29;
/// The longest replacement, which is gone through for every match.
const LONGEST_REPLACEMENT: usize = 1 << 23;
/// The most elements that `table.move` moves, whether or not there is anything in their places.
const MOST_MOVED: f64 = 16_777_216.0;

/// Functions of a library with what takes their place. Each has the original as its only upvalue.
type Replacements = &'static [(&'static CStr, ffi::lua_CFunction)];

const STRING: Replacements =
    &[(c"find", find), (c"match", matched), (c"gmatch", gmatch), (c"gsub", gsub), (c"split", split)];
const TABLE: Replacements = &[(c"sort", sort), (c"move", moved), (c"find", table_find)];
/// Loops that call any function without asking. `for` does the same.
const REMOVED: &[&str] = &["foreach", "foreachi"];

/// Replaces the functions.
pub(crate) fn install(lua: &Lua) -> mlua::Result<()> {
    for (library, replacements) in [("string", STRING), ("table", TABLE)] {
        let library: Table = lua.globals().get(library)?;
        for &(name, function) in replacements {
            let key = lua.create_string(name.to_bytes())?;
            let original: Function = library.raw_get(&key)?;
            // SAFETY: the original is the only value on the stack and is replaced by a closure that holds it. The functions
            // below keep to the calling convention.
            let closure = unsafe {
                lua.exec_raw::<Function>(original, |state| {
                    ffi::lua_pushcclosurek(state, function, name.as_ptr(), 1, None);
                })?
            };
            library.raw_set(key, closure)?;
        }
    }
    let table: Table = lua.globals().get("table")?;
    REMOVED.iter().try_for_each(|&name| table.raw_set(name, mlua::Nil))
}

/// Calls the original with the arguments at hand and returns all that it returns.
///
/// # Safety
/// Called by a closure of [`install`] with its state, as the last thing.
unsafe fn call_original(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: the first upvalue is the original; it and its arguments are replaced by the results.
    unsafe {
        let arguments = ffi::lua_gettop(state);
        ffi::lua_pushvalue(state, ffi::lua_upvalueindex(1));
        ffi::lua_insert(state, 1);
        ffi::lua_call(state, arguments, ffi::LUA_MULTRET);
        ffi::lua_gettop(state)
    }
}

/// The bytes of an argument that has to be a text.
///
/// # Safety
/// The argument stays on the stack, as it is, for as long as the bytes are used.
unsafe fn text<'a>(state: *mut ffi::lua_State, index: c_int) -> &'a [u8] {
    let mut length = 0;
    // SAFETY: where it returns, it points to that many bytes, which Luau does not move.
    unsafe {
        let data = ffi::luaL_checklstring(state, index, &mut length);
        std::slice::from_raw_parts(data.cast(), length)
    }
}

/// Refuses a text and a pattern that would take too long.
///
/// # Safety
/// As for [`text`].
unsafe fn check_pattern(state: *mut ffi::lua_State, name: &CStr, subject: &[u8], pattern: &[u8]) {
    let longest_set = if memchr::memchr(b'[', pattern).is_some() { pattern.len() } else { 1 };
    if subject.len().saturating_mul(longest_set) > MOST_COMPARISONS {
        let (subject, pattern) = (subject.len() as c_int, pattern.len() as c_int);
        // SAFETY: the arguments are what the format says, and nothing with a destructor is alive.
        unsafe {
            ffi::luaL_error(
                state,
                c"string.%s would take too long on a text of %d bytes with a pattern of %d that has a set in brackets; shorten one of them"
                    .as_ptr(),
                name.as_ptr(),
                subject,
                pattern,
            );
        }
    }
}

/// `string.find`: what is not a pattern is found in time proportional to the text.
unsafe extern "C-unwind" fn find(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: Luau passes the running state; nothing with a destructor is alive where an error makes it unwind.
    unsafe {
        let (subject, pattern) = (text(state, 1), text(state, 2));
        if ffi::lua_toboolean(state, 4) == 0 && pattern.iter().any(|byte| b"^$*+?.([%-".contains(byte)) {
            check_pattern(state, c"find", subject, pattern);
            return call_original(state);
        }
        let from = match ffi::luaL_optinteger(state, 3, 1) {
            // Counted from the end.
            from if from < 0 => (from + subject.len() as ffi::lua_Integer).max(0),
            from => (from - 1).max(0),
        } as usize;
        let found = subject.get(from..).and_then(|rest| memmem::find(rest, pattern));
        let Some(place) = found else {
            ffi::lua_pushnil(state);
            return 1;
        };
        ffi::lua_pushinteger(state, (from + place + 1) as ffi::lua_Integer);
        ffi::lua_pushinteger(state, (from + place + pattern.len()) as ffi::lua_Integer);
        2
    }
}

unsafe extern "C-unwind" fn matched(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: as in `find`.
    unsafe {
        check_pattern(state, c"match", text(state, 1), text(state, 2));
        call_original(state)
    }
}

unsafe extern "C-unwind" fn gmatch(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: as in `find`.
    unsafe {
        check_pattern(state, c"gmatch", text(state, 1), text(state, 2));
        call_original(state)
    }
}

unsafe extern "C-unwind" fn gsub(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: as in `find`.
    unsafe {
        check_pattern(state, c"gsub", text(state, 1), text(state, 2));
        if ffi::lua_type(state, 3) == ffi::LUA_TSTRING && text(state, 3).len() > LONGEST_REPLACEMENT {
            ffi::luaL_error(
                state,
                c"string.gsub takes a replacement of at most %d bytes, but it has %d".as_ptr(),
                LONGEST_REPLACEMENT as c_int,
                text(state, 3).len() as c_int,
            );
        }
        call_original(state)
    }
}

/// `string.split`, in time proportional to the text.
unsafe extern "C-unwind" fn split(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: as in `find`.
    unsafe {
        let subject = text(state, 1);
        let separator = if ffi::lua_isnoneornil(state, 2) != 0 { b",".as_slice() } else { text(state, 2) };
        if separator.is_empty() {
            return call_original(state);
        }
        ffi::lua_createtable(state, 0, 0);
        let (mut from, mut count) = (0, 0);
        loop {
            ask_interrupt(state);
            let end = memmem::find(&subject[from..], separator).map_or(subject.len(), |place| from + place);
            ffi::lua_pushlstring_(state, subject[from..].as_ptr().cast(), end - from);
            count += 1;
            ffi::lua_rawseti_(state, -2, count);
            if end == subject.len() {
                return 1;
            }
            from = end + separator.len();
        }
    }
}

/// `table.sort`: asks at every comparison that no function of the script does.
unsafe extern "C-unwind" fn sort(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: as in `find`.
    unsafe {
        ffi::lua_settop(state, 2);
        if ffi::lua_isnil(state, 2) != 0 || ffi::lua_iscfunction(state, 2) != 0 {
            ffi::lua_pushcclosurek(state, compare, c"compare".as_ptr(), 1, None);
        }
        call_original(state)
    }
}

/// Whether the first argument is less than the second; the upvalue says so if it is a function.
unsafe extern "C-unwind" fn compare(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: as in `find`; `table.sort` gives two arguments.
    unsafe {
        ask_interrupt(state);
        if ffi::lua_isnil(state, ffi::lua_upvalueindex(1)) != 0 {
            let less = ffi::lua_lessthan(state, 1, 2);
            ffi::lua_pushboolean(state, less);
            return 1;
        }
        ffi::lua_pushvalue(state, ffi::lua_upvalueindex(1));
        ffi::lua_insert(state, 1);
        ffi::lua_call(state, 2, 1);
        1
    }
}

unsafe extern "C-unwind" fn moved(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: as in `find`.
    unsafe {
        let first = ffi::lua_tonumberx(state, 2, std::ptr::null_mut());
        let last = ffi::lua_tonumberx(state, 3, std::ptr::null_mut());
        if last - first >= MOST_MOVED {
            ffi::luaL_error(
                state,
                c"table.move moves at most %d elements at once".as_ptr(),
                MOST_MOVED as c_int,
            );
        }
        call_original(state)
    }
}

/// `table.find`: asks at every comparison that may call a metamethod.
unsafe extern "C-unwind" fn table_find(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: as in `find`; whatever is pushed is popped.
    unsafe {
        let compared = matches!(ffi::lua_type(state, 2), ffi::LUA_TTABLE | ffi::LUA_TUSERDATA);
        if !compared || ffi::lua_getmetatable(state, 2) == 0 {
            return call_original(state);
        }
        ffi::lua_pop(state, 1);
        ffi::luaL_checktype(state, 1, ffi::LUA_TTABLE);
        let first = ffi::luaL_optinteger(state, 3, 1);
        if first < 1 {
            return call_original(state); // Has the message for it.
        }
        for index in first..=ffi::lua_Integer::from(c_int::MAX) {
            ask_interrupt(state);
            ffi::lua_rawgeti_(state, 1, index as c_int);
            if ffi::lua_isnil(state, -1) != 0 {
                return 1;
            }
            if ffi::lua_equal(state, 2, -1) != 0 {
                ffi::lua_pushinteger(state, index);
                return 1;
            }
            ffi::lua_pop(state, 1);
        }
        ffi::lua_pushnil(state);
        1
    }
}

#[cfg(test)]
mod tests;
