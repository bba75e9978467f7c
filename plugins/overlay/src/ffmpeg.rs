//! Decodes what the built-in decoders do not know, through the program `ffmpeg`. It writes raw frames to a pipe, in the
//! YUV4MPEG2 form that MJPEG tools introduced: a line of text with the size and the rate, then a line and the three planes
//! for each frame.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

use pdk_sdk::prelude::*;

use crate::clip::Frames;
use crate::picture::{Layout, Picture};

/// Longer lines are no header.
const LONGEST_LINE: u64 = 1000;

/// A running `ffmpeg` and its output.
pub struct Ffmpeg {
    child: Child,
    output: BufReader<ChildStdout>,
    width: usize,
    height: usize,
    rate: f64,
}

impl Ffmpeg {
    /// Starts `program` on a clip; `codec` says what the clip is, for the error.
    ///
    /// # Errors
    /// Where there is no such program, or it cannot decode the clip.
    pub fn start(program: &Path, clip: &Path, codec: &str) -> Result<Self> {
        // A relative path could start with a dash, or read as a protocol.
        let clip = std::path::absolute(clip)?;
        let mut child = Command::new(program)
            .args(["-v", "error", "-nostdin", "-xerror", "-err_detect", "explode", "-i"])
            .arg(&clip)
            .args(["-map", "0:v:0", "-pix_fmt", "yuv420p", "-strict", "-1", "-f", "yuv4mpegpipe", "-"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| match error.kind() {
                std::io::ErrorKind::NotFound => Error::new(format!(
                    "it is {codec}, which needs the program ffmpeg, and there is none on the PATH; install ffmpeg, or \
                     convert the clip to MP4 with H.264"
                )),
                _ => Error::new(format!("it is {codec}, and the program ffmpeg, which that needs, does not start: {error}")),
            })?;
        let Some(output) = child.stdout.take() else { return Err(Error::new("ffmpeg has no output")) };
        let mut decoder = Self { child, output: BufReader::new(output), width: 0, height: 0, rate: 0.0 };
        let header = decoder.line()?;
        match decoder.read_header(&header) {
            Some(()) => Ok(decoder),
            None => Err(failure(&decoder.said())),
        }
    }

    fn line(&mut self) -> Result<String> {
        let mut line = Vec::new();
        (&mut self.output).take(LONGEST_LINE).read_until(b'\n', &mut line)?;
        Ok(String::from_utf8_lossy(&line).trim_end().to_owned())
    }

    fn read_header(&mut self, header: &str) -> Option<()> {
        for field in header.strip_prefix("YUV4MPEG2 ")?.split(' ') {
            match field.split_at_checked(1)? {
                ("W", width) => self.width = width.parse().ok()?,
                ("H", height) => self.height = height.parse().ok()?,
                ("F", rate) => {
                    let (frames, seconds) = rate.split_once(':')?;
                    self.rate = frames.parse::<f64>().ok()? / seconds.parse::<f64>().ok()?;
                }
                ("C", chroma)
                    if !chroma.starts_with("420") || chroma.starts_with("420p") && chroma != "420paldv" =>
                {
                    return None;
                }
                _ => {}
            }
        }
        let sizes = 1..=1 << 15;
        (sizes.contains(&self.width)
            && sizes.contains(&self.height)
            && self.rate.is_finite()
            && self.rate > 0.0)
            .then_some(())
    }

    /// What ffmpeg has to say, which is nothing where all goes well.
    fn said(&mut self) -> String {
        let mut said = Vec::new();
        if let Some(errors) = self.child.stderr.take() {
            // It explains an error that there is anyway.
            let _ = errors.take(10_000).read_to_end(&mut said);
        }
        String::from_utf8_lossy(&said).into_owned()
    }
}

fn failure(said: &str) -> Error {
    let reason = said.lines().find(|line| !line.trim().is_empty()).unwrap_or("it gives no reason").trim();
    Error::new(format!("ffmpeg cannot decode it whole: {reason}"))
}

impl Frames for Ffmpeg {
    fn next(&mut self, into: &mut Picture) -> Result<bool> {
        let line = self.line()?;
        if line.is_empty() {
            // It ends well where a file was cut off, but says so.
            let well = self.child.wait()?.success();
            let said = self.said();
            return if well && said.is_empty() { Ok(false) } else { Err(failure(&said)) };
        }
        into.reset(self.width, self.height, Layout::Yuv420);
        match line.starts_with("FRAME") && self.output.read_exact(&mut into.data).is_ok() {
            true => Ok(true),
            false => Err(failure(&self.said())),
        }
    }

