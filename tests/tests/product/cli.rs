//! The command line: what every verb offers, output for scripts, exit codes.

use pdk_model::perturbation::{MODIFIERS, Modifier};
use pdk_tests::{Pdk, pictures, temp};
use serde_json::Value;

/// The verbs, as the help lists them.
fn verbs() -> Vec<String> {
    let help = Pdk::new(["--help"]).succeed().stdout;
    let list = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let list = list.take_while(|line| line.starts_with("  "));
    // What is indented further is the rest of a sentence.
    let verbs =
        list.filter(|line| !line.starts_with("   ")).filter_map(|line| line.split_whitespace().next());
    verbs.filter(|verb| *verb != "help").map(str::to_owned).collect()
}

#[test]
fn every_verb_explains_itself() {
    let help = Pdk::new(["--help"]).succeed().stdout;
    for code in ["0 done", "1 failed", "2 wrong usage", "70", "75"] {
        assert!(help.contains(code), "the help does not tell exit code {code}");
    }
    let verbs = verbs();
    for known in ["run", "perturb", "preview", "reference", "check", "doctor"] {
        assert!(verbs.iter().any(|verb| verb == known), "the help does not list {known}: {verbs:?}");
    }
    for verb in verbs {
        let own = Pdk::new([&verb, "--help"]).succeed().stdout;
        assert!(own.contains(&format!("Usage: pdk {verb}")), "{own}");
    }
    let version = Pdk::new(["--version"]).succeed().stdout;
    let lines: Vec<_> = version.lines().collect();
    assert!(lines[0].starts_with("pdk ") && lines[0].split('.').count() == 3, "{version}");
    for (line, start) in lines[1..].iter().zip(["plugin interface: ", "instructions: ", "engine: "]) {
        assert!(line.len() > start.len() && line.starts_with(start), "{version}");
    }
    assert_eq!(lines.len(), 4, "{version}");
}

#[test]
fn wrong_usage_has_a_code_of_its_own() {
    for arguments in [
        &["fly"][..],
        &["run"],
        &["list", "perturbations"],
        &["perturb", "in.png"],
        &["run", "x.lua", "--workers", "many"],
        &["run", "x.lua", "--set", "nothing"],
        &[],
    ] {
        let finished = Pdk::new(arguments).run();
        assert_eq!(finished.code, Some(2), "{arguments:?}: {}", finished.stderr);
        assert!(finished.stdout.is_empty() && finished.stderr.contains("--help"), "{}", finished.stderr);
    }
}

