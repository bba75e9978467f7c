//! Decodes H.264 from MP4 files.

use std::collections::VecDeque;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use openh264::OpenH264API;
use openh264::decoder::{DecodedYUV, Decoder, DecoderConfig, Flush};
use openh264::formats::YUVSource;
use pdk_sdk::file;
use pdk_sdk::prelude::*;

use crate::convert::Yuv420;
use crate::index::{Index, Indexed, index};
use crate::sps::{Colours, colours};
use crate::turn::turn;

/// Goes before every unit of a stream that is not in a container (ITU-T H.264, annex B).
pub const START_CODE: [u8; 4] = [0, 0, 0, 1];

/// Options by which ffmpeg converts colours to those that [`Writer`](crate::Writer) writes.
const BT601: &str = "-vf scale=out_color_matrix=bt601:out_range=tv";

/// Reads from a file or from memory.
pub trait Input: Read + Seek + Send {}
impl<T: Read + Seek + Send> Input for T {}

/// The result of opening a file.
pub enum Opened {
    /// Its frames can be read.
    Frames(Box<Reader>),
    /// It is a video of another codec, which the sentence part names.
    OtherCodec(String),
}

/// The frames of an MP4 file in the order in which they are shown, held up as the file says, each with its time.
pub struct Reader {
    input: Box<dyn Input>,
    index: Index,
    decoder: Decoder,
    /// Samples still to be decoded, by their place in the index.
    samples: Box<dyn Iterator<Item = u32> + Send>,
    /// Frames that were decoded, shown or not.
    decoded: u32,
    /// The first of those that is given.
    from: u32,
    /// Memory for turning pictures.
    turned: Yuv420,
    /// Parameter sets of the stream, with start codes.
    headers: Vec<u8>,
    /// What they say about colours, which holds for the whole file.
    colours: Colours,
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
    /// If it cannot be read, is not an MP4 file, is cut off, or has no video that can be decoded here.
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
    /// If it is not an MP4 file, is cut off, or has no video.
    pub fn open(mut input: Box<dyn Input>, size: u64, few: bool) -> Result<Opened> {
        let index = match index(&mut input, size)? {
            Indexed::Own(index) => *index,
            Indexed::Other(what) => return Ok(Opened::OtherCodec(what)),
        };
        let mut headers = Vec::new();
        for set in &index.parameters {
            headers.extend_from_slice(&START_CODE);
            headers.extend_from_slice(set);
        }
        let count = index.samples.len() as u32;
        let samples: Box<dyn Iterator<Item = u32> + Send> = match few {
            true => {
                let alone: Vec<u32> =
                    (0..count).filter(|place| index.samples[*place as usize].alone).collect();
                let mut few = match (alone.first(), alone.last()) {
                    // All can, which says nothing: the file has no list of them.
                    (Some(first), _) if alone.len() == count as usize => vec![*first],
                    (Some(first), Some(last)) => vec![*first, alone[(alone.len() - 1) / 2], *last],
                    _ => vec![0],
                };
                few.dedup();
                Box::new(few.into_iter())
            }
            false => Box::new(0..count),
        };
        let from = index.timing.skipped;
        let mut reader = Box::new(Self {
            input,
            index,
            decoder: new_decoder()?,
            samples,
            decoded: 0,
            from,
            turned: Yuv420::default(),
            colours: colours(&headers).unwrap_or_default(),
            headers,
            packet: Vec::new(),
            rest: None,
            alone: few,
        });
        // The sets may also lie with the frames. What is wrong with the first one, reading it reports.
        if reader.read_packet(0).is_ok() {
            reader.colours = colours(&reader.packet).unwrap_or(reader.colours);
        }
        Ok(match reader.colours.coding() {
            Ok(_) => Opened::Frames(reader),
            Err(what) => Opened::OtherCodec(what),
        })
    }

    /// Goes to a frame, so that [`next`](Self::next) reads it: decoding begins at the last frame before it at which it can.
    ///
    /// # Errors
    /// If the decoder does not start.
    pub fn seek(&mut self, frame: u32) -> Result<()> {
        let Self { index, .. } = self;
        let begin = index.timing.before(frame, |place| index.samples[place as usize].alone);
        let from = frame.saturating_add(index.timing.skipped);
        // What lies ahead is decoded on, unless there is a shorter way.
        if self.decoded > from || begin > self.decoded {
            self.samples = Box::new(begin..index.samples.len() as u32);
            (self.decoder, self.rest, self.decoded) = (new_decoder()?, None, begin);
        }
        self.from = from;
        Ok(())
    }

