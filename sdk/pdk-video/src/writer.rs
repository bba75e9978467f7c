//! Encodes frames as H.264 and puts them into an MP4 file.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use openh264::OpenH264API;
use openh264::encoder::{
    BitRate, Complexity, Encoder, EncoderConfig, FrameRate, IntraFramePeriod, Profile, QpRange,
    RateControlMode, VuiConfig,
};
use openh264::formats::YUVSlices;
use pdk_sdk::error::Place;
use pdk_sdk::file;
use pdk_sdk::prelude::*;

use crate::container::Mp4;
use crate::convert::Yuv420;

/// Ticks a second in the file: frame rates such as 24, 25, 30 and 30000/1001 have a whole number of them in a frame.
const TIMESCALE: u32 = 90_000;
/// The quantiser of every frame, of 0 (best) to 51: noise and fine structure are what a perturbation is looked at for.
const QUANTISER: u8 = 20;
/// Seconds from one frame that can be decoded alone to the next: where a player can jump to.
const SECONDS_BETWEEN_KEYS: f64 = 2.0;
/// The smallest side in pixels that the encoder takes, and the longest of the longer and of the shorter side.
const SHORTEST: usize = 16;
const LONGEST: (usize, usize) = (3840, 2160);

/// Writes frames of equal size to an MP4 file that players and browsers show.
///
/// Until [`finish`](Self::finish) the file has the number of this process and `.part` behind its name; without it nothing is left.
pub struct Writer {
    path: PathBuf,
    part: PathBuf,
    /// None once the file is complete.
    mp4: Option<Mp4<BufWriter<File>>>,
    encoder: Encoder,
    width: usize,
    height: usize,
    rate: f64,
    frames: u64,
    /// When the last frame ends, in ticks.
    end: u64,
    planes: Yuv420,
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
        let path = path.as_ref().to_owned();
        Self::begin(&path, width, height, frames_per_second).place(place(&path))
    }

    fn begin(path: &Path, width: usize, height: usize, rate: f64) -> Result<Self> {
        if !(rate > 0.0 && rate <= 1000.0) {
            return Err(Error::new(format!(
                "{rate} frames a second cannot be written: it has to be above 0 and at most 1000"
            )));
        }
        check_size(width, height)?;
        let rounded = (SECONDS_BETWEEN_KEYS * rate).round().max(1.0) as u32;
        // Says only which level of the standard the file claims; what noise takes at this quantiser, and no more than the
        // highest level allows.
        let bits = (width as f64 * height as f64 * rate * 2.0).clamp(100_000.0, 240_000_000.0) as u32;
        // In this mode the quantiser is chosen by the frame, and here it has no choice. So nothing depends on how long
        // encoding takes.
        let config = EncoderConfig::new()
            .rate_control_mode(RateControlMode::Bufferbased)
            .bitrate(BitRate::from_bps(bits))
            .qp(QpRange::new(QUANTISER, QUANTISER))
            .max_frame_rate(FrameRate::from_hz(rate as f32))
            .intra_frame_period(IntraFramePeriod::from_num_frames(rounded))
            .complexity(Complexity::Low)
            .profile(Profile::Main)
            .vui(VuiConfig::bt601())
            .skip_frames(false)
            .scene_change_detect(false)
            .adaptive_quantization(false)
            .background_detection(false)
            .num_threads(1);
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config)
            .place("the H.264 encoder does not start")?;

        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let part = file::part_of(path);
        let mp4 = Mp4::begin(BufWriter::new(File::create(&part)?), TIMESCALE)?;
        Ok(Self {
            path: path.to_owned(),
            part,
            mp4: Some(mp4),
            encoder,
            width,
            height,
            rate,
            frames: 0,
            end: 0,
            planes: Yuv420::default(),
        })
    }

    /// Writes the next frame, at the rate of the file.
    ///
    /// # Errors
    /// If the frame has another size than the file, or cannot be encoded or written.
    pub fn push(&mut self, frame: Frame<'_>) -> Result<()> {
        // Rounded anew for each, so that no error adds up.
        let end = ((self.frames + 1) as f64 * f64::from(TIMESCALE) / self.rate).round() as u64;
        self.write(frame, end).place(place(&self.path))
    }

    /// Writes the next frame, which is shown until this many seconds after the beginning of the video: for frames that do not come
    /// at a fixed rate.
    ///
    /// # Errors
    /// As [`push`](Self::push), and if it would end before it begins or last longer than a file can say.
    pub fn push_until(&mut self, frame: Frame<'_>, seconds: f64) -> Result<()> {
        let end = (seconds * f64::from(TIMESCALE)).round() as u64;
        self.write(frame, end).place(place(&self.path))
    }

    fn write(&mut self, frame: Frame<'_>, end: u64) -> Result<()> {
        let (width, height) = (self.width, self.height);
        if (frame.width(), frame.height()) != (width, height) {
            let (w, h) = (frame.width(), frame.height());
            return Err(Error::new(format!(
                "frame {} is {w} x {h}, but the video is {width} x {height}",
                self.frames
            )));
        }
        let duration = end.checked_sub(self.end).and_then(|duration| u32::try_from(duration).ok());
        let duration = duration.ok_or_else(|| {
            let [start, end] = [self.end, end].map(|ticks| ticks as f64 / f64::from(TIMESCALE));
            Error::new(format!("frame {} cannot be shown from second {start} to second {end}", self.frames))
        })?;
        let Some(mp4) = &mut self.mp4 else { return Err(Error::new("it is complete already")) };
        self.planes.fill(frame);
        let [luma, blue, red] = self.planes.planes();
        let source = YUVSlices::new((luma, blue, red), (width, height), (width, width / 2, width / 2));
        let stream = self.encoder.encode(&source).place("the frame cannot be encoded")?;

        let mut parameters: [Option<Vec<u8>>; 2] = [None, None];
        let mut bytes = Vec::new();
        let mut alone = false;
        for layer in (0..stream.num_layers()).filter_map(|number| stream.layer(number)) {
            for unit in (0..layer.nal_count()).filter_map(|number| layer.nal_unit(number)) {
                let unit = without_start_code(unit);
                // The kinds of ITU-T H.264, table 7-1; parameter sets are in the file's header.
                match unit.first().map_or(0, |byte| byte & 31) {
                    7 => parameters[0] = Some(unit.to_vec()),
                    8 => parameters[1] = Some(unit.to_vec()),
                    kind @ (1 | 5) => {
                        alone |= kind == 5;
                        bytes.extend_from_slice(&(unit.len() as u32).to_be_bytes());
                        bytes.extend_from_slice(unit);
                    }
                    _ => {}
                }
            }
        }
        if self.frames == 0 {
            let [Some(sequence), Some(picture)] = parameters else {
                return Err(Error::new("the encoder gives no parameter sets"));
            };
            mp4.describe(width as u16, height as u16, &sequence, &picture)?;
        }
        if bytes.is_empty() {
            return Err(Error::new(format!("the encoder left out frame {}", self.frames)));
        }
        mp4.add(&bytes, duration, alone)?;
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

fn check_size(width: usize, height: usize) -> Result<()> {
    let even = [width, height].map(|side| side.next_multiple_of(2).max(SHORTEST));
    if even != [width, height] {
        let [w, h] = even;
        return Err(Error::new(format!(
            "{width} x {height} cannot be encoded: H.264 needs an even width and height from {SHORTEST} pixels; pad or \
             scale the frames to {w} x {h}"
        )));
    }
    if width.max(height) > LONGEST.0 || width.min(height) > LONGEST.1 {
        let (long, short) = LONGEST;
        return Err(Error::new(format!(
            "{width} x {height} cannot be encoded: the encoder takes at most {long} x {short}; scale the frames"
        )));
    }
    Ok(())
}

fn place(path: &Path) -> String {
    format!("cannot write the video {}", path.display())
}

fn without_start_code(unit: &[u8]) -> &[u8] {
    match unit {
        [0, 0, 0, 1, unit @ ..] | [0, 0, 1, unit @ ..] => unit,
        unit => unit,
    }
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