#[test]
fn lists_tell_the_same_to_people_and_to_scripts() {
    let all = Pdk::new(["list", "--json"]).succeed().json();
    let people = Pdk::new(["list"]).succeed().stdout;
    let all = all.as_array().unwrap();
    for kind in ["perturbation", "simulator", "driver", "saliency", "search", "dataset"] {
        // A kind without components is an error for people, because it is likely a mistake.
        let own = Pdk::new(["list", kind, "--json"]).run();
        let own: Vec<Value> = own.json().as_array().unwrap().clone();
        let of_kind: Vec<_> = all.iter().filter(|c| c["description"]["kind"] == kind).cloned().collect();
        assert_eq!(own, of_kind, "{kind}");
    }
    for component in all {
        let description = &component["description"];
        let name = description["name"].as_str().unwrap();
        assert!(people.contains(name), "{name}");
        let file = component["file"].as_str().unwrap();
        assert!(std::path::Path::new(file).is_file() || file.starts_with("built-in:"), "{file}");
        let doc = description["doc"].as_str().unwrap();
        assert!(!doc.is_empty() && !doc.ends_with('.'), "{name}: {doc}");
        for parameter in description["parameters"].as_array().unwrap() {
            assert!(!parameter["doc"].as_str().unwrap().is_empty(), "{name}: {parameter}");
        }
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn every_component_can_be_shown() {
    let all = Pdk::new(["list", "--json"]).succeed().json();
    for component in all.as_array().unwrap() {
        let name = component["description"]["name"].as_str().unwrap();
        let shown = Pdk::new(["show", name]).succeed().stdout;
        assert!(shown.starts_with(&format!("{name} - ")), "{shown}");
        let json = Pdk::new(["show", name, "--json"]).succeed().json();
        assert!(json.as_array().unwrap().contains(component), "{name}");
    }
    Pdk::new(["show", "gausian_noise"]).fail(1, &["`gausian_noise`", "did you mean `gaussian_noise`"]);
}

#[test]
fn help_and_show_list_the_modifiers_of_perturbations() {
    let help = Pdk::new(["perturb", "--help"]).succeed().stdout;
    let shown = Pdk::new(["show", "contrast"]).succeed().stdout;
    for modifier in MODIFIERS {
        let Modifier { name, examples, .. } = modifier;
        assert!(shown.contains(name), "`pdk show` does not tell of {name}: {shown}");
        for example in *examples {
            assert!(help.contains(&format!("{name}={example}")), "the help has no {name}={example}: {help}");
        }
    }
    // Only perturbations have them.
    assert!(!Pdk::new(["show", "lane_keeper"]).succeed().stdout.contains("probability"));
}

/// One rule for scripts and clips: a name that is there already stays what it is, and pdk says so.
#[test]
fn a_name_of_pdks_own_stays_what_it_is() {
    let folder = temp();
    let scripts = folder.path().join("scripts");
    let clips = folder.path().join("clips");
    std::fs::create_dir_all(&scripts).unwrap();
    std::fs::create_dir_all(&clips).unwrap();
    let script = "return { doc = \"Mine\", apply = function(image) image:fill(0, 0, 0) end }";
    std::fs::write(scripts.join("gaussian_noise.lua"), script).unwrap();
    std::fs::write(clips.join("motion_blur.mp4"), "never opened").unwrap();
    let listed = Pdk::new(["list", "perturbation", "--json"])
        .args(["--plugins", "scripts", "--drop-ins", "clips"])
        .folder(folder.path())
        .succeed();
    let warnings: Vec<_> = listed.stderr.lines().collect();
    assert_eq!(warnings.len(), 2, "{}", listed.stderr);
    for (name, file) in [("gaussian_noise", "gaussian_noise.lua"), ("motion_blur", "motion_blur.mp4")] {
        let warning = warnings.iter().find(|warning| warning.contains(file)).unwrap();
        assert!(warning.contains(&format!("perturbation `{name}`")), "{warning}");
        assert!(warning.contains("is left out, because") && warning.contains("rename"), "{warning}");
        let list = listed.json();
        let kept = list.as_array().unwrap().iter().find(|c| c["description"]["name"] == name).unwrap();
        assert!(kept["file"].as_str().unwrap().contains("libpdk_"), "{kept}");
    }
    for more in [&[][..], &["--rust"]] {
        Pdk::new(["new", "perturbation", "gaussian_noise", "--out", "new"])
            .args(more)
            .folder(folder.path())
            .fail(1, &["`gaussian_noise` already", "libpdk_noise", "another name"]);
    }
    assert!(!folder.path().join("new").exists());
    Pdk::new(["new", "pipeline", "gaussian_noise", "--out", "new"]).folder(folder.path()).succeed();
}

#[test]
fn the_doctor_finds_what_is_wrong() {
    let folder = temp();
    let well = Pdk::new(["doctor", "--json"]).succeed().json();
    let findings = well.as_array().unwrap();
    let subjects: Vec<_> = findings.iter().map(|finding| finding["subject"].as_str().unwrap()).collect();
    for subject in ["version", "components", "routing"] {
        assert!(subjects.contains(&subject), "{subjects:?}");
    }
    assert!(findings.iter().all(|finding| finding["state"] != "bad"));
    assert!(Pdk::new(["doctor"]).succeed().stdout.contains("shared memory"));

    let broken = folder.path().join("broken.so");
    std::fs::write(&broken, "no library").unwrap();
    let ill = Pdk::new(["doctor", "--plugins"]).arg(&broken).run();
    assert_eq!(ill.code, Some(1));
    assert!(ill.stdout.contains("broken.so") && ill.stdout.contains("BAD"), "{}", ill.stdout);
    // The folder of the cache is made when it is needed.
    Pdk::new(["doctor"]).env("PDK_CACHE", folder.path().join("cache")).succeed();
    for variable in ["PDK_PLUGIN_PATH", "PDK_ONNXRUNTIME"] {
        let missing = Pdk::new(["doctor"]).env(variable, "/no/such/folder").run();
        assert_eq!(missing.code, Some(1));
        let said = format!(
            "{variable} {} /no/such/folder, which does not exist",
            match variable {
                "PDK_PLUGIN_PATH" => "names",
                _ => "is",
            }
        );
        assert!(missing.stdout.contains(&said), "{}", missing.stdout);
    }
}

#[cfg(unix)]
#[test]
fn the_doctor_takes_no_program_that_cannot_be_run() {
    use std::os::unix::fs::PermissionsExt;
    let folder = temp();
    let program = folder.path().join("ffmpeg");
    std::fs::write(&program, "").unwrap();
    for (mode, state) in [(0o644, "note"), (0o755, "ok")] {
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(mode)).unwrap();
        let findings = Pdk::new(["doctor", "--json"]).env("PATH", folder.path()).succeed().json();
        let ffmpeg = findings.as_array().unwrap().iter().find(|f| f["subject"] == "ffmpeg").unwrap();
        assert_eq!(ffmpeg["state"], state, "{ffmpeg}");
    }
}

#[test]
fn places_of_plugins_that_cannot_be_searched_are_named() {
    let folder = temp();
    let list = |path: &str| {
        Pdk::new(["list", "driver"]).folder(folder.path()).env("PDK_PLUGIN_PATH", path).succeed()
    };
    for (path, said) in [
        ("/no/such/folder", "PDK_PLUGIN_PATH names /no/such/folder, which does not exist"),
        ("/no/such/folder:.", "PDK_PLUGIN_PATH names /no/such/folder, which does not exist"),
    ] {
        let listed = list(path);
        assert!(
            listed.stderr.starts_with("pdk: warning: ") && listed.stderr.contains(said),
            "{}",
            listed.stderr
        );
        assert_eq!(listed.stderr.lines().count(), 1, "{}", listed.stderr);
        assert!(listed.stdout.contains("lane_keeper"));
    }
    for path in ["", ":", "."] {
        assert_eq!(list(path).stderr, "", "{path}");
    }
    // A file where the user's folder of plugins should be.
    std::fs::create_dir(folder.path().join("pdk")).unwrap();
    std::fs::create_dir(folder.path().join("pdk/plugins")).unwrap();
    std::fs::write(folder.path().join("pdk/plugins/overlays"), "no folder").unwrap();
    let listed = Pdk::new(["list", "driver"]).env("XDG_DATA_HOME", folder.path()).succeed();
    assert!(listed.stderr.contains("pdk/plugins/overlays cannot be read"), "{}", listed.stderr);
}

#[test]
fn a_preview_shows_perturbations_as_they_are_named() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 32, 24);
    let preview = |more: &[&str]| {
        let small = ["preview", "in.png", "--width", "32", "--picture", "32", "--json"];
        Pdk::new(small).args(more).folder(folder.path())
    };
    let size = |name: &str| image::image_dimensions(folder.path().join(name).join("sheet.png")).unwrap();
    preview(&["-o", "all", "--with", "pixelate", "--with", "pixelate@2,variant=corrected"]).succeed();
    preview(&["-o", "one", "--with", "pixelate@2"]).succeed();
    // Two columns of five pictures, against a single picture.
    assert_eq!((size("all").0, size("one").0), (3 * 16 + 2 * (5 * 32 + 4 * 6), 2 * 16 + 32));
    let moving =
        preview(&["-o", "moving", "--with", "dynamic_rain_filter@4", "--with", "dynamic_rain_filter"]);
    assert_eq!(moving.succeed().json()["written"].as_array().unwrap().len(), 1 + 2 * 2);
    assert!(folder.path().join("moving/dynamic_rain_filter-2.gif").is_file());
    preview(&["--with", "pixelate@2,variant=odd"]).fail(1, &["variant", "corrected"]);
    preview(&["--with", "pixelate@7"]).fail(1, &["pixelate@7", "from 0 to 4"]);
    preview(&["--with", "pixelade"]).fail(1, &["did you mean `pixelate`"]);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_preview_shows_the_clips_of_the_user_and_leaves_out_what_fails() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 32, 24);
    std::fs::create_dir(folder.path().join("clips")).unwrap();
    let clip = std::fs::read(pdk_tests::repository().join("scripts/overlays/snow.mp4")).unwrap();
    std::fs::write(folder.path().join("clips/whole.mp4"), &clip).unwrap();
    std::fs::write(folder.path().join("clips/cut.mp4"), &clip[..clip.len() / 2]).unwrap();
    let preview = |more: &[&str]| {
        let small = ["preview", "in.png", "--width", "16", "--picture", "16", "--drop-ins", "clips"];
        Pdk::new(small).args(more).folder(folder.path()).env("PDK_CACHE", folder.path().join("cache"))
    };
    let all = preview(&["--json"]).succeed();
    assert_eq!(all.json()["left_out"], serde_json::json!(["cut"]));
    let warnings: Vec<_> = all.stderr.lines().filter(|line| line.contains("warning")).collect();
    assert_eq!(warnings.len(), 1, "{}", all.stderr);
    assert!(warnings[0].contains("`cut` is left out") && warnings[0].contains("cut.mp4"), "{}", all.stderr);
    assert!(folder.path().join("preview/whole.gif").is_file());
    assert!(!folder.path().join("preview/cut.gif").exists());
    preview(&["--with", "cut"]).fail(1, &["cut.mp4"]);
    let told = preview(&[]).succeed().stdout;
    assert!(told.contains("by name only; --all shows them too"), "{told}");
}

