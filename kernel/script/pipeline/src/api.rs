//! What a pipeline can call: the functions of the global `pdk`.

use mlua::{ExternalError, Lua, Table, Value as LuaValue};
use pdk_lua::types::{Declare, definitions};
use pdk_lua::{ApiFunction, ApiTable, LuaRandom, perturbation_api};
use pdk_sdk::error::{Error, Result};
use serde_json::Value;

use crate::bridge::{all_outcomes, call, frames_of, function, settings, with_host};
use crate::host::Host;
use crate::requests::SCENARIOS;
use crate::scored::{conduct, score_of};
use crate::search::conduct::search;
use crate::session_object::{SESSION, SessionObject};
use crate::values::{entries, from_lua};
use crate::{levels, records, statistics};

/// What a pipeline can call.
pub const API: ApiTable = ApiTable {
    name: "pdk",
    doc: "What a pipeline can do.",
    functions: &[
        ApiFunction {
            name: "settings",
            signature: "<T>(defaults: T) -> T",
            doc: "Declares the settings of the pipeline with their defaults, and returns them with what `--set` puts in \
                  their place. May be called once. To read one that was not declared is an error. `seed` and the other \
                  settings of every run, which `pdk run --help` lists, are there in every pipeline.",
            make: |lua| lua.create_function(|lua, defaults: LuaValue| settings(lua, &defaults)),
        },
        ApiFunction {
            name: "drive",
            signature: "(request: DriveRequest) -> { Outcome }",
            doc: "Drives scenarios in the closed loop of a simulator and a driver, and returns an outcome for each, in their \
                  order.",
            make: |lua| lua.create_function(|lua, request: LuaValue| drive(lua, &request)),
        },
        ApiFunction {
            name: "session",
            signature: "(defaults: SessionRequest?) -> Session",
            doc: "A session to submit scenarios to one by one, to wait for outcomes as they come, and to decide what to drive \
                  next. All sessions of a pipeline share their workers and the record.",
            make: |lua| {
                lua.create_function(|lua, defaults: LuaValue| {
                    let table = from_lua(&defaults, "pdk.session").map_err(ExternalError::into_lua_err)?;
                    let table = if table.is_null() { Value::Array(Vec::new()) } else { table };
                    let simulator = defaults.as_table().and_then(|table| table.raw_get("simulator").ok());
                    let duration = defaults.as_table().and_then(|table| table.raw_get("duration").ok());
                    let defaults = with_host(lua, |host| host.defaults().read("pdk.session", table))?;
                    lua.create_userdata(SessionObject::new(defaults, simulator, duration))
                })
            },
        },
        ApiFunction {
            name: "search",
            signature: "(request: SearchRequest) -> SearchResult",
            doc: "Searches a space for candidates whose objectives are best, or that are critical: a strategy proposes them, and a \
                  function evaluates them, by a scenario or by itself. Writes NAME.json and NAME.csv into the record.",
            make: |lua| lua.create_function(|lua, request: LuaValue| search(lua, &request)),
        },
        ApiFunction {
            name: "evaluate",
            signature: "((request: EvaluateRequest) -> Evaluation) & ((request: TaskRequest) -> TaskResult)",
            doc: "Perturbs the frames of a dataset and compares what the driver makes of them with the recorded ground \
                  truth and with what it makes of the original frames. With a `task`, a predictor takes the place of the driver, and \
                  a metric says how good its outputs are.",
            make: |lua| {
                lua.create_function(|lua, request: LuaValue| {
                    let scored = score_of(lua, &request)?;
                    let request = scored.as_ref().map_or(&request, |(request, _)| request);
                    let read = from_lua(request, "pdk.evaluate").map_err(ExternalError::into_lua_err)?;
                    match &scored {
                        Some((_, score)) => conduct(lua, read, score),
                        None => call(lua, |host| host.evaluate(read)),
                    }
                })
            },
        },
        ApiFunction {
            name: "show",
            signature: "(result: { Outcome } | Evaluation | TaskResult) -> ()",
            doc: "Prints a table of what `drive` or `evaluate` returned.",
            make: |lua| function(lua, "pdk.show", |host, [result]| host.show(&result).map(|()| Value::Null)),
        },
        ApiFunction {
            name: "table",
            signature: "(header: { string }, rows: { { any } }) -> ()",
            doc: "Prints a table of texts and numbers, one list a row.",
            make: |lua| {
                function(lua, "pdk.table", |host, [header, rows]| {
                    host.table(&header, &rows).map(|()| Value::Null)
                })
            },
        },
        ApiFunction {
            name: "save",
            signature: "(name: string, value: any) -> ()",
            doc: "Writes a value into the run's record as a JSON file, after the first `drive`, `submit` or `evaluate`. The name \
                  ends in `.json` and is none of the record's own files.",
            make: |lua| {
                function(lua, "pdk.save", |host, [name, value]| {
                    host.save(&name, &value).map(|()| Value::Null)
                })
            },
        },
        ApiFunction {
            name: "road",
            signature: "(request: RoadRequest) -> Road",
            doc: "Makes a road from angles, at random, or with a number of turns and a mean curvature. An error says where \
                  the road would leave the map of 250 x 250 m or cross itself.",
            make: |lua| function(lua, "pdk.road", |host, [request]| host.road(request)),
        },
        ApiFunction {
            name: "random",
            signature: "(seed: number?) -> Random",
            doc: "A stream of random numbers, the same for the same seed on every machine. Without a seed it follows from that of the run. Each \
                  call begins the stream anew.",
            make: |lua| {
                lua.create_function(|lua, seed: LuaValue| {
                    let seed = from_lua(&seed, "pdk.random").map_err(ExternalError::into_lua_err)?;
                    let key = with_host(lua, |host| host.random(&seed))?;
                    lua.create_userdata(LuaRandom(key.sequence()))
                })
            },
        },
        statistics::FAILED_SHARE,
        statistics::MEAN,
        statistics::MEAN_SHARE,
        statistics::COMPARE,
        statistics::COMPARE_INDEPENDENT,
        statistics::GROUPS,
        statistics::FAILING_LEVEL,
        statistics::FAILS_AT,
        statistics::NEXT_LEVEL,
        ApiFunction {
            name: "perturbations",
            signature: "(all: boolean?) -> { string }",
            doc: "The names of the perturbations of the default set, or of all.",
            make: |lua| {
                function(lua, "pdk.perturbations", |host, [all]| match all {
                    Value::Null => Ok(host.perturbations(false).into()),
                    Value::Bool(all) => Ok(host.perturbations(all).into()),
                    other => Err(Error::new(format!("pdk.perturbations takes true or false, not {other}"))),
                })
            },
        },
        ApiFunction {
            name: "draws",
            signature: "(perturbation: string) -> boolean",
            doc: "Whether a perturbation draws anything at random, so that driving the same scenario again with another `repeat` gives another result.",
            make: |lua| function(lua, "pdk.draws", |host, [name]| Ok(host.draws(&name)?.into())),
        },
        ApiFunction {
            name: "reach",
            signature: "(perturbation: string, level_scale: string) -> { number }?",
            doc: "The lowest and the highest level that a perturbation without parameters reaches on a scale; nil if it reaches none or was not measured for it.",
            make: |lua| {
                function(lua, "pdk.reach", |host, [name, scale]| Ok(host.reach(&name, &scale)?.into()))
            },
        },
        ApiFunction {
            name: "path",
            signature: "(relative: string) -> string",
            doc: "A path that counts from the folder of the pipeline rather than from the working directory.",
            make: |lua| {
                function(lua, "pdk.path", |host, [relative]| match relative.as_str() {
                    Some(relative) => Ok(host.path(relative).into()),
                    None => Err(Error::new(format!("pdk.path takes a text, not {relative}"))),
                })
            },
        },
    ],
};

