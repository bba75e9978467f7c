//! What a loop drives at this moment, from its topics.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use image::{ImageFormat, RgbImage};
use pdk_bus::{Message, SlotTopics, Tap, Topic};
use pdk_loop::announced::Announced;
use pdk_sdk::error::{Error, Place, Result};
use serde_json::{Value, json};

use crate::drive::{Drive, road};
use crate::query::Has;

/// How long a topic is waited for: it is there if its loop lives.
const OPEN: Duration = Duration::from_millis(200);
/// A browser that has not asked for this long is gone.
const ASKED: Duration = Duration::from_secs(2);
/// How often runs are looked for.
const LOOK: Duration = Duration::from_millis(500);

/// The topics of a loop that writes a certain record.
pub struct Live {
    record: PathBuf,
    looked: Option<Instant>,
    /// When a browser asked last.
    asked: Option<Instant>,
    slots: Vec<(String, SlotTopics, Announced)>,
    tapped: Option<Tapped>,
}

/// The open topics of a slot.
struct Tapped {
    run: String,
    slot: u32,
    taps: [Tap; 4],
    drive: Drive,
    /// The newest frame as the camera and as the driver saw it.
    frames: [Option<Seen>; 2],
}

/// A frame.
struct Seen {
    /// Its number on its topic, over all scenarios.
    number: u64,
    width: u32,
    height: u32,
    pixels: Vec<u8>,
}

impl Live {
    /// Nothing is open yet.
    pub fn new(record: PathBuf) -> Self {
        Self { record, looked: None, asked: None, slots: Vec::new(), tapped: None }
    }

    /// Looks which loops write the record, and takes what has come on the topics of one of them.
    ///
    /// # Errors
    /// If the topics cannot be read.
    pub fn look(&mut self, slot: Option<u32>) -> Result<()> {
        if self.looked.is_none_or(|looked| looked.elapsed() >= LOOK) {
            self.slots = loops(&self.record)?;
            self.looked = Some(Instant::now());
        }
        let wanted = self.slots.iter().find(|(_, found, _)| Some(found.slot) == slot).or(self.slots.first());
        let Some((run, found, _)) = wanted else {
            self.tapped = None;
            return Ok(());
        };
        if self.tapped.as_ref().is_none_or(|tapped| tapped.run != *run || tapped.slot != found.slot) {
            self.tapped = Tapped::open(run, found.slot)?;
        }
        self.asked = Some(Instant::now());
        self.tapped.as_mut().map_or(Ok(()), |tapped| tapped.take(&[2, 3, 0, 1]))
    }

    /// Takes controls and states between two requests, so that curves have more points than requests.
    pub fn sample(&mut self) {
        if self.asked.is_some_and(|asked| asked.elapsed() < ASKED)
            && let Some(tapped) = &mut self.tapped
        {
            // The next request reports what is wrong with the topics.
            let _ = tapped.take(&[2, 3]);
        }
    }

    /// Whether a loop writes the record.
    pub fn is_under_way(&self) -> bool {
        !self.slots.is_empty()
    }

    /// What is driven, as JSON: of its course what a browser lacks.
    pub fn told(&self, has: Option<Has>) -> Value {
        let slots: Vec<_> = self
            .slots
            .iter()
            .map(|(_, slot, announced)| json!({ "slot": slot.slot, "name": announced.name }))
            .collect();
        let Some(tapped) = &self.tapped else { return json!({ "slots": slots }) };
        let announced = self
            .slots
            .iter()
            .find(|(run, slot, announced)| {
                *run == tapped.run
                    && slot.slot == tapped.slot
                    && Some(announced.number) == tapped.drive.scenario
            })
            .map(|(_, _, announced)| announced);
        let (from, points) = tapped.drive.since(has);
        // The road is that of the whole drive.
        let road = announced.filter(|_| from == 0).map(|announced| road(&announced.road));
        json!({
            "slots": slots, "slot": tapped.slot, "name": announced.map(|announced| &announced.name), "road": road,
            "drive": tapped.drive.generation, "from": from, "points": points,
        })
    }

    /// What tells the newest frame from those before it; none if none has come.
    pub fn tag(&self, perturbed: bool) -> Option<String> {
        let tapped = self.tapped.as_ref()?;
        let seen = tapped.frames[usize::from(perturbed)].as_ref()?;
        Some(format!("\"{}-{}-{}\"", tapped.run, tapped.slot, seen.number))
    }