#[test]
fn completions_are_there_for_the_usual_shells() {
    for shell in ["bash", "zsh", "fish"] {
        let script = Pdk::new(["completions", shell]).succeed().stdout;
        assert!(script.contains("PDK_COMPLETE"), "{script}");
    }
    Pdk::program("bash").args(["-n", "-c"]).arg(Pdk::new(["completions", "bash"]).succeed().stdout).succeed();
    let finished = Pdk::new(["completions", "tcsh"]).run();
    assert_eq!(finished.code, Some(2), "{}", finished.stderr);
    assert!(finished.stderr.contains("tcsh") && finished.stderr.contains("bash"), "{}", finished.stderr);
}

#[test]
fn completions_know_verbs_components_levels_pipelines_and_records() {
    let folder = temp();
    for run in ["quickstart-1", "quickstart-2"] {
        let record = folder.path().join("runs").join(run);
        std::fs::create_dir_all(&record).unwrap();
        std::fs::write(record.join("manifest.json"), "{}").unwrap();
    }
    std::fs::write(folder.path().join("own.lua"), "").unwrap();
    // As the function does that bash is given: the words, of which the last one is completed.
    let completed = |words: &[&str]| {
        let pdk = Pdk::new(["--"]).args(["pdk"]).args(words).folder(folder.path());
        let index = words.len().to_string();
        let pdk = pdk.env("PDK_COMPLETE", "bash").env("_CLAP_COMPLETE_INDEX", index).env("_CLAP_IFS", "\n");
        let stdout =
            pdk.env("_CLAP_COMPLETE_COMP_TYPE", "9").env("_CLAP_COMPLETE_SPACE", "true").succeed().stdout;
        stdout.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let verbs: Vec<String> = verbs().into_iter().filter(|verb| verb.starts_with("re")).collect();
    let (mut verbs, mut offered) = (verbs, completed(&["re"]));
    verbs.sort();
    offered.sort();
    assert_eq!(offered, verbs);
    assert_eq!(completed(&["show", "fog_"]), ["fog_by_visibility", "fog_filter", "fog_mapping"]);
    assert_eq!(completed(&["perturb", "road.png", "--with", "fog_filter@3"]), ["fog_filter@3"]);
    assert_eq!(completed(&["perturb", "road.png", "--with", "fog_filter@"]).len(), 5);
    assert_eq!(completed(&["saliency", "x.png", "--with", "hiresc"]), ["hirescam"]);
    assert_eq!(completed(&["run", "quick"]), ["quickstart"]);
    assert_eq!(completed(&["run", "ow"]), ["own.lua"]);
    let mut records = completed(&["replay", "runs/quickstart-"]);
    records.sort();
    records.dedup_by(|a, b| a.trim_end_matches('/') == b.trim_end_matches('/'));
    assert_eq!(records.len(), 2, "{records:?}");
}

#[test]
fn the_version_says_what_computes() {
    let short = Pdk::new(["-V"]).succeed().stdout;
    let long = Pdk::new(["--version"]).succeed().stdout;
    assert!(long.starts_with(short.trim_end()), "{long}");
    let line = |name: &str| long.lines().find_map(|line| line.strip_prefix(&format!("{name}: ")));
    assert!(line("instructions").is_some_and(|text| !text.is_empty()), "{long}");
    // As a scenario records it.
    assert!(line("engine").is_some_and(|text| text.starts_with("pdk ")), "{long}");
    let interface = line("plugin interface").and_then(|text| text.split_once(", SDK "));
    let (interface, sdk) = interface.unwrap_or_else(|| panic!("{long}"));
    assert!(interface.parse::<u64>().is_ok() && sdk.split('.').count() == 3, "{long}");
}

#[test]
fn the_cache_is_shown_and_cleared() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 64, 48);
    let pdk = |arguments: &[&str]| {
        let cache = folder.path().join("cache");
        Pdk::new(arguments.iter().copied()).folder(folder.path()).env("PDK_CACHE", cache)
    };
    pdk(&["perturb", "in.png", "--with", "static_rain_filter@2", "-o", "out.png"]).succeed();
    let parts = pdk(&["cache", "--json"]).succeed().json()["parts"].clone();
    let bytes = parts.as_array().unwrap().iter().map(|part| part["bytes"].as_u64().unwrap()).sum::<u64>();
    assert!(bytes > 0, "{parts}");
    assert!(pdk(&["cache"]).succeed().stdout.contains("overlays"));
    let removed = pdk(&["cache", "clear", "--json"]).succeed().json();
    assert_eq!(removed["bytes"], bytes);
    assert_eq!(pdk(&["cache", "--json"]).succeed().json()["parts"][0]["files"], 0);
    // What was removed is made again.
    let before = std::fs::read(folder.path().join("out.png")).unwrap();
    pdk(&["perturb", "in.png", "--with", "static_rain_filter@2", "-o", "out.png"]).succeed();
    assert_eq!(std::fs::read(folder.path().join("out.png")).unwrap(), before);
}

