//! Writes a trace.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use crate::lines::{sync_folder, write_error};
use foxglove::Encode;
use foxglove::messages::{CompressedImage, Log, Timestamp, log::Level};
use mcap::records::MessageHeader;
use pdk_model::scenario::ScenarioId;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Control, DriveContext, Frame, State};

use crate::trace::message::{Field, put_double, put_text, put_whole, schema};
use crate::trace::step::{ImageTopic, Step};

/// Quality of the JPEG frames in a trace: they are for people; what a driver saw is computed again from the seeds.
const JPEG_QUALITY: u8 = 85;

type Writer = mcap::Writer<BufWriter<File>>;

/// A trace that is being written.
pub struct Trace {
    path: PathBuf,
    writer: Writer,
    channels: Channels,
    sequence: u32,
    /// The encoded message, reused from one to the next.
    message: Vec<u8>,
}

struct Channels {
    raw: u16,
    perturbed: u16,
    control: u16,
    state: u16,
    road: u16,
    event: u16,
    /// Those that are made when the first message for them comes, which few traces have, by topic.
    later: BTreeMap<&'static str, u16>,
}

/// The fields of a state: those of the model, and a hash of the frame that the driver saw.
pub(crate) fn state_fields() -> Vec<Field> {
    let numbers = State::NUMBERS.map(Field::Double);
    let flags = State::FLAGS.map(Field::Bool);
    numbers.into_iter().chain(flags).chain([Field::Whole(FRAME_HASH)]).collect()
}

/// The name of the field with the hash of the frame that the driver saw.
pub(crate) const FRAME_HASH: &str = "frame_hash";
/// The name of the field with the road's centre line as `x,height,z@x,height,z@...` in metres.
pub(crate) const WAYPOINTS: &str = "waypoints";
/// The metadata of the channel of events: the id of the scenario. Every trace has events.
pub(crate) const SCENARIO: &str = "scenario";
/// The topics that few traces have: what a network looked at, what the driver got besides the frame, and what was applied to the vehicle.
pub(crate) const ATTENTION: &str = "/attention";
pub(crate) const OBSERVED: &str = "/observed";
pub(crate) const APPLIED: &str = "/applied";
/// The package of pdk's own messages.
const PACKAGE: &str = "pdk";

