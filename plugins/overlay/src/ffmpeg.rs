//! Decodes what the built-in decoders do not know, through the program `ffmpeg`. It writes raw frames to a pipe, in the
//! YUV4MPEG2 form that MJPEG tools introduced: a line of text with the size and the rate, then a line and the three planes
//! for each frame.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{ChildStdout, Command};

use pdk_image::{check_size, most_pixels};
use pdk_sdk::prelude::*;

use crate::file;
use crate::frames::Frames;
use crate::matroska;
use crate::picture::{Layout, Picture};
use crate::process::Process;

/// Longer lines are not a header.
const LONGEST_LINE: u64 = 1000;
/// What ffmpeg may read: files that hold their frames themselves. A playlist would name others.
const FORMATS: &str = "matroska,mov,avi,mpeg,mpegts,mpegvideo,m4v,h264,hevc,vvc,obu,ivf,av1,vc1,ogg,flv,asf,mxf,nut,rm,dv,\
                       yuv4mpegpipe,tiff_pipe,jpegxl_pipe";

/// Frames without alpha have colours at half their size, as clips before a screen have mostly; those with alpha keep all.
const FORMATS_OF_FRAMES: &str = "format=yuv420p|yuva444p";

/// A running `ffmpeg` and its output.
pub struct Ffmpeg {
    process: Process,
    output: BufReader<ChildStdout>,
    width: usize,
    height: usize,
    /// Frames have an alpha channel.
    alpha: bool,
    /// The planes of a frame with alpha.
    planes: Vec<u8>,
    /// Frames a second: ffmpeg repeats and leaves out frames of a clip without a fixed rate, so that they come in their time.
    rate: f64,
    /// Frames that were read.
    count: u64,
}

impl Ffmpeg {
    /// Starts `program` on a clip; `codec` says what the clip is, for the error.
    ///
    /// # Errors
    /// If there is no such program, or it cannot decode the clip.
    pub fn start(program: &Path, clip: &Path, codec: &str) -> Result<Self> {
        let decoder = matroska::alpha_decoder(&head(clip)?);
        let decoded = Self::run(program, clip, codec, decoder, FORMATS_OF_FRAMES)?;
        match decoded.alpha {
            // The colours of a clip with alpha are not keyed, so they have to be those that its maker saw.
            true => {
                drop(decoded);
                Self::run(
                    program,
                    clip,
                    codec,
                    decoder,
                    &format!("scale=out_color_matrix=bt601:out_range=tv,{FORMATS_OF_FRAMES}"),
                )
            }
            false => Ok(decoded),
        }
    }

