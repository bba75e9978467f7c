//! Pipelines: Lua files that say what to drive or evaluate, run with `pdk run`.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use mlua::{ExternalError, Function, IntoLua, Lua, LuaSerdeExt, Value as LuaValue};
use pdk_sdk::error::{Error, Place, Result};
use serde_json::Value;

use crate::chain::MAX_INTENSITY;
use crate::drive;
use crate::lua::{ApiFunction, ApiTable, Limits, Sandbox, without_clock};
use crate::record::manifest::Pipeline;
use crate::registry::Registry;

pub(crate) mod fields;
mod host;
pub mod records;
mod report;
pub mod road;
pub mod settings;
mod speed;
pub mod table;

pub use host::{Finished, Host, Options};

/// What a pipeline can call.
pub const API: ApiTable = ApiTable {
    name: "pdk",
    doc: "What a pipeline can do.",
    functions: &[
        ApiFunction {
            name: "settings",
            signature: "<T>(defaults: T) -> T",
            doc: "Declares the settings of the pipeline with their defaults, and returns them with what `--set` puts in \
                  their place. May be called once. `seed`, `threads`, `out` and `patience` are there in every pipeline.",
            make: |lua| host_function(lua, |host, defaults| host.settings(defaults)),
        },
        ApiFunction {
            name: "drive",
            signature: "(request: DriveRequest) -> { Outcome }",
            doc: "Drives scenarios in the closed loop of a simulator and a driver, and returns an outcome for each.",
            make: |lua| {
                let drive = host_function(lua, |host, request| host.drive(request))?;
                lua.create_function(move |lua, request: LuaValue| {
                    drive.call::<LuaValue>(sampled(lua, request)?)
                })
            },
        },
        ApiFunction {
            name: "evaluate",
            signature: "(request: EvaluateRequest) -> Evaluation",
            doc: "Perturbs the frames of a dataset and compares what the driver makes of them with the recorded ground \
                  truth and with what it makes of the original frames.",
            make: |lua| host_function(lua, |host, request| host.evaluate(request)),
        },
        ApiFunction {
            name: "show",
            signature: "(result: { Outcome } | Evaluation) -> ()",
            doc: "Prints a table of what `drive` or `evaluate` returned.",
            make: |lua| host_function(lua, |host, result| host.show(&result).map(|()| Value::Null)),
        },
        ApiFunction {
            name: "table",
            signature: "(header: { string }, rows: { { any } }) -> ()",
            doc: "Prints a table of texts and numbers, one list a row.",
            make: |lua| pair_function(lua, |host, pair| host.table(&pair)),
        },
        ApiFunction {
            name: "save",
            signature: "(name: string, value: any) -> ()",
            doc: "Writes a value into the run's record as a JSON file, after the first `drive` or `evaluate`. The name ends \
                  in `.json` and is none of the record's own files.",
            make: |lua| pair_function(lua, |host, pair| host.save(&pair)),
        },
        ApiFunction {
            name: "road",
            signature: "(request: RoadRequest) -> Road",
            doc: "Makes a road from angles, at random, or with a number of turns and a mean curvature. An error says where \
                  the road would leave the map of 250 x 250 m or cross itself.",
            make: |lua| host_function(lua, |host, request| host.road(request)),
        },
        ApiFunction {
            name: "perturbations",
            signature: "(all: boolean?) -> { string }",
            doc: "The names of the perturbations of the default set, or of all.",
            make: |lua| {
                host_function(lua, |host, all| Ok(host.perturbations(all == Value::Bool(true)).into()))
            },
        },
        ApiFunction {
            name: "path",
            signature: "(relative: string) -> string",
            doc: "A path that counts from the folder of the pipeline rather than from the working directory.",
            make: |lua| {
                host_function(lua, |host, relative| match relative.as_str() {
                    Some(relative) => Ok(host.path(relative).into()),
                    None => Err(Error::new(format!("pdk.path takes a text, not {relative}"))),
                })
            },
        },
    ],
};

/// Seconds between the points at which a level that is a function of time is sampled.
const SCHEDULE_STEP: f64 = 0.1;

