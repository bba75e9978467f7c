//! What the system does not give: files and memory. The sentence names the limit that was reached.

use std::path::Path;

use pdk_tests::process::pipeline;
use pdk_tests::{Finished, Pdk, built, pictures, temp};

const DRIVE: &str =
    "pdk.drive({ simulator = 'lane', driver = 'lane_keeper', duration = 0.5, scenarios = { {} } })";

fn program_limited(limit: &str) -> Pdk {
    Pdk::program("sh").arg("-c").arg(format!("ulimit {limit}; exec \"$0\" \"$@\"")).arg(built("pdk"))
}

fn limited(limit: &str, folder: &Path) -> Finished {
    let script = pipeline(folder, DRIVE);
    program_limited(limit).args(["run", "--workers", "1"]).arg(script).folder(folder).run()
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn too_few_open_files_are_reported_as_such() {
    let folder = temp();
    let mut said = 0;
    for files in (16..=40).step_by(4) {
        let finished = limited(&format!("-n {files}"), folder.path());
        if finished.code == Some(0) {
            continue;
        }
        assert_eq!(finished.code, Some(1), "{files}: {}", finished.stderr);
        // Before topics are made, the system itself says it: too many open files.
        if finished.stderr.contains("topic `") {
            said += 1;
            let names_it = finished.stderr.contains(&format!("may have {files} files open"));
            assert!(names_it && finished.stderr.contains("ulimit -n"), "{files}: {}", finished.stderr);
            assert!(!finished.stderr.contains("is writable"), "{files}: {}", finished.stderr);
        }
    }
    assert!(said >= 3, "{said}");
}

#[test]
fn a_verb_whose_component_takes_too_much_memory_names_the_option() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 16, 12);
    let perturb = ["perturb", "in.png", "--with", "misbehave@0,how=eat_memory", "-o", "out.png"];
    let perturb = Pdk::new(perturb).args(["--memory", "300"]).misbehave().folder(folder.path());
    perturb.fail(
        70,
        &["`misbehave", "took more than 300 MiB of memory (the limit is raised with --memory MIB)"],
    );
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn too_little_memory_is_an_error_and_no_abort() {
    let folder = temp();
    // How much is too little depends on the machine, so this goes through all that there is between too little and enough. A process that
    // cannot even be loaded is killed by the system before its first statement, so this begins at what `--version` needs.
    let loads = |megabytes: &u64| {
        program_limited(&format!("-v {}", megabytes << 10)).args(["--version"]).run().code == Some(0)
    };
    let least = (16..200).step_by(4).find(loads).expect("pdk needs less than 200 MiB to say its version");
    for megabytes in (least..=least + 360).step_by(12) {
        let finished = limited(&format!("-v {}", megabytes << 10), folder.path());
        let code = finished.code;
        assert!(matches!(code, Some(0 | 1)), "{megabytes} MiB: {code:?} {}", finished.stderr);
        let sentences = finished.stderr.lines().filter(|line| line.starts_with("pdk: error: ")).count();
        assert!(code == Some(0) || sentences > 0, "{megabytes} MiB: {}", finished.stderr);
    }
}
