//! The simulator `beamng`.

use pdk_adapter::{Mount, Settings};
use pdk_sdk::prelude::*;

use crate::scenery::Materials;
use crate::session::Session;

/// What users call it.
const TITLE: &str = "BeamNG.tech";
/// The port of BeamNG.tech, and the distance to that of the next game: vehicles have ports of their own above it.
const PORT: u16 = 25_252;
const PORT_STEP: u16 = 100;
/// The game takes at least so many steps a second.
const STEPS: f64 = 60.0;

/// The adapter to BeamNG.tech.
pub struct BeamNg {
    settings: Settings,
    options: Options,
    session: Option<Session>,
}

/// What a user has set about scenarios.
#[derive(Debug, Clone)]
pub struct Options {
    /// The camera on the vehicle.
    pub mount: Mount,
    /// The level on whose ground the road is drawn.
    pub level: String,
    /// The height of that ground in metres.
    pub ground: f64,
    /// What the road is drawn with.
    pub materials: Materials,
    /// What is driven.
    pub vehicle: String,
    /// How much damage is a collision, in the game's own number.
    pub collision_damage: f64,
    /// The version of the protocol.
    pub protocol: String,
}

impl Options {
    /// Steps of the game from one frame to the next.
    pub fn steps(&self) -> u32 {
        (STEPS / self.mount.camera.rate).ceil().max(1.0) as u32
    }
}

impl Component for BeamNg {
    fn description() -> Description {
        let description = Description::simulator("beamng", "BeamNG.tech, stepped frame by frame").external();
        let description = Mount::describe(description, 0.5, 1.5)
            .parameter(Parameter::text(
                "level",
                "the level on whose ground the road is drawn; left out, smallgrid",
            ))
            .parameter(
                Parameter::number("ground", 0.0, "height of that ground")
                    .range(-10_000.0, 10_000.0)
                    .unit("m"),
            )
            .parameter(Parameter::text(
                "road_material",
                "what the road is drawn with; left out, a_asphalt_01_a",
            ))
            .parameter(Parameter::text(
                "edge_material",
                "what its edge lines are drawn with; left out, line_white",
            ))
            .parameter(Parameter::text(
                "middle_material",
                "what its middle line is drawn with; left out, line_dashed_short",
            ))
            .parameter(Parameter::text("vehicle", "what is driven, by BeamNG's name; left out, etk800"))
            .parameter(
                Parameter::number(
                    "collision_damage",
                    100.0,
                    "how much the vehicle's damage, in BeamNG's own number, has to grow after the start to be a collision",
                )
                .range(0.0, 1e9),
            )
            .parameter(Parameter::text(
                "protocol",
                "version of the protocol, which has to be the game's; left out, v1.27",
            ));
        Settings::describe(description, PORT, PORT_STEP)
    }

    fn new(config: &Config) -> Result<Self> {
        let named = |name: &str, usual: &str| match config.text(name) {
            "" => usual.to_owned(),
            given => given.to_owned(),
        };
        let options = Options {
            mount: Mount::read(config),
            level: named("level", "smallgrid"),
            ground: config.number("ground"),
            materials: Materials {
                road: named("road_material", "a_asphalt_01_a"),
                edge: named("edge_material", "line_white"),
                middle: named("middle_material", "line_dashed_short"),
            },
            vehicle: named("vehicle", "etk800"),
            collision_damage: config.number("collision_damage"),
            protocol: named("protocol", "v1.27"),
        };
        Ok(Self { settings: Settings::read(TITLE, config)?, options, session: None })
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
