//! Gates: whether a new driver is worse than an old one, and whether a verdict holds.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_gate::verdict::Verdict;
use pdk_tests::process::{json_file, json_lines};
use pdk_tests::records::{assert_equal, files};
use pdk_tests::{Pdk, repository, temp};
use serde_json::Value;

/// A suite whose drives take milliseconds.
const SMALL: &str = r#"
name = "small"
version = 1
perturbations = ["contrast@0.5", "gaussian_noise"]
levels = [0]
nominal = 0.2

[[place]]
simulator = { name = "lane", width = 64, height = 48, rate = 10 }
road = { segments = 5, segment = 10, limit = 25 }
duration = 20

[test]
tolerated = 0.4
pairs = 30
ahead = 3
"#;

/// A driver that takes bends too fast.
const FAST: &str = "lane_keeper,target_speed=40,lateral_acceleration=20,gain=0.3";

fn suite(folder: &Path, text: &str) -> PathBuf {
    let file = folder.join("small.toml");
    fs::write(&file, text).unwrap();
    file
}

fn gate(old: &str, new: &str, suite: &Path, out: &Path) -> Pdk {
    Pdk::new(["gate", old, new, "--suite"]).arg(suite).arg("--out").arg(out)
}

/// Changes a verdict, and puts a root over it that fits.
fn forge(verdict: &Path, change: impl FnOnce(&mut Verdict)) {
    let mut forged = Verdict::read(verdict).unwrap();
    change(&mut forged);
    fs::write(verdict, serde_json::to_string(&forged.sealed()).unwrap()).unwrap();
}

