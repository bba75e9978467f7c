//! The record of a run: its folder, its manifest, and the ledger once scenarios need it.

use std::path::{Path, PathBuf};

use pdk_record::directory::{MANIFEST, RunDirectory};
use pdk_record::evaluated::EvaluationRecord;
use pdk_record::files::recorded;
use pdk_record::ledger::Ledger;
use pdk_record::located;
use pdk_record::manifest::{InUse, Machine, Manifest, Pipeline};
use pdk_sdk::error::{Error, Result};
use pdk_session::session::Session;
use serde_json::Value;

use super::setup::Setup;

/// The folder for records if the user names none.
const RUNS: &str = "runs";

/// What is recorded of a run.
#[derive(Default)]
pub(super) struct RunRecord {
    /// The folder, once something is recorded.
    pub directory: Option<RunDirectory>,
    /// What the run uses: components and files.
    pub in_use: InUse,
    /// The evaluations that were begun.
    pub evaluations: Vec<EvaluationRecord>,
    /// Whether the session has the ledger, which only scenarios need.
    has_ledger: bool,
    /// The manifest that an earlier process left in the folder.
    earlier: Option<Manifest>,
    /// The manifest as it is written.
    manifest: Option<Value>,
    /// How many modules, components with their files, and evaluations were in use when it was made.
    written: Option<[usize; 3]>,
}

impl RunRecord {
    /// Writes down what is used from here on, before anything is computed with it.
    ///
    /// # Errors
    /// If it cannot be written, or the folder holds the record of another run.
    pub fn begin(&mut self, setup: &mut Setup) -> Result<()> {
        let directory = self.open(setup)?;
        let new = (setup.modules)(setup.pipeline.modules.len());
        setup.pipeline.modules.extend(new);
        // They only become more, and nothing else changes. A pipeline may submit many scenarios one by one.
        let in_use = [setup.pipeline.modules.len(), self.in_use.count(), self.evaluations.len()];
        if self.written == Some(in_use) {
            return Ok(());
        }
        let manifest = Manifest {
            pdk: env!("CARGO_PKG_VERSION").to_owned(),
            seed: setup.common.seed,
            pipeline: Pipeline { path: recorded(&setup.pipeline.path), ..setup.pipeline.clone() },
            settings: setup.settings.declared().cloned().unwrap_or_default(),
            folder: located::from_record(directory.path()),
            plugins: setup.given.0.clone(),
            drop_ins: setup.given.1.clone(),
            components: self.in_use.components(),
            files: self.in_use.files(),
            evaluations: self.evaluations.clone(),
            machine: Machine::this(),
            shard: setup.common.shard,
        };
        let manifest = match &self.earlier {
            None => manifest,
            Some(earlier) => manifest.continuing(earlier).map_err(|difference| {
                // What another run recorded stays as it is.
                self.directory = None;
                Error::new(format!(
                    "the output folder {} holds the record of another run: {difference}; choose another with --out",
                    directory.path().display()
                ))
            })?,
        };
        let manifest = serde_json::to_value(manifest)?;
        if self.manifest.as_ref() != Some(&manifest) {
            directory.write_json(MANIFEST, &manifest)?;
            self.manifest = Some(manifest);
        }
        self.written = Some(in_use);
        Ok(())
    }

    /// Hands the session the ledger, so that it records scenarios.
    ///
    /// # Errors
    /// If the ledger is damaged.
    pub fn open_ledger(&mut self, session: &mut Session, keep_errors: bool) -> Result<()> {
        if let (Some(directory), false) = (self.directory.clone(), self.has_ledger) {
            directory.remove_partial_traces();
            // A record that is damaged stays as it is.
            let ledger = Ledger::open(&directory).inspect_err(|_| self.directory = None)?;
            session.record(directory, ledger, keep_errors);
            self.has_ledger = true;
        }
        Ok(())
    }

    /// The folder of the record, which is made when it is first needed.
    fn open(&mut self, setup: &Setup) -> Result<RunDirectory> {
        if let Some(directory) = &self.directory {
            return Ok(directory.clone());
        }
        let directory = match &setup.common.out {
            Some(path) => RunDirectory::create(path),
            None => RunDirectory::create_first(folders(&setup.pipeline.path)),
        }?;
        self.earlier = directory.manifest()?;
        Ok(self.directory.insert(directory).clone())
    }
}

/// The folders `runs/NAME-N`, one after the other.
fn folders(pipeline: &Path) -> impl Iterator<Item = PathBuf> {
    let name = pipeline.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    (1..).map(move |number: u64| Path::new(RUNS).join(format!("{name}-{number}")))
}
