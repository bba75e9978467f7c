//! Decodes H.264 from MP4 files.

use std::collections::VecDeque;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use mp4::{MediaType, Mp4Reader, TrackType};
use openh264::OpenH264API;
use openh264::decoder::{DecodedYUV, Decoder, DecoderConfig, Flush};
use openh264::formats::YUVSource;
use pdk_sdk::file;
use pdk_sdk::prelude::*;

use crate::bounded::Bounded;
use crate::convert::Yuv420;
use crate::index::{CUT_OFF, check_boxes, check_samples};

/// Profiles that the decoder knows: Baseline, Main, Extended and High. The others have more bits or more chroma.
const PROFILES: [u8; 4] = [66, 77, 88, 100];
/// Goes before every unit of a stream that is not in a container (ITU-T H.264, annex B).
const START_CODE: [u8; 4] = [0, 0, 0, 1];

/// Reads from a file or from memory.
pub trait Input: Read + Seek {}
impl<T: Read + Seek> Input for T {}

/// What became of opening a file.
pub enum Opened {
    /// Its frames can be read.
    Frames(Box<Reader>),
    /// It is a video of another codec, which the sentence part names.
    OtherCodec(String),
}

/// The frames of an MP4 file in the order in which they are shown.
pub struct Reader {
    mp4: Mp4Reader<Bounded>,
    decoder: Decoder,
    track: u32,
    /// Samples still to be decoded, by number from 1.
    samples: Box<dyn Iterator<Item = u32>>,
    count: u32,
    rate: f64,
    /// Bytes before each unit that hold its length.
    length_size: usize,
    /// Parameter sets of the stream, with start codes.
    headers: Vec<u8>,
    packet: Vec<u8>,
    /// Frames that the decoder gave back at the end.
    rest: Option<VecDeque<Yuv420>>,
    /// Only frames that can be decoded on their own are read, each by itself.
    alone: bool,
}

impl Reader {
    /// Opens a file to read all of its frames.
    ///
    /// # Errors
    /// Where it cannot be read, is no MP4 file, is cut off, or has no video that can be decoded here.
    pub fn open_file(path: &Path) -> Result<Box<Self>> {
        let (file, size) = file::open(path)?;
        match Self::open(Box::new(BufReader::new(file)), size, false)? {
            Opened::Frames(reader) => Ok(reader),
            Opened::OtherCodec(codec) => Err(only_h264(&codec)),
        }
    }

