//! Lines of the conversation between a session and its workers, in both directions.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pdk_fuzz as _;
use pdk_loop::protocol::{FromWorker, ToWorker, Work};
use serde::Serialize;
use serde::de::DeserializeOwned;

fuzz_target!(|data: &[u8]| {
    for line in data.split(|byte| *byte == b'\n') {
        if let Some(ToWorker::Job(job)) = same_after_writing::<ToWorker>(line)
            && let Work::Drive(drive) = &job.work
        {
            let _ = drive.scenario.id();
            for applied in &drive.scenario.perturbations {
                let _ = applied.level.check(&applied.name);
            }
        }
        same_after_writing::<FromWorker>(line);
    }
});

/// A message that can be read can be written, and read again.
fn same_after_writing<T: Serialize + DeserializeOwned>(line: &[u8]) -> Option<T> {
    let message: T = serde_json::from_slice(line).ok()?;
    let written = serde_json::to_string(&message).expect("a message can be written");
    let again: T = serde_json::from_str(&written).expect("what was written can be read");
    assert_eq!(serde_json::to_string(&again).expect("a message can be written"), written);
    Some(message)
}