#[test]
fn scripts_get_json_and_nothing_else() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 16, 12);
    let perturbed =
        Pdk::new(["perturb", "in.png", "--with", "contrast@1", "-o", "new/out.png", "--json", "--seed", "4"])
            .folder(folder.path())
            .succeed()
            .json();
    assert_eq!(perturbed["perturbations"][0], "contrast@1");
    assert_eq!(perturbed["seed"], 4);
    assert!(folder.path().join("new/out.png").is_file());

    let source = r#"
        print("a script may print")
        pdk.show(pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {} } }))
    "#;
    let ran = Pdk::new(["run", "--json", "--out"])
        .arg(folder.path().join("record"))
        .arg(pdk_tests::process::pipeline(folder.path(), source))
        .misbehave()
        .succeed();
    assert_eq!(ran.json()["summary"]["outcomes"][0]["cause"], "finished");
    assert!(ran.stderr.contains("a script may print"));
    let checked = Pdk::new(["check", "--json"]).arg(pdk_tests::library("pdk_noise")).succeed().json();
    assert!(checked["checks"].as_array().unwrap().iter().all(|check| check["failure"].is_null()));
}

/// In a command, and in a pipeline as text and as a table.
#[test]
fn a_level_that_is_left_out_is_two_everywhere() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 33, 17);
    let perturbed = ["contrast", "contrast@2", "contrast@3"].map(|with| {
        Pdk::new(["perturb", "in.png", "--with", with, "-o", "out.png"]).folder(folder.path()).succeed();
        std::fs::read(folder.path().join("out.png")).unwrap()
    });
    assert!(perturbed[0] == perturbed[1] && perturbed[0] != perturbed[2]);
    let source = r#"
        local outcomes = pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = {
            { perturbations = { "contrast" } }, { perturbations = { { name = "contrast" } } },
            { perturbations = { { name = "contrast", level = 2 } } }, { perturbations = { "contrast@2" } },
            { perturbations = { "contrast@3" } },
        } })
        for number = 1, 4 do
            assert(outcomes[number].name == "contrast@2" and outcomes[number].id == outcomes[1].id)
        end
        assert(outcomes[5].id ~= outcomes[1].id)
    "#;
    Pdk::new(["run"])
        .arg(pdk_tests::process::pipeline(folder.path(), source))
        .misbehave()
        .folder(folder.path())
        .succeed();
}

