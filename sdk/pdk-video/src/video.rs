//! Any video as frames: decoded here if it is H.264 in MP4, and else by the program ffmpeg.

use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;

use crate::convert::Yuv420;
use crate::ffmpeg::{Ffmpeg, MOST, PROGRAM, times};
use crate::reader::{Opened, Reader, opened};
use crate::recode::Recoding;

/// The frames of a video in the order in which they are shown, each with its time.
pub struct Video(Source);

enum Source {
    Own(Box<Reader>),
    Other(Box<Other>),
}

/// A video that ffmpeg decodes.
struct Other {
    path: PathBuf,
    codec: String,
    /// When each frame begins, and behind them when the last one ends.
    times: Vec<f64>,
    /// None before the first frame is wanted.
    running: Option<Ffmpeg>,
    /// The frame that it gives next.
    next: u32,
    /// The frame that is wanted next.
    wanted: u32,
}

impl Video {
    /// Opens a video.
    ///
    /// # Errors
    /// If it is not a video, is cut off, or needs ffmpeg, and ffmpeg is missing or cannot decode it.
    pub fn open(path: &Path) -> Result<Self> {
        let codec = match opened(path)? {
            Opened::Frames(reader) => return Ok(Self(Source::Own(reader))),
            Opened::OtherCodec(codec) => codec,
        };
        let times = times(Path::new(PROGRAM), path, &codec)?;
        Ok(Self::by_ffmpeg(path, codec, times))
    }

    /// A video whose frames have their times in another file, such as a stream of H.265 without a container, which `codec` names.
    /// `times` has the beginning of each frame in seconds after the first one, and behind them the end of the last one. ffmpeg decodes it.
    ///
    /// # Errors
    /// If there are no frames, or too many.
    pub fn with_times(path: &Path, codec: &str, times: Vec<f64>) -> Result<Self> {
        if !(2..=MOST).contains(&times.len()) {
            return Err(Error::new(format!(
                "its times are those of {} frames",
                times.len().saturating_sub(1)
            )));
        }
        Ok(Self::by_ffmpeg(path, codec.to_owned(), times))
    }

    fn by_ffmpeg(path: &Path, codec: String, times: Vec<f64>) -> Self {
        let path = path.to_owned();
        Self(Source::Other(Box::new(Other { path, codec, times, running: None, next: 0, wanted: 0 })))
    }

    /// Reads the next frame; false at the end.
    ///
    /// # Errors
    /// If the video is damaged or cut off.
    pub fn next(&mut self, into: &mut Yuv420) -> Result<bool> {
        match &mut self.0 {
            Source::Own(reader) => reader.next(into),
            Source::Other(other) => other.next(into),
        }
    }

    /// Goes to a frame, so that [`next`](Self::next) reads it.
    ///
    /// # Errors
    /// If the decoder does not start.
    pub fn seek(&mut self, frame: u32) -> Result<()> {
        match &mut self.0 {
            Source::Own(reader) => reader.seek(frame),
            Source::Other(other) => {
                other.wanted = frame;
                Ok(())
            }
        }
    }

    /// How many frames are shown.
    pub fn count(&self) -> u32 {
        match &self.0 {
            Source::Own(reader) => reader.count(),
            Source::Other(other) => (other.times.len() - 1) as u32,
        }
    }

    /// When a frame begins, in seconds after the first one; that of [`count`](Self::count) is when the last one ends.
    pub fn time(&self, frame: u32) -> f64 {
        match &self.0 {
            Source::Own(reader) => reader.time(frame),
            Source::Other(other) => {
                let time = other.times.get(frame as usize).or(other.times.last());
                time.copied().unwrap_or_default()
            }
        }
    }

    /// Frames a second, on average.
    pub fn rate(&self) -> f64 {
        f64::from(self.count()) / self.time(self.count())
    }

    /// Whether the video is known to have sound, which is not read.
    pub fn has_sound(&self) -> bool {
        matches!(&self.0, Source::Own(reader) if reader.has_sound())
    }

    /// How it is written again, with other pictures.
    ///
    /// # Errors
    /// If its codec or its container is not written, or ffmpeg is missing that writes it.
    pub fn recoding(&self) -> Result<Recoding> {
        match &self.0 {
            Source::Own(reader) => Ok(Recoding::own(reader.scale())),
            Source::Other(other) => Recoding::other(&other.path, &other.codec),
        }
    }

    /// When each frame begins, in seconds after the first one, and behind them when the last one ends.
    pub fn times(&self) -> Vec<f64> {
        (0..=self.count()).map(|frame| self.time(frame)).collect()
    }

    /// What decodes the video, and why that is not pdk itself: for people.
    pub fn decoder(&self) -> String {
        match &self.0 {
            Source::Own(_) => "H.264 in MP4, decoded by pdk".to_owned(),
            Source::Other(other) => format!("{}, decoded by ffmpeg", other.codec),
        }
    }
}

impl Other {
    fn next(&mut self, into: &mut Yuv420) -> Result<bool> {
        let count = (self.times.len() - 1) as u32;
        if self.wanted >= count {
            return Ok(false);
        }
        // It cannot go back, so it begins anew.
        if self.next > self.wanted || self.running.is_none() {
            let ffmpeg = Ffmpeg::start(Path::new(PROGRAM), &self.path, &self.codec)?;
            (self.running, self.next) = (Some(ffmpeg), 0);
        }
        while let Some(ffmpeg) = &mut self.running {
            match ffmpeg.next(into) {
                Ok(true) if self.next == self.wanted => {
                    (self.next, self.wanted) = (self.next + 1, self.wanted + 1);
                    return Ok(true);
                }
                Ok(true) => self.next += 1,
                Ok(false) => {
                    self.running = None;
                    return Err(Error::new(format!(
                        "ffmpeg decodes {} of its {count} frames; copy the video again if it has changed meanwhile",
                        self.next
                    )));
                }
                Err(error) => {
                    self.running = None;
                    return Err(error);
                }
            }
        }
        Ok(false)
    }
}
