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

use crate::drive;
use crate::query::{Has, known};

/// A run that has not noted its progress for this long is not under way.
const SILENT: Duration = Duration::from_secs(5);
/// Bytes of a clip that is shown.
const LARGEST_CLIP: u64 = 1 << 30;
/// What stands before and behind the number in the name of a clip.
const CLIP: (&str, &str) = ("scenario-", ".mp4");
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
    /// Another one as soon as rows that a browser has are not the first of these any more.
    generation: u64,
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
        Ok(Self { folder: folder.to_owned(), title, lines: Vec::new(), read: None, generation: 0 })
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
            let lines = ledger::read(&RunDirectory::open(&self.folder)?)?.0;
            // At the end of a run its lines are put in order, and one that is driven again has another outcome.
            self.generation += u64::from(!lines.starts_with(&self.lines));
            self.lines = lines;
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

    /// The scenarios that a browser lacks, as JSON, with what it takes to say next time which ones it has.
    ///
    /// # Errors
    /// If the ledger is damaged.
    pub fn rows(&mut self, has: Option<Has>) -> Result<Value> {
        let folder = self.folder.clone();
        let length = self.lines()?.len();
        let from = known(has, self.generation, length);
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
                "max": outcome.max_cross_track_error, "replay": shell::replay(&folder, number),
            })
        };
        let rows: Vec<Value> = (from as u64..).zip(&self.lines[from..]).map(row).collect();
        Ok(json!({ "generation": self.generation, "from": from, "rows": rows, "clips": self.clips() }))
    }

    /// The numbers of the scenarios of which there is a clip.
    fn clips(&self) -> Vec<u64> {
        let files = std::fs::read_dir(self.folder.join(CLIPS)).into_iter().flatten().flatten();
        let number = |name: String| name.strip_prefix(CLIP.0)?.strip_suffix(CLIP.1)?.parse().ok();
        let mut numbers: Vec<u64> =
            files.filter_map(|file| number(file.file_name().to_string_lossy().into_owned())).collect();
        numbers.sort_unstable();
        numbers
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
        let points = samples(&steps).into_iter().map(|step| drive::numbers(&step.state, Some(step.control)));
        Ok(Some(json!({
            "name": line.name, "road": drive::road(&road), "points": points.collect::<Vec<_>>(), "images": images,
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
    folder.join(CLIPS).join(format!("{}{number}{}", CLIP.0, CLIP.1))
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use pdk_record::ledger::Ledger;

    /// A record in a folder, without scenarios.
    pub fn record(folder: &Path) -> Recorded {
        let manifest = json!({
            "pdk": "0.1.0", "seed": 0, "pipeline": { "path": "drives.lua", "source": "" }, "settings": {}, "components": [], "files": [],
            "machine": { "system": "linux", "architecture": "x", "processors": 1 },
        });
        std::fs::write(folder.join(MANIFEST), manifest.to_string()).unwrap();
        Recorded::open(folder).unwrap()
    }

    fn line(seed: u64, cause: &str) -> Line {
        let value = json!({
            "id": "00".repeat(16), "name": format!("drive {seed}"), "images_every": 0, "success": cause == "finished", "cause": cause,
            "time": 2.0, "frames": 5, "progress": 0.5, "mean_cross_track_error": 0.1, "max_cross_track_error": 0.2, "digest": "",
            "scenario": { "simulator": { "name": "flat" }, "driver": { "name": "x" }, "duration": 9.0, "seed": seed },
        });
        let mut line: Line = serde_json::from_value(value).unwrap();
        line.id = line.scenario.id();
        line
    }

    fn write(folder: &Path, lines: &[Line]) {
        let _ = std::fs::remove_file(folder.join(SCENARIOS));
        let mut ledger = Ledger::open(&RunDirectory::open(folder).unwrap()).unwrap();
        lines.iter().for_each(|line| ledger.add(line).unwrap());
    }

    #[test]
    fn a_browser_gets_the_rows_that_it_lacks() {
        let folder = tempfile::tempdir().unwrap();
        let mut recorded = record(folder.path());
        assert_eq!(recorded.rows(None).unwrap()["rows"], json!([]));
        let lines = [line(1, "finished"), line(2, "lane_departure"), line(3, "finished")];
        write(folder.path(), &lines[..2]);
        let first = recorded.rows(None).unwrap();
        assert_eq!((first["from"].as_u64(), first["rows"].as_array().unwrap().len()), (Some(0), 2));
        assert_eq!((&first["rows"][1]["failed"], &first["rows"][1]["number"]), (&json!(true), &json!(1)));
        let generation = first["generation"].as_u64().unwrap();
        write(folder.path(), &lines);
        std::fs::create_dir(folder.path().join(CLIPS)).unwrap();
        for name in ["scenario-1.mp4", "scenario-x.mp4", "other.mp4"] {
            std::fs::write(folder.path().join(CLIPS).join(name), "").unwrap();
        }
        let more = recorded.rows(Some((generation, 2))).unwrap();
        assert_eq!((&more["generation"], &more["from"]), (&json!(generation), &json!(2)));
        assert_eq!(
            (more["rows"].as_array().unwrap().len(), &more["rows"][0]["name"]),
            (1, &json!("drive 3"))
        );
        assert_eq!(more["clips"], json!([1]));
        // Lines in another order are sent anew.
        write(folder.path(), &[lines[2].clone(), lines[0].clone(), lines[1].clone()]);
        let anew = recorded.rows(Some((generation, 3))).unwrap();
        assert_eq!((anew["from"].as_u64(), anew["rows"].as_array().unwrap().len()), (Some(0), 3));
        assert_ne!(anew["generation"], json!(generation));
    }

    #[test]
    fn a_note_that_is_old_says_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let recorded = record(folder.path());
        assert_eq!(recorded.progress(), None);
        let path = folder.path().join(PROGRESS);
        std::fs::write(&path, "{\"frames\":3}").unwrap();
        assert_eq!(recorded.progress(), Some(json!({ "frames": 3 })));
        let file = std::fs::File::options().write(true).open(&path).unwrap();
        file.set_modified(SystemTime::now() - 2 * SILENT).unwrap();
        assert_eq!(recorded.progress(), None);
    }
}