#[test]
fn all_formats_of_images_are_read_and_written() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 33, 17);
    for ending in ["png", "bmp", "webp", "jpg"] {
        let name = format!("out.{ending}");
        Pdk::new(["perturb", "in.png", "--with", "contrast@1", "-o", &name]).folder(folder.path()).succeed();
        Pdk::new(["perturb", &name, "--with", "contrast@1", "-o", "back.png"])
            .folder(folder.path())
            .succeed();
        let back = image::open(folder.path().join("back.png")).unwrap();
        assert_eq!((back.width(), back.height()), (33, 17));
    }
    let other =
        Pdk::new(["perturb", "in.png", "--with", "contrast@1", "-o", "out.tiff"]).folder(folder.path());
    other.fail(1, &["out.tiff", "its name has to end in"]);
}

#[test]
fn output_that_is_not_read_does_not_panic() {
    let shell = |line: &str| Pdk::program("sh").args(["-c", line]).arg(pdk_tests::built("pdk"));
    for verb in ["list", "completions bash", "show contrast", "list --json"] {
        shell(&format!("\"$0\" {verb} > /dev/full")).fail(1, &["cannot write to standard output"]);
        // A reader that leaves early is none of pdk's business.
        let left = shell(&format!("(\"$0\" {verb}; echo code $? >&2) | head -c 1")).succeed();
        assert!(
            left.stderr.contains("code 0") && !left.stderr.contains("panicked"),
            "{verb}: {}",
            left.stderr
        );
        assert_eq!(shell(&format!("exec \"$0\" {verb} 2> /dev/full")).run().code, Some(0));
    }
    assert_eq!(shell("exec \"$0\" show nothing 2> /dev/full").run().code, Some(1));
}

