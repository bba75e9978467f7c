//! What users get wrong, and what their machines do to them: a sentence, an exit code, and nothing half-written.

use std::fs;
use std::path::Path;
use std::process::Command;

use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::{Pdk, pictures, repository, temp};

fn perturb(folder: &Path, image: &str, with: &str, output: &str) -> Pdk {
    Pdk::new(["perturb", image, "--with", with, "-o", output]).folder(folder)
}

#[test]
fn images_that_cannot_be_read_are_named() {
    let folder = temp();
    let path = |name: &str| folder.path().join(name);
    for ending in ["jpg", "png", "bmp", "webp"] {
        let name = format!("cut.{ending}");
        pictures::write(&path(&name), 64, 48);
        pictures::cut(&path(&name));
        perturb(folder.path(), &name, "contrast@1", "out.png").fail(1, &[&name]);
    }
    fs::write(path("text.jpg"), "no picture").unwrap();
    fs::write(path("empty.png"), "").unwrap();
    // A PNG that says it is as large as the world.
    let mut large = fs::read({
        pictures::write(&path("large.png"), 8, 8);
        path("large.png")
    })
    .unwrap();
    large[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    fs::write(path("large.png"), large).unwrap();
    for name in ["text.jpg", "empty.png", "large.png", "missing.png", "."] {
        perturb(folder.path(), name, "contrast@1", "out.png").fail(1, &[name]);
    }
    for (output, said) in [("out.mp4", "neither a video nor an image"), ("out.png", "JPEG, PNG, BMP or WebP")]
    {
        perturb(folder.path(), "text.jpg", "contrast@1", output).fail(1, &["text.jpg", said]);
    }
    perturb(folder.path(), "cut.png", "contrast@1", "out.mp4")
        .fail(1, &["`cut.png` is an image", "end in .png"]);
    assert!(!path("out.png").exists() && !path("out.mp4").exists());
}

#[test]
fn what_a_frame_cannot_show_is_refused() {
    let folder = temp();
    let path = |name: &str| folder.path().join(name);
    let pixel = |alpha: u8| image::RgbaImage::from_pixel(32, 16, image::Rgba([10, 200, 30, alpha]));
    pixel(254).save(path("clear.png")).unwrap();
    pixel(254).save(path("clear.webp")).unwrap();
    pixel(255).save(path("opaque.png")).unwrap();
    for name in ["clear.png", "clear.webp"] {
        perturb(folder.path(), name, "contrast@1", "out.png")
            .fail(1, &[name, "512 of its pixels are not opaque", "lay it over a background"]);
    }
    // An overlay is there to be seen through.
    perturb(folder.path(), "opaque.png", "overlay@1,clip=clear.png", "out.png").succeed();
    perturb(folder.path(), "opaque.png", "contrast@1", "out.png").succeed();
}

#[test]
fn what_is_given_twice_is_refused() {
    let folder = temp();
    let script = pipeline(
        folder.path(),
        "local s = pdk.settings({ n = 1, driver = 'lane_keeper' })
         pdk.drive({ simulator = 'lane', driver = s.driver, duration = 0.2, scenarios = { {} } })",
    );
    let run = |values: &[&str]| {
        let values = values.iter().flat_map(|value| ["--set", value]);
        Pdk::new(["run"]).args(values).arg(&script).folder(folder.path())
    };
    run(&["n=1", "n=2"]).fail(1, &["--set n is given more than once"]);
    run(&["seed=1", "seed=1"]).fail(1, &["--set seed is given more than once"]);
    run(&[r#"driver={"name":"lane_keeper","name":"dave2"}"#])
        .fail(1, &["--set driver", "the key `name` occurs twice"]);
    run(&[r#"driver.target_speed={"a":1,"a":2}"#])
        .fail(1, &["--set driver.target_speed", "the key `a` occurs twice"]);
    assert!(!folder.path().join("runs").exists());
    pictures::write(&folder.path().join("in.png"), 16, 12);
    perturb(
        folder.path(),
        "in.png",
        r#"contrast,level={"ramp":{"from":0,"to":1,"to":4,"end":1}}"#,
        "out.png",
    )
    .fail(1, &["the key `to` occurs twice"]);
    Pdk::new(["doctor", "--simulator", "lane", "--set", "width=64", "--set", "width=128"])
        .fail(1, &["--set width is given more than once"]);
}

#[test]
fn seeds_are_those_that_every_language_keeps() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 16, 12);
    let drive = |seed: &str| {
        let scenario = format!(
            "pdk.drive({{ simulator = {{ name = 'lane', width = 64, height = 48 }}, driver = 'lane_keeper', duration = 0.2, \
             scenarios = {{ {{ seed = {seed} }} }} }})"
        );
        Pdk::new(["run"]).arg(pipeline(folder.path(), &scenario)).folder(folder.path())
    };
    drive("9007199254740991").succeed();
    // Lua has made 2^53 of it when pdk sees it.
    for seed in ["9007199254740993", "9007199254740992", "1e18"] {
        drive(seed).fail(1, &["`seed` is ", "from 0 to 9007199254740991"]);
    }
    let script = pipeline(folder.path(), "pdk.settings({})");
    let large = "9007199254740992";
    Pdk::new(["run", "--set", "seed=9007199254740992"])
        .arg(&script)
        .fail(1, &["--set seed", "is not a seed"]);
    for arguments in [
        &["run", "x.lua"][..],
        &["perturb", "in.png", "--with", "contrast@1", "-o", "out.png"],
        &["road"],
        &["preview", "in.png", "-o", "shown"],
    ] {
        let finished = Pdk::new(arguments).args(["--seed", large]).folder(folder.path()).run();
        assert_eq!(finished.code, Some(2), "{arguments:?}: {}", finished.stderr);
        assert!(finished.stderr.contains("is not a seed"), "{}", finished.stderr);
    }
}

#[test]
fn numbers_may_be_written_without_their_zero() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 16, 12);
    for with in ["gaussian_noise@.5,sigma=.1", "gaussian_noise@0.5,sigma=0.1"] {
        perturb(folder.path(), "in.png", with, &format!("{}.png", with.len())).succeed();
    }
    let written = [26, 28].map(|length| fs::read(folder.path().join(format!("{length}.png"))).unwrap());
    assert_eq!(written[0], written[1]);
}

#[test]
fn a_level_function_without_a_level_is_named() {
    let folder = temp();
    let source =
        "pdk.drive({ simulator = 'misbehave', driver = 'misbehave', scenarios = { { perturbations = {
        { name = 'contrast', level = function(t) if t < 0.25 then return 1 end end } } } } })";
    Pdk::new(["run"])
        .arg(pipeline(folder.path(), source))
        .misbehave()
        .folder(folder.path())
        .fail(1, &["pipeline.lua:1", "the level of `contrast` is nothing at 0.25 s", "from 0 to 4"]);
}

