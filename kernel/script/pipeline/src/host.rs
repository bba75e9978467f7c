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
mod scenarios;
mod searches;
mod searching;
mod setup;
mod tasks;

use std::path::Path;

use pdk_components::suggest;
use pdk_model::scenario::parse_seed;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::seed::Key;
use pdk_session::session::Session;
use serde_json::{Map, Value};

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
use crate::run_settings::{RUN_SETTINGS, Setting};
use crate::settings;
use crate::{road, table, tables};

/// The state behind the global `pdk` of one pipeline.
pub struct Host {
    session: Session,
    setup: Setup,
    /// The pipeline's own settings, once it has declared them.
    settings: Option<Value>,
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
            settings: None,
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
        if self.settings.is_some() {
            return Err(Error::new("pdk.settings may be called once; put all settings into one table"));
        }
        let set = RUN_SETTINGS.iter().find(|setting| defaults.get(setting.name).is_some());
        if let Some(Setting { name, meaning, .. }) = set {
            return Err(Error::new(format!(
                "`{name}` is a setting that every pipeline has ({meaning}); leave it out of pdk.settings"
            )));
        }
        if self.record.directory.is_some() {
            return Err(Error::new(
                "pdk.settings has to come before the first pdk.drive or pdk.evaluate, because the record begins there",
            ));
        }
        let settings = settings::apply(defaults, &self.setup.overrides)?;
        self.settings = Some(settings.clone());
        Ok(settings)
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
        let simulators = self.session.catalog().of_kind(Kind::Simulator);
        let own_clock = simulators.filter(|entry| !entry.description.clock.is_stepped());
        Defaults::new(self.setup.common.seed, own_clock.map(|entry| entry.description.name.clone()).collect())
    }

    /// `pdk.show`: a table of what `pdk.drive` or `pdk.evaluate` returned.
    pub(crate) fn show(&self, result: &Value) -> Result<()> {
        let text = table::render(result)?;
        let ids =
            result.as_array().into_iter().flatten().filter_map(|outcome| outcome["id"].as_str()).collect();
        for sentence in self.scenarios.failing_unperturbed(&ids) {
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

    /// If the command line sets something although the pipeline has no settings of its own.
    fn check_overrides(&self) -> Result<()> {
        match self.settings {
            Some(_) => Ok(()),
            // Says that the setting does not exist.
            None => settings::apply(Value::Object(Map::new()), &self.setup.overrides).map(drop),
        }
    }

    /// Writes down what is used from here on, before anything is computed with it.
    fn begin(&mut self) -> Result<()> {
        self.check_overrides()?;
        self.record.begin(&mut self.setup, self.settings.as_ref())
    }
}
