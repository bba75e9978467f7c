//! What the README and the guide tell a newcomer to type works as it stands there: each `pdk` in a block of commands is run beside
//! `docs/examples`, or stands in a list here with the reason why it is not.

use std::collections::HashSet;
use std::fs;
use std::path::Path;

use pdk_product::PRODUCT;
use pdk_tests::{Pdk, repository, target_folder, temp};

/// Commands that are not run, by their beginnings, and why.
const NOT_RUN: [(&str, &str); 14] = [
    ("pdk run study", "it drives for hours"),
    ("pdk run greedy --set perturbations=motion_blur", "the guide has a transcript of a smaller one"),
    ("pdk run greedy --set perturbations=gaussian_noise", "the guide has a transcript of a smaller one"),
    ("pdk run greedy --workers 2 --set 'simulator=", "it needs a simulator that is not here"),
    ("pdk gate dave2 pilot.onnx", "the network is the reader's"),
    ("pdk run attention", "it drives for many minutes"),
    (
        "pdk run search",
        "it drives for minutes on a busy machine; tests of searches drive less with the same pipeline",
    ),
    ("pdk doctor --simulator", "it needs a simulator that is not here"),
    ("pdk tap", "it needs a run under way; tests of watching start one"),
    ("pdk watch", "it serves until Ctrl-C; tests of watching start it"),
    ("pdk report runs/quickstart-1 --open", "it opens a browser"),
    ("pdk report runs/quickstart-1 runs/", "it needs a second run; tests of reports compare two"),
    (
        "pdk shrink runs/search-1",
        "the record is that of a long search; the guide has a transcript of another",
    ),
    ("pdk new driver my_pilot && cd", "tests of plugins build what `pdk new` writes"),
];

/// Commands after those before them, which `pdk new driver` begins.
const OF_A_PLUGIN: [&str; 4] = ["pdk check target", "pdk plugin add", "pdk plugin list", "pdk plugin remove"];

/// Beginnings of commands that drive, or work on the record of the quickstart. They are run in this order, in one folder.
const LONG: [&str; 14] = [
    "pdk run scripts/",
    "pdk attack drives",
    "pdk run manual",
    "pdk run greedy --set perturbations=fog_filter --set roads=4 --set driver=onnx",
    "pdk gate dave2 dave2_augmented",
    "pdk replay",
    "pdk report",
    "pdk export",
    "pdk shrink",
    "pdk why",
    "pdk sensitivity",
    "pdk saliency docs/examples/tub",
    "pdk suite runs/smoke-1",
    "pdk verify",
];

/// The pages, the README first.
fn pages() -> Vec<(String, String)> {
    let mut files = vec![repository().join("README.md")];
    let guide = fs::read_dir(repository().join("docs/guide")).unwrap();
    files.extend(
        guide.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "md")),
    );
    files.sort();
    files.iter().map(|file| (file.display().to_string(), fs::read_to_string(file).unwrap())).collect()
}

/// All commands with their pages, each once and in the order in which a reader meets them, since one may read what an earlier one
/// wrote: lines in blocks of `sh`, and the second column of a table of commands.
fn commands() -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    for (page, text) in pages() {
        let mut block = "";
        for line in text.lines() {
            match line.strip_prefix("```") {
                Some(language) => block = if block.is_empty() { language } else { "" },
                None if block == "sh" && line.starts_with("pdk ") => {
                    found.push((page.clone(), line.to_owned()))
                }
                None if line.starts_with('|') => {
                    let command = line.split('|').nth(2).unwrap_or_default().trim();
                    let command = command.strip_prefix('`').and_then(|rest| rest.strip_suffix('`'));
                    let command = command.filter(|command| command.starts_with("pdk "));
                    found.extend(command.map(|command| (page.clone(), command.to_owned())));
                }
                None => {}
            }
        }
    }
    // A verb alone is a name and not a command.
    found.retain(|(_, command)| command.split_whitespace().count() > 2);
    let mut seen = HashSet::new();
    found.retain(|(_, command)| seen.insert(command.clone()));
    found
}

