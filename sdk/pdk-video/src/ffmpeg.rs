//! Decodes what the built-in decoders do not know, through the program `ffmpeg`. It writes raw frames to a pipe, in the
//! YUV4MPEG2 form that MJPEG tools introduced: a line of text with the size and the rate, then a line and the three planes
//! for each frame.

use std::io::{BufRead, Read};
use std::path::Path;
use std::process::{Command, Stdio};

use pdk_image::{check_size, most_pixels};
use pdk_sdk::prelude::*;

use crate::convert::Yuv420;
use crate::matroska;
use crate::process::{Output, Process};

/// Longer lines are not a header.
const LONGEST_LINE: u64 = 1000;
/// What ffmpeg may read: files that hold their frames themselves. A playlist would name others.
const FORMATS: &str = "matroska,mov,avi,mpeg,mpegts,mpegvideo,m4v,h264,hevc,vvc,obu,ivf,av1,vc1,ogg,flv,asf,mxf,nut,rm,dv,\
                       yuv4mpegpipe,tiff_pipe,jpegxl_pipe";

/// The program, which is looked for on the PATH.
pub const PROGRAM: &str = "ffmpeg";

/// More frames than this are not listed; see `timing`.
pub const MOST: usize = 1 << 22;

/// Frames without alpha have colours at half their size, as clips before a screen have mostly; those with alpha keep all.
const FORMATS_OF_FRAMES: &str = "format=yuv420p|yuva444p";

/// The matrix and the range of the frames, whatever those of the clip are. Nothing changes if the clip names none.
const CODING_OF_FRAMES: &str = "scale=out_color_matrix=bt601:out_range=tv";

/// A running `ffmpeg` and its output.
pub struct Ffmpeg {
    process: Process,
    output: Output,
    width: usize,
    height: usize,
    /// Frames may have an alpha channel.
    accepts_alpha: bool,
    /// Frames have an alpha channel.
    alpha: bool,
    /// Frames a second.
    rate: f64,
    /// Frames that were read.
    count: u64,
}

impl Ffmpeg {
    /// Starts `program` on a clip, each frame of which comes once; `codec` says what the clip is, for the error.
    ///
    /// # Errors
    /// If there is no such program, or it cannot decode the clip.
    pub fn start(program: &Path, clip: &Path, codec: &str) -> Result<Self> {
        let [option, value] = each_once(program);
        Self::run(
            command(program, clip, None)?,
            codec,
            &[option, value, "-vf", CODING_OF_FRAMES, "-pix_fmt", "yuv420p"],
            false,
        )
    }

    /// Starts `program` on a clip that may have an alpha channel. As many frames come a second as the clip has on average: ffmpeg repeats and
    /// leaves out frames of a clip without a fixed rate, so that they come in their time.
    ///
    /// # Errors
    /// If there is no such program, or it cannot decode the clip.
    pub fn start_with_alpha(program: &Path, clip: &Path, codec: &str) -> Result<Self> {
        let decoder = matroska::alpha_decoder(&head(clip)?);
        let run = |filter: &str| {
            let started = Self::run(command(program, clip, decoder)?, codec, &["-vf", filter], true);
            started.map_err(|error| match decoder {
                Some(name) if error.message().contains("Unknown decoder") => Error::new(format!(
                    "it has an alpha channel, which ffmpeg reads with {name} alone, and this ffmpeg was built without it; install one \
                     that has it"
                )),
                _ => error,
            })
        };
        let decoded = run(FORMATS_OF_FRAMES)?;
        match decoded.alpha {
            // The colours of a clip with alpha are not keyed, so they have to be those that its maker saw.
            true => {
                drop(decoded);
                run(&format!("{CODING_OF_FRAMES},{FORMATS_OF_FRAMES}"))
            }
            false => Ok(decoded),
        }
    }

