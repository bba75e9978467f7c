//! Errors of the machine and of its set-up say nothing about a driver: they are not outcomes, another worker does the work, and a run
//! that is continued tries again.

use std::fs;
use std::path::Path;

use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::records::{assert_equal, files};
use pdk_tests::{Pdk, temp};

/// Twenty scenarios in a simulator that one slot, or every slot, does not have.
const TWENTY: &str = r#"
    local settings = pdk.settings({ how = "refuse_first_slot" })
    local scenarios = {}
    for seed = 1, 20 do
        table.insert(scenarios, { seed = seed })
    end
    pdk.drive({
        simulator = { name = "misbehave", how = settings.how }, driver = "misbehave", duration = 2, scenarios = scenarios,
    })
"#;

/// What is said of the first slot.
const TAKEN: &str = "simulator `misbehave`: the port of slot 0 is taken";

fn run(script: &Path, out: &Path) -> Pdk {
    Pdk::new(["run", "--out"]).arg(out).arg(script).misbehave()
}

/// The causes in the ledger of a record.
fn causes(out: &Path) -> Vec<String> {
    let lines = json_lines(&out.join("scenarios.jsonl"));
    lines.iter().map(|line| line["cause"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn what_a_worker_cannot_do_another_one_does() {
    let folder = temp();
    let script = pipeline(folder.path(), TWENTY);
    let pool = format!("'{}' 2", env!("CARGO_BIN_EXE_pool"));
    for (name, option, value) in [("here", "--workers", "2"), ("pool", "--pool", &pool)] {
        let out = folder.path().join(name);
        let driven = run(&script, &out).args([option, value]).succeed();
        let said = format!("pdk: warning: worker 0 gets nothing more to do, and others do its work: {TAKEN}");
        assert_eq!(driven.stderr.matches(&said).count(), 1, "{}", driven.stderr);
        assert_eq!(causes(&out), ["finished"; 20], "{name}");
    }
    assert_equal(&folder.path().join("pool"), &files(&folder.path().join("here")));
}

#[test]
fn where_no_worker_can_do_it_the_run_ends_and_goes_on_another_time() {
    let folder = temp();
    let script = pipeline(folder.path(), TWENTY);
    let (out, whole) = (folder.path().join("out"), folder.path().join("whole"));
    run(&script, &out).args(["--workers", "1"]).fail(1, &[TAKEN]);
    assert!(causes(&out).is_empty());
    run(&script, &out).args(["--workers", "2"]).succeed();
    run(&script, &whole).args(["--workers", "3"]).succeed();
    assert_equal(&out, &files(&whole));
    let every = || run(&script, &folder.path().join("every")).set("how", "refuse_every_slot");
    for workers in ["1", "2", "4"] {
        every()
            .args(["--workers", workers])
            .fail(1, &["simulator `misbehave`: the port of slot", "is taken"]);
    }
    assert!(causes(&folder.path().join("every")).is_empty());
    every().args(["--pool", &format!("'{}' 2", env!("CARGO_BIN_EXE_pool"))]).fail(1, &["is taken"]);
}

/// Six scenarios. Two of them need more memory than a limit allows that is too low.
const HUNGRY: &str = r#"
    local scenarios = {}
    for seed = 1, 6 do
        table.insert(scenarios, { seed = seed, perturbations = { if seed % 3 == 2 then "hungry@2" else "contrast@2" } })
    end
    pdk.drive({
        simulator = { name = "lane", width = 64, height = 48 }, driver = "lane_keeper", duration = 1, scenarios = scenarios,
    })
"#;

const PERTURBATION: &str = r#"
    return {
        doc = "needs memory",
        apply = function(image)
            local kept = table.create(2000000, 0)
            image:fill(#kept % 7, 0, 0)
        end,
    }
"#;

/// Continues with a limit that is too low, or with the usual one.
fn hungry(script: &Path, out: &Path, low: bool) -> Pdk {
    let command = Pdk::new(["run", "--workers", "2", "--out"]).arg(out).arg(script);
    if low { command.env("PDK_SCRIPT_MEGABYTES", "16") } else { command }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn what_failed_is_driven_again_unless_errors_are_kept() {
    let folder = temp();
    let script = pipeline(folder.path(), HUNGRY);
    fs::create_dir(folder.path().join("perturbations")).unwrap();
    fs::write(folder.path().join("perturbations/hungry.lua"), PERTURBATION).unwrap();
    let (out, whole) = (folder.path().join("out"), folder.path().join("whole"));
    hungry(&script, &whole, false).succeed();
    let expected = files(&whole);
    hungry(&script, &out, true).fail(1, &["2 of 6 scenarios could not be driven because a component failed"]);
    let failed = ["time_out", "error", "time_out", "time_out", "error", "time_out"];
    assert_eq!(causes(&out), failed);
    let before = files(&out);
    // Errors stay where the user says so, or come again.
    for keep in [["--keep-errors", ""], ["--set", "keep_errors=true"]] {
        let command = hungry(&script, &out, false).args(keep.iter().filter(|word| !word.is_empty()));
        let kept = command.run();
        assert_eq!(kept.code, Some(1), "{}", kept.stderr);
        assert!(kept.stdout.contains("6 of 6 scenarios were in the record already"), "{}", kept.stdout);
        assert_equal(&out, &before);
    }
    hungry(&script, &out, true).fail(1, &["2 of 6 scenarios could not be driven"]);
    assert_equal(&out, &before);
    let again = hungry(&script, &out, false).succeed();
    assert!(again.stdout.contains("4 of 6 scenarios were in the record already"), "{}", again.stdout);
    assert_equal(&out, &expected);

    // What failed in the parts of a run is driven again where the whole is completed.
    let parts = ["1/2", "2/2"].map(|part| {
        let out = folder.path().join(part.replace('/', "-"));
        assert_eq!(hungry(&script, &out, true).args(["--shard", part]).run().code, Some(1));
        out
    });
    let merged = folder.path().join("merged");
    Pdk::new(["merge"]).args(&parts).arg("--out").arg(&merged).succeed();
    assert_eq!(causes(&merged), failed);
    hungry(&script, &merged, false).succeed();
    assert_equal(&merged, &expected);
}
