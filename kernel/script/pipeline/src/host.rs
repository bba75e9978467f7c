//! What stands behind the global `pdk` of one pipeline: its settings, the session, and the record.

mod account;
mod components;
pub(crate) mod driving;
mod evaluating;
mod evaluations;
mod finishing;
mod frames;
mod inside;
mod record;
pub(crate) mod recordings;
mod scenarios;
mod searches;
mod searching;
mod setup;
mod tasks;

use std::path::Path;

use pdk_model::level_scale::LevelScale;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::parse_seed;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::seed::Key;
use pdk_sdk::suggest;
use pdk_session::session::Session;
use serde_json::Value;

use self::account::Account;
use self::components::Components;
use self::evaluations::Evaluations;
use self::frames::Frames;
use self::record::RunRecord;
use self::scenarios::Scenarios;
use self::searches::Searches;
pub use self::setup::Setup;
pub(crate) use self::tasks::UnderWay;
use crate::requests::Defaults;
use crate::{road, table, tables};

/// The state behind the global `pdk` of one pipeline.
pub struct Host {
    session: Session,
    setup: Setup,
    record: RunRecord,
    components: Components,
    scenarios: Scenarios,
    evaluations: Evaluations,
    searches: Searches,
    account: Account,
    frames: Frames,
}

impl Host {
    /// The host for one pipeline.
    pub fn new(session: Session, setup: Setup) -> Self {
        Self {
            session,
            record: RunRecord::default(),
            components: Components::default(),
            scenarios: Scenarios::default(),
            evaluations: Evaluations::default(),
            searches: Searches::default(),
            account: Account::new(),
            frames: Frames::new(setup.audience),
            setup,
        }
    }

    /// `pdk.settings`: the defaults with what the command line puts in their place.
    pub(crate) fn settings(&mut self, defaults: Value) -> Result<Value> {
        self.setup.settings.declare(defaults, self.record.directory.is_some())
    }

    /// Notes what did not go well without ending the run.
    pub(crate) fn warn(&mut self, sentence: String) {
        self.account.warnings.push(sentence);
    }

    /// How many scenarios are driven at the same time, once all workers are there.
    pub(crate) fn slots(&self) -> usize {
        self.session.slots()
    }

    /// The components there are.
    pub(crate) fn catalog(&self) -> Result<Value> {
        Ok(serde_json::to_value(self.session.catalog())?)
    }

    /// The defaults of scenarios.
    pub(crate) fn defaults(&self) -> Defaults {
        Defaults::of_run(&self.setup.common, self.session.catalog())
    }

    /// `pdk.show`: a table of what `pdk.drive` or `pdk.evaluate` returned.
    pub(crate) fn show(&self, result: &Value) -> Result<()> {
        let text = table::render(result)?;
        let ids =
            result.as_array().into_iter().flatten().filter_map(|outcome| outcome["id"].as_str()).collect();
        for sentence in self.scenarios.failing_unperturbed(&ids)? {
            self.print(&sentence);
        }
        self.print(&text);
        Ok(())
    }

    /// `pdk.table`: a table of the pipeline's own making.
    pub(crate) fn table(&self, header: &Value, rows: &Value) -> Result<()> {
        let text = tables::render(header, rows)?;
        self.print(&text);
        Ok(())
    }

    fn print(&self, text: &str) {
        // What a part shows is not what the whole will show.
        if self.setup.common.shard.is_none() {
            self.frames.print(text);
        }
    }

    /// `pdk.save`: a file in the record.
    pub(crate) fn save(&self, name: &Value, value: &Value) -> Result<()> {
        let name = tables::checked_name(name)?;
        let directory = self.record.directory.as_ref().ok_or_else(|| {
            Error::new("pdk.save has to come after the first pdk.drive or pdk.evaluate, because the record begins there")
        })?;
        directory.write_json(name, value)
    }

    /// `pdk.road`: a road for scenarios.
    pub(crate) fn road(&self, request: Value) -> Result<Value> {
        road::make(request, self.setup.common.seed)
    }

    /// `pdk.random`: the key of a stream of random numbers, from the run's seed if there is no other.
    ///
    /// # Errors
    /// If the seed is not one.
    pub(crate) fn random(&self, seed: &Value) -> Result<Key> {
        let seed = match seed {
            Value::Null => self.setup.common.seed,
            seed => parse_seed(&seed.to_string()).map_err(|error| error.at("pdk.random"))?,
        };
        Ok(pdk_sdk::seed::key(seed, "pdk.random", 0))
    }

    /// `pdk.perturbations`: the names of the perturbations, all or those of the default set.
    pub(crate) fn perturbations(&self, all: bool) -> Vec<String> {
        let wanted = self.session.catalog().of_kind(Kind::Perturbation);
        wanted.filter(|c| all || c.description.default).map(|c| c.description.name.clone()).collect()
    }

    /// The lowest and the highest level that a perturbation reaches on a scale; none if it reaches none, or was not measured for it.
    ///
    /// # Errors
    /// If there is no such perturbation or scale.
    pub(crate) fn reach(&self, name: &Value, scale: &Value) -> Result<Option<Vec<f64>>> {
        let (Some(name), Some(scale)) = (name.as_str(), scale.as_str()) else {
            return Err(Error::new(format!(
                "pdk.reach takes the names of a perturbation and of a scale, not {name} and {scale}"
            )));
        };
        let catalog = self.session.catalog();
        let entry = catalog.get(Kind::Perturbation, name).map_err(|error| error.at("pdk.reach"))?;
        if !entry.scales.iter().any(|measured| measured.scale.name == scale) && catalog.has_scale(scale) {
            return Ok(None);
        }
        let mut applied = AppliedPerturbation::new(name, 0.0);
        applied.level_scale = Some(LevelScale::Named(scale.to_owned()));
        let measured = catalog.measured_scale(&applied).map_err(|error| error.at("pdk.reach"))?;
        Ok(measured.and_then(|measured| measured.reach()).map(|(low, high)| vec![low, high]))
    }

    /// `pdk.draws`: whether a perturbation draws anything at random.
    ///
    /// # Errors
    /// If there is none of this name.
    pub(crate) fn draws(&self, name: &Value) -> Result<bool> {
        let Some(name) = name.as_str() else {
            return Err(Error::new(format!("pdk.draws takes the name of a perturbation, not {name}")));
        };
        let mut all = self.session.catalog().of_kind(Kind::Perturbation);
        match all.find(|component| component.description.name == name) {
            Some(component) => {
                let description = &component.description;
                Ok(!(description.drawn_per_sequence.is_empty() && description.drawn_per_frame.is_empty()))
            }
            None => {
                let known = self.perturbations(true);
                Err(Error::new(format!(
                    "pdk.draws: there is no perturbation `{name}`; {}",
                    suggest::hint(name, known.iter().map(String::as_str))
                )))
            }
        }
    }

    /// `pdk.path`: a path that counts from the pipeline's folder.
    pub(crate) fn path(&self, relative: &str) -> String {
        let folder = self.setup.pipeline.path.parent().unwrap_or(Path::new(""));
        folder.join(relative).to_string_lossy().into_owned()
    }

    /// Writes down what is used from here on, before anything is computed with it.
    fn begin(&mut self) -> Result<()> {
        self.setup.settings.check()?;
        self.record.begin(&mut self.setup)
    }
}
