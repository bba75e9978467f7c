//! Writes a video again, with other pictures: in the codec and the container that it has, each frame at its time. What is decoded here is
//! encoded here, and the rest is left to the program ffmpeg, which gets the pictures through a pipe.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use pdk_sdk::prelude::*;

use crate::convert::Yuv420;
use crate::encoder::check_size;
use crate::ffmpeg::{PROGRAM, Told, each_once, look, not_started};
use crate::matroska::{frame_head, stream_head};
use crate::process::{Input, Process};
use crate::reader::{Opened, opened};
use crate::writer::Writer;

/// Seconds from one frame that can be decoded alone to the next.
const SECONDS_BETWEEN_KEYS: f64 = 2.0;

/// An encoder of ffmpeg, by the codec that it writes.
struct Encoder {
    /// As ffmpeg calls it.
    codec: &'static str,
    name: &'static str,
    /// Its quality, which is high, so that what a perturbation does is not mixed with what the codec does.
    quality: &'static [&'static str],
    /// What makes the same bytes of the same frames on every machine.
    steady: &'static [&'static str],
    /// The shortest side in pixels that it takes.
    shortest: u32,
}

/// Those that are used, the first of a codec that there is.
const ENCODERS: &[Encoder] = &[
    Encoder {
        codec: "av1",
        name: "libsvtav1",
        quality: &["-crf", "20"],
        steady: &["-preset", "8", "-svtav1-params", "lp=1"],
        shortest: 64,
    },
    Encoder {
        codec: "av1",
        name: "libaom-av1",
        quality: &["-crf", "16", "-b:v", "0"],
        steady: &["-cpu-used", "6", "-row-mt", "0"],
        shortest: 16,
    },
    Encoder {
        codec: "hevc",
        name: "libx265",
        quality: &["-crf", "16"],
        steady: &["-x265-params", "log-level=error:frame-threads=1:pools=none"],
        shortest: 16,
    },
    Encoder { codec: "h264", name: "libx264", quality: &["-crf", "16"], steady: &[], shortest: 16 },
    Encoder {
        codec: "vp9",
        name: "libvpx-vp9",
        quality: &["-crf", "16", "-b:v", "0"],
        steady: &["-cpu-used", "4", "-row-mt", "0"],
        shortest: 16,
    },
    Encoder {
        codec: "vp8",
        name: "libvpx",
        quality: &["-crf", "8", "-b:v", "50M"],
        steady: &["-cpu-used", "4"],
        shortest: 16,
    },
    Encoder { codec: "mpeg4", name: "mpeg4", quality: &["-q:v", "2"], steady: &[], shortest: 16 },
    Encoder { codec: "mjpeg", name: "mjpeg", quality: &["-q:v", "2"], steady: &[], shortest: 16 },
];

/// How a video is written again.
pub struct Recoding(Way);

enum Way {
    /// With this many ticks a second.
    Own(u32),
    Other {
        told: Told,
        encoder: &'static Encoder,
        container: &'static str,
        version: String,
    },
}

impl Recoding {
    /// For the video in a file.
    ///
    /// # Errors
    /// If it is not a video, is cut off, or is one that cannot be written.
    pub fn of(video: &Path) -> Result<Self> {
        match opened(video)? {
            Opened::Frames(reader) => Ok(Self::own(reader.scale())),
            Opened::OtherCodec(codec) => Self::other(video, &codec),
        }
    }

    /// For a video that is decoded here.
    pub(crate) fn own(scale: u32) -> Self {
        Self(Way::Own(scale))
    }

