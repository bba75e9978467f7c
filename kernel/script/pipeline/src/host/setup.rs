//! What a run is made with.

use std::path::PathBuf;

use pdk_components::search_path::SearchPath;
use pdk_record::manifest::{Module, Pipeline};

use crate::follow::Audience;
use crate::run_settings::RunSettings;
use crate::settings::PipelineSettings;

/// What was given at the start of a run.
pub struct Setup {
    /// The pipeline.
    pub pipeline: Pipeline,
    /// Gives the modules that were required so far, but for this many first ones.
    pub modules: Box<dyn Fn(usize) -> Vec<Module> + Send>,
    /// The folders that `--plugins` and `--drop-ins` named, for the manifest.
    pub given: (Vec<PathBuf>, Vec<PathBuf>),
    /// Where components are looked for.
    pub search: SearchPath,
    /// The settings that every run has.
    pub common: RunSettings,
    /// The pipeline's own settings.
    pub settings: PipelineSettings,
    /// Who follows the run.
    pub audience: Audience,
}
