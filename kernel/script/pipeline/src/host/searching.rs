//! The beginning and the end of searches.

use pdk_model::component::ComponentSpec;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_session::connection::Pool;
use pdk_session::session::{Options, Session};
use serde_json::Value;

use super::Host;
use super::searches::BegunSearch;
use crate::naming::run_name;
use crate::tables;

impl Host {
    /// Begins a search with a strategy: a component, which gets a session of one worker on this machine that it has to itself, or
    /// none. `ends_by_outcomes` says whether it depends on outcomes or on the time when the search stops.
    pub(crate) fn begin_search(
        &mut self,
        name: Option<&str>,
        strategy: Option<&ComponentSpec>,
        ends_by_outcomes: bool,
    ) -> Result<BegunSearch> {
        self.refuse_part(strategy, ends_by_outcomes)?;
        let number = self.searches.begun;
        self.searches.begun += 1;
        let name = match (name, number) {
            (Some(name), _) => name.to_owned(),
            (None, 0) => "search".to_owned(),
            (None, _) => format!("search-{}", number + 1),
        };
        tables::checked_name(&Value::String(format!("{name}.json")))?;
        if self.searches.names.contains(&name) {
            return Err(Error::new(format!(
                "pdk.search: the run has a search `{name}` already, whose files this one would overwrite; give it another `name`"
            )));
        }
        if let Some(strategy) = strategy {
            let catalog = self.session.catalog();
            catalog.check(Kind::Search, &strategy.name, &strategy.parameters)?;
            self.note_files(Kind::Search, strategy)?;
            let catalog = self.session.catalog();
            self.record.in_use.add(
                catalog,
                Kind::Search,
                &strategy.name,
                &strategy.parameters,
                Vec::new(),
            )?;
        }
        self.begin()?;
        let described =
            strategy.and_then(|strategy| self.session.catalog().get(Kind::Search, &strategy.name).ok());
        let baseline = described.is_some_and(|entry| entry.description.baseline);
        let session = match strategy {
            None => None,
            Some(_) => Some(match self.searches.strategist.take() {
                Some(session) => session,
                None => Session::start(Options {
                    run: format!("{}-search{number}", run_name(&self.setup.pipeline.path)),
                    pool: Pool::Here(1),
                    limits: self.setup.common.limits(),
                    search: self.setup.search.clone(),
                })?,
            }),
        };
        self.searches.names.insert(name.clone());
        Ok(BegunSearch {
            name,
            number,
            seed: self.setup.common.seed,
            slots: self.session.slots(),
            baseline,
            session,
        })
    }

    /// Ends a search: its files go into the record, and its session is kept for the next one.
    pub(crate) fn end_search(
        &mut self,
        name: &str,
        found: &Value,
        table: &str,
        session: Option<Session>,
    ) -> Result<()> {
        self.searches.strategist = session.or(self.searches.strategist.take());
        if let Some(directory) = &self.record.directory {
            directory.write_json(&format!("{name}.json"), found)?;
            directory.write_text(&format!("{name}.csv"), table)?;
        }
        Ok(())
    }

    /// Refuses a part of a search that goes another way with other outcomes.
    fn refuse_part(&self, strategy: Option<&ComponentSpec>, ends_by_outcomes: bool) -> Result<()> {
        if self.setup.common.shard.is_none() {
            return Ok(());
        }
        let catalog = self.session.catalog();
        let learns_nothing: Vec<&str> = catalog
            .of_kind(Kind::Search)
            .filter(|entry| entry.description.learns_nothing)
            .map(|entry| entry.description.name.as_str())
            .collect();
        let refused = |reason: String| Err(Error::of(ErrorKind::Configuration, reason));
        match strategy.is_some_and(|strategy| learns_nothing.contains(&strategy.name.as_str())) {
            false => refused(format!(
                "pdk.search decides by outcomes what to drive next, so a part of it cannot be run alone; leave out --shard, and use --pool for \
                 several machines, or choose a strategy that learns nothing ({})",
                learns_nothing.join(", ")
            )),
            true if ends_by_outcomes => refused(
                "pdk.search stops by `hypervolume` or `seconds`, so a part of it cannot be run alone; leave out --shard, or let it stop by \
                 `evaluations`"
                    .to_owned(),
            ),
            true => Ok(()),
        }
    }
}
