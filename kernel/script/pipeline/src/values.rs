//! Values that cross from Lua and from programs: texts, truth values, tables, and numbers that are finite.

use mlua::{Lua, LuaSerdeExt, Table, Value as LuaValue};
use pdk_sdk::error::{Error, Result};
use serde_json::{Map, Number, Value};

/// Tables in tables in tables: deeper ones are refused, since a table may hold itself.
const DEEPEST: usize = 64;
/// Whole numbers beyond this are not exact in Lua.
const LARGEST_WHOLE: f64 = 9_007_199_254_740_992.0;

/// A value of a script; `place` is what errors call it.
///
/// # Errors
/// Names the part of it that cannot cross: a number that is not finite, a function, a table that holds itself.
pub fn from_lua(value: &LuaValue, place: &str) -> Result<Value> {
    read(value, place, 0)
}

/// A value for a script.
///
/// # Errors
/// If the virtual machine is out of memory.
pub fn to_lua(lua: &Lua, value: &Value) -> mlua::Result<LuaValue> {
    lua.to_value_with(
        value,
        mlua::serde::SerializeOptions::new().serialize_none_to_null(false).serialize_unit_to_null(false),
    )
}

/// A value of another program as it would come from a script, so that equal scenarios are equal texts: the keys of tables in order, and
/// numbers without a fraction as whole ones.
pub fn from_program(value: Value) -> Value {
    match value {
        Value::Number(number) if number.is_f64() => {
            number.as_f64().and_then(whole).map_or(Value::Number(number), Value::from)
        }
        Value::Array(list) => list.into_iter().map(from_program).collect(),
        Value::Object(fields) => {
            let mut fields: Map<String, Value> =
                fields.into_iter().map(|(key, value)| (key, from_program(value))).collect();
            fields.sort_keys();
            Value::Object(fields)
        }
        other => other,
    }
}

/// A number without a fraction, if it is exact as a whole one. A minus before a zero is of no use to anybody.
fn whole(value: f64) -> Option<i64> {
    (value.fract() == 0.0 && value.abs() <= LARGEST_WHOLE).then_some(value as i64)
}

/// The entries of a list, one by one.
///
/// # Errors
/// If it has a gap or fields besides.
pub fn entries(list: &Table, place: &str) -> Result<impl Iterator<Item = Result<LuaValue>>> {
    let length = list.raw_len();
    for pair in list.pairs::<LuaValue, LuaValue>() {
        let (key, _) = pair.map_err(|error| unreadable(place, &error))?;
        match index(&key) {
            Some(index) => check_index(index, length, place)?,
            None if length == 0 => {
                return Err(Error::new(format!(
                    "{place} is a table of fields, but has to be a list: {{ ... }}"
                )));
            }
            None if key.is_string() => return Err(list_and_fields(place)),
            None => return Err(no_key(&key, place)),
        }
    }
    Ok((1..=length).map(move |index| entry(list, index, place)))
}

/// An entry of a list. Lua keeps lists in a way in which their order is not always that of their pairs.
fn entry(list: &Table, index: usize, place: &str) -> Result<LuaValue> {
    match list.raw_get(index) {
        Ok(LuaValue::Nil) => Err(Error::new(format!("{place} has a gap: its list has no entry {index}"))),
        Ok(value) => Ok(value),
        Err(error) => Err(unreadable(place, &error)),
    }
}

/// Where in a list a key is, from 1; none if it is not a number.
fn index(key: &LuaValue) -> Option<f64> {
    key.as_f64().or_else(|| key.as_i64().map(|index| index as f64))
}

fn check_index(index: f64, length: usize, place: &str) -> Result<()> {
    match index.fract() == 0.0 && index >= 1.0 && index <= length as f64 {
        true => Ok(()),
        false => Err(Error::new(format!("{place} has a gap: its list has an entry {index} of {length}"))),
    }
}

fn unreadable(place: &str, error: &mlua::Error) -> Error {
    Error::new(format!("{place} cannot be read ({error})"))
}

fn no_key(key: &LuaValue, place: &str) -> Error {
    Error::new(format!("{place} has a {} as a key; keys are texts", key.type_name()))
}

fn list_and_fields(place: &str) -> Error {
    Error::new(format!("{place} is a list and has fields as well; it can be one of the two"))
}

fn read(value: &LuaValue, place: &str, depth: usize) -> Result<Value> {
    if depth > DEEPEST {
        return Err(Error::new(format!("{place} is too deep; does a table hold itself?")));
    }
    match value {
        LuaValue::Nil => Ok(Value::Null),
        value if value.is_null() => Ok(Value::Null),
        LuaValue::Boolean(value) => Ok(Value::Bool(*value)),
        LuaValue::Integer(value) => Ok(Value::Number((*value).into())),
        LuaValue::Number(value) => number(*value, place),
        LuaValue::String(text) => match text.to_str() {
            Ok(text) => Ok(Value::String(text.to_owned())),
            Err(_) => Err(Error::new(format!("{place} is not valid UTF-8"))),
        },
        LuaValue::Table(table) => read_table(table, place, depth),
        other => Err(Error::new(format!("{place} is a {}, which is of no use here", other.type_name()))),
    }
}

