//! The bytes of Luau's buffers, in place.

use std::ptr;

use mlua::{Buffer, Lua, ffi};

/// Where the bytes of a buffer are, and how many.
pub(crate) fn buffer_bytes(lua: &Lua, buffer: &Buffer) -> mlua::Result<(*mut u8, usize)> {
    let (mut data, mut len) = (ptr::null_mut(), 0usize);
    // SAFETY: the buffer is on top of the stack; looking at it neither allocates nor raises.
    unsafe {
        lua.exec_raw::<()>(buffer, |state| {
            data = ffi::lua_tobuffer(state, -1, &mut len).cast::<u8>();
            ffi::lua_pop(state, 1);
        })?;
    }
    if data.is_null() {
        return Err(mlua::Error::runtime("a buffer without memory"));
    }
    Ok((data, len))
}
