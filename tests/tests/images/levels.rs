//! Scales on which a level means the same for every perturbation: used, refused, recorded and measured.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::search_path::SearchPath;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_preview::picture;
use pdk_sdk::describe::Kind;
use pdk_sdk::prelude::FrameBuf;
use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::{Pdk, pictures, real_data, registry, repository, temp};
use serde_json::{Value, json};

/// A scale `own` in a folder for drop-ins.
fn scale(folder: &Path, perturbations: &Value) {
    fs::create_dir_all(folder.join("scales")).unwrap();
    let scale =
        json!({"measure": "none", "costs": [1, 2, 3, 4, 5], "frames": [], "perturbations": perturbations});
    fs::write(folder.join("scales/own.scale.json"), scale.to_string()).unwrap();
}

fn pdk(folder: &Path, arguments: &[&str]) -> Pdk {
    Pdk::new(["--drop-ins", "scales"]).args(arguments).folder(folder)
}

/// The bytes of a picture under a perturbation.
fn perturbed(folder: &Path, with: &str) -> Vec<u8> {
    pdk(folder, &["perturb", "in.png", "--with", with, "-o", "out.png"]).succeed();
    fs::read(folder.join("out.png")).unwrap()
}

/// A folder with a picture and a scale.
fn prepared() -> tempfile::TempDir {
    let folder = temp();
    pictures::road(80, 60, 3).save(folder.path().join("in.png")).unwrap();
    scale(
        folder.path(),
        &json!([
            {"name": "translate_image", "version": 1, "points": [[0, 0], [2, 3], [4, 6]]},
            {"name": "fog_filter", "version": 1, "points": [[0.5, -1], [3, 4]]},
            {"name": "contrast", "version": 99, "points": [[0, 0], [4, 4]]},
        ]),
    );
    folder
}

#[test]
fn a_level_of_a_scale_is_the_published_level_that_was_measured() {
    let folder = prepared();
    let same = |scaled: &str, published: &str| {
        assert!(perturbed(folder.path(), scaled) == perturbed(folder.path(), published), "{scaled}");
    };
    same("translate_image@2,level_scale=own", "translate_image@3");
    same("translate_image@1,level_scale=own", "translate_image@1.5");
    same("fog_filter@3,level_scale=own", "fog_filter@4");
    // Beyond the published levels, parameters go on in a straight line.
    let registry = registry(&SearchPath::default());
    let description = &registry.catalog().get(Kind::Perturbation, "translate_image").unwrap().description;
    let shift = description.parameters.iter().find(|parameter| parameter.name == "shift").unwrap();
    let levels = shift.levels.unwrap();
    let beyond = levels[4] + 2.0 * (levels[4] - levels[3]);
    same("translate_image@4,level_scale=own", &format!("translate_image,shift={beyond}"));
    let shown = pdk(folder.path(), &["show", "translate_image"]).succeed().stdout;
    assert!(
        shown.contains(
            "own: reaches levels 0 to 4 of it; its 0 1 2 3 4 are the published 0.00 1.50 3.00 4.50 6.00"
        ),
        "{shown}"
    );
}