/// What scripts see, in the order of the type definition file: first perturbations, then pipelines.
pub fn everything() -> Vec<&'static dyn Declare> {
    let mut api = perturbation_api();
    api.extend(records::RECORDS.iter().map(|&record| record as &dyn Declare));
    api.push(&SESSION);
    api.push(&API);
    api
}

/// The type definition file for editors.
pub fn type_definitions() -> String {
    definitions(&everything())
}

/// `pdk.drive`: submits all scenarios, and waits for all. They are read one by one, since all of them as one value would take much memory.
fn drive(lua: &Lua, request: &LuaValue) -> mlua::Result<LuaValue> {
    let (shared, list) = without_scenarios(lua, request)?;
    let shared_values = from_lua(&shared, "pdk.drive").map_err(ExternalError::into_lua_err)?;
    let defaults = with_host(lua, |host| host.defaults().drive(shared_values))?;
    let mut submissions = Vec::new();
    if let (Some(list), Some(shared)) = (list, shared.as_table()) {
        let own_defaults = |field: &str| shared.raw_get::<LuaValue>(field);
        let entries = entries(&list, "pdk.drive.scenarios").map_err(ExternalError::into_lua_err)?;
        for (number, scenario) in (1..).zip(entries) {
            let scenario = scenario.map_err(ExternalError::into_lua_err)?;
            let scenario = levels::evaluated(lua, &scenario, |own| frames_of(lua, own, &own_defaults))?;
            let read = || {
                let table = from_lua(&scenario, &format!("pdk.drive.scenarios[{number}]"))?;
                let submission = defaults.submission(&format!("pdk.drive: scenarios[{number}]"), table)?;
                Ok::<_, Error>(serde_json::to_string(&submission)?)
            };
            submissions.push(read().map_err(ExternalError::into_lua_err)?);
        }
    }
    // All of them are read before anything is made for one.
    let tickets = with_host(lua, |host| {
        let prepare = |text: String| host.prepare(serde_json::from_str(&text)?);
        let prepared = submissions.into_iter().map(prepare).collect::<Result<_>>()?;
        host.submit(prepared)
    })?;
    all_outcomes(lua, tickets, Host::wait)
}

/// A request of `pdk.drive`, and its list of scenarios. In the request, one entry stands for the list.
fn without_scenarios(lua: &Lua, request: &LuaValue) -> mlua::Result<(LuaValue, Option<Table>)> {
    let list = request.as_table().map(|table| table.raw_get::<LuaValue>(SCENARIOS)).transpose()?;
    let list = list.as_ref().and_then(LuaValue::as_table).filter(|list| list.raw_len() > 0);
    let (Some(table), Some(list)) = (request.as_table(), list) else { return Ok((request.clone(), None)) };
    let shared = levels::copied(lua, table)?;
    shared.raw_set(SCENARIOS, [true])?;
    Ok((LuaValue::Table(shared), Some(list.clone())))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `PDK_BLESS=1` writes the file anew.
    #[test]
    fn the_committed_types_are_up_to_date() {
        let root =
            std::env::var("PDK_TEST_ROOT").unwrap_or(concat!(env!("CARGO_MANIFEST_DIR"), "/../../..").into());
        let file = std::path::Path::new(&root).join("sdk/lua/pdk.d.luau");
        let expected = type_definitions();
        if std::env::var_os("PDK_BLESS").is_some() {
            std::fs::write(&file, &expected).unwrap();
        }
        let found = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(found == expected, "{} is stale; run the tests with PDK_BLESS=1", file.display());
    }
}
