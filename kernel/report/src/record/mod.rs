//! What a page about a run says, read from its record.

use std::fs::{self, File};
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use pdk_report::{Component, Drive, DriveTimes, EvaluateTimes, Run, Setup, Times};
use pdk_sdk::error::{Error, Place, Result};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::drive::stages::LoopTimes;
use crate::record::manifest::Manifest;
use crate::record::{PERFORMANCE, RESULTS, RunDirectory, SCENARIOS, SUMMARY};

mod closed_loop;
mod offline;
mod shots;

/// The name of the page in the folder of the record.
pub const REPORT: &str = "report.html";

/// The folder of clips in that of the record.
pub const CLIPS: &str = "clips";

/// Failures whose last frames are shown.
const SHOWN_FAILURES: usize = 6;

/// Reads all that the page in this file says about a run.
///
/// # Errors
/// Where the folder holds no record, the record is damaged, or nothing was recorded yet.
pub fn read(folder: &Path, page: &Path) -> Result<Run> {
    let directory = RunDirectory::open(folder)?;
    let recorded = directory.read()?;
    let outcomes: Vec<_> = recorded.outcomes.into_values().collect();
    let evaluations = offline::read(&directory)?;
    if outcomes.is_empty() && evaluations.is_empty() {
        return Err(Error::new(format!(
            "the record in {} holds no scenario and no result yet; wait for the first, or run the pipeline again",
            folder.display()
        )));
    }
    let unfinished = unfinished(&directory, outcomes.len(), evaluations.len())?;
    let mut drives = closed_loop::drives(&outcomes, folder, &clip_folder(folder, page)?);
    shots::add(&directory, &mut drives, SHOWN_FAILURES);
    let performance: Option<Performance> = json(&directory, PERFORMANCE)?;
    Ok(Run {
        title: title(&recorded.manifest),
        folder: folder.display().to_string(),
        started: performance.as_ref().map(|performance| performance.started_unix_seconds),
        unfinished,
        setup: setup(&recorded.manifest),
        drives,
        evaluations,
        times: performance.map(Performance::times).unwrap_or_default(),
    })
}

/// A JSON file of the record; none where it is not there.
fn json<T: DeserializeOwned>(directory: &RunDirectory, name: &str) -> Result<Option<T>> {
    let path = directory.path().join(name);
    match fs::read(&path) {
        Ok(text) => serde_json::from_slice(&text).map(Some).place(path.display()),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Error::from(error).at(path.display())),
    }
}

/// How the record shows that its run did not come to the end: the summary is written last, and knows all lines.
fn unfinished(directory: &RunDirectory, scenarios: usize, evaluations: usize) -> Result<Option<String>> {
    let what = "What is said here is about the part that was recorded.";
    for name in [SCENARIOS, RESULTS] {
        let path = directory.path().join(name);
        if cut_off(&path) {
            return Ok(Some(format!("The last line of {name} is cut off and left out. {what}")));
        }
    }
    let summary: Option<Value> = json(directory, SUMMARY)?;
    let Some(summary) = summary else {
        return Ok(Some(format!("It has no {SUMMARY}: it was ended early or is still going on. {what}")));
    };
    let known = |field: &str| summary[field].as_array().map_or(0, Vec::len);
    let same = known("outcomes") == scenarios && known("evaluations") == evaluations;
    Ok((!same).then(|| format!("Its {SUMMARY} does not know all that was recorded. {what}")))
}

/// Whether a file ends within a line.
fn cut_off(path: &Path) -> bool {
    let mut last = [b'\n'];
    let read = File::open(path).and_then(|mut file| {
        file.seek(SeekFrom::End(-1))?;
        file.read_exact(&mut last)
    });
    // One that is not there or is empty has no line.
    read.is_ok() && last != [b'\n']
}