#[test]
fn what_a_scale_does_not_have_is_refused() {
    let folder = prepared();
    for (with, sentence) in [
        (
            "fog_filter@4,level_scale=own",
            "level 4 of scale `own` cannot be had: its parameters reach levels 0.5 to 3 of it",
        ),
        ("fog_filter@1,level_scale=owns", "it has no scale `owns`; did you mean `own`?"),
        (
            "rotate_image@1,level_scale=own",
            "perturbation `rotate_image`: it has no scale `own`; there is only calibrated-1",
        ),
        (
            "translate_image@1,level_scale=own,shift=3",
            "it was not measured for scale `own` with these parameters",
        ),
        (
            "contrast@1,level_scale=own",
            "was measured with its version 99, and this is version 1; measure it again with `pdk calibrate`",
        ),
        (
            r#"fog_filter,level_scale=own,level={"ramp":{"from":0.5,"to":3.5,"end":2}}"#,
            "level 3.5 of scale `own` cannot be had",
        ),
    ] {
        pdk(folder.path(), &["perturb", "in.png", "--with", with, "-o", "out.png"]).fail(1, &[sentence]);
    }
    // Not in the folder of the pictures.
    let out = temp();
    let out = out.path().join("out").display().to_string();
    pdk(folder.path(), &["corrupt", ".", "--with", "fog_filter@3..4,level_scale=own", "-o", &out])
        .fail(1, &["level 4 of scale `own` cannot be had"]);
    let suite = |level: &'static str| {
        let suite =
            ["corrupt", ".", "--suite", "weather", "--levels", level, "--level-scale", "own", "-o", &out];
        pdk(folder.path(), &suite)
    };
    let warned = suite("1..3").succeed().stderr;
    assert!(
        warned.contains("left out: perturbation `contrast`: scale `own` was measured with its version 99"),
        "{warned}"
    );
    let made = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name());
    let made: BTreeSet<_> = made.map(|name| name.into_string().unwrap()).collect();
    assert_eq!(made, ["fog_filter,level_scale=own", "manifest.json"].map(str::to_owned).into());
    fs::remove_dir_all(&out).unwrap();
    suite("4").fail(1, &["scale `own`"]);
    pdk(folder.path(), &["corrupt", ".", "--with", "fog_filter@1", "--level-scale", "own", "-o", &out])
        .fail(1, &["--level-scale is for a --suite"]);
    for (text, sentence) in [
        ("{", "own.scale.json: it is not a scale (EOF while parsing"),
        (
            r#"{"measure":"","costs":[1,2,3,4,5],"frames":[],"perturbations":[{"name":"fog_filter","version":1,"points":[[2,1],[1,1]]}]}"#,
            "the points of `fog_filter` are out of order or out of range); `pdk calibrate` writes them",
        ),
    ] {
        fs::write(folder.path().join("scales/own.scale.json"), text).unwrap();
        let warned = pdk(folder.path(), &["list", "perturbation"]).succeed().stderr;
        assert!(warned.contains(sentence), "{warned}");
    }
}

#[test]
fn scripts_go_beyond_the_published_levels_as_well() {
    let folder = prepared();
    let script = "return { doc = 'Darker', parameters = { { name = 'by', doc = 'by how much', levels = { 1, 2, 3, 4, 6 }, min = 0, max = 100 } },
        apply = function(image, cx) image:brightness(1 - cx.by / 100) end }";
    fs::create_dir(folder.path().join("own")).unwrap();
    fs::write(folder.path().join("own/darker.lua"), script).unwrap();
    scale(folder.path(), &json!([{"name": "darker", "version": 1, "points": [[0, 0], [4, 8]]}]));
    let perturbed = |with: &str| {
        pdk(folder.path(), &["--plugins", "own", "perturb", "in.png", "--with", with, "-o", "out.png"])
            .succeed();
        fs::read(folder.path().join("out.png")).unwrap()
    };
    assert!(perturbed("darker@4,level_scale=own") == perturbed("darker,by=14"));
    assert!(perturbed("darker@1,level_scale=own") == perturbed("darker@2"));
    // Its name is on no list of a study that goes by a scale which it was not measured for.
    let source = r#"print(pdk.reach("darker", "own")[2], pdk.reach("fog_filter", "own"), pdk.reach("fog_filter", "calibrated-1")[1])"#;
    let file = pipeline(folder.path(), source);
    let printed = pdk(folder.path(), &["--plugins", "own", "run", file.to_str().unwrap()]).succeed().stderr;
    assert!(printed.contains("4\tnil\t0"), "{printed}");
    let unknown = pipeline(folder.path(), r#"pdk.reach("fog_filter", "calibrated")"#);
    pdk(folder.path(), &["run", unknown.to_str().unwrap()]).fail(
        1,
        &["pdk.reach: perturbation `fog_filter`: it has no scale `calibrated`; did you mean `calibrated-1`?"],
    );
}

#[test]
fn scales_of_one_name_differ_by_their_points() {
    let folder = prepared();
    fs::create_dir(folder.path().join("set")).unwrap();
    pictures::road(80, 60, 3).save(folder.path().join("set/a.png")).unwrap();
    let with = |level: f64, published: f64| {
        format!(
            r#"fog_filter@{level},level_scale={{"name":"x","version":1,"points":[[0,0],[4,{published}]]}}"#
        )
    };
    let corrupt = |out: &str, with: &[String]| {
        let given = with.iter().flat_map(|with| ["--with", with]);
        pdk(folder.path(), &["corrupt", "set", "-o", out]).args(given).succeed();
    };
    corrupt("both", &[with(1.0, 1.0), with(2.0, 8.0)]);
    corrupt("one", &[with(2.0, 8.0)]);
    let picture =
        |out: &str| fs::read(folder.path().join(out).join("fog_filter,level_scale=x/2/a.png")).unwrap();
    assert!(picture("both") == picture("one"));
}

