//! `pdk perturb` on videos: as many frames, in their own time, the same bytes every time, and nothing half-written.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};

use pdk_sdk::prelude::FrameBuf;
use pdk_tests::records::partial;
use pdk_tests::{Pdk, pictures, real_data, temp};
use pdk_video::{Reader, Writer, Yuv420};

const SIZE: (usize, usize) = (96, 64);
const RATE: f64 = 12.5;

/// A clip of a road that shakes.
fn clip(path: &Path, frames: u32) {
    let (width, height) = SIZE;
    let mut writer = Writer::create(path, width, height, RATE).unwrap();
    for number in 0..frames {
        let road = pictures::road(width as u32, height as u32, number).into_raw();
        writer.push(FrameBuf::from_vec(road, width, height).unwrap().as_ref()).unwrap();
    }
    writer.finish().unwrap();
}

/// The frames of a video, and how many there are in a second.
fn frames(path: &Path) -> (Vec<FrameBuf>, f64) {
    let mut reader = Reader::open_file(path).unwrap();
    let mut planes = Yuv420::default();
    let mut frames = Vec::new();
    while reader.next(&mut planes).unwrap() {
        let mut frame = FrameBuf::new(planes.width, planes.height);
        planes.to_rgb(frame.as_mut());
        frames.push(frame);
    }
    (frames, reader.rate())
}

fn perturb(folder: &Path, video: &str, with: &str, output: &str) -> Pdk {
    Pdk::new(["perturb", video, "--with", with, "-o", output]).folder(folder)
}

