//! Pages about runs: they say what the record says, need nothing besides themselves, and escape what users write.

use std::fs;
use std::path::{Path, PathBuf};

use image::RgbImage;
use pdk_tests::process::{LIMIT, json_file, json_lines, pipeline};
use pdk_tests::processes::{BusFolder, comes_true};
use pdk_tests::records::wait_for_lines;
use pdk_tests::{Pdk, datasets, onnx, temp};
use serde_json::Value;

/// Three scenarios on a straight road in small frames; the last one leaves the lane.
const DRIVE: &str = r#"
local settings = pdk.settings({ note = "" })
local scenarios = {
    { name = "<b>clear & \"bright\"</b>" },
    { perturbations = { "contrast@0" } },
    { perturbations = { "translate_image@4" } },
}
for _, scenario in scenarios do
    scenario.road = { angles = { 0, 10, 10, 10, 10, 10 }, segment = 15 }
end
pdk.drive({
    simulator = { name = "lane", width = 80, height = 60, rate = 20 },
    driver = "lane_keeper", duration = 20, scenarios = scenarios,
})
"#;

/// A run of it in a folder.
fn driven(folder: &Path) -> PathBuf {
    let out = folder.join("record");
    let script = pipeline(folder, DRIVE);
    let run = Pdk::new(["run", "--out"]).arg(&out).arg(script).set("note", "<i>it's</i>");
    run.arg("--plugins").arg(folder).succeed();
    out
}

fn report(record: &Path) -> Pdk {
    Pdk::new(["report"]).arg(record)
}

/// The page in the folder of the record.
fn page(record: &Path) -> String {
    read(&record.join("report.html"))
}

/// A page, with slashes and spaces as they are.
fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap().replace("&#x2f;", "/").replace('\u{a0}', " ")
}

/// The row of a heat map as texts: its heading and its cells.
fn row(page: &str, heading: &str) -> Vec<String> {
    let start = format!("<tr><th scope=\"row\">{heading}</th><td");
    let (_, rest) = page.split_once(&start).unwrap_or_else(|| panic!("no row {heading}"));
    let row = rest.split_once("</tr>").unwrap().0;
    row.split("</td>").filter_map(|cell| Some(cell.rsplit_once('>')?.1.to_owned())).collect()
}

/// Nothing in a page leads out of it.
fn check_self_contained(page: &str) {
    for outside in ["http:", "https:", "<link", "@import", "url(", "<iframe", "<object"] {
        assert!(!page.contains(outside), "{outside} in the page");
    }
    for source in page.split(" src=\"").skip(1) {
        assert!(source.starts_with("data:image/jpeg;base64,"), "{}", &source[..40]);
    }
}

#[test]
fn a_page_says_what_the_record_says() {
    let folder = temp();
    let record = driven(folder.path());
    let ran = report(&record).succeed();
    assert!(ran.stdout.contains("report.html"), "{}", ran.stdout);
    let page = page(&record);
    check_self_contained(&page);

    let outcomes = json_lines(&record.join("scenarios.jsonl"));
    let causes: Vec<&str> = outcomes.iter().map(|outcome| outcome["cause"].as_str().unwrap()).collect();
    assert_eq!(causes, ["finished", "finished", "lane_departure"], "the page needs a failure");
    assert!(page.contains("3 scenarios were driven, and 1 failed (33 %)"));
    assert!(
        page.contains("lane_keeper fails under 1 of 2 perturbations: translate_image (already at level 4).")
    );
    assert_eq!(row(&page, "translate_image"), ["·", "failed"]);
    assert_eq!(row(&page, "contrast"), ["ok", "·"]);
    assert!(page.contains("From one road nothing follows about others") && !page.contains("effect size"));
    let (results, provenance) = page.split_once("Where this comes from").unwrap();
    assert!(provenance.contains("This command repeats the run") && !results.contains("--set"));
    for outcome in &outcomes {
        let mean = format!("{:.3}", outcome["mean_cross_track_error"].as_f64().unwrap());
        // That of a drive that was cut short is not comparable.
        let cell = match outcome["success"] == true {
            true => format!("<td class=\"n\">{mean}</td>"),
            false => format!(">({mean})</span></td>"),
        };
        assert!(page.contains(&cell), "{cell}");
    }
    assert!(page.contains(&format!("pdk replay {} --scenario 2", record.display())));
    assert!(!page.contains("--scenario 0"), "nothing to look at again");
    assert!(page.contains("100 %") && page.contains("missed deadlines") && !page.contains("Unfinished"));

    assert!(page.contains("--plugins /"), "the command that repeats the run");
    // What the camera and the driver saw before the failure.
    let pictures = page.matches(" src=\"data:image/jpeg").count();
    assert!((2..=6).contains(&pictures) && pictures.is_multiple_of(2), "{pictures}");
    let times: Vec<f64> = page
        .split("<figcaption>")
        .filter_map(|caption| caption.split_once(" s</figcaption>")?.0.parse().ok())
        .collect();
    let end = outcomes[2]["time"].as_f64().unwrap();
    assert!(times.is_sorted() && end - times[times.len() - 1] < 0.31, "{times:?}, but it ended at {end}");
    assert_eq!(page.matches("class=\"mark\"").count(), 2, "one in the legend, one on the road");
}

