//! What jobs came to whose frames are not in the file of results yet, so that a run that is killed loses only the jobs that were under
//! way. Results stand in the order of their frames, each with all perturbations, and jobs are done perturbation by perturbation.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use pdk_loop::protocol::{EvaluateFrames, EvaluatedFrame};
use pdk_record::lines::{Lines, complete};
use pdk_sdk::error::{Place, Result};
use serde::{Deserialize, Serialize};

/// A line of the file.
#[derive(Serialize, Deserialize)]
struct Line {
    job: String,
    frames: Vec<EvaluatedFrame>,
}

/// The file, and the lines of an earlier process in it.
pub struct Journal {
    path: PathBuf,
    /// Open from the first line on.
    lines: Option<Lines>,
    /// What jobs came to that have not been asked for yet.
    known: BTreeMap<String, Vec<EvaluatedFrame>>,
    /// The number of the evaluation under way.
    evaluation: u64,
    /// Frames that were taken for the evaluation under way, and those among them that are perturbed.
    taken: (u64, u64),
}

impl Journal {
    /// Reads the file, if there is one. What cannot be read is forgotten, with all behind it.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub fn open(path: &Path) -> Result<Self> {
        let mut journal =
            Self { path: path.to_owned(), lines: None, known: BTreeMap::new(), evaluation: 0, taken: (0, 0) };
        if !path.is_file() {
            return Ok(journal);
        }
        let (mut lines, text) = Lines::open(path)?;
        let mut whole = 0;
        for line in text[..complete(&text)].split_inclusive(|byte| *byte == b'\n') {
            let Ok(Line { job, frames }) = serde_json::from_slice(line) else { break };
            journal.known.insert(job, frames);
            whole += line.len() as u64;
        }
        lines.truncate(whole)?;
        journal.lines = Some(lines);
        Ok(journal)
    }

    /// Begins the evaluation of this number: nothing was taken yet.
    pub fn begin(&mut self, evaluation: u64) {
        (self.evaluation, self.taken) = (evaluation, (0, 0));
    }

    /// The frames of a job of the evaluation of this number, if they are known.
    pub fn take(&mut self, evaluation: u64, job: &EvaluateFrames) -> Option<Vec<EvaluatedFrame>> {
        if self.known.is_empty() {
            return None;
        }
        let frames = self.known.remove(&key(evaluation, job))?;
        let count = frames.len() as u64;
        self.taken.0 += count;
        if job.perturbation.is_some() {
            self.taken.1 += count;
        }
        Some(frames)
    }

    /// How many frames were taken for this evaluation, and how many of them are perturbed.
    pub fn taken(&self) -> (u64, u64) {
        self.taken
    }

    /// Notes what a job came to. It is not written through to the disk: after a power cut it is driven again.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, evaluation: u64, job: &EvaluateFrames, frames: &[EvaluatedFrame]) -> Result<()> {
        let line = Line { job: key(evaluation, job), frames: frames.to_vec() };
        let mut text = serde_json::to_vec(&line)?;
        text.push(b'\n');
        let lines = match &mut self.lines {
            Some(lines) => lines,
            none => none.insert(Lines::open(&self.path)?.0),
        };
        lines.add(&text)
    }

    /// Up to where it is written, in bytes.
    pub fn length(&self) -> u64 {
        self.lines.as_ref().map_or(0, Lines::length)
    }

    /// Forgets what lies behind this length, because it is in the file of results now.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn forget(&mut self, length: u64) -> Result<()> {
        self.lines
            .as_mut()
            .filter(|lines| lines.length() > length)
            .map_or(Ok(()), |lines| lines.truncate(length))
    }

    /// Ends the evaluation. Removes the file, unless it has jobs of a later one. What it still has of this one or those before is in the
    /// file of results: the process was killed before it could forget it.
    ///
    /// # Errors
    /// If it cannot be removed.
    pub fn close(&mut self) -> Result<()> {
        let of = |key: &str| key.split('/').next().and_then(|number| number.parse::<u64>().ok());
        let ended = self.evaluation;
        self.known.retain(|key, _| of(key) > Some(ended));
        match self.known.is_empty() && self.lines.take().is_some() {
            true => fs::remove_file(&self.path).place(format_args!("cannot remove {}", self.path.display())),
            false => Ok(()),
        }
    }
}

