//! Messages with pictures and with numbers, of the kinds that are read.

use pdk_sdk::prelude::*;
use pdk_video::{Stream, Yuv420, begins_anew};
use prost::Message as _;

use crate::cdr::Cdr;
use crate::foxglove::{CompressedImage, CompressedVideo, Foxglove, RawImage, Stored, Timestamp};
use crate::protobuf::{self, damaged};
use crate::raw::Raw;

/// Kinds of messages with a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Picture {
    /// `sensor_msgs/CompressedImage`.
    Compressed,
    /// `sensor_msgs/Image`.
    Image,
    /// `foxglove.CompressedImage`.
    FoxgloveCompressed(Stored),
    /// `foxglove.RawImage`.
    FoxgloveRaw(Stored),
    /// `foxglove.CompressedVideo`.
    FoxgloveVideo(Stored),
}

impl Picture {
    /// The kind of a message; none if it has no picture.
    pub fn of(encoding: &str, schema: &str) -> Option<Self> {
        let foxglove = match encoding {
            "cdr" => schema.strip_prefix("foxglove_msgs/msg/").map(|name| (Stored::Ros2, name)),
            "protobuf" => schema.strip_prefix("foxglove.").map(|name| (Stored::Protobuf, name)),
            _ => return None,
        };
        Some(match (schema, foxglove) {
            (_, Some((stored, "CompressedImage"))) => Self::FoxgloveCompressed(stored),
            (_, Some((stored, "RawImage"))) => Self::FoxgloveRaw(stored),
            (_, Some((stored, "CompressedVideo"))) => Self::FoxgloveVideo(stored),
            ("sensor_msgs/msg/CompressedImage", None) if encoding == "cdr" => Self::Compressed,
            ("sensor_msgs/msg/Image", None) if encoding == "cdr" => Self::Image,
            _ => return None,
        })
    }

    /// When the picture was taken, in nanoseconds, and whether decoding can begin with it.
    ///
    /// # Errors
    /// If the message is damaged.
    pub fn look(self, data: &[u8]) -> Result<(u64, bool)> {
        Ok(match self {
            Self::Compressed
            | Self::Image
            | Self::FoxgloveCompressed(Stored::Ros2)
            | Self::FoxgloveRaw(Stored::Ros2) => (Cdr::new(data)?.header()?, true),
            Self::FoxgloveVideo(Stored::Ros2) => {
                let mut cdr = Cdr::new(data)?;
                (cdr.header()?, begins_anew(cdr.bytes()?))
            }
            Self::FoxgloveCompressed(Stored::Protobuf) | Self::FoxgloveRaw(Stored::Protobuf) => {
                (Timestamp::of_message(data)?, true)
            }
            Self::FoxgloveVideo(Stored::Protobuf) => {
                (Timestamp::of_message(data)?, begins_anew(protobuf::bytes(data, 3)?))
            }
        })
    }

    /// The picture of a message.
    ///
    /// # Errors
    /// If the message or the picture is damaged, or of a kind that is not read.
    pub fn decode(self, data: &[u8]) -> Result<FrameBuf> {
        match self {
            Self::Compressed => {
                let mut cdr = Cdr::new(data)?;
                cdr.header()?;
                let format = cdr.text()?.to_owned();
                // Depth, which is not a picture for a driver.
                if format.contains("compressedDepth") {
                    return Err(Error::new(format!("it is `{format}`, which is a depth and not a picture")));
                }
                still(cdr.bytes()?)
            }
            Self::Image => {
                let mut cdr = Cdr::new(data)?;
                cdr.header()?;
                let (height, width) = (cdr.u32()?, cdr.u32()?);
                let encoding = cdr.text()?;
                cdr.byte()?;
                let step = cdr.u32()?;
                Raw { width, height, encoding, step, data: cdr.bytes()? }.to_frame()
            }
            Self::FoxgloveCompressed(stored) => still(&CompressedImage::read(stored, data)?.data),
            Self::FoxgloveRaw(stored) => {
                let RawImage { width, height, encoding, step, data, .. } = RawImage::read(stored, data)?;
                Raw { width, height, encoding: &encoding, step, data: &data }.to_frame()
            }
            Self::FoxgloveVideo(_) => Err(Error::new("a picture of a video needs those before it")),
        }
    }
}

/// Decodes the next picture of a video.
///
/// # Errors
/// If the message or the picture is damaged, or of another codec than H.264.
pub fn decode_next(stream: &mut Stream, stored: Stored, data: &[u8], into: &mut Yuv420) -> Result<()> {
    let video = CompressedVideo::read(stored, data)?;
    match video.format.as_str() {
        "h264" => stream.decode(&video.data, into),
        other => {
            Err(Error::new(format!("the video is encoded as `{other}`, and h264 is read; convert the topic")))
        }
    }
}

fn still(bytes: &[u8]) -> Result<FrameBuf> {
    let image = pdk_image::decode(bytes)?.into_rgb8();
    let (width, height) = (image.width() as usize, image.height() as usize);
    FrameBuf::from_vec(image.into_raw(), width, height).map_err(Error::new)
}

