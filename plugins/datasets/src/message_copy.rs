//! Messages with another picture or with steering of the other sign in them, all else being as it was.

use std::path::Path;

use pdk_sdk::prelude::*;

use crate::cdr::{self, Cdr};
use crate::foxglove::{CompressedImage, Foxglove, RawImage, Stored};
use crate::message::{Numbers, Picture};
use crate::protobuf;
use crate::raw::Raw;

impl Picture {
    /// How pictures of this kind are stored in a copy, for people.
    pub fn stored_as(self) -> String {
        match self {
            Self::Compressed | Self::FoxgloveCompressed(_) => {
                "each picture in the format that it has; JPEG has the quality of the settings and is lossy"
                    .to_owned()
            }
            Self::Image | Self::FoxgloveRaw(_) => {
                "pixels without compression, in the encoding that they have".to_owned()
            }
            Self::FoxgloveVideo(_) => pdk_video::Encoder::describe(),
        }
    }

    /// A message with another picture of the same size, which is stored as the one before.
    ///
    /// # Errors
    /// If the message is damaged, or is a picture of a video.
    pub fn with_picture(self, message: &[u8], frame: Frame<'_>, quality: u8) -> Result<Vec<u8>> {
        match self {
            Self::Compressed => {
                let mut cdr = Cdr::new(message)?;
                cdr.header()?;
                cdr.text()?;
                let place = cdr.place();
                cdr::with_bytes(message, place, &like(cdr.bytes()?, frame, quality)?)
            }
            Self::Image => {
                let mut cdr = Cdr::new(message)?;
                cdr.header()?;
                let (height, width) = (cdr.u32()?, cdr.u32()?);
                let encoding = cdr.text()?;
                cdr.byte()?;
                let step = cdr.u32()?;
                let place = cdr.place();
                let raw = Raw { width, height, encoding, step, data: cdr.bytes()? };
                cdr::with_bytes(message, place, &raw.with_picture(frame)?)
            }
            Self::FoxgloveCompressed(stored) => {
                let before = CompressedImage::read(stored, message)?;
                self.with_data(message, &like(&before.data, frame, quality)?)
            }
            Self::FoxgloveRaw(stored) => {
                let RawImage { width, height, encoding, step, data, .. } = RawImage::read(stored, message)?;
                let raw = Raw { width, height, encoding: &encoding, step, data: &data };
                self.with_data(message, &raw.with_picture(frame)?)
            }
            Self::FoxgloveVideo(_) => Err(Error::new("a picture of a video needs those before it")),
        }
    }

    /// A message of Foxglove with other data.
    ///
    /// # Errors
    /// If the message is damaged, or is not one of Foxglove.
    pub fn with_data(self, message: &[u8], data: &[u8]) -> Result<Vec<u8>> {
        let (stored, number) = match self {
            Self::FoxgloveCompressed(stored) => (stored, 2),
            Self::FoxgloveRaw(stored) => (stored, 6),
            Self::FoxgloveVideo(stored) => (stored, 3),
            Self::Compressed | Self::Image => return Err(Error::new("it is not a message of Foxglove")),
        };
        if stored == Stored::Protobuf {
            return protobuf::with_bytes(message, number, data);
        }
        let mut cdr = Cdr::new(message)?;
        cdr.header()?;
        if matches!(self, Self::FoxgloveRaw(_)) {
            cdr.u32()?;
            cdr.u32()?;
            cdr.text()?;
            cdr.u32()?;
        }
        cdr::with_bytes(message, cdr.place(), data)
    }
}

/// A frame in the format of a picture.
fn like(picture: &[u8], frame: Frame<'_>, quality: u8) -> Result<Vec<u8>> {
    let name = match picture {
        [0xff, 0xd8, ..] => "picture.jpg",
        [0x89, b'P', b'N', b'G', ..] => "picture.png",
        [b'B', b'M', ..] => "picture.bmp",
        _ => "picture.webp",
    };
    let before = pdk_image::decode(picture)?.color();
    if before.bytes_per_pixel() > before.channel_count() {
        return Err(Error::new(
            "its pixels have more than 8 bits a channel, which a copy would not have; convert the topic",
        ));
    }
    pdk_image::encode(Path::new(name), frame, quality)
}

