//! Encodes frames as H.264 and puts them into an MP4 file.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use pdk_sdk::error::Place;
use pdk_sdk::file;
use pdk_sdk::prelude::*;

use crate::container::Mp4;
use crate::encoder::Encoder;

/// Ticks a second in the file: frame rates such as 24, 25, 30 and 30000/1001 have a whole number of them in a frame.
const TIMESCALE: u32 = 90_000;
/// Seconds from one frame that can be decoded alone to the next: where a player can jump to.
const SECONDS_BETWEEN_KEYS: f64 = 2.0;

/// Writes frames of equal size to an MP4 file that players and browsers show.
///
/// Until [`finish`](Self::finish) the file has the number of this process and `.part` behind its name; without it nothing is left.
pub struct Writer {
    path: PathBuf,
    part: PathBuf,
    /// None once the file is complete.
    mp4: Option<Mp4<BufWriter<File>>>,
    encoder: Encoder,
    /// Ticks a second.
    scale: u32,
    rate: f64,
    frames: u64,
    /// When the last frame ends, in ticks.
    end: u64,
}

impl Writer {
    /// Begins a file. Width and height are even numbers of pixels from 16, because chroma has half of them; the rate is in
    /// frames a second, above 0 and at most 1000. Folders on the way are made.
    ///
    /// # Errors
    /// If the size or the rate is another one, or the file cannot be written.
    pub fn create(
        path: impl AsRef<Path>,
        width: usize,
        height: usize,
        frames_per_second: f64,
    ) -> Result<Self> {
        Self::with_scale(path, width, height, frames_per_second, TIMESCALE)
    }

    /// Begins a file as [`create`](Self::create) does, whose times are whole numbers of ticks, of which there are `scale` in a second.
    ///
    /// # Errors
    /// As [`create`](Self::create).
    pub fn with_scale(
        path: impl AsRef<Path>,
        width: usize,
        height: usize,
        frames_per_second: f64,
        scale: u32,
    ) -> Result<Self> {
        let path = path.as_ref().to_owned();
        Self::begin(&path, [width, height], frames_per_second, scale).place(place(&path))
    }

    fn begin(path: &Path, [width, height]: [usize; 2], rate: f64, scale: u32) -> Result<Self> {
        if !(rate > 0.0 && rate <= 1000.0) {
            return Err(Error::new(format!(
                "{rate} frames a second cannot be written: it has to be above 0 and at most 1000"
            )));
        }
        let rounded = (SECONDS_BETWEEN_KEYS * rate).round().max(1.0) as u32;
        let encoder = Encoder::new(width, height, rate, rounded)?;

        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let part = file::part_of(path);
        let mp4 = Mp4::begin(BufWriter::new(File::create(&part)?), scale)?;
        Ok(Self { path: path.to_owned(), part, mp4: Some(mp4), encoder, scale, rate, frames: 0, end: 0 })
    }

    /// Writes the next frame, at the rate of the file.
    ///
    /// # Errors
    /// If the frame has another size than the file, or cannot be encoded or written.
    pub fn push(&mut self, frame: Frame<'_>) -> Result<()> {
        // Rounded anew for each, so that no error adds up.
        let end = ((self.frames + 1) as f64 * f64::from(self.scale) / self.rate).round() as u64;
        self.write(frame, end).place(place(&self.path))
    }

    /// Writes the next frame, which is shown until this many seconds after the beginning of the video: for frames that do not come
    /// at a fixed rate.
    ///
    /// # Errors
    /// As [`push`](Self::push), and if it would end before it begins or last longer than a file can say.
    pub fn push_until(&mut self, frame: Frame<'_>, seconds: f64) -> Result<()> {
        let end = (seconds * f64::from(self.scale)).round() as u64;
        self.write(frame, end).place(place(&self.path))
    }

    fn write(&mut self, frame: Frame<'_>, end: u64) -> Result<()> {
        let [width, height] = self.encoder.size();
        if [frame.width(), frame.height()] != [width, height] {
            let (w, h) = (frame.width(), frame.height());
            return Err(Error::new(format!(
                "frame {} is {w} x {h}, but the video is {width} x {height}",
                self.frames
            )));
        }
        let duration = end.checked_sub(self.end).and_then(|duration| u32::try_from(duration).ok());
        let duration = duration.ok_or_else(|| {
            let [start, end] = [self.end, end].map(|ticks| ticks as f64 / f64::from(self.scale));
            Error::new(format!("frame {} cannot be shown from second {start} to second {end}", self.frames))
        })?;
        let Some(mp4) = &mut self.mp4 else { return Err(Error::new("it is complete already")) };
        let units = self.encoder.encode(frame, false)?;
        let mut bytes = Vec::new();
        for unit in &units.slices {
            bytes.extend_from_slice(&(unit.len() as u32).to_be_bytes());
            bytes.extend_from_slice(unit);
        }
        if self.frames == 0 {
            let [Some(sequence), Some(picture)] = &units.parameters else {
                return Err(Error::new("the encoder gives no parameter sets"));
            };
            mp4.describe(width as u16, height as u16, sequence, picture)?;
        }
        mp4.add(&bytes, duration, units.alone)?;
        (self.frames, self.end) = (self.frames + 1, end);
        Ok(())
    }