    /// Opens a file of `size` bytes. With `few`, up to three frames are read that can be decoded on their own: from the
    /// beginning, the middle and the end.
    ///
    /// # Errors
    /// Where it is no MP4 file, is cut off, or has no video.
    pub fn open(mut input: Box<dyn Input>, size: u64, few: bool) -> Result<Opened> {
        if let Some(other) = check_boxes(&mut input, size)? {
            return Ok(Opened::OtherCodec(other));
        }
        let (input, steps) = Bounded::new(input, size);
        let reader = match Mp4Reader::read_header(input, size) {
            Ok(reader) => reader,
            Err(_) if steps.are_used_up() => {
                return Err(Error::new("it is damaged: its index leads in circles; copy it again"));
            }
            Err(mp4::Error::BoxNotFound(mp4::BoxType::MoovBox) | mp4::Error::IoError(_)) => {
                return Err(Error::new(CUT_OFF));
            }
            Err(error) => {
                return Ok(Opened::OtherCodec(format!(
                    "MP4 or QuickTime of a kind that the built-in reader does not know ({error})"
                )));
            }
        };
        steps.lift();
        if reader.is_fragmented() {
            return Ok(Opened::OtherCodec("an MP4 file in fragments".to_owned()));
        }
        let mut tracks: Vec<_> = reader.tracks().values().collect();
        tracks.sort_by_key(|track| track.track_id());
        let video = tracks.into_iter().find(|track| matches!(track.track_type(), Ok(TrackType::Video)));
        let Some(track) = video else { return Err(Error::new("it has no video track")) };
        let tables = &track.trak.mdia.minf.stbl;
        let Some(format) = &tables.stsd.avc1 else {
            let codec = match track.media_type() {
                Ok(MediaType::H265) => "H.265",
                Ok(MediaType::VP9) => "VP9",
                _ => "another codec than H.264",
            };
            return Ok(Opened::OtherCodec(codec.to_owned()));
        };
        let sets = &format.avcc;
        if !PROFILES.contains(&sets.avc_profile_indication) {
            let profile = sets.avc_profile_indication;
            return Ok(Opened::OtherCodec(format!(
                "H.264 in profile {profile} with more than 8 bits or more than 4:2:0 chroma"
            )));
        }
        let mut headers = Vec::new();
        for set in sets.sequence_parameter_sets.iter().chain(&sets.picture_parameter_sets) {
            headers.extend_from_slice(&START_CODE);
            headers.extend_from_slice(&set.bytes);
        }
        let length_size = usize::from(sets.length_size_minus_one & 3) + 1;

        let (id, count) = (track.track_id(), track.sample_count());
        let header = &track.trak.mdia.mdhd;
        let seconds = header.duration as f64 / f64::from(header.timescale.max(1));
        if count == 0 || seconds <= 0.0 {
            return Err(Error::new("it has no frames"));
        }
        check_samples(track, size)?;
        let samples: Box<dyn Iterator<Item = u32>> = match (few, &tables.stss) {
            (true, Some(alone)) if !alone.entries.is_empty() => {
                let last = alone.entries.len() - 1;
                let mut few = vec![alone.entries[0], alone.entries[last / 2], alone.entries[last]];
                few.dedup();
                Box::new(few.into_iter())
            }
            (true, _) => Box::new(std::iter::once(1)),
            (false, _) => Box::new(1..=count),
        };
        Ok(Opened::Frames(Box::new(Self {
            mp4: reader,
            decoder: new_decoder()?,
            track: id,
            samples,
            count,
            rate: f64::from(count) / seconds,
            length_size,
            headers,
            packet: Vec::new(),
            rest: None,
            alone: few,
        })))
    }

    /// Puts a sample into `packet`, in the form of a stream. The parameter sets go before every sample that needs them.
    fn read_packet(&mut self, sample: u32) -> Result<()> {
        let missing = || {
            Error::new(format!("it is cut off: frame {sample} of {} is missing; copy it again", self.count))
        };
        let sample = self.mp4.read_sample(self.track, sample).ok().flatten().ok_or_else(missing)?;
        self.packet.clear();
        if sample.is_sync {
            self.packet.extend_from_slice(&self.headers);
        }
        let mut bytes = &sample.bytes[..];
        while bytes.len() > self.length_size {
            let (length, rest) = bytes.split_at(self.length_size);
            let length = length.iter().fold(0usize, |sum, &byte| sum << 8 | usize::from(byte));
            let unit = rest.get(..length).ok_or_else(missing)?;
            self.packet.extend_from_slice(&START_CODE);
            self.packet.extend_from_slice(unit);
            bytes = &rest[length..];
        }
        Ok(())
    }

    fn take_rest(&mut self) -> Result<VecDeque<Yuv420>> {
        let frames = self.decoder.flush_remaining().map_err(|error| damaged(&error))?;
        let copy = |frame: &DecodedYUV<'_>| {
            let mut picture = Yuv420::default();
            copy_planes(frame, &mut picture);
            picture
        };
        Ok(frames.iter().map(copy).collect())
    }

    /// Reads the next frame in the order in which they are shown; false at the end.
    ///
    /// # Errors
    /// Where the file is damaged or cut off.
    pub fn next(&mut self, into: &mut Yuv420) -> Result<bool> {
        while let Some(sample) = self.samples.next() {
            self.read_packet(sample)?;
            if self.alone {
                self.decoder = new_decoder()?;
            }
            let decoded = self.decoder.decode(&self.packet).map_err(|error| damaged(&error))?;
            if let Some(frame) = decoded {
                copy_planes(&frame, into);
                return Ok(true);
            }
            if self.alone
                && let Some(picture) = self.take_rest()?.pop_front()
            {
                *into = picture;
                return Ok(true);
            }
        }
        if self.rest.is_none() {
            let rest = if self.alone { VecDeque::new() } else { self.take_rest()? };
            self.rest = Some(rest);
        }
        let Some(picture) = self.rest.as_mut().and_then(VecDeque::pop_front) else { return Ok(false) };
        *into = picture;
        Ok(true)
    }

    /// Frames a second: how many there are, by how long they last.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Frames in the file, as its index says.
    pub fn count(&self) -> u32 {
        self.count
    }
}

