//! What a script keeps from one frame to the next: variables outside of its functions, and what they hold.
//!
//! A result must not depend on them. They are looked at when a script is checked, so that one whose result does can be
//! told which variable it is.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::{CStr, c_int, c_void};

use mlua::{Function, Lua, Table, Value, ffi};
use pdk_sdk::error::Result;

use crate::buffers::buffer_bytes;
use crate::image::LuaImage;
use crate::perturbation::LuaPerturbation;

/// The most variables and entries of tables that are looked at.
const MOST: usize = 20_000;
/// The longest text of a value in a sentence, in characters.
const LONGEST: usize = 20;

/// The values that a script holds between two frames, by the names of its variables: `count`, `state.count`, `list[3]`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Kept {
    held: BTreeMap<String, Held>,
}

/// A value that can change.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Held {
    /// A number, a text, true, false or nil, as it is written.
    Value(String),
    /// The pixels of an image or the bytes of a buffer.
    Bytes(blake3::Hash),
}

impl Kept {
    /// What has another value in `later`, as a part of a sentence: `count` (1, then 2). What is new, or gone, counts.
    pub fn changes(&self, later: &Kept) -> Vec<String> {
        let names: BTreeSet<&String> = self.held.keys().chain(later.held.keys()).collect();
        let text = |held: Option<&Held>| match held {
            None => "nil".to_owned(),
            Some(Held::Value(text)) => match text.char_indices().nth(LONGEST) {
                Some((end, _)) => format!("{}...", &text[..end]),
                None => text.clone(),
            },
            Some(Held::Bytes(_)) => "bytes".to_owned(),
        };
        names
            .into_iter()
            .filter(|name| self.held.get(*name) != later.held.get(*name))
            .map(|name| match (self.held.get(name), later.held.get(name)) {
                (Some(Held::Bytes(_)), Some(Held::Bytes(_))) => format!("`{name}` (its bytes)"),
                (before, after) => format!("`{name}` ({}, then {})", text(before), text(after)),
            })
            .collect()
    }
}

impl LuaPerturbation {
    /// What the script holds at present.
    ///
    /// # Errors
    /// If the virtual machine is out of memory.
    pub fn kept(&self) -> Result<Kept> {
        self.sandbox.make(&self.script, |lua| {
            let mut walk = Walk { lua, kept: Kept::default(), seen: BTreeSet::new() };
            walk.function(&self.apply)?;
            walk.table("", &lua.globals())?;
            Ok(walk.kept)
        })
    }
}

/// A walk over all that can be reached from a script's functions and globals.
struct Walk<'a> {
    lua: &'a Lua,
    kept: Kept,
    seen: BTreeSet<usize>,
}

impl Walk<'_> {
    fn value(&mut self, name: &str, value: &Value) -> mlua::Result<()> {
        if self.seen.len() + self.kept.held.len() >= MOST {
            return Ok(());
        }
        match value {
            Value::Nil | Value::Boolean(_) | Value::Integer(_) | Value::Number(_) | Value::String(_) => {
                self.hold(name, Held::Value(written(value)));
            }
            Value::Vector(vector) => self.hold(name, Held::Value(format!("{vector:?}"))),
            Value::Buffer(buffer) => {
                let (data, len) = buffer_bytes(self.lua, buffer)?;
                // SAFETY: the buffer is alive, and no script runs while it is looked at.
                let bytes = unsafe { std::slice::from_raw_parts(data, len) };
                self.hold(name, Held::Bytes(blake3::hash(bytes)));
            }
            Value::UserData(object) if object.is::<LuaImage>() => {
                let image = object.borrow::<LuaImage>()?;
                self.hold(name, Held::Bytes(blake3::hash(image.frame()?.data())));
            }
            Value::Table(table) => self.table(name, table)?,
            Value::Function(function) => self.function(function)?,
            // Streams are set anew for every frame.
            Value::UserData(_)
            | Value::LightUserData(_)
            | Value::Thread(_)
            | Value::Error(_)
            | Value::Other(_) => {}
        }
        Ok(())
    }

    fn hold(&mut self, name: &str, held: Held) {
        let mut unique = name.to_owned();
        // Two variables of the same name, in different functions; the walk takes the same way every time.
        for number in 2.. {
            if !self.kept.held.contains_key(&unique) {
                break;
            }
            unique = format!("{name} ({number})");
        }
        self.kept.held.insert(unique, held);
    }

    /// Whether something is met for the first time.
    fn is_new(&mut self, place: *const c_void) -> bool {
        self.seen.insert(place as usize)
    }

    fn table(&mut self, name: &str, table: &Table) -> mlua::Result<()> {
        if !self.is_new(table.to_pointer()) {
            return Ok(());
        }
        // In an order that does not depend on how the table came about.
        let mut entries = BTreeMap::new();
        for pair in table.pairs::<Value, Value>() {
            let (key, value) = pair?;
            let place = match &key {
                Value::String(key) if name.is_empty() => key.to_string_lossy(),
                Value::String(key) => format!("{name}.{}", key.to_string_lossy()),
                Value::Boolean(_) | Value::Integer(_) | Value::Number(_) => {
                    format!("{name}[{}]", written(&key))
                }
                _ => continue,
            };
            entries.insert(place, value);
        }
        for (place, value) in entries {
            self.value(&place, &value)?;
        }
        match table.metatable() {
            Some(metatable) if !name.is_empty() => self.table(&format!("getmetatable({name})"), &metatable),
            _ => Ok(()),
        }
    }

    /// Looks at the variables outside of a function that it uses.
    fn function(&mut self, function: &Function) -> mlua::Result<()> {
        if function.info().what != "Lua" || !self.is_new(function.to_pointer()) {
            return Ok(());
        }
        for index in 1.. {
            let Some((name, value)) = upvalue(self.lua, function, index)? else { break };
            self.value(&name, &value)?;
        }
        Ok(())
    }
}