#[test]
fn equal_drivers_pass_and_the_number_of_workers_changes_nothing() {
    let folder = temp();
    let suite = suite(folder.path(), SMALL);
    let one = folder.path().join("one");
    let ran = gate("lane_keeper", "lane_keeper,gain=1", &suite, &one).args(["--workers", "1"]).succeed();
    let last = ran.stdout.lines().last().unwrap();
    assert!(
        last.starts_with("passed: lane_keeper,gain=1 against lane_keeper in suite small version 1"),
        "{last}"
    );
    assert!(ran.stdout.contains("not worse by more than 0.4"), "{}", ran.stdout);
    let verdict = json_file(&one.join("verdict.json"));
    assert_eq!(verdict["decision"]["passed"], true);
    let entries = verdict["entries"].as_array().unwrap();
    // As many roads as it takes to be sure, and not all that there are; each of its own.
    assert!(entries.len() < 60 && entries.len() > 10, "{}", entries.len());
    let lines = json_lines(&one.join("scenarios.jsonl"));
    let of_old = |line: &&Value| line["scenario"]["driver"]["parameters"].is_null();
    let pairs: Vec<(&Value, &Value)> = lines
        .iter()
        .filter(of_old)
        .map(|line| (&line["scenario"]["road"], &line["scenario"]["seed"]))
        .collect();
    for (road, seed) in &pairs {
        assert_eq!(pairs.iter().filter(|(other, _)| other == road).count(), 1);
        // Both drivers have the luck of the road.
        let both = lines
            .iter()
            .filter(|line| line["scenario"]["seed"] == **seed && line["scenario"]["road"] == **road);
        assert_eq!(both.count(), 2);
    }
    let three = folder.path().join("three");
    gate("lane_keeper", "lane_keeper,gain=1", &suite, &three).args(["--workers", "3"]).succeed();
    assert_equal(&three, &files(&one));
    // The same command continues it, and drives nothing.
    let again = gate("lane_keeper", "lane_keeper,gain=1", &suite, &three).succeed();
    assert!(again.stdout.contains("scenarios were in the record already"), "{}", again.stdout);
    assert_equal(&three, &files(&one));
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_worse_driver_fails_with_a_code_of_its_own_and_its_failures_are_kept() {
    let folder = temp();
    let suite = suite(folder.path(), SMALL);
    let out = folder.path().join("out");
    let file = |name: &str| folder.path().join(name);
    let ran = gate("lane_keeper", FAST, &suite, &out)
        .arg("--markdown")
        .arg(file("a.md"))
        .arg("--junit")
        .arg(file("a.xml"))
        .arg("--verdict")
        .arg(file("a.json"))
        .arg("--save-suite")
        .arg(file("never_again.toml"))
        .arg("--clips")
        .arg(file("clips"))
        .arg("--json")
        .run();
    assert_eq!(ran.code, Some(3), "{}{}", ran.stdout, ran.stderr);
    let found = ran.json();
    assert_eq!(
        (&found["passed"], &found["verdict"]["decision"]["findings"][0]["state"]),
        (&false.into(), &"not_met".into())
    );
    let failures = found["new_failures"].as_array().unwrap();
    assert!(!failures.is_empty());
    assert!(
        failures.iter().all(|failure| fs::metadata(failure["clip"].as_str().unwrap()).unwrap().len() > 1000)
    );
    // The command of a failure repeats it.
    let command = failures[0]["replay"].as_str().unwrap();
    let words: Vec<&str> = command.split(' ').skip(1).collect();
    let replayed = Pdk::new(words).succeed();
    assert!(replayed.stdout.contains("1 of 1 equal"), "{}", replayed.stdout);
    let markdown = fs::read_to_string(file("a.md")).unwrap();
    assert!(markdown.contains("| not worse | not met |") && markdown.contains(command), "{markdown}");
    let junit = fs::read_to_string(file("a.xml")).unwrap();
    assert!(
        junit.contains("failures=\"1\"") && junit.contains("<failure type=\"not met\" message=\"worse\">"),
        "{junit}"
    );
    assert_eq!(json_file(&file("a.json")), json_file(&out.join("verdict.json")));
    // What failed has to pass from now on: the old driver does, the new one does not.
    let fixed = folder.path().join("fixed");
    let passed = gate(FAST, "lane_keeper", &file("never_again.toml"), &fixed).succeed();
    assert!(passed.stdout.contains("passes all fixed scenarios"), "{}", passed.stdout);
    let failed = gate("lane_keeper", FAST, &file("never_again.toml"), &folder.path().join("again")).run();
    assert_eq!(failed.code, Some(3), "{}", failed.stderr);
    // The same suite comes from the record.
    Pdk::new(["suite"]).arg(&out).arg("--out").arg(file("of_record.toml")).succeed();
    let shown = Pdk::new(["suite", "--json"]).arg(file("of_record.toml")).succeed().json();
    assert!(shown["scenarios"].as_array().unwrap().len() >= failures.len());
}

#[test]
fn a_record_stands_for_its_drives() {
    let folder = temp();
    let suite = suite(folder.path(), SMALL);
    let first = folder.path().join("first");
    gate("lane_keeper,gain=1", "lane_keeper", &suite, &first).succeed();
    let second = folder.path().join("second");
    let named = first.display().to_string();
    let ran = gate(&named, "lane_keeper,gain=1.1", &suite, &second).succeed();
    // Only the new driver was driven.
    let drivers: Vec<Value> = json_lines(&second.join("scenarios.jsonl"))
        .iter()
        .map(|line| line["scenario"]["driver"].clone())
        .collect();
    assert!(drivers.iter().all(|driver| driver["parameters"]["gain"] == 1.1), "{drivers:?}");
    assert!(ran.stdout.contains("drives were in a record already"), "{}", ran.stdout);
    Pdk::new(["verify"]).arg(&second).succeed();
    // Two records need no drive at all.
    let both = Pdk::new(["gate", &named, &named, "--suite"]).arg(&suite).folder(folder.path()).succeed();
    assert!(!both.stdout.contains("Record:"), "{}", both.stdout);
    assert!(!folder.path().join("runs").exists());
}

#[test]
fn a_verdict_holds_and_a_forged_one_does_not() {
    let folder = temp();
    let suite = suite(folder.path(), SMALL);
    let out = folder.path().join("out");
    gate("lane_keeper", FAST, &suite, &out).run();
    let verdict = out.join("verdict.json");
    let verify = || Pdk::new(["verify"]).arg(&out);
    let held = verify().args(["--probes", "9"]).succeed();
    assert!(
        held.stdout.contains("9 of ") && held.stdout.contains("came out the same, bit for bit"),
        "{}",
        held.stdout
    );
    assert!(held.stdout.ends_with("failed against lane_keeper\n"), "{}", held.stdout);
    let original = fs::read(&verdict).unwrap();

    // An edited decision does not fit the root.
    let text = String::from_utf8(original.clone()).unwrap();
    fs::write(&verdict, text.replace("\"passed\": false", "\"passed\": true")).unwrap();
    let refuted = verify().run();
    assert_eq!(refuted.code, Some(3), "{}", refuted.stderr);
    assert!(refuted.stdout.contains("its root is not that of its contents"), "{}", refuted.stdout);
    assert!(refuted.stdout.contains("its decision does not follow from its entries"), "{}", refuted.stdout);

    // With a root that fits, the decision still has to follow from the entries.
    fs::write(&verdict, &original).unwrap();
    forge(&verdict, |verdict| verdict.decision.passed = true);
    let refuted = verify().run();
    assert!(refuted.code == Some(3) && refuted.stdout.contains("does not follow"), "{}", refuted.stdout);

    // One false outcome among all, with everything else made to fit.
    fs::write(&verdict, &original).unwrap();
    forge(&verdict, |verdict| verdict.entries[3].checksum = "0".repeat(32));
    let refuted = verify().run();
    assert_eq!(refuted.code, Some(3), "{}", refuted.stderr);
    assert!(refuted.stdout.contains("entry 3, ") && refuted.stdout.contains("refuted"), "{}", refuted.stdout);

    // Scenarios that the suite does not have.
    fs::write(&verdict, &original).unwrap();
    forge(&verdict, |verdict| {
        let id = verdict.entries[0].id;
        verdict.entries[2].id = id;
    });
    let refuted = verify().run();
    assert!(refuted.code == Some(3) && refuted.stdout.contains("entry 2, "), "{}", refuted.stdout);
    fs::write(&verdict, &original).unwrap();
    forge(&verdict, |verdict| _ = verdict.entries.remove(0));
    let refuted = verify().run();
    assert!(refuted.code == Some(3) && refuted.stdout.contains("in their order"), "{}", refuted.stdout);
}

#[test]
fn what_a_verification_lacks_is_named() {
    let folder = temp();
    let text = SMALL.replace("pairs = 30", "pairs = 2").replace("duration = 20", "duration = 1");
    let suite = suite(folder.path(), &text);
    let out = folder.path().join("out");
    let network = folder.path().join("pilot.onnx");
    fs::copy(repository().join("scripts/models/dave2.onnx"), &network).unwrap();
    let named = network.display().to_string();
    let ran = gate("lane_keeper", &named, &suite, &out).run();
    assert_eq!(ran.code, Some(3), "{}{}", ran.stdout, ran.stderr);
    assert!(ran.stdout.contains("undecided"), "{}", ran.stdout);
    let verify = || Pdk::new(["verify"]).arg(&out);
    verify().succeed();
    // A network that has moved is named, and has to be the same.
    let moved = folder.path().join("moved.onnx");
    fs::rename(&network, &moved).unwrap();
    verify()
        .fail(1, &["the new driver needs the file", "pilot.onnx", "is not there; name the file with --file"]);
    verify().arg("--file").arg(&moved).succeed();
    let mut bytes = fs::read(&moved).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&network, &bytes).unwrap();
    verify().fail(1, &["pilot.onnx", "has another content; name the file with --file"]);
    fs::copy(&moved, &network).unwrap();
    // Another suite.
    fs::write(&suite, text.replace("version = 1", "version = 2")).unwrap();
    verify()
        .fail(1, &["is not that of the verdict, which is `small` version 1", "it has version 2 and not 1"]);
    fs::remove_file(&suite).unwrap();
    verify().fail(1, &["cannot read the suite", "the verdict is of the suite `small` version 1"]);
    fs::write(&suite, &text).unwrap();
    // Another machine.
    forge(&out.join("verdict.json"), |verdict| {
        verdict.new.component.parameters.insert("engine".to_owned(), "onnxruntime 0.0.0/abacus".into());
    });
    verify().fail(1, &["cannot be verified on this machine, because it computes networks differently"]);
}

