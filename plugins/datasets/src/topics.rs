//! What a bag holds of a drive: its pictures, and what was recorded beside them at about the same time.

use std::collections::BTreeMap;

use pdk_sdk::prelude::*;
use pdk_video::{Stream, Yuv420};

use crate::bag::{Bag, Place};
use crate::foxglove::Stored;
use crate::label::{Label, Units, pedals, range};
use crate::message::{Numbers, Picture, Reading, decode_next};
use crate::place::{beyond, unsuitable};
use crate::video::nearest;

/// More messages than this of one topic are not believed.
const MOST: usize = 1 << 22;

/// The topic of a trace of pdk with pictures as the simulator gave them.
const ORIGINAL: &str = "/raw";

/// A drive in a bag.
pub struct Drive {
    pub(crate) bag: Bag,
    pub(crate) kind: Picture,
    topic: String,
    /// Other topics with pictures.
    pub(crate) others: Vec<String>,
    /// The topic of the steering.
    pub(crate) steering: Option<(String, Numbers)>,
    pub(crate) frames: Vec<Frame>,
    told: Vec<(String, String)>,
    /// The video as far as it was decoded: the frame that comes next.
    stream: Option<(Stream, usize)>,
    picture: Yuv420,
}

/// A frame of a drive.
pub(crate) struct Frame {
    pub place: Place,
    /// When its message was recorded, in nanoseconds.
    pub logged: u64,
    /// Seconds since the first.
    pub time: f64,
    /// Whether decoding can begin here.
    pub begins: bool,
    label: Result<Label>,
}

/// A message with a picture.
struct Seen {
    place: Place,
    logged: u64,
    stamp: u64,
    begins: bool,
}

/// Messages with numbers of a topic: when they were recorded and what they say.
struct Series {
    kind: Numbers,
    /// What is wrong with a message is an error of the frames that need it.
    values: Vec<(u64, Result<Reading>)>,
}

impl Drive {
    /// The parameters that name topics, and say how numbers belong to pictures.
    pub fn parameters() -> Vec<Parameter> {
        let topic = |name: &str, doc: &str| Parameter::text(name, doc);
        let clock = "where the time of a frame comes from: when its message was recorded, or its header";
        let mut parameters = vec![
            topic("image", "the topic of the pictures; guessed if it is not set"),
            topic(
                "steering",
                "the topic of the steering: Float32, Float64, Twist (angular.z) or AckermannDrive (steering_angle), with a header or \
                 without; guessed if it is not set, and `none` for none",
            ),
            topic(
                "throttle",
                "the topic of the throttle: Float32 or Float64; that of the steering if it is not set and has one, as in traces of pdk",
            ),
            topic("brake", "the topic of the brake, which counts against the throttle: Float32 or Float64"),
            topic(
                "speed",
                "the topic of the speed: Float32, Float64, Twist (linear.x) or AckermannDrive; that of the steering if it is not set and \
                 has one",
            ),
            Parameter::number("tolerance", 0.1, "how far a message with numbers may be from its picture")
                .range(0.0, 1e6)
                .unit("s"),
            Parameter::choice("clock", &["log", "header"], clock),
        ];
        let [_, speed_unit] = Units::parameters("m/s");
        let full_lock = "the recorded steering that is full steering to the right, negative if the recording counts to the left, such as -0.44 \
                         for radians; 0: 1 for a Float32, a Float64 and traces of pdk, and for a Twist and an AckermannDrive it has to be set";
        parameters.extend([Parameter::number("full_lock", 0.0, full_lock), speed_unit]);
        parameters
    }