/// The request with points in the place of levels that are functions of time, so that a scenario can be recorded and
/// driven again without its script. The script's own tables stay as they are: scenarios of different durations may share
/// them.
fn sampled(lua: &Lua, request: LuaValue) -> mlua::Result<LuaValue> {
    let default = duration_of(&request).unwrap_or(drive::plan::DEFAULT_DURATION);
    let scenarios = |scenarios| {
        copied(lua, scenarios, |_, scenario| {
            let duration = duration_of(&scenario).unwrap_or(default).clamp(0.0, 86_400.0);
            let perturbation = |_: &LuaValue, p: LuaValue| {
                let name =
                    p.as_table().and_then(|table| table.raw_get::<String>("name").ok()).unwrap_or_default();
                copied(lua, p, only("level", |level| points(lua, &name, level, duration)))
            };
            copied(lua, scenario, only("perturbations", |list| copied(lua, list, perturbation)))
        })
    };
    copied(lua, request, only("scenarios", scenarios))
}

/// The level of a perturbation as points where it is a function of time; any other as it is.
fn points(lua: &Lua, name: &str, level: LuaValue, duration: f64) -> mlua::Result<LuaValue> {
    let LuaValue::Function(level) = level else { return Ok(level) };
    let points = (0..=(duration / SCHEDULE_STEP).ceil() as u32)
        .map(|step| {
            let time = f64::from(step) * SCHEDULE_STEP;
            let value = level.call::<LuaValue>(time)?;
            let number = value.as_f64().or_else(|| value.as_i64().map(|whole| whole as f64));
            let number = number.filter(|number| (0.0..=MAX_INTENSITY).contains(number)).ok_or_else(|| {
                let shown = match (&value, number) {
                    (_, Some(number)) => number.to_string(),
                    (LuaValue::Nil, None) => "nothing".to_owned(),
                    (other, None) => format!("a {}", other.type_name()),
                };
                mlua::Error::runtime(format!(
                    "the level of `{name}` is {shown} at {time:.1} s, but has to be a number from 0 to {MAX_INTENSITY}"
                ))
            })?;
            Ok([time, number])
        })
        .collect::<mlua::Result<Vec<_>>>()?;
    HashMap::from([("points", points)]).into_lua(lua)
}

/// A copy of a table with other values; what is no table is itself.
fn copied(
    lua: &Lua,
    value: LuaValue,
    mut change: impl FnMut(&LuaValue, LuaValue) -> mlua::Result<LuaValue>,
) -> mlua::Result<LuaValue> {
    let LuaValue::Table(table) = value else { return Ok(value) };
    let copy = lua.create_table()?;
    for pair in table.pairs::<LuaValue, LuaValue>() {
        let (key, value) = pair?;
        let value = change(&key, value)?;
        copy.raw_set(key, value)?;
    }
    Ok(LuaValue::Table(copy))
}

/// Changes the value of one field and leaves the others.
fn only(
    field: &str,
    mut change: impl FnMut(LuaValue) -> mlua::Result<LuaValue>,
) -> impl FnMut(&LuaValue, LuaValue) -> mlua::Result<LuaValue> {
    move |key, value| match key.as_string().is_some_and(|key| key.as_bytes() == field.as_bytes()) {
        true => change(value),
        false => Ok(value),
    }
}

/// The time limit of a request or scenario in seconds, where it sets one.
fn duration_of(value: &LuaValue) -> Option<f64> {
    value.as_table().and_then(|table| table.raw_get("duration").ok()?)
}

/// A function of the host that takes two values, which it gets as `first` and `second`, and returns nothing.
fn pair_function(lua: &Lua, work: fn(&mut Host, Value) -> Result<()>) -> mlua::Result<Function> {
    let host = host_function(lua, move |host, pair| work(host, pair).map(|()| Value::Null))?;
    lua.create_function(move |lua, (first, second): (LuaValue, LuaValue)| {
        let pair = lua.create_table()?;
        pair.raw_set("first", first)?;
        pair.raw_set("second", second)?;
        host.call::<()>(pair)
    })
}

/// A function of the host as a Lua function: values cross as JSON, and the time it takes is not the script's.
fn host_function(
    lua: &Lua,
    work: impl Fn(&mut Host, Value) -> Result<Value> + Send + 'static,
) -> mlua::Result<Function> {
    lua.create_function(move |lua, argument: LuaValue| {
        // An empty table is an empty list: no request has an empty table where it matters.
        let options = mlua::serde::DeserializeOptions::new().encode_empty_tables_as_array(true);
        let argument: Value = lua.from_value_with(argument, options)?;
        let mut host = lua
            .app_data_mut::<Host>()
            .ok_or_else(|| Error::new("this function is there in pipelines only").into_lua_err())?;
        let result = without_clock(|| work(&mut host, argument)).map_err(ExternalError::into_lua_err)?;
        lua.to_value_with(
            &result,
            mlua::serde::SerializeOptions::new().serialize_none_to_null(false).serialize_unit_to_null(false),
        )
    })
}

