//! Reads traces: steps, images, events and the road in the order in which they were written.
//!
//! Fields are found by the names in the schema that a trace carries, so what others add to a trace does not matter.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Seek};
use std::path::{Path, PathBuf};

use crate::ledger::Line;
use mcap::McapError;
use mcap::sans_io::LinearReaderOptions;
use pdk_model::scenario::ScenarioId;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use pdk_sdk::prelude::{Control, DriveContext, FrameBuf, State};

use crate::trace::chunks;
use crate::trace::message::Field;
use crate::trace::protobuf::{Wire, fields};
use crate::trace::step::{Digest, ImageTopic, Step};
use crate::trace::writer::{APPLIED, ATTENTION, OBSERVED, SCENARIO, WAYPOINTS, state_fields};

/// A frame as it lies in a trace. It is for people: what the driver saw had not been through JPEG.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TraceImage {
    /// What the camera saw, or what the driver saw.
    pub topic: ImageTopic,
    /// The number of the frame in its scenario.
    pub sequence: u64,
    /// Simulation time in nanoseconds.
    pub nanoseconds: u64,
    /// The JPEG file.
    pub jpeg: Vec<u8>,
}

/// Something that happened: the start of a scenario, a failure, the end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Event {
    /// Simulation time in nanoseconds.
    pub nanoseconds: u64,
    /// Whether it is a failure.
    pub failure: bool,
    /// What happened.
    pub text: String,
}

/// One thing in a trace.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// A step of the loop.
    Step(Step),
    /// A frame; it comes after the step of its number.
    Image(TraceImage),
    /// Something that happened.
    Event(Event),
    /// The centre line of the driven lane as `x,height,z@x,height,z@...` in metres.
    Road(String),
}

impl TraceImage {
    /// Simulation time in seconds.
    pub fn time(&self) -> f64 {
        seconds(self.nanoseconds)
    }

    /// The frame.
    ///
    /// # Errors
    /// If the JPEG is damaged.
    pub fn decode(&self) -> Result<FrameBuf> {
        let place = || format!("the image of frame {} in the trace", self.sequence);
        let image = image::load_from_memory_with_format(&self.jpeg, image::ImageFormat::Jpeg)
            .place(place())?
            .into_rgb8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        FrameBuf::from_vec(image.into_raw(), width, height).place(place())
    }
}

impl Event {
    /// Simulation time in seconds.
    pub fn time(&self) -> f64 {
        seconds(self.nanoseconds)
    }
}

fn seconds(nanoseconds: u64) -> f64 {
    nanoseconds as f64 / 1e9
}

/// The line of the ledger that a trace belongs to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Owner {
    /// The scenario.
    pub scenario: ScenarioId,
    /// The digest of its outcome; empty if the drive was lost before it was computed.
    pub digest: String,
}

impl Owner {
    /// The owner of the trace that a line speaks of.
    pub fn of(line: &Line) -> Self {
        Self { scenario: line.id, digest: line.outcome.digest.clone() }
    }
}

/// The entries of a trace, read as they are asked for: only a part of the file is in memory. After an error there are no
/// more. If the iterator ends without an error, the trace was complete.
pub struct TraceReader {
    path: PathBuf,
    messages: mcap::io::MessageReader<BufReader<File>>,
    /// For each channel the numbers of the fields, in the order of the names in [`Topic::fields`].
    layouts: BTreeMap<u16, (Topic, Vec<u64>)>,
    /// A step whose control has not come yet.
    step: Option<Step>,
    /// Steps so far, for the sentence about a trace that ends early.
    steps: u64,
    /// The line that the trace has to belong to.
    owner: Option<Owner>,
    /// The id in the trace.
    scenario: Option<String>,
    digest: Digest,
    done: bool,
}

/// All steps of a trace, in order.
///
/// # Errors
/// As for [`TraceReader::open`].
pub fn read_steps(path: &Path) -> Result<Vec<Step>> {
    steps_and_road(TraceReader::open(path)?).map(|(steps, _)| steps)
}

/// All steps of the trace that belongs to a line of the ledger, in order, and the centre line of the driven lane, which is empty
/// if the simulator did not report it.
///
/// # Errors
/// As for [`TraceReader::of`].
pub fn read_recorded(path: &Path, owner: Owner) -> Result<(Vec<Step>, String)> {
    steps_and_road(TraceReader::of(path, owner)?)
}

