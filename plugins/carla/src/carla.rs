//! The simulator `carla`.

use pdk_adapter::Settings;
use pdk_sdk::prelude::*;

use crate::annotation;
use crate::episode::Episode;
use crate::options::Options;
use crate::sensors::Sensors;
use crate::stage::Stage;

/// What users call it.
const TITLE: &str = "the CARLA server";
/// The port of CARLA, and the distance to that of the next server: each takes three ports in a row.
const PORT: u16 = 2000;
const PORT_STEP: u16 = 4;

/// The adapter to CARLA.
pub struct Carla {
    settings: Settings,
    options: Options,
    episode: Option<Episode>,
}

impl Component for Carla {
    fn description() -> Description {
        let description = Description::simulator("carla", "CARLA 0.9.13 to 0.9.16, stepped frame by frame");
        let description = description.version(2).external();
        Settings::describe(Options::describe(description), PORT, PORT_STEP)
    }

    fn new(config: &Config) -> Result<Self> {
        let options = Options::read(config)?;
        let settings = Settings::read(TITLE, config)?;
        if options.restart_every > 0 && settings.launch.is_empty() {
            return Err(Error::of(
                ErrorKind::Configuration,
                "`restart_every` is set, but pdk can only restart a server that it has started itself: say how with `launch`".to_owned(),
            ));
        }
        Ok(Self { settings, options, episode: None })
    }
}

impl Carla {
    fn stage(&self) -> Result<&Stage> {
        self.episode.as_ref().and_then(Episode::stage).ok_or_else(not_started)
    }

    fn sensors(&self) -> Result<&Sensors> {
        self.stage()?.sensors().ok_or_else(not_started)
    }
}

impl Simulator for Carla {
    fn camera(&self) -> Camera {
        self.options.mount.camera
    }

    fn reset(&mut self, scenario: &Scenario, slot: u32) -> Result<State> {
        let deadline = self.settings.starting();
        // One that was closed meanwhile is gone before another is opened.
        let mut kept = self.episode.take();
        let most = match self.options.restart_every {
            0 => u64::MAX,
            every => every,
        };
        let of_use = kept
            .as_mut()
            .is_some_and(|episode| episode.slot() == slot && episode.worlds() < most && episode.is_open());
        let episode = match kept.filter(|_| of_use) {
            Some(episode) => episode,
            None => Episode::open(&self.settings, slot, &deadline)?,
        };
        let episode = self.episode.insert(episode);
        episode.begin(scenario, &self.options, &deadline)
    }

    fn frame(&mut self, into: FrameMut<'_>) -> Result<State> {
        self.sensors()?.write(into)?;
        Ok(self.stage()?.state())
    }

    fn annotate(&mut self, annotations: Annotations) {
        self.options.annotations = annotations;
    }

    fn label_names(&self) -> Vec<String> {
        annotation::NAMES.map(str::to_owned).to_vec()
    }

    fn labels(&mut self, into: &mut [u8]) -> Result<()> {
        self.sensors()?.labels(into)
    }

    fn depth(&mut self, into: &mut [f32]) -> Result<()> {
        self.sensors()?.depth(into)
    }

    fn act(&mut self, control: Control) -> Result<State> {
        let deadline = self.settings.answering();
        let episode = self.episode.as_mut().ok_or_else(not_started)?;
        episode.step(|stage, server, world| stage.act(control, server, world, &deadline))
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        self.stage().map(|stage| stage.waypoints().to_vec()).unwrap_or_default()
    }

    fn info(&self) -> Vec<(String, String)> {
        self.episode.as_ref().map(Episode::info).unwrap_or_default()
    }
}

fn not_started() -> Error {
    Error::new("it has no scenario yet: call reset first")
}
