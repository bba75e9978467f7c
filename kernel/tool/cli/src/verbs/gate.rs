//! `pdk gate`: whether a new driver is worse than an old one.

use std::path::{Path, PathBuf};

use pdk_components::product;
use pdk_gate::gate::{self, Judged, NewFailure};
use pdk_gate::loaded::Loaded;
use pdk_gate::{again, shown};
use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_pipeline::follow::Audience;
use pdk_replay::replay::{Film, Replay};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use pdk_session::connection::Pool;
use pdk_supervise::supervisor::Limits;

use super::recorded::{self, Driving};
use super::settings::ToolSettings;
use super::{Global, check_writable, print_json};

/// Arguments of `pdk gate`
#[derive(clap::Args)]
pub struct Arguments {
    /// The driver that there was: a network's file, a driver's name with its parameters, or the record of its drives
    #[arg(value_name = "OLD")]
    old: String,
    /// The driver that is to take its place, named in the same ways
    #[arg(value_name = "NEW")]
    new: String,
    #[arg(long, value_name = "SUITE", help = suite_help())]
    suite: String,
    /// Write the verdict to this file as well, which `pdk verify` checks
    #[arg(long, value_name = "FILE.json")]
    verdict: Option<PathBuf>,
    /// Write the result as Markdown, for a pull request
    #[arg(long, value_name = "FILE.md")]
    markdown: Option<PathBuf>,
    /// Write the result as JUnit XML, a test case for each requirement
    #[arg(long, value_name = "FILE.xml")]
    junit: Option<PathBuf>,
    /// Write a clip of each new failure to this folder; not for recordings
    #[arg(long, value_name = "DIR")]
    clips: Option<PathBuf>,
    /// Write the new failures as a suite, for the gates to come
    #[arg(long, value_name = "FILE.toml")]
    save_suite: Option<PathBuf>,
    #[command(flatten)]
    settings: ToolSettings,
}

impl Arguments {
    /// Finds out before anything is driven whether results can be written to where they are to go.
    fn check_outputs(&self) -> Result<()> {
        if let Some(path) = &self.save_suite {
            super::suite::name_of(path)?;
        }
        let files = [&self.verdict, &self.markdown, &self.junit, &self.save_suite];
        for path in files.into_iter().flatten() {
            check_writable(path)?;
        }
        match &self.clips {
            Some(folder) => make_folder(folder),
            None => Ok(()),
        }
    }
}

fn make_folder(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).place(format_args!("cannot make the folder {}", folder.display()))
}

/// What a suite on the command line may be.
pub fn suite_help() -> String {
    let names: Vec<_> = product::get().suites.iter().map(|suite| suite.name).collect();
    format!("The suite: a file in TOML, or one that comes with pdk by its name: {}", names.join(", "))
}

/// Decides; returns whether the new driver passed.
pub fn run(global: &Global, arguments: &Arguments) -> Result<bool> {
    let audience = if global.json { Audience::None } else { Audience::Person };
    let loaded = Loaded::find(&arguments.suite)?;
    if arguments.clips.is_some() && loaded.suite.is_recorded() {
        return Err(Error::new(format!(
            "clips are of drives, and {} is a suite of recordings; leave out --clips",
            arguments.suite
        )));
    }
    arguments.check_outputs()?;
    let options = arguments.settings.options(global, audience)?;
    let (pool, limits) = (options.common.pool(), options.common.limits());
    let mut judged = gate::run(loaded, [&arguments.old, &arguments.new], options)?;
    for warning in &judged.warnings {
        eprintln!("pdk: warning: {warning}");
    }
    // What is known is shown and written even if a clip cannot be made.
    let filmed = match &arguments.clips {
        Some(folder) => film(global, &mut judged.failures, folder, &pool, &limits),
        None => Ok(()),
    };
    if !global.json {
        print(&judged);
    }
    let write = |path: &Option<PathBuf>, text: &dyn Fn() -> Result<String>| match path {
        Some(path) => {
            file::write(path, text()?.as_bytes()).place(format_args!("cannot write {}", path.display()))
        }
        None => Ok(()),
    };
    write(&arguments.verdict, &|| Ok(serde_json::to_string_pretty(&judged.verdict)? + "\n"))?;
    write(&arguments.markdown, &|| Ok(shown::markdown(&judged)))?;
    write(&arguments.junit, &|| shown::junit(&judged))?;
    if let Some(path) = arguments.save_suite.as_ref().filter(|_| judged.failures.is_empty()) {
        eprintln!("pdk: notice: there are no new failures, so {} is left as it is", path.display());
    } else if let Some(path) = &arguments.save_suite {
        let scenarios = judged.failures.iter().map(|failure| &failure.scenario);
        let about = format!("What {} failed and {} did not", arguments.new, arguments.old);
        let text = again::of_scenarios(scenarios, &super::suite::name_of(path)?, &about)?;
        write(&Some(path.clone()), &|| Ok(text.clone()))?;
    }
    if global.json {
        print_json(&shown::json(&judged)?)?;
    }
    filmed?;
    Ok(judged.verdict.decision.passed)
}

fn print(judged: &Judged) {
    println!("{}", shown::requirements(judged));
    for sentence in shown::explanation(judged).into_iter().chain(shown::luck(judged)) {
        println!("{sentence}");
    }
    if !judged.failures.is_empty() {
        println!("New failures:");
    }
    for line in shown::failures(judged) {
        println!("{line}");
    }
    if judged.known > 0 {
        let (all, unit) = (judged.drives.0, judged.verdict.unit());
        println!("{} of {all} {unit} were in a record already", judged.known);
    }
    for line in &judged.speed {
        println!("{line}");
    }
    match &judged.record {
        Some(record) => println!("Record: {}", record.display()),
        None => println!("Nothing was driven, so there is no record; --verdict writes the verdict to a file"),
    }
    println!("{}", shown::headline(judged));
}

/// Films new failures, a clip each.
fn film(
    global: &Global,
    failures: &mut [NewFailure],
    folder: &Path,
    pool: &Pool,
    limits: &Limits,
) -> Result<()> {
    make_folder(folder)?;
    for NewFailure { id, record, clip, .. } in failures {
        let path = folder.join(format!("{id}.mp4"));
        let replay = Replay::open(record, &[id.to_string()])?;
        let driving = Driving { verb: "gate", record, pool: pool.clone(), limits: *limits, trust: false };
        let (session, _) = recorded::session(global, &replay, driving)?;
        let progress = pdk_terminal::progress(global.json, "{pos}/{len} frames of a clip, {eta} left");
        replay.drive(session, Some(&Film { path: path.clone(), saliency: None }), &progress)?;
        *clip = Some(path);
    }
    Ok(())
}