fn steps_and_road(reader: TraceReader) -> Result<(Vec<Step>, String)> {
    let (mut steps, mut road) = (Vec::new(), String::new());
    for entry in reader {
        match entry? {
            Entry::Step(step) => steps.push(step),
            Entry::Road(waypoints) => road = waypoints,
            Entry::Image(_) | Entry::Event(_) => {}
        }
    }
    Ok((steps, road))
}

/// Reads a trace to its end, with all checksums, to see whether it is whole and belongs to a line of the ledger.
///
/// # Errors
/// As for [`TraceReader::of`].
pub fn check(path: &Path, owner: Owner) -> Result<()> {
    TraceReader::of(path, owner)?.try_for_each(|entry| entry.map(drop))
}

impl TraceReader {
    /// Opens a trace.
    ///
    /// # Errors
    /// If it is not there or cannot be read. What is wrong with its content shows with its entries.
    pub fn open(path: &Path) -> Result<Self> {
        let opened = file::open_if_there(path)
            .map_err(|error| Error::new(format!("cannot read the trace {} ({error})", path.display())))?;
        let (mut file, _) = opened.ok_or_else(|| Error::new(format!(
                "the trace {} is missing; delete its line from scenarios.jsonl and run the pipeline again with --out and its folder",
                path.display()
            )))?;
        let largest = chunks::largest(&mut file).and_then(|largest| file.rewind().map(|()| largest));
        let largest = largest
            .map_err(|error| Error::new(format!("cannot read the trace {} ({error})", path.display())))?;
        if largest > LARGEST_RECORD as u64 {
            return Err(damaged(path, 0, "a chunk that claims too much"));
        }
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_validate_data_section_crc(true)
            .with_record_length_limit(LARGEST_RECORD);
        Ok(Self {
            path: path.to_owned(),
            messages: mcap::io::MessageReader::new_with_options(BufReader::new(file), options),
            layouts: BTreeMap::new(),
            step: None,
            steps: 0,
            owner: None,
            scenario: None,
            digest: Digest::default(),
            done: false,
        })
    }

    /// Opens the trace that belongs to a line of the ledger. If it is of another scenario, or its steps are not those of the outcome,
    /// the last of its entries is an error.
    ///
    /// # Errors
    /// As for [`TraceReader::open`].
    pub fn of(path: &Path, owner: Owner) -> Result<Self> {
        Ok(Self { owner: Some(owner), ..Self::open(path)? })
    }

    /// Makes sure that the trace, which has been read to its end, belongs to its line.
    fn check_owner(&mut self) -> Result<()> {
        let Some(Owner { scenario, digest }) = self.owner.take() else { return Ok(()) };
        let found = self.scenario.as_deref().unwrap_or("no scenario");
        let difference = if found != scenario.to_string() {
            format!("it is the trace of {found} and not of {scenario}")
        } else if !digest.is_empty() && self.digest.text() != digest {
            format!("its steps have the digest {} and the outcome has {digest}", self.digest.text())
        } else {
            return Ok(());
        };
        Err(Error::new(format!(
            "the trace {} does not belong to its line in scenarios.jsonl ({difference}); restore it, or delete the line and run the \
             pipeline again with --out and its folder",
            self.path.display()
        )))
    }