/// What tells a job from the others of a run. The rest, such as the driver, is the same in all runs that continue one record: the manifest
/// says what each evaluation is of.
fn key(evaluation: u64, job: &EvaluateFrames) -> String {
    let EvaluateFrames { perturbation, from, start, end, .. } = job;
    let perturbation = serde_json::to_string(perturbation).unwrap_or_default();
    format!("{evaluation}/{from}/{start}/{end}/{perturbation}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_loop::protocol::Subject;
    use pdk_model::component::ComponentSpec;
    use pdk_model::perturbation::AppliedPerturbation;
    use pdk_sdk::prelude::Control;

    fn job(perturbation: Option<&str>, start: usize) -> EvaluateFrames {
        EvaluateFrames {
            dataset: ComponentSpec::new("d"),
            subject: Subject::Driver(ComponentSpec::new("x")),
            perturbation: perturbation.map(|text| AppliedPerturbation::parse(text).unwrap()),
            seed: 0,
            sequence: 0,
            earliest: None,
            from: start,
            start,
            end: start + 2,
        }
    }

    #[test]
    fn jobs_are_known_to_the_next_process_until_they_are_in_the_results() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.journal");
        let good = |steering| EvaluatedFrame::Good {
            frame: "a".into(),
            truth: Control { steering: f64::NAN, throttle: 0.1 },
            control: Control { steering, throttle: 1.0 / 3.0 },
        };
        let bad = EvaluatedFrame::Bad { frame: "b".into(), error: "cut".into(), by_driver: true };
        let mut journal = Journal::open(&path).unwrap();
        assert!(!path.exists() && journal.take(0, &job(None, 0)).is_none());
        journal.add(0, &job(None, 0), &[good(0.1 + 0.2), bad.clone()]).unwrap();
        let original = journal.length();
        journal.add(0, &job(Some("fog@1"), 0), &[good(0.5), good(0.25)]).unwrap();
        drop(journal);
        // A line that was cut off, and one that is something else, are forgotten.
        let mut text = fs::read(&path).unwrap();
        let whole = text.len();
        text.extend_from_slice(b"{\"job\"}\n{");
        fs::write(&path, &text).unwrap();
        let mut journal = Journal::open(&path).unwrap();
        assert_eq!(journal.length(), whole as u64);
        assert!(journal.take(1, &job(None, 0)).is_none() && journal.take(0, &job(None, 2)).is_none());
        let frames = journal.take(0, &job(None, 0)).unwrap();
        let EvaluatedFrame::Good { truth, control, .. } = &frames[0] else { panic!("it is good") };
        assert!(truth.steering.is_nan() && control.steering == 0.1 + 0.2);
        assert!(matches!(&frames[1], EvaluatedFrame::Bad { error, by_driver: true, .. } if error == "cut"));
        assert_eq!(journal.take(0, &job(Some("fog@1"), 0)).unwrap().len(), 2);
        assert_eq!(journal.taken(), (4, 2));
        journal.forget(original).unwrap();
        journal.add(2, &job(None, 0), &[bad]).unwrap();
        drop(journal);
        // The first evaluation was killed with a job in the file of results and here. A later one keeps its own.
        let mut journal = Journal::open(&path).unwrap();
        journal.begin(0);
        journal.close().unwrap();
        assert!(path.exists(), "a job of a later evaluation is in it");
        journal.begin(2);
        assert_eq!(journal.take(2, &job(None, 0)).unwrap().len(), 1);
        journal.close().unwrap();
        assert!(!path.exists());
    }
}
