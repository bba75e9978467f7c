//! Turns whatever a script raises into one sentence with the script's name and line.

use std::cell::RefCell;
use std::ffi::{CStr, c_int};
use std::mem::MaybeUninit;

use mlua::{Value, ffi};
use pdk_sdk::error::{Error, ErrorKind};

/// The longest message of a script that is passed on, in characters.
const LONGEST: usize = 400;

thread_local! {
    /// `script:line` of the latest error. Kept outside of the virtual machine, which may be out of memory.
    static LOCATION: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Notes which line of which script runs: that of the innermost function written in Lua.
///
/// # Safety
/// `state` is a running Lua state.
pub(super) unsafe fn record_location(state: *mut ffi::lua_State) {
    LOCATION.with_borrow_mut(|location| {
        location.clear();
        for level in 0.. {
            let mut info = MaybeUninit::<ffi::lua_Debug>::zeroed();
            // SAFETY: all zeros is a valid `lua_Debug`, and Lua fills in what is asked for: source and line. This
            // neither allocates nor raises.
            let info = unsafe {
                if ffi::lua_getinfo(state, level, c"sl".as_ptr(), info.as_mut_ptr()) == 0 {
                    break;
                }
                info.assume_init_ref()
            };
            if info.currentline > 0 {
                // SAFETY: Lua set it to a text that ends in zero and lives as long as `info`.
                let source = unsafe { CStr::from_ptr(info.short_src) };
                // The binding looks up fields in Lua, on behalf of the script's line.
                if source.to_bytes().starts_with(b"__mlua") {
                    continue;
                }
                location.push_str(&source.to_string_lossy());
                location.push(':');
                location.push_str(&info.currentline.to_string());
                break;
            }
        }
    });
}

/// The message handler of protected calls: notes the location and leaves the error as it is. Luau calls it before the
/// stack is unwound, also when memory has run out.
pub(super) unsafe extern "C-unwind" fn handler(state: *mut ffi::lua_State) -> c_int {
    // SAFETY: called by Luau with the running state.
    unsafe { record_location(state) };
    1
}

/// Forgets the location of an earlier error.
pub(super) fn forget_location() {
    LOCATION.with_borrow_mut(String::clear);
}

/// `script:line` of the latest error, or the name of the script where the line is not known.
pub(super) fn location(script: &str) -> String {
    LOCATION.with_borrow(|location| if location.is_empty() { script.to_owned() } else { location.clone() })
}

/// Whether an error, or what caused it, is that memory ran out.
pub(super) fn is_memory(error: &mlua::Error) -> bool {
    match error {
        mlua::Error::MemoryError(_) => true,
        mlua::Error::CallbackError { cause, .. }
        | mlua::Error::BadArgument { cause, .. }
        | mlua::Error::WithContext { cause, .. } => is_memory(cause),
        _ => false,
    }
}

/// The sentence for what a script raised.
pub(super) fn raised(script: &str, raised: &Value) -> Error {
    let message = match raised {
        Value::String(text) => text.to_string_lossy(),
        other => format!("raised an error that is {}; use a text, as in error(\"...\")", type_of(other)),
    };
    with_location(script, &message)
}

/// The sentence for an error of the binding: a wrong argument, a script that cannot be compiled. What is lost or late, such as a simulator
/// that is not there, is no fault of the line that waits for it, which is not named then. What pdk says itself is passed on whole.
pub(super) fn binding(script: &str, error: &mlua::Error) -> Error {
    match of_host(error) {
        Some(error) if matches!(error.kind(), ErrorKind::Lost | ErrorKind::Late) => error.clone(),
        Some(error) => located(script, error.message().to_owned()),
        None => with_location(script, &root(error)),
    }
}

/// The error of the host that went through the script.
fn of_host(error: &mlua::Error) -> Option<&Error> {
    match error {
        mlua::Error::CallbackError { cause, .. } | mlua::Error::WithContext { cause, .. } => of_host(cause),
        mlua::Error::ExternalError(error) => error.downcast_ref(),
        _ => None,
    }
}

/// What a script said, shortened, with the location first.
fn with_location(script: &str, message: &str) -> Error {
    located(script, shorten(message.split("\nstack traceback:").next().unwrap_or_default().trim()))
}

/// Puts the location first, unless the message starts with one.
fn located(script: &str, message: String) -> Error {
    let place = location(script);
    let named = message.strip_prefix(script).is_some_and(|rest| {
        rest.strip_prefix(':').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
    });
    if named || message.starts_with(&format!("{place}:")) {
        Error::new(message)
    } else {
        Error::new(message).at(place)
    }
}

/// The message of the innermost cause, without what the binding wraps around it.
fn root(error: &mlua::Error) -> String {
    match error {
        mlua::Error::CallbackError { cause, .. } | mlua::Error::WithContext { cause, .. } => root(cause),
        mlua::Error::BadArgument { to, name, .. } if name.as_deref() == Some("self") => {
            let method = to.as_deref().and_then(|to| to.rsplit('.').next()).unwrap_or_default();
            format!("`{method}` is called with a dot; call it with a colon, as in image:{method}(...)")
        }
        mlua::Error::RuntimeError(message)
        | mlua::Error::SyntaxError { message, .. }
        | mlua::Error::MemoryError(message) => message.clone(),
        other => other.to_string(),
    }
}

/// The type of a value as it is called in an error, with its article.
pub(super) fn type_of(value: &Value) -> String {
    match value {
        Value::Nil => "nothing".to_owned(),
        // Whole numbers are not a type of their own in Luau.
        Value::Integer(_) => "a number".to_owned(),
        Value::Error(_) => "an error".to_owned(),
        other => format!("a {}", other.type_name()),
    }
}

fn shorten(message: &str) -> String {
    match message.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{} ...", &message[..end]),
        None => message.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_pdk_says_is_passed_on_whole_and_what_a_script_says_is_shortened() {
        let long = format!("{}; set trust=true", "it cannot be ranked ".repeat(40));
        let host = mlua::Error::external(Error::new(long.as_str()));
        assert_eq!(binding("a", &host).message(), format!("a: {long}"));
        let script = binding("a", &mlua::Error::RuntimeError(long.clone())).to_string();
        assert!(script.ends_with(" ...") && script.len() < long.len(), "{script}");
    }
}