    /// The next entry, or none at the end of a complete trace.
    fn read(&mut self) -> Result<Option<Entry>> {
        loop {
            let Some(message) = self.messages.next() else { break };
            let message = message.map_err(|error| self.file_error(&error))?;
            let channel = &message.channel;
            if !self.layouts.contains_key(&channel.id) {
                // What others may add to a trace is left out.
                let Some(topic) = Topic::named(&channel.topic) else { continue };
                let schema = channel.schema.as_ref().map_or(&[][..], |schema| &schema.data);
                let layout = layout(schema, &topic.fields()).ok_or_else(|| self.damaged("its schema"))?;
                if let (Topic::Event, Some(scenario)) = (topic, channel.metadata.get(SCENARIO)) {
                    self.scenario = Some(scenario.clone());
                }
                self.layouts.insert(channel.id, (topic, layout));
            }
            let Some((topic, layout)) = self.layouts.get(&channel.id) else { continue };
            let (sequence, nanoseconds) = (u64::from(message.sequence), message.log_time);
            let values = Values::read(*topic, layout, &message.data).map_err(|what| self.damaged(&what))?;
            let entry = match topic {
                Topic::State => {
                    let (state, frame_hash) = values.state().map_err(|what| self.damaged(&what))?;
                    let step = Step { sequence, state, frame_hash, ..Step::default() };
                    if self.step.replace(step).is_some() {
                        return Err(self.damaged("a state without a control"));
                    }
                    continue;
                }
                Topic::Observed | Topic::Applied | Topic::Control => {
                    let numbers = values.numbers().map_err(|what| self.damaged(&what))?;
                    let step = self.step.as_mut().filter(|step| step.sequence == sequence);
                    match (topic, step) {
                        (Topic::Observed, Some(step)) => step.observed = Some(numbers),
                        (Topic::Applied, Some(step)) => step.applied = Some(Control::from_numbers(numbers)),
                        (_, Some(step)) => step.control = Control::from_numbers(numbers),
                        (_, None) => return Err(self.damaged("a control without a state")),
                    }
                    let Some(step) = self.step.take_if(|_| matches!(topic, Topic::Control)) else { continue };
                    self.steps += 1;
                    self.digest.add(step.frame_hash, &step.control);
                    Entry::Step(step)
                }
                Topic::Image(topic) => {
                    let jpeg = values.bytes(0).map_err(|what| self.damaged(&what))?.to_vec();
                    Entry::Image(TraceImage { topic: *topic, sequence, nanoseconds, jpeg })
                }
                Topic::Event => {
                    let level = values.whole(0).map_err(|what| self.damaged(&what))?;
                    let text = values.bytes(1).map_err(|what| self.damaged(&what))?;
                    let text = String::from_utf8_lossy(text).into_owned();
                    Entry::Event(Event { nanoseconds, failure: level >= ERROR_LEVEL, text })
                }
                Topic::Road => {
                    let waypoints = values.bytes(0).map_err(|what| self.damaged(&what))?;
                    Entry::Road(String::from_utf8_lossy(waypoints).into_owned())
                }
            };
            return Ok(Some(entry));
        }
        match self.step {
            Some(_) => Err(self.damaged("a state without a control")),
            None => self.check_owner().map(|()| None),
        }
    }

    fn damaged(&self, what: &str) -> Error {
        damaged(&self.path, self.steps, what)
    }

    fn file_error(&self, error: &McapError) -> Error {
        match error {
            McapError::UnexpectedEof | McapError::UnexpectedEoc => Error::new(format!(
                "the trace {} is cut off after {} steps; delete its line from scenarios.jsonl and run the pipeline again with --out and its folder",
                self.path.display(),
                self.steps
            )),
            other => self.damaged(&other.to_string()),
        }
    }
}

fn damaged(path: &Path, steps: u64, what: &str) -> Error {
    Error::new(format!(
        "the trace {} is damaged after {steps} steps ({what}); delete its line from scenarios.jsonl and run the pipeline again with --out and its folder",
        path.display()
    ))
}

impl Iterator for TraceReader {
    type Item = Result<Entry>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        let entry = self.read().transpose();
        self.done = !matches!(entry, Some(Ok(_)));
        entry
    }
}

/// Bytes of the largest record or chunk. Chunks end with the first message that makes them 768 KiB, so only an image of
/// this size would make one; a length beyond it is damage, and no reason to ask for that much memory.
const LARGEST_RECORD: usize = 256 << 20;

/// The severity of failures among those of `foxglove.Log`.
const ERROR_LEVEL: u64 = 4;

/// The topics of a trace.
#[derive(Debug, Clone, Copy)]
enum Topic {
    State,
    Control,
    Observed,
    Applied,
    Image(ImageTopic),
    Event,
    Road,
}

impl Topic {
    fn named(name: &str) -> Option<Self> {
        match name {
            "/state" => Some(Topic::State),
            "/control" => Some(Topic::Control),
            "/raw" => Some(Topic::Image(ImageTopic::Raw)),
            "/perturbed" => Some(Topic::Image(ImageTopic::Perturbed)),
            OBSERVED => Some(Topic::Observed),
            APPLIED => Some(Topic::Applied),
            ATTENTION => Some(Topic::Image(ImageTopic::Attention)),
            "/event" => Some(Topic::Event),
            "/road" => Some(Topic::Road),
            _ => None,
        }
    }

    /// The fields that are read.
    fn fields(self) -> Vec<&'static str> {
        match self {
            Topic::State => state_fields().into_iter().map(Field::name).collect(),
            Topic::Control | Topic::Applied => Control::NUMBERS.to_vec(),
            Topic::Observed => DriveContext::NUMBERS.to_vec(),
            Topic::Image(_) => vec!["data"],
            Topic::Event => vec!["level", "message"],
            Topic::Road => vec![WAYPOINTS],
        }
    }
}

