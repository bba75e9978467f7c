//! Records as files for other tools: each file says what the record says.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::{Pdk, datasets, temp};

/// A driver on two roads, in a clear view and under a perturbation that it does not survive.
fn driven(folder: &Path) -> PathBuf {
    let source = r#"
        local scenarios = {}
        for turn = 8, 10, 2 do
            local road = { angles = { 0, turn, turn, turn, turn }, segment = 15 }
            table.insert(scenarios, { road = road })
            for level = 1, 4, 3 do
                table.insert(scenarios, { road = road, perturbations = { "translate_image@" .. level } })
            end
        end
        pdk.drive({
            simulator = { name = "lane", width = 80, height = 60, rate = 20 },
            driver = "lane_keeper", duration = 20, scenarios = scenarios,
        })
    "#;
    let record = folder.join("record");
    Pdk::new(["run", "--out"]).arg(&record).arg(pipeline(folder, source)).succeed();
    record
}

/// Exports a record and returns the files that were written, by their names below the folder.
fn export(record: &Path, to: &str, folder: &Path) -> Vec<String> {
    let ran = Pdk::new(["export"]).arg(record).args(["--to", to, "--json", "-o"]).arg(folder).succeed();
    let named = |file: &serde_json::Value| {
        let path = PathBuf::from(file.as_str().unwrap());
        assert!(path.is_file(), "{}", path.display());
        path.strip_prefix(folder).unwrap().display().to_string()
    };
    ran.json()["files"].as_array().unwrap().iter().map(named).collect()
}