#[test]
fn a_wrong_perturbation_is_answered_with_what_there_is() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 16, 12);
    for (with, parts) in [
        ("gausian_noise@1", &["`gausian_noise`", "did you mean `gaussian_noise`"][..]),
        ("gaussian_noise@9", &["gaussian_noise@9", "from 0 to 4"]),
        ("gaussian_noise@-1", &["from 0 to 4"]),
        ("gaussian_noise@high", &["high", "from 0 to 4"]),
        ("gaussian_noise@nan", &["from 0 to 4"]),
        ("gaussian_noise@1,loudness=3", &["loudness", "it has"]),
        ("gaussian_noise@1,loudness", &["`loudness`", "name=value"]),
        ("motion_blur@1,degrees=90", &["degrees", "-45 to 45"]),
        ("motion_blur@1,degrees=steep", &["degrees", "number"]),
        ("", &["names no perturbation", "NAME@LEVEL"]),
        ("@2", &["`@2` names no perturbation", "NAME@LEVEL"]),
    ] {
        perturb(folder.path(), "in.png", with, "out.png").fail(1, parts);
    }
    for (time, shown) in
        [("nan", "--time is NaN"), ("1e300", "--time is 1e300,"), ("-2e9", "--time is -2e9,")]
    {
        let given = ["--time", time].map(str::to_owned);
        let perturb = perturb(folder.path(), "in.png", "contrast@1", "out.png");
        perturb.arg(given.join("=")).fail(1, &[shown, "within 1e9"]);
    }
    assert!(!folder.path().join("out.png").exists());
}

