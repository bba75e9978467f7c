//! The guide shows what pdk prints: every code block that begins with `$ pdk` is run, and its output compared.
//!
//! In a block, a line `...` stands for lines that were left out, and `frames in ...` for a speed. `PDK_BLESS=1` writes the output of
//! the commands anew, except of those with a line `...`.

use std::fs;
use std::path::Path;

use pdk_tests::{Pdk, repository, target_folder, temp};

/// The line that stands for lines that were left out.
const LEFT_OUT: &str = "...";

/// A command in a block, and the lines that it shows.
struct Step<'a> {
    command: &'a str,
    shown: Vec<&'a str>,
}

#[test]
fn the_guide_shows_what_short_commands_print() {
    for page in ["install", "perturb", "your-network", "datasets", "attention", "plugins", "simulators"] {
        check(page);
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_guide_shows_what_runs_print() {
    for page in ["tour", "pipelines", "search", "records", "cluster", "verdicts"] {
        check(page);
    }
}

/// Runs the commands of a page in order, in a folder that holds an image and a network.
fn check(page: &str) {
    let file = repository().join(format!("docs/guide/{page}.md"));
    let text = fs::read_to_string(&file).unwrap();
    let folder = temp();
    fs::copy(repository().join("docs/road.png"), folder.path().join("road.png")).unwrap();
    fs::copy(repository().join("scripts/models/dave2.onnx"), folder.path().join("pilot.onnx")).unwrap();
    let mut written = text.clone();
    let blocks = blocks(&text);
    assert!(!blocks.is_empty(), "{page}.md has no block that begins with `$ pdk`");
    for block in blocks {
        let mut anew = String::new();
        for step in steps(block) {
            let printed = run(step.command, folder.path());
            let printed: Vec<String> = printed.trim_end().lines().map(without_speed).collect();
            let equal = matches(&step.shown, &printed);
            let bless = std::env::var_os("PDK_BLESS").is_some() && !step.shown.contains(&LEFT_OUT);
            assert!(
                equal || bless,
                "{page}.md shows another output of `{}`:\n{}\nIt prints:\n{}",
                step.command,
                step.shown.join("\n"),
                printed.join("\n")
            );
            anew += &format!("$ {}\n", step.command);
            let lines = if equal { step.shown.join("\n") } else { printed.join("\n") };
            anew += &if lines.is_empty() { lines } else { lines + "\n" };
        }
        written = written.replace(block, &anew);
    }
    if written != text {
        fs::write(&file, written).unwrap();
    }
}

/// The code blocks of a page that begin with a command of pdk, without their fences.
fn blocks(text: &str) -> Vec<&str> {
    text.split("```\n$ pdk ")
        .skip(1)
        .map(|rest| {
            let start = rest.as_ptr().addr() - text.as_ptr().addr() - "$ pdk ".len();
            let length = text[start..].find("```\n").expect("a block that nothing ends");
            &text[start..start + length]
        })
        .collect()
}

fn steps(block: &str) -> Vec<Step<'_>> {
    let mut steps: Vec<Step<'_>> = Vec::new();
    for line in block.lines() {
        match (line.strip_prefix("$ "), steps.last_mut()) {
            (Some(command), _) => steps.push(Step { command, shown: Vec::new() }),
            (None, Some(step)) => step.shown.push(line),
            (None, None) => unreachable!("a block begins with a command"),
        }
    }
    steps
}

/// What a command prints, standard error included, in the order in which a terminal shows it.
fn run(command: &str, folder: &Path) -> String {
    let path = format!("{}:{}", target_folder().display(), std::env::var("PATH").unwrap_or_default());
    let shell = Pdk::program("sh").arg("-c").arg(format!("{command} 2>&1")).env("PATH", path);
    shell.env("PDK_CACHE", folder.join("cache")).folder(folder).succeed().stdout
}

/// A line without its speed, which is another one at each run.
fn without_speed(line: &str) -> String {
    line.split_once(" frames in ")
        .map_or_else(|| line.to_owned(), |(before, _)| format!("{before} frames in ..."))
}

/// Whether the printed lines are those shown. The engine's class is that of the processor, so only its place counts.
fn matches(shown: &[&str], printed: &[String]) -> bool {
    let same = |shown: &str, printed: &str| {
        shown == printed || (shown.starts_with("engine: ") && printed.starts_with("engine: "))
    };
    match shown.split_first() {
        None => printed.is_empty(),
        Some((&LEFT_OUT, rest)) => (0..=printed.len()).any(|skipped| matches(rest, &printed[skipped..])),
        Some((first, rest)) => {
            printed.first().is_some_and(|line| same(first, line)) && matches(rest, &printed[1..])
        }
    }
}