/// The lines of a file of CSV without quotes, by their fields.
fn lines(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn a_record_is_flat_csv() {
    let folder = temp();
    let (record, out) = (driven(folder.path()), folder.path().join("out"));
    let files = export(&record, "csv", &out);
    assert_eq!(files[..2], ["scenarios.csv", "telemetry.csv"]);
    for table in
        ["tables/failing-levels.csv", "tables/failed.csv", "tables/error.csv", "tables/certainty.csv"]
    {
        assert!(files.iter().any(|file| file == table), "{files:?}");
    }
    let outcomes = json_lines(&record.join("scenarios.jsonl"));
    let telemetry = lines(&out.join("telemetry.csv"));
    let column = |name: &str| telemetry[0].iter().position(|column| column == name).unwrap();
    // A line for each frame, and the largest error of each scenario is the one of its outcome.
    let frames: usize = outcomes.iter().map(|outcome| outcome["frames"].as_u64().unwrap() as usize).sum();
    assert_eq!(telemetry.len() - 1, frames);
    for outcome in &outcomes {
        let own = telemetry[1..].iter().filter(|line| outcome["id"] == line[column("id")].as_str());
        let errors = own.map(|line| line[column("cross_track_error")].parse::<f64>().unwrap().abs());
        assert_eq!(errors.fold(0.0, f64::max), outcome["max_cross_track_error"].as_f64().unwrap());
    }
    let text = fs::read_to_string(out.join("scenarios.csv")).unwrap();
    assert_eq!(text.lines().count(), outcomes.len() + 1);
    for column in [
        "number,perturbation,level,",
        "scenario.road.angles",
        "measures.rms_jerk",
        "scenario.perturbations.0.name",
    ] {
        assert!(text.lines().next().unwrap().contains(column), "{column}");
    }
    assert!(text.contains("translate_image,4,") && text.contains("lane_departure"), "{text}");
    // The mark of a report as a number.
    let failed = lines(&out.join("tables/failed.csv"));
    assert_eq!(failed.last().unwrap()[0], "translate_image");
    assert_eq!(failed.last().unwrap().last().unwrap(), "1");
}

#[test]
fn tables_and_figures_are_files() {
    let folder = temp();
    let (record, out) = (driven(folder.path()), folder.path().join("out"));
    let markdown = export(&record, "md", &out);
    let text = fs::read_to_string(out.join("tables/failed.md")).unwrap();
    assert!(
        text.contains("| perturbation | level 1 | level 4 |") && text.contains("|---|---:|---:|"),
        "{text}"
    );
    let latex = export(&record, "tex", &out);
    assert_eq!(latex.len(), markdown.len() + 1, "one document with all of them");
    let text = fs::read_to_string(out.join("tables/failed.tex")).unwrap();
    assert!(text.contains("\\toprule") && text.contains("translate\\_image & "), "{text}");

    let figures = export(&record, "svg", &out);
    for name in ["failing-levels", "failed", "error", "road-1"] {
        assert!(figures.contains(&format!("figures/{name}.svg")), "{figures:?}");
    }
    for figure in figures {
        let text = fs::read_to_string(out.join(&figure)).unwrap();
        assert!(
            text.starts_with("<svg xmlns=") && text.contains("<text") && !text.contains("var("),
            "{figure}"
        );
    }
    // Equal records make equal files.
    let again = folder.path().join("again");
    export(&record, "svg", &again);
    let read = |folder: &Path| fs::read(folder.join("figures/failed.svg")).unwrap();
    assert_eq!(read(&out), read(&again));
}

#[test]
fn scenarios_are_test_cases() {
    let folder = temp();
    let (record, out) = (driven(folder.path()), folder.path().join("out"));
    assert_eq!(export(&record, "junit", &out), ["junit.xml"]);
    let text = fs::read_to_string(out.join("junit.xml")).unwrap();
    let failed = json_lines(&record.join("scenarios.jsonl")).iter().filter(|o| o["success"] == false).count();
    assert!(
        failed > 0 && text.contains(&format!("tests=\"6\" failures=\"{failed}\" errors=\"0\"")),
        "{text}"
    );
    assert_eq!(text.matches("<testcase ").count(), 6);
    assert_eq!(text.matches("<failure type=\"lane departure\"").count(), failed);
    assert!(text.contains("pdk replay ") && text.contains("--scenario 2"), "{text}");
}

#[test]
fn the_page_of_a_domain_has_what_was_driven() {
    let folder = temp();
    let (record, out) = (driven(folder.path()), folder.path().join("out"));
    assert_eq!(export(&record, "odd", &out), ["odd.json", "odd.html"]);
    let odd = pdk_tests::process::json_file(&out.join("odd.json"));
    let row = |list: &str, id: &str| {
        let rows = odd[list].as_array().unwrap();
        rows.iter().find(|row| row["id"] == id).unwrap_or_else(|| panic!("{id}")).clone()
    };
    let misaligned = row("triggers", "misaligned");
    assert_eq!((&misaligned["state"], &misaligned["by"][0]), (&"failed".into(), &"translate_image".into()));
    let of = &misaligned["drivers"][0];
    assert_eq!(
        (&of["driver"], &of["scenarios"], &of["roads"]),
        (&"lane_keeper".into(), &4.into(), &2.into())
    );
    assert_eq!(of["driven_to"], 4.0);
    // What the simulator shows is judged by drives with a clear view alone.
    let bends = row("attributes", "bends");
    assert_eq!((&bends["state"], &bends["drivers"][0]["scenarios"]), (&"passed".into(), &2.into()));
    assert_eq!(row("attributes", "junctions")["state"], "open");
    let page = fs::read_to_string(out.join("odd.html")).unwrap();
    assert!(
        page.contains("It claims no conformity with either standard") && page.contains("translate_image"),
        "{page}"
    );
}

#[test]
fn the_layout_in_a_record_shows_the_topics_of_its_traces() {
    let folder = temp();
    let record = driven(folder.path());
    let layout = fs::read_to_string(record.join("foxglove.json")).unwrap();
    let trace = fs::read_dir(record.join("traces")).unwrap().next().unwrap().unwrap().path();
    let bytes = fs::read(trace).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let topics: Vec<&str> = summary.channels.values().map(|channel| channel.topic.as_str()).collect();
    for topic in ["/raw", "/perturbed", "/control", "/state", "/event"] {
        assert!(topics.contains(&topic) && layout.contains(&format!("\"{topic}")), "{topic}: {topics:?}");
    }
}

#[test]
fn an_offline_run_has_its_results() {
    let folder = temp();
    let dataset = folder.path().join("tub");
    datasets::tub(&dataset, 6, 40, 30);
    let source = r#"
        local settings = pdk.settings({ dataset = "" })
        pdk.evaluate({ dataset = settings.dataset, driver = "misbehave", perturbations = { "contrast" }, levels = { 0, 4 } })
    "#;
    let record = folder.path().join("record");
    let run = Pdk::new(["run", "--out"]).arg(&record).arg(pipeline(folder.path(), source)).misbehave();
    run.set("dataset", dataset.display()).succeed();
    let out = folder.path().join("out");
    let files = export(&record, "csv", &out);
    let expected =
        ["results.csv", "tables/steering-error.csv", "tables/steering-drift.csv", "tables/steering.csv"];
    assert_eq!(files, expected);
    let results = lines(&out.join("results.csv"));
    assert_eq!(results.len() - 1, json_lines(&record.join("results.jsonl")).len());
    assert!(results[0].contains(&"perturbed.steering".to_owned()), "{:?}", results[0]);
    let refused = Pdk::new(["export"]).arg(&record).args(["--to", "junit"]);
    refused.fail(1, &["holds no scenario that could be a test case", "export it to csv"]);
}
