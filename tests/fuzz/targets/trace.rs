//! Traces.

#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use pdk_record::trace::reader::{Entry, TraceReader};

static TRACE: LazyLock<PathBuf> = LazyLock::new(|| pdk_fuzz::folder("trace").join("trace.mcap"));

fuzz_target!(|data: &[u8]| {
    std::fs::write(&*TRACE, data).expect("a file");
    let Ok(reader) = TraceReader::open(&TRACE) else { return };
    for entry in reader.take(1000) {
        match entry {
            Ok(Entry::Image(image)) => _ = image.decode(),
            Ok(_) => {}
            Err(error) => assert!(error.to_string().contains("trace"), "{error}"),
        }
    }
});