/// Name and value of a variable that a function uses from outside, counted from 1.
fn upvalue(lua: &Lua, function: &Function, index: c_int) -> mlua::Result<Option<(String, Value)>> {
    let mut name = None;
    // SAFETY: the function is the only thing on the stack and is replaced by one value; getting it does not raise. Its
    // name, if there is one, is a text that ends in zero.
    let value = unsafe {
        lua.exec_raw::<Value>(function, |state| {
            let text = ffi::lua_getupvalue(state, 1, index);
            if text.is_null() {
                ffi::lua_pushnil(state);
            } else {
                name = Some(CStr::from_ptr(text).to_string_lossy().into_owned());
            }
            ffi::lua_remove(state, 1);
        })?
    };
    Ok(name.map(|name| (name, value)))
}

/// A number, a text, true, false or nil, as it is written in a script.
fn written(value: &Value) -> String {
    match value {
        Value::Boolean(value) => value.to_string(),
        Value::Integer(number) => number.to_string(),
        Value::Number(number) => number.to_string(),
        Value::String(text) => format!("\"{}\"", text.to_string_lossy()),
        _ => "nil".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use crate::perturbation::tests::{key, make, picture, run};
    use pdk_sdk::perturbation::Context;

    /// What changes between the second and the third frame of a script.
    fn changes(source: &str) -> Vec<String> {
        let mut perturbation = make(source, json!({})).unwrap();
        let (src, key) = (picture(8, 6), key());
        let mut kept = Vec::new();
        for frame in 0..3 {
            run(&mut perturbation, &src, &Context::new(2.0, frame, frame as f64, &key)).unwrap();
            kept.push(perturbation.kept().unwrap());
        }
        kept[1].changes(&kept[2])
    }

    #[test]
    fn variables_outside_of_functions_are_found_wherever_they_are() {
        for (source, expected) in [
            ("local n = 0 return { doc = 'x', apply = function() n = n + 1 end }", "`n` (2, then 3)"),
            ("n = 0 return { doc = 'x', apply = function() n = n + 1 end }", "`n` (2, then 3)"),
            (
                "local s = { n = 0 } return { doc = 'x', apply = function() s.n = s.n + 1 end }",
                "`s.n` (2, then 3)",
            ),
            (
                "local s = { 5, 0 } return { doc = 'x', apply = function() s[2] = s[2] + 1 end }",
                "`s[2]` (2, then 3)",
            ),
            (
                "local n = 0 local function count() n = n + 1 end
                return { doc = 'x', apply = function() count() end }",
                "`n` (2, then 3)",
            ),
            (
                "local s = setmetatable({}, { n = 0 }) return { doc = 'x', apply = function()
                local m = getmetatable(s) m.n = m.n + 1 end }",
                "`getmetatable(s).n` (2, then 3)",
            ),
            (
                "local b = buffer.create(4) return { doc = 'x', apply = function(_, cx)
                buffer.writeu8(b, 0, cx.frame_index) end }",
                "`b` (its bytes)",
            ),
            (
                "local last return { doc = 'x', apply = function(image, cx) last = image:copy()
                last:fill(cx.frame_index, 0, 0) end }",
                "`last` (its bytes)",
            ),
            (
                "local text = '' return { doc = 'x', apply = function() text = text .. 'a' end }",
                "`text` (\"aa\", then \"aaa\")",
            ),
            (
                "local old return { doc = 'x', apply = function(_, cx) old = cx.frame_index > 1 or nil end }",
                "`old` (nil, then true)",
            ),
        ] {
            assert_eq!(changes(source), [expected], "{source}");
        }
    }

    #[test]
    fn remaining_differences_are_not_findings() {
        for source in [
            "local DIRT = { 1, 2, 3 } return { doc = 'x', apply = function(image) image:fill(DIRT[1], 0, 0) end }",
            "local table local function make(width) return { width } end
            return { doc = 'x', apply = function(image) table = table or make(image.width) end }",
            "return { doc = 'x', apply = function(image, cx) local n = 0 n = n + cx.frame_index end }",
            "local loop = {} loop.loop = loop return { doc = 'x', apply = function() return loop.nothing end }",
        ] {
            assert!(changes(source).is_empty(), "{source}: {:?}", changes(source));
        }
    }
}