/// The numbers of fields in a schema, which is a `FileDescriptorSet` whose last file holds the message; none if it is
/// damaged or lacks one.
fn layout(schema: &[u8], wanted: &[&str]) -> Option<Vec<u64>> {
    /// Numbers of the fields in `descriptor.proto`.
    const FILE: u64 = 1;
    const MESSAGE_TYPE: u64 = 4;
    const FIELD: u64 = 2;
    const NAME: u64 = 1;
    const NUMBER: u64 = 3;
    let inner = |message: &'_ [u8], number: u64| -> Option<Vec<Vec<u8>>> {
        let mut found = Vec::new();
        for field in fields(message) {
            let (at, value) = field?;
            if at == number {
                found.push(value.bytes()?.to_vec());
            }
        }
        Some(found)
    };
    let mut numbers = BTreeMap::new();
    for file in inner(schema, FILE)? {
        for message in inner(&file, MESSAGE_TYPE)? {
            for field in inner(&message, FIELD)? {
                let (mut name, mut number) = (None, None);
                for part in fields(&field) {
                    match part? {
                        (NAME, value) => name = Some(value.text()?.to_owned()),
                        (NUMBER, value) => number = Some(value.whole()?),
                        _ => {}
                    }
                }
                numbers.insert(name?, number?);
            }
        }
    }
    wanted.iter().map(|name| numbers.get(*name).copied()).collect()
}

/// The most fields that a topic has: those of a state.
const FIELDS: usize = State::NUMBERS.len() + State::FLAGS.len() + 1;

/// The values of a message in the order of [`Topic::fields`].
struct Values<'a> {
    topic: Topic,
    values: [Option<Wire<'a>>; FIELDS],
}

impl<'a> Values<'a> {
    fn read(topic: Topic, layout: &[u64], message: &'a [u8]) -> Result<Self, String> {
        let mut values = [None; FIELDS];
        for field in fields(message) {
            let (number, value) = field.ok_or("a message that ends early")?;
            if let Some(position) = layout.iter().position(|known| *known == number) {
                values[position] = Some(value);
            }
        }
        Ok(Self { topic, values })
    }

    /// What a message says without its field at a position.
    fn missing(&self, position: usize) -> String {
        let name = self.topic.fields().get(position).copied().unwrap_or_default();
        format!("a message whose `{name}` is missing or of another type")
    }

    fn double(&self, position: usize) -> Result<f64, String> {
        self.values[position].and_then(Wire::double).ok_or_else(|| self.missing(position))
    }

    /// A whole number; zeros may be left out.
    fn whole(&self, position: usize) -> Result<u64, String> {
        self.values[position].map_or(Some(0), Wire::whole).ok_or_else(|| self.missing(position))
    }

