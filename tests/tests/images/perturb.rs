//! `pdk perturb` on several images and on standard input and output.

use std::fs;
use std::path::Path;

use pdk_tests::{Pdk, built, pictures, repository, temp};
use serde_json::Value;

/// Images of two sizes and two formats.
fn images(folder: &Path) {
    fs::create_dir(folder.join("in")).unwrap();
    for (name, width, height) in [("a.png", 64, 48), ("b.jpg", 40, 30), ("c.png", 64, 48)] {
        pictures::road(width, height, 3).save(folder.join("in").join(name)).unwrap();
    }
}

fn perturb(folder: &Path, arguments: &[&str]) -> Pdk {
    Pdk::new(["perturb", "--with", "gaussian_noise@3", "--with", "zigzag_mapping@2"])
        .args(arguments)
        .folder(folder)
}

#[test]
fn several_images_come_out_as_each_does_alone_with_the_number_of_its_frame() {
    let folder = temp();
    images(folder.path());
    let names = ["a.png", "b.jpg", "c.png"];
    let inputs = names.map(|name| format!("in/{name}"));
    let given: Vec<&str> =
        inputs.iter().map(String::as_str).chain(["-o", "out/deep", "--frame", "5", "--json"]).collect();
    let printed = perturb(folder.path(), &given).succeed().stdout;
    let printed: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(printed["outputs"], serde_json::json!(names.map(|name| format!("out/deep/{name}"))));
    for (number, name) in names.iter().enumerate() {
        let frame = (number + 5).to_string();
        perturb(folder.path(), &[&inputs[number], "-o", name, "--frame", &frame]).succeed();
        let [alone, together] = [name.to_string(), format!("out/deep/{name}")]
            .map(|file| fs::read(folder.path().join(file)).unwrap());
        assert!(alone == together, "{name}");
    }
    // Frames have luck of their own.
    let [first, third] =
        ["a.png", "c.png"].map(|name| fs::read(folder.path().join("out/deep").join(name)).unwrap());
    assert!(first != third);
    // One image goes into a folder, too, if it is there or is written as one.
    perturb(folder.path(), &["in/a.png", "-o", "one/", "--frame", "5"]).succeed();
    assert!(fs::read(folder.path().join("one/a.png")).unwrap() == first);
    perturb(folder.path(), &["in/a.png", "-o", "out", "--frame", "5"]).succeed();
    assert_eq!(fs::read(folder.path().join("out/a.png")).unwrap(), first);
}

#[test]
fn an_image_can_come_from_standard_input_and_go_to_standard_output() {
    let folder = temp();
    images(folder.path());
    perturb(folder.path(), &["in/b.jpg", "-o", "expected.png"]).succeed();
    let piped = |command: &str| {
        let program = built("pdk");
        let command = command.replace(
            "PDK",
            &format!("'{}' perturb --with gaussian_noise@3 --with zigzag_mapping@2", program.display()),
        );
        Pdk::program("sh").args(["-c", &command]).folder(folder.path())
    };
    piped("PDK - -o - < in/b.jpg > piped.png").succeed();
    piped("cat in/b.jpg | PDK - -o named.png").succeed();
    let expected = fs::read(folder.path().join("expected.png")).unwrap();
    for name in ["piped.png", "named.png"] {
        assert!(fs::read(folder.path().join(name)).unwrap() == expected, "{name}");
    }
    assert_eq!(
        piped("PDK - -o - < /dev/null").fail(1, &[]),
        "standard input: it is empty; send an image in JPEG, PNG, BMP or WebP"
    );
    let cut = piped("head -c 300 in/b.jpg | PDK - -o -").fail(1, &[]);
    assert!(cut.starts_with("standard input: ") && cut.contains("damaged"), "{cut}");
}

#[test]
fn what_cannot_be_written_for_several_images_is_refused_before_any_work() {
    let folder = temp();
    images(folder.path());
    fs::create_dir(folder.path().join("other")).unwrap();
    fs::copy(folder.path().join("in/a.png"), folder.path().join("other/a.png")).unwrap();
    let error = |arguments: &[&str]| perturb(folder.path(), arguments).fail(1, &[]);
    assert_eq!(
        error(&["in/a.png", "in/b.jpg", "-o", "in/c.png"]),
        "there are 2 images, but `in/c.png` is a file; name a folder with -o"
    );
    assert_eq!(
        error(&["in/a.png", "in/b.jpg", "-o", "-"]),
        "there are 2 images, but `-` is standard output, which takes one; name a folder with -o"
    );
    assert!(
        error(&["in/a.png", "other/a.png", "-o", "out"])
            .contains("`in/a.png` and `other/a.png` have the same name")
    );
    assert!(error(&["in/a.png", "in/b.jpg", "-o", "in"]).contains("the result would replace in/a.png"));
    assert!(
        error(&["in/a.png", "-", "-o", "out"]).contains("`-` has no name for its result in the folder `out`")
    );
    let video = repository().join("docs/examples/drive.mp4").display().to_string();
    let mixed = error(&["in/a.png", &video, "-o", "out"]);
    assert!(mixed.contains("drive.mp4` is a video, which has to be given alone"), "{mixed}");
    assert!(error(&["in/a.png", "in", "-o", "out"]).contains("`in` is a folder; name the images in it"));
    assert!(
        error(&["in/a.png", "in/b.jpg", "-o", "new.png"])
            .contains("`new.png` is the name of one image; name a folder")
    );
    assert!(error(&["in/a.png", "-o", "-", "--json"]).contains("both write to standard output"));
    assert!(!folder.path().join("out").exists() && !folder.path().join("new.png").exists());
}
