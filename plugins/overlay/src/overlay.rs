//! The user's own clips.

use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::cache;
use crate::clip::Clip;
use crate::common::{fit_of, motion_of, with_common, with_motion};
use crate::pictures::{Folder, PICTURES};
use crate::player::Player;
use crate::prepare::{self, Settings};
use crate::published;

/// The files that become perturbations of their own in an overlays folder.
const ENDINGS: [&str; 14] =
    ["mp4", "m4v", "mov", "mkv", "webm", "avi", "mpg", "gif", "apng", "png", "webp", "jpg", "jpeg", "bmp"];

/// Lays a clip over the frame.
pub struct Overlay {
    player: Player,
}

impl Component for Overlay {
    fn description() -> Description {
        let description =
            Description::perturbation("overlay", "Lays a green-screen clip of the user's over the frame")
                .version(6)
                .not_default()
                .source("Chroma keying by screen subtraction: Jack, Video Demystified");
        with_motion(with_common(description), ["cross-fade", "ping-pong", "repeat"])
            .parameter(Parameter::path(
                "clip",
                "video (its sound is not used), animated or still picture, or folder of pictures; before a screen of one colour, or with an alpha \
                 channel; or the name of a clip of pdk's own, such as built-in:birds",
            ))
            .parameter(Parameter::text(
                "key",
                "colour of the screen, such as #05c142; `auto` or nothing: found in the clip",
            ))
            .parameter(
                Parameter::number("seconds", 30.0, "how much of the clip is used at most")
                    .range(0.01, 3600.0)
                    .unit("s"),
            )
            .drop_in("overlays", &ENDINGS, "clip")
            .drop_in_folders(&PICTURES)
            .example(json!({"clip": "built-in:birds"}))
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let clip = Path::new(config.text("clip"));
        if !clip.is_dir() {
            return Ok(Vec::new());
        }
        // What is wrong with it shows when the overlay is made.
        let files = Folder::files(clip).unwrap_or_default();
        let names = files.iter().filter_map(|file| file.file_name()).map(PathBuf::from).collect();
        Ok(vec![InputFiles::new("pictures", clip, names)])
    }

    fn new(config: &Config) -> Result<Self> {
        let key = match config.text("key") {
            "" | "auto" => None,
            text => Some(colour(text)?),
        };
        let (clip, fit) = match config.text("clip").strip_prefix(published::PREFIX) {
            Some(name) => (published::clip(name)?, published::usual_fit(name, fit_of(config))),
            None => (Clip::Path(PathBuf::from(config.text("clip"))), fit_of(config)),
        };
        let settings = Settings { key, fit, seconds: config.number("seconds") };
        // What is wrong with a clip shows here, before the first frame.
        prepare::check(&clip, &settings, &cache::folder()?)?;
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
