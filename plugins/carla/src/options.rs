//! What a user can set about scenarios in CARLA.

use pdk_adapter::Mount;
use pdk_road::traffic::Wanted;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Map, Value};

use crate::weather::Weather;

/// What a user has set about scenarios.
#[derive(Debug, Clone)]
pub struct Options {
    /// The camera on the vehicle.
    pub mount: Mount,
    /// What is wanted besides frames.
    pub annotations: Annotations,
    /// Other attributes of the camera.
    pub camera_attributes: Vec<(String, String)>,
    /// What is driven.
    pub vehicle: String,
    /// Its speed at the start in metres per second.
    pub initial_speed: f64,
    /// The weather.
    pub weather: Weather,
    /// The other vehicles.
    pub traffic: Wanted,
    /// How long the camera looks at the start of the road before the scenario begins, in seconds of simulation time.
    pub exposure_seconds: f64,
    /// After this many worlds a server that pdk has started is started again; 0 for never.
    pub restart_every: u64,
}

impl Options {
    /// Adds what a user can set.
    pub fn describe(description: Description) -> Description {
        Mount::describe(description, 1.5, 1.6)
            .parameter(Parameter::json(
                "camera_attributes",
                Value::Null,
                "further attributes of CARLA's camera, such as {\"motion_blur_intensity\": 0}",
            ))
            .parameter(
                Parameter::number(
                    "exposure_seconds",
                    3.0,
                    "simulation time for which the camera looks at the start of the road before a scenario begins: a camera that was just \
                     spawned adapts its exposure for some seconds",
                )
                .range(0.0, 60.0)
                .unit("s"),
            )
            .parameter(
                Parameter::integer(
                    "restart_every",
                    0,
                    "after this many worlds pdk starts its server again, since a server grows with every road that it generates; needs \
                     `launch`; 0 for never",
                )
                .range(0.0, 1_000_000.0),
            )
            .parameter(Parameter::text("vehicle", "what is driven, by CARLA's name; left out, vehicle.tesla.model3"))
            .parameter(
                Parameter::number("initial_speed", 0.0, "speed of the vehicle at the start of the road")
                    .range(0.0, 50.0)
                    .unit("m/s"),
            )
            .parameter(
                Parameter::number("vehicle_ahead", 0.0, "free distance to a vehicle ahead in the same lane at the start; 0 for none")
                    .range(0.0, 140.0)
                    .unit("m"),
            )
            .parameter(
                Parameter::number(
                    "vehicle_ahead_speed",
                    6.5,
                    "mean speed of the vehicle ahead; it swings by 30 % around it every 14 s",
                )
                .range(0.5, 40.0)
                .unit("m/s"),
            )
            .parameter(
                Parameter::number("oncoming", 0.0, "oncoming vehicles a kilometre, on roads of the scenario's own")
                    .range(0.0, 60.0)
                    .unit("1/km"),
            )
            .parameter(Parameter::json(
                "weather",
                Value::Null,
                "the weather: the name of one of CARLA's, such as \"HardRainNoon\", or an object with some of its numbers, such as \
                 {\"fog_density\": 40}; null for that of the server",
            ))
    }

    /// What a user has set.
    ///
    /// # Errors
    /// If the camera's attributes or the weather are not what they have to be.
    pub fn read(config: &Config) -> Result<Self> {
        let vehicle = match config.text("vehicle") {
            "" => "vehicle.tesla.model3",
            name => name,
        };
        Ok(Self {
            mount: Mount::read(config),
            annotations: Annotations::default(),
            camera_attributes: attributes(config.value("camera_attributes"))?,
            vehicle: vehicle.to_owned(),
            initial_speed: config.number("initial_speed"),
            weather: Weather::read(config.value("weather"))?,
            traffic: Wanted {
                gap: config.number("vehicle_ahead"),
                speed: config.number("vehicle_ahead_speed"),
                oncoming: config.number("oncoming"),
            },
            exposure_seconds: config.number("exposure_seconds"),
            restart_every: config.integer("restart_every").unsigned_abs(),
        })
    }
}

/// Attributes as CARLA takes them: texts.
fn attributes(value: &Value) -> Result<Vec<(String, String)>> {
    let none = Map::new();
    let fields = match value {
        Value::Null => &none,
        Value::Object(fields) => fields,
        other => {
            return Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "`camera_attributes` is {other}, but has to be an object, such as {{\"motion_blur_intensity\": 0}}"
                ),
            ));
        }
    };
    let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    Ok(fields.iter().map(|(name, value)| (name.clone(), text(value))).collect())
}