#[test]
fn a_road_is_printed_as_numbers_and_text_and_drawn() {
    let folder = temp();
    let road = |arguments: &[&str]| Pdk::new(["road"]).args(arguments).folder(folder.path());
    let told = road(&[
        "--turns",
        "3",
        "--mean-curvature",
        "0.02",
        "--seed",
        "5",
        "--attempts",
        "100",
        "-o",
        "road.svg",
    ]);
    let told = told.succeed().stdout;
    assert!(told.contains("turns           3"), "{told}");
    let picture = std::fs::read_to_string(folder.path().join("road.svg")).unwrap();
    assert!(picture.starts_with("<svg") && picture.contains("<polyline"), "{picture}");
    let json = road(&["--angles", "0,30,0,-30,0,0,0,0", "--json"]).succeed().json();
    assert_eq!(json["turns"], 2);
    let angles = serde_json::json!([0.0, 30.0, 0.0, -30.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(json["road"], serde_json::json!({ "angles": angles, "segment": 25.0 }));
    let waypoints = json["waypoints"].as_str().unwrap().split('@');
    assert!(
        waypoints.clone().all(|point| point.split(',').filter(|n| n.parse::<f64>().is_ok()).count() == 3)
    );
    // A point at least every metre and a half.
    assert!(waypoints.count() as f64 > json["length"].as_f64().unwrap() / 1.5);
    road(&["--turns", "3"]).fail(1, &["--turns and --mean-curvature belong together"]);
    road(&["--limit", "99"]).fail(1, &["`limit` is 99", "from 0 to 90 degrees"]);
    road(&["--angles", "0,30", "--seed", "3", "--turns", "1"]).fail(1, &["`angles` say all"]);
    let negative = road(&["--seed", "-1"]).run();
    assert!(
        negative.code == Some(2) && negative.stderr.contains("`-1` is not a seed"),
        "{}",
        negative.stderr
    );
    road(&["-o", "missing/road.svg"]).fail(1, &["cannot write missing/road.svg"]);
}