/// It has one line in the ledger, and an outcome in the summary each time.
#[test]
fn a_scenario_that_was_asked_for_twice_is_shown_once() {
    let folder = temp();
    let source = r#"
        for round = 1, 2 do
            pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {}, {} } })
        end
    "#;
    let record = folder.path().join("record");
    let script = pipeline(folder.path(), source);
    Pdk::new(["run", "--out"]).arg(&record).arg(script).misbehave().succeed();
    let ran = report(&record).arg("--json").succeed();
    assert_eq!(ran.json()["unfinished"], false);
    assert!(page(&record).contains("1 scenario was driven"), "{}", page(&record));
}

#[test]
fn what_users_write_is_escaped() {
    let folder = temp();
    let record = driven(folder.path());
    report(&record).succeed();
    let page = page(&record);
    assert!(!page.contains("<b>clear") && !page.contains("<i>it"));
    assert!(page.contains("&lt;b&gt;clear &amp; &quot;bright&quot;&lt;"), "the scenario");
    assert!(page.contains("&lt;i&gt;it&#x27;s&lt;"), "the setting");
}

#[test]
fn equal_records_make_equal_pages() {
    let folder = temp();
    let record = driven(folder.path());
    let outs = ["a.html", "b.html"].map(|name| folder.path().join(name));
    for out in &outs {
        report(&record).arg("--out").arg(out).succeed();
    }
    assert_eq!(fs::read(&outs[0]).unwrap(), fs::read(&outs[1]).unwrap());
    assert!(!record.join("report.html").exists());
}

#[test]
fn clips_are_linked_from_wherever_the_page_is() {
    let folder = temp();
    let record = driven(folder.path());
    fs::create_dir(record.join("clips")).unwrap();
    fs::write(record.join("clips/scenario-2.mp4"), "").unwrap();
    report(&record).succeed();
    let page = page(&record);
    assert!(page.contains("href=\"clips/scenario-2.mp4\"") && !page.contains("scenario-1.mp4"));
    let elsewhere = folder.path().join("page.html");
    report(&record).arg("--out").arg(&elsewhere).succeed();
    let page = read(&elsewhere);
    assert!(page.contains("href=\"record/clips/scenario-2.mp4\""));
}

/// A run that was killed while it wrote a line; the page in its folder does not keep it from going on.
#[test]
fn a_run_that_has_not_ended_has_a_page() {
    let folder = temp();
    let record = driven(folder.path());
    let path = record.join("scenarios.jsonl");
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() - 100]).unwrap();
    for name in ["summary.json", "performance.json"] {
        fs::remove_file(record.join(name)).unwrap();
    }
    let ran = report(&record).arg("--json").succeed();
    assert_eq!(ran.json()["unfinished"], true);
    let page = page(&record);
    assert!(page.contains("Unfinished run.") && page.contains("2 scenarios were driven, and none failed."));
    assert!(!page.contains("translate_image at level"));

    // The same without a trace of the line.
    let complete = whole.iter().rposition(|byte| *byte == b'\n').unwrap();
    let complete = whole[..complete].iter().rposition(|byte| *byte == b'\n').unwrap() + 1;
    fs::write(&path, &whole[..complete]).unwrap();
    assert_eq!(report(&record).arg("--json").succeed().json()["unfinished"], true);

    let script = folder.path().join("pipeline.lua");
    Pdk::new(["run", "--out"]).arg(&record).arg(script).set("note", "<i>it's</i>").succeed();
    assert_eq!(fs::read(&path).unwrap(), whole);
    assert_eq!(report(&record).arg("--json").succeed().json()["unfinished"], false);
}