#[test]
fn a_row_of_a_preview_is_empty_where_a_level_is_not_reached() {
    let folder = prepared();
    pdk(folder.path(), &["preview", "in.png", "--with", "fog_filter,level_scale=own", "-o", "preview"])
        .succeed();
    // On a line through the row there are three pictures of five: the scale has levels 0.5 to 3.
    let sheet = image::open(folder.path().join("preview/sheet.png")).unwrap().to_rgb8();
    let line = sheet.height() - 40;
    let shown = (0..sheet.width()).filter(|x| *sheet.get_pixel(*x, line) != picture::PAPER).count();
    assert!((3 * 180..=3 * 192).contains(&shown), "{shown} pixels");
    pdk(folder.path(), &["preview", "in.png", "--with", "fog_filter@4,level_scale=own", "-o", "preview"])
        .fail(1, &["level 4 of scale `own` cannot be had"]);
}

#[test]
fn a_record_holds_what_was_measured_and_is_driven_again_without_the_scale() {
    let folder = prepared();
    let source = r#"pdk.drive({ simulator = "lane", driver = "lane_keeper", duration = 1,
        scenarios = { { perturbations = { "fog_filter@3,level_scale=own" } } } })"#;
    let file = pipeline(folder.path(), source);
    let file = file.to_str().unwrap();
    pdk(folder.path(), &["run", file, "-o", "record"]).succeed();
    let line = &json_lines(&folder.path().join("record/scenarios.jsonl"))[0];
    let applied = &line["scenario"]["perturbations"][0];
    assert_eq!(
        applied["level_scale"],
        json!({"name": "own", "version": 1, "points": [[0.5, -1.0], [3.0, 4.0]]})
    );
    assert_eq!(line["name"], "fog_filter@3,level_scale=\"own\"");
    fs::remove_dir_all(folder.path().join("scales")).unwrap();
    Pdk::new(["replay", "record"]).folder(folder.path()).succeed();
    // Another scale of this name is another scenario.
    scale(folder.path(), &json!([{"name": "fog_filter", "version": 1, "points": [[0, 0], [4, 4]]}]));
    pdk(folder.path(), &["run", file, "-o", "other"]).succeed();
    assert!(json_lines(&folder.path().join("other/scenarios.jsonl"))[0]["id"] != line["id"]);
    // Before anything is driven.
    let beyond =
        pipeline(folder.path(), &source.replace("@3", "@3.5").replace("fog_filter", "translate_image"));
    pdk(folder.path(), &["run", beyond.to_str().unwrap(), "-o", "beyond"])
        .fail(1, &["it has no scale `own`"]);
    assert!(!folder.path().join("beyond").exists());
}

#[test]
fn what_hardly_changes_the_frames_of_a_scale_is_reported() {
    let folder = temp();
    image::RgbImage::from_pixel(160, 120, image::Rgb([120; 3])).save(folder.path().join("grey.png")).unwrap();
    let calibrate = ["calibrate", "grey.png", "-o", "mine.scale.json", "--width", "160", "--with"];
    let finished = Pdk::new(calibrate).args(["gaussian_blur", "--with", "fog_filter"]).folder(folder.path());
    let warning = "pdk: warning: no level of the scale can be reached with gaussian_blur: on these frames";
    let stderr = finished.succeed().stderr;
    assert!(stderr.contains(warning), "{stderr}");
}