    /// For a video that ffmpeg decodes.
    ///
    /// # Errors
    /// If ffmpeg is missing, or cannot write its codec or container.
    pub(crate) fn other(video: &Path, codec: &str) -> Result<Self> {
        let ending = video.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        let container = match ending.to_ascii_lowercase().as_str() {
            "mp4" | "m4v" | "mp4v" => "mp4",
            "mov" | "qt" => "mov",
            "mkv" => "matroska",
            "webm" => "webm",
            "avi" => "avi",
            "hevc" => "hevc",
            other => {
                return Err(Error::new(format!("videos whose names end in `.{other}` are not written")));
            }
        };
        let told = look(video, codec)?;
        let known = encoders()?;
        let encoder = ENCODERS.iter().find(|encoder| {
            encoder.codec == told.codec
                && told.size.iter().all(|side| *side >= encoder.shortest)
                && known.lines().any(|line| line.split_whitespace().nth(1) == Some(encoder.name))
        });
        let encoder = encoder.ok_or_else(|| {
            let named: Vec<&str> =
                ENCODERS.iter().filter(|encoder| encoder.codec == told.codec).map(|encoder| encoder.name).collect();
            Error::new(match named.as_slice() {
                [] => format!("its codec is `{}`, which pdk does not write; convert it to MP4 with H.264", told.codec),
                named => format!(
                    "its codec is `{}`, for which ffmpeg needs the encoder {}, and this ffmpeg was built without it; install one that has \
                     it, or convert the video to MP4 with H.264",
                    told.codec,
                    named.join(" or ")
                ),
            })
        })?;
        Ok(Self(Way::Other { told, encoder, container, version: version()? }))
    }

    /// The codec and the quality, for people and manifests.
    pub fn describe(&self) -> String {
        match &self.0 {
            Way::Own(_) => crate::Encoder::describe(),
            Way::Other { told, encoder, version, .. } => {
                let quality = encoder.quality.join(" ");
                format!(
                    "{} by {} of ffmpeg {version} with {quality}, which is lossy",
                    told.codec, encoder.name
                )
            }
        }
    }

    /// Begins a video whose frames begin at these times in seconds, behind which is when the last one ends. With `keys` that many frames lie
    /// between two that can be decoded alone, if ffmpeg writes it.
    ///
    /// # Errors
    /// If frames of this size cannot be encoded, or the file cannot be written.
    pub fn begin(
        &self,
        into: &Path,
        size: [usize; 2],
        times: Vec<f64>,
        keys: Option<u32>,
    ) -> Result<Recoder> {
        let count = times.len().saturating_sub(1);
        let rate = count as f64 / times.last().copied().unwrap_or_default();
        let rate = if rate.is_finite() { rate.clamp(0.001, 1000.0) } else { 1.0 };
        let output = match &self.0 {
            Way::Own(scale) => {
                Output::Own(Box::new(Writer::with_scale(into, size[0], size[1], rate, *scale)?))
            }
            Way::Other { told, encoder, container, .. } => {
                check_size(size[0], size[1])?;
                let keys = keys.unwrap_or_else(|| (SECONDS_BETWEEN_KEYS * rate).round().max(1.0) as u32);
                let command = command(told, encoder, container, keys, into);
                let (process, mut input) =
                    Process::start_with_input(command).map_err(|error| not_started(&error, encoder.codec))?;
                let head = stream_head(size, 1e9 / rate);
                // If ffmpeg has ended, it says why at the end.
                let alive = input.write_all(&head).is_ok();
                Output::Other(Box::new(Piped {
                    process,
                    input: alive.then_some(input),
                    size,
                    planes: Yuv420::default(),
                }))
            }
        };
        Ok(Recoder { output, times, written: 0, into: into.to_owned() })
    }
}

/// Writes the frames of a video that is written again.
pub struct Recoder {
    output: Output,
    times: Vec<f64>,
    written: usize,
    into: PathBuf,
}

enum Output {
    Own(Box<Writer>),
    Other(Box<Piped>),
}

/// A running ffmpeg that encodes.
struct Piped {
    process: Process,
    /// None once it reads no more.
    input: Option<Input>,
    size: [usize; 2],
    planes: Yuv420,
}

