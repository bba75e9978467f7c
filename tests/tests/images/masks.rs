//! Perturbations of a part of the frame: by masks in Lua, by a simulator's labels, and by perturbations that follow a saliency map.

use std::fs;
use std::path::Path;

use pdk_tests::process::json_lines;
use pdk_tests::{Pdk, pictures, pixels, temp};

/// Which pixels of an image a perturbation changes, row by row.
fn changed(folder: &Path, with: &str) -> Vec<bool> {
    let (image, out) = (folder.join("road.png"), folder.join("out.png"));
    if !image.exists() {
        pictures::write(&image, 320, 160);
    }
    Pdk::new(["perturb", "road.png", "--plugins", ".", "--with", with, "-o", "out.png"])
        .folder(folder)
        .succeed();
    let [before, after] = [image, out].map(|path| image::open(path).unwrap().into_rgb8());
    before.pixels().zip(after.pixels()).map(|(a, b)| a != b).collect()
}

#[test]
fn a_mask_in_lua_limits_a_perturbation() {
    let folder = temp();
    fs::write(
        folder.path().join("lower_half.lua"),
        r#"return {
            doc = "The lower half of the frame",
            mask = function(image, cx)
                image:fill(0, 0, 0)
                image:rectangle(0, image.height / 2, image.width, image.height / 2, 255, 255, 255)
            end,
        }"#,
    )
    .unwrap();
    let listed = Pdk::new(["list", "mask", "--plugins", "."]).folder(folder.path()).succeed();
    assert!(
        listed.stdout.contains("lower_half") && listed.stdout.contains("segmentation"),
        "{}",
        listed.stdout
    );
    let found = changed(folder.path(), r#"false_color_filter@3,where={"mask":"lower_half"}"#);
    assert_eq!(found.iter().position(|changed| *changed), Some(320 * 80));
    assert!(found[320 * 80..].iter().filter(|changed| **changed).count() > 320 * 70);

    // By its path, and without a folder of plugins.
    let image = folder.path().join("road.png");
    let perturb = |with: &str| {
        Pdk::new(["perturb", "road.png", "-o", "by_path.png", "--with", with]).folder(folder.path())
    };
    perturb(r#"false_color_filter@3,where={"mask":"lower_half.lua"}"#).succeed();
    let [by_name, by_path] =
        ["out.png", "by_path.png"].map(|name| image::open(image.with_file_name(name)).unwrap());
    assert_eq!(by_name, by_path);
    perturb(r#"contrast@3,where={"mask":"lower_haft.lua"}"#)
        .fail(1, &["mask `lower_haft.lua`: there is no such file"]);

    fs::write(folder.path().join("broken.lua"), "return { doc = 'x', mask = function(image) return 3 end }")
        .unwrap();
    let perturb = |with: &str| {
        Pdk::new(["perturb", "road.png", "--plugins", ".", "-o", "x.png", "--with", with])
            .folder(folder.path())
    };
    perturb(r#"contrast@3,where={"mask":"broken"}"#)
        .fail(1, &["mask `broken`", "`mask` returns a number, but has to change `image` in place"]);
    perturb(r#"contrast@3,where={"mask":"lower_haft"}"#)
        .fail(1, &["there is no mask `lower_haft`", "`lower_half`"]);
    perturb(r#"contrast@3,where={"label":"road"}"#).fail(1, &["these frames come without"]);
}

#[test]
fn the_labels_of_the_simulator_limit_a_perturbation() {
    let folder = temp();
    let drive = |name: &str, label: &str| {
        let out = folder.path().join(name);
        let source = format!(
            r#"pdk.drive({{ simulator = {{ name = "lane", width = 80, height = 60 }}, driver = "lane_keeper", duration = 1, images_every = 5,
                scenarios = {{ {{ perturbations = {{ {{ name = "false_color_filter", level = 4, where = {{ label = "{label}" }} }} }} }} }} }})"#
        );
        let path = folder.path().join(format!("{name}.lua"));
        fs::write(&path, source).unwrap();
        (Pdk::new(["run", "--out"]).arg(&out).arg(path), out)
    };
    let (run, out) = drive("sky", "sky");
    run.succeed();
    assert_eq!(json_lines(&out.join("scenarios.jsonl")).len(), 1);
    let (run, out) = drive("moon", "moon");
    run.run();
    let line = &json_lines(&out.join("scenarios.jsonl"))[0];
    let error = line["error"].as_str().unwrap();
    assert!(error.contains("the simulator has no label `moon`; it has `sky`, `ground`, `road`"), "{error}");
}

#[test]
fn distances_limit_a_perturbation() {
    let folder = temp();
    let changes = |name: &str, distances: &str| {
        let (out, source) = (folder.path().join(name), folder.path().join(format!("{name}.lua")));
        let text = format!(
            r#"pdk.drive({{ simulator = {{ name = "lane", width = 160, height = 80, oncoming = 0, straight_ends = 0 }}, driver = "lane_keeper", duration = 0.2,
                images_every = 1,
                scenarios = {{ {{ perturbations = {{ {{ name = "false_color_filter", level = 3, where = {distances} }} }} }} }} }})"#
        );
        fs::write(&source, text).unwrap();
        Pdk::new(["run", "--out"]).arg(&out).arg(&source).succeed();
        let traces: Vec<_> = fs::read_dir(out.join("traces")).unwrap().collect();
        pixels::changes(&traces[0].as_ref().unwrap().path())
    };
    // The camera stands 1.35 m high: the lowest rows are some metres away, and the sky is farther than anything.
    let far = changes("far", "{ farther = 30 }");
    let near = changes("near", "{ nearer = 15 }");
    let between = changes("between", "{ farther = 4, nearer = 15 }");
    let shares = |changes: &_| [0..10, 40..55, 78..80].map(|rows| pixels::changed(changes, rows));
    let [far, near, between] = [&far, &near, &between].map(shares);
    assert!(far[0] > 0.5 && far[1..] == [0.0, 0.0], "{far:?}");
    assert!(near[0] == 0.0 && near[1] > 0.5 && near[2] > 0.5, "{near:?}");
    assert!(between[0] == 0.0 && between[1] > 0.3 && between[2] < 0.1, "{between:?}");
}

#[test]
fn drops_follow_attention_and_others_refuse_to() {
    let folder = temp();
    let by = "gradient,model=dave2,engine=pdk";
    let with = changed(folder.path(), &format!("raindrops_on_lens@4,attention=\"{by}\""));
    let without = changed(folder.path(), "raindrops_on_lens@4");
    assert_ne!(with, without);
    Pdk::new(["perturb", "road.png", "-o", "x.png", "--with"])
        .arg(format!("gaussian_noise@4,attention=\"{by}\""))
        .folder(folder.path())
        .fail(1, &["perturbation `gaussian_noise`", "does not follow saliency maps", "`where`"]);
    let shown = Pdk::new(["show", "raindrops_on_lens"]).succeed();
    assert!(shown.stdout.contains("attention where"), "{}", shown.stdout);
}
