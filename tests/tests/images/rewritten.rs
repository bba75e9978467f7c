//! `pdk corrupt`: recordings whose frames are not files of their own are written in the form that they have.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use pdk_tests::process::{LIMIT, json_file};
use pdk_tests::processes::{comes_true, signal};
use pdk_tests::records::{assert_equal, files, wait_for_lines};
use pdk_tests::{Pdk, temp};
use rustix::process::Signal;
use serde_json::{Value, json};

use crate::corrupt::MIRROR;

/// A plugin that does what an exact copy shows: the negative, and at level 0 nothing.
const NEGATIVE: &str = "return { doc = 'Negative', geometry = 'kept', apply = function(image, cx)
        if cx.intensity == 0 then return end
        for at = 0, image.width * image.height * 3 - 1 do
            buffer.writeu8(image.pixels, at, 255 - buffer.readu8(image.pixels, at))
        end
    end }";

fn written(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../plugins/datasets/tests/written").join(name)
}

fn corrupt(folder: &Path, dataset: &str, more: &[&str], out: &str) -> Pdk {
    fs::write(folder.join("negative.lua"), NEGATIVE).unwrap();
    fs::write(folder.join("mirror.lua"), MIRROR).unwrap();
    let plugins = ["--plugins", "negative.lua", "--plugins", "mirror.lua"];
    Pdk::new(["corrupt", dataset, "-o", out]).args(plugins).args(more).folder(folder)
}

/// The pictures and the records of a recording, as a copy has them that is plain.
fn plain(folder: &Path, dataset: &str, with: &str, out: &str) -> Vec<(String, Vec<u8>)> {
    corrupt(folder, dataset, &["--with", with, "--plain"], out).succeed();
    let here = folder.join(out).join(with.replace('@', "/"));
    let mut found: Vec<_> = fs::read_dir(here)
        .unwrap()
        .map(|entry| {
            let path = entry.unwrap().path();
            (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(path).unwrap())
        })
        .collect();
    found.sort();
    found
}

