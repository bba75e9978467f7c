//! The simulator `beamng`.

use pdk_adapter::Settings;
use pdk_sdk::prelude::*;

use crate::options::Options;
use crate::session::Session;

/// What users call it.
const TITLE: &str = "BeamNG.tech";
/// The port of BeamNG.tech, and the distance to that of the next game: vehicles have ports of their own above it.
const PORT: u16 = 25_252;
const PORT_STEP: u16 = 100;

/// The adapter to BeamNG.tech.
pub struct BeamNg {
    settings: Settings,
    options: Options,
    session: Option<Session>,
}

impl Component for BeamNg {
    fn description() -> Description {
        let description = Description::simulator("beamng", "BeamNG.tech, stepped frame by frame");
        let description = description.version(2).external();
        Settings::describe(Options::describe(description), PORT, PORT_STEP)
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { settings: Settings::read(TITLE, config)?, options: Options::read(config), session: None })
    }
}

impl Simulator for BeamNg {
    fn camera(&self) -> Camera {
        self.options.mount.camera
    }

    fn reset(&mut self, scenario: &Scenario, slot: u32) -> Result<State> {
        let deadline = self.settings.starting();
        // One that was closed meanwhile is gone before another is opened.
        let mut kept = self.session.take();
        let of_use = kept.as_mut().is_some_and(|session| session.slot() == slot && session.is_open());
        let session = match kept.filter(|_| of_use) {
            Some(session) => session,
            None => Session::open(&self.settings, &self.options, slot, &deadline)?,
        };
        self.session.insert(session).begin(scenario, &deadline)
    }

    fn frame(&mut self, into: FrameMut<'_>) -> Result<State> {
        let session = self.session.as_ref().ok_or_else(not_started)?;
        session.write(into)?;
        session.state()
    }

    fn act(&mut self, control: Control) -> Result<State> {
        self.session.as_mut().ok_or_else(not_started)?.act(control)
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        self.session.as_ref().map(Session::waypoints).unwrap_or_default()
    }

    fn info(&self) -> Vec<(String, String)> {
        match &self.session {
            Some(_) => vec![("protocol".to_owned(), self.options.protocol.clone())],
            None => Vec::new(),
        }
    }
}

fn not_started() -> Error {
    Error::new("it has no scenario yet: call reset first")
}