#[test]
fn places_that_cannot_be_written_are_named() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 16, 12);
    perturb(folder.path(), "in.png", "contrast@1", "in.png/out.png").fail(1, &["in.png/out.png"]);
    perturb(folder.path(), "in.png", "contrast@1", "/proc/pdk/out.png").fail(1, &["/proc/pdk/out.png"]);
    perturb(folder.path(), "in.png", "contrast@1", "out").fail(1, &["its name has to end in"]);

    let quick = "pdk.drive({ simulator = 'misbehave', driver = 'misbehave', scenarios = { {} } })";
    let quick = pipeline(folder.path(), quick);
    let run = |out: &str| Pdk::new(["run", "--out", out]).arg(&quick).misbehave().folder(folder.path());
    run("in.png/record").fail(1, &["in.png/record", "--out"]);
    run("in.png").fail(1, &["in.png", "--out"]);
    run("/proc/pdk").fail(1, &["/proc/pdk", "--out"]);
    run(".").fail(1, &["is not empty", "--out"]);
    run("record").succeed();
    let before = fs::read(folder.path().join("record/manifest.json")).unwrap();
    run("record").args(["--seed", "1"]).fail(1, &["record holds the record of another run", "--out"]);
    assert_eq!(fs::read(folder.path().join("record/manifest.json")).unwrap(), before);

    let export = |to: &str| Pdk::new(["export", "record", "-o", to]).folder(folder.path());
    export("in.png/x.json").fail(1, &["in.png/x.json"]);
    for verb in [["new", "pipeline", "x", "--out", "in.png"], ["new", "driver", "x", "--out", "in.png"]] {
        Pdk::new(verb).folder(folder.path()).fail(1, &["in.png"]);
    }
}

/// Many scenarios, so that the record soon fills a disk.
const HUNGRY: &str = r#"
    local scenarios = {}
    for index = 1, 600 do table.insert(scenarios, { seed = index }) end
    pdk.drive({ simulator = "misbehave", driver = "misbehave", images_every = 1, scenarios = scenarios })
"#;

/// What holds whatever was full: complete lines, in files that can be read.
fn check_what_was_recorded(out: &Path) -> usize {
    let lines = out.join("scenarios.jsonl");
    if !lines.exists() {
        return 0;
    }
    let outcomes = json_lines(&lines);
    assert!(outcomes.iter().all(|outcome| outcome["cause"] == "finished"));
    outcomes.len()
}

#[test]
fn a_file_that_may_not_grow_ends_the_run_with_a_sentence() {
    let folder = temp();
    let hungry = pipeline(folder.path(), HUNGRY);
    // In blocks of 512 or 1024 bytes, as the shell has it: enough for the topics in shared memory, which count as files
    // too, and not for all lines.
    let recorded = ["140", "280"].map(|blocks| {
        let out = folder.path().join(format!("record-{blocks}"));
        Pdk::program("sh")
            .arg("-c")
            .arg(format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\""))
            .arg(pdk_tests::built("pdk"))
            .args(["run", "--workers", "2", "--out"])
            .arg(&out)
            .arg(&hungry)
            .misbehave()
            .fail(1, &["cannot write", "scenarios.jsonl", "free some space"]);
        check_what_was_recorded(&out)
    });
    assert!(recorded[0] > 0 && recorded[0] < recorded[1] && recorded[1] < 600, "{recorded:?}");
}