/// What a file is by its first bytes, where that is a video.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Container {
    /// MP4 or QuickTime, which [`Reader`] opens.
    Mp4,
    /// Another one, by name.
    Other(&'static str),
}

/// Tells by its first bytes, at least 12 where it has them, whether a file is a video.
pub fn container(head: &[u8]) -> Option<Container> {
    match head {
        // Pictures in a box format.
        [_, _, _, _, b'f', b't', b'y', b'p', b'a', b'v', b'i', b'f' | b's', ..]
        | [_, _, _, _, b'f', b't', b'y', b'p', b'h', b'e', b'i', _, ..]
        | [_, _, _, _, b'f', b't', b'y', b'p', b'm', b'i', b'f', b'1', ..] => None,
        [_, _, _, _, b'f', b't', b'y', b'p', ..]
        | [_, _, _, _, b'm', b'o', b'o', b'v', ..]
        | [_, _, _, _, b'm', b'd', b'a', b't', ..]
        | [_, _, _, _, b'w', b'i', b'd', b'e', ..] => Some(Container::Mp4),
        [0x1a, 0x45, 0xdf, 0xa3, ..] => Some(Container::Other("Matroska or WebM")),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'A', b'V', b'I', ..] => Some(Container::Other("AVI")),
        _ => None,
    }
}

/// The error for a video of another kind, which the sentence part names.
pub fn only_h264(kind: &str) -> Error {
    Error::new(format!(
        "it is {kind}, but only H.264 in MP4 can be read; convert it, such as with `ffmpeg -i VIDEO -c:v libx264 \
         -pix_fmt yuv420p OUT.mp4`"
    ))
}

fn new_decoder() -> Result<Decoder> {
    // With frames that are shown in another order than they are stored, the decoder must not be emptied in between.
    let config = DecoderConfig::new().flush_after_decode(Flush::NoFlush);
    Decoder::with_api_config(OpenH264API::from_source(), config)
        .map_err(|error| Error::new(format!("the H.264 decoder does not start: {error}")))
}

fn damaged(error: &openh264::Error) -> Error {
    Error::new(format!("its H.264 is damaged, or uses what the built-in decoder does not know ({error})"))
}