fn number(value: f64, place: &str) -> Result<Value> {
    if let Some(whole) = whole(value) {
        return Ok(Value::Number(whole.into()));
    }
    match Number::from_f64(value) {
        Some(number) => Ok(Value::Number(number)),
        None => Err(Error::new(format!("{place} is {value}, but has to be a finite number"))),
    }
}

/// An empty table counts as an empty list. No request has an empty table for which the difference matters.
fn read_table(table: &Table, place: &str, depth: usize) -> Result<Value> {
    let length = table.raw_len();
    let mut is_list = false;
    let mut fields = Map::new();
    for pair in table.pairs::<LuaValue, LuaValue>() {
        let (key, value) = pair.map_err(|error| unreadable(place, &error))?;
        match (&key, index(&key)) {
            (LuaValue::String(key), _) => {
                let key = key.to_string_lossy();
                let value = read(&value, &format!("{place}.{key}"), depth + 1)?;
                fields.insert(key, value);
            }
            (_, Some(index)) => {
                check_index(index, length, place)?;
                is_list = true;
            }
            (other, None) => return Err(no_key(other, place)),
        }
    }
    let mut list = Vec::new();
    if is_list {
        list.reserve_exact(length);
        for index in 1..=length {
            list.push(read(&entry(table, index, place)?, &format!("{place}[{index}]"), depth + 1)?);
        }
    }
    match (list.is_empty(), fields.is_empty()) {
        (false, false) => Err(list_and_fields(place)),
        (_, true) => Ok(Value::Array(list)),
        (true, false) => {
            // A script's tables have no order that means anything.
            fields.sort_keys();
            Ok(Value::Object(fields))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn read(script: &str) -> Result<Value> {
        from_lua(&Lua::new().load(script).eval().unwrap(), "pdk.x")
    }

    #[test]
    fn what_can_be_json_crosses() {
        let script = "return { b = { 1, 2.5, 'x' }, a = { c = true, d = {} }, e = -0 }";
        assert_eq!(read(script).unwrap().to_string(), r#"{"a":{"c":true,"d":[]},"b":[1,2.5,"x"],"e":0}"#);
        assert_eq!(read("return 2^53").unwrap(), json!(9_007_199_254_740_992_i64));
        assert_eq!(read("return 1e300").unwrap(), json!(1e300));
    }

    #[test]
    fn entries_come_in_their_order_however_the_list_was_made() {
        let lua = Lua::new();
        let read = |script: &str| -> Result<Vec<i64>> {
            let list: Table = lua.load(script).eval().unwrap();
            let entries = entries(&list, "pdk.x")?;
            entries.map(|entry| Ok(entry?.as_i64().unwrap())).collect()
        };
        let backwards = "local list = {} for i = 5, 1, -1 do list[i] = i end return list";
        assert_eq!(read(backwards).unwrap(), [1, 2, 3, 4, 5]);
        assert_eq!(from_lua(&lua.load(backwards).eval().unwrap(), "x").unwrap(), json!([1, 2, 3, 4, 5]));
        for (script, said) in [
            ("return { 1, nil, 3 }", "pdk.x has a gap"),
            ("return { 1, 2, x = 3 }", "is a list and has fields as well"),
            ("return { 1, 2, [print] = 3 }", "pdk.x has a function as a key"),
        ] {
            let error = read(script).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn what_a_program_writes_is_what_a_script_writes() {
        let script = "return { b = { 1, 2.5, 'x' }, a = { c = true, z = 18446744073709551616 }, e = 0 }";
        let written = json!({"e": -0.0, "b": [1.0, 2.5, "x"], "a": {"z": 18446744073709551616.0, "c": true}});
        assert_eq!(from_program(written).to_string(), read(script).unwrap().to_string());
        assert_eq!(from_program(json!(u64::MAX)), json!(u64::MAX));
    }

    #[test]
    fn what_cannot_is_named() {
        for (script, said) in [
            ("return { level = 0/0 }", "pdk.x.level is NaN, but has to be a finite number"),
            ("return { a = { 1, 1/0 } }", "pdk.x.a[2] is inf, but has to be a finite number"),
            ("return { f = print }", "pdk.x.f is a function, which is of no use here"),
            ("return { 1, x = 2 }", "pdk.x is a list and has fields as well"),
            ("return { [1] = 1, [3] = 3, [2.5] = 1 }", "pdk.x has a gap"),
            ("return { 1, nil, 3 }", "pdk.x has a gap"),
            ("return { [print] = 1 }", "pdk.x has a function as a key"),
            ("local t = {} t.t = t return t", "does a table hold itself?"),
        ] {
            let error = read(script).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