/// The mean difference of two frames in grey levels.
fn difference(a: &FrameBuf, b: &FrameBuf) -> f64 {
    assert_eq!((a.width(), a.height()), (b.width(), b.height()));
    let sum: u64 = a.data().iter().zip(b.data()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.data().len() as f64
}

#[test]
fn a_video_becomes_a_video_of_the_same_size_length_and_rate() {
    let folder = temp();
    // What it contains decides, not its name.
    let video = folder.path().join("drive.bin");
    clip(&video, 15);
    let said = perturb(folder.path(), "drive.bin", "rotate_image@3", "new/out.mp4").succeed().stdout;
    assert!(said.starts_with("new/out.mp4: 15 frames, "), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");

    let ((before, _), (after, rate)) = (frames(&video), frames(&folder.path().join("new/out.mp4")));
    assert_eq!((after.len(), rate), (15, RATE));
    for (number, (before, after)) in before.iter().zip(&after).enumerate() {
        assert!(difference(before, after) > 5.0, "frame {number} is as it was");
    }
    let left: Vec<_> = fs::read_dir(folder.path().join("new")).unwrap().collect();
    assert_eq!(left.len(), 1, "{left:?}");
}

#[test]
fn what_is_done_to_a_frame_is_what_is_done_to_an_image() {
    let folder = temp();
    clip(&folder.path().join("drive.mp4"), 10);
    // Changes with the time, and draws anew for each frame.
    let fog = r#"fog_filter,level={"ramp":{"from":0,"to":4,"end":1}}"#;
    for with in [fog, "gaussian_noise@1"] {
        perturb(folder.path(), "drive.mp4", with, "out.mp4").args(["--seed", "5"]).succeed();
        let (before, _) = frames(&folder.path().join("drive.mp4"));
        let (after, _) = frames(&folder.path().join("out.mp4"));
        for number in [0, 4, 9] {
            let image = image::RgbImage::from_raw(96, 64, before[number].data().to_vec()).unwrap();
            image.save(folder.path().join("in.png")).unwrap();
            let time = number as f64 / RATE;
            perturb(folder.path(), "in.png", with, "out.png")
                .args(["--seed", "5", "--frame", &number.to_string(), "--time", &time.to_string()])
                .succeed();
            let alone = pdk_image::read(&folder.path().join("out.png")).unwrap();
            // A video keeps a fourth of the colour.
            let close = difference(&alone, &after[number]);
            let other = difference(&alone, &after[(number + 5) % 10]);
            assert!(close < 0.7 * other, "{with}, frame {number}: {close} to its own, {other} to another");
        }
    }
}

#[test]
fn the_same_command_gives_the_same_bytes() {
    let folder = temp();
    clip(&folder.path().join("drive.mp4"), 12);
    let run = |seed: &str, output: &str| {
        let command = perturb(folder.path(), "drive.mp4", "gaussian_noise@2", output);
        let said =
            command.args(["--with", "dynamic_rain_filter@3", "--json", "--seed", seed]).succeed().json();
        assert_eq!((&said["frames"], &said["frames_per_second"]), (&12.into(), &RATE.into()));
        assert_eq!((&said["width"], &said["height"]), (&96.into(), &64.into()));
        fs::read(folder.path().join(output)).unwrap()
    };
    let first = run("1", "a.mp4");
    assert_eq!(first, run("1", "b.mp4"));
    assert_ne!(first, run("2", "c.mp4"));
}

#[test]
fn an_overlay_moves_over_a_video_in_its_own_time() {
    let folder = temp();
    let overlays = folder.path().join("overlays");
    // A red square that goes to the right over a green screen, a pixel a frame at 25 frames a second.
    let mut writer = Writer::create(overlays.join("square.mp4"), 96, 64, 25.0).unwrap();
    for number in 0..50 {
        let pixels = (0..96 * 64).flat_map(|i| {
            let (x, y) = (i % 96, i / 96);
            let inside = (20..44).contains(&y) && (number..number + 24).contains(&x);
            if inside { [220u8, 20, 20] } else { [0, 220, 25] }
        });
        writer.push(FrameBuf::from_vec(pixels.collect(), 96, 64).unwrap().as_ref()).unwrap();
    }
    writer.finish().unwrap();
    clip(&folder.path().join("drive.mp4"), 20);
    perturb(folder.path(), "drive.mp4", "square@4", "out.mp4")
        .args(["--drop-ins".as_ref(), overlays.as_os_str()])
        .env("PDK_CACHE", folder.path().join("cache"))
        .succeed();
    let (after, _) = frames(&folder.path().join("out.mp4"));
    assert_eq!(after.len(), 20);
    // Where the red is, on average over a row through the square.
    let centre = |frame: &FrameBuf| {
        let red = |x: usize| {
            let [r, g, _] = frame.as_ref().pixel(x, 32);
            f64::from(r > 150 && g < 100)
        };
        let sum: f64 = (0..96).map(red).sum();
        assert!(sum > 10.0, "no square");
        (0..96).map(|x| red(x) * x as f64).sum::<f64>() / sum
    };
    // Two frames of the clip for one of the video.
    let moved = centre(&after[15]) - centre(&after[5]);
    assert!((moved - 20.0).abs() < 3.0, "{moved} pixels in ten frames");
}

/// When each frame of a video begins and the last one ends, in seconds.
fn times(path: &Path) -> Vec<f64> {
    let reader = Reader::open_file(path).unwrap();
    (0..=reader.count()).map(|frame| reader.time(frame)).collect()
}

#[test]
fn frames_keep_times_of_their_own() {
    let folder = temp();
    let ends = [0.1, 0.5, 0.54, 0.6, 1.6, 1.7];
    let mut writer = Writer::create(folder.path().join("drive.mp4"), 96, 64, 6.0 / 1.7).unwrap();
    for (number, end) in ends.into_iter().enumerate() {
        let road = pictures::road(96, 64, number as u32).into_raw();
        writer.push_until(FrameBuf::from_vec(road, 96, 64).unwrap().as_ref(), end).unwrap();
    }
    writer.finish().unwrap();
    // The fog is at level 0 until 0.55 s, then at level 4, so only frames that begin later change.
    let fog = r#"fog_filter,level={"points":[[0.55,0],[0.56,4]]}"#;
    perturb(folder.path(), "drive.mp4", fog, "out.mp4").succeed();
    perturb(folder.path(), "drive.mp4", "fog_filter@0", "clear.mp4").succeed();
    let out = folder.path().join("out.mp4");
    assert_eq!(times(&out), [0.0, 0.1, 0.5, 0.54, 0.6, 1.6, 1.7]);
    let ((foggy, _), (clear, _)) = (frames(&out), frames(&folder.path().join("clear.mp4")));
    let differ: Vec<bool> = foggy.iter().zip(&clear).map(|(a, b)| difference(a, b) > 5.0).collect();
    assert_eq!(differ, [false, false, false, false, true, true]);
}

#[test]
fn unusual_videos_are_read_as_ffmpeg_reads_them_and_sound_is_missed() {
    compare_with_ffmpeg(&["attacks/rot.mp4", "attacks/vfr.mp4", "attacks/av.mp4"]);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn recordings_are_read_as_ffmpeg_reads_them() {
    compare_with_ffmpeg(&["overlays/birds.mp4", "road/solidWhiteRight.mp4"]);
}

fn compare_with_ffmpeg(videos: &[&str]) {
    for video in videos.iter().filter_map(|name| real_data(name)) {
        let name = video.file_name().unwrap().to_str().unwrap();
        let folder = temp();
        let said = perturb(folder.path(), video.to_str().unwrap(), "contrast@0", "out.mp4").succeed();
        let silent = said.stderr.is_empty();
        let warning =
            format!("pdk: warning: video `{}` has sound, which the result does not have", video.display());
        assert!(silent || said.stderr.trim() == warning, "{name}: {}", said.stderr);
        assert_eq!(silent, !Reader::open_file(&video).unwrap().has_sound(), "{name}");
        assert!(name != "av.mp4" || !silent);
        let read = times(&video);
        let rounded = |times: &[f64]| times.iter().map(|time| (time * 90_000.0).round()).collect::<Vec<_>>();
        assert_eq!(rounded(&times(&folder.path().join("out.mp4"))), rounded(&read), "{name}");

        let ffmpeg = |format: &str| {
            let mut command = Command::new("ffmpeg");
            command.args(["-v", "error", "-nostdin", "-i"]).arg(&video).args(["-map", "0:v:0"]);
            command.args(["-vsync", "passthrough", "-pix_fmt", "yuv420p", "-enc_time_base", "-1"]);
            command.args(["-f", format, "-"]).stdout(Stdio::piped()).spawn()
        };
        let Ok(mut theirs) = ffmpeg("rawvideo") else {
            eprintln!("skipped: ffmpeg is not installed, so its frames are not compared");
            return;
        };
        let mut reader = Reader::open_file(&video).unwrap();
        let (mut planes, mut frame) = (Yuv420::default(), Vec::new());
        let mut stream = theirs.stdout.take().unwrap();
        for number in 0..reader.count() {
            assert!(reader.next(&mut planes).unwrap());
            frame.resize(planes.data.len(), 0);
            stream.read_exact(&mut frame).unwrap();
            let unequal = planes.data.iter().zip(&frame).filter(|(ours, theirs)| ours != theirs);
            let apart: Vec<u8> = unequal.map(|(ours, theirs)| ours.abs_diff(*theirs)).collect();
            // OpenH264 smooths some edges in frames that lean on later ones a little less than the standard says.
            let close = apart.len() * 1000 < frame.len() && apart.iter().all(|&apart| apart <= 4);
            assert!(
                close,
                "{name}, frame {number}: {} values, by up to {:?}",
                apart.len(),
                apart.iter().max()
            );
        }
        assert_eq!((reader.next(&mut planes).unwrap(), stream.read(&mut [0]).unwrap()), (false, 0), "{name}");
        assert!(theirs.wait().unwrap().success(), "{name}");
        // Lines of stream, times and so on; a comment says what a tick is.
        let listed =
            String::from_utf8(ffmpeg("framehash").unwrap().wait_with_output().unwrap().stdout).unwrap();
        let tick = listed.lines().find_map(|line| line.strip_prefix("#tb 0: ")).unwrap();
        let (numerator, denominator) = tick.split_once('/').unwrap();
        let tick = numerator.parse::<f64>().unwrap() / denominator.parse::<f64>().unwrap();
        let begins = listed.lines().filter(|line| !line.starts_with('#'));
        let begins = begins.map(|line| line.split(',').nth(2).unwrap().trim().parse::<f64>().unwrap() * tick);
        let begins: Vec<f64> = begins.collect();
        assert_eq!(begins.len() + 1, read.len(), "{name}");
        for (frame, (ours, theirs)) in read.iter().zip(&begins).enumerate() {
            assert!((ours - (theirs - begins[0])).abs() < 1e-4, "{name}, frame {frame}: {ours} and {theirs}");
        }
    }
}

#[test]
fn videos_that_cannot_be_read_are_named_and_leave_nothing() {
    let folder = temp();
    let path = |name: &str| folder.path().join(name);
    clip(&path("drive.mp4"), 6);
    let whole = fs::read(path("drive.mp4")).unwrap();
    fs::write(path("index.mp4"), &whole[..whole.len() - 10]).unwrap();
    fs::write(path("half.mp4"), &whole[..whole.len() / 2]).unwrap();
    fs::write(path("empty.mp4"), "").unwrap();
    fs::write(path("text.mp4"), "no video").unwrap();
    fs::write(path("other.mp4"), b"\x1a\x45\xdf\xa3\x01\0\0\0\0\0\0\0").unwrap();
    // The first frame is there by its length, but not what is in it.
    let mut blank = whole.clone();
    let at = blank.windows(4).position(|w| w == b"mdat").unwrap() + 12;
    blank[at + 5..at + 400].fill(0xff);
    fs::write(path("blank.mp4"), blank).unwrap();
    // The first frame is whole; of the last one a part was never written.
    let mut later = whole.clone();
    let index = later.windows(4).position(|w| w == b"moov").unwrap();
    later[index - 60..index - 10].fill(0);
    fs::write(path("later.mp4"), later).unwrap();
    // The handler of the only track is one of sound.
    let mut sound = whole.clone();
    let at = sound.windows(4).position(|w| w == b"vide").unwrap();
    sound[at..at + 4].copy_from_slice(b"soun");
    fs::write(path("sound.mp4"), sound).unwrap();
    for (name, reason) in [
        ("index.mp4", "it is cut off"),
        ("half.mp4", "it is cut off"),
        ("empty.mp4", "is empty"),
        ("text.mp4", "is neither a video nor an image"),
        ("other.mp4", "ffmpeg"),
        ("blank.mp4", "damaged"),
        ("later.mp4", "damaged"),
        ("sound.mp4", "it has no video track"),
        ("missing.mp4", "does not exist"),
    ] {
        perturb(folder.path(), name, "contrast@1", "out.mp4").fail(1, &[name, reason]);
        assert!(!path("out.mp4").exists() && partial(folder.path()).is_empty(), "{name}");
    }
}

#[test]
fn the_result_is_of_the_same_sort_as_the_input() {
    let folder = temp();
    clip(&folder.path().join("drive.mp4"), 2);
    pictures::write(&folder.path().join("in.png"), 64, 48);
    perturb(folder.path(), "drive.mp4", "contrast@1", "out.png").fail(1, &["drive.mp4", "out.png", ".mp4"]);
    perturb(folder.path(), "in.png", "contrast@1", "out.mp4").fail(1, &["in.png", "out.mp4", ".png"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn a_component_that_fails_in_the_middle_leaves_what_was_there() {
    let folder = temp();
    clip(&folder.path().join("drive.mp4"), 8);
    fs::write(folder.path().join("out.mp4"), "of before").unwrap();
    let script = "return {
        doc = 'Breaks at frame 4', family = 'custom',
        apply = function(image, cx) if cx.frame_index == 4 then error('enough') end end,
    }";
    fs::create_dir(folder.path().join("scripts")).unwrap();
    fs::write(folder.path().join("scripts/breaks.lua"), script).unwrap();
    perturb(folder.path(), "drive.mp4", "breaks@1", "out.mp4")
        .args(["--plugins", "scripts"])
        .fail(1, &["breaks", "enough"]);
    assert_eq!(fs::read(folder.path().join("out.mp4")).unwrap(), b"of before");
    assert_eq!(partial(folder.path()), Vec::<std::path::PathBuf>::new());
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_recorded_drive_is_perturbed_whole() {
    let Some(drive) = real_data("road/solidWhiteRight.mp4") else { return };
    let folder = temp();
    let drive = drive.to_str().unwrap();
    let said =
        perturb(folder.path(), drive, "dynamic_rain_filter@3", "out.mp4").arg("--json").succeed().json();
    let (count, size) = (Reader::open_file(Path::new(drive)).unwrap().count(), (960, 540));
    assert_eq!((&said["frames"], &said["frames_per_second"]), (&count.into(), &25.0.into()));
    let reader = Reader::open_file(&folder.path().join("out.mp4")).unwrap();
    assert_eq!((reader.count(), reader.rate()), (count, 25.0));
    assert_eq!((said["width"].as_u64(), said["height"].as_u64()), (Some(size.0), Some(size.1)));
}