    /// Reads where everything is.
    ///
    /// # Errors
    /// If a file cannot be read, or has no pictures.
    pub fn new(config: &Config, bag: Bag) -> Result<Self> {
        let mut pictures: BTreeMap<String, (Picture, Vec<Seen>)> = BTreeMap::new();
        let mut numbers: BTreeMap<String, Series> = BTreeMap::new();
        let mut others: BTreeMap<String, String> = BTreeMap::new();
        let early = bag.scan(&mut |message| {
            if let Some(kind) = Picture::of(message.encoding, message.schema) {
                let (_, seen) =
                    pictures.entry(message.topic.to_owned()).or_insert_with(|| (kind, Vec::new()));
                // What is wrong with it is said when it is read.
                let (stamp, begins) = kind.look(message.data).unwrap_or((0, true));
                seen.push(Seen { place: message.place, logged: message.time, stamp, begins });
                few_enough(seen.len(), message.topic)?;
            } else if let Some(kind) = Numbers::of(message.encoding, message.schema) {
                let series = numbers
                    .entry(message.topic.to_owned())
                    .or_insert_with(|| Series { kind, values: Vec::new() });
                let reading = kind.read(message.data);
                let reading = reading.map_err(|error| error.at(format_args!("topic `{}`", message.topic)));
                series.values.push((message.time, reading));
                few_enough(series.values.len(), message.topic)?;
            } else if !others.contains_key(message.topic) {
                others
                    .insert(message.topic.to_owned(), format!("{} in {}", message.schema, message.encoding));
            }
            Ok(())
        })?;
        let mut told = Vec::new();
        // A trace of pdk has what the driver saw as well, perturbed already.
        let is_trace = numbers.values().any(|series| series.kind == Numbers::Control);
        let image = match config.text("image") {
            "" if is_trace && pictures.contains_key(ORIGINAL) => ORIGINAL,
            given => given,
        };
        let topic = choose("image", image, pictures.keys(), |topic| {
            pictures.get(topic).map_or(0, |(_, seen)| seen.len())
        })?;
        let Some(topic) = topic else {
            let others: Vec<String> =
                others.iter().map(|(topic, what)| format!("{topic} ({what})")).collect();
            return Err(unsuitable(format_args!(
                "it has no pictures of ROS 2 or Foxglove; its topics are {}",
                if others.is_empty() { "none".to_owned() } else { others.join(", ") }
            )));
        };
        let (kind, mut seen) = pictures.remove(&topic).ok_or_else(|| unsuitable("it has no pictures"))?;
        seen.sort_by_key(|seen| seen.logged);
        told.push(("frames".to_owned(), format!("{} of topic {topic}", seen.len())));
        told.extend(early.map(|early| ("end".to_owned(), early)));

        let (labels, steering) = labels(config, &numbers, &seen, &mut told)?;
        let by_header = config.text("clock") == "header";
        let time = |seen: &Seen| if by_header { seen.stamp } else { seen.logged };
        let first = seen.first().map_or(0, time);
        let frames: Vec<Frame> = seen
            .iter()
            .zip(labels)
            .map(|(seen, label)| Frame {
                place: seen.place,
                logged: seen.logged,
                time: seconds(time(seen), first),
                begins: seen.begins,
                label,
            })
            .collect();
        let others = pictures.into_keys().collect();
        let picture = Yuv420::default();
        Ok(Self { bag, kind, topic, others, steering, frames, told, stream: None, picture })
    }

    /// A frame of a video.
    ///
    /// # Errors
    /// If it, or one that it needs, is damaged or missing.
    pub(crate) fn video(&mut self, stored: Stored, index: usize) -> Result<FrameBuf> {
        let begin = self.frames[..=index].iter().rposition(|frame| frame.begins).ok_or_else(|| {
            Error::new("the video begins with pictures that need earlier ones, which were not recorded; leave out the frames before the first key frame")
        })?;
        let (mut stream, mut next) = match self.stream.take() {
            Some((stream, next)) if (begin..=index).contains(&next) => (stream, next),
            _ => (Stream::new()?, begin),
        };
        // Without a stream, the next frame begins anew.
        while next <= index {
            let place = self.frames[next].place;
            decode_next(&mut stream, stored, self.bag.read(place)?, &mut self.picture).map_err(|error| {
                if next < index { error.at(format_args!("frame {next}, which it needs")) } else { error }
            })?;
            next += 1;
        }
        self.stream = Some((stream, next));
        let mut frame = FrameBuf::new(self.picture.width, self.picture.height);
        self.picture.to_rgb(frame.as_mut());
        Ok(frame)
    }
}

impl Dataset for Drive {
    fn len(&self) -> usize {
        self.frames.len()
    }

    fn name(&self, index: usize) -> String {
        format!("{} {index}", self.topic)
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let frame = self.frames.get(index).ok_or_else(|| beyond(index, self.frames.len()))?;
        let (label, time, place) = (frame.label.clone()?, frame.time, frame.place);
        let frame = match self.kind {
            Picture::FoxgloveVideo(stored) => self.video(stored, index)?,
            kind => kind.decode(self.bag.read(place)?)?,
        };
        Ok(Entry { frame, steering: label.steering, throttle: label.throttle, time, speed: label.speed })
    }

