//! The parameters of a simulator's camera, described once for all simulators.

use std::ops::RangeInclusive;

use pdk_model::camera::Camera;

use crate::config::Config;
use crate::describe::{Description, Parameter};

impl Description {
    /// Adds the parameters of a camera whose frames have this size in pixels if the user does not say, and sides in this range.
    pub fn camera(self, [width, height]: [u32; 2], sides: RangeInclusive<f64>) -> Self {
        let side = |name, default: u32, doc| {
            Parameter::integer(name, default.into(), doc).range(*sides.start(), *sides.end()).unit("px")
        };
        self.parameter(side("width", width, "width of the camera's frames"))
            .parameter(side("height", height, "height of the camera's frames"))
            .parameter(
                Parameter::number("rate", 20.0, "frames per second of simulation time")
                    .range(1.0, 1000.0)
                    .unit("Hz"),
            )
    }

    /// Adds the parameters of where a camera is mounted, with what they are if the user does not say, and their ranges.
    pub fn mounting(
        self,
        default: Mounting,
        height: RangeInclusive<f64>,
        pitch: RangeInclusive<f64>,
    ) -> Self {
        self.parameter(
            Parameter::number("field_of_view", default.field_of_view, "angle that the frame's width covers")
                .range(20.0, 130.0)
                .unit("degrees"),
        )
        .parameter(
            Parameter::number("camera_height", default.height, "height of the camera above the road")
                .range(*height.start(), *height.end())
                .unit("m"),
        )
        .parameter(
            Parameter::number("camera_pitch", default.pitch, "angle by which the camera looks down")
                .range(*pitch.start(), *pitch.end())
                .unit("degrees"),
        )
    }
}

impl Config {
    /// The camera that the parameters of [`Description::camera`] say.
    pub fn camera(&self) -> Camera {
        let side = |name| u32::try_from(self.integer(name)).unwrap_or(u32::MAX);
        Camera { width: side("width"), height: side("height"), rate: self.number("rate") }
    }

    /// What the parameters of [`Description::mounting`] say.
    pub fn mounting(&self) -> Mounting {
        Mounting {
            field_of_view: self.number("field_of_view"),
            height: self.number("camera_height"),
            pitch: self.number("camera_pitch"),
        }
    }
}

/// Where a camera is mounted, and what it covers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mounting {
    /// The angle that a frame's width covers, in degrees.
    pub field_of_view: f64,
    /// How high it is above the ground, in metres.
    pub height: f64,
    /// By how much it looks down, in degrees.
    pub pitch: f64,
}

impl Mounting {
    /// Behind the windscreen of a car, as in the embedded simulator: what is assumed where nothing else is known.
    pub const WINDSCREEN: Self = Self { field_of_view: 75.0, height: 1.35, pitch: 8.0 };
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Map, json};

    #[test]
    fn what_is_described_is_read() {
        let default = Mounting { field_of_view: 90.0, height: 1.5, pitch: 5.0 };
        let description = Description::simulator("x", "X").camera([320, 160], 1.0..=4096.0).mounting(
            default,
            0.3..=4.0,
            -10.0..=25.0,
        );
        let config = Config::check(&description, &Map::new()).unwrap();
        assert_eq!(config.camera(), Camera { width: 320, height: 160, rate: 20.0 });
        assert_eq!(config.mounting(), default);
        let given = json!({"width": 0});
        assert!(Config::check(&description, given.as_object().unwrap()).is_err());
    }
}