impl Trace {
    /// Starts the trace of a scenario. Until it is complete it has the number of this process and `.part` behind its name.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn create(path: &Path, scenario: &ScenarioId) -> Result<Self> {
        let part = part_of(path, std::process::id());
        // Most often there is none. An attempt that was given up may still hold its file, and completes it when it is dropped: this one gets
        // another.
        let _ = std::fs::remove_file(&part);
        let file = File::create(&part).map_err(|error| write_error(path, &error))?;
        let options =
            mcap::WriteOptions::new().library(concat!("pdk ", env!("CARGO_PKG_VERSION")).to_owned());
        let mut writer = options.create(BufWriter::new(file)).map_err(|error| trace_error(path, &error))?;
        let channels = Channels {
            raw: add_channel::<CompressedImage>(&mut writer, "/raw", path)?,
            perturbed: add_channel::<CompressedImage>(&mut writer, "/perturbed", path)?,
            control: add_own(&mut writer, "/control", "Control", &Control::NUMBERS.map(Field::Double), path)?,
            state: add_own(&mut writer, "/state", "State", &state_fields(), path)?,
            road: add_own(&mut writer, "/road", "Road", &[Field::Text(WAYPOINTS)], path)?,
            event: add_described::<Log>(
                &mut writer,
                "/event",
                &BTreeMap::from([(SCENARIO.to_owned(), scenario.to_string())]),
                path,
            )?,
            later: BTreeMap::new(),
        };
        Ok(Self { path: path.to_owned(), writer, channels, sequence: 0, message: Vec::new() })
    }

    /// Adds what one step of the loop did.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn step(&mut self, step: &Step) -> Result<()> {
        let Step { sequence, state, control, frame_hash, observed, applied } = *step;
        self.sequence = sequence as u32;
        let message = &mut self.message;
        message.clear();
        let mut number = 0;
        let mut next = || {
            number += 1;
            number
        };
        state.numbers().into_iter().for_each(|value| put_double(message, next(), value));
        state.flags().into_iter().for_each(|value| put_whole(message, next(), u64::from(value)));
        put_whole(message, next(), frame_hash);
        self.write_message(self.channels.state, state.time)?;
        if let Some(numbers) = observed {
            let fields = DriveContext::NUMBERS.map(Field::Double);
            let channel =
                self.later(OBSERVED, |writer, path| add_own(writer, OBSERVED, "Observation", &fields, path))?;
            self.write_numbers(channel, state.time, numbers)?;
        }
        if let Some(control) = applied {
            let fields = Control::NUMBERS.map(Field::Double);
            let channel =
                self.later(APPLIED, |writer, path| add_own(writer, APPLIED, "Control", &fields, path))?;
            self.write_numbers(channel, state.time, control.numbers())?;
        }
        // It comes last, so that a reader has the others by then.
        self.write_numbers(self.channels.control, state.time, control.numbers())
    }

    /// The channel of a topic that few traces have.
    fn later(
        &mut self,
        topic: &'static str,
        make: impl FnOnce(&mut Writer, &Path) -> Result<u16>,
    ) -> Result<u16> {
        if let Some(channel) = self.channels.later.get(topic) {
            return Ok(*channel);
        }
        let made = make(&mut self.writer, &self.path)?;
        self.channels.later.insert(topic, made);
        Ok(made)
    }

    fn write_numbers(&mut self, channel: u16, time: f64, numbers: [f64; 2]) -> Result<()> {
        self.message.clear();
        for (number, value) in (1..).zip(numbers) {
            put_double(&mut self.message, number, value);
        }
        self.write_message(channel, time)
    }

    /// Adds the centre line of the driven lane.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn road(&mut self, waypoints: &str) -> Result<()> {
        self.message.clear();
        put_text(&mut self.message, 1, waypoints);
        self.write_message(self.channels.road, 0.0)
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// If it cannot be encoded or written.
    pub fn image(&mut self, topic: ImageTopic, sequence: u64, time: f64, frame: Frame<'_>) -> Result<()> {
        self.sequence = sequence as u32;
        let mut jpeg = Vec::with_capacity(frame.width() * frame.height() / 2);
        let contiguous =
            frame.contiguous().ok_or_else(|| Error::new("a frame to record has gaps between its rows"))?;
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, JPEG_QUALITY)
            .encode(contiguous, frame.width() as u32, frame.height() as u32, image::ExtendedColorType::Rgb8)
            .map_err(|error| {
                Error::new(format!("cannot encode a frame for {} ({error})", self.path.display()))
            })?;
        let channel = match topic {
            ImageTopic::Raw => self.channels.raw,
            ImageTopic::Perturbed => self.channels.perturbed,
            ImageTopic::Attention => {
                self.later(ATTENTION, |writer, path| add_channel::<CompressedImage>(writer, ATTENTION, path))?
            }
        };
        let message = CompressedImage {
            timestamp: Some(timestamp(time)),
            frame_id: "camera".to_owned(),
            data: jpeg.into(),
            format: "jpeg".to_owned(),
        };
        self.write(channel, time, &message)
    }

    /// Adds something that happened: the start, a failure, the end.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn event(&mut self, time: f64, failure: bool, text: &str) -> Result<()> {
        let level = if failure { Level::Error } else { Level::Info };
        let message = Log {
            timestamp: Some(timestamp(time)),
            level: level.into(),
            message: text.to_owned(),
            name: "pdk".to_owned(),
            file: String::new(),
            line: 0,
        };
        self.write(self.channels.event, time, &message)
    }

    /// Completes the file: it is on the disk, under its own name, when this returns.
    ///
    /// # Errors
    /// If the rest cannot be written.
    pub fn finish(mut self) -> Result<()> {
        self.writer.finish().map_err(|error| trace_error(&self.path, &error))?;
        let failed = |error: std::io::Error| write_error(&self.path, &error);
        let file = self.writer.into_inner().into_inner().map_err(|error| failed(error.into_error()))?;
        file.sync_data()
            .and_then(|()| std::fs::rename(part_of(&self.path, std::process::id()), &self.path))
            .map_err(failed)?;
        sync_folder(&self.path);
        Ok(())
    }

    fn write<T: Encode>(&mut self, channel_id: u16, time: f64, message: &T) -> Result<()> {
        self.message.clear();
        message.encode(&mut self.message).map_err(|error| {
            Error::new(format!("cannot encode a message for {} ({error})", self.path.display()))
        })?;
        self.write_message(channel_id, time)
    }

    /// Writes the encoded message.
    fn write_message(&mut self, channel_id: u16, time: f64) -> Result<()> {
        let time = nanoseconds(time);
        let header =
            MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.writer
            .write_to_known_channel(&header, &self.message)
            .map_err(|error| trace_error(&self.path, &error))
    }
}

