//! The command line.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Command, CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::CompleteEnv;
use pdk_components::inspection;
use pdk_components::product;
use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_lua::LuaScripts;
use pdk_notice::eprintln;
use pdk_sdk::error::{Error, Place, Result};
use pdk_session::connection::Pool;
use pdk_session::interrupt;
use pdk_session::session::{Options, Session};
use pdk_supervise::calls;
use pdk_supervise::supervisor::Limits;

use crate::supervised::Memory;
use crate::{memory, supervised};

mod attack;
mod cache;
mod calibrate;
mod check;
mod completions;
mod corrupt;
mod doctor;
mod examples;
mod export;
mod gate;
mod gradient;
mod json_text;
mod list;
mod merge;
mod network;
mod new;
mod perturb;
mod plugin;
mod preview;
mod recorded;
mod reference;
mod replay;
mod report;
mod road;
mod run;
mod saliency;
mod sensitivity;
mod session;
mod settings;
mod show;
mod shrink;
mod suite;
mod tap;
mod verify;
mod version;
mod watch;
mod why;
mod worker;
mod workers;

/// Tests driving models by disturbing what their camera sees
#[derive(Parser)]
#[command(
    name = "pdk",
    version,
    propagate_version = true,
    after_help = "Exit codes: 0 done, 1 failed with a sentence on standard error, 2 wrong usage, \
                  3 a gate or a verification said no, \
                  70 ended by a component, 75 ended because a component did not come back, \
                  130 interrupted with Ctrl-C, 143 terminated."
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
    /// Folder with files of your own, such as clips and networks, each of which becomes a component; may be given several times
    #[arg(long, global = true, value_name = "DIR")]
    drop_ins: Vec<PathBuf>,
    /// Write the result to standard output as JSON
    #[arg(long, global = true)]
    json: bool,
}

impl Global {
    /// Where components are looked for besides the usual places.
    pub fn search_path(&self) -> SearchPath {
        SearchPath { plugins: self.plugins.clone(), drop_ins: self.drop_ins.clone(), beside: Vec::new() }
    }

    /// Finds all components, and says what had to be left out. They are loaded into this process.
    pub fn registry(&self) -> Result<Registry> {
        let search = self.search_path();
        let registry = Registry::discover(&search, Box::new(LuaScripts::new(&search)))?;
        for refused in registry.refused() {
            eprintln!("pdk: warning: {refused}");
        }
        for skipped in registry.skipped() {
            eprintln!("pdk: warning: {skipped}");
        }
        Ok(registry)
    }

    /// A session with its first worker, which says what had to be left out; `name` is that of the run on its topics.
    pub fn session(&self, name: &str, pool: Pool, limits: Limits, search: SearchPath) -> Result<Session> {
        let run = format!("{name}-{}", std::process::id());
        let session = Session::start(Options { run, pool, limits, search })?;
        for refused in session.refused() {
            eprintln!("pdk: warning: {refused}");
        }
        Ok(session)
    }
}

/// The exit code of a gate that a driver does not pass, and of a verdict that is refuted.
const NO: u8 = 3;

#[derive(Subcommand)]
enum Verb {
    /// Run a pipeline
    Run(run::Arguments),
    /// Perturb an image or a video
    Perturb(perturb::Arguments),
    /// Perturb a dataset, with its labels
    Corrupt(corrupt::Arguments),
    /// Show what perturbations do to an image: a sheet, strips and clips
    Preview(preview::Arguments),
    /// Measure a scale on which a level means the same for every perturbation
    Calibrate(calibrate::Arguments),
    /// Show which parts of frames matter to a driver's network: numbers and pictures
    Saliency(saliency::Arguments),
    /// Train a picture that makes a driver steer elsewhere: a patch on the road or a change of every frame, on recorded frames or recorded drives
    Attack(attack::Arguments),
    /// Write the exact gradient of a network as a network
    Gradient(gradient::Arguments),
    /// Write the reference pages of all perturbations
    Reference(reference::Arguments),
    /// List the components there are
    List(list::Arguments),
    /// Show a component with its parameters, or the network in an ONNX file
    Show(show::Arguments),
    /// Write a working starting point
    New(new::Arguments),
    /// Check a plugin before shipping it
    Check(check::Arguments),
    /// Install, list and remove plugins
    Plugin(plugin::Arguments),
    /// Report what is installed and what is missing
    Doctor(doctor::Arguments),
    /// Write a page about a run: what failed, when, where and how often
    Report(report::Arguments),
    /// Make a road and draw it
    Road(road::Arguments),
    /// Drive recorded scenarios again and compare them with their record, bit for bit
    Replay(replay::Arguments),
    /// Make a scenario that failed as simple as it can be and still fail
    Shrink(shrink::Arguments),
    /// Find the smallest part of a failed drive that is proven to make it fail
    Why(why::Arguments),
    /// Show how the largest error of a drive changes with the level at each frame
    Sensitivity(sensitivity::Arguments),
    /// Export the record of a run for other tools
    Export(export::Arguments),
    /// Decide whether a new driver is worse than an old one, with an error rate that holds whenever the gate stops
    Gate(gate::Arguments),
    /// Check the verdict of a gate by driving some of its scenarios again
    Verify(verify::Arguments),
    /// Show a suite of scenarios, or make one of what failed in a record
    Suite(suite::Arguments),
    /// Show a run in the browser, while it goes on and afterwards
    Watch(watch::Arguments),
    /// Print the messages of a run under way: frames, controls and states
    Tap(tap::Arguments),
    /// Put the records of the parts of a run together
    Merge(merge::Arguments),
    /// Run a pipeline for another program, or take its calls: JSON lines on standard input and output (see docs/session-protocol.md)
    Session(session::Arguments),
    /// Do jobs for a session: JSON lines on standard input and output (see docs/worker-protocol.md)
    Worker(worker::Arguments),
    /// Open libraries, and say what came of it
    #[command(name = inspection::VERB, hide = true)]
    Inspect {
        /// The libraries
        libraries: Vec<PathBuf>,
    },
    /// Show or clear the cache of clips and saliency maps
    Cache(cache::Arguments),
    /// Write the completions for a shell to standard output
    Completions(completions::Arguments),
    /// Write the manual pages to a folder
    Man {
        /// The folder, which is made where it is missing
        #[arg(value_name = "DIR")]
        folder: PathBuf,
    },
}

