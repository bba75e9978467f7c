//! The examples in `scripts/examples` run as they are, and its README lists them.

use std::collections::BTreeSet;
use std::fs;

use pdk_tests::process::json_lines;
use pdk_tests::{Pdk, repository, temp};

/// The pipelines among the files: their names begin with a number.
fn examples() -> BTreeSet<String> {
    let names = fs::read_dir(repository().join("scripts/examples")).unwrap();
    let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.starts_with(|first: char| first.is_ascii_digit())).collect()
}

#[test]
fn the_readme_lists_each_example_once() {
    let readme = fs::read_to_string(repository().join("scripts/examples/README.md")).unwrap();
    let rows = readme.lines().filter_map(|line| line.strip_prefix("| [")?.split_once(']'));
    let listed: Vec<String> = rows.map(|(name, _)| name.to_owned()).collect();
    assert_eq!(listed, examples().into_iter().collect::<Vec<_>>(), "in this order");
    assert!(listed.len() >= 20);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn each_example_runs_and_leaves_what_it_promises() {
    let folder = temp();
    for example in examples() {
        let script = repository().join("scripts/examples").join(&example);
        let source = fs::read_to_string(&script).unwrap();
        assert!(
            source.starts_with("-- ") && source.lines().count() <= 60,
            "{example} is not a short script with a topic"
        );
        let record = folder.path().join(example.trim_end_matches(".lua"));
        let ran = Pdk::new(["run"]).arg(&script).arg("--out").arg(&record).folder(folder.path()).succeed();
        assert!(!ran.stderr.contains("warning"), "{example}: {}", ran.stderr);
        if source.contains("evaluate = function(values)\n\t\treturn { objectives") {
            assert!(record.join("search.json").is_file(), "{example}");
            continue;
        }
        let outcomes = json_lines(&record.join("scenarios.jsonl"));
        assert!(!outcomes.is_empty(), "{example} drives nothing");
        assert!(outcomes.iter().all(|outcome| outcome["cause"] != "error"), "{example}: {outcomes:?}");
    }
    assert!(folder.path().join("22_save/weather.json").is_file());
}