    /// The newest frame as a picture; none if none has come.
    ///
    /// # Errors
    /// If it cannot be encoded.
    pub fn frame(&self, perturbed: bool) -> Result<Option<Vec<u8>>> {
        let seen = self.tapped.as_ref().and_then(|tapped| tapped.frames[usize::from(perturbed)].as_ref());
        seen.map(Seen::picture).transpose()
    }
}

impl Seen {
    fn picture(&self) -> Result<Vec<u8>> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let picture = RgbImage::from_raw(self.width, self.height, self.pixels.clone())
            .ok_or_else(|| Error::new("a frame is not of the size that its header has"))?;
        // Not compressed: that costs less than a JPEG, and shows the very pixels.
        picture.write_to(&mut bytes, ImageFormat::Bmp).place("cannot encode a frame")?;
        Ok(bytes.into_inner())
    }
}

/// The record that a loop writes.
fn record_of(announced: &Announced) -> Option<&Path> {
    announced.trace.parent().and_then(Path::parent)
}

/// The loops that write a record, by their slots.
fn loops(record: &Path) -> Result<Vec<(String, SlotTopics, Announced)>> {
    let all = all()?.into_iter();
    let own = |found: &(String, SlotTopics, Announced)| {
        record_of(&found.2).is_some_and(|folder| std::fs::canonicalize(folder).is_ok_and(|it| it == record))
    };
    Ok(all.filter(own).collect())
}

/// All loops that record what they drive, those of the run that started last first.
fn all() -> Result<Vec<(String, SlotTopics, Announced)>> {
    let runs = Tap::list().map_err(|error| Error::new(error.message()))?;
    let mut found = Vec::new();
    for run in runs {
        for slot in run.slots {
            if let Some(announced) = slot.announced().and_then(|text| serde_json::from_str(&text).ok()) {
                found.push((run.run.clone(), slot, announced));
            }
        }
    }
    Ok(found)
}

/// The record of the run that started last of those under way.
///
/// # Errors
/// If the topics cannot be listed.
pub fn latest() -> Result<Option<PathBuf>> {
    Ok(all()?.iter().find_map(|(_, _, announced)| record_of(announced).map(Path::to_owned)))
}

impl Tapped {
    fn open(run: &str, slot: u32) -> Result<Option<Self>> {
        let open = |topic| Tap::open(run, slot, topic, OPEN);
        // A loop that is gone by now is not an error: the next look finds the one that took its place.
        let (Ok(raw), Ok(perturbed), Ok(control), Ok(state)) =
            (open(Topic::Raw), open(Topic::Perturbed), open(Topic::Control), open(Topic::State))
        else {
            return Ok(None);
        };
        Ok(Some(Self {
            run: run.to_owned(),
            slot,
            taps: [raw, perturbed, control, state],
            drive: Drive::default(),
            frames: [None, None],
        }))
    }

    /// Takes what has come on these topics since the last time; of the frames only the newest.
    fn take(&mut self, topics: &[usize]) -> Result<()> {
        let mut controls = Vec::new();
        for &place in topics {
            let mut newest = None;
            while let Some(message) =
                self.taps[place].receive(Duration::ZERO).map_err(|error| Error::new(error.message()))?
            {
                match message {
                    Message::Control(header, control) => controls.push((header.sequence, control)),
                    Message::State(header, state) => {
                        let control = controls.iter().find(|(sequence, _)| *sequence == header.sequence);
                        self.drive.add(header.scenario, state, control.map(|(_, control)| *control));
                    }
                    Message::Frame(frame) => newest = Some(frame),
                }
            }
            if let Some(frame) = newest {
                let header = frame.header();
                let (number, width, height) = (header.number, header.width, header.height);
                self.frames[place] = Some(Seen { number, width, height, pixels: frame.to_vec() });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_a_picture_of_its_pixels() {
        let seen = Seen { number: 7, width: 2, height: 1, pixels: vec![1, 2, 3, 4, 5, 6] };
        let picture = image::load_from_memory(&seen.picture().unwrap()).unwrap().to_rgb8();
        assert_eq!((picture.dimensions(), picture.into_raw()), ((2, 1), vec![1, 2, 3, 4, 5, 6]));
        assert!(Seen { width: 3, ..seen }.picture().is_err());
    }

    #[test]
    fn without_a_loop_nothing_is_under_way() {
        let folder = tempfile::tempdir().unwrap();
        let mut live = Live::new(folder.path().to_owned());
        live.look(None).unwrap();
        assert!(!live.is_under_way() && live.tag(true).is_none() && live.frame(false).unwrap().is_none());
        assert_eq!(live.told(None), json!({ "slots": [] }));
    }
}