impl Verb {
    /// Whether it calls components in its own process.
    fn calls_components(&self) -> bool {
        match self {
            Verb::Perturb(_)
            | Verb::Corrupt(_)
            | Verb::Preview(_)
            | Verb::Calibrate(_)
            | Verb::Saliency(_)
            | Verb::Sensitivity(_)
            | Verb::Attack(_)
            | Verb::Reference(_) => true,
            Verb::List(_) | Verb::Show(_) => true,
            Verb::New(_) | Verb::Doctor(_) | Verb::Plugin(_) => true,
            // Pipelines and replays leave that to workers, and `check` has processes of its own.
            Verb::Run(_)
            | Verb::Replay(_)
            | Verb::Shrink(_)
            | Verb::Why(_)
            | Verb::Check(_)
            | Verb::Worker(_) => false,
            Verb::Session(_) | Verb::Merge(_) => false,
            Verb::Gate(_) | Verb::Verify(_) | Verb::Suite(_) => false,
            Verb::Report(arguments) => arguments.calls_components(),
            Verb::Road(_) | Verb::Export(_) | Verb::Gradient(_) | Verb::Tap(_) | Verb::Watch(_) => false,
            Verb::Cache(_) | Verb::Inspect { .. } | Verb::Completions(_) | Verb::Man { .. } => false,
        }
    }

    /// How much memory its process may take, if it has the option.
    fn memory(&self) -> Option<Memory> {
        match self {
            Verb::Perturb(arguments) => Some(arguments.memory),
            Verb::Corrupt(arguments) => Some(arguments.memory),
            Verb::Preview(arguments) => Some(arguments.memory),
            Verb::Calibrate(arguments) => Some(arguments.memory),
            Verb::Saliency(arguments) => Some(arguments.memory),
            Verb::Sensitivity(arguments) => Some(arguments.memory),
            Verb::Attack(arguments) => Some(arguments.memory()),
            _ => None,
        }
    }
}