    /// Puts a sample into `packet`, in the form of a stream. The parameter sets go before every sample that needs them.
    fn read_packet(&mut self, place: u32) -> Result<()> {
        let missing = || {
            let (number, count) = (place + 1, self.index.samples.len());
            Error::new(format!("it is cut off: frame {number} of {count} is missing; copy it again"))
        };
        let sample = self.index.samples[place as usize];
        // The index was compared with the size of the file, so that this is not more than the file has.
        let mut bytes = vec![0; sample.length as usize];
        let read =
            self.input.seek(SeekFrom::Start(sample.at)).and_then(|_| self.input.read_exact(&mut bytes));
        read.map_err(|_| missing())?;
        self.packet.clear();
        if sample.alone {
            self.packet.extend_from_slice(&self.headers);
        }
        let mut bytes = &bytes[..];
        while bytes.len() > self.index.length_size {
            let (length, rest) = bytes.split_at(self.index.length_size);
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
        let coding = self.colours.coding().unwrap_or_default();
        let copy = |frame: &DecodedYUV<'_>| {
            let mut picture = Yuv420::default();
            copy_planes(frame, &mut picture);
            picture.coding = coding;
            picture
        };
        Ok(frames.iter().map(copy).collect())
    }

    /// Reads the next frame in the order in which they are shown; false at the end.
    ///
    /// # Errors
    /// If the file is damaged or cut off.
    pub fn next(&mut self, into: &mut Yuv420) -> Result<bool> {
        let timing = &self.index.timing;
        let end = if self.alone { u32::MAX } else { timing.skipped + timing.count() };
        while self.decoded < end {
            // After an error, decoding begins anew if another frame is wanted.
            let decoded = self.decode(into).inspect_err(|_| self.decoded = u32::MAX)?;
            if !decoded {
                break;
            }
            self.decoded += 1;
            if self.alone || self.decoded > self.from {
                turn(into, self.index.quarters, &mut self.turned);
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Decodes the next frame; false at the end.
    fn decode(&mut self, into: &mut Yuv420) -> Result<bool> {
        while let Some(sample) = self.samples.next() {
            self.read_packet(sample)?;
            if colours(&self.packet).is_some_and(|colours| colours != self.colours) {
                return Err(Error::new(format!(
                    "its H.264 changes the matrix or the range of its colours at frame {}; convert it, such as with `ffmpeg -i VIDEO {BT601} \
                     -c:v libx264 -pix_fmt yuv420p OUT.mp4`",
                    sample + 1
                )));
            }
            if self.alone {
                self.decoder = new_decoder()?;
            }
            let decoded = self.decoder.decode(&self.packet).map_err(|error| damaged(&error))?;
            if let Some(frame) = decoded {
                copy_planes(&frame, into);
                into.coding = self.colours.coding().unwrap_or_default();
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

    /// Frames a second, on average: how many there are, by how long they last.
    pub fn rate(&self) -> f64 {
        f64::from(self.count()) / self.time(self.count())
    }

    /// Frames that are shown, as the file's index says.
    pub fn count(&self) -> u32 {
        self.index.timing.count()
    }

    /// When a frame begins, in seconds after the first one; that of [`count`](Self::count) is when the last one ends.
    pub fn time(&self, frame: u32) -> f64 {
        self.index.timing.time(frame)
    }

    /// Ticks a second: times of frames are whole numbers of them.
    pub fn scale(&self) -> u32 {
        self.index.timing.scale()
    }

    /// Whether the file has sound, which is not read.
    pub fn has_sound(&self) -> bool {
        self.index.has_sound
    }
}

/// Opens what is decoded here, and says what anything else is.
///
/// # Errors
/// If it is not a video, or is cut off.
pub fn opened(path: &Path) -> Result<Opened> {
    let (mut file, size) = file::open(path)?;
    let mut head = Vec::new();
    (&mut file).take(12).read_to_end(&mut head)?;
    file.rewind()?;
    match container(&head) {
        Some(Container::Mp4) => Reader::open(Box::new(BufReader::new(file)), size, false),
        Some(Container::Other(name)) => Ok(Opened::OtherCodec(name.to_owned())),
        None => Err(Error::new("it is not a video in MP4, QuickTime, Matroska, WebM or AVI")),
    }
}

/// What a file is by its first bytes, if that is a video.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Container {
    /// MP4 or QuickTime, which [`Reader`] opens.
    Mp4,
    /// Another one, by name.
    Other(&'static str),
}

/// Tells by its first bytes, at least 12 if it has them, whether a file is a video.
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
        "it is {kind}, but only H.264 in MP4 can be read; convert it, such as with `ffmpeg -i VIDEO {BT601} -c:v libx264 \
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

pub(crate) fn copy_planes(frame: &DecodedYUV<'_>, into: &mut Yuv420) {
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

    /// A copy of a clip with bytes behind the first of these names.
    fn changed(path: &Path, name: &[u8; 4], skip: usize, bytes: &[u8]) -> std::path::PathBuf {
        let mut whole = std::fs::read(path).unwrap();
        let at = whole.windows(4).rposition(|window| window == name).unwrap() + 4 + skip;
        whole[at..at + bytes.len()].copy_from_slice(bytes);
        let changed = path.with_extension("changed.mp4");
        std::fs::write(&changed, whole).unwrap();
        changed
    }

    fn numbers(numbers: &[i32]) -> Vec<u8> {
        numbers.iter().flat_map(|number| number.to_be_bytes()).collect()
    }

    /// All frames, and when each begins and the last one ends.
    fn whole(mut reader: Box<Reader>) -> (Vec<Yuv420>, Vec<f64>) {
        let (mut planes, mut frames) = (Yuv420::default(), Vec::new());
        while reader.next(&mut planes).unwrap() {
            frames.push(planes.clone());
        }
        assert_eq!(frames.len(), reader.count() as usize);
        let times = (0..=reader.count()).map(|frame| reader.time(frame)).collect();
        (frames, times)
    }

    /// Luma at a place.
    fn luma(frame: &Yuv420, x: usize, y: usize) -> u8 {
        frame.planes()[0][y * frame.width + x]
    }

    #[test]
    fn pictures_are_held_up_as_the_file_says() {
        const ONE: i32 = 1 << 16;
        let folder = tempfile::tempdir().unwrap();
        let path = clip(folder.path(), 3, 10.0);
        let (plain, times) = whole(Reader::open_file(&path).unwrap());
        // The matrices of the track and of the whole file, behind dates, numbers and a duration.
        let places = [(b"tkhd", 52), (b"mvhd", 48)];
        for (name, skip) in places {
            let turned = |matrix: [i32; 6]| Reader::open_file(&changed(&path, name, skip, &numbers(&matrix)));
            let right = whole(turned([0, ONE, 0, -ONE, 0, 0]).unwrap());
            let half = whole(turned([-ONE, 0, 0, 0, -ONE, 0]).unwrap());
            let left = whole(turned([0, -ONE, 0, ONE, 0, 0]).unwrap());
            for (number, plain) in plain.iter().enumerate() {
                let [right, half, left] = [&right, &half, &left].map(|video| &video.0[number]);
                assert_eq!((right.width, right.height, left.width, half.width), (64, 96, 64, 96));
                for (x, y) in [(0, 0), (95, 0), (4 * number + 8, 24), (17, 40)] {
                    let value = luma(plain, x, y);
                    let values = [luma(right, 63 - y, x), luma(half, 95 - x, 63 - y), luma(left, y, 95 - x)];
                    assert_eq!(values, [value; 3], "{x} {y}");
                }
            }
            assert_eq!(right.1, times);
            let mirrored = turned([-ONE, 0, 0, 0, ONE, 0]).err().unwrap().to_string();
            assert!(mirrored.contains("mirrored") && mirrored.contains("ffmpeg -i"), "{mirrored}");
        }
    }

    #[test]
    fn frames_have_the_times_that_they_were_written_with() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("clip.mp4");
        let ends = [0.1, 0.5, 0.54, 0.6];
        let mut writer = Writer::create(&path, 96, 64, 4.0 / 0.6).unwrap();
        for (number, end) in ends.into_iter().enumerate() {
            writer.push_until(picture(number).as_ref(), end).unwrap();
        }
        let error = writer.push_until(picture(4).as_ref(), 0.3).unwrap_err().to_string();
        assert!(error.ends_with("frame 4 cannot be shown from second 0.6 to second 0.3"), "{error}");
        writer.finish().unwrap();
        let reader = Reader::open_file(&path).unwrap();
        assert!((reader.rate() - 4.0 / 0.6).abs() < 1e-9 && !reader.has_sound());
        assert_eq!(whole(reader).1, [0.0, 0.1, 0.5, 0.54, 0.6]);
    }

    #[test]
    fn frames_that_are_stored_in_another_order_have_the_times_at_which_they_are_shown() {
        let folder = tempfile::tempdir().unwrap();
        let path = clip(folder.path(), 4, 10.0);
        let plain = whole(Reader::open_file(&path).unwrap()).1;
        assert_eq!(plain, [0.0, 0.1, 0.2, 0.3, 0.4]);
        // Every frame 200 ms late, and the second and third exchanged, as encoders do.
        let offsets = numbers(&[0, 4, 1, 18_000, 1, 27_000, 1, 9_000, 1, 18_000]);
        let late = with_box(&path, &[b"moov", b"trak", b"mdia", b"minf", b"stbl"], b"ctts", &offsets);
        assert_eq!(whole(Reader::open_file(&late).unwrap()).1, plain);
        let edits = |entries: &[i32]| {
            let list =
                [&numbers(&[entries.len() as i32 / 3 * 12 + 16]), &b"elst"[..], &numbers(&[0])].concat();
            let list = [list, numbers(&[entries.len() as i32 / 3]), numbers(entries)].concat();
            Reader::open_file(&with_box(&late, &[b"moov", b"trak"], b"edts", &list))
        };
        // Parts are a length, in ticks of the file, a beginning and a rate.
        const RATE: i32 = 1 << 16;
        assert_eq!(whole(edits(&[36_000, 18_000, RATE]).unwrap()).1, plain);
        // A beginning without pictures does not count; a second and a half after the end the last one is still shown.
        let longer = edits(&[9_000, -1, RATE, 171_000, 18_000, RATE]).unwrap();
        assert_eq!(whole(longer).1, [0.0, 0.1, 0.2, 0.3, 1.9]);
        // Cut on both sides.
        let (cut, times) = whole(edits(&[18_000, 27_000, RATE]).unwrap());
        assert_eq!(times, [0.0, 0.1, 0.2]);
        let all = whole(Reader::open_file(&path).unwrap()).0;
        assert_eq!(cut, all[1..3]);
        for (entries, reason) in [
            (
                &[36_000, 18_000, RATE / 2][..],
                "it is an MP4 file whose edit list plays it at another speed, but only",
            ),
            (
                &[9_000, 18_000, RATE, 9_000, 36_000, RATE],
                "it is an MP4 file whose edit list puts it together from several parts, but only",
            ),
            (&[9_000, 90_000, RATE], "its edit list leaves none of its frames"),
        ] {
            let said = edits(entries).err().unwrap().to_string();
            assert!(said.starts_with(reason), "{said}");
        }
    }

    #[test]
    fn frames_are_read_in_any_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = clip(folder.path(), 20, 4.0);
        let (all, _) = whole(Reader::open_file(&path).unwrap());
        let mut reader = Reader::open_file(&path).unwrap();
        let mut picture = Yuv420::default();
        for frame in [19, 0, 7, 8, 9, 17, 3, 3, 16, 18] {
            reader.seek(frame).unwrap();
            assert!(reader.next(&mut picture).unwrap());
            assert!(picture == all[frame as usize], "frame {frame}");
        }
        // On from there to the end, and behind it.
        assert!(reader.next(&mut picture).unwrap() && picture == all[19]);
        assert!(!reader.next(&mut picture).unwrap());
        reader.seek(20).unwrap();
        assert!(!reader.next(&mut picture).unwrap());
    }

    #[test]
    fn sound_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = clip(folder.path(), 3, 10.0);
        let bytes = std::fs::read(&path).unwrap();
        let at = bytes.windows(4).rposition(|window| window == b"trak").unwrap();
        let length = u32::from_be_bytes(bytes[at - 4..at].try_into().unwrap()) as usize;
        // The same track again, as one of sound.
        let mut track = bytes[at + 4..at - 4 + length].to_vec();
        let name = |track: &[u8], name: &[u8; 4]| track.windows(4).position(|window| window == name).unwrap();
        let number = name(&track, b"tkhd") + 24;
        track[number..number + 4].copy_from_slice(&2u32.to_be_bytes());
        let handler = name(&track, b"vide");
        track[handler..handler + 4].copy_from_slice(b"soun");
        let heard = Reader::open_file(&with_box(&path, &[b"moov"], b"trak", &track)).unwrap();
        assert!(heard.has_sound() && heard.count() == 3);
        assert_eq!(whole(heard), whole(Reader::open_file(&path).unwrap()));
    }

    /// A copy of a file with another box at the end of the one to which this path leads; the index lies behind the frames.
    fn with_box(path: &Path, within: &[&[u8; 4]], name: &[u8; 4], content: &[u8]) -> std::path::PathBuf {
        let mut bytes = std::fs::read(path).unwrap();
        let added = [&numbers(&[content.len() as i32 + 8])[..], name, content].concat();
        let (mut from, mut end) = (0, 0);
        for name in within {
            let at = from + bytes[from..].windows(4).position(|window| window == *name).unwrap();
            let length = u32::from_be_bytes(bytes[at - 4..at].try_into().unwrap());
            bytes[at - 4..at].copy_from_slice(&(length + added.len() as u32).to_be_bytes());
            (from, end) = (at, at - 4 + length as usize);
        }
        bytes.splice(end..end, added);
        let changed = path.with_extension("more.mp4");
        std::fs::write(&changed, bytes).unwrap();
        changed
    }

    #[test]
    fn every_two_seconds_a_player_can_jump_to() {
        let folder = tempfile::tempdir().unwrap();
        let bytes = std::fs::read(clip(folder.path(), 20, 4.0)).unwrap();
        let Indexed::Own(index) = index(&mut Cursor::new(&bytes), bytes.len() as u64).unwrap() else {
            panic!("it is another codec")
        };
        let alone: Vec<_> = (0..20).filter(|place| index.samples[*place].alone).collect();
        assert_eq!(alone, [0, 8, 16]);
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
