//! The user's own clips.

use std::path::PathBuf;

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::cache;
use crate::clip::Clip;
use crate::player::{Loop, Motion, Player};
use crate::prepare::{self, Settings};
use crate::published;
use crate::scale::Fit;

/// How visible a clip is at each level, as published.
pub const OPACITIES: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];

/// The files that become perturbations of their own in an overlays folder.
const ENDINGS: [&str; 14] =
    ["mp4", "m4v", "mov", "mkv", "webm", "avi", "mpg", "gif", "apng", "png", "webp", "jpg", "jpeg", "bmp"];

/// What every overlay says of itself.
pub fn with_common(description: Description) -> Description {
    description
        .family("overlay")
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
            "The clip runs in simulation time, whatever the rate of the frames; the published code goes on by one picture a \
             frame.",
        )
        .parameter(fit())
        .parameter(Parameter::choice(
            "loop",
            &ends,
            "cross-fade: the last half second fades into the first; ping-pong: the clip runs back to its beginning; repeat: \
             it starts again",
        ))
        .parameter(
            Parameter::number("rate", 0.0, "frames of the clip per second of simulation time; 0: the clip's own")
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

/// Lays a clip over the frame.
pub struct Overlay {
    player: Player,
}

impl Component for Overlay {
    fn description() -> Description {
        let description =
            Description::perturbation("overlay", "Lays a green-screen clip of the user's over the frame")
                .not_default()
                .source("Chroma keying by screen subtraction: Jack, Video Demystified");
        with_motion(with_common(description), ["cross-fade", "ping-pong", "repeat"])
            .parameter(Parameter::path(
                "clip",
                "video, animated or still picture, or folder of pictures; before a screen of one colour, or with an alpha \
                 channel; or the name of a clip of pdk's own, such as built-in:birds",
            ))
            .parameter(Parameter::text(
                "key",
                "colour of the screen, such as #05c142; `auto` or nothing: found in the clip",
            ))
            .parameter(
                Parameter::number("seconds", 30.0, "what the clip has beyond this length is not used")
                    .range(0.01, 3600.0)
                    .unit("s"),
            )
            .drop_in("overlays", &ENDINGS, "clip")
            .example(json!({"clip": "built-in:birds"}))
    }

    fn new(config: &Config) -> Result<Self> {
        let key = match config.text("key") {
            "" | "auto" => None,
            text => Some(colour(text)?),
        };
        let settings = Settings { key, fit: fit_of(config), seconds: config.number("seconds") };
        let clip = match config.text("clip").strip_prefix(published::PREFIX) {
            Some(name) => published::clip(name)?,
            None => Clip::Path(PathBuf::from(config.text("clip"))),
        };
        // What is wrong with a clip shows here, before the first frame.
        prepare::check(&clip, &settings, &cache::folder())?;
        Ok(Self { player: Player::new(clip, settings, motion_of(config))? })
    }
}

impl Perturbation for Overlay {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.player.apply(src, dst, cx)
    }
}

/// A colour as `#rrggbb`.
fn colour(text: &str) -> Result<[u8; 3]> {
    let digits = text.strip_prefix('#').unwrap_or(text);
    let value =
        u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6 && !digits.starts_with('+'));
    match value.map(u32::to_be_bytes) {
        Some([_, r, g, b]) => Ok([r, g, b]),
        None => Err(Error::new(format!(
            "parameter `key` is \"{text}\", but has to be a colour such as #05c142, or auto"
        ))),
    }
}
