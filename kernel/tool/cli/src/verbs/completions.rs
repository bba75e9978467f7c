//! `pdk completions`, and what a shell offers for an argument: components with their levels, pipelines and records.
//!
//! The shell's part is small. For each completion it calls pdk with the variable [`VARIABLE`], and pdk looks at what is there: so
//! completions know the user's own components too.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::Command;
use clap_complete::engine::{ArgValueCompleter, CompletionCandidate, PathCompleter, ValueCompleter};
use clap_complete::env::Shells;
use pdk_components::product;
use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_lua::LuaScripts;
use pdk_record::directory::MANIFEST;
use pdk_sdk::describe::{Description, Kind};
use pdk_sdk::error::{Error, Place, Result};

/// Set by the shell if pdk has to complete a command line.
pub const VARIABLE: &str = "PDK_COMPLETE";
/// Where runs have their records if no other folder is named.
const RUNS: &str = "runs";
/// The intensities that a shell offers.
const LEVELS: [&str; 5] = ["0", "1", "2", "3", "4"];

/// Arguments of `pdk completions`
#[derive(clap::Args)]
pub struct Arguments {
    /// The shell
    shell: clap_complete::Shell,
}

/// Writes what a shell has to read so that it asks pdk for completions.
pub fn run(arguments: &Arguments) -> Result<()> {
    let name = arguments.shell.to_string();
    let unknown = || Error::new(format!("there are no completions for {name}"));
    let shells = Shells::builtins();
    let shell = shells.completer(&name).ok_or_else(unknown)?;
    let mut script = Vec::new();
    shell
        .write_registration(VARIABLE, "pdk", "pdk", "pdk", &mut script)
        .place("cannot write the completions")?;
    pdk_notice::bytes(&script);
    Ok(())
}

/// The command line with what a shell offers for the arguments of its verbs.
pub fn offered(command: Command) -> Command {
    let offers: [(&str, &str, ArgValueCompleter); 20] = [
        ("run", "pipeline", ArgValueCompleter::new(pipelines)),
        ("session", "pipeline", ArgValueCompleter::new(pipelines)),
        ("perturb", "perturbations", ArgValueCompleter::new(perturbations)),
        ("corrupt", "perturbations", ArgValueCompleter::new(perturbations)),
        ("preview", "perturbations", ArgValueCompleter::new(perturbations)),
        ("preview", "method", ArgValueCompleter::new(methods)),
        ("saliency", "methods", ArgValueCompleter::new(methods)),
        ("saliency", "driver", ArgValueCompleter::new(|typed: &OsStr| named(typed, Some(Kind::Driver)))),
        ("show", "name", ArgValueCompleter::new(|typed: &OsStr| named(typed, None))),
        ("report", "record", ArgValueCompleter::new(records)),
        ("replay", "record", ArgValueCompleter::new(records)),
        ("shrink", "record", ArgValueCompleter::new(records)),
        ("export", "record", ArgValueCompleter::new(records)),
        ("merge", "parts", ArgValueCompleter::new(records)),
        ("saliency", "frames", ArgValueCompleter::new(records)),
        ("gate", "old", ArgValueCompleter::new(drivers)),
        ("gate", "new", ArgValueCompleter::new(drivers)),
        ("gate", "suite", ArgValueCompleter::new(suites)),
        ("verify", "suite", ArgValueCompleter::new(suites)),
        ("suite", "from", ArgValueCompleter::new(suites)),
    ];
    offers.into_iter().fold(command, |command, (verb, argument, offer)| {
        command.mut_subcommand(verb, |verb| verb.mut_arg(argument, |argument| argument.add(offer)))
    })
}

/// All components that can be found without options; none if that fails, since a completion cannot report an error.
fn descriptions() -> Vec<Description> {
    let search = SearchPath::default();
    let registry = Registry::discover(&search, Box::new(LuaScripts::new(&search)));
    let entries = registry.iter().flat_map(|registry| registry.catalog().entries());
    entries.map(|entry| entry.description.clone()).collect()
}

