//! What the record holds: scenarios, their traces and clips.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use pdk_model::outcome::Verdict;
use pdk_record::directory::{CLIPS, MANIFEST, PROGRESS, RunDirectory, SCENARIOS};
use pdk_record::ledger::{self, Line};
use pdk_record::trace::reader::{Entry, Owner, TraceReader};
use pdk_record::trace::step::ImageTopic;
use pdk_report::telemetry::samples;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::file;
use pdk_terminal::shell;
use serde_json::{Value, json};

use crate::live;

/// A run that has not noted its progress for this long is not under way.
const SILENT: Duration = Duration::from_secs(5);
/// Bytes of a clip that is shown.
const LARGEST_CLIP: u64 = 1 << 30;
/// Bytes of the note of the progress.
const LARGEST_NOTE: u64 = 4096;

/// The record that is watched.
pub struct Recorded {
    folder: PathBuf,
    /// What the run is called.
    pub title: String,
    /// The lines as they were read last, and the length and time of their file then.
    lines: Vec<Line>,
    read: Option<(u64, SystemTime)>,
}

impl Recorded {
    /// The record in a folder.
    ///
    /// # Errors
    /// If it holds none.
    pub fn open(folder: &Path) -> Result<Self> {
        let manifest = RunDirectory::open(folder)?.manifest()?;
        let manifest =
            manifest.ok_or_else(|| Error::new(format!("{} lost its {MANIFEST}", folder.display())))?;
        let title = manifest.pipeline.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { folder: folder.to_owned(), title, lines: Vec::new(), read: None })
    }

    /// The folder, as the user named it.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The lines, read again if there may be more.
    ///
    /// # Errors
    /// If the ledger is damaged.
    pub fn lines(&mut self) -> Result<&[Line]> {
        let Ok(metadata) = std::fs::metadata(self.folder.join(SCENARIOS)) else { return Ok(&[]) };
        let now = (metadata.len(), metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH));
        if self.read != Some(now) {
            self.lines = ledger::read(&RunDirectory::open(&self.folder)?)?.0;
            self.read = Some(now);
        }
        Ok(&self.lines)
    }

    /// How far the run is, as it notes it itself; none if it is not under way.
    pub fn progress(&self) -> Option<Value> {
        let path = self.folder.join(PROGRESS);
        let noted = std::fs::metadata(&path).and_then(|metadata| metadata.modified()).ok()?;
        if SystemTime::now().duration_since(noted).is_ok_and(|age| age > SILENT) {
            return None;
        }
        serde_json::from_slice(&file::read(&path, LARGEST_NOTE).ok()?).ok()
    }

    /// The scenarios, as JSON.
    ///
    /// # Errors
    /// If the ledger is damaged.
    pub fn rows(&mut self) -> Result<Value> {
        let folder = self.folder.clone();
        let row = |(number, line): (u64, &Line)| {
            let outcome = &line.outcome;
            let verdict = outcome.cause.verdict();
            let mark = match verdict {
                Verdict::Passed => "✓",
                Verdict::Unsafe => "✗",
                Verdict::Stopped => "■",
                Verdict::Late => "▷",
                Verdict::Void => "?",
            };
            json!({
                "number": number, "name": line.name, "failed": verdict.failed() || verdict == Verdict::Void,
                "outcome": format!("{mark} {}", outcome.cause.text()), "error": outcome.error, "time": outcome.time,
                "progress": outcome.progress, "mean": outcome.mean_cross_track_error,
                "max": outcome.max_cross_track_error, "clip": clip_path(&folder, number).is_file(),
                "replay": shell::replay(&folder, number),
            })
        };
        Ok((0..).zip(self.lines()?).map(row).collect())
    }

    /// A scenario: where and how it was driven, and which of its frames are recorded.
    ///
    /// # Errors
    /// If its trace cannot be read; none if there is no such scenario.
    pub fn scenario(&mut self, number: u64) -> Result<Option<Value>> {
        let Some(line) = self.line(number)? else { return Ok(None) };
        let (mut steps, mut road, mut images) = (Vec::new(), String::new(), Vec::new());
        for entry in self.trace(&line)? {
            match entry? {
                Entry::Step(step) => steps.push(step),
                Entry::Road(waypoints) => road = waypoints,
                Entry::Image(image) if image.topic == ImageTopic::Perturbed => {
                    images.push(json!([image.sequence, image.time()]));
                }
                Entry::Image(_) | Entry::Event(_) => {}
            }
        }
        let points = samples(&steps).into_iter().map(|step| live::numbers(&step.state, Some(step.control)));
        Ok(Some(json!({
            "name": line.name, "road": live::road(&road), "points": points.collect::<Vec<_>>(), "images": images,
        })))
    }

    /// A recorded frame of a scenario, as JPEG.
    ///
    /// # Errors
    /// If its trace cannot be read; none if there is no such frame.
    pub fn image(&mut self, number: u64, sequence: u64, perturbed: bool) -> Result<Option<Vec<u8>>> {
        let Some(line) = self.line(number)? else { return Ok(None) };
        let topic = if perturbed { ImageTopic::Perturbed } else { ImageTopic::Raw };
        for entry in self.trace(&line)? {
            match entry? {
                Entry::Image(image) if image.topic == topic && image.sequence == sequence => {
                    return Ok(Some(image.jpeg));
                }
                _ => {}
            }
        }
        Ok(None)
    }

    /// The clip of a scenario, which `pdk replay` may have made.
    ///
    /// # Errors
    /// If it cannot be read; none if there is none.
    pub fn clip(&self, number: u64) -> Result<Option<Vec<u8>>> {
        let path = clip_path(&self.folder, number);
        match path.is_file() {
            true => file::read(&path, LARGEST_CLIP).map(Some),
            false => Ok(None),
        }
    }

    /// The report, as it would be now.
    ///
    /// # Errors
    /// As for a report.
    pub fn report(&self) -> Result<String> {
        let page = self.folder.join(pdk_record::directory::REPORT);
        pdk_report::render(&pdk_report::record::read(&self.folder, &page)?.run)
    }

    fn line(&mut self, number: u64) -> Result<Option<Line>> {
        let lines = self.lines()?;
        Ok(usize::try_from(number).ok().and_then(|number| lines.get(number)).cloned())
    }

    fn trace(&self, line: &Line) -> Result<TraceReader> {
        TraceReader::of(&RunDirectory::open(&self.folder)?.trace_path(&line.id), Owner::of(line))
    }
}

fn clip_path(folder: &Path, number: u64) -> PathBuf {
    folder.join(CLIPS).join(format!("scenario-{number}.mp4"))
}