    /// Bytes; none may be left out.
    fn bytes(&self, position: usize) -> Result<&'a [u8], String> {
        self.values[position].map_or(Some(&[][..]), Wire::bytes).ok_or_else(|| self.missing(position))
    }

    fn state(&self) -> Result<(State, u64), String> {
        const FLAGS: usize = State::NUMBERS.len();
        const HASH: usize = FLAGS + State::FLAGS.len();
        let (mut numbers, mut flags) = ([0.0; FLAGS], [false; State::FLAGS.len()]);
        for (position, number) in numbers.iter_mut().enumerate() {
            *number = self.double(position)?;
        }
        for (position, flag) in flags.iter_mut().enumerate() {
            *flag = self.whole(FLAGS + position)? != 0;
        }
        Ok((State::from_parts(numbers, flags), self.whole(HASH)?))
    }

    fn numbers(&self) -> Result<[f64; 2], String> {
        Ok([self.double(0)?, self.double(1)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::writer::Trace;

    fn steps() -> Vec<Step> {
        let step = |sequence: u64| {
            let time = sequence as f64 / 20.0;
            let state = State {
                time,
                position: [1.5, -0.25, 0.1 + time],
                heading: -0.0,
                speed: 8.0 + 1e-15,
                cross_track_error: -0.3,
                progress: time / 3.0,
                lane_departure: sequence == 2,
                finished: sequence == 3,
                vehicle_ahead: if sequence == 1 { 12.5 } else { f64::INFINITY },
                ..State::default()
            };
            let control = Control { steering: -0.125 * time, throttle: 1.0 };
            let observed = (sequence > 0).then_some([time + 0.001, f64::from(sequence as u32) - 0.0]);
            let applied = (sequence > 1).then_some(Control { steering: -0.0, throttle: time });
            Step { sequence, state, control, frame_hash: u64::MAX - sequence, observed, applied }
        };
        (0..4).map(step).collect()
    }

    fn scenario() -> ScenarioId {
        "00112233445566778899aabbccddeeff".parse().unwrap()
    }

    fn written(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("pdk-trace-{name}-{}.mcap", std::process::id()));
        let mut trace = Trace::create(&path, &scenario()).unwrap();
        let mut frame = FrameBuf::new(16, 8);
        frame.as_mut().rows_mut().for_each(|row| row.fill(90));
        trace.event(0.0, false, "fog@2").unwrap();
        for step in steps() {
            let Step { sequence, state, .. } = step;
            trace.step(&step).unwrap();
            if sequence == 2 {
                trace.image(ImageTopic::Raw, sequence, state.time, frame.as_ref()).unwrap();
                trace.image(ImageTopic::Perturbed, sequence, state.time, frame.as_ref()).unwrap();
            }
        }
        trace.event(0.15, true, "lane departure").unwrap();
        trace.road("0,0,0@1,0,2").unwrap();
        trace.finish().unwrap();
        path
    }

    #[test]
    fn what_is_written_is_read_bit_for_bit() {
        let path = written("whole");
        let entries: Vec<Entry> = TraceReader::open(&path).unwrap().collect::<Result<_>>().unwrap();
        let read: Vec<Step> = read_steps(&path).unwrap();
        assert_eq!(read, steps());
        assert!(read[0].state.heading.is_sign_negative());
        let order: Vec<_> = entries
            .iter()
            .map(|entry| match entry {
                Entry::Step(step) => format!("step {}", step.sequence),
                Entry::Image(image) => format!("{:?} {} {}", image.topic, image.sequence, image.time()),
                Entry::Event(event) => format!("{} {} {}", event.text, event.failure, event.time()),
                Entry::Road(waypoints) => format!("road {waypoints}"),
            })
            .collect();
        assert_eq!(
            order,
            [
                "fog@2 false 0",
                "step 0",
                "step 1",
                "step 2",
                "Raw 2 0.1",
                "Perturbed 2 0.1",
                "step 3",
                "lane departure true 0.15",
                "road 0,0,0@1,0,2",
            ]
        );
        let Entry::Image(image) = &entries[4] else { panic!("no image") };
        let frame = image.decode().unwrap();
        assert_eq!((frame.width(), frame.height()), (16, 8));
        assert!(frame.data().iter().all(|value| value.abs_diff(90) < 3));
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_trace_belongs_to_one_line() {
        let path = written("owner");
        let mut digest = Digest::default();
        steps().iter().for_each(|step| digest.add(step.frame_hash, &step.control));
        let own = Owner { scenario: scenario(), digest: digest.text() };
        assert_eq!(read_recorded(&path, own.clone()).unwrap().0, steps());
        // That of a drive that was lost.
        check(&path, Owner { digest: String::new(), ..own.clone() }).unwrap();
        let error = |owner| check(&path, owner).unwrap_err().to_string();
        let other = Owner { scenario: "ff".repeat(16).parse().unwrap(), ..own.clone() };
        let text = error(other);
        assert!(
            text.contains("it is the trace of 00112233445566778899aabbccddeeff and not of ffff"),
            "{text}"
        );
        assert!(text.contains("delete the line and run the pipeline again with --out"), "{text}");
        let text = error(Owner { digest: "00".to_owned(), ..own.clone() });
        assert!(
            text.contains(&format!("its steps have the digest {} and the outcome has 00", own.digest)),
            "{text}"
        );
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_truncated_or_damaged_trace_is_an_error() {
        let path = written("cut");
        let bytes = std::fs::read(&path).unwrap();
        for length in [0, 4, 40, bytes.len() / 2, bytes.len() - 200, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let error = read_steps(&path).unwrap_err().to_string();
            assert!(error.contains(" is cut off after ") || error.contains(" is damaged after "), "{error}");
        }
        // Whatever byte is wrong, there are all steps or an error, and no panic.
        let mut errors = 0;
        for position in 0..bytes.len() {
            let mut wrong = bytes.clone();
            wrong[position] ^= 0x20;
            std::fs::write(&path, wrong).unwrap();
            match read_steps(&path) {
                Ok(read) => assert!(read == steps(), "byte {position}: {} steps", read.len()),
                Err(_) => errors += 1,
            }
        }
        assert!(errors > 10, "{errors}");
        std::fs::remove_file(&path).unwrap();
        let error = read_steps(&path).unwrap_err().to_string();
        assert!(error.contains("is missing; delete its line from scenarios.jsonl and run the pipeline again with --out and its folder"), "{error}");
    }
}
