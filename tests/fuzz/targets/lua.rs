//! Scripts: whole ones, and the bodies of `apply`, which are called with a small image.

#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use pdk_lua::perturbation::Source;
use pdk_sdk::config::Config;
use pdk_sdk::perturbation::{Context, Perturbation};
use pdk_sdk::prelude::FrameBuf;
use pdk_sdk::seed;
use serde_json::Map;

static SCRIPT: LazyLock<PathBuf> = LazyLock::new(|| {
    // SAFETY: the first input is tried before there is another thread that looks.
    unsafe {
        std::env::set_var("PDK_SCRIPT_SECONDS", "0.5");
        std::env::set_var("PDK_SCRIPT_MEGABYTES", "32");
    }
    pdk_fuzz::folder("lua").join("script.lua")
});

fuzz_target!(|data: &[u8]| {
    let Some((kind, text)) = data.split_first() else { return };
    let script = match kind % 2 {
        0 => text.to_vec(),
        _ => [b"return { doc = 'x', apply = function(image, cx)\n", text, b"\nend }"].concat(),
    };
    std::fs::write(&*SCRIPT, script).expect("the script is written");
    let source = Source::read(&SCRIPT).expect("the script is there");
    let Ok(description) = pdk_lua::description(&source) else { return };
    let Ok(config) = Config::check(&description, &Map::new()) else { return };
    let Ok(mut perturbation) = pdk_lua::open(&source, &config) else { return };
    let key = seed::key(7, "script", 0);
    let frame_in = FrameBuf::from_vec((0..12 * 8 * 3).map(|i| i as u8).collect(), 12, 8).expect("a frame");
    let mut target = FrameBuf::new(12, 8);
    for frame in 0..2 {
        let context = Context::new(2.0, frame, frame as f64 / 20.0, &key);
        if perturbation.apply(frame_in.as_ref(), target.as_mut(), &context).is_err() {
            return;
        }
    }
});
