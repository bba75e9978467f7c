//! Descriptions of networks, from the command line: what is guessed, what is written to complete, what is seen, and what does not fit.

use std::fs;
use std::path::Path;

use pdk_tests::{Pdk, repository, temp};

fn pdk(arguments: &[&str]) -> Pdk {
    Pdk::new(arguments)
}

/// Copies a network of `tests/networks`, with its description or without.
fn network(folder: &Path, name: &str, described: bool) -> String {
    let from = repository().join("tests/networks");
    let model = folder.join("pilot.onnx");
    fs::copy(from.join(format!("{name}.onnx")), &model).unwrap();
    if described {
        fs::copy(from.join(format!("{name}.toml")), folder.join("pilot.toml")).unwrap();
    }
    model.to_str().unwrap().to_owned()
}

#[test]
fn guesses_are_reported_with_their_reasons_and_written_to_complete() {
    let folder = temp();
    let model = network(folder.path(), "yuv", false);
    let shown = pdk(&["show", &model]).succeed().stdout;
    for expected in [
        "described nowhere; `pdk new network",
        "layout    nhwc (the shape is (batch, 66, 200, 3))",
        "size      200x66 pixels (the shape says so)",
        "color     rgb (ASSUMED: ",
        "scale     0..255 (ASSUMED: ",
        "steering  angle (it is the only output)",
    ] {
        assert!(shown.contains(expected), "{expected} in {shown}");
    }
    let written = pdk(&["new", "network", &model]).succeed().stdout;
    assert!(written.contains("pilot.toml"), "{written}");
    let text = fs::read_to_string(folder.path().join("pilot.toml")).unwrap();
    for expected in [
        "\n# color = \"rgb\"\n",
        "\n# scale = \"0..255\"\n",
        "\nsteering = \"angle\"\n",
        "\n# crop = {",
        "# ASSUMED: rgb, because",
    ] {
        assert!(text.contains(expected), "{expected} in {text}");
    }
    // It is in force as it was written, and what is assumed is so until a person has looked at it.
    let shown = pdk(&["show", &model]).succeed().stdout;
    assert!(shown.contains("pilot.toml line ") && shown.contains("color     rgb (ASSUMED"), "{shown}");
    let checked = text
        .replace("# color = \"rgb\"", "color = \"rgb\"")
        .replace("# scale = \"0..255\"", "scale = \"0..255\"");
    fs::write(folder.path().join("pilot.toml"), checked).unwrap();
    let shown = pdk(&["show", &model]).succeed().stdout;
    assert!(shown.contains("pilot.toml line ") && !shown.contains("ASSUMED"), "{shown}");
    pdk(&["new", "network", &model]).fail(1, &["pilot.toml describes the network already; edit it"]);
    pdk(&["new", "network", "pilot"])
        .fail(1, &["`pilot` is not an ONNX file; write `pdk new network MODEL.onnx`"]);
    // Of a stack, the file does not say enough.
    fs::remove_file(folder.path().join("pilot.toml")).unwrap();
    let model = network(folder.path(), "stack", false);
    let shown = pdk(&["show", &model]).succeed().stdout;
    assert!(shown.contains("unknown   its input `frames` has the shape (1, 9, 32, 64)"), "{shown}");
    pdk(&["new", "network", &model]).succeed();
    let text = fs::read_to_string(folder.path().join("pilot.toml")).unwrap();
    assert!(
        text.contains("# Cannot be guessed: its input `frames`") && text.contains("\n# frames = 3\n"),
        "{text}"
    );
}

#[test]
fn what_a_network_sees_is_a_picture() {
    let folder = temp();
    let out = folder.path().join("seen.png");
    let (out, road) = (out.to_str().unwrap(), repository().join("docs/road.png"));
    for (name, width, height) in
        [("yuv", 320 + 8 + 2 * 200, 160), ("stack", 320 + 8 + 64, 160), ("mean_crop", 320 + 8 + 3 * 96, 160)]
    {
        let model = network(folder.path(), name, true);
        pdk(&["show", &model, "--image", road.to_str().unwrap(), "-o", out]).succeed();
        let seen = image::open(out).unwrap();
        assert_eq!((seen.width(), seen.height()), (width, height), "{name}");
    }
    pdk(&["show", "fog_filter", "--image", "a.png", "-o", out])
        .fail(1, &["`fog_filter` is not an ONNX file"]);
}