impl Recoder {
    /// Writes the next frame.
    ///
    /// # Errors
    /// If it has another size than the video, there are more than there are times, or it cannot be written.
    pub fn push(&mut self, frame: Frame<'_>) -> Result<()> {
        let [Some(begins), Some(end)] =
            [self.written, self.written + 1].map(|place| self.times.get(place).copied())
        else {
            return Err(Error::new("it has more frames than times"));
        };
        self.written += 1;
        match &mut self.output {
            Output::Own(writer) => writer.push_until(frame, end),
            Output::Other(piped) => piped.push(frame, begins),
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// If frames are missing, or it cannot be completed.
    pub fn finish(self) -> Result<()> {
        if self.written + 1 != self.times.len() {
            return Err(Error::new(format!(
                "it has {} frames of {}",
                self.written,
                self.times.len().saturating_sub(1)
            )));
        }
        match self.output {
            Output::Own(writer) => writer.finish(),
            Output::Other(mut piped) => {
                let broken = piped.input.take().is_none();
                let (well, said) = piped.process.finish_work();
                match well && said.trim().is_empty() && !broken {
                    true => Ok(()),
                    false => Err(refused(&said)),
                }
            }
        }
        .map_err(|error| error.at(format_args!("cannot write {}", self.into.display())))
    }
}

impl Piped {
    fn push(&mut self, frame: Frame<'_>, begins: f64) -> Result<()> {
        if [frame.width(), frame.height()] != self.size {
            let [width, height] = self.size;
            let (w, h) = (frame.width(), frame.height());
            return Err(Error::new(format!("a frame is {w} x {h}, but the video is {width} x {height}")));
        }
        self.planes.fill(frame);
        let head = frame_head((begins * 1e9).round() as u64, self.planes.data.len());
        let input = self.input.as_mut().ok_or_else(|| Error::new("ffmpeg reads no more"))?;
        if input.write_all(&head).and_then(|()| input.write_all(&self.planes.data)).is_err() {
            self.input = None;
            return Err(refused(&self.process.finish().1));
        }
        Ok(())
    }
}

fn command(told: &Told, encoder: &Encoder, container: &str, keys: u32, into: &Path) -> Command {
    let program = Path::new(PROGRAM);
    let mut command = Command::new(program);
    let [once, passthrough] = each_once(program);
    command
        // One of the encoders reports what it does at any level of ffmpeg's own messages; this limits it to errors.
        .env("SVT_LOG", "1")
        .args(["-v", "error", "-nostdin", "-xerror", "-protocol_whitelist", "file,pipe"])
        .args(["-f", "matroska", "-i", "pipe:0", "-map", "0:v:0", once, passthrough, "-threads", "1"])
        .args(["-enc_time_base", &format!("{}:{}", told.scale.0, told.scale.1)])
        .args(["-c:v", encoder.name])
        .args(encoder.quality)
        .args(encoder.steady)
        .args([
            "-g",
            &keys.to_string(),
            "-pix_fmt",
            if encoder.codec == "mjpeg" { "yuvj420p" } else { "yuv420p" },
        ]);
    if matches!(container, "mp4" | "mov") {
        command.args(["-video_track_timescale", &told.scale.1.to_string()]);
        if encoder.codec == "hevc" {
            command.args(["-tag:v", "hvc1"]);
        }
    }
    command.args(["-fflags", "+bitexact", "-flags:v", "+bitexact", "-f", container, "-y"]).arg("--");
    // A relative path could start with a dash, or read as a protocol.
    command.arg(std::path::absolute(into).unwrap_or_else(|_| into.to_owned()));
    command
}

/// What `ffmpeg -encoders` lists.
fn encoders() -> Result<String> {
    said(&["-v", "error", "-encoders"])
}

/// The version of ffmpeg.
fn version() -> Result<String> {
    let said = said(&["-version"])?;
    Ok(said.split_whitespace().nth(2).unwrap_or("of an unknown version").to_owned())
}

fn said(arguments: &[&str]) -> Result<String> {
    let output = Command::new(PROGRAM).args(arguments).stdin(Stdio::null()).stderr(Stdio::null()).output();
    let output = output.map_err(|error| not_started(&error, "a video of another codec than H.264"))?;
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn refused(said: &str) -> Error {
    let reason = said.lines().find(|line| !line.trim().is_empty()).unwrap_or("it gives no reason").trim();
    Error::new(format!("ffmpeg cannot encode it: {reason}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Video;

    fn picture(number: usize) -> FrameBuf {
        let bytes = (0..64 * 64).flat_map(|i| [(i % 64 * 3 + number * 9) as u8, (i / 64 * 4) as u8, 90]);
        FrameBuf::from_vec(bytes.collect(), 64, 64).unwrap()
    }

    /// The frames of a video with their times.
    fn frames(path: &Path) -> (Vec<FrameBuf>, Vec<f64>) {
        let mut video = Video::open(path).unwrap();
        let mut picture = Yuv420::default();
        let mut frames = Vec::new();
        while video.next(&mut picture).unwrap() {
            let mut frame = FrameBuf::new(picture.width, picture.height);
            picture.to_rgb(frame.as_mut());
            frames.push(frame);
        }
        (frames, (0..=video.count()).map(|frame| video.time(frame)).collect())
    }

    #[test]
    #[ignore = "long: .ci/run runs it"]
    fn a_video_is_written_with_its_codec_and_the_times_of_its_frames() {
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join("own.mp4");
        let times = [0.0, 0.1, 0.25, 0.3, 0.5, 0.55, 0.7, 0.8, 0.9];
        let mut writer = Writer::with_scale(&own, 64, 64, 10.0, 1000).unwrap();
        for (number, end) in times.iter().enumerate().skip(1) {
            writer.push_until(picture(number).as_ref(), *end).unwrap();
        }
        writer.finish().unwrap();
        let mut videos = vec![own.clone()];
        let has_ffmpeg = said(&["-version"]).is_ok();
        let known = if has_ffmpeg { encoders().unwrap() } else { String::new() };
        for (name, encoder) in [
            ("av1.mp4", "libsvtav1"),
            ("hevc.mp4", "libx265"),
            ("vp9.webm", "libvpx-vp9"),
            ("h264.mkv", "libx264"),
        ] {
            if !known.contains(encoder) {
                println!("skipped: {name}, for there is no ffmpeg with {encoder}");
                continue;
            }
            let path = folder.path().join(name);
            let made = Command::new(PROGRAM)
                .args(["-v", "error", "-i"])
                .arg(&own)
                .args([
                    "-fps_mode",
                    "passthrough",
                    "-vf",
                    "settb=1/1000,setpts=N*100",
                    "-c:v",
                    encoder,
                    "-crf",
                    "10",
                ])
                .arg(&path)
                .status();
            assert!(made.unwrap().success(), "{name}");
            videos.push(path);
        }
        for path in videos {
            let (before, expected) = frames(&path);
            assert_eq!(before.len(), times.len() - 1);
            let recoding = Video::open(&path).unwrap().recoding().unwrap();
            let copies =
                ["a", "b"].map(|name| folder.path().join(name).with_extension(path.extension().unwrap()));
            for copy in &copies {
                let mut recoder = recoding.begin(copy, [64, 64], expected.clone(), None).unwrap();
                before.iter().for_each(|frame| recoder.push(frame.as_ref()).unwrap());
                recoder.finish().unwrap();
            }
            let (after, found) = frames(&copies[0]);
            let told = recoding.describe();
            // When the last frame ends, not every container says.
            assert_eq!(found[..times.len() - 1], expected[..times.len() - 1], "{told}");
            for (old, new) in before.iter().zip(&after) {
                let off: u64 =
                    old.data().iter().zip(new.data()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
                assert!(
                    (off as f64) < 3.0 * old.data().len() as f64,
                    "{told}: {}",
                    off as f64 / old.data().len() as f64
                );
            }
            assert_eq!(std::fs::read(&copies[0]).unwrap(), std::fs::read(&copies[1]).unwrap(), "{told}");
            let listed = Command::new(PROGRAM).arg("-i").arg(&copies[0]).output().unwrap();
            let listed = String::from_utf8_lossy(&listed.stderr).into_owned();
            assert!(listed.contains("(tv, smpte170m"), "{told} names no matrix and range: {listed}");
            assert_eq!(Video::open(&copies[0]).unwrap().decoder(), Video::open(&path).unwrap().decoder());
        }
    }

    #[test]
    fn what_cannot_be_written_is_refused_with_a_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let error = |result: Result<Recoder>| result.err().unwrap().to_string();
        let odd = Recoding::own(1000).begin(&folder.path().join("a.mp4"), [63, 48], vec![0.0, 0.1], None);
        assert!(error(odd).contains("pad or scale the frames to 64 x 48"));
        let flv = Recoding::other(Path::new("a.flv"), "Flash").err().unwrap();
        assert!(flv.message().contains("`.flv` are not written"));
        let mut recoder = Recoding::own(1000)
            .begin(&folder.path().join("b.mp4"), [64, 64], vec![0.0, 0.1, 0.2], None)
            .unwrap();
        recoder.push(picture(0).as_ref()).unwrap();
        assert!(recoder.finish().unwrap_err().message().contains("1 frames of 2"));
    }
}