/// Runs a pipeline to its end, or to an error of its script, which [`Finished::failure`] then holds. What was recorded
/// until an error is complete and stays.
///
/// # Errors
/// Where nothing could be begun: the file cannot be read, or a setting that every pipeline understands has a wrong value.
pub fn run(registry: Arc<Registry>, path: &Path, options: Options) -> Result<Finished> {
    let source =
        std::fs::read_to_string(path).place(format_args!("cannot read the pipeline {}", path.display()))?;
    let pipeline = Pipeline { path: path.to_owned(), source: source.clone() };
    let host = Host::new(registry, pipeline, options)?;
    let sandbox = Sandbox::with_api(Limits::from_environment()?, |lua| API.install(lua))?;
    sandbox.lua().set_app_data(host);
    let name = path.to_string_lossy();
    let result = sandbox
        .load(&name, source.as_bytes())
        .and_then(|chunk| sandbox.call(&name, &chunk, ()))
        .and_then(|returned| refuse_perturbation(&name, &returned));
    let mut host = sandbox
        .lua()
        .remove_app_data::<Host>()
        .ok_or_else(|| Error::new("the pipeline's host is gone, which is a defect in pdk"))?;
    Ok(host.finish(result))
}

/// A perturbation returns a table that applies it; run as a pipeline it would do nothing and say nothing.
fn refuse_perturbation(name: &str, returned: &LuaValue) -> Result<()> {
    match returned {
        LuaValue::Table(table) if table.contains_key("apply").unwrap_or(false) => Err(Error::new(format!(
            "{name} is a perturbation, not a pipeline; name its folder with --plugins and use it with `pdk perturb` or in a \
             pipeline"
        ))),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_perturbation_is_no_pipeline() {
        let lua = Lua::new();
        let returned: LuaValue = lua.load("return { doc = 'x', apply = function() end }").eval().unwrap();
        assert!(
            refuse_perturbation("a.lua", &returned).unwrap_err().to_string().contains("is a perturbation")
        );
        assert!(refuse_perturbation("a.lua", &LuaValue::Nil).is_ok());
    }

    #[test]
    fn a_function_of_time_is_sampled_for_each_scenario_and_stays_a_function() {
        let lua = Lua::new();
        let request: LuaValue = lua
            .load(
                "local fog = { name = 'fog', level = function(time) return time / 2 end }
                 local list = { fog, 'rain@1' }
                 return { duration = 1, simulator = 'x',
                     scenarios = { { perturbations = list }, { perturbations = list, duration = 4 }, {} } }",
            )
            .eval()
            .unwrap();
        for _ in 0..2 {
            let sampled: Value = lua.from_value(sampled(&lua, request.clone()).unwrap()).unwrap();
            assert_eq!(sampled["simulator"], "x");
            let perturbation = |scenario: usize| &sampled["scenarios"][scenario]["perturbations"];
            let points = |scenario: usize| perturbation(scenario)[0]["level"]["points"].as_array().unwrap();
            assert_eq!(points(0).len(), 11);
            assert_eq!(points(1).len(), 41);
            assert_eq!(points(1)[40], serde_json::json!([4, 2]));
            assert_eq!(perturbation(1)[1], "rain@1");
        }
    }

    #[test]
    fn a_function_that_gives_no_level_is_named_with_the_time() {
        let lua = Lua::new();
        let error = |body: &str| {
            let script = format!(
                "return {{ duration = 1, scenarios = {{ {{ perturbations = {{ {{ name = 'fog', level = function(t) {body} end }} }} }} }} }}"
            );
            sampled(&lua, lua.load(script).eval().unwrap()).unwrap_err().to_string()
        };
        for (body, said) in [
            ("if t < 0.25 then return 1 end", "is nothing at 0.3 s"),
            ("return 'high'", "is a string at 0.0 s"),
            ("return 4 + t", "is 4.1 at 0.1 s"),
            ("return 0 / 0", "is NaN at 0.0 s"),
        ] {
            let error = error(body);
            let expected = format!("the level of `fog` {said}, but has to be a number from 0 to 4");
            assert!(error.contains(&expected), "{error}");
        }
    }
}
