//! What a run knows about components: each is made once, before anything is computed with it.

use std::collections::{BTreeMap, BTreeSet};

use pdk_loop::protocol::Made;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::Scenario;
use pdk_network::reason::ASSUMED;
use pdk_record::manifest::components_of;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_session::interrupt::{self, Wish};
use pdk_session::session::Session;
use serde_json::Value;

use crate::outcomes::Submitted;

/// A component, by its kind and what it is made from.
pub(super) type Key = (Kind, String);

/// The key of a component.
///
/// # Errors
/// If it cannot be JSON.
pub(super) fn key(kind: Kind, component: &ComponentSpec) -> Result<Key> {
    Ok((kind, serde_json::to_string(component)?))
}

/// The components that were made.
#[derive(Default)]
pub(super) struct Components {
    /// What they said.
    made: BTreeMap<Key, Made>,
    /// Those whose files have been noted.
    read: BTreeSet<Key>,
    /// Those that panicked then, took their process along or did not come back, and how.
    fatal: BTreeMap<Key, Error>,
    /// What scenarios and evaluations left to the machine, such as the engine of networks, and what it was.
    pub settled: Vec<(String, String)>,
    /// The contents of the files that scenarios name, by their paths.
    pub contents: BTreeMap<String, String>,
    /// The contents of the recordings that were opened, by their readers.
    pub recordings: BTreeMap<Key, String>,
}

impl Components {
    /// What a component is like; each is made once.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn make(&mut self, session: &mut Session, kind: Kind, component: &ComponentSpec) -> Result<Made> {
        let key = key(kind, component)?;
        if let Some(made) = self.made.get(&key) {
            return Ok(made.clone());
        }
        let made = session.make(kind, component)?;
        for (_, assumed) in made.info.iter().filter(|(name, _)| name == ASSUMED) {
            let model = component.parameters.get("model").and_then(Value::as_str).unwrap_or("FILE.onnx");
            // A gate has a host for each of its recordings.
            pdk_notice::error_line_once(format_args!(
                "pdk: notice: {kind} `{component}` assumes {assumed}, because nothing says otherwise; if that is wrong, describe the network \
                 in a file beside it; `pdk new network {model}` writes one to complete"
            ));
        }
        self.made.insert(key, made.clone());
        Ok(made)
    }

    /// As [`make`](Self::make), for a scenario: a component that cannot be made is an error at once, but one that panics, takes its
    /// process along or does not come back is the outcome of each scenario that needs it.
    ///
    /// # Errors
    /// If it cannot be made in another way.
    pub fn try_to_make(
        &mut self,
        session: &mut Session,
        kind: Kind,
        component: &ComponentSpec,
    ) -> Result<Made> {
        let key = key(kind, component)?;
        if self.fatal.contains_key(&key) {
            return Ok(Made::default());
        }
        match self.make(session, kind, component) {
            Err(error)
                if matches!(error.kind(), ErrorKind::Lost | ErrorKind::Late | ErrorKind::Panic)
                    && interrupt::wish() == Wish::None =>
            {
                self.fatal.insert(key, error);
                Ok(Made::default())
            }
            made => made,
        }
    }

    /// The components of a scenario that went wrong when they were made.
    ///
    /// # Errors
    /// If one cannot be JSON.
    pub fn fatal_of(&self, scenario: &Scenario) -> Result<Vec<Key>> {
        if self.fatal.is_empty() {
            return Ok(Vec::new());
        }
        let keys = components_of(scenario).into_iter().map(|(kind, component)| key(kind, &component));
        keys.filter(|key| key.as_ref().map_or(true, |key| self.fatal.contains_key(key))).collect()
    }

    /// How components of these scenarios went wrong when they were made, each once.
    pub fn troubles<'a>(&'a self, scenarios: impl Iterator<Item = &'a Submitted>) -> Vec<String> {
        let keys: BTreeSet<&Key> = scenarios.flat_map(|submitted| &submitted.fatal).collect();
        keys.into_iter().filter_map(|key| self.fatal.get(key)).map(ToString::to_string).collect()
    }

    /// Whether the files of a component are to be noted, which is so once. One that cannot be made does not come to read anything.
    ///
    /// # Errors
    /// If it cannot be JSON.
    pub fn is_unread(&mut self, kind: Kind, component: &ComponentSpec) -> Result<bool> {
        let key = key(kind, component)?;
        Ok(!self.fatal.contains_key(&key) && self.read.insert(key))
    }
}