    fn rate(&self) -> f64 {
        self.rate
    }
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        // It may have ended already; either way nothing is left of it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;

    /// A program that does what `script` says, in place of ffmpeg. Another process writes it: a file that this one has open
    /// for writing is inherited by whatever another test starts meanwhile, and then it cannot be run ("text file busy").
    fn program(folder: &Path, script: &str) -> std::path::PathBuf {
        let (text, path) = (folder.join("script"), folder.join("ffmpeg"));
        std::fs::write(&text, format!("#!/bin/sh\n{script}\n")).unwrap();
        let installed = Command::new("install").args(["-m", "755"]).args([&text, &path]).status().unwrap();
        assert!(installed.success());
        path
    }

    fn start(script: &str) -> Result<Ffmpeg> {
        let folder = tempfile::tempdir().unwrap();
        Ffmpeg::start(&program(folder.path(), script), Path::new("clip.mkv"), "Matroska or WebM")
    }

    #[test]
    fn frames_come_through_the_pipe() {
        let script =
            r"printf 'YUV4MPEG2 W3 H2 F30000:1001 Ip A1:1 C420jpeg\nFRAME\nabcdefUUVVFRAME\nghijklXXYY'";
        let mut frames = start(script).unwrap();
        assert!((frames.rate() - 29.97).abs() < 0.001);
        let mut picture = Picture::default();
        assert!(frames.next(&mut picture).unwrap());
        assert_eq!((picture.width, picture.height, picture.layout), (3, 2, Layout::Yuv420));
        assert_eq!(picture.data, b"abcdefUUVV");
        assert!(frames.next(&mut picture).unwrap());
        assert_eq!(picture.planes_mut()[2], b"YY");
        assert!(!frames.next(&mut picture).unwrap());
    }

    #[test]
    fn what_goes_wrong_is_said_with_its_reason() {
        let message = |result: Result<Ffmpeg>| result.err().unwrap().to_string();
        assert_eq!(
            message(start("echo 'clip.mkv: Invalid data found' >&2; exit 1")),
            "ffmpeg cannot decode it whole: clip.mkv: Invalid data found"
        );
        let absent =
            Ffmpeg::start(Path::new("/nonexistent/ffmpeg"), Path::new("clip.mkv"), "Matroska or WebM");
        assert_eq!(
            message(absent),
            "it is Matroska or WebM, which needs the program ffmpeg, and there is none on the PATH; install ffmpeg, or \
             convert the clip to MP4 with H.264"
        );
        assert!(message(start(r"printf 'YUV4MPEG2 W3 H2 F30:1 C444\n'")).starts_with("ffmpeg cannot"));
        let mut cut =
            start(r"printf 'YUV4MPEG2 W3 H2 F30:1 C420jpeg\nFRAME\nabc'; echo 'ends early' >&2").unwrap();
        assert!(cut.next(&mut Picture::default()).unwrap_err().to_string().ends_with("ends early"));
        let mut late =
            start(r"printf 'YUV4MPEG2 W3 H2 F30:1 C420jpeg\n'; echo 'corrupt' >&2; exit 3").unwrap();
        assert!(late.next(&mut Picture::default()).unwrap_err().to_string().ends_with("corrupt"));
    }
}
