//! A camera that the adapter itself fixes to the vehicle, for simulators that have cameras wherever one is wanted.

use pdk_sdk::camera::Mounting;
use pdk_sdk::prelude::{Camera, Config, Description, Parameter};

/// Where a camera is fixed to the vehicle, and what it delivers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mount {
    /// Size and rate of its frames.
    pub camera: Camera,
    /// The angle that a frame's width covers, in degrees.
    pub field_of_view: f64,
    /// How far it is ahead of the vehicle's centre, in metres.
    pub ahead: f64,
    /// How high it is above the ground, in metres.
    pub height: f64,
    /// By how much it looks down, in degrees.
    pub pitch: f64,
}

impl Mount {
    /// Adds the parameters to the description of an adapter: a camera so far ahead of the vehicle's centre and so high above the ground
    /// in metres, where the user does not say.
    pub fn describe(description: Description, ahead: f64, height: f64) -> Description {
        description
            .camera([320, 160], 1.0..=4096.0)
            .parameter(
                Parameter::number(
                    "camera_ahead",
                    ahead,
                    "how far the camera is ahead of the vehicle's centre",
                )
                .range(-10.0, 10.0)
                .unit("m"),
            )
            .mounting(Mounting { field_of_view: 90.0, height, pitch: 5.0 }, 0.3..=10.0, -30.0..=90.0)
    }

    /// Reads the parameters.
    pub fn read(config: &Config) -> Self {
        let Mounting { field_of_view, height, pitch } = config.mounting();
        Self { camera: config.camera(), field_of_view, ahead: config.number("camera_ahead"), height, pitch }
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::*;

    #[test]
    fn what_is_described_is_read() {
        let description = Mount::describe(Description::simulator("x", "X"), 0.5, 1.5);
        let given = json!({"width": 64, "camera_height": 2, "camera_pitch": -3});
        let mount = Mount::read(&Config::check(&description, given.as_object().unwrap()).unwrap());
        let camera = Camera { width: 64, height: 160, rate: 20.0 };
        assert_eq!(mount, Mount { camera, field_of_view: 90.0, ahead: 0.5, height: 2.0, pitch: -3.0 });
    }
}