#[test]
fn a_disk_that_fills_up_ends_the_run_with_a_sentence() {
    let folder = temp();
    let disk = folder.path().join("disk");
    fs::create_dir(&disk).unwrap();
    let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", "size=256k", "tmpfs"]).arg(&disk).output();
    if !mounted.is_ok_and(|mounted| mounted.status.success()) {
        eprintln!("skipped: a small disk cannot be mounted here");
        return;
    }
    let hungry = pipeline(folder.path(), HUNGRY);
    let out = disk.join("record");
    let finished = Pdk::new(["run", "--out"]).arg(&out).arg(&hungry).misbehave().run();
    let recorded = std::panic::catch_unwind(|| check_what_was_recorded(&out));
    assert!(Command::new("umount").arg(&disk).status().unwrap().success());
    assert_eq!(finished.code, Some(1), "{}", finished.stderr);
    assert!(
        finished.stderr.contains("cannot write") && finished.stderr.contains("free some space"),
        "{}",
        finished.stderr
    );
    assert!((1..600).contains(&recorded.unwrap()));
}

#[test]
fn a_result_does_not_replace_what_it_is_made_from() {
    let folder = temp();
    pdk_tests::pictures::write(&folder.path().join("in.png"), 32, 24);
    let before = fs::read(folder.path().join("in.png")).unwrap();
    for output in ["in.png", "./in.png"] {
        Pdk::new(["perturb", "in.png", "--with", "contrast@2", "-o", output])
            .folder(folder.path())
            .fail(1, &["would replace in.png", "-o"]);
    }
    assert_eq!(fs::read(folder.path().join("in.png")).unwrap(), before);
}

