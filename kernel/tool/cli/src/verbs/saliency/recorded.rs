//! The frames in the traces of a record: what the camera saw, and how fast the vehicle was.

use std::path::{Path, PathBuf};

use pdk_record::directory::{RunDirectory, SCENARIOS};
use pdk_record::ledger;
use pdk_record::trace::reader::{Entry, Owner, TraceImage, TraceReader};
use pdk_record::trace::step::ImageTopic;
use pdk_sdk::error::{Error, Result};

use super::shown::Shown;

/// The recorded frames of a run.
pub struct Recorded {
    traces: Vec<Trace>,
    /// The trace of each frame, and the number of the frame in its scenario.
    frames: Vec<(usize, u64)>,
    /// The trace that is being read, since frames are asked for in their order.
    open: Option<(usize, Reading)>,
}

struct Trace {
    path: PathBuf,
    /// The number of its scenario, for names.
    scenario: usize,
    /// The number of its road: drives on one road show much the same.
    road: usize,
}

/// A trace with the speed at the step that was read last.
struct Reading {
    entries: TraceReader,
    speed: f64,
}

impl Reading {
    fn of(entries: TraceReader) -> Self {
        Self { entries, speed: 0.0 }
    }

    /// The next frame that the camera saw.
    fn next(&mut self) -> Result<Option<TraceImage>> {
        for entry in &mut self.entries {
            match entry? {
                Entry::Step(step) => self.speed = step.state.speed,
                Entry::Image(image) if image.topic == ImageTopic::Raw => return Ok(Some(image)),
                Entry::Image(_) | Entry::Event(_) | Entry::Road(_) => {}
            }
        }
        Ok(None)
    }
}

impl Recorded {
    /// Whether a folder is the record of a run in which scenarios were driven.
    pub fn is_one(folder: &Path) -> bool {
        folder.join(SCENARIOS).is_file()
    }

    /// Finds the frames of a record.
    ///
    /// # Errors
    /// If the record cannot be read or has no frames.
    pub fn open(folder: &Path) -> Result<Self> {
        let directory = RunDirectory::open(folder)?;
        let (lines, _) = ledger::read(&directory)?;
        let (mut traces, mut frames, mut roads) = (Vec::new(), Vec::new(), Vec::new());
        for (scenario, line) in lines.iter().enumerate() {
            let path = directory.trace_path(&line.id);
            if line.images_every == 0 || !path.exists() {
                continue;
            }
            // Without a road of its own, the simulator draws it from the seed.
            let road = (&line.scenario.road, line.scenario.road.is_null().then_some(line.scenario.seed));
            let number = roads.iter().position(|known| *known == road).unwrap_or(roads.len());
            if number == roads.len() {
                roads.push(road);
            }
            // Read to its end here, which is where it is found out whether it belongs to the line.
            let mut reading = Reading::of(TraceReader::of(&path, Owner::of(line))?);
            while let Some(image) = reading.next()? {
                frames.push((traces.len(), image.sequence));
            }
            traces.push(Trace { path, scenario, road: number });
        }
        if frames.is_empty() {
            return Err(Error::new(format!(
                "{} has no images; drive again with `images_every` set, such as 20 for one a second",
                folder.display()
            )));
        }
        Ok(Self { traces, frames, open: None })
    }

    /// The number of frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// A frame.
    ///
    /// # Errors
    /// If its trace cannot be read.
    pub fn read(&mut self, at: usize) -> Result<Shown> {
        let (place, sequence) = self.frames[at];
        let trace = &self.traces[place];
        let mut reading = match self.open.take() {
            Some((open, reading)) if open == place => reading,
            _ => Reading::of(TraceReader::open(&trace.path)?),
        };
        while let Some(image) = reading.next()? {
            if image.sequence == sequence {
                let (frame, speed) = (image.decode()?, Some(reading.speed));
                self.open = Some((place, reading));
                return Ok(Shown {
                    name: format!("{}-{sequence}", trace.scenario),
                    frame,
                    speed,
                    road: Some(trace.road),
                });
            }
        }
        Err(Error::new(format!("the trace {} has changed while it was read", trace.path.display())))
    }
}