#[test]
fn a_folder_that_is_not_a_record_is_named() {
    let folder = temp();
    report(&folder.path().join("missing")).fail(1, &["holds no record", "manifest.json"]);
    let record = driven(folder.path());
    report(&record).arg("--out").arg(folder.path().join("no/page.html")).fail(1, &["no/page.html"]);

    let path = record.join("scenarios.jsonl");
    let whole = fs::read_to_string(&path).unwrap();
    let damaged: Vec<String> = whole
        .lines()
        .enumerate()
        .map(|(i, line)| if i == 1 { line[..90].to_owned() } else { line.to_owned() })
        .collect();
    fs::write(&path, damaged.join("\n") + "\n").unwrap();
    report(&record).fail(1, &["scenarios.jsonl:2"]);
    fs::remove_file(&path).unwrap();
    report(&record).fail(1, &["holds no scenario and no result yet"]);
    fs::write(record.join("manifest.json"), "{").unwrap();
    report(&record).fail(1, &["manifest.json"]);
}

/// Two drivers in one record, and the same driver in two.
#[test]
fn drivers_and_records_are_compared_on_one_page() {
    let folder = temp();
    let record = driven(folder.path());
    let other = folder.path().join("other");
    let script = folder.path().join("pipeline.lua");
    let text = fs::read_to_string(&script).unwrap();
    // The other one sees a shifted picture in place of a contrast, so it fails where the first does not.
    fs::write(&script, text.replace("translate_image@4", "contrast@1")).unwrap();
    Pdk::new(["run", "--out"]).arg(&other).arg(&script).set("note", "other").succeed();
    let ran = report(&record).arg(&other).arg("--json").succeed();
    assert_eq!(ran.json()["scenarios"], 6);
    let text = read(&record.join("comparison.html"));
    check_self_contained(&text);
    let (first, second) =
        (format!("lane_keeper of {}", record.display()), format!("lane_keeper of {}", other.display()));
    assert!(text.contains(&format!("{second} beside {first}")), "{first}");
    assert!(text.contains("cannot be told apart") && text.contains("Who fails where the other does not"));
    // Both drove the clear view and one level of one perturbation.
    assert!(text.contains("Of 2 scenarios that both drove, both fail 0"), "{text}");
    assert!(text.contains(&format!("The record {}", other.display())));
    assert!(!record.join("report.html").exists());
}

/// The page goes without frames and paths where traces are gone, and says so.
#[test]
fn a_missing_trace_costs_only_its_frames() {
    let folder = temp();
    let record = driven(folder.path());
    fs::remove_dir_all(record.join("traces")).unwrap();
    let ran = report(&record).succeed();
    assert!(ran.stderr.contains("scenario 2 is shown without its path"), "{}", ran.stderr);
    let page = page(&record);
    assert!(page.contains("There are no frames of the failures") && !page.contains("data:image"));
}

#[test]
fn an_offline_run_has_a_page_of_its_numbers() {
    let folder = temp();
    let dataset = folder.path().join("tub");
    datasets::tub(&dataset, 6, 40, 30);
    let source = r#"
        local settings = pdk.settings({ dataset = "" })
        pdk.evaluate({ dataset = settings.dataset, driver = "misbehave",
            perturbations = { "contrast", "gaussian_noise" }, levels = { 0, 2.5, 4 } })
    "#;
    let record = folder.path().join("record");
    let script = pipeline(folder.path(), source);
    let run = Pdk::new(["run", "--out"]).arg(&record).arg(script).misbehave();
    run.set("dataset", dataset.display()).succeed();
    report(&record).succeed();
    let page = page(&record);
    check_self_contained(&page);

    let summary = json_file(&record.join("summary.json"))["evaluations"][0].clone();
    let cells = |name: &str, field: &str| -> Vec<String> {
        let rows = summary["rows"].as_array().unwrap().iter().filter(|row| row["label"] == name);
        rows.map(|row| written(&row[field])).collect()
    };
    for name in ["contrast", "gaussian_noise"] {
        assert_eq!(row(&page, name), cells(name, "steering_error"));
        // The second table is that of the drift.
        let (_, drift) = page.split_once("Mean absolute drift").unwrap();
        assert_eq!(row(drift, name), cells(name, "steering_drift"));
    }
    let original = written(&summary["original_steering_error"]);
    assert_eq!(row(&page, "no perturbation"), [original.as_str()]);
    assert!(page.contains(&format!("6 frames were evaluated under 2 perturbations; without perturbation the steering is off by {original}")));
    assert!(page.contains("at level 2.5") && page.contains("Worst frames") && page.contains("error grew by"));

    // Without its last line and its summary it is the page of an unfinished run.
    let path = record.join("results.jsonl");
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() - 9]).unwrap();
    fs::remove_file(record.join("summary.json")).unwrap();
    assert_eq!(report(&record).arg("--json").succeed().json()["unfinished"], true);
    fs::write(&path, [b"{}\n", &whole[..]].concat()).unwrap();
    report(&record).fail(1, &["results.jsonl:1"]);
}

