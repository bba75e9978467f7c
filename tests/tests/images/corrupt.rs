//! `pdk corrupt`: datasets with their labels under perturbations, the same bytes with any number of workers, and after a kill.

use std::fs;
use std::path::Path;

use pdk_sdk::prelude::FrameBuf;
use pdk_tests::process::{LIMIT, json_file};
use pdk_tests::processes::{comes_true, signal};
use pdk_tests::records::{assert_equal, files, wait_for_lines};
use pdk_tests::{Pdk, datasets, pictures, temp, test_library};
use rustix::process::Signal;
use serde_json::{Value, json};

/// Where a run that is not done notes what it has written.
const JOURNAL: &str = ".manifest.journal";

fn corrupt(folder: &Path, dataset: &str, more: &[&str], out: &str) -> Pdk {
    Pdk::new(["corrupt", dataset, "-o", out]).args(more).folder(folder)
}

/// A folder with pictures in two classes.
fn classes(folder: &Path, count: u32) {
    for number in 0..count {
        let path =
            folder.join(format!("photos/{}/{number:03}.png", if number % 2 == 0 { "car" } else { "tree" }));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        pictures::road(96, 64, number).save(path).unwrap();
    }
}

/// Grey pictures with a white box in each, and its labels in all formats; the box has these edges.
fn labelled(folder: &Path, [left, top, right, bottom]: [usize; 4]) {
    const SIZE: [usize; 2] = [160, 120];
    let mut picture = FrameBuf::new(SIZE[0], SIZE[1]);
    let mut mask = FrameBuf::new(SIZE[0], SIZE[1]);
    for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
        let inside = (left..right).contains(&x) && (top..bottom).contains(&y);
        picture.as_mut().set_pixel(x, y, [if inside { 255 } else { 90 }; 3]);
        mask.as_mut().set_pixel(x, y, [if inside { 7 } else { 1 }; 3]);
    }
    let write = |name: &str, text: &str| {
        let path = folder.join("set").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    pdk_image::write(&folder.join("set/images/a.png"), picture.as_ref()).unwrap();
    pdk_image::write(&folder.join("set/masks/a.png"), mask.as_ref()).unwrap();
    let [l, t, r, b] = [left, top, right, bottom].map(|edge| edge as f64);
    let yolo = [(l + r) / 320.0, (t + b) / 240.0, (r - l) / 160.0, (b - t) / 120.0];
    write("labels/a.txt", &format!("3 {} {} {} {}\n", yolo[0], yolo[1], yolo[2], yolo[3]));
    write("images/a.lines.txt", &format!("{l} {t} {r} {b}\n"));
    let mut counts = Vec::new();
    let mut run = left * SIZE[1] + top;
    for column in left..right {
        counts.extend([run, bottom - top]);
        run = if column + 1 < right {
            SIZE[1] - (bottom - top)
        } else {
            SIZE[1] - bottom + (SIZE[0] - right) * SIZE[1]
        };
    }
    counts.push(run);
    let coco = json!({
        "images": [{"id": 1, "file_name": "a.png", "width": 160, "height": 120}],
        "categories": [{"id": 3, "name": "thing"}],
        "annotations": [
            {"id": 1, "image_id": 1, "category_id": 3, "bbox": [l, t, r - l, b - t], "area": (r - l) * (b - t), "iscrowd": 0,
             "segmentation": [[l, t, r, t, r, b, l, b]], "keypoints": [l, t, 2, r, b, 2], "num_keypoints": 2},
            {"id": 2, "image_id": 1, "category_id": 3, "bbox": [l, t, r - l, b - t], "area": 1, "iscrowd": 1,
             "segmentation": {"size": [120, 160], "counts": counts}},
            {"id": 3, "image_id": 1, "category_id": 3, "bbox": [0, 119, 3, 1], "area": 3, "iscrowd": 0},
        ],
    });
    write("annotations.json", &coco.to_string());
}

