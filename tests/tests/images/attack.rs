//! Pictures that make a driver steer elsewhere, on the command line: trained by `pdk attack`, shown by perturbations.

use std::fs;
use std::path::Path;

use pdk_tests::{Pdk, repository, temp};
use serde_json::Value;

/// `pdk attack` on the frames that come along, with few steps.
fn attack(folder: &Path, arguments: &[&str]) -> Pdk {
    let frames = repository().join("docs/examples/recording");
    Pdk::new(["attack", arguments[0]])
        .arg(frames)
        .args(["--count", "8", "--steps", "6", "--batch", "1"])
        .args(&arguments[1..])
        .folder(folder)
}

#[test]
fn a_picture_is_trained_measured_and_shown_and_comes_out_the_same_again() {
    let folder = temp();
    for (kind, name, more) in [
        ("universal", "universal_perturbation@3", &["--under", "gaussian_noise@0", "--goal", "right"][..]),
        ("patch", "adversarial_patch@4", &["--size", "3", "--near", "4", "--far", "12"]),
    ] {
        let run = |file: &str, seed: &str| -> Value {
            let fixed = [kind, "--driver", "dave2", "-o", file, "--seed", seed, "--json"];
            attack(folder.path(), &[&fixed, more].concat()).succeed().json()
        };
        let (first, again, other) = (run("a.png", "1"), run("b.png", "1"), run("c.png", "2"));
        let [a, b, c] = ["a.png", "b.png", "c.png"].map(|file| fs::read(folder.path().join(file)).unwrap());
        assert!(a == b && a != c, "{kind}");
        assert_eq!(first["measured"], again["measured"]);
        assert_ne!(first["measured"], other["measured"]);
        assert_eq!((&first["trained_on"], &first["measured_on"]), (&6.into(), &2.into()));
        let moved = |row: usize| first["measured"][row]["moved"].as_f64().unwrap();
        // On frames that it was not trained on, it steers to the goal further than what it is compared with.
        assert_eq!(moved(0), 0.0, "{first}");
        assert!(moved(2) > moved(1).abs(), "{kind}: {first}");
        fs::copy(repository().join("docs/examples/road.jpg"), folder.path().join("road.jpg")).unwrap();
        Pdk::new(["perturb", "road.jpg", "--with", &format!("{name},picture=a.png"), "-o", "shown.png"])
            .folder(folder.path())
            .succeed();
        let [before, after] =
            ["road.jpg", "shown.png"].map(|file| pdk_image::read(&folder.path().join(file)).unwrap());
        assert_ne!(before, after, "{kind}");
    }
}

#[test]
fn what_cannot_be_trained_is_refused_and_nothing_is_written() {
    let folder = temp();
    let refused = |arguments: &[&str], parts: &[&str]| {
        attack(folder.path(), &[arguments, &["-o", "out.png"]].concat()).fail(1, parts);
        assert!(!folder.path().join("out.png").exists(), "{arguments:?}");
    };
    refused(&["patch", "--driver", "lane_keeper"], &["lane_keeper", "name a driver that runs a network"]);
    refused(&["patch", "--driver", "dave2", "--near", "9", "--far", "3"], &["--far is 3", "--near 9"]);
    refused(&["patch", "--driver", "dave2", "--offset", "nan"], &["--offset is NaN", "from -10 to 10"]);
    refused(&["patch", "--driver", "dave2", "--above", "2"], &["--above is for --pose upright"]);
    refused(&["patch", "--driver", "dave2", "--size", "0"], &["--size is 0", "above 0"]);
    refused(&["universal", "--driver", "dave2", "--epsilon", "0.5"], &["--epsilon is 0.5", "from 1 to 255"]);
    let picture = folder.path().join("in.png");
    pdk_tests::pictures::write(&picture, 60, 40);
    let on_one = |out: &str, part: &str| {
        Pdk::new(["attack", "patch", "in.png", "--driver", "dave2", "-o", out])
            .folder(folder.path())
            .fail(1, &[part]);
    };
    on_one("in.png", "would replace in.png");
    on_one("out.png", "too few to hold one in 4 back");
}
