//! The command line.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use pdk::exit_guard::ExitGuard;
use pdk::output;
use pdk::registry::{Registry, SearchPath};
use pdk_sdk::error::Result;

mod check;
mod doctor;
mod export;
mod list;
mod new;
mod perturb;
mod preview;
mod reference;
mod replay;
mod report;
mod road;
mod run;
mod show;

/// Tests driving models by disturbing what their camera sees
#[derive(Parser)]
#[command(
    name = "pdk",
    version,
    propagate_version = true,
    after_help = "Exit codes: 0 done, 1 failed with a sentence on standard error, 2 wrong usage, \
                  70 ended by a component, 75 ended because a component did not come back."
)]
pub struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    verb: Verb,
}

/// Options that every verb understands.
#[derive(clap::Args)]
pub struct Global {
    /// Folder with further plugins and Lua perturbations; may be given several times
    #[arg(long, global = true, value_name = "DIR")]
    plugins: Vec<PathBuf>,
    /// Folder with green-screen clips, each of which becomes a perturbation; may be given several times
    #[arg(long, global = true, value_name = "DIR")]
    overlays: Vec<PathBuf>,
    /// Write the result to standard output as JSON
    #[arg(long, global = true)]
    json: bool,
}

impl Global {
    /// Where components are looked for besides the usual places.
    pub fn search_path(&self) -> SearchPath {
        let overlays = self.overlays.iter().map(|folder| ("overlays", folder.clone()));
        SearchPath { plugins: self.plugins.clone(), drop_ins: overlays.collect() }
    }

    /// Finds all components, and says what had to be left out.
    pub fn registry(&self) -> Result<Registry> {
        let registry = Registry::discover(&self.search_path())?;
        for refused in registry.refused() {
            eprintln!("pdk: warning: {refused}");
        }
        Ok(registry)
    }
}

#[derive(Subcommand)]
enum Verb {
    /// Run a pipeline
    Run(run::Arguments),
    /// Perturb an image or a video
    Perturb(perturb::Arguments),
    /// Show what perturbations do to an image: a sheet, strips and clips
    Preview(preview::Arguments),
    /// Write the reference pages of all perturbations
    Reference(reference::Arguments),
    /// List the components there are
    List(list::Arguments),
    /// Show a component with its parameters
    Show(show::Arguments),
    /// Write a working starting point
    New(new::Arguments),
    /// Check a plugin before shipping it
    Check(check::Arguments),
    /// Say what is installed, what is missing and what to do
    Doctor(doctor::Arguments),
    /// Write a page about a run: what failed, when, where and how often
    Report(report::Arguments),
    /// Make a road and draw it
    Road(road::Arguments),
    /// Drive recorded scenarios again and compare them with their record, bit for bit
    Replay(replay::Arguments),
    /// Export the record of a run for other tools
    Export(export::Arguments),
    /// Write the completions for a shell to standard output
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

/// Runs the verb on the command line.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    // From here on, only returning from this function is a regular end.
    let _guard = ExitGuard::new();
    let Cli { global, verb } = &cli;
    let result = match verb {
        Verb::Run(arguments) => run::run(global, arguments),
        Verb::Perturb(arguments) => perturb::run(global, arguments),
        Verb::Preview(arguments) => preview::run(global, arguments),
        Verb::Reference(arguments) => reference::run(global, arguments),
        Verb::List(arguments) => list::run(global, arguments),
        Verb::Show(arguments) => show::run(global, arguments),
        Verb::New(arguments) => new::run(global, arguments),
        Verb::Check(arguments) => check::run(global, arguments),
        Verb::Doctor(arguments) => doctor::run(global, arguments),
        Verb::Report(arguments) => report::run(global, arguments),
        Verb::Road(arguments) => road::run(global, arguments),
        Verb::Replay(arguments) => replay::run(global, arguments),
        Verb::Export(arguments) => export::run(global, arguments),
        Verb::Completions { shell } => {
            use clap::CommandFactory;
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "pdk", &mut script);
            output::bytes(&script);
            Ok(())
        }
    };
    match result.and_then(|()| output::finish()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("pdk: error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Writes a JSON value to standard output.
fn print_json(value: &serde_json::Value) -> Result<()> {
    println!("{}", serde_json::to_string_pretty(value)?);
    Ok(())
}