#[test]
fn a_recording_is_evaluated_on_a_scale() {
    let folder = temp();
    let out = folder.path().join("out");
    let run = |levels: &str| {
        Pdk::new(["run", "offline", "--out"])
            .arg(&out)
            .set("dataset", repository().join("docs/examples/tub").display())
            .set("driver", r#"{"name":"dave2","speed":8}"#)
            .set("trust", true)
            .set("frames", 2)
            .set("perturbations", "fog_filter,gaussian_blur")
            .set("levels", levels)
            .set("level_scale", "calibrated-1")
    };
    let stderr = run("0,3").succeed().stderr;
    let left_out =
        "Left out, because calibrated-1 does not have all of levels 0 to 3 for them: gaussian_blur";
    assert!(stderr.contains(left_out), "{stderr}");
    let results = json_lines(&out.join("results.jsonl"));
    assert_eq!(results.len(), 4, "two frames at two levels");
    for line in results {
        assert_eq!(line["label"], r#"fog_filter,level_scale="calibrated-1""#);
    }
    fs::remove_dir_all(&out).unwrap();
    run("0,9").fail(1, &["has to be a number from 0 to 4"]);
    let refusal = "with level_scale, perturbations are names alone, without parameters and modifiers";
    run("0,3").set("perturbations", "rotate_image@degrees=7").fail(1, &[refusal]);
    let blur = run("0,3").set("perturbations", "gaussian_blur");
    blur.fail(1, &["no perturbation reaches levels 0 to 3 of calibrated-1; set other levels"]);
}

#[test]
fn a_scale_is_measured_and_used() {
    let folder = temp();
    fs::create_dir(folder.path().join("frames")).unwrap();
    for shift in [0, 20] {
        let file = folder.path().join(format!("frames/{shift}.png"));
        pictures::road(160, 120, shift).save(file).unwrap();
    }
    let run = |more: &[&str]| {
        let given = ["calibrate", "frames", "-o", "mine.scale.json", "--width", "160"];
        Pdk::new(given).args(more).folder(folder.path())
    };
    let printed = run(&["--with", "increase_brightness", "--with", "fog_filter"]).succeed().stdout;
    assert!(printed.contains("Wrote mine.scale.json"), "{printed}");
    let scale = json_file(&folder.path().join("mine.scale.json"));
    assert_eq!(scale["frames"][1]["name"], "20");
    assert_eq!(scale["perturbations"].as_array().unwrap().len(), 2);
    // The same command writes the same bytes.
    let before = fs::read(folder.path().join("mine.scale.json")).unwrap();
    run(&["--with", "increase_brightness", "--with", "fog_filter"]).succeed();
    assert!(fs::read(folder.path().join("mine.scale.json")).unwrap() == before);
    // What costs the same is as far from the original.
    let differs = |with: &str| {
        let out = folder.path().join("out.png");
        Pdk::new(["--drop-ins", ".", "perturb", "frames/0.png", "--with", with, "-o", "out.png"])
            .folder(folder.path())
            .succeed();
        let [raw, out] =
            [folder.path().join("frames/0.png"), out].map(|file| pdk_image::read(&file).unwrap());
        pdk_calibrate::cost::of(raw.as_ref(), out.as_ref())
    };
    for level in [1.0, 2.5] {
        let expected = pdk_calibrate::cost::COSTS.at(level);
        for name in ["increase_brightness", "fog_filter"] {
            let cost = differs(&format!("{name}@{level},level_scale=mine"));
            assert!(libm::log(cost / expected).abs() < 0.2, "{name}@{level}: {cost}, not {expected}");
        }
    }
    for (with, sentence) in [
        ("fog_filter,probability=0.5", "a scale is measured without modifiers; name parameters alone"),
        ("fog_filter@3", "--with fog_filter@3: all levels are measured; leave the level out"),
    ] {
        run(&["--with", with]).fail(1, &[sentence]);
    }
    run(&["--with", "fog_filter", "--with", "fog_filter"]).fail(1, &["it is named twice"]);
    run(&["--with", "frozen_frames"]).fail(1, &["what it does cannot be seen in single frames"]);
    run(&["--costs", "1,2,3,3,5"]).fail(1, &["--costs takes 5 numbers above 0 in rising order"]);
    Pdk::new(["calibrate", "frames", "-o", "nowhere/mine.scale.json"])
        .folder(folder.path())
        .fail(1, &["cannot write nowhere/mine.scale.json: No such file or directory"]);
    Pdk::new(["calibrate", "frames", "-o", "mine.json"])
        .folder(folder.path())
        .fail(1, &["mine.json does not name a scale; write NAME.scale.json"]);
    Pdk::new(["calibrate", "frames", "-o", "calibrated-1.scale.json"])
        .folder(folder.path())
        .fail(1, &["the scale `calibrated-1` comes with pdk"]);
}

/// Every perturbation of the default set is on the scale that comes with pdk, as it is now.
#[test]
fn the_scale_that_comes_along_is_up_to_date() {
    let registry = registry(&SearchPath::default());
    for entry in registry.catalog().of_kind(Kind::Perturbation) {
        let description = &entry.description;
        let measured = entry.scales.iter().find(|measured| measured.scale.name == "calibrated-1");
        assert!(measured.is_some() || !description.default, "{} is not on the scale", description.name);
        if let Some(measured) = measured {
            assert_eq!(measured.scale.version, description.version, "{}", description.name);
        }
    }
}

/// Frames that the scale was not measured on.
fn unseen_frames() -> Vec<FrameBuf> {
    let examples = repository().join("docs/examples");
    let mut files = vec![examples.join("road.jpg")];
    for folder in ["tub/images", "recording/frames"] {
        let mut found: Vec<_> =
            fs::read_dir(examples.join(folder)).unwrap().map(|entry| entry.unwrap().path()).collect();
        found.sort();
        files.extend(found.into_iter().step_by(3));
    }
    // Photographs, if there are some.
    for name in ["solidWhiteCurve", "solidYellowLeft", "whiteCarLaneSwitch"] {
        files.extend(real_data(&format!("road/{name}.jpg")));
    }
    let read =
        |file: &PathBuf| picture::to_frame(picture::scaled(&pdk_image::read(file).unwrap(), 320)).unwrap();
    files.iter().map(read).collect()
}

/// By what factor costs differ: 2 to the root of the mean square of their distances from their mean, on a logarithmic scale.
fn spread(costs: &[f64]) -> f64 {
    let logarithms: Vec<f64> = costs.iter().map(|cost| libm::log2(*cost)).collect();
    let mean = logarithms.iter().sum::<f64>() / costs.len() as f64;
    let variance = logarithms.iter().map(|log| (log - mean) * (log - mean)).sum::<f64>() / costs.len() as f64;
    libm::exp2(variance.sqrt())
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_level_costs_alike_on_frames_that_the_scale_was_not_measured_on() {
    let registry = registry(&SearchPath::default());
    let frames = unseen_frames();
    let cost = |text: &str| {
        let applied = AppliedPerturbation::parse(text).unwrap();
        registry.catalog().level_scale(&applied).ok()?;
        let mut chain = Chain::new(&registry, std::slice::from_ref(&applied), 5).unwrap();
        let mut sum = 0.0;
        for (number, frame) in frames.iter().enumerate() {
            let mut perturbed = FrameBuf::new(frame.width(), frame.height());
            let index = 53 * number as u64;
            chain.begin_again(std::slice::from_ref(&applied), number as u64);
            chain
                .apply(frame.as_ref(), perturbed.as_mut(), &Moment::new(index, index as f64 / 20.0))
                .unwrap();
            sum += pdk_calibrate::cost::of(frame.as_ref(), perturbed.as_ref());
        }
        Some(sum / frames.len() as f64)
    };
    let catalog = registry.catalog().of_kind(Kind::Perturbation);
    let names: Vec<_> =
        catalog.filter(|entry| entry.description.default).map(|entry| &entry.description.name).collect();
    for level in [1.0, 1.5, 2.0, 2.5, 3.0] {
        let on_scale: Vec<_> = names
            .iter()
            .filter_map(|name| Some((cost(&format!("{name}@{level},level_scale=calibrated-1"))?, *name)))
            .collect();
        let costs: Vec<f64> = on_scale.iter().map(|(cost, _)| *cost).collect();
        let published: Vec<f64> = on_scale
            .iter()
            .map(|(_, name)| cost(&format!("{name}@{level}")).unwrap())
            .filter(|cost| *cost > 0.0)
            .collect();
        let (before, after) = (spread(&published), spread(&costs));
        let expected = pdk_calibrate::cost::COSTS.at(level);
        let farthest = on_scale
            .iter()
            .max_by(|a, b| libm::log(a.0 / expected).abs().total_cmp(&libm::log(b.0 / expected).abs()))
            .unwrap();
        println!(
            "level {level}: {} perturbations, spread {before:.2} on the published scale, {after:.2} on this one; farthest {} with {:.1} instead of {expected:.1}",
            costs.len(),
            farthest.1,
            farthest.0
        );
        assert!(libm::log2(after) < 0.5 * libm::log2(before), "level {level}: {after} against {before}");
    }
}
