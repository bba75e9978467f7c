//! Runs a pipeline.

use std::path::{Path, PathBuf};

use mlua::Value as LuaValue;
use pdk_components::product;
use pdk_components::search_path::SearchPath;
use pdk_lua::{Limits, Modules, Sandbox};
use pdk_notice::eprintln;
use pdk_record::files::recorded;
use pdk_record::manifest::{Module, Pipeline};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::file;
use pdk_sdk::suggest;
use pdk_session::interrupt;
use pdk_session::session::{Options as SessionOptions, Session};

use crate::api::API;
use crate::finished::Finished;
use crate::follow::Audience;
use crate::host::{Host, Setup};
use crate::naming::run_name;
use crate::run_settings::RunSettings;
use crate::settings::PipelineSettings;

/// How a pipeline is run.
#[derive(Debug, Clone)]
pub struct Options {
    /// The settings that every pipeline has.
    pub common: RunSettings,
    /// The pipeline's own.
    pub settings: PipelineSettings,
    /// Where components are looked for besides the usual places.
    pub search: SearchPath,
    /// Who follows the run.
    pub audience: Audience,
}

/// Bytes of a file that may be a pipeline; a script that is compiled may have fewer.
const LARGEST_PIPELINE: u64 = 16 << 20;

/// The text of a pipeline and where it comes from.
pub(crate) struct Script {
    /// The file, or the name of one that is part of pdk.
    path: PathBuf,
    source: String,
    /// The folder that it lies in; none if it is part of pdk.
    folder: Option<PathBuf>,
}

impl Script {
    /// A name without folder and ending is that of a pipeline that is part of pdk, all else a file.
    fn find(pipeline: &Path) -> Result<Self> {
        let is_name = pipeline.components().count() == 1 && !pipeline.to_string_lossy().contains('.');
        if is_name {
            let name = pipeline.to_string_lossy();
            let pipelines = product::get().pipelines;
            let known = pipelines.iter().map(|script| script.name);
            let script = pipelines.iter().find(|script| script.name == name).ok_or_else(|| {
                Error::new(format!(
                    "there is no built-in pipeline `{name}`; to run a file, write its folder or its ending, as in ./{name}; {}",
                    suggest::hint(&name, known)
                ))
            })?;
            return Ok(Self { path: script.name.into(), source: script.source.to_owned(), folder: None });
        }
        Self::read(pipeline)
    }

    /// A file.
    pub(crate) fn read(file: &Path) -> Result<Self> {
        let source = file::read_text(file, LARGEST_PIPELINE).map_err(|error| unreadable(file, &error))?;
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Ok(Self { path: file.to_owned(), source, folder: Some(folder.to_owned()) })
    }

    /// A text of a tool, such as a suite of scenarios, in a folder.
    pub(crate) fn of_tool(path: PathBuf, source: String, folder: Option<PathBuf>) -> Self {
        Self { path, source, folder }
    }

    /// A program whose text is not known, such as what is typed at a prompt.
    pub(crate) fn without_text(name: &str) -> Self {
        Self { path: name.into(), source: String::new(), folder: None }
    }
}

fn unreadable(pipeline: &Path, error: &Error) -> Error {
    let name = pipeline.file_stem().unwrap_or_default().to_string_lossy();
    let hint = match product::get().pipelines.iter().any(|script| script.name == name) {
        true => format!("; the one that comes with pdk is `pdk run {name}`"),
        false if matches!(pipeline.try_exists(), Ok(false)) => "; check the path".to_owned(),
        false => String::new(),
    };
    Error::new(format!("cannot read the pipeline {} ({error}){hint}", pipeline.display()))
}

/// Runs a pipeline to its end, or to an error of its script, which [`Finished::failure`] then holds. It is a file, or the name
/// of one that is part of pdk. What was recorded until an error is complete and stays.
///
/// # Errors
/// If nothing could be begun: the file cannot be read, or no worker can be started.
pub fn run(pipeline: &Path, options: Options) -> Result<Finished> {
    let script = Script::find(pipeline)?;
    let (name, source) = (script.path.to_string_lossy().into_owned(), script.source.clone());
    let modules = Modules::new(script.folder.as_deref(), product::get().modules);
    let mut sandbox = Sandbox::with_api(Limits::of_pipeline()?, |lua| {
        modules.install(lua)?;
        API.install(lua)
    })?;
    sandbox.stop_when(stop);
    let loaded = modules.clone();
    let recorded = move |known: usize| {
        let new = loaded.loaded_since(known).into_iter();
        new.map(|module| Module::new(module.name, module.source)).collect()
    };
    let host = start(script, Box::new(recorded), options)?;
    sandbox.lua().set_app_data(host);
    let result = sandbox
        .load(&name, source.as_bytes())
        .and_then(|chunk| sandbox.call(&name, &chunk, ()))
        .and_then(|returned| refuse_perturbation(&name, &returned));
    let host = sandbox
        .lua()
        .remove_app_data::<Host>()
        .ok_or_else(|| Error::new("the pipeline's host is gone, which is a defect in pdk"))?;
    Ok(host.finish(result))
}

/// Starts the session of a pipeline, and says what had to be left out. `modules` gives the modules that it has required so far, but for
/// as many first ones as its argument says.
pub(crate) fn start(
    script: Script,
    modules: Box<dyn Fn(usize) -> Vec<Module> + Send>,
    options: Options,
) -> Result<Host> {
    let Script { path, source, folder } = script;
    let given = given(&options.search);
    // A perturbation beside its pipeline is found without being named.
    let mut search = options.search;
    search.beside.extend(folder.iter().flat_map(|folder| [folder.clone(), folder.join("perturbations")]));
    interrupt::watch()?;
    let session = Session::start(SessionOptions {
        run: run_name(&path),
        pool: options.common.pool(),
        limits: options.common.limits(),
        search: search.clone(),
    })?;
    for refused in session.refused() {
        eprintln!("pdk: warning: {refused}");
    }
    let setup = Setup {
        pipeline: Pipeline { path, source, modules: Vec::new() },
        modules,
        given,
        search,
        common: options.common,
        settings: options.settings,
        audience: options.audience,
    };
    Ok(Host::new(session, setup))
}

/// What ends a script that computes when the user wants an end.
fn stop() -> Option<Error> {
    (interrupt::wish() != interrupt::Wish::None).then(interrupt::error)
}

/// The folders that the command line named, for the manifest.
fn given(search: &SearchPath) -> (Vec<PathBuf>, Vec<PathBuf>) {
    let search = search.absolute();
    let recorded = |folders: Vec<PathBuf>| folders.iter().map(|folder| recorded(folder)).collect();
    (recorded(search.plugins), recorded(search.drop_ins))
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
    use mlua::Lua;

    #[test]
    fn a_perturbation_is_not_a_pipeline() {
        let lua = Lua::new();
        let returned: LuaValue = lua.load("return { doc = 'x', apply = function() end }").eval().unwrap();
        assert!(
            refuse_perturbation("a.lua", &returned).unwrap_err().to_string().contains("is a perturbation")
        );
        assert!(refuse_perturbation("a.lua", &LuaValue::Nil).is_ok());
    }
}