    fn position(&self, index: usize) -> Position {
        let time = self.frames.get(index).map_or(f64::NAN, |frame| frame.time);
        Position { part: 0, number: index as u64, time }
    }

    fn info(&self) -> Vec<(String, String)> {
        self.told.clone()
    }
}

fn few_enough(count: usize, topic: &str) -> Result<()> {
    match count > MOST {
        true => Err(Error::new(format!(
            "topic `{topic}` has more than {MOST} messages; cut the recording into parts"
        ))),
        false => Ok(()),
    }
}

/// Seconds from one time in nanoseconds to another.
fn seconds(time: u64, from: u64) -> f64 {
    (i128::from(time) - i128::from(from)) as f64 / 1e9
}

/// The topic that the configuration names, or the one with the most messages; the first by name of several.
fn choose<'a>(
    what: &str,
    given: &str,
    known: impl Iterator<Item = &'a String> + Clone,
    messages: impl Fn(&str) -> usize,
) -> Result<Option<String>> {
    if given.is_empty() {
        return Ok(known.rev_max(messages));
    }
    match known.clone().any(|topic| topic == given) {
        true => Ok(Some(given.to_owned())),
        false => {
            let known: Vec<&str> = known.map(String::as_str).collect();
            Err(Error::new(format!(
                "there is no topic `{given}` for `{what}`; {}",
                match known.is_empty() {
                    true => "no topic has messages of the kinds that are read".to_owned(),
                    false => format!("those with such messages are {}", known.join(", ")),
                }
            )))
        }
    }
}

/// The largest, and the first of several that are equal.
trait RevMax {
    fn rev_max(self, by: impl Fn(&str) -> usize) -> Option<String>;
}

impl<'a, I: Iterator<Item = &'a String>> RevMax for I {
    fn rev_max(self, by: impl Fn(&str) -> usize) -> Option<String> {
        let largest = self.fold(None::<(&String, usize)>, |largest, topic| match largest {
            Some((_, most)) if most >= by(topic) => largest,
            _ => Some((topic, by(topic))),
        });
        largest.map(|(topic, _)| topic.clone())
    }
}

/// The topic that is taken for that of the steering if none is named: of a trace of pdk, of an Ackermann drive, with a name that says so, or
/// of the only twist. A twist may be anything that moves, such as what a receiver of GPS says.
///
/// # Errors
/// If there are several twists, and nothing says which of them steers.
fn guessed_steering(numbers: &BTreeMap<String, Series>) -> Result<Option<String>> {
    let of = |is_kind: fn(Numbers) -> bool| {
        numbers.iter().filter(move |(_, series)| is_kind(series.kind)).map(|(topic, _)| topic)
    };
    let named = || {
        numbers
            .iter()
            .filter(|(_, series)| series.kind != Numbers::State)
            .map(|(topic, _)| topic)
            .find(|topic| topic.to_lowercase().contains("steer"))
    };
    let certain = of(|kind| kind == Numbers::Control)
        .next()
        .or_else(|| of(|kind| matches!(kind, Numbers::Ackermann(_))).next())
        .or_else(named);
    if let Some(topic) = certain {
        return Ok(Some(topic.clone()));
    }
    let twists: Vec<&str> = of(|kind| matches!(kind, Numbers::Twist(_))).map(String::as_str).collect();
    match &twists[..] {
        [] => Ok(None),
        [topic] => Ok(Some((*topic).to_owned())),
        several => Err(Error::new(format!(
            "several topics could be the steering ({}); name it by `steering`, or write `steering=none`",
            several.join(", ")
        ))),
    }
}

/// The recorded steering that is full steering to the right.
///
/// # Errors
/// If it is not set, and the kind of the messages does not say it.
fn full_lock(config: &Config, topic: &str, kind: Numbers, [low, high]: [f64; 2]) -> Result<f64> {
    match config.number("full_lock") {
        0.0 if kind.is_to_the_left() => Err(Error::new(format!(
            "the steering of topic {topic} ({}) is {low} to {high}, counted to the left; set `full_lock` to its value at full steering to \
             the right, such as -0.44, or `steering=none`",
            kind.steering()
        ))),
        0.0 => Ok(1.0),
        given => Ok(given),
    }
}