/// The smallest box around what is white in a picture.
fn white(path: &Path) -> [f64; 4] {
    let picture = pdk_image::read(path).unwrap();
    let mut edges = [f64::MAX, f64::MAX, 0.0, 0.0f64];
    for (x, y) in (0..picture.height()).flat_map(|y| (0..picture.width()).map(move |x| (x, y))) {
        if picture.as_ref().pixel(x, y)[0] > 172 {
            let [x, y] = [x as f64, y as f64];
            edges = [edges[0].min(x), edges[1].min(y), edges[2].max(x + 1.0), edges[3].max(y + 1.0)];
        }
    }
    edges
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[track_caller]
fn near(a: &[f64], b: &[f64], limit: f64) {
    assert!(a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= limit), "{a:?} is not {b:?}");
}

#[test]
fn a_folder_becomes_a_tree_of_perturbations_and_levels() {
    let folder = temp();
    classes(folder.path(), 4);
    let with = ["--with", "fog_filter@1..2,gaussian_noise@3,seeds=1"];
    corrupt(folder.path(), "photos", &with, "bad").fail(1, &["seeds"]);
    let done = corrupt(
        folder.path(),
        "photos",
        &["--with", "fog_filter@1..2,rotate_image@1,degrees=5", "--json"],
        "out",
    );
    let done = done.succeed().json();
    assert_eq!(
        (&done["pictures"], &done["written"], &done["conditions"]),
        (&json!(4), &json!(12), &json!(3))
    );
    for condition in ["fog_filter/1", "fog_filter/2", "rotate_image,degrees=5/1"] {
        let picture = pdk_image::read(&folder.path().join("out").join(condition).join("car/000.png"));
        assert_eq!(picture.unwrap().width(), 96);
    }
    let manifest = json_file(&folder.path().join("out/manifest.json"));
    assert_eq!(manifest["files"].as_array().unwrap().len(), 4);
    let entry = &manifest["files"][0];
    let written =
        fs::read(folder.path().join("out/fog_filter/2").join(entry["file"].as_str().unwrap())).unwrap();
    assert_eq!(entry["written"]["fog_filter/2"], blake3::hash(&written).to_hex().to_string());
    // A picture is what `perturb` makes of it with the seed that the manifest has.
    let (name, seed) = (entry["file"].as_str().unwrap(), entry["seed"].to_string());
    let image = format!("photos/{name}");
    Pdk::new(["perturb", &image, "--with", "fog_filter@2", "--seed", &seed, "-o", "one.png"])
        .folder(folder.path())
        .succeed();
    assert_eq!(fs::read(folder.path().join("one.png")).unwrap(), written);
}

#[test]
fn one_picture_and_one_file_are_counted_in_the_singular() {
    let folder = temp();
    classes(folder.path(), 1);
    fs::write(folder.path().join("photos/notes.txt"), "").unwrap();
    let said = corrupt(folder.path(), "photos", &["--with", "contrast@1"], "out").succeed().stdout;
    assert!(
        said.starts_with("photos: a folder of pictures, 1 picture, 1 other file\nout: 1 condition, 2 files "),
        "{said}"
    );
    assert!(said.contains(" 2 files written, 0 were there; "), "{said}");
}

