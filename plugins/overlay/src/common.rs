//! What all overlays have in common: their descriptions and parameters.

use pdk_sdk::prelude::*;

use crate::player::{Loop, Motion};
use crate::scale::Fit;

/// How visible a clip is at each level, as published.
pub const OPACITIES: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];

/// What every overlay says of itself.
pub fn with_common(description: Description) -> Description {
    description
        .family("overlay")
        .keeps_geometry()
        .follows_attention("where the clip's middle lies: in the middle of what the map marks, which is the mean of all places by their squared values")
        .mathematics("(1 - opacity a) v + opacity c, a the clip's alpha once the screen is out, c its colour times a")
        .divergence("Opacity goes from 0.2 to 1, as the paper has it; the published code has 0.15 to 0.85.")
        .divergence(
            "The screen goes out with soft edges, and what it casts on things goes too; the published code takes out a box of \
             colours, which leaves jagged edges and a green fringe.",
        )
        .divergence("The clip keeps its shape; the published code stretches it, as `fit=stretch` does.")
        .parameter(
            Parameter::by_level(
                "opacity",
                OPACITIES,
                "how visible the clip is, in steps of 1/256; 1 as in the clip",
            )
            .range(0.0, 1.0),
        )
}

/// What every overlay that moves says of itself; `ends` are the ways of going on at the end of the clip, first the usual one.
pub fn with_motion(description: Description, ends: [&str; 3]) -> Description {
    description
        .dynamic()
        .drawn_per_sequence("where in the clip it starts")
        .divergence(
            "The clip runs in simulation time, whatever the rate of the frames, and between two of its pictures both are mixed, or the nearest is \
             shown if it has 50 a second or more; the published code goes on by one picture a frame.",
        )
        .parameter(fit())
        .parameter(Parameter::choice(
            "loop",
            &ends,
            "cross-fade: the last half second fades into the first; ping-pong: the clip runs back to its beginning; repeat: \
             it starts again",
        ))
        .parameter(
            Parameter::number("rate", 0.0, "frames of the clip per second of simulation time; 0: the clip's own, or, if the clip follows the vehicle's speed, what that makes of it")
                .range(0.0, 1000.0)
                .unit("Hz"),
        )
}

/// The parameter that says how a clip is fitted to the frame.
pub fn fit() -> Parameter {
    Parameter::choice(
        "fit",
        &["cover", "stretch"],
        "cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape of \
         the frame, as published",
    )
}

/// How a clip is fitted to the frame.
pub fn fit_of(config: &Config) -> Fit {
    if config.text("fit") == "stretch" { Fit::Stretch } else { Fit::Cover }
}

/// How a clip runs.
pub fn motion_of(config: &Config) -> Motion {
    Motion::Runs {
        end: match config.text("loop") {
            "ping-pong" => Loop::PingPong,
            "repeat" => Loop::Repeat,
            _ => Loop::CrossFade,
        },
        rate: Some(config.number("rate")).filter(|&rate| rate > 0.0),
    }
}