    fn run(mut command: Command, codec: &str, options: &[&str], accepts_alpha: bool) -> Result<Self> {
        command.args(options).args(["-strict", "-1", "-f", "yuv4mpegpipe", "-"]);
        let (process, output) = Process::start(command).map_err(|error| not_started(&error, codec))?;
        let mut running =
            Self { process, output, width: 0, height: 0, accepts_alpha, alpha: false, rate: 0.0, count: 0 };
        let header = running.line()?;
        if header.is_empty() {
            return Err(running.failure());
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
                ("C", "444alpha") if self.accepts_alpha => self.alpha = true,
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

    /// The frames' width and height.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Whether frames have an alpha channel, and are read by [`Self::next_with_alpha`].
    pub fn has_alpha(&self) -> bool {
        self.alpha
    }

    /// Reads the next frame of a clip without alpha; false at the end.
    ///
    /// # Errors
    /// If the clip is damaged or cut off.
    pub fn next(&mut self, into: &mut Yuv420) -> Result<bool> {
        if !self.begin_frame()? {
            return Ok(false);
        }
        into.reset(self.width, self.height);
        self.fill(&mut into.data)
    }

    /// Reads the next frame of a clip with alpha; false at the end. It comes as four planes of its size: luma, blue and red chroma as
    /// video has them, and alpha.
    ///
    /// # Errors
    /// If the clip is damaged or cut off.
    pub fn next_with_alpha(&mut self, planes: &mut Vec<u8>) -> Result<bool> {
        if !self.begin_frame()? {
            return Ok(false);
        }
        planes.resize(4 * self.width * self.height, 0);
        self.fill(planes)
    }

    /// Reads the line before a frame; false at the end.
    fn begin_frame(&mut self) -> Result<bool> {
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
        Ok(true)
    }

    fn fill(&mut self, data: &mut [u8]) -> Result<bool> {
        match self.output.read_exact(data) {
            Ok(()) => Ok(true),
            Err(_) => Err(self.failure()),
        }
    }

    /// When the frame that was read last ends, in seconds after the first one began, if they come at a fixed rate.
    pub fn end(&self) -> f64 {
        self.count as f64 / self.rate
    }
}

/// The beginning of a command: how `program` reads a clip, with a decoder other than its own.
fn command(program: &Path, clip: &Path, decoder: Option<&str>) -> Result<Command> {
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
        .args(["-map", "0:v:0"]);
    Ok(command)
}

/// The beginning of a clip's file.
fn head(clip: &Path) -> Result<Vec<u8>> {
    let mut head = Vec::new();
    // A clip that is not there is for ffmpeg to report.
    if let Ok((file, _)) = pdk_sdk::file::open(clip) {
        file.take(matroska::HEAD).read_to_end(&mut head)?;
    }
    Ok(head)
}

/// The option by which ffmpeg gives each frame once; it has another name since version 5.1.
pub fn each_once(program: &Path) -> [&'static str; 2] {
    let mut command = Command::new(program);
    command.args(["-v", "error", "-nostdin", "-fps_mode", "passthrough", "-version"]);
    let known = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
    match known {
        Ok(status) if !status.success() => ["-vsync", "passthrough"],
        _ => ["-fps_mode", "passthrough"],
    }
}

pub fn not_started(error: &std::io::Error, codec: &str) -> Error {
    match error.kind() {
        std::io::ErrorKind::NotFound => Error::new(format!(
            "it is {codec}, which needs the program ffmpeg, and there is none on the PATH; install ffmpeg, or convert \
             the clip to MP4 with H.264"
        )),
        _ => Error::new(format!(
            "it is {codec}, and the program ffmpeg, which that needs, does not start: {error}"
        )),
    }
}

/// What ffmpeg says of the pictures of a video.
pub struct Told {
    /// Their codec, as ffmpeg calls it.
    pub codec: String,
    /// Seconds of a tick, as a fraction: times are whole numbers of ticks.
    pub scale: (u32, u32),
    /// Width and height.
    pub size: [u32; 2],
}

/// Asks ffmpeg what a video is; `codec` says what is known of that.
///
/// # Errors
/// If there is no such program, or it cannot read the video.
pub fn look(video: &Path, codec: &str) -> Result<Told> {
    let mut command = command(Path::new(PROGRAM), video, None)?;
    command.args(["-c", "copy", "-frames:v", "1", "-f", "framecrc", "-"]);
    let (mut process, output) = Process::start(command).map_err(|error| not_started(&error, codec))?;
    let (mut codec, mut scale, mut size) = (None, None, None);
    for line in output.lines() {
        let line = line.map_err(|error| Error::new(format!("ffmpeg cannot read it: {error}")))?;
        if let Some(name) = line.strip_prefix("#codec_id 0: ") {
            codec = Some(name.trim().to_owned());
        } else if let Some((numerator, denominator)) =
            line.strip_prefix("#tb 0: ").and_then(|tick| tick.split_once('/'))
        {
            scale = numerator.parse().ok().zip(denominator.trim().parse().ok());
        } else if let Some((width, height)) =
            line.strip_prefix("#dimensions 0: ").and_then(|size| size.split_once('x'))
        {
            size = width.parse().ok().zip(height.trim().parse().ok());
        }
    }
    let (_, said) = process.finish();
    match (codec, scale, size) {
        (Some(codec), Some(scale), Some((width, height))) => Ok(Told { codec, scale, size: [width, height] }),
        _ => Err(because(&said)),
    }
}

/// When the frames of a video begin, in seconds after the first one, and behind them when the last one ends. The video is decoded for
/// that, because a file may hold frames that are not shown.
///
/// # Errors
/// If there is no such program, or it cannot decode the video.
pub fn times(program: &Path, video: &Path, codec: &str) -> Result<Vec<f64>> {
    let mut command = command(program, video, None)?;
    command.args(each_once(program));
    // Times as the file has them, and not in frames of a rate.
    command.args(["-enc_time_base", "-1", "-c:v", "rawvideo", "-f", "framecrc", "-"]);
    let (mut process, output) = Process::start(command).map_err(|error| not_started(&error, codec))?;
    let mut scale = None;
    let mut ticks: Vec<i64> = Vec::new();
    let mut last = 0;
    for line in output.lines() {
        let line = line.map_err(|error| Error::new(format!("ffmpeg cannot decode it whole: {error}")))?;
        let fields = || line.split(',').map(|field| field.trim().parse::<i64>().ok());
        match line.strip_prefix("#tb 0: ").and_then(|scale| scale.split_once('/')) {
            Some((numerator, denominator)) => {
                scale = numerator.parse::<f64>().ok().zip(denominator.trim().parse::<f64>().ok());
            }
            None if line.starts_with('#') => {}
            None => match (fields().nth(2).flatten(), fields().nth(3).flatten()) {
                (Some(begins), Some(duration)) if ticks.len() < MOST => {
                    ticks.push(begins);
                    last = duration;
                }
                (Some(_), Some(_)) => {
                    return Err(Error::new(format!("it has more than {MOST} frames; cut it into parts")));
                }
                _ => {
                    return Err(because(&format!(
                        "its list of frames has the line `{}`",
                        line.escape_debug()
                    )));
                }
            },
        }
    }
    let (well, said) = process.finish();
    if !well || !said.is_empty() {
        return Err(because(&said));
    }
    let (Some((numerator, denominator)), Some(&first)) = (scale, ticks.first()) else {
        return Err(Error::new("it has no frames"));
    };
    if !ticks.is_sorted() {
        return Err(Error::new("ffmpeg gives its frames in another order than their times"));
    }
    let end = ticks.last().map_or(first, |begins| begins.saturating_add(last.max(1)));
    ticks.push(end);
    Ok(ticks.into_iter().map(|tick| (tick.saturating_sub(first)) as f64 * numerator / denominator).collect())
}

fn because(said: &str) -> Error {
    let reason = said.lines().find(|line| !line.trim().is_empty()).unwrap_or("it gives no reason").trim();
    Error::new(format!("ffmpeg cannot decode it whole: {reason}"))
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::stand_in::{program, within};

    fn start(script: &str) -> Result<Ffmpeg> {
        let folder = tempfile::tempdir().unwrap();
        Ffmpeg::start_with_alpha(&program(folder.path(), script), Path::new("clip.mkv"), "Matroska or WebM")
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
        let mut picture = Yuv420::default();
        assert!(frames.next(&mut picture).unwrap());
        assert_eq!((picture.width, picture.height), (3, 2));
        assert_eq!(picture.data, b"abcdefUUVV");
        assert_eq!(frames.end(), 1001.0 / 30000.0);
        assert!(frames.next(&mut picture).unwrap());
        assert_eq!(picture.planes()[2], b"YY");
        assert!(!frames.next(&mut picture).unwrap());
    }

    #[test]
    fn failures_are_reported_with_their_reason() {
        assert_eq!(
            message(start("echo 'clip.mkv: Invalid data found' >&2; exit 1")),
            "ffmpeg cannot decode it whole: clip.mkv: Invalid data found"
        );
        let folder = tempfile::tempdir().unwrap();
        let absent = Ffmpeg::start_with_alpha(
            &folder.path().join("ffmpeg"),
            Path::new("clip.mkv"),
            "Matroska or WebM",
        );
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
        assert!(cut.next(&mut Yuv420::default()).unwrap_err().to_string().ends_with("ends early"));
        let mut late =
            start(r"printf 'YUV4MPEG2 W3 H2 F30:1 C420jpeg\n'; echo 'corrupt' >&2; exit 3").unwrap();
        assert!(late.next(&mut Yuv420::default()).unwrap_err().to_string().ends_with("corrupt"));
    }

    #[test]
    fn a_flood_of_messages_blocks_neither_side_and_its_end_is_reported() {
        let error = within(20, || {
            let flood =
                "i=0; while [ $i -lt 20000 ]; do echo \"message $i of a flood\"; i=$((i + 1)); done >&2";
            let frame = r"printf 'FRAME\nabcdefUUVV'";
            let header = r"printf 'YUV4MPEG2 W3 H2 F30:1 C420jpeg\n'";
            let mut frames = start(&format!("{flood}; {header}; {frame}; {flood}; {frame}; cat")).unwrap();
            let mut picture = Yuv420::default();
            assert!(frames.next(&mut picture).unwrap() && frames.next(&mut picture).unwrap());
            frames.next(&mut picture).unwrap_err().to_string()
        });
        let line = error.strip_prefix("ffmpeg cannot decode it whole: message ").unwrap();
        let number = line.strip_suffix(" of a flood").unwrap_or_else(|| panic!("{error}"));
        assert!(number.parse::<u32>().unwrap() > 19_900, "{error}");
    }

    #[test]
    #[ignore = "long: .ci/run runs it"]
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
                let read = |frames: &mut Ffmpeg| frames.next(&mut Yuv420::default());
                let ended = Ffmpeg::start_with_alpha(&path, Path::new("clip.mkv"), "x")
                    .and_then(|mut frames| read(&mut frames));
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
        message(Ffmpeg::start_with_alpha(&path, Path::new("http:clip.mkv"), "Matroska or WebM"));
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
    #[ignore = "long: .ci/run runs it"]
    fn an_installed_ffmpeg_decodes_a_clip_and_refuses_what_is_too_large() {
        let Some(ffmpeg) = installed() else { return };
        let folder = tempfile::tempdir().unwrap();
        for name in ["clip.mkv", "clip.avi", "clip.nut"] {
            let clip = folder.path().join(name);
            make(&ffmpeg, "64x48", "ffv1", &clip);
            let mut frames = Ffmpeg::start_with_alpha(&ffmpeg, &clip, "a test").unwrap();
            let (mut picture, mut count) = (Yuv420::default(), 0);
            while frames.next(&mut picture).unwrap() {
                count += 1;
            }
            assert_eq!((picture.width, picture.height, frames.end(), count), (64, 48, 0.4, 10), "{name}");
        }
        let clip = folder.path().join("wide.mkv");
        make(&ffmpeg, "40000x40", "ffv1", &clip);
        let said = within(20, {
            let ffmpeg = ffmpeg.clone();
            move || message(Ffmpeg::start_with_alpha(&ffmpeg, &clip, "a test"))
        });
        assert!(said.starts_with("it is 40000 x 40, and pictures may have"), "{said}");
        let clip = folder.path().join("large.mkv");
        make(&ffmpeg, "8192x8208", "ffv1", &clip);
        let said = within(20, move || message(Ffmpeg::start_with_alpha(&ffmpeg, &clip, "a test")));
        assert!(said.starts_with("ffmpeg cannot decode it whole: "), "{said}");
    }

    #[test]
    fn alpha_comes_through_the_pipe_if_it_is_asked_for() {
        let script = r"printf 'YUV4MPEG2 W2 H1 F30:1 C444alpha\nFRAME\n\221\020\066\200\042\200\200\377'";
        let folder = tempfile::tempdir().unwrap();
        let program = program(folder.path(), script);
        let mut frames = Ffmpeg::start_with_alpha(&program, Path::new("clip.mkv"), "a test").unwrap();
        let mut planes = Vec::new();
        assert!(frames.has_alpha() && frames.next_with_alpha(&mut planes).unwrap());
        assert_eq!((frames.size(), planes.as_slice()), ((2, 1), &b"\x91\x10\x36\x80\x22\x80\x80\xff"[..]));
        assert!(!frames.next_with_alpha(&mut planes).unwrap());
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
            let said = within(20, move || message(Ffmpeg::start_with_alpha(&ffmpeg, &clip, "a test")));
            assert!(said.contains("whitelist"), "{name}: {said}");
        }
    }
}
