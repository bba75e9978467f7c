//! Descriptions that have a name, for networks that many people have.
//!
//! Each is text like a file's, so that one that nearly fits can be copied and changed.

/// The names.
pub const NAMES: [&str; 7] = [
    "dave2",
    "udacity",
    "donkeycar_linear",
    "donkeycar_categorical",
    "donkeycar_memory",
    "donkeycar_rnn",
    "donkeycar_3d",
];

/// Bojarski et al., "End to End Learning for Self-Driving Cars" (2016): 66x200 pixels in YUV, which a layer of the network brings to
/// -1 to 1. The paper's network gives the inverse of the turning radius, so that `steering` needs a scale of the vehicle.
const DAVE2: &str = r#"
image_size = [200, 66]
color = "yuv"
scale = "-1..1"
"#;

/// The networks of Udacity's "Behavioral Cloning", as its best-known solutions have them: the sky and the bonnet are cut off frames
/// of 320x160.
const UDACITY: &str = r#"
frame = [320, 160]
crop = { top = 60, bottom = 25 }
image_size = [200, 66]
resize = "area"
color = "yuv"
scale = "-1..1"
"#;

/// donkeycar 5.3, `parts/keras.py`: bytes divided by 255, red first, of the size that the camera has.
const LINEAR: &str = r#"
scale = "0..1"
color = "rgb"
steering = "n_outputs0"
throttle = "n_outputs1"
"#;

/// As `KerasCategorical`, whose outputs `linear_unbin` reads: value = bin * R / (count + offset) + offset. The throttle's range R is
/// MODEL_CATEGORICAL_MAX_THROTTLE_RANGE of donkeycar's configuration, 0.8; its 20 bins are 0.04 apart and end at 0.76.
const CATEGORICAL: &str = r#"
scale = "0..1"
color = "rgb"
steering = { output = "angle_out", bins = { from = -1.0, to = 1.0, count = 15 } }
throttle = { output = "throttle_out", bins = { from = 0.0, to = 0.76, count = 20 } }
"#;

/// As `KerasMemory`: the controls of the frames before go in, the oldest first.
const MEMORY: &str = r#"
scale = "0..1"
color = "rgb"
inputs = { img_in = "image", mem_in = "controls" }
steering = "n_outputs0"
throttle = "n_outputs1"
"#;

/// As `KerasLSTM`: the last frames in an axis of their own, filled with the first.
const RNN: &str = r#"
scale = "0..1"
color = "rgb"
layout = "nthwc"
frames = 3
steering = { output = "model_outputs", index = 0 }
throttle = { output = "model_outputs", index = 1 }
"#;

/// As `Keras3D_CNN`.
const THREE_D: &str = r#"
scale = "0..1"
color = "rgb"
layout = "nthwc"
frames = 20
steering = { output = "outputs", index = 0 }
throttle = { output = "outputs", index = 1 }
"#;

/// The text of a preset; none if there is none of this name.
pub fn text(name: &str) -> Option<&'static str> {
    let texts = [DAVE2, UDACITY, LINEAR, CATEGORICAL, MEMORY, RNN, THREE_D];
    NAMES.iter().zip(texts).find(|(known, _)| **known == name).map(|(_, text)| text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Described, Given};

    #[test]
    fn every_preset_is_a_description() {
        for name in NAMES {
            let mut given = Given::default();
            given.set("preset", name.into(), "a test");
            Described::new(given).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
        assert_eq!(text("none"), None);
    }
}