impl Numbers {
    /// A message in which the steering has the other sign.
    ///
    /// # Errors
    /// If the message is damaged, or has no steering.
    pub fn with_other_sign(self, message: &[u8]) -> Result<Vec<u8>> {
        let mut signs = Vec::new();
        match self {
            Self::Control => return protobuf::with_other_sign(message, 1),
            Self::State => return Err(Error::new("it has no steering")),
            Self::Float32 => signs.push(Cdr::new(message)?.pass_sign(4)?),
            Self::Float64 => signs.push(Cdr::new(message)?.pass_sign(8)?),
            Self::Twist(has_header) => {
                let mut cdr = Cdr::new(message)?;
                if has_header {
                    cdr.header()?;
                }
                for _ in 0..5 {
                    cdr.pass_sign(8)?;
                }
                signs.push(cdr.pass_sign(8)?);
            }
            Self::Ackermann(has_header) => {
                let mut cdr = Cdr::new(message)?;
                if has_header {
                    cdr.header()?;
                }
                // The angle, and how fast it changes.
                signs.extend([cdr.pass_sign(4)?, cdr.pass_sign(4)?]);
            }
        }
        let mut turned = message.to_vec();
        signs.into_iter().for_each(|place| turned[place] ^= 0x80);
        Ok(turned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message;

    #[test]
    fn steering_has_the_other_sign_and_the_rest_stays() {
        let header = [&[0, 1, 0, 0, 7, 0, 0, 0, 9, 0, 0, 0, 4, 0, 0, 0][..], b"cam\0"].concat();
        let with = |head: &[u8], numbers: &[f64], bytes: usize| {
            let mut message = head.to_vec();
            message.resize(4 + (message.len() - 4).next_multiple_of(bytes), 0);
            for number in numbers {
                match bytes {
                    4 => message.extend((*number as f32).to_le_bytes()),
                    _ => message.extend(number.to_le_bytes()),
                }
            }
            message
        };
        let bare = &header[..4];
        let twist = [1.5, 2.0, 3.0, 4.0, 5.0, 0.25];
        let mirrored = [1.5, 2.0, 3.0, 4.0, 5.0, -0.25];
        let (drive, turned) = ([0.5, 1.0, 3.0, 2.0, 1.0], [-0.5, -1.0, 3.0, 2.0, 1.0]);
        for (kind, before, after) in [
            (Numbers::Float32, with(bare, &[-0.5], 4), with(bare, &[0.5], 4)),
            (Numbers::Float64, with(bare, &[0.5], 8), with(bare, &[-0.5], 8)),
            (Numbers::Twist(false), with(bare, &twist, 8), with(bare, &mirrored, 8)),
            (Numbers::Twist(true), with(&header, &twist, 8), with(&header, &mirrored, 8)),
            (Numbers::Ackermann(false), with(bare, &drive, 4), with(bare, &turned, 4)),
            (Numbers::Ackermann(true), with(&header, &drive, 4), with(&header, &turned, 4)),
        ] {
            assert_eq!(kind.with_other_sign(&before).unwrap(), after, "{kind:?}");
            assert_eq!(kind.read(&before).unwrap().first, -kind.read(&after).unwrap().first, "{kind:?}");
            assert!(kind.with_other_sign(&before[..6]).is_err());
        }
    }

    #[test]
    fn messages_of_foxglove_have_another_picture_in_either_form() {
        let timestamp = Some(crate::foxglove::Timestamp { seconds: 7, nanos: 9 });
        let raw = RawImage {
            timestamp,
            width: 1,
            height: 2,
            encoding: "bgr8".to_owned(),
            step: 3,
            data: vec![1, 2, 3, 4, 5, 6],
        };
        let mut ros2 = [&[0, 1, 0, 0, 7, 0, 0, 0, 9, 0, 0, 0, 4, 0, 0, 0][..], b"cam\0"].concat();
        ros2.extend([1, 0, 0, 0, 2, 0, 0, 0, 5, 0, 0, 0]);
        ros2.extend(b"bgr8\0\0\0\0");
        ros2.extend([3, 0, 0, 0, 6, 0, 0, 0, 1, 2, 3, 4, 5, 6]);
        let frame = FrameBuf::from_vec(vec![10, 20, 30, 40, 50, 60], 1, 2).unwrap();
        let expected = RawImage { data: vec![30, 20, 10, 60, 50, 40], ..raw.clone() };
        for (stored, message) in [(Stored::Protobuf, raw.encode_to_vec()), (Stored::Ros2, ros2)] {
            let written = Picture::FoxgloveRaw(stored).with_picture(&message, frame.as_ref(), 95).unwrap();
            assert_eq!(RawImage::read(stored, &written).unwrap(), expected);
            assert_eq!(written.len(), message.len());
        }
        let picture = pdk_image::encode(Path::new("a.png"), frame.as_ref(), 95).unwrap();
        let before = CompressedImage { timestamp, data: picture.clone() };
        let other = FrameBuf::from_vec(vec![9; 6], 1, 2).unwrap();
        let kind = Picture::FoxgloveCompressed(Stored::Protobuf);
        let written = kind.with_picture(&before.encode_to_vec(), other.as_ref(), 95).unwrap();
        assert_eq!(kind.decode(&written).unwrap(), other);
        assert!(kind.with_picture(&[0xff, 1, 2], other.as_ref(), 95).is_err());
    }
}