fn title(manifest: &Manifest) -> String {
    manifest.pipeline.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn setup(manifest: &Manifest) -> Setup {
    let machine = &manifest.machine;
    let settings = manifest.settings.as_object();
    let settings =
        settings.map(|table| table.iter().map(|(key, value)| (key.clone(), text(value))).collect());
    Setup {
        version: manifest.pdk.clone(),
        seed: manifest.seed,
        pipeline: manifest.pipeline.path.display().to_string(),
        source: manifest.pipeline.source.clone(),
        command: command(manifest),
        settings: settings.unwrap_or_default(),
        components: manifest
            .components
            .iter()
            .map(|component| Component {
                kind: component.kind.to_string(),
                name: component.name.clone(),
                version: component.version,
                info: component.info.iter().map(|(k, v)| format!("{k} {v}")).collect::<Vec<_>>().join(", "),
                file: component.file.path.display().to_string(),
                hash: component.file.blake3.clone(),
            })
            .collect(),
        files: manifest
            .files
            .iter()
            .map(|file| (file.path.display().to_string(), file.blake3.clone()))
            .collect(),
        machine: format!("{} on {}, {} processors", machine.system, machine.architecture, machine.processors),
    }
}

/// A setting as the command line takes it.
fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// The command that repeats a run. The manifest does not tell defaults from what was set, so it names all settings.
fn command(manifest: &Manifest) -> String {
    let pipeline = quoted(&manifest.pipeline.path.to_string_lossy());
    let mut command = format!("pdk run {pipeline} --seed {}", manifest.seed);
    for (option, folders) in [("--plugins", &manifest.plugins), ("--overlays", &manifest.overlays)] {
        for folder in folders {
            command += &format!(" \\\n  {option} {}", quoted(&folder.to_string_lossy()));
        }
    }
    for (key, value) in manifest.settings.as_object().into_iter().flatten() {
        // An empty table may be meant as either; a list does for both.
        let value = text(value);
        command += &format!(" \\\n  --set {}", quoted(&format!("{key}={value}")));
    }
    command
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-/=:,@+".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// The command that replays a scenario.
fn replay(folder: &Path, index: u64) -> String {
    format!("pdk replay {} --scenario {index}", quoted(&folder.to_string_lossy()))
}

/// The folder of the clips on disk, and as the page sees it.
struct ClipFolder {
    path: PathBuf,
    address: String,
}

fn clip_folder(folder: &Path, page: &Path) -> Result<ClipFolder> {
    let path = folder.join(CLIPS);
    let place = page.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let address = match (fs::canonicalize(place), fs::canonicalize(folder)) {
        (Ok(from), Ok(to)) => relative(&from, &to.join(CLIPS)),
        (Err(error), _) => {
            return Err(Error::new(format!(
                "cannot write {} ({error}); name a place in a folder that is there",
                page.display()
            )));
        }
        (_, Err(error)) => return Err(Error::from(error).at(folder.display())),
    };
    Ok(ClipFolder { path, address })
}

/// The way from a folder to a place, both absolute, with slashes.
fn relative(from: &Path, to: &Path) -> String {
    let (from, to): (Vec<_>, Vec<_>) = (from.components().collect(), to.components().collect());
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = from[shared..].iter().map(|_| "..".to_owned());
    let down = to[shared..].iter().map(|part| part.as_os_str().to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<_>>().join("/")
}

/// The file with times.
#[derive(Deserialize)]
struct Performance {
    started_unix_seconds: u64,
    steps: Vec<Step>,
}

/// A step of the pipeline.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Step {
    Drive { threads: u64, frames_per_second: f64, real_time_factor: f64, stages: LoopTimes },
    Evaluate(EvaluateStep),
}

#[derive(Deserialize)]
struct EvaluateStep {
    threads: u64,
    perturbed_frames: u64,
    frames_per_second: f64,
    perturbation_milliseconds: f64,
    driver_milliseconds: f64,
}

impl Performance {
    fn times(self) -> Vec<Times> {
        let times = |step| match step {
            Step::Drive { threads, frames_per_second, real_time_factor, stages } => {
                Times::Drive(DriveTimes {
                    threads,
                    frames_per_second,
                    real_time_factor,
                    steps: stages.steps,
                    overruns: stages.overruns,
                    stages: [stages.simulator, stages.perturbation, stages.driver, stages.kernel]
                        .map(|stage| (stage.median_microseconds / 1e3, stage.p99_microseconds / 1e3)),
                })
            }
            Step::Evaluate(step) => Times::Evaluate(EvaluateTimes {
                threads: step.threads,
                frames: step.perturbed_frames,
                frames_per_second: step.frames_per_second,
                perturbation: step.perturbation_milliseconds,
                driver: step.driver_milliseconds,
            }),
        };
        self.steps.into_iter().map(times).collect()
    }
}

/// How many scenarios a page is about.
pub fn scenarios(run: &Run) -> usize {
    run.drives.iter().map(|drive: &Drive| drive.scenarios.len()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_come_through_a_shell() {
        assert_eq!(quoted("runs/quickstart-1"), "runs/quickstart-1");
        assert_eq!(quoted("my run"), "'my run'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
        assert_eq!(replay(Path::new("a b"), 3), "pdk replay 'a b' --scenario 3");
    }

    #[test]
    fn the_way_to_the_clips_goes_up_and_down() {
        let way = |from: &str, to: &str| relative(Path::new(from), Path::new(to));
        assert_eq!(way("/a/b", "/a/b/clips"), "clips");
        assert_eq!(way("/a/b/c", "/a/d/clips"), "../../d/clips");
    }
}