#[test]
fn workers_and_a_kill_change_no_byte() {
    let folder = temp();
    classes(folder.path(), 40);
    let with = ["--with", "gaussian_noise@1..3,imagenet_c_elastic_transform@2,fog_filter@4", "--seed", "9"];
    let run =
        |workers: &str, out: &str| corrupt(folder.path(), "photos", &with, out).args(["--workers", workers]);
    run("1", "one").succeed();
    let expected = files(&folder.path().join("one"));
    assert_eq!(expected.len(), 40 * 5 + 1);
    run("4", "four").succeed();
    assert_equal(&folder.path().join("four"), &expected);

    let out = folder.path().join("killed");
    let mut child = run("2", "killed").spawn();
    wait_for_lines(&mut child, &out.join(JOURNAL), 25);
    signal(&child, Signal::KILL);
    child.wait().unwrap();
    assert!(!out.join("manifest.json").exists(), "it was done before it was killed");
    // Its other process ends with it, and holds the folder until then.
    let mut done = Value::Null;
    let continued = comes_true(LIMIT, || {
        let run = run("3", "killed").arg("--json").run();
        let free = run.code == Some(0) || !run.stderr.contains("another process writes");
        if run.code == Some(0) {
            done = run.json();
        }
        free
    });
    assert!(continued && done["there"].as_u64().unwrap() >= 24, "{done}");
    assert_equal(&out, &expected);

    // What is there is not done again, but what was changed is.
    fs::write(out.join("fog_filter/4/car/000.png"), "x").unwrap();
    let again = run("2", "killed").arg("--json").succeed().json();
    assert_eq!((&again["written"], &again["there"]), (&json!(1), &json!(199)));
    assert_equal(&out, &expected);
    corrupt(folder.path(), "photos", &with, "killed")
        .args(["--quality", "50"])
        .fail(1, &["was written with --quality 95, and this command has --quality 50", "-o"]);
    fs::create_dir(folder.path().join("full")).unwrap();
    fs::write(folder.path().join("full/mine.txt"), "").unwrap();
    run("1", "full").fail(1, &["has other files in it"]);
}

#[test]
fn labels_go_where_the_pixels_go() {
    let folder = temp();
    labelled(folder.path(), [50, 40, 90, 70]);
    let with =
        "translate_image@0,variant=corrected,share=0.1,rotate_image@0,degrees=20,scale_image@3,fog_filter@0";
    let done = corrupt(folder.path(), "set", &["--with", with, "--json"], "out").succeed().json();
    assert_eq!(done["others"]["COCO annotations"], 1, "{done}");
    let out = folder.path().join("out");
    for condition in
        ["translate_image,variant=corrected,share=0.1/0", "rotate_image,degrees=20/0", "scale_image/3"]
    {
        let place = out.join(condition);
        let seen = white(&place.join("images/a.png"));
        let coco = json_file(&place.join("annotations.json"));
        let annotation = &coco["annotations"][0];
        let found = numbers(&annotation["bbox"]);
        near(&[found[0], found[1], found[0] + found[2], found[1] + found[3]], &seen, 1.0);
        let points = numbers(&annotation["keypoints"]);
        assert!(points[0] >= seen[0] - 1.0 && points[3] <= seen[2] + 1.0 && annotation["num_keypoints"] == 2);
        let corners = numbers(&annotation["segmentation"][0]);
        let across = corners.iter().step_by(2).copied();
        near(
            &[across.clone().fold(f64::MAX, f64::min), across.fold(0.0, f64::max)],
            &[seen[0], seen[2]],
            1.0,
        );
        let yolo = fs::read_to_string(place.join("labels/a.txt")).unwrap();
        let yolo: Vec<f64> = yolo.split_whitespace().map(|number| number.parse().unwrap()).collect();
        near(
            &[yolo[1] * 160.0, yolo[2] * 120.0],
            &[(seen[0] + seen[2]) / 2.0, (seen[1] + seen[3]) / 2.0],
            1.0,
        );
        // The mask has the value of the box where the picture is white, and nothing in between.
        let read = |name: &str| pdk_image::read(&place.join(name)).unwrap();
        let (picture, mask) = (read("images/a.png"), read("masks/a.png"));
        let values: std::collections::BTreeSet<u8> = mask.data().iter().copied().collect();
        assert!(values.is_subset(&[0, 1, 7].into()), "{values:?}");
        let differ = picture
            .data()
            .iter()
            .zip(mask.data())
            .filter(|(seen, class)| (**seen > 172) != (**class == 7))
            .count();
        assert!(differ < 3 * 40, "{condition}: {differ} values");
        // A mask that is packed in the annotations is the same one.
        let area: f64 = mask.data().iter().filter(|class| **class == 7).count() as f64 / 3.0;
        assert_eq!(coco["annotations"][1]["area"].as_f64(), Some(area), "{condition}");
        let lines = fs::read_to_string(place.join("images/a.lines.txt")).unwrap();
        let line: Vec<f64> = lines.split_whitespace().map(|number| number.parse().unwrap()).collect();
        near(&[line[0] + 0.5, line[1] + 0.5], &[points[0], points[1]], 1.0);
    }
    // What lies outside is left out, and what does not move is the same file.
    let of = |condition: &str| {
        json_file(&out.join(condition).join("annotations.json"))["annotations"].as_array().unwrap().len()
    };
    assert_eq!((of("rotate_image,degrees=20/0"), of("scale_image/3")), (2, 3));
    for name in ["annotations.json", "labels/a.txt", "masks/a.png"] {
        assert_eq!(
            fs::read(out.join("fog_filter/0").join(name)).unwrap(),
            fs::read(folder.path().join("set").join(name)).unwrap()
        );
    }
}