fn candidate(value: impl AsRef<OsStr>, help: &str) -> CompletionCandidate {
    let help = (!help.is_empty()).then(|| help.to_owned().into());
    CompletionCandidate::new(value.as_ref()).help(help)
}

/// Components of a kind, or of all kinds, whose names begin with what was typed.
fn named(typed: &OsStr, kind: Option<Kind>) -> Vec<CompletionCandidate> {
    let Some(typed) = typed.to_str() else { return Vec::new() };
    let descriptions = descriptions().into_iter();
    let fitting = descriptions.filter(|component| kind.is_none_or(|kind| component.kind == kind));
    let fitting = fitting.filter(|component| component.name.starts_with(typed));
    fitting.map(|component| candidate(&component.name, &component.doc)).collect()
}

fn methods(typed: &OsStr) -> Vec<CompletionCandidate> {
    named(typed, Some(Kind::Saliency))
}

/// A perturbation by its name, and after the `@` its levels.
fn perturbations(typed: &OsStr) -> Vec<CompletionCandidate> {
    let Some(typed) = typed.to_str() else { return Vec::new() };
    match typed.split_once('@') {
        None => named(OsStr::new(typed), Some(Kind::Perturbation)),
        Some((name, level)) => {
            let levels = LEVELS.into_iter().filter(|offered| offered.starts_with(level));
            levels.map(|level| candidate(format!("{name}@{level}"), "")).collect()
        }
    }
}

/// The pipelines that come with pdk, and files in Lua.
fn pipelines(typed: &OsStr) -> Vec<CompletionCandidate> {
    let own = product::get().pipelines.iter().map(|script| script.name);
    let own = own.filter(|name| typed.to_str().is_some_and(|typed| name.starts_with(typed)));
    let mut offered: Vec<_> = own.map(|name| candidate(name, "comes with pdk")).collect();
    let is_script = |path: &Path| path.extension().is_some_and(|ending| ending == "lua");
    offered.extend(PathCompleter::any().filter(is_script).complete(typed));
    offered
}

/// The suites that come with pdk, records and files in TOML.
fn suites(typed: &OsStr) -> Vec<CompletionCandidate> {
    let own = product::get().suites.iter().map(|suite| suite.name);
    let own = own.filter(|name| typed.to_str().is_some_and(|typed| name.starts_with(typed)));
    let mut offered: Vec<_> = own.map(|name| candidate(name, "comes with pdk")).collect();
    let is_suite = |path: &Path| path.extension().is_some_and(|ending| ending == "toml");
    offered.extend(PathCompleter::any().filter(is_suite).complete(typed));
    offered
}

/// Drivers by name, records and files.
fn drivers(typed: &OsStr) -> Vec<CompletionCandidate> {
    let mut offered = named(typed, Some(Kind::Driver));
    offered.extend(records(typed));
    offered
}

/// The records of runs in this folder, the newest first, and other folders.
fn records(typed: &OsStr) -> Vec<CompletionCandidate> {
    let mut offered: Vec<_> = newest(Path::new(RUNS), typed)
        .into_iter()
        .map(|record| candidate(record, "record of a run"))
        .collect();
    offered.extend(PathCompleter::any().complete(typed));
    offered
}

/// The folders with a record that begin with what was typed, the newest first.
fn newest(runs: &Path, typed: &OsStr) -> Vec<PathBuf> {
    let written = |folder: &Path| folder.join(MANIFEST).metadata().and_then(|data| data.modified()).ok();
    let folders = std::fs::read_dir(runs).into_iter().flatten().flatten().map(|entry| entry.path());
    let begins =
        |folder: &PathBuf| folder.as_os_str().as_encoded_bytes().starts_with(typed.as_encoded_bytes());
    let mut found: Vec<_> = folders.filter(begins).filter_map(|path| Some((written(&path)?, path))).collect();
    found.sort();
    found.into_iter().rev().map(|(_, path)| path).collect()
}
