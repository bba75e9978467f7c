//! Pipelines: Lua files that say what to drive or evaluate, run with `pdk run`.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use mlua::{ExternalError, Function, Lua, LuaSerdeExt, Value as LuaValue};
use pdk_sdk::error::{Error, Place, Result};
use serde_json::Value;

use crate::drive;
use crate::lua::{ApiFunction, ApiTable, Limits, Sandbox, without_clock};
use crate::record::manifest::Pipeline;
use crate::registry::Registry;

mod host;
pub mod records;
pub mod settings;
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
                lua.create_function(move |_, request: LuaValue| {
                    sample_schedules(&request)?;
                    drive.call::<LuaValue>(request)
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

/// Puts points in the place of levels that are functions of time, so that a scenario can be recorded and driven again
/// without its script.
fn sample_schedules(request: &LuaValue) -> mlua::Result<()> {
    let LuaValue::Table(request) = request else { return Ok(()) };
    let duration = request.get::<Option<f64>>("duration").ok().flatten();
    let Ok(scenarios) = request.get::<mlua::Table>("scenarios") else { return Ok(()) };
    for scenario in scenarios.sequence_values::<mlua::Table>() {
        let Ok(scenario) = scenario else { return Ok(()) };
        let own = scenario.get::<Option<f64>>("duration").ok().flatten();
        let duration = own.or(duration).unwrap_or(drive::plan::DEFAULT_DURATION).clamp(0.0, 86_400.0);
        let Ok(perturbations) = scenario.get::<mlua::Table>("perturbations") else { continue };
        for perturbation in perturbations.sequence_values::<LuaValue>() {
            let LuaValue::Table(perturbation) = perturbation? else { continue };
            let LuaValue::Function(level) = perturbation.get::<LuaValue>("level")? else { continue };
            let points = (0..=(duration / SCHEDULE_STEP).ceil() as u32)
                .map(|step| {
                    let time = f64::from(step) * SCHEDULE_STEP;
                    Ok([time, level.call::<f64>(time)?])
                })
                .collect::<mlua::Result<Vec<_>>>()?;
            perturbation.set("level", HashMap::from([("points", points)]))?;
        }
    }
    Ok(())
}

/// A function of the host as a Lua function: values cross as JSON, and the time it takes is not the script's.
fn host_function(lua: &Lua, work: fn(&mut Host, Value) -> Result<Value>) -> mlua::Result<Function> {
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

/// Runs a pipeline to its end. What was recorded until an error is complete and stays.
///
/// # Errors
/// Where the file cannot be read, the script fails, or what it asks for fails.
pub fn run(registry: Arc<Registry>, path: &Path, options: Options) -> Result<Finished> {
    let source =
        std::fs::read_to_string(path).place(format_args!("cannot read the pipeline {}", path.display()))?;
    let pipeline = Pipeline { path: path.to_owned(), source: source.clone() };
    let host = Host::new(registry, pipeline, options)?;
    let sandbox = Sandbox::with_api(Limits::from_environment()?, |lua| API.install(lua))?;
    sandbox.lua().set_app_data(host);
    let name = path.to_string_lossy();
    let result =
        sandbox.load(&name, source.as_bytes()).and_then(|chunk| sandbox.call(&name, &chunk, ()).map(|_| ()));
    let mut host = sandbox
        .lua()
        .remove_app_data::<Host>()
        .ok_or_else(|| Error::new("the pipeline's host is gone, which is a defect in pdk"))?;
    match result {
        Ok(()) => host.finish(),
        Err(error) => {
            // The record of what came before is completed; the script's error is the one to report.
            let _ = host.finish();
            Err(error)
        }
    }
}
