//! What the drivers share whose network is part of this plugin. They learned to drive from images of the embedded simulator; the recipe is in
//! `scripts/training`.

use pdk_network::Given;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, json};

use super::onnx::Onnx;
use crate::engine;
use crate::model_file::Source;

/// The parameter with the speed that stands for one that is not known.
const SPEED: &str = "speed";
/// The highest such speed, in metres per second.
const FASTEST: f64 = 100.0;

/// A network of this plugin that drives.
pub struct Trained {
    name: &'static str,
    network: Onnx,
    /// The speed that stands for one that is not known.
    assumed: Option<f64>,
}

impl Trained {
    /// Makes the driver.
    ///
    /// # Errors
    /// If the engine cannot run the network, or the speed is not one.
    pub fn open(name: &'static str, content: &'static [u8], config: &Config) -> Result<Self> {
        let assumed = match config.value(SPEED) {
            Value::Null => None,
            given => {
                Some(given.as_f64().filter(|speed| (0.0..=FASTEST).contains(speed)).ok_or_else(|| {
                    Error::new(format!(
                        "`{SPEED}` is {given}, but has to be a number of m/s from 0 to {FASTEST}"
                    ))
                })?)
            }
        };
        let mut given = Given::default();
        own_description(name, &mut given);
        let network =
            Onnx::open(Source::BuiltIn(content.into()), name, given, config.text(engine::PARAMETER))?;
        Ok(Self { name, network, assumed })
    }
}

impl Driver for Trained {
    fn reset(&mut self) -> Result<()> {
        self.network.reset()
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        let cx = self.moving(cx)?;
        self.network.drive(frame, &cx)
    }

    fn gradient(&mut self, frame: Frame<'_>, cx: &DriveContext, into: &mut [f32]) -> Result<f64> {
        let cx = self.moving(cx)?;
        self.network.gradient(frame, &cx, into)
    }

    fn info(&self) -> Vec<(String, String)> {
        self.network.info()
    }
}

impl Trained {
    /// The same with the speed that stands for one that is not known.
    fn moving(&self, cx: &DriveContext) -> Result<DriveContext> {
        let known = Some(cx.speed).filter(|speed| speed.is_finite()).or(self.assumed);
        let speed = known.ok_or_else(|| {
            Error::new(format!(
                "it takes the vehicle's speed, which the recording does not have; set one in m/s that stands for it, as in driver = {{ name \
                 = \"{}\", {SPEED} = 8 }} or --set driver.{SPEED}=8",
                self.name
            ))
        })?;
        Ok(DriveContext { speed, ..*cx })
    }
}

/// The source of the networks that are variants of DAVE-2.
pub const DAVE2: &str = "DAVE-2: Bojarski et al., End to End Learning for Self-Driving Cars, 2016";

/// How a network of this plugin was trained, for the fields that nothing else gives.
pub fn own_description(name: &str, given: &mut Given) {
    let outputs = match name {
        // Plans reach the wanted speed with a time constant of a second, so 0.58 of what is lacking after 0.75 to 1 s. With this gain the
        // throttle is 0.5 for each m/s that is lacking, as the other networks learned.
        "waypoint_planner" => vec![(
            "waypoints",
            json!({
                "output": "waypoints", "axes": "right_forward", "interval": 0.25, "aim": 0.8, "origin": 1.3, "wheelbase": 2.6, "full_lock": 25,
                "gain": 0.86
            }),
        )],
        _ => vec![
            ("steering", json!({"output": "control", "index": 0})),
            ("throttle", json!({"output": "control", "index": 1})),
        ],
    };
    let inputs = [
        ("resize", json!("linear")),
        ("color", json!("rgb")),
        ("scale", json!("0..255")),
        ("inputs", json!({"image": "image", "speed": "speed"})),
    ];
    for (field, value) in inputs.into_iter().chain(outputs) {
        if given.get(field).is_none() {
            given.set(field, value, "the recipe of the network");
        }
    }
}

/// Describes the driver of a network of this plugin, with the BLAKE3 of its file and the source of its structure.
pub fn describe(description: Description, blake3: &str, source: &str) -> Description {
    description
        .family("network")
        .network()
        .source(source)
        .parameter(engine::parameter())
        .parameter(
            Parameter::json(
                SPEED,
                Value::Null,
                "the speed that stands for one that is not known, as for recordings without speeds; there is none by default, and a frame \
                 without a speed is an error",
            )
            .unit("m/s"),
        )
        .blake3(blake3)
}

/// Defines the driver of a network; what is given is its name, which is also that of its file in `scripts/models`, BLAKE3 of that
/// file, what it does, and the source of its structure. The hash is written down, because every process that loads the plugin asks for it.
macro_rules! network {
    ($driver:ident: $name:literal, $hash:literal, $doc:literal, $source:expr) => {
        use pdk_sdk::prelude::*;

        #[doc = concat!($doc, ".")]
        pub struct $driver {
            network: super::trained::Trained,
        }

        impl $driver {
            /// Its name.
            pub const NAME: &str = $name;
            /// The content of its file.
            pub const CONTENT: &[u8] =
                include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/models/", $name, ".onnx"));
        }

        impl Component for $driver {
            fn description() -> Description {
                super::trained::describe(Description::driver($name, $doc), $hash, $source)
            }

            fn new(config: &Config) -> Result<Self> {
                Ok(Self { network: super::trained::Trained::open($name, Self::CONTENT, config)? })
            }
        }

        impl Driver for $driver {
            fn reset(&mut self) -> Result<()> {
                self.network.reset()
            }

            fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
                self.network.drive(frame, cx)
            }

            fn gradient(&mut self, frame: Frame<'_>, cx: &DriveContext, into: &mut [f32]) -> Result<f64> {
                self.network.gradient(frame, cx, into)
            }

            // The library's own hash changes with every build of it; that of the network says whether it is the same.
            fn info(&self) -> Vec<(String, String)> {
                let mut info = self.network.info();
                info.push(("network BLAKE3".to_owned(), $hash.to_owned()));
                info
            }
        }
    };
}
pub(super) use network;