/// A run of a network on one short road.
fn drive(folder: &Path, model: &str) -> Pdk {
    let source = r#"
        local settings = pdk.settings({ model = "" })
        pdk.drive({ simulator = { name = "lane", width = 160, height = 80 }, driver = { name = "onnx", model = settings.model, engine = "pdk" },
            scenarios = { { seed = 1, duration = 0.3 }, { seed = 2, duration = 0.3 } } })
    "#;
    let pipeline = pdk_tests::process::pipeline(folder, source);
    Pdk::new(["run", "--workers", "2", "--out"]).arg(folder.join("record")).arg(pipeline).set("model", model)
}

#[test]
fn a_run_says_once_what_it_assumes() {
    let folder = temp();
    let model = network(folder.path(), "yuv", false);
    let ran = drive(folder.path(), &model).succeed();
    assert_eq!(ran.stderr.matches("pdk: notice: driver").count(), 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("assumes color rgb, scale 0..255"), "{}", ran.stderr);
    fs::remove_dir_all(folder.path().join("record")).unwrap();
    let model = network(folder.path(), "yuv", true);
    let ran = drive(folder.path(), &model).succeed();
    assert!(!ran.stderr.contains("notice"), "{}", ran.stderr);
    let manifest = fs::read_to_string(folder.path().join("record/manifest.json")).unwrap();
    assert!(manifest.contains("description of pilot.onnx"), "{manifest}");
}

#[test]
fn a_description_that_does_not_fit_ends_a_run_with_file_field_and_remedy() {
    let folder = temp();
    for (name, description, expected) in [
        (
            "mean_crop",
            "scale = \"0..1\"\nmean = [0.5, 0.5]\n",
            "pilot.toml line 2: `mean` has 2 numbers, but a frame has 3 channels; write one number",
        ),
        (
            "yuv",
            "color = \"rgb\"\nscale = \"0..1\"\nlayout = \"nchw\"\n",
            "pilot.toml line 3: `layout` is nchw, but the input `input_1` has the shape (batch, 66, 200, 3)",
        ),
        (
            "categorical",
            "scale = \"0..1\"\n[steering]\noutput = \"angle_out\"\nbins = { from = -1, to = 1, count = 11 }\n[throttle]\noutput = \"throttle_out\"\n",
            "pilot.toml line 2: `steering` has 11 bins, but the output `angle_out` has 15 numbers; write as many bins",
        ),
        (
            "stack",
            "frames = 2\n",
            "pilot.toml line 1: `frames` does not fit the input `frames` with the shape (1, 9, 32, 64): there would have to be 2 or 6 channels",
        ),
        (
            "recurrent",
            "[state]\nhidden = \"hidden_nxt\"\n",
            "pilot.toml line 1: `state` names the output `hidden_nxt`, which the network does not have; did you mean `hidden_next`?",
        ),
        (
            "speed",
            "[inputs]\nv = { value = \"speed\", unit = \"kmh\" }\ncommand = 0\n",
            "pilot.toml line 1: `inputs` for `v` has the unit \"kmh\"; did you mean `km/h`?",
        ),
        ("yuv", "colour = \"yuv\"\n", "pilot.toml line 1: there is no field `colour`; did you mean `color`?"),
        (
            "yuv",
            "crop = { top = 90 }\n",
            "its `crop` leaves columns 0 to 160 and rows 90 to 80 of a frame of 160x80 pixels; correct it, or set `frame`",
        ),
    ] {
        let model = network(folder.path(), name, false);
        fs::write(folder.path().join("pilot.toml"), description).unwrap();
        let _ = fs::remove_dir_all(folder.path().join("record"));
        drive(folder.path(), &model).fail(1, &[expected]);
        // What a crop leaves depends on the frames.
        if !description.starts_with("crop") {
            pdk(&["show", &model]).fail(1, &[expected]);
        }
    }
}

#[test]
fn doctor_names_the_engines_that_run_networks() {
    let report = pdk(&["doctor"]).run().stdout;
    assert!(report.contains("engine     `pdk`, the default, runs networks on pdk "), "{report}");
    assert!(report.contains("engine     `onnxruntime`"), "{report}");
}