#[test]
fn wrong_settings_are_answered_with_what_there_is() {
    let folder = temp();
    let script = repository().join("scripts/quickstart.lua");
    let run = || Pdk::new(["run"]).arg(&script).folder(folder.path());
    for (setting, parts) in [
        ("dration=3", &["dration", "did you mean `duration`"][..]),
        ("duration=long", &["duration", "`long` is not a number"]),
        ("duration=-1", &["`duration` is -1 s"]),
        ("duration=1e9", &["86400"]),
        ("levels=high", &["levels", "`high` is not a number"]),
        ("levels=5", &["from 0 to 4"]),
        ("perturbations=fogg", &["`fogg`"]),
        ("driver=lane_keper", &["lane_keper", "did you mean `lane_keeper`"]),
        ("duration.unit=3", &["duration.unit", "is not a table"]),
        ("driver.pace=3", &["dave2", "has no parameter `pace`"]),
        (r#"driver={"name":"lane_keeper","speed":3}"#, &["speed", "target_speed"]),
        ("simulator=line", &["simulator", "`line`"]),
        ("seed=-1", &["seed", "whole number"]),
        ("seed=1.5", &["seed", "whole number"]),
        ("workers=0", &["workers", "from 1 to 1024"]),
        ("memory=0", &["memory", "positive number of MiB"]),
        ("patience=0", &["patience", "positive"]),
    ] {
        let sentence = run().arg("--set").arg(setting).fail(1, parts);
        assert!(sentence.len() < 700, "{sentence}");
    }
    // Not one of them began to drive.
    let driven: Vec<_> =
        walk(folder.path()).into_iter().filter(|path| path.ends_with("scenarios.jsonl")).collect();
    for lines in driven {
        assert_eq!(fs::metadata(&lines).unwrap().len(), 0, "{}", lines.display());
    }
    // What only the simulator knows is an error of each scenario, none of which drives a frame.
    let record = folder.path().join("road");
    run().set("road", r#"{"angels":[1]}"#).arg("--out").arg(&record).fail(1, &["angels", "13 of 13"]);
    let outcomes = json_lines(&record.join("scenarios.jsonl"));
    assert_eq!(outcomes.len(), 13);
    assert!(outcomes.iter().all(|outcome| outcome["cause"] == "error" && outcome["frames"] == 0));
}

fn walk(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() { found.extend(walk(&path)) } else { found.push(path) }
    }
    found
}

#[test]
fn a_pipeline_that_fails_says_where() {
    let folder = temp();
    for (source, parts) in [
        ("local x = \n", &["pipeline.lua:"][..]),
        ("\n\nerror('on purpose')", &["pipeline.lua:3", "on purpose"]),
        ("local t = nil\nreturn t.x", &["pipeline.lua:2", "nil"]),
        ("pdk.drvie({})", &["pipeline.lua:1"]),
        ("pdk.drive({ simulator = 'misbehave' })", &["pipeline.lua:1", "`scenarios` is missing"]),
        (
            "pdk.drive({ simulator = 'misbehave', scenarios = { {} } })",
            &["pipeline.lua:1", "scenarios[1]", "`driver` is missing"],
        ),
        ("pdk.drive(7)", &["pipeline.lua:1", "pdk.drive"]),
        (
            "pdk.drive({ simulator = 'misbehave', driver = 'misbehave', scenarios = {} })",
            &["scenarios", "empty"],
        ),
        (
            "pdk.drive({ simulator = 'misbehave', driver = 'misbehave', scenarios = { { lenght = 3 } } })",
            &["lenght"],
        ),
        (
            "pdk.drive({ simulator = 'misbehave', driver = 'misbehave', images_every = -1, scenarios = { {} } })",
            &["pdk.drive", "`images_every` is -1", "whole number of at least 0"],
        ),
        (
            "pdk.drive({ simulator = 'misbehave', driver = 'misbehave', scenarios = { { perturbations = 'contrast@1' } } })",
            &["scenarios[1]", "`perturbations` is \"contrast@1\"", "a list"],
        ),
        (
            "pdk.drive({ simulator = 'misbehave', driver = 'misbehave', duration = 0/0, scenarios = { {} } })",
            &["pipeline.lua:1", "pdk.drive.duration is NaN, but has to be a finite number"],
        ),
        (
            "pdk.drive({ simulator = 'lane', driver = 'misbehave', scenarios = { { road = { angles = { 0, 1/0 } } } } })",
            &["pipeline.lua:1", "angles[2] is inf, but has to be a finite number"],
        ),
        (
            "pdk.table({ 'a' }, { { -1/0 } })",
            &["pipeline.lua:1", "pdk.table", "is -inf, but has to be a finite number"],
        ),
        ("pdk.settings({ seed = 3 })", &["seed", "every pipeline"]),
        ("pdk.settings({}) pdk.settings({})", &["once"]),
        (
            "local s = pdk.settings({ level = 4 })\nprint(s.levl)",
            &["pipeline.lua:2", "the pipeline has no setting `levl`; did you mean `level`?"],
        ),
        ("pdk.show(3)", &["pdk.show"]),
        (
            "pdk.evaluate({ dataset = 'x', driver = 'misbehave', perturbations = { 'contrast' }, levels = { 9 } })",
            &["pipeline.lua:1", "from 0 to 4"],
        ),
        (
            "pdk.evaluate({ dataset = 'x', driver = 'misbehave', perturbations = {}, levels = { 1 } })",
            &["pipeline.lua:1", "`perturbations` is empty"],
        ),
        (
            "pdk.evaluate({ dataset = 'x', driver = 'misbehave', perturbations = { 'contrast' }, levels = {} })",
            &["pipeline.lua:1", "`levels` is empty"],
        ),
        ("io.open('/etc/passwd')", &["pipeline.lua:1"]),
        ("os.execute('true')", &["pipeline.lua:1"]),
        ("require('x')", &["pipeline.lua:1"]),
        ("\x1bLua", &["pipeline.lua"]),
    ] {
        Pdk::new(["run"])
            .arg(pipeline(folder.path(), source))
            .misbehave()
            .folder(folder.path())
            .fail(1, parts);
    }
    fs::write(folder.path().join("binary.lua"), [0xff, 0xfe, 0, 1]).unwrap();
    Pdk::new(["run", "binary.lua"]).folder(folder.path()).fail(1, &["binary.lua"]);
    Pdk::new(["run", "missing.lua"])
        .folder(folder.path())
        .fail(1, &["missing.lua (it does not exist); check the path"]);
    Pdk::new(["run", "."]).folder(folder.path()).fail(1, &["cannot read the pipeline"]);
    let unknown = Pdk::new(["run"]).arg(pipeline(folder.path(), "local x = 1")).set("speed", 3);
    unknown.fail(1, &["no setting `speed`"]);
    // A mistake on the command line shows before anything is driven.
    let drives = pipeline(
        folder.path(),
        "pdk.drive({ simulator = 'misbehave', driver = 'misbehave', scenarios = { {} } })",
    );
    let run = Pdk::new(["run"]).arg(drives).misbehave().folder(folder.path()).set("speed", 3);
    run.fail(1, &["no setting `speed`"]);
    assert!(!folder.path().join("runs").exists());
}

#[test]
fn a_script_that_runs_away_is_stopped() {
    let folder = temp();
    let run = |source: &str| Pdk::new(["run"]).arg(pipeline(folder.path(), source)).folder(folder.path());
    run("while true do end")
        .env("PDK_SCRIPT_SECONDS", "0.2")
        .fail(1, &["pipeline.lua:1", "0.2 s", "PDK_SCRIPT_SECONDS"]);
    run("pcall(function() while true do end end)\nwhile true do end")
        .env("PDK_SCRIPT_SECONDS", "0.2")
        .fail(1, &["0.2 s"]);
    run("local t = {} while true do table.insert(t, string.rep('x', 1000000) .. #t) end")
        .env("PDK_SCRIPT_SECONDS", "30")
        .env("PDK_SCRIPT_MEGABYTES", "32")
        .fail(1, &["pipeline.lua:1", "32 MiB", "PDK_SCRIPT_MEGABYTES"]);
    run("local function f() return f() + 1 end f()").fail(1, &["pipeline.lua:1"]);
    run("").env("PDK_SCRIPT_SECONDS", "soon").fail(1, &["PDK_SCRIPT_SECONDS", "positive number"]);
}

#[test]
fn a_lua_perturbation_that_runs_away_fails_its_scenario_only() {
    let folder = temp();
    // If everything has to be a perturbation.
    let scripts = folder.path().join("perturbations");
    fs::create_dir(&scripts).unwrap();
    let perturbation = |name: &str, body: &str| {
        let text = format!("return {{ doc = \"Fails\", apply = function(image, cx)\n{body}\nend }}");
        fs::write(scripts.join(format!("{name}.lua")), text).unwrap();
    };
    perturbation("endless", "while true do end");
    perturbation("greedy", "local t = {} while true do table.insert(t, buffer.create(1000000)) end");
    perturbation("broken", "error('on purpose')");
    fs::write(scripts.join("nothing.lua"), "return 7").unwrap();
    let source = r#"
        pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = {
            {}, { perturbations = { "endless" } }, { perturbations = { "greedy" } }, { perturbations = { "broken" } },
            { seed = 1 },
        } })
    "#;
    let out = folder.path().join("record");
    let finished = Pdk::new(["run", "--out"])
        .arg(&out)
        .arg(pipeline(folder.path(), source))
        .misbehave()
        .arg("--plugins")
        .arg(&scripts)
        .env("PDK_SCRIPT_SECONDS", "0.3")
        .env("PDK_SCRIPT_MEGABYTES", "32")
        .run();
    assert_eq!(finished.code, Some(1), "{}", finished.stderr);
    assert!(finished.stderr.contains("3 of 5 scenarios"), "{}", finished.stderr);
    assert!(
        finished.stderr.contains("warning") && finished.stderr.contains("nothing.lua"),
        "{}",
        finished.stderr
    );
    let outcomes = json_lines(&out.join("scenarios.jsonl"));
    let causes: Vec<_> = outcomes.iter().map(|outcome| outcome["cause"].as_str().unwrap()).collect();
    assert_eq!(causes, ["finished", "error", "error", "error", "finished"]);
    for (outcome, parts) in outcomes[1..4].iter().zip([
        ["endless.lua:2", "0.3 s"],
        ["greedy.lua:2", "32 MiB"],
        ["broken.lua:2", "on purpose"],
    ]) {
        let error = outcome["error"].as_str().unwrap();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
}
