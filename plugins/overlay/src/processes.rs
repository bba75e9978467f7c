//! Tests of several processes that prepare clips in one cache folder.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::clip::Clip;
use crate::prepare::{self, Settings};
use crate::scale::Fit;
use crate::stand_in::{program, wait_until};

const FOLDER: &str = "PDK_OVERLAY_TEST_FOLDER";

/// What the other processes do: prepares the clip of the folder that [`FOLDER`] names.
#[test]
#[ignore = "is started by the other tests of this file"]
fn worker() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else { return };
    let clip = Clip::Path(folder.join("clip.mkv"));
    let settings = Settings { key: None, fit: Fit::Cover, seconds: 30.0 };
    let hash = clip.hash().unwrap();
    let store = prepare::open(&clip, &hash, &settings, (32, 24), &folder.join("cache")).unwrap();
    assert_eq!((store.index().frames, store.index().rate), (12, 25.0));
}

/// Begins a process that does what [`worker`] says, with the stand-in for ffmpeg that lies in the folder. The stand-in is
/// written before: replacing it takes it away for a moment from processes that already run.
fn begin(folder: &Path) -> Child {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::iter::once(folder.to_owned()).chain(std::env::split_paths(&path));
    Command::new(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "processes::worker", "--nocapture"])
        .env("PATH", std::env::join_paths(path).unwrap())
        .env(FOLDER, folder)
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

/// A folder with a clip that the built-in decoders leave to ffmpeg, and what ffmpeg would give for it: a dark square that
/// goes to the right before a green screen.
fn folder_with_clip() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("clip.mkv"), b"\x1a\x45\xdf\xa3 of a kind").unwrap();
    let mut frames = b"YUV4MPEG2 W64 H48 F25:1 C420jpeg\n".to_vec();
    for number in 0..12 {
        frames.extend_from_slice(b"FRAME\n");
        for (size, screen, square) in [(1, 145, 40), (2, 54, 128), (2, 34, 128)] {
            let inside =
                |x: usize, y: usize| (8 + 2 * number..24 + 2 * number).contains(&x) && (16..32).contains(&y);
            let (width, height) = (64 / size, 48 / size);
            frames.extend(
                (0..width * height)
                    .map(|i| if inside(i % width * size, i / width * size) { square } else { screen }),
            );
        }
    }
    std::fs::write(folder.path().join("frames"), frames).unwrap();
    folder
}

#[test]
fn processes_that_want_the_same_clip_prepare_it_once() {
    let folder = folder_with_clip();
    let place = folder.path().display();
    // Half a second is enough for all to come and find that it is being prepared.
    let script = format!("echo started >> '{place}/log'; sleep 0.5; exec cat '{place}/frames'");
    program(folder.path(), &script);
    let workers: Vec<Child> = (0..4).map(|_| begin(folder.path())).collect();
    for mut worker in workers {
        assert!(worker.wait().unwrap().success());
    }
    // One looked for the screen, and then read the clip.
    let log = std::fs::read_to_string(folder.path().join("log")).unwrap();
    assert_eq!(log.lines().count(), 2, "{log}");
    let left: Vec<_> = std::fs::read_dir(folder.path().join("cache"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .filter(|name| name != "CACHEDIR.TAG")
        .collect();
    assert!(left.len() == 1 && left[0].to_string_lossy().ends_with(".clip"), "{left:?}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_killed_process_leaves_neither_ffmpeg_nor_its_turn() {
    let folder = folder_with_clip();
    let place = folder.path().display();
    let number = folder.path().join("number");
    let hanging = format!("echo $$ > '{place}/number'; exec sleep 100");
    program(folder.path(), &hanging);
    let mut killed = begin(folder.path());
    wait_until("ffmpeg is started", || {
        std::fs::read_to_string(&number).is_ok_and(|text| text.ends_with('\n'))
    });
    assert!(crate::stand_in::runs(&number));
    // Another one waits already.
    program(folder.path(), &format!("exec cat '{place}/frames'"));
    let mut waiting = begin(folder.path());
    killed.kill().unwrap();
    killed.wait().unwrap();
    wait_until("ffmpeg is gone", || !crate::stand_in::runs(&number));
    assert!(waiting.wait().unwrap().success());
}