    /// Starts it with a decoder other than its own and with a filter.
    fn run(program: &Path, clip: &Path, codec: &str, decoder: Option<&str>, filter: &str) -> Result<Self> {
        // A relative path could start with a dash, or read as a protocol.
        let clip = std::path::absolute(clip)?;
        let mut command = Command::new(program);
        command
            .args(["-v", "error", "-nostdin", "-xerror", "-err_detect", "explode"])
            .args(["-protocol_whitelist", "file,pipe", "-format_whitelist", FORMATS])
            .args(["-max_pixels", &most_pixels()?.to_string()])
            .args(decoder.iter().flat_map(|decoder| ["-c:v", decoder]))
            .arg("-i")
            .arg(&clip)
            .args(["-map", "0:v:0", "-vf", filter, "-strict", "-1", "-f", "yuv4mpegpipe", "-"]);
        let (process, output) = Process::start(command).map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => Error::new(format!(
                "it is {codec}, which needs the program ffmpeg, and there is none on the PATH; install ffmpeg, or convert \
                 the clip to MP4 with H.264"
            )),
            _ => Error::new(format!(
                "it is {codec}, and the program ffmpeg, which that needs, does not start: {error}"
            )),
        })?;
        let mut running = Self {
            process,
            output,
            width: 0,
            height: 0,
            alpha: false,
            rate: 0.0,
            count: 0,
            planes: Vec::new(),
        };
        let header = running.line()?;
        if header.is_empty() {
            let error = running.failure();
            return Err(match decoder {
                Some(name) if error.message().contains("Unknown decoder") => Error::new(format!(
                    "it has an alpha channel, which ffmpeg reads with {name} alone, and this ffmpeg was built without it; install one that has it"
                )),
                _ => error,
            });
        }
        running.read_header(&header).ok_or_else(|| {
            Error::new(format!(
                "ffmpeg cannot decode it whole: its output begins with `{}`, which are not frames in the requested format",
                header.chars().take(100).collect::<String>().escape_debug()
            ))
        })?;
        check_size(running.width as u32, running.height as u32)?;
        Ok(running)
    }

    fn line(&mut self) -> Result<String> {
        let mut line = Vec::new();
        (&mut self.output).take(LONGEST_LINE).read_until(b'\n', &mut line)?;
        Ok(String::from_utf8_lossy(&line).trim_end().to_owned())
    }

    fn read_header(&mut self, header: &str) -> Option<()> {
        for field in header.strip_prefix("YUV4MPEG2 ")?.split(' ') {
            match field.split_at_checked(1)? {
                ("W", width) => self.width = width.parse::<u32>().ok()? as usize,
                ("H", height) => self.height = height.parse::<u32>().ok()? as usize,
                ("F", rate) => {
                    let (frames, seconds) = rate.split_once(':')?;
                    self.rate = frames.parse::<f64>().ok()? / seconds.parse::<f64>().ok()?;
                }
                ("C", "444alpha") => self.alpha = true,
                ("C", chroma)
                    if !chroma.starts_with("420") || chroma.starts_with("420p") && chroma != "420paldv" =>
                {
                    return None;
                }
                _ => {}
            }
        }
        let sized = self.width > 0 && self.height > 0;
        (sized && self.rate.is_finite() && self.rate > 0.0).then_some(())
    }

    /// Why the output ended, as ffmpeg says.
    fn failure(&mut self) -> Error {
        because(&self.process.finish().1)
    }
}

/// The beginning of a clip's file.
fn head(clip: &Path) -> Result<Vec<u8>> {
    let mut head = Vec::new();
    // A clip that is not there is for ffmpeg to report.
    if let Ok((file, _)) = file::open(clip) {
        file.take(matroska::HEAD).read_to_end(&mut head)?;
    }
    Ok(head)
}

fn because(said: &str) -> Error {
    let reason = said.lines().find(|line| !line.trim().is_empty()).unwrap_or("it gives no reason").trim();
    Error::new(format!("ffmpeg cannot decode it whole: {reason}"))
}

impl Frames for Ffmpeg {
    fn next(&mut self, into: &mut Picture) -> Result<bool> {
        let line = self.line()?;
        if line.is_empty() {
            // It ends well where a file was cut off, but says so.
            let (well, said) = self.process.finish();
            return if well && said.is_empty() { Ok(false) } else { Err(because(&said)) };
        }
        if !line.starts_with("FRAME") {
            return Err(Error::new(
                "ffmpeg cannot decode it whole: what it writes is not a sequence of frames",
            ));
        }
        self.count += 1;
        if self.alpha {
            self.planes.resize(4 * self.width * self.height, 0);
            if self.output.read_exact(&mut self.planes).is_err() {
                return Err(self.failure());
            }
            into.reset(self.width, self.height, Layout::Rgba);
            into.fill_from_planes(&self.planes);
            return Ok(true);
        }
        into.reset(self.width, self.height, Layout::Yuv420);
        match self.output.read_exact(&mut into.data) {
            Ok(()) => Ok(true),
            Err(_) => Err(self.failure()),
        }
    }