fn is_one_of(command: &str, beginnings: &[&str]) -> bool {
    beginnings.iter().any(|beginning| command.starts_with(beginning))
}

fn is_run(command: &str) -> bool {
    let not_run: Vec<&str> = NOT_RUN.iter().map(|(beginning, _)| *beginning).collect();
    // `pdk new` has transcripts, and asks before it writes over a file.
    !is_one_of(command, &not_run) && !is_one_of(command, &OF_A_PLUGIN) && !command.starts_with("pdk new ")
}

/// A folder with what a checkout has that the commands name.
fn checkout() -> tempfile::TempDir {
    let folder = temp();
    for part in ["docs/examples", "scripts"] {
        copy(&repository().join(part), &folder.path().join(part));
    }
    folder
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let to = to.join(entry.file_name());
        match entry.path().is_dir() {
            true => copy(&entry.path(), &to),
            false => drop(fs::copy(entry.path(), to).unwrap()),
        }
    }
}

fn run(page: &str, command: &str, folder: &Path) {
    println!("{page}: {command}");
    let path = format!("{}:{}", target_folder().display(), std::env::var("PATH").unwrap_or_default());
    Pdk::program("sh")
        .args(["-c", command])
        .env("PATH", path)
        .env("PDK_CACHE", folder.join("cache"))
        .folder(folder)
        .succeed();
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn commands_in_the_documents_work_as_they_stand() {
    let folder = checkout();
    let commands = commands();
    assert!(commands.len() > 30, "{commands:?}");
    let short = commands.iter().filter(|(_, command)| is_run(command) && !is_one_of(command, &LONG));
    let mut count = 0;
    for (page, command) in short {
        run(page, command, folder.path());
        count += 1;
    }
    assert!(count > 12, "{count} commands were run");
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn commands_that_drive_work_as_they_stand() {
    let folder = checkout();
    let commands = commands();
    run("the tour", "pdk run quickstart", folder.path());
    for beginning in LONG {
        let these = commands.iter().filter(|(_, command)| is_run(command) && command.starts_with(beginning));
        for (page, command) in these {
            run(page, command, folder.path());
        }
    }
}

/// Beginnings of the examples in help that need no files.
const OF_THEIR_OWN: [&str; 7] = [
    "pdk list",
    "pdk show fog_filter",
    "pdk new perturbation",
    "pdk new driver",
    "pdk doctor",
    "pdk road",
    "pdk cache",
];

#[test]
fn examples_in_help_that_need_no_files_work() {
    let examples =
        || PRODUCT.examples.iter().flat_map(|(_, examples)| *examples).map(|(example, _)| *example);
    // A program of someone else would have to be there.
    let is_run = |example: &&str| !example.contains("--simulator");
    for beginning in OF_THEIR_OWN {
        let these: Vec<_> =
            examples().filter(|example| example.starts_with(beginning)).filter(is_run).collect();
        assert!(!these.is_empty(), "no example in help begins with `{beginning}`");
        for example in these {
            run("help", example, temp().path());
        }
    }
}

#[test]
fn every_reason_for_not_running_a_command_is_of_one() {
    let commands = commands();
    for (beginning, reason) in NOT_RUN {
        let is_there = commands.iter().any(|(_, command)| command.starts_with(beginning));
        assert!(
            is_there,
            "no page has a command that begins with `{beginning}` ({reason}); remove it from the list"
        );
    }
    for beginning in OF_A_PLUGIN.iter().chain(&LONG) {
        assert!(commands.iter().any(|(_, command)| command.starts_with(beginning)), "{beginning}");
    }
}

#[test]
fn the_examples_are_small() {
    fn size(path: &Path) -> u64 {
        match path.is_dir() {
            true => fs::read_dir(path).unwrap().map(|entry| size(&entry.unwrap().path())).sum(),
            false => path.metadata().unwrap().len(),
        }
    }
    let examples = size(&repository().join("docs/examples"));
    assert!(examples < 700_000, "docs/examples has {examples} bytes");
}
