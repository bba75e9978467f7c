//! Messages of Foxglove with pictures: the fields that are read, by their published numbers in Protocol Buffers and by their published order in
//! ROS 2 (`foxglove_msgs`), where a time and the name of a place come first, as in a `std_msgs/Header`.

use pdk_sdk::prelude::*;
use prost::Message as _;

use crate::cdr::Cdr;
use crate::protobuf::{self, damaged};

/// How a message of Foxglove is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stored {
    /// In Protocol Buffers.
    Protobuf,
    /// As ROS 2 stores messages.
    Ros2,
}

/// A message of Foxglove.
pub trait Foxglove: prost::Message + Default {
    /// Reads the fields behind the time and the name of a place.
    ///
    /// # Errors
    /// If the message is damaged.
    fn of_fields(timestamp: Timestamp, cdr: &mut Cdr<'_>) -> Result<Self>;

    /// Reads a message.
    ///
    /// # Errors
    /// If it is damaged.
    fn read(stored: Stored, message: &[u8]) -> Result<Self> {
        match stored {
            Stored::Protobuf => Self::decode(message).map_err(damaged),
            Stored::Ros2 => {
                let mut cdr = Cdr::new(message)?;
                Self::of_fields(Timestamp::of_header(&mut cdr)?, &mut cdr)
            }
        }
    }
}

/// `foxglove.CompressedImage`.
#[derive(Clone, PartialEq, prost::Message)]
pub struct CompressedImage {
    /// When it was taken.
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    /// A JPEG, PNG or WebP.
    #[prost(bytes = "vec", tag = "2")]
    pub data: Vec<u8>,
}

impl Foxglove for CompressedImage {
    fn of_fields(timestamp: Timestamp, cdr: &mut Cdr<'_>) -> Result<Self> {
        Ok(Self { timestamp: Some(timestamp), data: cdr.bytes()?.to_vec() })
    }
}

/// `foxglove.RawImage`.
#[derive(Clone, PartialEq, prost::Message)]
pub struct RawImage {
    /// When it was taken.
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    /// Pixels in a row.
    #[prost(fixed32, tag = "2")]
    pub width: u32,
    /// Rows.
    #[prost(fixed32, tag = "3")]
    pub height: u32,
    /// How its pixels are stored.
    #[prost(string, tag = "4")]
    pub encoding: String,
    /// Bytes from one row to the next.
    #[prost(fixed32, tag = "5")]
    pub step: u32,
    /// The pixels.
    #[prost(bytes = "vec", tag = "6")]
    pub data: Vec<u8>,
}

impl Foxglove for RawImage {
    fn of_fields(timestamp: Timestamp, cdr: &mut Cdr<'_>) -> Result<Self> {
        let (width, height) = (cdr.u32()?, cdr.u32()?);
        let encoding = cdr.text()?.to_owned();
        let step = cdr.u32()?;
        Ok(Self { timestamp: Some(timestamp), width, height, encoding, step, data: cdr.bytes()?.to_vec() })
    }
}

/// `foxglove.CompressedVideo`.
#[derive(Clone, PartialEq, prost::Message)]
pub struct CompressedVideo {
    /// When it was taken.
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    /// The units of one picture.
    #[prost(bytes = "vec", tag = "3")]
    pub data: Vec<u8>,
    /// The codec, such as `h264`.
    #[prost(string, tag = "4")]
    pub format: String,
}

impl Foxglove for CompressedVideo {
    fn of_fields(timestamp: Timestamp, cdr: &mut Cdr<'_>) -> Result<Self> {
        let data = cdr.bytes()?.to_vec();
        Ok(Self { timestamp: Some(timestamp), data, format: cdr.text()?.to_owned() })
    }
}

/// `google.protobuf.Timestamp`.
#[derive(Clone, Copy, PartialEq, prost::Message)]
pub struct Timestamp {
    /// Seconds since 1970.
    #[prost(int64, tag = "1")]
    pub seconds: i64,
    /// And nanoseconds.
    #[prost(int32, tag = "2")]
    pub nanos: i32,
}

impl Timestamp {
    /// The time at the beginning of a message of ROS 2, behind which the name of a place is passed.
    fn of_header(cdr: &mut Cdr<'_>) -> Result<Self> {
        let time = cdr.header()?;
        Ok(Self { seconds: (time / 1_000_000_000) as i64, nanos: (time % 1_000_000_000) as i32 })
    }

    /// The time of a message in Protocol Buffers, in nanoseconds; 0 if it has none.
    ///
    /// # Errors
    /// If the message is damaged.
    pub fn of_message(message: &[u8]) -> Result<u64> {
        Ok(Self::decode(protobuf::bytes(message, 1)?).map_err(damaged)?.nanoseconds())
    }

    /// In nanoseconds.
    fn nanoseconds(self) -> u64 {
        let nanoseconds = i128::from(self.seconds) * 1_000_000_000 + i128::from(self.nanos);
        u64::try_from(nanoseconds).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A message of ROS 2: a time, the name `cam`, and what comes behind.
    fn ros2(behind: &[u8]) -> Vec<u8> {
        let mut message = vec![0, 1, 0, 0, 7, 0, 0, 0, 9, 0, 0, 0, 4, 0, 0, 0];
        message.extend(b"cam\0");
        message.extend(behind);
        message
    }

    #[test]
    fn messages_of_ros_2_say_the_same_as_those_in_protocol_buffers() {
        let timestamp = Some(Timestamp { seconds: 7, nanos: 9 });
        let image = CompressedImage { timestamp, data: vec![1, 2, 3] };
        let behind = [3, 0, 0, 0, 1, 2, 3, 0, 4, 0, 0, 0, b'p', b'n', b'g', 0];
        assert_eq!(CompressedImage::read(Stored::Ros2, &ros2(&behind)).unwrap(), image);
        assert_eq!(CompressedImage::read(Stored::Protobuf, &image.encode_to_vec()).unwrap(), image);

        let video = CompressedVideo { timestamp, data: vec![1, 2, 3], format: "h264".to_owned() };
        let behind = [3, 0, 0, 0, 1, 2, 3, 0, 5, 0, 0, 0, b'h', b'2', b'6', b'4', 0];
        assert_eq!(CompressedVideo::read(Stored::Ros2, &ros2(&behind)).unwrap(), video);
        assert_eq!(CompressedVideo::read(Stored::Protobuf, &video.encode_to_vec()).unwrap(), video);

        let raw = RawImage {
            timestamp,
            width: 1,
            height: 2,
            encoding: "rgb8".to_owned(),
            step: 3,
            data: vec![1, 2, 3, 4, 5, 6],
        };
        let mut behind = vec![1, 0, 0, 0, 2, 0, 0, 0, 5, 0, 0, 0];
        behind.extend(b"rgb8\0\0\0\0");
        behind.extend([3, 0, 0, 0, 6, 0, 0, 0, 1, 2, 3, 4, 5, 6]);
        assert_eq!(RawImage::read(Stored::Ros2, &ros2(&behind)).unwrap(), raw);
        assert_eq!(RawImage::read(Stored::Protobuf, &raw.encode_to_vec()).unwrap(), raw);
        for stored in [Stored::Ros2, Stored::Protobuf] {
            assert!(RawImage::read(stored, &[0xff, 1, 2]).is_err());
        }
    }
}