#[test]
fn what_cannot_say_where_it_moves_things_is_refused_where_there_are_labels() {
    let folder = temp();
    classes(folder.path(), 1);
    labelled(folder.path(), [50, 40, 90, 70]);
    let plugin = test_library("frozen");
    // An elastic cloth of before pdk asked for geometry, as a script and as a plugin of an older SDK.
    fs::write(folder.path().join("cloth.lua"), "return { doc = 'Cloth', apply = function(image, cx) end }")
        .unwrap();
    let run = |dataset: &str, more: &[&str], out: &str| {
        corrupt(folder.path(), dataset, more, out).args(["--plugins", "cloth.lua", "--plugins"]).arg(&plugin)
    };
    for name in ["frozen@1", "cloth@1"] {
        let with = ["--with", name];
        let sentence = ["does not say whether it changes where things are", "`set`", "--labels drop"];
        run("set", &with, "refused").fail(1, &sentence);
        run("photos", &with, &format!("{name}-photos")).succeed();
        run("set", &[&with[..], &["--labels", "drop"]].concat(), &format!("{name}-drop")).succeed();
        let dropped = folder.path().join(format!("{name}-drop/{}/1", &name[..name.len() - 2]));
        assert!(dropped.join("images/a.png").exists() && !dropped.join("annotations.json").exists());
        run("set", &[&with[..], &["--labels", "keep"]].concat(), &format!("{name}-keep")).succeed();
    }
    let suite = |name: &str| corrupt(folder.path(), "set", &["--suite", name], "suite");
    suite("default").fail(1, &["sample_pairing_filter", "cannot describe"]);
    suite("defaults").fail(1, &["there is no suite `defaults`", "`imagenet_c`"]);
    fs::write(folder.path().join("set/a.xml"), "<annotation><bndbox/></annotation>").unwrap();
    run("set", &["--with", "rotate_image@1"], "xml").fail(1, &["a.xml", "COCO"]);
}

