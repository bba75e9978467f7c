//! Networks as ONNX files: what they declare, and a run of those that can be run.

#![no_main]

use std::sync::Once;

use libfuzzer_sys::fuzz_target;
use pdk_fuzz as _;

static QUIET: Once = Once::new();

fuzz_target!(|data: &[u8]| {
    // The library that runs networks panics on some that contradict themselves, which is caught: so a panic is no finding by
    // itself, but one that comes through is.
    QUIET.call_once(|| std::panic::set_hook(Box::new(|_| {})));
    let _ = pdk_models::try_model(data);
});