    fn end(&self) -> f64 {
        self.count as f64 / self.rate
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::stand_in::{program, within};

    fn start(script: &str) -> Result<Ffmpeg> {
        let folder = tempfile::tempdir().unwrap();
        Ffmpeg::start(&program(folder.path(), script), Path::new("clip.mkv"), "Matroska or WebM")
    }

    fn message(result: Result<Ffmpeg>) -> String {
        result.err().unwrap().to_string()
    }

    #[test]
    fn frames_come_through_the_pipe() {
        let script =
            r"printf 'YUV4MPEG2 W3 H2 F30000:1001 Ip A1:1 C420jpeg\nFRAME\nabcdefUUVVFRAME\nghijklXXYY'";
        let mut frames = start(script).unwrap();
        assert!((frames.rate - 29.97).abs() < 0.001);
        let mut picture = Picture::default();
        assert!(frames.next(&mut picture).unwrap());
        assert_eq!((picture.width, picture.height, picture.layout), (3, 2, Layout::Yuv420));
        assert_eq!(picture.data, b"abcdefUUVV");
        assert_eq!(frames.end(), 1001.0 / 30000.0);
        assert!(frames.next(&mut picture).unwrap());
        assert_eq!(picture.planes_mut()[2], b"YY");
        assert!(!frames.next(&mut picture).unwrap());
    }

    #[test]
    fn failures_are_reported_with_their_reason() {
        assert_eq!(
            message(start("echo 'clip.mkv: Invalid data found' >&2; exit 1")),
            "ffmpeg cannot decode it whole: clip.mkv: Invalid data found"
        );
        let folder = tempfile::tempdir().unwrap();
        let absent = Ffmpeg::start(&folder.path().join("ffmpeg"), Path::new("clip.mkv"), "Matroska or WebM");
        assert_eq!(
            message(absent),
            "it is Matroska or WebM, which needs the program ffmpeg, and there is none on the PATH; install ffmpeg, or \
             convert the clip to MP4 with H.264"
        );
        assert_eq!(
            message(start(r"printf 'YUV4MPEG2 W3 H2 F30:1 C444\n'")),
            "ffmpeg cannot decode it whole: its output begins with `YUV4MPEG2 W3 H2 F30:1 C444`, which are not frames in the \
             requested format"
        );
        let mut cut =
            start(r"printf 'YUV4MPEG2 W3 H2 F30:1 C420jpeg\nFRAME\nabc'; echo 'ends early' >&2").unwrap();
        assert!(cut.next(&mut Picture::default()).unwrap_err().to_string().ends_with("ends early"));
        let mut late =
            start(r"printf 'YUV4MPEG2 W3 H2 F30:1 C420jpeg\n'; echo 'corrupt' >&2; exit 3").unwrap();
        assert!(late.next(&mut Picture::default()).unwrap_err().to_string().ends_with("corrupt"));
    }

    #[test]
    fn a_flood_of_messages_blocks_neither_side_and_its_end_is_reported() {
        let error = within(20, || {
            let flood =
                "i=0; while [ $i -lt 20000 ]; do echo \"message $i of a flood\"; i=$((i + 1)); done >&2";
            let frame = r"printf 'FRAME\nabcdefUUVV'";
            let header = r"printf 'YUV4MPEG2 W3 H2 F30:1 C420jpeg\n'";
            let mut frames = start(&format!("{flood}; {header}; {frame}; {flood}; {frame}; cat")).unwrap();
            let mut picture = Picture::default();
            assert!(frames.next(&mut picture).unwrap() && frames.next(&mut picture).unwrap());
            frames.next(&mut picture).unwrap_err().to_string()
        });
        let line = error.strip_prefix("ffmpeg cannot decode it whole: message ").unwrap();
        let number = line.strip_suffix(" of a flood").unwrap_or_else(|| panic!("{error}"));
        assert!(number.parse::<u32>().unwrap() > 19_900, "{error}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn nothing_is_left_of_it_whichever_way_it_ends() {
        let header = r"printf 'YUV4MPEG2 W3 H2 F30:1 C420jpeg\n'";
        for (script, refused) in [
            // What it goes on writing is not read.
            (r"printf 'YUV4MPEG2 W3 H2 F30:1 C444\n'; exec yes".to_owned(), "in the requested format"),
            (
                r"printf 'YUV4MPEG2 W40000 H40 F30:1 C420jpeg\n'; exec yes".to_owned(),
                "it is 40000 x 40, and pictures may have",
            ),
            (format!("{header}; exec yes"), "not a sequence of frames"),
            // Its output ends, and it does not.
            (format!("{header}; exec sleep 60 >&-"), "it gives no reason"),
            (format!("{header}; exec sleep 60 >&- 2>&-"), "it gives no reason"),
            // It is dropped in the middle.
            (format!("{header}; printf 'FRAME\\nabcdefUUVV'; exec yes FRAME"), ""),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let number = folder.path().join("number");
            let path = program(folder.path(), &format!("echo $$ > '{}'; {script}", number.display()));
            let said = within(20, move || {
                let read = |frames: &mut Ffmpeg| frames.next(&mut Picture::default());
                let ended =
                    Ffmpeg::start(&path, Path::new("clip.mkv"), "x").and_then(|mut frames| read(&mut frames));
                ended.err().map_or_else(String::new, |error| error.to_string())
            });
            assert!(said.contains(refused) && said.is_empty() == refused.is_empty(), "{script}: {said}");
            assert!(!crate::stand_in::runs(&number), "{script}");
        }
    }

    #[test]
    fn ffmpeg_reads_this_file_alone() {
        let folder = tempfile::tempdir().unwrap();
        let told = folder.path().join("told");
        let path = program(folder.path(), &format!("printf '%s\\n' \"$@\" > '{}'", told.display()));
        message(Ffmpeg::start(&path, Path::new("http:clip.mkv"), "Matroska or WebM"));
        let told = std::fs::read_to_string(told).unwrap();
        let told: Vec<&str> = told.lines().collect();
        let input = told.iter().position(|argument| *argument == "-i").unwrap();
        assert_eq!(Path::new(told[input + 1]), std::path::absolute("http:clip.mkv").unwrap());
        let value =
            |name: &str| told[told[..input].iter().position(|argument| *argument == name).unwrap() + 1];
        assert_eq!(value("-protocol_whitelist"), "file,pipe");
        for format in ["hls", "concat", "dash", "image2", "lavfi", "sdp", "rtsp", "tee", "imf"] {
            assert!(value("-format_whitelist").split(',').all(|allowed| allowed != format), "{format}");
        }
        assert_eq!(value("-max_pixels"), most_pixels().unwrap().to_string());
    }

    /// An installed ffmpeg.
    fn installed() -> Option<PathBuf> {
        let path = std::env::var_os("PATH").unwrap_or_default();
        let found =
            std::env::split_paths(&path).map(|folder| folder.join("ffmpeg")).find(|file| file.is_file());
        if found.is_none() {
            eprintln!("skipped: no ffmpeg on the PATH");
        }
        found
    }

    /// A clip of ten frames that the installed ffmpeg makes.
    fn make(ffmpeg: &Path, size: &str, codec: &str, clip: &Path) {
        let source = format!("color=0x00c81e:size={size}:rate=25:duration=0.4");
        let mut command = Command::new(ffmpeg);
        command.args(["-v", "error", "-f", "lavfi", "-i", &source, "-c:v", codec]).arg(clip);
        assert!(command.status().unwrap().success());
    }

    #[test]
    fn an_installed_ffmpeg_decodes_a_clip_and_refuses_what_is_too_large() {
        let Some(ffmpeg) = installed() else { return };
        let folder = tempfile::tempdir().unwrap();
        for name in ["clip.mkv", "clip.avi", "clip.nut"] {
            let clip = folder.path().join(name);
            make(&ffmpeg, "64x48", "ffv1", &clip);
            let mut frames = Ffmpeg::start(&ffmpeg, &clip, "a test").unwrap();
            let (mut picture, mut count) = (Picture::default(), 0);
            while frames.next(&mut picture).unwrap() {
                count += 1;
            }
            assert_eq!((picture.width, picture.height, frames.end(), count), (64, 48, 0.4, 10), "{name}");
        }
        let clip = folder.path().join("wide.mkv");
        make(&ffmpeg, "40000x40", "ffv1", &clip);
        let said = within(20, {
            let ffmpeg = ffmpeg.clone();
            move || message(Ffmpeg::start(&ffmpeg, &clip, "a test"))
        });
        assert!(said.starts_with("it is 40000 x 40, and pictures may have"), "{said}");
        let clip = folder.path().join("large.mkv");
        make(&ffmpeg, "8192x8208", "ffv1", &clip);
        let said = within(20, move || message(Ffmpeg::start(&ffmpeg, &clip, "a test")));
        assert!(said.starts_with("ffmpeg cannot decode it whole: "), "{said}");
    }

    #[test]
    fn alpha_comes_through_the_pipe() {
        let script = r"printf 'YUV4MPEG2 W2 H1 F30:1 C444alpha\nFRAME\n\221\020\066\200\042\200\200\377'";
        let mut frames = start(script).unwrap();
        let mut picture = Picture::default();
        assert!(frames.next(&mut picture).unwrap());
        assert_eq!((picture.width, picture.height, picture.layout), (2, 1, Layout::Rgba));
        assert!(picture.has_transparency());
        // Green, half transparent, and black.
        let expected = [0, 255, 1, 128, 0, 0, 0, 255];
        assert!(picture.data.iter().zip(expected).all(|(a, b)| a.abs_diff(b) < 3), "{:?}", picture.data);
        assert!(!frames.next(&mut picture).unwrap());
    }

    #[test]
    fn an_installed_ffmpeg_keeps_alpha() {
        let Some(ffmpeg) = installed() else { return };
        let folder = tempfile::tempdir().unwrap();
        // Red that grows opaque from left to right.
        let source = "color=0xc81e1e:size=64x48:rate=25:duration=0.2,format=rgba,geq=r=200:g=30:b=30:a='4*X'";
        for (name, arguments) in [
            ("prores.mov", &["-c:v", "prores_ks", "-profile:v", "4444", "-pix_fmt", "yuva444p10le"][..]),
            (
                "vp9.webm",
                &[
                    "-c:v",
                    "libvpx-vp9",
                    "-pix_fmt",
                    "yuva420p",
                    "-crf",
                    "10",
                    "-b:v",
                    "0",
                    "-auto-alt-ref",
                    "0",
                ],
            ),
            ("vp8.webm", &["-c:v", "libvpx", "-pix_fmt", "yuva420p", "-b:v", "4M", "-auto-alt-ref", "0"]),
            ("ffv1.mkv", &["-c:v", "ffv1", "-pix_fmt", "bgra"]),
            ("animation.mov", &["-c:v", "qtrle", "-pix_fmt", "argb"]),
        ] {
            let clip = folder.path().join(name);
            let mut command = Command::new(&ffmpeg);
            command.args(["-v", "error", "-f", "lavfi", "-i", source]).args(arguments).arg(&clip);
            if !command.status().unwrap().success() {
                eprintln!("skipped: this ffmpeg does not write {name}");
                continue;
            }
            let mut frames = Ffmpeg::start(&ffmpeg, &clip, "a test").unwrap();
            let (mut picture, mut count) = (Picture::default(), 0);
            while frames.next(&mut picture).unwrap() {
                count += 1;
            }
            assert_eq!((count, picture.layout), (5, Layout::Rgba), "{name}");
            for x in [8, 31, 50] {
                let pixel = &picture.data[(24 * 64 + x) * 4..][..4];
                assert!(pixel[3].abs_diff(4 * x as u8) <= 6, "{name} {x}: {pixel:?}");
                assert!(
                    pixel[..3].iter().zip([200, 30, 30]).all(|(a, b)| a.abs_diff(b) <= 8),
                    "{name} {x}: {pixel:?}"
                );
            }
        }
    }

    #[test]
    fn an_installed_ffmpeg_follows_no_playlist() {
        let Some(ffmpeg) = installed() else { return };
        let folder = tempfile::tempdir().unwrap();
        make(&ffmpeg, "64x48", "mpeg2video", &folder.path().join("other.ts"));
        // Not taken for text, because of the byte at the end.
        for (name, list) in [
            ("concat.mkv", &b"ffconcat version 1.0\nfile other.ts\n# \xff\n"[..]),
            (
                "playlist.mkv",
                b"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:0.4,\nother.ts\n#EXT-X-ENDLIST\n# \xff\n",
            ),
        ] {
            let clip = folder.path().join(name);
            std::fs::write(&clip, list).unwrap();
            let ffmpeg = ffmpeg.clone();
            let said = within(20, move || message(Ffmpeg::start(&ffmpeg, &clip, "a test")));
            assert!(said.contains("whitelist"), "{name}: {said}");
        }
    }
}