#[test]
fn recordings_stay_recordings_and_mirrors_turn_the_steering() {
    let folder = temp();
    datasets::tub(&folder.path().join("drive"), 6, 96, 64);
    fs::write(
        folder.path().join("drive/catalog_0.catalog_manifest"),
        json!({"created_at": 1.0, "line_lengths": [1], "start_index": 0}).to_string(),
    )
    .unwrap();
    fs::write(folder.path().join("mirror.lua"), MIRROR).unwrap();
    let with = ["--with", "mirror@1,rotate_image@4,raindrops_on_lens@2", "--plugins", "mirror.lua"];
    let done = corrupt(folder.path(), "drive", &with, "out").arg("--json").succeed().json();
    assert_eq!(done["read_as"], "a recording, read by `tub`");
    let records = |path: &str| -> Vec<(String, f64)> {
        let text = fs::read_to_string(folder.path().join(path)).unwrap();
        let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        lines
            .iter()
            .map(|line| (line["cam/image_array"].to_string(), line["user/angle"].as_f64().unwrap()))
            .collect()
    };
    let before = records("drive/catalog_0.catalog");
    let mirrored = records("out/mirror/1/catalog_0.catalog");
    assert!(before.iter().zip(&mirrored).all(|(a, b)| a.0 == b.0 && a.1 == -b.1), "{mirrored:?}");
    // A camera that is turned upside down is in the same vehicle.
    assert_eq!(records("out/rotate_image/4/catalog_0.catalog"), before);
    let lengths = json_file(&folder.path().join("out/mirror/1/catalog_0.catalog_manifest"));
    let text = fs::read_to_string(folder.path().join("out/mirror/1/catalog_0.catalog")).unwrap();
    let expected: Vec<_> = text.lines().map(|line| line.len() + 1).collect();
    assert_eq!(lengths["line_lengths"], json!(expected));
    // Drops run down in the time of the recording, as in a sequence.
    for name in ["0", "5"] {
        let image = format!("images/{name}_cam_image_array_.jpg");
        let time = (name.parse::<f64>().unwrap() * 0.05).to_string();
        let one = [
            "perturb",
            &format!("drive/{image}"),
            "--with",
            "raindrops_on_lens@2",
            "--frame",
            name,
            "--time",
            &time,
        ];
        Pdk::new(one).args(["-o", "one.jpg"]).folder(folder.path()).succeed();
        let made = fs::read(folder.path().join("out/raindrops_on_lens/2").join(&image)).unwrap();
        assert_eq!(made, fs::read(folder.path().join("one.jpg")).unwrap(), "{image}");
    }
    // The reader may be named, and its frames written as pictures with records.
    let plain = ["--with", "mirror@1", "--plugins", "mirror.lua", "--plain"];
    corrupt(folder.path(), "tub,path=drive", &plain, "plain").succeed();
    let record = json_file(&folder.path().join("plain/mirror/1/record_000004.json"));
    assert_eq!(record["user/angle"].as_f64(), Some(-before[4].1));
    let again = corrupt(folder.path(), "plain/mirror/1", &["--with", "fog_filter@1"], "again")
        .arg("--json")
        .succeed()
        .json();
    assert_eq!(again["read_as"], "a recording, read by `folder`");
    corrupt(folder.path(), "drive", &["--with", "fog_filter@1", "--format", "png"], "png")
        .fail(1, &["name their pictures"]);
    corrupt(folder.path(), "nowhere", &["--with", "fog_filter@1"], "x")
        .fail(1, &["neither a folder nor a dataset reader"]);
}

#[test]
fn a_plain_copy_says_what_was_recorded_and_what_was_not() {
    let folder = temp();
    let data = folder.path().join("drive");
    fs::create_dir(&data).unwrap();
    // The throttle was not recorded.
    let mut table = "image,steering,speed,milliseconds\n".to_owned();
    let times = [0.0, 33.3125, 66.7, 100.03125];
    for (number, time) in (0..4_u32).zip(times) {
        pictures::road(48, 32, number).save(data.join(format!("{number}.png"))).unwrap();
        let (steering, speed) = (datasets::steering(number), 2.5 + f64::from(number));
        table += &format!("{number}.png,{steering},{speed},{time}\n");
    }
    fs::write(data.join("log.csv"), table).unwrap();
    let plain = ["--with", "contrast@0", "--plain"];
    corrupt(folder.path(), "csv,path=drive", &plain, "once").succeed();
    let copy = "once/contrast/0";
    corrupt(folder.path(), &format!("folder,path={copy}"), &plain, "twice").succeed();
    for (number, time) in (0..4_u32).zip(times) {
        let name = format!("contrast/0/record_{number:06}.json");
        let [once, twice] = ["once", "twice"].map(|out| json_file(&folder.path().join(out).join(&name)));
        assert_eq!(
            (&once["user/throttle"], once["enc/speed"].as_f64()),
            (&Value::Null, Some(2.5 + f64::from(number)))
        );
        assert_eq!(once["user/angle"].as_f64(), Some(datasets::steering(number)));
        // Cameras do not count in milliseconds.
        assert_eq!(once["milliseconds"].as_f64(), Some(time));
        assert_eq!(once, twice);
    }
}

