//! The parameters of the adapter.

use pdk_adapter::Settings;
use pdk_sdk::prelude::*;

/// Which build of the simulator it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Build {
    /// The one that takes roads, sends telemetry by itself, and says where the vehicle is.
    RoadGenerating,
    /// The one that Udacity has published, which answers each command with telemetry.
    Stock,
}

impl Build {
    /// As users write it, the default first.
    pub const NAMES: [&str; 2] = ["road_generating", "stock"];

    /// By how much its speeds have to be multiplied for metres a second: one says miles an hour.
    pub fn speed_scale(self) -> f64 {
        match self {
            Self::RoadGenerating => 1.0,
            Self::Stock => 1.0 / 2.236_936_29,
        }
    }
}

/// What the user has set.
#[derive(Debug, Clone)]
pub struct Options {
    /// Where pdk listens.
    pub settings: Settings,
    /// Which build it is.
    pub build: Build,
    /// Size and rate of the camera.
    pub camera: Camera,
    /// The cross-track error in metres at which the vehicle has left its lane.
    pub lane_departure: f64,
    /// How long the vehicle is watched at the start before it counts as standing there.
    pub settle: f64,
    /// Slower than this it stands, in metres a second.
    pub standing_speed: f64,
}

/// Describes the component.
pub fn describe(description: Description) -> Description {
    let description = description
        .external()
        .own_clock()
        .source("https://github.com/udacity/self-driving-car-sim")
        .parameter(Parameter::choice(
            "build",
            &Build::NAMES,
            "the build that takes roads, or the one that Udacity has published",
        ));
    Settings::describe(description, 4567, 1)
        .camera([320, 160], 1.0..=4096.0)
        .parameter(
            Parameter::number(
                "lane_departure",
                4.0,
                "cross-track error at which the vehicle has left its lane, unless the scenario says it",
            )
            .range(0.01, 100.0)
            .unit("m"),
        )
        .parameter(
            Parameter::number("standing_speed", 0.05, "a vehicle that is slower than this stands")
                .range(0.0, 100.0)
                .unit("m/s"),
        )
        .parameter(
            Parameter::number(
                "settle_seconds",
                1.0,
                "how long the vehicle has to stand at the start before a scenario begins",
            )
            .range(0.0, 60.0)
            .unit("s"),
        )
}

impl Options {
    /// Reads the parameters.
    ///
    /// # Errors
    /// If `launch` is not a list of texts.
    pub fn read(config: &Config) -> Result<Self> {
        Ok(Self {
            settings: Settings::read("the Udacity simulator", config)?,
            build: if config.text("build") == "stock" { Build::Stock } else { Build::RoadGenerating },
            camera: config.camera(),
            lane_departure: config.number("lane_departure"),
            settle: config.number("settle_seconds"),
            standing_speed: config.number("standing_speed"),
        })
    }
}