#[test]
fn mistakes_are_named() {
    let folder = temp();
    let suite = suite(folder.path(), SMALL);
    let with = |old: &str, suite: &str| {
        Pdk::new(["gate", old, "lane_keeper", "--suite", suite]).folder(folder.path())
    };
    let file = suite.display().to_string();
    with("lane_keeper", "smok").fail(1, &["there is no built-in suite `smok`", "did you mean `smoke`?"]);
    with("lane_keper", &file).fail(1, &["there is no driver `lane_keper`; did you mean `lane_keeper`?"]);
    with("missing.onnx", &file).fail(1, &["missing.onnx", "a network is named by its file"]);
    with(".", &file).fail(1, &["is a folder without a record of a run"]);
    fs::write(folder.path().join("a.toml"), "name = \"a\"\nversion = 1\npairs = 3").unwrap();
    with("lane_keeper", "a.toml").fail(1, &["the suite a.toml is not right: line 3: unknown field `pairs`"]);
    Pdk::new(["verify"]).arg(&suite).fail(1, &["is not a verdict of `pdk gate`"]);
    Pdk::new(["gate", "lane_keeper"]).run().code.filter(|code| *code == 2).unwrap();
}

#[test]
fn every_requirement_counts() {
    let folder = temp();
    let requirements = r#"
[[require]]
kind = "measure"
name = "holds the middle"
measure = "max_cross_track_error"
at = "gaussian_noise@1"
below = 1.5
on = [3, 4]

[[require]]
kind = "no_new_failure"
pairs = 4

[[require]]
kind = "not_worse"
by = "perturbation"
tolerated = 0.6
"#;
    let suite = suite(folder.path(), &format!("{SMALL}{requirements}"));
    let ran =
        gate("lane_keeper", "lane_keeper", &suite, &folder.path().join("out")).arg("--json").succeed().json();
    let findings = ran["verdict"]["decision"]["findings"].as_array().unwrap();
    let titles: Vec<&str> = findings.iter().map(|finding| finding["requirement"].as_str().unwrap()).collect();
    let expected = [
        "holds the middle",
        "no failure that the old one does not have",
        "not worse: contrast@0.5",
        "not worse: gaussian_noise",
    ];
    assert_eq!(titles, expected);
    assert!(findings.iter().all(|finding| finding["state"] == "met"), "{findings:#?}");
    assert_eq!(findings[2]["test"]["alpha"], 0.025);
    // Those of the measure are the new driver's alone.
    let entries = ran["verdict"]["entries"].as_array().unwrap();
    assert_eq!(entries[..3].iter().filter(|entry| entry["series"] == "requirement 1").count(), 3);
    assert!(
        entries
            .iter()
            .filter(|entry| entry["series"] == "requirement 1")
            .all(|entry| entry["driver"] == "new")
    );
    let verify = || Pdk::new(["verify", "--probes", "1000"]).arg(folder.path().join("out"));
    verify().succeed();
    // A measure that decides is repeated like the rest of what came of a drive.
    forge(&folder.path().join("out/verdict.json"), |verdict| {
        let measured = verdict.entries[1].measured.as_mut().unwrap();
        *measured /= 2.0;
    });
    let refuted = verify().run();
    assert!(
        refuted.code == Some(3)
            && refuted.stdout.contains("entry 1, requirement 1 2")
            && refuted.stdout.contains("the measure 0."),
        "{}",
        refuted.stdout
    );
}