/// A plugin that mirrors pictures.
pub const MIRROR: &str = "return { doc = 'Mirror', apply = function(image, cx)
        local pixels, width = image.pixels, image.width
        for y = 0, image.height - 1 do for x = 0, width // 2 - 1 do for c = 0, 2 do
            local a, b = (y * width + x) * 3 + c, (y * width + width - 1 - x) * 3 + c
            local left = buffer.readu8(pixels, a)
            buffer.writeu8(pixels, a, buffer.readu8(pixels, b))
            buffer.writeu8(pixels, b, left)
        end end end
    end,
    move_point = function(x, y, width) return width - 1 - x, y end,
    source_point = function(x, y, width) return width - 1 - x, y end }";

#[test]
fn mirrors_turn_the_steering_of_a_table_or_are_refused() {
    let folder = temp();
    fs::write(folder.path().join("mirror.lua"), MIRROR).unwrap();
    let data = folder.path().join("log");
    fs::create_dir(&data).unwrap();
    let mut table = "image, note,Angle ,speed\r\n".to_owned();
    let angles = [" -12.50 ", "0", "\"3.25\"", " 25.0", "-0.50", "7"];
    for (number, angle) in angles.iter().enumerate() {
        pictures::road(48, 32, number as u32).save(data.join(format!("{number}.png"))).unwrap();
        table += &format!("{number}.png,\"a, b\",{angle},5.5\r\n");
    }
    fs::write(data.join("log.csv"), &table).unwrap();
    let with = ["--with", "mirror@1", "--plugins", "mirror.lua"];
    // The angles are beyond full lock, so that it is not read as a recording: what would be written would be wrong.
    corrupt(folder.path(), "log", &with, "refused")
        .fail(1, &["mirrors the frames", "full_lock", "--labels keep"]);
    assert!(!folder.path().join("refused/mirror").exists());
    let done = corrupt(folder.path(), "log", &["--with", "fog_filter@1"], "fog").succeed();
    assert!(done.stderr.contains("is read as a folder of pictures, not as a recording"), "{}", done.stderr);

    let dataset = "csv,path=log,full_lock=25";
    corrupt(folder.path(), dataset, &with, "out").succeed();
    let turned = fs::read_to_string(folder.path().join("out/mirror/1/log.csv")).unwrap();
    let expected = [" 12.50 ", "0", "\"-3.25\"", " -25.0", "0.50", "-7"];
    let rest = |text: &str, angles: &[&str]| {
        angles.iter().enumerate().fold(text.to_owned(), |text, (number, angle)| {
            text.replacen(
                &format!("{number}.png,\"a, b\",{angle},"),
                &format!("{number}.png,\"a, b\",ANGLE,"),
                1,
            )
        })
    };
    assert_eq!(turned.matches("ANGLE").count(), 0);
    assert_eq!(rest(&turned, &expected), rest(&table, &angles));
    assert_eq!(rest(&turned, &expected).matches("ANGLE").count(), angles.len());
    // Without a mirror it stays as it is, byte for byte.
    corrupt(folder.path(), dataset, &["--with", "fog_filter@1"], "fogged").succeed();
    assert_eq!(fs::read_to_string(folder.path().join("fogged/fog_filter/1/log.csv")).unwrap(), table);
    // Pictures of several cameras would have to change places, and nothing says which.
    pictures::road(48, 32, 9).save(data.join("left_0.png")).unwrap();
    corrupt(folder.path(), dataset, &with, "cameras").fail(1, &["several cameras", "--plain"]);
}

#[test]
fn a_recording_without_pictures_of_its_own_is_refused_for_its_own_reason() {
    let folder = temp();
    fs::create_dir_all(folder.path().join("old/meta")).unwrap();
    let info = json!({"fps": 10, "codebase_version": "v1.6", "features": {"cam": {"dtype": "video"}}});
    fs::write(folder.path().join("old/meta/info.json"), info.to_string()).unwrap();
    let with = ["--with", "fog_filter@1"];
    corrupt(folder.path(), "old", &with, "out")
        .fail(1, &["version `1.6`", "READER,path=DIR,PARAMETER=VALUE"]);
    fs::create_dir(folder.path().join("empty")).unwrap();
    corrupt(folder.path(), "empty", &with, "out").fail(1, &["`empty` has no pictures", "pdk list dataset"]);
}

