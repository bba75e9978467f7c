//! Networks as ONNX files: what they declare, and a run of those that can be run.

#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;

static MODEL: LazyLock<PathBuf> = LazyLock::new(|| pdk_fuzz::folder("onnx").join("model.onnx"));

fuzz_target!(|data: &[u8]| {
    std::fs::write(&*MODEL, data).expect("a file");
    let _ = pdk_models::try_model(&MODEL);
});