/// Runs the verb on the command line.
pub fn main() -> ExitCode {
    // First, since reading the command line takes memory too.
    if let Err(error) = memory::watch(calls::supervised()) {
        return failed(&error);
    }
    inspection::enable();
    // Does not come back if a shell asks for completions.
    CompleteEnv::with_factory(command).var(completions::VARIABLE).complete();
    let cli = parsed();
    if cli.verb.calls_components() && !calls::supervised() {
        return supervised::run(cli.verb.memory()).unwrap_or_else(|error| failed(&error));
    }
    let Cli { global, verb } = &cli;
    // What a verb found out may be a no, which is not an error.
    let mut said_no = false;
    let result = match verb {
        Verb::Run(arguments) => run::run(global, arguments),
        Verb::Perturb(arguments) => perturb::run(global, arguments),
        Verb::Preview(arguments) => preview::run(global, arguments),
        Verb::Calibrate(arguments) => calibrate::run(global, arguments),
        Verb::Corrupt(arguments) => corrupt::run(global, arguments),
        Verb::Saliency(arguments) => saliency::run(global, arguments),
        Verb::Attack(arguments) => attack::run(global, arguments),
        Verb::Gradient(arguments) => gradient::run(global, arguments),
        Verb::Reference(arguments) => reference::run(global, arguments),
        Verb::List(arguments) => list::run(global, arguments),
        Verb::Show(arguments) => show::run(global, arguments),
        Verb::New(arguments) => new::run(global, arguments),
        Verb::Check(arguments) => check::run(global, arguments),
        Verb::Plugin(arguments) => plugin::run(global, arguments),
        Verb::Doctor(arguments) => doctor::run(global, arguments),
        Verb::Report(arguments) => report::run(global, arguments),
        Verb::Road(arguments) => road::run(global, arguments),
        Verb::Replay(arguments) => replay::run(global, arguments),
        Verb::Shrink(arguments) => shrink::run(global, arguments),
        Verb::Why(arguments) => why::run(global, arguments),
        Verb::Sensitivity(arguments) => sensitivity::run(global, arguments),
        Verb::Export(arguments) => export::run(global, arguments),
        Verb::Merge(arguments) => merge::run(global, arguments),
        Verb::Tap(arguments) => tap::run(global, arguments),
        Verb::Watch(arguments) => watch::run(global, arguments),
        Verb::Gate(arguments) => gate::run(global, arguments).map(|passed| said_no = !passed),
        Verb::Verify(arguments) => verify::run(global, arguments).map(|holds| said_no = !holds),
        Verb::Suite(arguments) => suite::run(global, arguments),
        Verb::Session(arguments) => session::run(global, arguments),
        Verb::Worker(arguments) => worker::run(arguments),
        Verb::Inspect { libraries } => inspection::serve(libraries),
        Verb::Cache(arguments) => cache::run(global, arguments),
        Verb::Completions(arguments) => completions::run(arguments),
        Verb::Man { folder } => manual(folder),
    };
    let code = match result.and_then(|()| pdk_notice::finish()) {
        Ok(()) if said_no => ExitCode::from(NO),
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => failed(&error),
    };
    // What comes now is a regular end.
    calls::done();
    code
}

/// The command line with all that is derived for it.
fn command() -> Command {
    examples::shown(completions::offered(Cli::command()), product::get())
}

/// What is on the command line. Wrong usage ends the process.
fn parsed() -> Cli {
    let mut command = command();
    // It takes a look at all plugins, for which no other verb has to wait.
    if std::env::args_os().any(|argument| argument == "--version") {
        command = command.long_version(version::long());
    }
    let matches = command.get_matches();
    Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
}

/// Writes a manual page for `pdk` and one for each verb.
fn manual(folder: &Path) -> Result<()> {
    let place = || format!("cannot write the manual pages to {}", folder.display());
    std::fs::create_dir_all(folder).place(place())?;
    clap_mangen::generate_to(command(), folder).place(place())
}

/// Says what went wrong. An interrupted run has the exit code that the signal would have given it.
fn failed(error: &pdk_sdk::error::Error) -> ExitCode {
    eprintln!("pdk: error: {error}");
    interrupt::exit_code().map_or(ExitCode::FAILURE, ExitCode::from)
}

/// Finds out whether a file can be written, before it is known what comes into it.
fn check_writable(path: &Path) -> Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let tried = match path {
        path if path.is_dir() => Err(std::io::Error::from(std::io::ErrorKind::IsADirectory)),
        // A pipe or a device is written to and not replaced.
        path if path.exists() && !path.is_file() => Ok(()),
        // A file is made beside it.
        _ => tempfile::tempfile_in(folder).map(drop),
    };
    tried.place(format_args!("cannot write {}", path.display()))
}

/// Endings of pictures, videos and documents. A folder whose name has one is a file that the user expects.
const FILE_ENDINGS: [&str; 19] = [
    "avi", "bmp", "csv", "gif", "html", "jpeg", "jpg", "json", "md", "mkv", "mov", "mp4", "npy", "pdf",
    "png", "svg", "tex", "webp", "xml",
];

/// Refuses to make a folder that is named like a file.
fn check_folder(path: &Path) -> Result<()> {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match FILE_ENDINGS.contains(&ending.as_str()) && !path.is_dir() {
        false => Ok(()),
        true => Err(Error::new(format!(
            "{} is named like a file, but several files are written, and -o names the folder for them; name a folder such as {}",
            path.display(),
            path.with_extension("").display()
        ))),
    }
}

/// A name, with a number behind it if it was there that many times before.
fn numbered(name: &str, before: usize) -> String {
    match before {
        0 => name.to_owned(),
        _ => format!("{name}-{}", before + 1),
    }
}

/// Writes a JSON value to standard output.
fn print_json(value: &serde_json::Value) -> Result<()> {
    json_text::print(&serde_json::to_string_pretty(value)?);
    Ok(())
}