/// Kinds of messages with numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Numbers {
    /// `std_msgs/Float32`.
    Float32,
    /// `std_msgs/Float64`.
    Float64,
    /// `geometry_msgs/Twist`: the rate of turning and the speed; with a header or without.
    Twist(bool),
    /// `ackermann_msgs/AckermannDrive`: the steering angle and the speed; with a header or without.
    Ackermann(bool),
    /// `pdk.Control` of a trace: steering and throttle.
    Control,
    /// `pdk.State` of a trace: the speed.
    State,
}

/// What a message with numbers says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The steering, or its only number.
    pub first: f64,
    /// The throttle, if it has one besides.
    pub throttle: Option<f64>,
    /// The speed, if it has one besides.
    pub speed: Option<f64>,
}

impl Numbers {
    /// The kind of a message; none if it is not read.
    pub fn of(encoding: &str, schema: &str) -> Option<Self> {
        match (encoding, schema) {
            ("protobuf", "pdk.Control") => return Some(Self::Control),
            ("protobuf", "pdk.State") => return Some(Self::State),
            _ => {}
        }
        let name = schema.strip_prefix("std_msgs/msg/").or(schema.strip_prefix("geometry_msgs/msg/"));
        let name = name.or(schema.strip_prefix("ackermann_msgs/msg/")).filter(|_| encoding == "cdr")?;
        Some(match name {
            "Float32" => Self::Float32,
            "Float64" => Self::Float64,
            "Twist" => Self::Twist(false),
            "TwistStamped" => Self::Twist(true),
            "AckermannDrive" => Self::Ackermann(false),
            "AckermannDriveStamped" => Self::Ackermann(true),
            _ => return None,
        })
    }

    /// What the steering is in such a message.
    pub fn steering(self) -> &'static str {
        match self {
            Self::Float32 | Self::Float64 => "data",
            Self::Twist(_) => "angular.z",
            Self::Ackermann(_) => "steering_angle",
            Self::Control => "steering",
            Self::State => "speed",
        }
    }

    /// Whether it counts steering to the left, in a unit that has no full steering.
    pub fn is_to_the_left(self) -> bool {
        matches!(self, Self::Twist(_) | Self::Ackermann(_))
    }

    /// What a message says.
    ///
    /// # Errors
    /// If the message is damaged, or a number is not finite.
    pub fn read(self, data: &[u8]) -> Result<Reading> {
        let mut reading = Reading { first: f64::NAN, throttle: None, speed: None };
        match self {
            Self::Control => {
                let Control { steering, throttle } = Control::decode(data).map_err(damaged)?;
                reading = Reading { first: steering, throttle: Some(throttle), speed: None };
            }
            Self::State => reading.first = State::decode(data).map_err(damaged)?.speed,
            Self::Float32 => reading.first = Cdr::new(data)?.f32()?,
            Self::Float64 => reading.first = Cdr::new(data)?.f64()?,
            Self::Twist(has_header) => {
                let mut cdr = Cdr::new(data)?;
                if has_header {
                    cdr.header()?;
                }
                let mut values = [0.0; 6];
                for value in &mut values {
                    *value = cdr.f64()?;
                }
                reading = Reading { first: values[5], throttle: None, speed: Some(values[0]) };
            }
            Self::Ackermann(has_header) => {
                let mut cdr = Cdr::new(data)?;
                if has_header {
                    cdr.header()?;
                }
                let angle = cdr.f32()?;
                cdr.f32()?;
                reading = Reading { first: angle, throttle: None, speed: Some(cdr.f32()?) };
            }
        }
        let Reading { first, throttle, speed } = reading;
        match first.is_finite() && [throttle, speed].iter().flatten().all(|number| number.is_finite()) {
            true => Ok(reading),
            false => Err(Error::new("a number in the message is not finite")),
        }
    }
}

/// `pdk.Control` as traces have it.
#[derive(Clone, Copy, PartialEq, prost::Message)]
struct Control {
    #[prost(double, tag = "1")]
    steering: f64,
    #[prost(double, tag = "2")]
    throttle: f64,
}

/// `pdk.State` as traces have it, of which the speed is read.
#[derive(Clone, Copy, PartialEq, prost::Message)]
struct State {
    #[prost(double, tag = "6")]
    speed: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::{Control as Driven, State as Situation};

    #[test]
    fn the_numbers_of_fields_in_traces_are_those_of_the_model() {
        let number =
            |names: &[&str], wanted: &str| 1 + names.iter().position(|name| *name == wanted).unwrap();
        assert_eq!(["steering", "throttle"].map(|name| number(&Driven::NUMBERS, name)), [1, 2]);
        assert_eq!(number(&Situation::NUMBERS, "speed"), 6);
        let control = Control { steering: -0.5, throttle: 0.25 }.encode_to_vec();
        let reading = Numbers::of("protobuf", "pdk.Control").unwrap().read(&control).unwrap();
        assert_eq!(reading, Reading { first: -0.5, throttle: Some(0.25), speed: None });
        let state = State { speed: 12.5 }.encode_to_vec();
        assert_eq!(Numbers::of("protobuf", "pdk.State").unwrap().read(&state).unwrap().first, 12.5);
    }
}