/// What was recorded with each picture, and the topic of the steering.
type Labels = (Vec<Result<Label>>, Option<(String, Numbers)>);

/// What was recorded with each picture.
fn labels(
    config: &Config,
    numbers: &BTreeMap<String, Series>,
    seen: &[Seen],
    told: &mut Vec<(String, String)>,
) -> Result<Labels> {
    let origin = seen.first().map_or(0, |seen| seen.logged);
    let tolerance = config.number("tolerance");
    let named = |what: &str| -> Result<Option<String>> {
        match config.text(what) {
            "" | "none" => Ok(None),
            given => choose(what, given, numbers.keys(), |_| 0),
        }
    };
    let steering = match config.text("steering") {
        "" => guessed_steering(numbers)?,
        _ => named("steering")?,
    };
    let beside = |has: fn(&Reading) -> bool| {
        let has_one = |topic: &String| {
            numbers[topic].values.iter().flat_map(|(_, reading)| reading).next().is_some_and(has)
        };
        steering.clone().filter(has_one)
    };
    let speed = match config.text("speed") {
        "" => beside(|reading| reading.speed.is_some()).or_else(|| {
            numbers.iter().find(|(_, series)| series.kind == Numbers::State).map(|(topic, _)| topic.clone())
        }),
        _ => named("speed")?,
    };
    let throttle = match config.text("throttle") {
        "" => beside(|reading| reading.throttle.is_some()),
        _ => named("throttle")?,
    };
    let brake = named("brake")?;
    // The messages of a topic in the order of their times, in seconds after the first picture.
    let series = |topic: &Option<String>| -> Vec<(f64, &Result<Reading>)> {
        let values =
            topic.as_ref().and_then(|topic| numbers.get(topic)).map_or(&[][..], |series| &series.values);
        let mut values: Vec<_> =
            values.iter().map(|(time, reading)| (seconds(*time, origin), reading)).collect();
        values.sort_by(|a, b| a.0.total_cmp(&b.0));
        values
    };
    let [steerings, throttles, brakes, speeds] = [&steering, &throttle, &brake, &speed].map(series);
    let first = |reading: &Reading| reading.first;
    let mut tell = |what: &str, topic: &Option<String>, how: String| {
        let topic = topic.as_ref().map(|topic| format!("topic {topic}{how}"));
        told.push((what.to_owned(), topic.unwrap_or_else(|| "not recorded".to_owned())));
    };
    let (how, units) = match (&steering, range(steerings.iter().flat_map(|(_, reading)| *reading).map(first)))
    {
        (Some(topic), (low, high)) if low <= high => {
            let kind = numbers[topic].kind;
            let units = Units::of(config, full_lock(config, topic, kind, [low, high])?)?;
            let how = units.describe_steering(low, high)?;
            (format!(", {}, {how}, at most {tolerance} s away", kind.steering()), units)
        }
        _ => (String::new(), Units::of(config, 1.0)?),
    };
    tell("steering", &steering, how);
    tell("throttle", &throttle, String::new());
    tell("speed", &speed, format!(", in {}", units.speed_name()));
    let label = |seen: &Seen| -> Result<Label> {
        let time = seconds(seen.logged, origin);
        let value = |what: &str,
                     topic: &Option<String>,
                     messages: &[(f64, &Result<Reading>)],
                     value: fn(&Reading) -> f64| match topic {
            None => Ok(f64::NAN),
            Some(topic) => match nearest(messages, time, tolerance) {
                Some(reading) => reading.as_ref().map(value).map_err(Clone::clone),
                None => Err(Error::new(format!(
                    "topic {topic} has no message within {tolerance} s, for the {what}; set `tolerance`"
                ))),
            },
        };
        let pressed = |reading: &Reading| reading.throttle.unwrap_or(reading.first);
        let driven = |reading: &Reading| reading.speed.unwrap_or(reading.first);
        let throttle = value("throttle", &throttle, &throttles, pressed)?;
        Ok(Label {
            steering: units.steering(value("steering", &steering, &steerings, first)?),
            throttle: pedals(throttle, value("brake", &brake, &brakes, first)?)?,
            speed: units.speed(value("speed", &speed, &speeds, driven)?),
        })
    };
    let labels = seen.iter().map(label).collect();
    let kind = |topic: &String| numbers.get(topic).map(|series| (topic.clone(), series.kind));
    Ok((labels, steering.as_ref().and_then(kind)))
}
