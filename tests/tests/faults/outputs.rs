//! What is written is there whole, or what was there before: with a full disk, too.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_tests::process::pipeline;
use pdk_tests::records::partial;
use pdk_tests::{Pdk, built, pictures, temp};

/// `pdk` whose files may have this many blocks of 512 bytes: what a full disk does to a write, in the middle of a file.
fn short_of_space(blocks: u32, folder: &Path) -> Pdk {
    Pdk::program("sh")
        .arg("-c")
        .arg(format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\""))
        .arg(built("pdk"))
        .folder(folder)
}

#[test]
fn a_full_disk_leaves_what_was_there() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 320, 160);
    let script = pipeline(
        folder.path(),
        "pdk.drive({ simulator = { name = 'lane', width = 160, height = 80 }, driver = 'lane_keeper', duration = 2, \
           failure = { lane_departure = 0.0001 }, scenarios = { { name = 'n' } } })",
    );
    Pdk::new(["run", "--out", "record"]).arg(&script).folder(folder.path()).succeed();
    let cases: [(u32, &str, &[&str]); 7] = [
        (16, "out.png", &["perturb", "in.png", "--with", "gaussian_noise@4", "-o", "out.png"]),
        (16, "shown/sheet.png", &["preview", "in.png", "-o", "shown", "--with", "contrast"]),
        (8, "report.html", &["report", "record", "-o", "report.html"]),
        (8, "published.json", &["export", "record", "-o", "published.json"]),
        (8, "pages/README.md", &["reference", "pages"]),
        (1, "road.svg", &["road", "--seed", "1", "-o", "road.svg"]),
        (
            16,
            "maps/in.gradient.png",
            &["saliency", "in.png", "--driver", "dave2", "--with", "gradient", "-o", "maps"],
        ),
    ];
    for (blocks, written, arguments) in cases {
        // It is the file that is meant, and it is longer than it may be.
        let path = folder.path().join(written);
        Pdk::new(arguments).folder(folder.path()).succeed();
        let length = fs::metadata(&path).unwrap_or_else(|error| panic!("{written}: {error}")).len();
        assert!(length > u64::from(blocks) * 512, "{written} has {length} bytes");
        fs::write(&path, "of before").unwrap();
        let finished = short_of_space(blocks, folder.path()).args(arguments).run();
        assert_eq!(finished.code, Some(1), "{written}: {}{}", finished.stdout, finished.stderr);
        assert!(finished.stderr.contains("File too large"), "{written}: {}", finished.stderr);
        assert_eq!(fs::read(&path).unwrap(), b"of before", "{written}");
        assert_eq!(partial(folder.path()), Vec::<PathBuf>::new(), "{written}");
    }
    // What is not there yet stays so, and is written once there is space.
    let arguments = ["road", "--seed", "1", "-o", "new.svg"];
    short_of_space(1, folder.path()).args(arguments).fail(1, &["new.svg", "File too large"]);
    assert!(!folder.path().join("new.svg").exists());
    Pdk::new(arguments).folder(folder.path()).succeed();
    assert!(fs::read_to_string(folder.path().join("new.svg")).unwrap().contains("</svg>"));
}

#[test]
fn a_device_and_a_link_are_written_to_and_stay_what_they_are() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 32, 16);
    std::os::unix::fs::symlink("real.png", folder.path().join("link.png")).unwrap();
    fs::write(folder.path().join("real.png"), "of before").unwrap();
    let perturb =
        |to: &str| Pdk::new(["perturb", "in.png", "--with", "contrast@1", "-o", to]).folder(folder.path());
    perturb("link.png").succeed();
    assert!(fs::symlink_metadata(folder.path().join("link.png")).unwrap().is_symlink());
    assert!(fs::read(folder.path().join("real.png")).unwrap().starts_with(b"\x89PNG"));
    Pdk::new(["road", "--seed", "1", "-o", "/dev/null"]).folder(folder.path()).fail(1, &[".svg"]);
    std::os::unix::fs::symlink("/dev/null", folder.path().join("null.svg")).unwrap();
    Pdk::new(["road", "--seed", "1", "-o", "null.svg"]).folder(folder.path()).succeed();
    assert!(!fs::metadata("/dev/null").unwrap().is_file());
}

#[test]
fn a_folder_is_not_made_under_the_name_of_a_file() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 32, 16);
    fs::create_dir(folder.path().join("there.png")).unwrap();
    let cases: [(&str, &[&str]); 4] = [
        ("sheet.PNG", &["preview", "in.png", "--with", "contrast"]),
        ("out.mp4", &["corrupt", ".", "--with", "contrast@1"]),
        ("map.jpg", &["saliency", "in.png", "--driver", "dave2", "--with", "gradient"]),
        ("out.csv", &["export", "record", "--to", "csv"]),
    ];
    for (name, arguments) in cases {
        let stem = name.split('.').next().unwrap();
        let remedy = format!(
            "{name} is named like a file, but several files are written, and -o names the folder for them; name a folder \
                              such as {stem}"
        );
        Pdk::new(arguments).args(["-o", name]).folder(folder.path()).fail(1, &[&remedy]);
        assert!(!folder.path().join(name).exists());
    }
    Pdk::new(["preview", "in.png", "--with", "contrast", "-o", "there.png"]).folder(folder.path()).succeed();
    assert!(folder.path().join("there.png/sheet.png").is_file());
}
