//! The last recorded frames of the failures that a page shows.

use std::collections::VecDeque;
use std::path::Path;

use pdk_report::{Drive, Shot, worst_failures};
use pdk_sdk::error::Result;

use crate::drive::recent::{BEFORE, before_the_last};
use crate::record::RunDirectory;
use crate::record::trace::ImageTopic;
use crate::record::trace_reader::{Entry, TraceReader};

/// Pictures of so many bytes make a page that is still handy: in a page a third more.
const BUDGET: usize = 6 << 20;

/// Adds frames to the worst failures of each drive. A trace that cannot be read is warned of: the rest of the page does not
/// need it.
pub fn add(directory: &RunDirectory, drives: &mut [Drive], most: usize) {
    let mut budget = BUDGET;
    let each = (most / drives.len().max(1)).max(1);
    for drive in drives {
        for position in worst_failures(drive, each) {
            let scenario = &mut drive.scenarios[position];
            match last_frames(&directory.trace_path(scenario.index)) {
                Ok(mut shots) => {
                    // The last one tells most.
                    while bytes(&shots) > budget {
                        shots.remove(0);
                    }
                    budget -= bytes(&shots);
                    scenario.shots = shots;
                }
                Err(error) => {
                    eprintln!(
                        "pdk: warning: scenario {} is shown without its frames: {error}",
                        scenario.index
                    );
                }
            }
        }
    }
}

fn bytes(shots: &[Shot]) -> usize {
    shots.iter().map(|shot| shot.raw.len() + shot.perturbed.len()).sum()
}

/// The last recorded frame and, as far as there are, those some time before.
fn last_frames(trace: &Path) -> Result<Vec<Shot>> {
    let mut recent: VecDeque<(u64, Shot)> = VecDeque::new();
    for entry in TraceReader::open(trace)? {
        let Entry::Image(image) = entry? else { continue };
        if recent.back().is_none_or(|(sequence, _)| *sequence != image.sequence) {
            recent.push_back((image.sequence, Shot { time: image.time(), ..Shot::default() }));
            let oldest = image.time() - BEFORE[0];
            while recent.get(1).is_some_and(|(_, shot)| shot.time <= oldest) {
                recent.pop_front();
            }
        }
        if let Some((_, shot)) = recent.back_mut() {
            match image.topic {
                ImageTopic::Raw => shot.raw = image.jpeg,
                ImageTopic::Perturbed => shot.perturbed = image.jpeg,
            }
        }
    }
    let recent: Vec<Shot> = recent.into_iter().map(|(_, shot)| shot).collect();
    let times: Vec<f64> = recent.iter().map(|shot| shot.time).collect();
    Ok(before_the_last(&times).into_iter().map(|position| recent[position].clone()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::trace::Trace;
    use pdk_report::{Scenario, Verdict};
    use pdk_sdk::prelude::FrameBuf;

    /// A trace with an image every tenth of a second, up to this time.
    fn trace(path: &Path, seconds: u64) {
        let mut trace = Trace::create(path).unwrap();
        let frame = FrameBuf::new(16, 8);
        for sequence in 0..=seconds * 10 {
            for topic in [ImageTopic::Raw, ImageTopic::Perturbed] {
                trace.image(topic, sequence, sequence as f64 / 10.0, frame.as_ref()).unwrap();
            }
        }
        trace.finish().unwrap();
    }

    #[test]
    fn the_last_frame_and_those_before_it_are_shown() {
        let folder = std::env::temp_dir().join(format!("pdk-shots-{}", std::process::id()));
        let directory = RunDirectory::create(&folder).unwrap();
        let failed = |index: u64| Scenario { index, verdict: Verdict::Failed, ..Scenario::default() };
        let mut drives = vec![Drive { scenarios: (0..4).map(failed).collect(), ..Drive::default() }];
        for (index, seconds) in [5, 1, 0].into_iter().enumerate() {
            trace(&directory.trace(index as u64).unwrap(), seconds);
        }
        add(&directory, &mut drives, 4);
        let times = |scenario: usize| {
            let shots = &drives[0].scenarios[scenario].shots;
            assert!(shots.iter().all(|shot| !shot.raw.is_empty() && !shot.perturbed.is_empty()));
            shots.iter().map(|shot| shot.time).collect::<Vec<_>>()
        };
        assert_eq!(times(0), [3.0, 4.0, 5.0]);
        assert_eq!(times(1), [0.0, 1.0]);
        assert_eq!(times(2), [0.0]);
        assert!(times(3).is_empty(), "it has no trace");
        std::fs::remove_dir_all(folder).unwrap();
    }
}
