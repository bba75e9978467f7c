//! The record of a run: manifest, lines of scenarios, lines of results, summary, times; and the page about it. A line of a
//! scenario gets the checksum that fits it, or nearly all would be refused for that.

#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use pdk_record::directory::{MANIFEST, PERFORMANCE, RESULTS, RunDirectory, SCENARIOS, SUMMARY};
use pdk_record::ledger;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| pdk_fuzz::folder("record"));

fuzz_target!(|data: &[u8]| {
    let mut parts = pdk_fuzz::parts(data);
    let mut lines = Vec::new();
    for line in parts.next().unwrap_or_default().split_inclusive(|byte| *byte == b'\n') {
        match line.strip_suffix(b"}\n") {
            Some(body) => {
                let sum = blake3::hash(body).to_hex();
                lines.extend_from_slice(body);
                lines.extend_from_slice(format!(",\"checksum\":\"{}\"}}\n", &sum[..16]).as_bytes());
            }
            None => lines.extend_from_slice(line),
        }
    }
    let write = |name: &str, text: &[u8]| std::fs::write(FOLDER.join(name), text).expect("a file");
    write(SCENARIOS, &lines);
    write(RESULTS, parts.next().unwrap_or_default());
    write(SUMMARY, parts.next().unwrap_or_default());
    write(PERFORMANCE, parts.next().unwrap_or_default());
    let manifest = parts.next().filter(|part| !part.is_empty());
    write(MANIFEST, manifest.unwrap_or(include_bytes!("../corpus/manifest.json")));
    let Ok(directory) = RunDirectory::open(&FOLDER) else { return };
    let _ = ledger::read(&directory);
    let _ = directory.manifest();
    if let Ok(read) = pdk_report::record::read(&FOLDER, &FOLDER.join("report.html")) {
        let _ = pdk_report::render(&read.run);
    }
});
