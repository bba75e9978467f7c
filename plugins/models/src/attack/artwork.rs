//! The pictures that `pdk attack` makes: in a file, or part of this plugin.

use std::path::Path;

use pdk_sdk::prelude::*;

/// The pictures that are part of this plugin, by their names. `docs/guide/perturb.md` has the commands that made them.
const BUILT_IN: [(&str, &[u8]); 2] = [
    (
        "dave2_patch",
        include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/attacks/dave2_patch.png")),
    ),
    (
        "dave2_universal",
        include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/attacks/dave2_universal.png")),
    ),
];

/// The parameter that names a picture.
pub fn parameter(doc: &str) -> Parameter {
    Parameter::path("picture", doc)
}

/// Reads a picture by the name of its file, or by that of one that is part of this plugin.
///
/// # Errors
/// If it cannot be read.
pub fn read(config: &Config) -> Result<FrameBuf> {
    let name = config.text("picture");
    let read = match BUILT_IN.iter().find(|(known, _)| *known == name) {
        Some((_, content)) => decode(content),
        None => pdk_image::read(Path::new(name)),
    };
    read.map_err(|error| error.at(format_args!("picture `{name}`")))
}

fn decode(content: &[u8]) -> Result<FrameBuf> {
    let picture = pdk_image::decode(content)?.into_rgb8();
    let [width, height] = [picture.width(), picture.height()].map(|side| side as usize);
    FrameBuf::from_vec(picture.into_raw(), width, height).map_err(Error::new)
}