fn has_ffmpeg() -> bool {
    let there = Command::new("ffmpeg").arg("-version").output().is_ok();
    if !there {
        println!("skipped what needs ffmpeg: it is not on the PATH");
    }
    there
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn recordings_come_out_in_their_own_form() {
    let folder = temp();
    let mut forms = vec![
        ("mcap", "ros2.mcap", ",image=/rgb8,full_lock=-1", 6, false),
        ("mcap", "foxglove.mcap", ",image=/h264", 6, true),
        ("rosbag2", "bag", ",full_lock=1", 6, false),
        ("rosbag2", "bag_sqlite", ",full_lock=1", 6, false),
        ("video", "video/b_frames_mp4", "", 6, true),
        ("lerobot", "lerobot_2", "", 12, true),
    ];
    if has_ffmpeg() {
        forms.push(("lerobot", "lerobot_3", "", 12, true));
        forms.push(("comma2k19", "comma2k19", ",full_lock=-400", 6, true));
    }
    for (reader, name, parameters, count, is_lossy) in forms {
        let dataset = format!("{reader},path={}{parameters}", written(name).display());
        let out = format!("{}_out", name.replace(['/', '.'], "_"));
        let done =
            corrupt(folder.path(), &dataset, &["--with", "negative@0..1", "--json"], &out).succeed().json();
        assert_eq!(done["read_as"], format!("a recording, read by `{reader}`"));
        assert_eq!(
            (&done["pictures"], &done["pictures_written"]),
            (&json!(count), &json!(2 * count)),
            "{name}"
        );
        let manifest = json_file(&folder.path().join(&out).join("manifest.json"));
        let stored = manifest["settings"]["stored"].as_object().unwrap();
        assert!(
            stored.values().all(|how| how.as_str().unwrap().contains("lossy") || !is_lossy),
            "{stored:?}"
        );
        let copy = folder.path().join(&out).join("negative/1");
        let root = if written(name).is_file() { written("") } else { written(name) };
        for file in manifest["files"].as_array().unwrap() {
            let name = file["file"].as_str().unwrap();
            let content = fs::read(copy.join(name)).unwrap();
            assert_eq!(file["written"]["negative/1"], blake3::hash(&content).to_hex().to_string(), "{name}");
            // What is not of the pictures is carried over.
            let original = root.join(name);
            assert!(original.is_file());
            assert_eq!(content == fs::read(original).unwrap(), !stored.contains_key(name), "{name}");
        }
        let place = if written(name).is_file() { copy.join(name) } else { copy };
        let again = format!("{reader},path={}{parameters}", place.display());
        let expected = plain(folder.path(), &dataset, "negative@1", &format!("{out}_expected"));
        let found = plain(folder.path(), &again, "negative@0", &format!("{out}_found"));
        assert_eq!(expected.len(), 2 * count);
        for ((name, old), (same, new)) in expected.iter().zip(&found) {
            assert_eq!(name, same);
            if name.ends_with(".png") && is_lossy {
                let [old, new] = [old, new].map(|bytes| pdk_image::decode(bytes).unwrap().into_rgb8());
                let off: u64 = old.iter().zip(new.iter()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
                assert!(off < 8 * old.len() as u64, "{out} {name}");
            } else {
                assert!(old == new, "{out} {name}");
            }
        }
    }
}

#[test]
fn a_kill_changes_no_byte_of_a_recording() {
    let folder = temp();
    let dataset = format!("lerobot,path={}", written("lerobot_2").display());
    let with =
        ["--with", "gaussian_noise@1..4,frozen_frames@3,fog_filter@0..4", "--labels", "keep", "--seed", "9"];
    let run =
        |workers: &str, out: &str| corrupt(folder.path(), &dataset, &with, out).args(["--workers", workers]);
    run("1", "one").succeed();
    let expected = files(&folder.path().join("one"));
    run("4", "four").succeed();
    assert_equal(&folder.path().join("four"), &expected);
    let out = folder.path().join("killed");
    let mut child = run("2", "killed").spawn();
    wait_for_lines(&mut child, &out.join(".manifest.journal"), 8);
    signal(&child, Signal::KILL);
    child.wait().unwrap();
    assert!(!out.join("manifest.json").exists(), "it was done before it was killed");
    let mut done = Value::Null;
    let continued = comes_true(LIMIT, || {
        let run = run("3", "killed").arg("--json").run();
        if run.code == Some(0) {
            done = run.json();
        }
        run.code == Some(0) || !run.stderr.contains("another process writes")
    });
    assert!(continued && done["there"].as_u64().unwrap() >= 6, "{done}");
    assert_equal(&out, &expected);
}

#[test]
fn mirrors_turn_the_steering_of_a_recording_or_are_refused() {
    let folder = temp();
    let steering = |dataset: &str, out: &str| -> Vec<f64> {
        let found = plain(folder.path(), dataset, "negative@0", out);
        let records = found.iter().filter(|(name, _)| name.ends_with(".json"));
        let records = records.map(|(_, record)| serde_json::from_slice::<Value>(record).unwrap());
        records.map(|record| record["user/angle"].as_f64().unwrap()).collect()
    };
    for (reader, name, parameters) in [
        ("rosbag2", "bag", ",full_lock=1"),
        ("rosbag2", "bag_sqlite", ",full_lock=1"),
        ("video", "video/b_frames_mp4", ""),
    ] {
        let dataset = format!("{reader},path={}{parameters}", written(name).display());
        let out = name.replace('/', "_");
        corrupt(folder.path(), &dataset, &["--with", "mirror@1"], &out).succeed();
        let before = steering(&dataset, &format!("{out}_before"));
        let copy =
            format!("{reader},path={}{parameters}", folder.path().join(&out).join("mirror/1").display());
        let after = steering(&copy, &format!("{out}_after"));
        assert!(
            before.iter().zip(&after).all(|(a, b)| *a == -b) && before.iter().any(|a| *a != 0.0),
            "{after:?}"
        );
    }
    let lerobot = format!("lerobot,path={}", written("lerobot_2").display());
    let with = ["--with", "mirror@1"];
    corrupt(folder.path(), &lerobot, &with, "refused").fail(1, &["mirrors the frames", "Parquet", "--plain"]);
    assert!(!folder.path().join("refused/mirror").exists());
    corrupt(folder.path(), &lerobot, &["--with", "mirror@1", "--labels", "keep"], "kept").succeed();
    for more in [["--labels", "drop"], ["--format", "png"]] {
        let with = [&["--with", "negative@1"][..], &more].concat();
        corrupt(folder.path(), &lerobot, &with, "refused").fail(1, &["--plain"]);
    }
}
