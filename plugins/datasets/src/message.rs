//! Messages with pictures and with numbers, of the kinds that are read.

use pdk_sdk::prelude::*;
use pdk_video::{Stream, Yuv420, begins_anew};
use prost::Message as _;

use crate::cdr::Cdr;
use crate::foxglove::{CompressedImage, CompressedVideo, RawImage};
use crate::raw::Raw;

/// Kinds of messages with a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Picture {
    /// `sensor_msgs/CompressedImage`.
    Compressed,
    /// `sensor_msgs/Image`.
    Image,
    /// `foxglove.CompressedImage`.
    FoxgloveCompressed,
    /// `foxglove.RawImage`.
    FoxgloveRaw,
    /// `foxglove.CompressedVideo`.
    FoxgloveVideo,
}

impl Picture {
    /// The kind of a message; none if it has no picture.
    pub fn of(encoding: &str, schema: &str) -> Option<Self> {
        Some(match (encoding, schema) {
            ("cdr", "sensor_msgs/msg/CompressedImage") => Self::Compressed,
            ("cdr", "sensor_msgs/msg/Image") => Self::Image,
            ("protobuf", "foxglove.CompressedImage") => Self::FoxgloveCompressed,
            ("protobuf", "foxglove.RawImage") => Self::FoxgloveRaw,
            ("protobuf", "foxglove.CompressedVideo") => Self::FoxgloveVideo,
            _ => return None,
        })
    }

    /// When the picture was taken, in nanoseconds, and whether decoding can begin with it.
    ///
    /// # Errors
    /// If the message is damaged.
    pub fn look(self, data: &[u8]) -> Result<(u64, bool)> {
        let stamp = |stamp: Option<crate::foxglove::Timestamp>| {
            stamp.map_or(0, crate::foxglove::Timestamp::nanoseconds)
        };
        Ok(match self {
            Self::Compressed | Self::Image => (Cdr::new(data)?.header()?, true),
            Self::FoxgloveCompressed => {
                (stamp(CompressedImage::decode(data).map_err(damaged)?.timestamp), true)
            }
            Self::FoxgloveRaw => (stamp(RawImage::decode(data).map_err(damaged)?.timestamp), true),
            Self::FoxgloveVideo => {
                let video = CompressedVideo::decode(data).map_err(damaged)?;
                (stamp(video.timestamp), begins_anew(&video.data))
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
            Self::FoxgloveCompressed => still(&CompressedImage::decode(data).map_err(damaged)?.data),
            Self::FoxgloveRaw => {
                let RawImage { width, height, encoding, step, data, .. } =
                    RawImage::decode(data).map_err(damaged)?;
                Raw { width, height, encoding: &encoding, step, data: &data }.to_frame()
            }
            Self::FoxgloveVideo => Err(Error::new("a picture of a video needs those before it")),
        }
    }
}

/// Decodes the next picture of a video.
///
/// # Errors
/// If the message or the picture is damaged, or of another codec than H.264.
pub fn decode_next(stream: &mut Stream, data: &[u8], into: &mut Yuv420) -> Result<()> {
    let video = CompressedVideo::decode(data).map_err(damaged)?;
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

fn damaged(error: prost::DecodeError) -> Error {
    Error::new(format!("the message is damaged ({error})"))
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
}

impl Numbers {
    /// The kind of a message; none if it is not read.
    pub fn of(encoding: &str, schema: &str) -> Option<Self> {
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
        }
    }

    /// The steering of a message, or its only number, and the speed if it has one.
    ///
    /// # Errors
    /// If the message is damaged, or a number is not finite.
    pub fn read(self, data: &[u8]) -> Result<(f64, Option<f64>)> {
        let mut cdr = Cdr::new(data)?;
        if matches!(self, Self::Twist(true) | Self::Ackermann(true)) {
            cdr.header()?;
        }
        let (first, speed) = match self {
            Self::Float32 => (cdr.f32()?, None),
            Self::Float64 => (cdr.f64()?, None),
            Self::Twist(_) => {
                let mut values = [0.0; 6];
                for value in &mut values {
                    *value = cdr.f64()?;
                }
                (values[5], Some(values[0]))
            }
            Self::Ackermann(_) => {
                let angle = cdr.f32()?;
                cdr.f32()?;
                (angle, Some(cdr.f32()?))
            }
        };
        match first.is_finite() && speed.is_none_or(f64::is_finite) {
            true => Ok((first, speed)),
            false => Err(Error::new("a number in the message is not finite")),
        }
    }
}
