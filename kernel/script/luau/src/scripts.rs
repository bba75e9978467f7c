//! Components from scripts, for the registry. What a file is follows from what it returns and where it lies.

use std::path::{Path, PathBuf};

use pdk_components::registry::{Script, Scripts};
use pdk_components::search_path::{PATH_VARIABLE, SearchPath};
use pdk_sdk::abi::host::Instance;
use pdk_sdk::config::Config;
use pdk_sdk::describe::{Description, Kind};
use pdk_sdk::error::Result;

use crate::glance::Glance;
use crate::perturbation::{self, Returned, Source};

/// The folders of this name hold perturbations and nothing else.
const FOLDER: &str = "perturbations";

/// Makes components from Lua files.
///
/// A table with `apply` or a text `doc` is a perturbation, one with `mask` a mask, wherever it lies. In a folder named `perturbations`, or where the user named the very
/// file, everything else is a mistake. Elsewhere a script may also be a pipeline, or a module that a pipeline requires: these are told by their
/// texts and not run.
#[derive(Debug, Clone, Default)]
pub struct LuaScripts {
    /// The files that the user named.
    named: Vec<PathBuf>,
}

impl LuaScripts {
    /// Scripts that are looked for in these places.
    pub fn new(search: &SearchPath) -> Self {
        let variable = std::env::var_os(PATH_VARIABLE);
        let variable = variable.iter().flat_map(std::env::split_paths);
        let files = search.plugins.iter().cloned().chain(variable).filter(|place| place.is_file());
        Self { named: files.map(|file| file.canonicalize().unwrap_or(file)).collect() }
    }

    /// Whether a file can be a perturbation only.
    fn is_meant(&self, path: &Path) -> bool {
        let folder = path.parent().and_then(Path::file_name);
        folder.is_some_and(|name| name == FOLDER)
            || path.canonicalize().is_ok_and(|path| self.named.contains(&path))
    }
}

impl Scripts for LuaScripts {
    fn describe(&self, script: Script<'_>) -> Result<Option<Description>> {
        let source = Source::of(script)?;
        let is_meant = match script {
            Script::File(path) => self.is_meant(path),
            Script::BuiltIn(_) => true,
        };
        if is_meant {
            return perturbation::description(&source).map(Some);
        }
        if source.glance() != Glance::Component {
            return Ok(None);
        }
        match perturbation::look_at(&source)? {
            Returned::Perturbation(declaration) => Ok(Some(declaration.description)),
            Returned::Other(mlua::Value::Nil) => Err(source.without_return()),
            Returned::Pipeline | Returned::Other(_) => Ok(None),
        }
    }

    fn create(&self, script: Script<'_>, config: &Config) -> Result<Instance> {
        let made = perturbation::open(&Source::of(script)?, config)?;
        Ok(match made.description().kind {
            Kind::Mask => Instance::Mask(Box::new(made)),
            _ => Instance::Perturbation(Box::new(made)),
        })
    }
}

#[cfg(test)]
mod tests;
