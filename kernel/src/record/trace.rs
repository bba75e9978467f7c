//! The trace of a scenario as MCAP: frames, control, state and events, for Foxglove, Rerun and everything else that
//! reads the format. Times are simulation times, so that two equal runs write equal files.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use foxglove::Encode;
use foxglove::messages::{CompressedImage, Log, Timestamp, log::Level};
use mcap::records::MessageHeader;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Control, Frame, State};

/// Quality of the JPEG frames in a trace: they are for people; what a driver saw is computed again from the seeds.
const JPEG_QUALITY: u8 = 85;

/// A trace that is being written.
pub struct Trace {
    path: PathBuf,
    writer: mcap::Writer<BufWriter<File>>,
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
    event: u16,
}

/// A control in the trace.
#[derive(Encode)]
struct ControlMessage {
    steering: f64,
    throttle: f64,
}

/// A state in the trace.
#[derive(Encode)]
struct StateMessage {
    time: f64,
    x: f64,
    height: f64,
    z: f64,
    heading: f64,
    speed: f64,
    cross_track_error: f64,
    progress: f64,
    /// Infinite where there is none.
    vehicle_ahead: f64,
    lane_departure: bool,
    collision: bool,
    finished: bool,
    /// Hash of the frame that the driver saw.
    frame_hash: u64,
}

/// What one step of the loop did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// The number of the frame in its scenario, from 0.
    pub sequence: u64,
    /// The state that belongs to the frame.
    pub state: State,
    /// What the driver decided.
    pub control: Control,
    /// Hash of the frame that the driver saw: XXH3 with 64 bits over its bytes.
    pub frame_hash: u64,
}

/// Which of the two image topics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageTopic {
    /// What the camera saw.
    Raw,
    /// What the driver saw.
    Perturbed,
}

impl Trace {
    /// Starts a trace.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(|error| super::write_error(path, &error))?;
        let options =
            mcap::WriteOptions::new().library(concat!("pdk ", env!("CARGO_PKG_VERSION")).to_owned());
        let mut writer = options.create(BufWriter::new(file)).map_err(|error| trace_error(path, &error))?;
        let channels = Channels {
            raw: add_channel::<CompressedImage>(&mut writer, "/raw", path)?,
            perturbed: add_channel::<CompressedImage>(&mut writer, "/perturbed", path)?,
            control: add_channel::<ControlMessage>(&mut writer, "/control", path)?,
            state: add_channel::<StateMessage>(&mut writer, "/state", path)?,
            event: add_channel::<Log>(&mut writer, "/event", path)?,
        };
        Ok(Self { path: path.to_owned(), writer, channels, sequence: 0, message: Vec::new() })
    }

    /// Adds what one step of the loop did.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn step(&mut self, step: &Step) -> Result<()> {
        let Step { sequence, state, control, frame_hash } = *step;
        self.sequence = sequence as u32;
        let [x, height, z] = state.position;
        let message = StateMessage {
            time: state.time,
            x,
            height,
            z,
            heading: state.heading,
            speed: state.speed,
            cross_track_error: state.cross_track_error,
            progress: state.progress,
            vehicle_ahead: state.vehicle_ahead,
            lane_departure: state.lane_departure,
            collision: state.collision,
            finished: state.finished,
            frame_hash,
        };
        self.write(self.channels.state, state.time, &message)?;
        let message = ControlMessage { steering: control.steering, throttle: control.throttle };
        self.write(self.channels.control, state.time, &message)
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// Where it cannot be encoded or written.
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
    /// Where it cannot be written.
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

    /// Completes the file.
    ///
    /// # Errors
    /// Where the rest cannot be written.
    pub fn finish(mut self) -> Result<()> {
        self.writer.finish().map_err(|error| trace_error(&self.path, &error))?;
        Ok(())
    }

    fn write<T: Encode>(&mut self, channel_id: u16, time: f64, message: &T) -> Result<()> {
        self.message.clear();
        message.encode(&mut self.message).map_err(|error| {
            Error::new(format!("cannot encode a message for {} ({error})", self.path.display()))
        })?;
        let time = nanoseconds(time);
        let header =
            MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.writer
            .write_to_known_channel(&header, &self.message)
            .map_err(|error| trace_error(&self.path, &error))
    }
}

/// Simulation time in seconds as a trace counts it.
fn nanoseconds(time: f64) -> u64 {
    (time * 1e9).round().max(0.0) as u64
}

fn timestamp(time: f64) -> Timestamp {
    let nanoseconds = nanoseconds(time);
    Timestamp::new((nanoseconds / 1_000_000_000) as u32, (nanoseconds % 1_000_000_000) as u32)
}

fn add_channel<T: Encode>(
    writer: &mut mcap::Writer<BufWriter<File>>,
    topic: &str,
    path: &Path,
) -> Result<u16> {
    let schema = match T::get_schema() {
        Some(schema) => writer.add_schema(&schema.name, &schema.encoding, &schema.data),
        None => Ok(0),
    };
    schema
        .and_then(|id| writer.add_channel(id, topic, &T::get_message_encoding(), &BTreeMap::new()))
        .map_err(|error| trace_error(path, &error))
}

fn trace_error(path: &Path, error: &mcap::McapError) -> Error {
    match error {
        mcap::McapError::Io(error) => super::write_error(path, error),
        other => Error::new(format!("cannot write {} ({other})", path.display())),
    }
}