/// A suite for a simulator that draws in one scenario of four whether the driver fails, and where a perturbation makes it fail.
const DRAWN: &str = r#"
name = "drawn"
version = 1
perturbations = ["increase_brightness@4"]
nominal = 0.6

[[place]]
simulator = { name = "misbehave", how = "draw" }
road = { segments = 4, segment = 25 }

[test]
tolerated = 0.45
pairs = 60
repeats = 5
ahead = 4
"#;

#[test]
fn drives_that_do_not_repeat_are_repeated_and_told_apart_from_what_differs() {
    let folder = temp();
    let suite = suite(folder.path(), DRAWN);
    let out = folder.path().join("out");
    let ran = gate("misbehave", "misbehave,at=-1", &suite, &out)
        .folder(folder.path())
        .misbehave()
        .arg("--json")
        .run();
    // Whether it passes is drawn, too.
    assert!(matches!(ran.code, Some(0 | 3)), "{}", ran.stderr);
    let found = ran.json();
    let decision = &found["verdict"]["decision"];
    let luck = &decision["luck"];
    let value = |name: &str| luck[name]["value"].as_f64().unwrap();
    // The probability that two drives differ is an eighth with a clear view, and none under the perturbation.
    assert!(value("clear") < 0.5 && luck["clear"]["high"].as_f64().unwrap() > 0.1, "{luck}");
    assert_eq!((value("perturbed"), value("fails_perturbed")), (0.0, 1.0), "{luck}");
    assert!(value("fails_clear") < 0.5 && value("beyond").abs() < 0.4, "{luck}");
    assert_eq!(luck["scenarios"], decision["findings"][0]["scenarios"]);
    // Each scenario was driven twice or more often by both, up to five times, with the same luck.
    let entries = found["verdict"]["entries"].as_array().unwrap();
    let repeats: Vec<u64> =
        entries.iter().map(|entry| entry["repeat"].as_u64().unwrap_or_default()).collect();
    assert!(repeats.contains(&1) && repeats.iter().all(|repeat| *repeat < 5), "{repeats:?}");
    let lines = json_lines(&out.join("scenarios.jsonl"));
    let seeds: Vec<&Value> = lines.iter().map(|line| &line["scenario"]["seed"]).collect();
    assert!(seeds.iter().all(|seed| seeds.iter().filter(|other| other == &seed).count() >= 4));
    // The verdict agrees with itself, though no drive comes out as another.
    Pdk::new(["verify", "--probes", "0"]).arg(&out).folder(folder.path()).misbehave().succeed();
    // A driver that fails always is found, and its failures are more than luck.
    let worse = gate("misbehave", "misbehave,how=idle", &suite, &folder.path().join("worse"));
    let ran =
        worse.folder(folder.path()).misbehave().args(["--markdown"]).arg(folder.path().join("a.md")).run();
    assert_eq!(ran.code, Some(3), "{}{}", ran.stdout, ran.stderr);
    assert!(ran.stdout.contains("the simulator does not repeat itself: a second drive"), "{}", ran.stdout);
    let markdown = fs::read_to_string(folder.path().join("a.md")).unwrap();
    assert!(markdown.contains("of these points are more than luck"), "{markdown}");
    let verdict = json_file(&folder.path().join("worse/verdict.json"));
    assert!(verdict["decision"]["luck"]["beyond"]["value"].as_f64().unwrap() > 0.2, "{verdict}");
}

/// Where a weight of a network lies: a place around which the bytes are numbers as weights are.
fn weight(bytes: &[u8]) -> usize {
    let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()).abs();
    let is_weight = |at: usize| (0..8).all(|next| (1e-3..1.0).contains(&number(at + 4 * next)));
    (bytes.len() / 2..bytes.len() - 64).find(|at| is_weight(*at)).unwrap()
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_network_with_one_weight_changed_by_a_hundredth_is_not_worse() {
    let folder = temp();
    let old = repository().join("scripts/models/dave2.onnx");
    let mut bytes = fs::read(&old).unwrap();
    let at = weight(&bytes);
    let changed = f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) * 1.01;
    bytes[at..at + 4].copy_from_slice(&changed.to_le_bytes());
    let new = folder.path().join("changed.onnx");
    fs::write(&new, bytes).unwrap();
    let out = folder.path().join("out");
    let ran = Pdk::new(["gate"])
        .arg(&old)
        .arg(&new)
        .args(["--suite", "smoke", "--json", "--out"])
        .arg(&out)
        .succeed()
        .json();
    assert_eq!(ran["passed"], true);
    assert_ne!(ran["verdict"]["old"]["files"], ran["verdict"]["new"]["files"]);
}
