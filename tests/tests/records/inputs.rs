//! Whatever a run reads is part of it: it is not continued or merged with other weights, pictures, modules or traces.

use std::fs;
use std::path::Path;

use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::records::{self, assert_equal, files, trace};
use pdk_tests::{Pdk, datasets, onnx, pictures, temp};

/// Drives with whatever driver is set.
const DRIVES: &str = r#"
    local settings = pdk.settings({ driver = { name = "lane_keeper" } })
    pdk.drive({
        simulator = { name = "lane", width = 32, height = 24, rate = 10 }, driver = settings.driver, duration = 0.5,
        scenarios = { { name = "one", seed = 1 }, { name = "two", seed = 2 } },
    })
"#;

fn run(out: &Path, script: &Path) -> Pdk {
    Pdk::new(["run", "--workers", "1", "--out"]).arg(out).arg(script)
}

#[test]
fn other_weights_beside_a_network_are_another_run() {
    let folder = temp();
    let (script, model) = (pipeline(folder.path(), DRIVES), folder.path().join("pilot.onnx"));
    let driver = format!(r#"{{"name":"onnx","model":"{}"}}"#, model.display());
    let out = folder.path().join("whole");
    let weigh = |mix| onnx::pilot_with_weights_beside(&model, "pilot.bin", 24, 32, mix);
    weigh(7);
    run(&out, &script).set("driver", &driver).succeed();
    run(&out, &script).set("driver", &driver).succeed();
    let part = |index: &str| {
        let out = folder.path().join(index);
        let shard = format!("{index}/2");
        run(&out, &script).set("driver", &driver).args(["--shard", &shard]).succeed();
        out
    };
    let first = part("1");
    weigh(5);
    let second = part("2");
    let difference = format!("the file {} is a different one", folder.path().join("pilot.bin").display());
    run(&out, &script)
        .set("driver", &driver)
        .fail(1, &["holds the record of another run", &difference, "--out"]);
    let merged = folder.path().join("merged");
    Pdk::new(["merge"])
        .args([&first, &second])
        .arg("--out")
        .arg(&merged)
        .fail(1, &["is of another run than", &difference]);
    let replayed = Pdk::new(["replay"]).arg(&out).run();
    assert!(
        replayed.stderr.contains(&format!("since the run was recorded, {difference}")),
        "{}",
        replayed.stderr
    );
}

/// A tub of few pictures, of which each has its hash in the manifest, and one of many.
#[test]
fn another_picture_of_a_dataset_is_another_run() {
    for (count, named) in [(3, true), (80, false)] {
        let folder = temp();
        let (tub, model) = (folder.path().join("tub"), folder.path().join("pilot.onnx"));
        datasets::tub(&tub, count, 32, 24);
        onnx::pilot(&model, 3, 24, 32);
        let source = r#"
            pdk.evaluate({ dataset = pdk.path("tub"), driver = { name = "onnx", model = pdk.path("pilot.onnx") },
                perturbations = { "contrast" }, levels = { 1 }, trust = true })
        "#;
        let script = pipeline(folder.path(), source);
        let out = folder.path().join("record");
        run(&out, &script).succeed();
        run(&out, &script).succeed();
        let listed = json_file(&out.join("manifest.json"))["files"].clone();
        let group = listed.as_array().unwrap().iter().find(|file| file["group"] == "files of the dataset");
        assert_eq!(group.unwrap()["count"], count + 2, "pictures, catalog and manifest: {listed}");
        let picture = tub.join("images/1_cam_image_array_.jpg");
        let before = fs::read(&picture).unwrap();
        pictures::road(32, 24, 9).save(&picture).unwrap();
        let difference = match named {
            true => format!("the file {} is a different one", picture.display()),
            false => format!(
                "the files of the dataset in {} ({} in all) are not the same",
                tub.display(),
                count + 2
            ),
        };
        run(&out, &script).fail(1, &["holds the record of another run", &difference]);
        fs::write(&picture, &before).unwrap();
        run(&out, &script).succeed();
        // What was recorded with a picture.
        let catalog = tub.join("catalog_0.catalog");
        let lines = fs::read_to_string(&catalog).unwrap();
        fs::write(&catalog, lines.replacen("\"user/throttle\":0.4", "\"user/throttle\":0.3", 1)).unwrap();
        let difference = match named {
            true => format!("the file {} is a different one", catalog.display()),
            false => "are not the same".to_owned(),
        };
        run(&out, &script).fail(1, &["holds the record of another run", &difference]);
    }
}

/// Evaluates as the file beside the pipeline says, which is not part of the pipeline's text.
#[test]
fn another_evaluation_is_another_run() {
    let folder = temp();
    let project = folder.path().join("project");
    fs::create_dir(&project).unwrap();
    datasets::tub(&project.join("tub"), 3, 32, 24);
    for name in ["pilot.onnx", "other.onnx"] {
        onnx::pilot(&project.join(name), 3, 24, 32);
    }
    let source = r#"
        local settings = pdk.settings({ perturbations = { "contrast" } })
        -- An evaluation that fails uses up a number.
        local function evaluate(name, frames)
            return pcall(pdk.evaluate, { dataset = pdk.path("tub"), driver = { name = "onnx", model = pdk.path(name) },
                perturbations = settings.perturbations, levels = { 1 }, frames = frames, trust = true })
        end
        assert(not evaluate("pilot.onnx", 0))
        local good, result = evaluate("other.onnx", 3)
        if not good then
            error(result, 0)
        end
    "#;
    let (script, out) = (pipeline(&project, source), folder.path().join("record"));
    run(&out, &script).succeed();
    let expected = files(&out);
    run(&out, &script).succeed();
    assert_equal(&out, &expected);
    // Another place is not another evaluation.
    fs::rename(&project, folder.path().join("moved")).unwrap();
    let script = folder.path().join("moved").join(script.file_name().unwrap());
    let results = fs::read(out.join("results.jsonl")).unwrap();
    run(&out, &script).succeed();
    assert_eq!(fs::read(out.join("results.jsonl")).unwrap(), results);
    let manifest = out.join("manifest.json");
    let told = json_file(&manifest)["evaluations"].clone();
    assert_eq!(told.as_array().unwrap().len(), 2);
    assert!(json_lines(&out.join("results.jsonl")).iter().all(|line| line["evaluation"] == 1));
    // As if the record were of another level.
    let text = fs::read_to_string(&manifest).unwrap();
    let mut other = json_file(&manifest);
    other["evaluations"][1]["perturbations"][0]["level"] = 2.into();
    fs::write(&manifest, other.to_string()).unwrap();
    let difference = "`evaluations[1].perturbations[0].level` was 2.0 and is 1.0";
    run(&out, &script).fail(1, &["another run", difference]);
    fs::write(&manifest, text).unwrap();
    run(&out, &script).succeed();
}

#[test]
fn another_module_of_a_program_is_another_run() {
    let folder = temp();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("pilot.sh", ". \"$(dirname \"$0\")/helper.sh\"\n");
    write("helper.sh", "exit 3\n");
    write("weights", "1");
    let program = folder.path().join("pilot.sh");
    let driver = format!(
        r#"{{"name":"process","command":["sh","{}"],"files":["{}"]}}"#,
        program.display(),
        folder.path().join("weights").display()
    );
    let (script, out) = (pipeline(folder.path(), DRIVES), folder.path().join("record"));
    let run = || run(&out, &script).set("driver", &driver);
    // The program does not drive, which is an outcome like any other.
    run().fail(1, &["2 of 2 scenarios", "exit status: 3"]);
    for (name, text, before) in [("helper.sh", "exit 4\n", "exit 3\n"), ("weights", "2", "1")] {
        write(name, text);
        let difference = format!("the file {} is a different one", folder.path().join(name).display());
        run().fail(1, &["holds the record of another run", &difference]);
        write(name, before);
    }
    write("new.sh", "");
    let difference = format!("the modules .sh in {} were 2 and are 3", folder.path().display());
    run().fail(1, &["holds the record of another run", &difference]);
    // Not a module.
    fs::remove_file(folder.path().join("new.sh")).unwrap();
    write("notes.txt", "");
    run().fail(1, &["2 of 2 scenarios", "exit status: 3"]);
}

/// A record with two scenarios of the same length.
fn record(folder: &Path) -> (std::path::PathBuf, std::path::PathBuf) {
    let (script, out) = (pipeline(folder, DRIVES), folder.join("record"));
    run(&out, &script).succeed();
    (script, out)
}

#[test]
fn a_trace_belongs_to_its_scenario_and_its_outcome() {
    let folder = temp();
    let (script, out) = record(folder.path());
    let whole = files(&out);
    let lines = json_lines(&out.join("scenarios.jsonl"));
    let [one, two] = [0, 1].map(|number: usize| trace(&out, &lines[number]));
    let swap = || {
        let between = out.join("between");
        fs::rename(&one, &between).unwrap();
        fs::rename(&two, &one).unwrap();
        fs::rename(&between, &two).unwrap();
    };
    swap();
    let ids = [0, 1].map(|number: usize| lines[number]["id"].as_str().unwrap().to_owned());
    let difference = format!("(it is the trace of {} and not of {})", ids[1], ids[0]);
    Pdk::new(["replay"]).arg(&out).fail(1, &["2 of 2 scenarios could not be compared", &difference]);
    Pdk::new(["export"]).arg(&out).fail(1, &[&difference]);
    let report = Pdk::new(["report", "--out"]).arg(folder.path().join("page.html")).arg(&out).succeed();
    assert!(report.stderr.contains("scenario 0 is shown without its path"), "{}", report.stderr);
    assert!(report.stderr.contains(&difference), "{}", report.stderr);
    let again = run(&out, &script).succeed();
    assert_eq!(again.stderr.matches("is driven again: the trace ").count(), 2, "{}", again.stderr);
    assert_equal(&out, &whole);
    // The same scenario with another outcome, as in real time.
    records::edit(&out, |lines| lines[1].outcome.digest = "00".repeat(16));
    let difference = format!(
        "(its steps have the digest {} and the outcome has 0000",
        lines[1]["digest"].as_str().unwrap()
    );
    Pdk::new(["replay"]).arg(&out).fail(1, &["1 of 2 scenarios could not be compared", &difference]);
    let again = run(&out, &script).succeed();
    assert_eq!(again.stderr.matches("is driven again: the trace ").count(), 1, "{}", again.stderr);
    assert_equal(&out, &whole);
}

#[test]
fn a_trace_of_another_part_is_not_merged() {
    let folder = temp();
    let script = pipeline(folder.path(), DRIVES);
    let parts = ["1", "2"].map(|index| {
        let out = folder.path().join(index);
        run(&out, &script).args(["--shard", &format!("{index}/2")]).succeed();
        let line = json_lines(&out.join("scenarios.jsonl"))[0].clone();
        (trace(&out, &line), out)
    });
    fs::copy(&parts[0].0, &parts[1].0).unwrap();
    Pdk::new(["merge"])
        .args([&parts[0].1, &parts[1].1])
        .arg("--out")
        .arg(folder.path().join("merged"))
        .fail(1, &["does not belong to its line in scenarios.jsonl (it is the trace of"]);
}

#[test]
fn an_id_is_that_of_its_scenario() {
    let folder = temp();
    let (script, out) = record(folder.path());
    let merged_out = folder.path().join("merged");
    let (mut forged, mut own) = (String::new(), String::new());
    records::edit(&out, |lines| {
        own = lines[0].id.to_string();
        lines[0].id = "ab".repeat(16).parse().unwrap();
        forged = lines[0].id.to_string();
    });
    let parts = [
        "scenarios.jsonl:1 is not a line as pdk writes it".to_owned(),
        format!("its id is {forged} and that of its scenario is {own}"),
    ];
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    for verb in ["replay", "report", "export"] {
        Pdk::new([verb]).arg(&out).fail(1, &parts);
    }
    Pdk::new(["shrink", "--scenario", "0"]).arg(&out).fail(1, &parts);
    run(&out, &script).fail(1, &parts);
    // In a part of a run.
    let part = folder.path().join("part");
    run(&part, &script).args(["--shard", "1/1"]).succeed();
    fs::copy(out.join("scenarios.jsonl"), part.join("scenarios.jsonl")).unwrap();
    Pdk::new(["merge"]).arg(&part).arg("--out").arg(&merged_out).fail(1, &parts);
}