#[test]
fn cameras_to_the_left_and_right_change_places_in_a_mirror() {
    let folder = temp();
    fs::write(folder.path().join("mirror.lua"), MIRROR).unwrap();
    let data = folder.path().join("log");
    fs::create_dir_all(data.join("IMG")).unwrap();
    let row = |number: usize, [left, right]: [&str; 2], steering: &str| {
        format!(
            "/sim/IMG/center_{number}.png, /sim/IMG/{left}_{number}.png, /sim/IMG/{right}_{number}.png, {steering}, 0.5, 0, 9\n"
        )
    };
    let steering = ["-0.25", "0", "0.5"];
    let table = |sides: [&str; 2], steering: [&str; 3]| -> String {
        steering.iter().enumerate().map(|(number, steering)| row(number, sides, steering)).collect()
    };
    fs::write(data.join("driving_log.csv"), table(["left", "right"], steering)).unwrap();
    for number in 0..3 {
        for (place, camera) in ["center", "left", "right"].iter().enumerate() {
            let name = data.join(format!("IMG/{camera}_{number}.png"));
            pictures::road(48, 32, 10 * number + place as u32).save(name).unwrap();
        }
    }
    corrupt(folder.path(), "log", &["--with", "mirror@1", "--plugins", "mirror.lua"], "out").succeed();
    let made = folder.path().join("out/mirror/1");
    let turned = fs::read_to_string(made.join("driving_log.csv")).unwrap();
    assert_eq!(turned, table(["right", "left"], ["0.25", "0", "-0.5"]));
    // What the right column names now is the mirrored picture of the left camera.
    let open = |folder: &Path| image::open(folder.join("IMG/left_1.png")).unwrap().into_rgb8();
    assert_eq!(open(&made), image::imageops::flip_horizontal(&open(&data)));
}

#[test]
fn pictures_are_written_in_another_format_and_quality() {
    let folder = temp();
    labelled(folder.path(), [50, 40, 90, 70]);
    let size = |quality: &str| {
        let more = ["--with", "gaussian_noise@3", "--format", "jpeg", "--quality", quality];
        corrupt(folder.path(), "set", &more, quality).succeed();
        let made = folder.path().join(quality).join("gaussian_noise/3");
        assert_eq!(json_file(&made.join("annotations.json"))["images"][0]["file_name"], "a.jpg");
        fs::metadata(made.join("images/a.jpg")).unwrap().len()
    };
    assert!(size("30") * 2 < size("95"));
}

#[test]
fn a_result_in_the_dataset_and_two_files_in_one_place_are_refused() {
    let folder = temp();
    classes(folder.path(), 2);
    let with = ["--with", "contrast@1"];
    std::os::unix::fs::symlink("photos", folder.path().join("link")).unwrap();
    for out in ["photos", "photos/new/out", "link/out"] {
        corrupt(folder.path(), "photos", &with, out)
            .fail(1, &[&format!("the folder {out} lies in the dataset photos"), "outside of it with -o"]);
    }
    corrupt(&folder.path().join("photos"), ".", &with, "out")
        .fail(1, &["the folder out lies in the dataset ."]);
    assert!(!folder.path().join("photos/new").exists() && !folder.path().join("photos/out").exists());
    corrupt(folder.path(), "photos", &with, "photos-out").succeed();
    datasets::tub(&folder.path().join("drive"), 2, 96, 64);
    let tub = "tub,path=drive";
    corrupt(folder.path(), tub, &[&with[..], &["--plain"]].concat(), "drive/out")
        .fail(1, &["lies in the dataset drive"]);

    fs::write(folder.path().join("photos/tree/001.jpg"), "x").unwrap();
    let png = [&with[..], &["--format", "png"]].concat();
    corrupt(folder.path(), "photos", &png, "png").fail(
        1,
        &["`tree/001.jpg` and `tree/001.png` would both be written as `tree/001.png`", "leave --format out"],
    );
    assert!(!folder.path().join("png").exists());
}