    /// Frames written so far.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Completes the file and gives it its name; what had it is replaced.
    ///
    /// # Errors
    /// If no frame was written, or the file cannot be completed.
    pub fn finish(mut self) -> Result<()> {
        let place = place(&self.path);
        self.complete().place(place)
    }

    fn complete(&mut self) -> Result<()> {
        if self.frames == 0 {
            return Err(Error::new("a video has at least one frame"));
        }
        let Some(mp4) = self.mp4.take() else { return Ok(()) };
        let completed = mp4.finish().and_then(|file| {
            let file = file.into_inner().map_err(|error| Error::from(error.into_error()))?;
            file.sync_all()?;
            Ok(std::fs::rename(&self.part, &self.path)?)
        });
        if completed.is_err() {
            self.remove();
        }
        completed
    }

    /// Removes an unfinished file. If that fails too, the file that stays is not a video.
    fn remove(&self) {
        let _ = std::fs::remove_file(&self.part);
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        if self.mp4.is_some() {
            self.remove();
        }
    }
}

fn place(path: &Path) -> String {
    format!("cannot write the video {}", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, height: usize, number: usize) -> FrameBuf {
        let bytes = (0..width * height).flat_map(|i| {
            let (x, y) = (i % width, i / width);
            [(x * 4 + number * 9) as u8, (y * 3) as u8, ((x * y) / 8 + number) as u8]
        });
        FrameBuf::from_vec(bytes.collect(), width, height).unwrap()
    }

    fn write(path: &Path, (width, height): (usize, usize), frames: usize, rate: f64) -> Result<()> {
        let mut writer = Writer::create(path, width, height, rate)?;
        for number in 0..frames {
            writer.push(picture(width, height, number).as_ref())?;
        }
        writer.finish()
    }

    fn names(folder: &Path) -> Vec<String> {
        let name =
            |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
        let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(name).collect();
        names.sort();
        names
    }

    #[test]
    fn the_same_frames_give_the_same_bytes_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let files = ["a.mp4", "deeper/b.mp4"].map(|name| folder.path().join(name));
        for file in &files {
            write(file, (64, 48), 12, 12.5).unwrap();
        }
        assert_eq!(std::fs::read(&files[0]).unwrap(), std::fs::read(&files[1]).unwrap());
        assert_eq!(names(folder.path()), ["a.mp4", "deeper"]);
        assert_eq!(names(&folder.path().join("deeper")), ["b.mp4"]);
    }

    #[test]
    fn what_is_not_finished_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mp4");
        let mut writer = Writer::create(&path, 64, 48, 30.0).unwrap();
        writer.push(picture(64, 48, 0).as_ref()).unwrap();
        assert_eq!(names(folder.path()), [format!("a.mp4.{}.part", std::process::id())]);
        let error = writer.push(picture(32, 48, 0).as_ref()).unwrap_err().to_string();
        assert!(error.ends_with("frame 1 is 32 x 48, but the video is 64 x 48"), "{error}");
        drop(writer);
        assert!(names(folder.path()).is_empty());

        let error = write(&path, (64, 48), 0, 30.0).unwrap_err().to_string();
        assert!(error.ends_with("a video has at least one frame"), "{error}");
        assert!(names(folder.path()).is_empty());
        assert!(write(&folder.path().join("a\0b"), (64, 48), 1, 30.0).is_err());
    }

    #[test]
    fn a_failed_write_is_reported_with_its_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mp4");
        let error = |size, rate| write(&path, size, 1, rate).unwrap_err().to_string();
        let odd = error((63, 48), 30.0);
        assert!(odd.ends_with("pad or scale the frames to 64 x 48"), "{odd}");
        assert!(odd.starts_with(&format!("cannot write the video {}", path.display())), "{odd}");
        assert!(error((8, 48), 30.0).ends_with("to 16 x 48"));
        assert!(error((3842, 48), 30.0).contains("at most 3840 x 2160"));
        assert!(error((2162, 2162), 30.0).contains("at most 3840 x 2160"));
        for rate in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e6] {
            assert!(error((64, 48), rate).contains("frames a second cannot be written"));
        }
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn the_smallest_and_the_largest_sizes_are_encoded() {
        let folder = tempfile::tempdir().unwrap();
        for size in [(16, 16), (16, 3840), (3840, 16), (18, 22), (3840, 2160)] {
            write(&folder.path().join("a.mp4"), size, 2, 30.0).unwrap_or_else(|e| panic!("{size:?}: {e}"));
        }
    }
}