/// The name of a trace that is not complete. It is of the process that writes it: another one may write the same trace while this
/// one has not yet noticed that its own is not wanted.
pub fn part_of(path: &Path, process: u32) -> PathBuf {
    path.with_extension(format!("{process}.part"))
}

/// Simulation time in seconds as a trace counts it.
fn nanoseconds(time: f64) -> u64 {
    (time * 1e9).round().max(0.0) as u64
}

fn timestamp(time: f64) -> Timestamp {
    let nanoseconds = nanoseconds(time);
    Timestamp::new((nanoseconds / 1_000_000_000) as u32, (nanoseconds % 1_000_000_000) as u32)
}

/// Adds a topic with messages of our own.
fn add_own(writer: &mut Writer, topic: &str, name: &str, fields: &[Field], path: &Path) -> Result<u16> {
    let schema = schema(PACKAGE, name, fields);
    writer
        .add_schema(&format!("{PACKAGE}.{name}"), "protobuf", &schema)
        .and_then(|id| writer.add_channel(id, topic, "protobuf", &BTreeMap::new()))
        .map_err(|error| trace_error(path, &error))
}

fn add_channel<T: Encode>(writer: &mut Writer, topic: &str, path: &Path) -> Result<u16> {
    add_described::<T>(writer, topic, &BTreeMap::new(), path)
}

/// Adds a topic whose channel says something besides.
fn add_described<T: Encode>(
    writer: &mut Writer,
    topic: &str,
    metadata: &BTreeMap<String, String>,
    path: &Path,
) -> Result<u16> {
    let schema = match T::get_schema() {
        Some(schema) => writer.add_schema(&schema.name, &schema.encoding, &schema.data),
        None => Ok(0),
    };
    schema
        .and_then(|id| writer.add_channel(id, topic, &T::get_message_encoding(), metadata))
        .map_err(|error| trace_error(path, &error))
}

fn trace_error(path: &Path, error: &mcap::McapError) -> Error {
    match error {
        mcap::McapError::Io(error) => write_error(path, error),
        other => Error::new(format!("cannot write {} ({other})", path.display())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trace_that_is_begun_again_has_nothing_of_the_first_attempt() {
        let folder = tempfile::tempdir().unwrap();
        let create = |name: &str| {
            let scenario = "00112233445566778899aabbccddeeff".parse().unwrap();
            Trace::create(&folder.path().join(name), &scenario).unwrap()
        };
        let complete = |mut trace: Trace| {
            trace.event(0.0, false, "fog@2").unwrap();
            trace.finish().unwrap();
        };
        complete(create("once.mcap"));
        let mut first = create("again.mcap");
        // So much that it has written part of it.
        for number in 0..4096 {
            first.event(f64::from(number), false, &format!("{number} ").repeat(200)).unwrap();
        }
        let second = create("again.mcap");
        drop(first);
        complete(second);
        let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        assert!(read("again.mcap") == read("once.mcap"));
    }
}
