//! Levels that are functions of time: they are evaluated for every frame, and the scenario holds the values, so that it can be
//! driven again without its script.

use mlua::{ExternalError, Lua, Table, Value as LuaValue};
use pdk_model::level::{MAX_INTENSITY, MOST_FRAMES};

use crate::values::entries;

/// A scenario in which no level is a function any more; the script's own tables stay as they are, since scenarios may share
/// them. `frames` says for a scenario, with what it leaves to its defaults, its rate and how long it lasts.
///
/// # Errors
/// If a function fails or gives something other than a level, with its perturbation and the time.
pub fn evaluated(
    lua: &Lua,
    scenario: &LuaValue,
    frames: impl Fn(&Table) -> mlua::Result<(f64, f64)>,
) -> mlua::Result<LuaValue> {
    let Some(table) = scenario.as_table() else { return Ok(scenario.clone()) };
    let perturbations: LuaValue = table.raw_get("perturbations")?;
    let Some(list) = perturbations.as_table().filter(|list| has_function(list)) else {
        return Ok(scenario.clone());
    };
    let (rate, duration) = frames(table)?;
    let copies = lua.create_table()?;
    for entry in entries(list, "perturbations").map_err(ExternalError::into_lua_err)? {
        let entry = entry.map_err(ExternalError::into_lua_err)?;
        let level = entry.as_table().and_then(|entry| entry.raw_get::<LuaValue>("level").ok());
        let copy = match (entry.as_table(), level) {
            (Some(perturbation), Some(LuaValue::Function(level))) => {
                let name = perturbation.raw_get::<String>("name").unwrap_or_default();
                let copy = copied(lua, perturbation)?;
                copy.raw_set("level", of_frames(lua, &name, &level, rate, duration)?)?;
                LuaValue::Table(copy)
            }
            _ => entry,
        };
        copies.raw_push(copy)?;
    }
    let copy = copied(lua, table)?;
    copy.raw_set("perturbations", copies)?;
    Ok(LuaValue::Table(copy))
}

fn has_function(list: &Table) -> bool {
    list.sequence_values::<LuaValue>().flatten().any(|entry| {
        let level = entry.as_table().and_then(|entry| entry.raw_get::<LuaValue>("level").ok());
        level.is_some_and(|level| level.is_function())
    })
}

/// A table with the same fields.
pub fn copied(lua: &Lua, table: &Table) -> mlua::Result<Table> {
    let copy = lua.create_table()?;
    for pair in table.pairs::<LuaValue, LuaValue>() {
        let (key, value) = pair?;
        copy.raw_set(key, value)?;
    }
    Ok(copy)
}

/// `{ frames = { rate, levels } }` with the level of each frame from the start to the time limit.
fn of_frames(lua: &Lua, name: &str, level: &mlua::Function, rate: f64, duration: f64) -> mlua::Result<Table> {
    let count = (duration * rate).ceil() + 1.0;
    if !(count > 0.0 && count < MOST_FRAMES as f64) {
        return Err(mlua::Error::runtime(format!(
            "the level of `{name}` is a function of time, and {duration} s at {rate} frames a second are too many frames for that; \
             use a ramp, a pulse or points"
        )));
    }
    let levels = lua.create_table()?;
    for frame in 0..count as u64 {
        let time = frame as f64 / rate;
        let value = level.call::<LuaValue>(time)?;
        let number = value.as_f64().or_else(|| value.as_i64().map(|whole| whole as f64));
        let number = number.filter(|number| (0.0..=MAX_INTENSITY).contains(number)).ok_or_else(|| {
            let shown = match (&value, number) {
                (_, Some(number)) => number.to_string(),
                (LuaValue::Nil, None) => "nothing".to_owned(),
                (other, None) => format!("a {}", other.type_name()),
            };
            mlua::Error::runtime(format!(
                "the level of `{name}` is {shown} at {time:.2} s, but has to be a number from 0 to {MAX_INTENSITY}"
            ))
        })?;
        levels.raw_push(number)?;
    }
    let frames = lua.create_table()?;
    frames.raw_set("rate", rate)?;
    frames.raw_set("levels", levels)?;
    let course = lua.create_table()?;
    course.raw_set("frames", frames)?;
    Ok(course)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::values::from_lua;
    use pdk_model::level::Level;

    #[test]
    fn every_frame_has_the_functions_own_value() {
        let lua = Lua::new();
        let scenario: LuaValue = lua
            .load(
                "local fog = { name = 'fog', level = function(time) return time * time end }
                 return { duration = 2, perturbations = { fog, 'rain@1' } }",
            )
            .eval()
            .unwrap();
        // Again, since the script's own table keeps its function.
        for _ in 0..2 {
            let evaluated = evaluated(&lua, &scenario, |_| Ok((20.0, 2.0))).unwrap();
            let evaluated = from_lua(&evaluated, "x").unwrap();
            let level = Level::from_json("fog", &evaluated["perturbations"][0]["level"]).unwrap();
            for frame in 0..=40 {
                let time = f64::from(frame) / 20.0;
                assert_eq!(level.at(time), Some(time * time), "{time}");
            }
            assert_eq!(evaluated["perturbations"][1], "rain@1");
            assert_eq!(evaluated["duration"], 2);
        }
    }

    #[test]
    fn a_function_that_gives_no_level_is_named_with_the_time() {
        let lua = Lua::new();
        for (body, said) in [
            ("if t < 0.25 then return 1 end", "is nothing at 0.25 s"),
            ("return 'high'", "is a string at 0.00 s"),
            ("return 4 + t", "is 4.05 at 0.05 s"),
            ("return 0 / 0", "is NaN at 0.00 s"),
        ] {
            let script = format!(
                "return {{ perturbations = {{ {{ name = 'fog', level = function(t) {body} end }} }} }}"
            );
            let scenario = lua.load(script).eval().unwrap();
            let error = evaluated(&lua, &scenario, |_| Ok((20.0, 1.0))).unwrap_err().to_string();
            let expected = format!("the level of `fog` {said}, but has to be a number from 0 to 4");
            assert!(error.contains(&expected), "{error}");
        }
    }

    #[test]
    fn a_list_with_fields_or_a_gap_is_refused() {
        let lua = Lua::new();
        for (list, said) in [
            ("fog, name = 'rain', level = 2", "perturbations is a list and has fields as well"),
            ("fog, nil, 'rain@1'", "perturbations has a gap"),
        ] {
            let script = format!(
                "local fog = {{ name = 'fog', level = function() return 1 end }} return {{ perturbations = {{ {list} }} }}"
            );
            let scenario = lua.load(script).eval().unwrap();
            let error = evaluated(&lua, &scenario, |_| Ok((20.0, 1.0))).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn only_scenarios_with_functions_ask_for_the_rate() {
        let lua = Lua::new();
        let scenario = lua.load("return { perturbations = { 'fog@1' } }").eval().unwrap();
        let same = evaluated(&lua, &scenario, |_| panic!("no result is needed")).unwrap();
        assert_eq!(same, scenario);
    }
}
