//! The life of a plugin: begun with `pdk new`, built, tested, checked, installed, used, replaced, removed; and what a record says
//! of one that is gone.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::{Pdk, library, pictures, target_folder, temp, test_library};
use serde_json::json;

/// A library of this package, as Cargo names it.
fn library_of(name: &str) -> String {
    format!("lib{name}.{}", std::env::consts::DLL_EXTENSION)
}

/// Builds and tests a crate that `pdk new` has written; the library.
fn build(project: &Path) -> PathBuf {
    // A folder of its own, kept from one test run to the next.
    let target = target_folder().parent().unwrap().join("new-plugin");
    for verb in ["build", "test"] {
        let built = Command::new(option_env!("CARGO").unwrap_or("cargo"))
            .args([verb, "--release", "--offline"])
            .current_dir(project)
            .env("CARGO_TARGET_DIR", &target)
            .output()
            .unwrap();
        assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    }
    target.join("release").join(library_of(project.file_name().unwrap().to_str().unwrap()))
}

/// `pdk` for a user whose plugins lie below this folder.
fn user(home: &Path, arguments: &[&str]) -> Pdk {
    Pdk::new(arguments).folder(home).env("XDG_DATA_HOME", home.join("data"))
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_new_plugin_is_built_checked_installed_and_used() {
    let home = temp();
    let home = home.path();
    let said = user(home, &["new", "perturbation", "salt_spray", "--rust"]).succeed().stdout;
    assert!(said.contains("pdk plugin add target/release/libsalt_spray."), "{said}");
    user(home, &["new", "perturbation", "salt_spray", "--rust"]).fail(1, &["salt_spray exists already"]);
    let project = home.join("salt_spray");
    let package = fs::read_to_string(project.join("Cargo.toml")).unwrap();
    let homepage = package.replace("# homepage", "homepage");
    assert_ne!(package, homepage);
    fs::write(project.join("Cargo.toml"), homepage).unwrap();
    let built = build(&project);
    let checked = user(home, &["check"]).arg(&built).succeed();
    assert!(checked.stdout.contains("ok   perturbation `salt_spray`"), "{}", checked.stdout);

    assert!(user(home, &["plugin", "list"]).succeed().stdout.starts_with("Nothing is installed in "));
    let added = user(home, &["plugin", "add"]).arg(&built).succeed().stdout;
    let file = home.join("data/pdk/plugins").join(library_of("salt_spray"));
    assert_eq!(
        added,
        format!("Installed salt_spray 0.1.0 in {}: perturbation `salt_spray`.\n", file.display())
    );
    assert_eq!(fs::read(&file).unwrap(), fs::read(&built).unwrap());
    let again = user(home, &["plugin", "add"]).arg(&built).succeed().stdout;
    assert!(again.starts_with("salt_spray 0.1.0 is installed already, in "), "{again}");
    let listed = user(home, &["plugin", "list", "--json"]).succeed().json();
    assert_eq!(listed[0]["name"], json!("salt_spray"));
    assert_eq!(listed[0]["homepage"], json!("https://example.org/salt_spray"));
    assert_eq!(listed[0]["components"], json!([{ "kind": "perturbation", "name": "salt_spray" }]));
    assert_eq!(listed[0]["file"]["path"], json!(file));

    pictures::write(&home.join("in.png"), 64, 48);
    user(home, &["perturb", "in.png", "--with", "salt_spray@4", "-o", "out.png"]).succeed();
    let [before, after] = ["in.png", "out.png"].map(|name| image::open(home.join(name)).unwrap().into_rgb8());
    assert!(before.get_pixel(0, 0)[0] / 2 > after.get_pixel(0, 0)[0], "the corner is darker");
    // What is installed has its name.
    user(home, &["new", "perturbation", "salt_spray", "--rust", "--out", "other"])
        .fail(1, &["`salt_spray` already, in"]);

    user(home, &["plugin", "remove", "salt_spry"])
        .fail(1, &["no plugin `salt_spry`", "did you mean `salt_spray`?"]);
    let removed = user(home, &["plugin", "remove", "salt_spray"]).succeed().stdout;
    assert_eq!(removed, format!("Removed {}.\n", file.display()));
    user(home, &["show", "salt_spray"]).fail(1, &["there is no component `salt_spray`"]);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_new_simulator_and_a_new_driver_drive_together_and_a_replay_says_where_to_get_them() {
    let home = temp();
    let home = home.path();
    for what in ["simulator", "driver"] {
        let name = format!("my_{what}");
        user(home, &["new", what, &name]).succeed();
        let project = home.join(&name);
        if what == "driver" {
            let package = fs::read_to_string(project.join("Cargo.toml")).unwrap();
            fs::write(project.join("Cargo.toml"), package.replace("# homepage", "homepage")).unwrap();
        }
        let built = build(&project);
        let checked = user(home, &["check"]).arg(&built).succeed();
        assert!(checked.stdout.contains(&format!("ok   {what} `{name}`")), "{}", checked.stdout);
        user(home, &["plugin", "add"]).arg(&built).succeed();
    }
    let source = r#"
        pdk.drive({ simulator = "my_simulator", driver = "my_driver", scenarios = { {}, { perturbations = { "contrast@1" } } } })
    "#;
    let script = pipeline(home, source);
    let run = |out: &str| user(home, &["run", "--out", out]).arg(&script).succeed();
    run("record");
    for line in json_lines(&home.join("record/scenarios.jsonl")) {
        assert_eq!(line["cause"], json!("finished"), "the template drives to the end: {line}");
    }
    let manifest = json_file(&home.join("record/manifest.json"));
    let component = |name: &str| {
        let components = manifest["components"].as_array().unwrap();
        components.iter().find(|component| component["name"] == name).unwrap().clone()
    };
    let driver = component("my_driver");
    let plugin =
        json!({ "name": "my_driver", "version": "0.1.0", "homepage": "https://example.org/my_driver" });
    assert_eq!(driver["plugin"], plugin);
    assert_eq!(component("my_simulator")["plugin"], json!({ "name": "my_simulator", "version": "0.1.0" }));
    let replay = || user(home, &["replay", "record"]);
    assert_eq!(replay().succeed().stderr, "");

    // Another build: the replay works, and says which one the record was made with.
    let installed = home.join("data/pdk/plugins").join(library_of("my_driver"));
    let original = fs::read(&installed).unwrap();
    fs::write(&installed, [original.as_slice(), b"changed"].concat()).unwrap();
    let hash = driver["file"]["blake3"].as_str().unwrap();
    let place =
        format!("the plugin my_driver 0.1.0 (BLAKE3 {hash}), to be had at https://example.org/my_driver");
    let warned = replay().succeed().stderr;
    assert!(
        warned.contains(&format!(
            "data/pdk/plugins/{}, is not that of {place}, so the replay",
            library_of("my_driver")
        )),
        "{warned}"
    );

    user(home, &["plugin", "remove", "my_driver"]).succeed();
    let remedy = ": install it with `pdk plugin add FILE`, or name its folder with --plugins";
    let file = Path::new("data/pdk/plugins").join(library_of("my_driver"));
    let from = format!("the record has it from {}, {place}{remedy}", file.display());
    replay().fail(1, &["there is no driver `my_driver`", &from]);
    fs::write(&installed, original).unwrap();
    user(home, &["plugin", "remove", "my_simulator"]).succeed();
    // One that does not say where to get it.
    let parts =
        ["the plugin my_simulator 0.1.0 (BLAKE3 ", "), to be had from its author: ", "pdk plugin add"];
    replay().fail(1, &["there is no simulator `my_simulator`", parts[0], parts[1], parts[2]]);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_new_adapter_drives_the_simulator_of_its_test() {
    let home = temp();
    let home = home.path();
    user(home, &["new", "adapter", "my_bridge"]).succeed();
    // Its tests drive.
    let built = build(&home.join("my_bridge"));
    let checked = user(home, &["check"]).arg(&built).succeed().stdout;
    let note = "note simulator `my_bridge` was made and not used, because the simulator my_bridge is not at 127.0.0.1:9000";
    assert!(checked.contains("ok   simulator `my_bridge`") && checked.contains(note), "{checked}");
}

/// Each of the crates has a test of its own for the rules of its kind, and `pdk check` uses it as pdk does.
#[test]
#[ignore = "long: .ci/run runs it"]
fn a_crate_of_each_other_kind_is_built_and_checked() {
    let home = temp();
    let home = home.path();
    pictures::write(&home.join("in.png"), 64, 48);
    let recording = home.join("recording");
    fs::create_dir(&recording).unwrap();
    fs::copy(home.join("in.png"), recording.join("0.png")).unwrap();
    fs::write(recording.join("frames.txt"), "0.png,0.1,0.2,0\n").unwrap();
    for what in ["mask", "saliency", "search", "dataset"] {
        let name = format!("my_{what}");
        user(home, &["new", what, &name, "--rust"]).succeed();
        let built = build(&home.join(&name));
        let check = user(home, &["check"]).arg(&built);
        // Only a dataset needs something of the user's.
        let check = if what == "dataset" { check.set("my_dataset.path", recording.display()) } else { check };
        let checked = check.succeed().stdout;
        assert!(checked.contains(&format!("{what} `{name}`")), "{checked}");
        user(home, &["plugin", "add"]).arg(&built).succeed();
    }
    user(home, &["perturb", "in.png", "-o", "out.png", "--with", r#"contrast@4,where={"mask":"my_mask"}"#])
        .succeed();
    user(home, &["saliency", "in.png", "--driver", "dave2", "--with", "my_saliency"]).succeed();
    let settings = ["strategy=my_search", "evaluations=24", "perturbations=[\"contrast\"]", "duration=0.5"];
    let search = user(home, &["run", "search", "--out", "record"]);
    let search = settings.iter().fold(search, |pdk, setting| pdk.arg("--set").arg(setting));
    search.succeed();
    let dataset = json!({ "name": "my_dataset", "path": recording });
    let offline = user(home, &["run", "offline", "--set", "driver=lane_keeper", "--set"]);
    let evaluated = offline.arg(format!("dataset={dataset}")).succeed().stdout;
    assert!(evaluated.contains("1 frame"), "{evaluated}");
}

#[test]
fn what_cannot_be_used_is_not_installed() {
    let home = temp();
    let home = home.path();
    let add = |file: &Path| user(home, &["plugin", "add"]).arg(file);
    fs::write(home.join("text.so"), "this is not a library\n").unwrap();
    fs::write(home.join("seven.lua"), "return 7").unwrap();
    add(&home.join("text.so")).fail(1, &["text.so", "is not a library"]);
    add(&home.join("seven.lua")).fail(1, &["seven.lua"]);
    add(&home.join("nothing.so")).fail(1, &["cannot find", "nothing.so"]);
    add(home).fail(1, &["is not a file"]);
    add(&test_library("stranger")).fail(1, &["was built for version 2 of the plugin interface"]);
    add(&test_library("misbehave"))
        .env("MISBEHAVE", "abort_in_describe")
        .env("PDK_CACHE", home.join("cache"))
        .fail(1, &["libmisbehave", "opening it was ended by signal 6"]);
    add(&library("pdk_noise")).fail(1, &["pdk-noise is not installed", "comes with pdk"]);
    assert!(!home.join("data").exists());
    user(home, &["plugin", "add"])
        .env("XDG_DATA_HOME", "")
        .env("HOME", "")
        .arg(test_library("frozen"))
        .fail(1, &["there is no folder for your plugins", "HOME"]);
}

#[test]
fn names_that_clash_are_reported() {
    let home = temp();
    let home = home.path();
    let tint = |tone: u8| {
        let source = format!(
            "return {{ doc = 'tints', parameters = {{}}, apply = function(image, cx) return image:fill({tone}, 9, 9) end }}"
        );
        fs::write(home.join("tint.lua"), source).unwrap();
    };
    tint(9);
    let added = user(home, &["plugin", "add", "tint.lua"]).succeed().stdout;
    assert!(
        added.starts_with("Installed tint 1 in ") && added.ends_with("tint.lua: perturbation `tint`.\n"),
        "{added}"
    );
    tint(8);
    user(home, &["plugin", "add", "tint.lua"])
        .fail(1, &["another tint is installed already", "--replace", "pdk plugin remove tint"]);
    user(home, &["plugin", "add", "tint.lua", "--replace"]).succeed();
    let installed = home.join("data/pdk/plugins/tint.lua");
    assert_eq!(fs::read(home.join("tint.lua")).unwrap(), fs::read(&installed).unwrap());

    fs::rename(home.join("tint.lua"), home.join("contrast.lua")).unwrap();
    user(home, &["plugin", "add", "contrast.lua"])
        .fail(1, &["there is a perturbation `contrast` already, in ", "which comes with pdk; rename yours"]);

    user(home, &["plugin", "add"]).arg(test_library("frozen")).succeed();
    let table = user(home, &["plugin", "list"]).succeed().stdout;
    assert!(
        table.contains("1.2.3") && table.contains("dataset `frozen`") && table.contains("tint.lua"),
        "{table}"
    );
    // A file that has become unusable is listed with the reason, and can be removed.
    let frozen = home.join("data/pdk/plugins").join(library_of("frozen"));
    fs::write(&frozen, "cut off").unwrap();
    let listed = user(home, &["plugin", "list", "--json"]).succeed().json();
    let broken = listed.as_array().unwrap().iter().find(|plugin| plugin["name"] == "frozen").unwrap();
    assert!(broken["error"].as_str().unwrap().contains("is not a library"), "{broken}");
    user(home, &["plugin", "remove", "frozen"]).succeed();
    assert!(!frozen.exists() && installed.exists());
}