fn copy_planes(frame: &DecodedYUV<'_>, into: &mut Yuv420) {
    let (width, height) = frame.dimensions();
    into.reset(width, height);
    let strides = frame.strides();
    let [luma, blue, red] = into.planes_mut();
    for (plane, from, stride, width) in [
        (luma, frame.y(), strides.0, width),
        (blue, frame.u(), strides.1, width.div_ceil(2)),
        (red, frame.v(), strides.2, width.div_ceil(2)),
    ] {
        for (row, from) in plane.chunks_exact_mut(width).zip(from.chunks(stride)) {
            row.copy_from_slice(&from[..width]);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::Writer;

    /// A clip with a light square that goes to the right, four pixels a frame, over a colour that changes with the frame.
    fn picture(number: usize) -> FrameBuf {
        let mut frame = FrameBuf::new(96, 64);
        let mut view = frame.as_mut();
        for y in 0..64 {
            for (x, pixel) in view.row_mut(y).chunks_exact_mut(3).enumerate() {
                let inside = (16..32).contains(&y) && (4 * number..4 * number + 16).contains(&x);
                pixel.copy_from_slice(&if inside {
                    [250, 240, 40]
                } else {
                    [30, 60 + 4 * number as u8, 160]
                });
            }
        }
        frame
    }

    fn clip(folder: &Path, frames: usize, rate: f64) -> std::path::PathBuf {
        let path = folder.join("clip.mp4");
        let mut writer = Writer::create(&path, 96, 64, rate).unwrap();
        for number in 0..frames {
            writer.push(picture(number).as_ref()).unwrap();
        }
        writer.finish().unwrap();
        path
    }

    #[test]
    fn what_was_written_is_read_back_in_order_and_in_colour() {
        let folder = tempfile::tempdir().unwrap();
        let mut reader = Reader::open_file(&clip(folder.path(), 20, 10.0)).unwrap();
        assert_eq!((reader.count(), reader.rate()), (20, 10.0));
        let (mut planes, mut rgb) = (Yuv420::default(), FrameBuf::new(96, 64));
        for number in 0..20 {
            assert!(reader.next(&mut planes).unwrap(), "{number}");
            planes.to_rgb(rgb.as_mut());
            let wanted = picture(number);
            let differences = rgb.data().iter().zip(wanted.data()).map(|(a, b)| u64::from(a.abs_diff(*b)));
            let mean = differences.sum::<u64>() as f64 / wanted.data().len() as f64;
            assert!(mean < 3.0, "frame {number}: {mean}");
            // In the middle of the square, where nothing is mixed.
            let (read, drawn) =
                (rgb.as_ref().pixel(4 * number + 8, 24), wanted.as_ref().pixel(4 * number + 8, 24));
            assert!(read.iter().zip(drawn).all(|(a, b)| a.abs_diff(b) <= 10), "frame {number}: {read:?}");
        }
        assert!(!reader.next(&mut planes).unwrap());
        assert!(!reader.next(&mut planes).unwrap());
    }

    #[test]
    fn rates_of_every_kind_come_back() {
        let folder = tempfile::tempdir().unwrap();
        for rate in [0.5, 12.5, 24_000.0 / 1001.0, 25.0, 30_000.0 / 1001.0, 60.0, 1000.0] {
            let reader = Reader::open_file(&clip(folder.path(), 12, rate)).unwrap();
            assert!((reader.rate() / rate - 1.0).abs() < 1e-4, "{rate}: {}", reader.rate());
        }
    }

    #[test]
    fn every_two_seconds_a_player_can_jump_to() {
        let folder = tempfile::tempdir().unwrap();
        let bytes = std::fs::read(clip(folder.path(), 20, 4.0)).unwrap();
        let mp4 = Mp4Reader::read_header(Cursor::new(&bytes), bytes.len() as u64).unwrap();
        let alone = &mp4.tracks()[&1].trak.mdia.minf.stbl.stss.as_ref().unwrap().entries;
        assert_eq!(alone, &[1, 9, 17]);
    }

    #[test]
    fn a_file_that_is_cut_off_anywhere_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = clip(folder.path(), 6, 25.0);
        let whole = std::fs::read(&path).unwrap();
        for length in (0..whole.len()).step_by(41).chain([whole.len() - 1]) {
            std::fs::write(&path, &whole[..length]).unwrap();
            let error = match Reader::open_file(&path) {
                Err(error) => error.to_string(),
                Ok(_) => panic!("{length} of {} bytes were opened", whole.len()),
            };
            assert!(error.starts_with("it is cut off"), "{length}: {error}");
        }
    }

    #[test]
    fn the_first_bytes_tell_what_a_file_is() {
        assert_eq!(container(b"\0\0\0\x18ftypisom\0"), Some(Container::Mp4));
        assert_eq!(container(b"\0\0\0\x18ftypqt  \0"), Some(Container::Mp4));
        assert_eq!(container(b"\x1a\x45\xdf\xa3\x01\0\0\0"), Some(Container::Other("Matroska or WebM")));
        assert_eq!(container(b"RIFF\x01\x02\x03\x04AVI LIST"), Some(Container::Other("AVI")));
        for none in
            [&b""[..], b"\0\0\0\x18ftypavif", b"\0\0\0\x18ftypheic", b"RIFF\x01\x02\x03\x04WEBP", b"\x89PNG"]
        {
            assert_eq!(container(none), None, "{none:?}");
        }
    }
}
