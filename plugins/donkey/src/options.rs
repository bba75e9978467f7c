//! The parameters of the adapter.

use pdk_adapter::Settings;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, json};

/// Which build of the simulator it is. They differ in units, in how a scene is chosen, and in what they know of roads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Build {
    /// The current one, with a menu of scenes.
    Current,
    /// The one that builds roads from points, and loads its only scene by itself.
    RoadGenerating,
}

impl Build {
    /// As users write it, the default first.
    pub const NAMES: [&str; 2] = ["current", "road_generating"];

    fn named(name: &str) -> Self {
        match name {
            "road_generating" => Self::RoadGenerating,
            _ => Self::Current,
        }
    }

    /// By how much positions and speeds of the simulator have to be multiplied for metres: the car of the current build is a model,
    /// and it says what a real one would measure.
    pub fn scale(self) -> f64 {
        match self {
            Self::Current => 8.0,
            Self::RoadGenerating => 1.0,
        }
    }
}

/// What the user has set.
#[derive(Debug, Clone)]
pub struct Options {
    /// Where the simulator is.
    pub settings: Settings,
    /// Which build it is.
    pub build: Build,
    /// The scene to load.
    pub scene: String,
    /// Size and rate of the camera.
    pub camera: Camera,
    /// The message that configures the camera.
    pub camera_fields: Vec<(&'static str, String)>,
    /// The message that configures the car.
    pub car_fields: Vec<(&'static str, String)>,
    /// The cross-track error in metres at which the vehicle has left its lane.
    pub lane_departure: f64,
    /// How long the car is watched at the start before it counts as standing there.
    pub settle: f64,
    /// Slower than this it stands, in metres a second.
    pub standing_speed: f64,
}

/// The numbers of the camera: name of the parameter, of the field, and what it is. 0 leaves the scene's own.
const CAMERA: [(&str, &str, &str, &str); 8] = [
    ("field_of_view", "fov", "degrees", "angle that the frame's height covers; 0 for the scene's own"),
    ("fisheye_x", "fish_eye_x", "", "how much the picture bulges sideways; 0 for the scene's own"),
    ("fisheye_y", "fish_eye_y", "", "how much the picture bulges upwards; 0 for the scene's own"),
    (
        "camera_right",
        "offset_x",
        "m",
        "how far the camera is moved to the right, in the scene's units; 0 for its own place",
    ),
    ("camera_up", "offset_y", "m", "how far it is moved up, in the scene's units; 0 for its own place"),
    ("camera_ahead", "offset_z", "m", "how far it is moved ahead, in the scene's units; 0 for its own place"),
    ("camera_pitch", "rot_x", "degrees", "angle by which it looks down; 0 for its own"),
    ("camera_yaw", "rot_y", "degrees", "angle by which it looks to the right; 0 for its own"),
];

/// Describes the component.
pub fn describe(description: Description) -> Description {
    let description =
        description.external().own_clock().source("https://github.com/tawnkramer/sdsandbox").parameter(
            Parameter::choice(
                "build",
                &Build::NAMES,
                "the current build, or the one that builds roads from points",
            ),
        );
    let mut description = Settings::describe(description, 9091, 1)
        .parameter(Parameter {
            default: "generated_track".into(),
            ..Parameter::text("scene", "scene to load").only_for("build", "current")
        })
        .camera([320, 240], 1.0..=4096.0)
        .parameter(Parameter::choice(
            "encoding",
            &["jpg", "png"],
            "how frames are sent: jpg is smaller, png without loss",
        ));
    for (name, _, unit, doc) in CAMERA {
        description =
            description.parameter(Parameter::number(name, 0.0, doc).range(-360.0, 360.0).unit(unit));
    }
    description
        .parameter(Parameter::choice(
            "body",
            &["donkey", "bare", "car01", "f1", "cybertruck"],
            "body of the car",
        ))
        .parameter(Parameter::json(
            "color",
            json!([128, 128, 128]),
            "colour of the body: red, green and blue, 0 to 255",
        ))
        .parameter(Parameter {
            default: "pdk".into(),
            ..Parameter::text("car_name", "name that is shown above the car")
        })
        .parameter(
            Parameter::number(
                "lane_departure",
                2.0,
                "cross-track error at which the vehicle has left its lane, unless the scenario says it",
            )
            .range(0.01, 100.0)
            .unit("m"),
        )
        .parameter(
            Parameter::number("standing_speed", 0.05, "a car that is slower than this stands")
                .range(0.0, 100.0)
                .unit("m/s"),
        )
        .parameter(
            Parameter::number(
                "settle_seconds",
                1.0,
                "how long the car has to stand at the start before a scenario begins",
            )
            .range(0.0, 60.0)
            .unit("s"),
        )
}

impl Options {
    /// Reads the parameters.
    ///
    /// # Errors
    /// If the colour is none, or `launch` no list of texts.
    pub fn read(config: &Config) -> Result<Self> {
        let build = Build::named(config.text("build"));
        let camera = config.camera();
        let mut camera_fields: Vec<_> =
            CAMERA.iter().map(|(name, field, ..)| (*field, config.number(name).to_string())).collect();
        camera_fields.extend([
            ("img_w", camera.width.to_string()),
            ("img_h", camera.height.to_string()),
            ("img_d", "3".to_owned()),
            ("img_enc", config.text("encoding").to_uppercase()),
            ("rot_z", "0".to_owned()),
        ]);
        let [red, green, blue] = color(config.value("color"))?;
        let car_fields = vec![
            ("body_style", config.text("body").to_owned()),
            ("body_r", red.to_string()),
            ("body_g", green.to_string()),
            ("body_b", blue.to_string()),
            ("car_name", config.text("car_name").to_owned()),
            ("font_size", "100".to_owned()),
        ];
        Ok(Self {
            settings: Settings::read("the Donkey simulator", config)?,
            build,
            scene: config.text("scene").to_owned(),
            camera,
            camera_fields,
            car_fields,
            lane_departure: config.number("lane_departure"),
            settle: config.number("settle_seconds"),
            standing_speed: config.number("standing_speed"),
        })
    }
}

fn color(value: &Value) -> Result<[u8; 3]> {
    let channels: Option<Vec<u8>> = value.as_array().and_then(|list| {
        list.iter().map(|channel| channel.as_u64().and_then(|channel| u8::try_from(channel).ok())).collect()
    });
    channels.and_then(|channels| channels.try_into().ok()).ok_or_else(|| {
        Error::of(
            ErrorKind::Configuration,
            format!("`color` is {value}, but has to be three whole numbers from 0 to 255, as in [255, 0, 0]"),
        )
    })
}