#[test]
fn a_task_that_was_killed_has_the_numbers_of_its_lines() {
    let folder = temp();
    // Pieces of 100 pictures are recorded one after the other, so most are not when the first one is.
    for (class, name) in ["red", "green", "blue"].into_iter().enumerate() {
        let own = folder.path().join("data").join(name);
        fs::create_dir_all(&own).unwrap();
        for number in 0..400_usize {
            let bright = if number.is_multiple_of(5) { (class + 1) % 3 } else { class };
            let colour = std::array::from_fn(|channel| if channel == bright { 130 } else { 100 });
            RgbImage::from_pixel(8, 8, image::Rgb(colour))
                .save(own.join(format!("{number:03}.png")))
                .unwrap();
        }
    }
    onnx::colours(&folder.path().join("colours.onnx"), 8, 8);
    let source = r#"
        pdk.evaluate({ dataset = pdk.path("data"),
            predictor = { name = "network", model = pdk.path("colours.onnx"), scale = "0..1", engine = "pdk" },
            task = { kind = "classification", classes = { "red", "green", "blue" } },
            perturbations = { "gaussian_noise", "contrast" }, levels = { 0, 1, 2, 3, 4 } })
    "#;
    let script = pipeline(folder.path(), source);
    let record = folder.path().join("record");
    let bus = BusFolder::new();
    let (variable, value) = bus.variable();
    let run = || Pdk::new(["run", "--workers", "1", "--out"]).arg(&record).arg(&script).env(variable, value);
    let mut child = run().spawn();
    let results = record.join("results.jsonl");
    wait_for_lines(&mut child, &results, 1_500);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{:?}", bus.processes());

    // The kill may have cut the last line off.
    let text = fs::read_to_string(&results).unwrap();
    let whole = text.rfind('\n').map_or(0, |end| end + 1);
    let lines: Vec<Value> = text[..whole].lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!((1..1200 * 11).contains(&lines.len()), "it was not killed on the way: {} lines", lines.len());
    let error = |label: Option<&str>, level: Option<f64>| {
        let own: Vec<_> = lines
            .iter()
            .filter(|line| line["label"].as_str() == label && line["level"].as_f64() == level)
            .collect();
        let wrong = own.iter().filter(|line| line["measured"]["top"][0] != line["measured"]["class"]).count();
        (own.len(), wrong as f64 / own.len() as f64)
    };
    let (pictures, original) = error(None, None);
    assert!(original > 0.1, "nothing to show: {original}");
    let said = report(&record).arg("--json").succeed().json();
    assert_eq!(said["unfinished"], true);
    let unfinished = page(&record);
    check_self_contained(&unfinished);
    assert!(unfinished.contains("Unfinished"), "the page does not say so");
    let sentence =
        format!("{pictures} pictures were evaluated for the task under way; top1_error is {original:.3}");
    assert!(unfinished.contains(&sentence), "{sentence}");
    for name in ["gaussian_noise", "contrast"] {
        let wanted: Vec<_> =
            (0..5).map(|level| format!("{:.3}", error(Some(name), Some(f64::from(level))).1)).collect();
        assert_eq!(row(&unfinished, name), wanted, "{name}");
    }

    run().succeed();
    let said = report(&record).arg("--json").succeed().json();
    assert_eq!(said["unfinished"], false);
    assert!(page(&record).contains("1200 pictures were evaluated for classification; top1_error is"));
}

#[test]
fn a_last_line_that_is_cut_off_is_warned_of_by_every_verb() {
    let folder = temp();
    let record = driven(folder.path());
    let lines = record.join("scenarios.jsonl");
    let text = fs::read(&lines).unwrap();
    fs::write(&lines, &text[..text.len() - 20]).unwrap();
    let warning = format!(
        "pdk: warning: the last line of {} is cut off, so its scenario is left out\n",
        lines.display()
    );
    for (verb, more) in [("report", &[][..]), ("replay", &[]), ("export", &[]), ("export", &["--to", "csv"])]
    {
        let ran = Pdk::new([verb]).arg(&record).args(more).args(["--plugins"]).arg(folder.path()).succeed();
        assert_eq!(ran.stderr.matches(&warning).count(), 1, "{verb}: {}", ran.stderr);
    }
}

/// A number of a summary as the page writes it.
fn written(value: &Value) -> String {
    let value = value.as_f64().unwrap();
    if value >= 1.0 { format!("{value:.2}") } else { format!("{value:.3}") }
}
