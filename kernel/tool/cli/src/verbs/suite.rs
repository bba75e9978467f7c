//! `pdk suite`: a suite of scenarios in numbers, or one of what failed in a record.

use std::path::{Path, PathBuf};

use pdk_gate::again;
use pdk_gate::loaded::Loaded;
use pdk_gate::step::{Step, steps};
use pdk_gate::suite::ENDING;
use pdk_notice::println;
use pdk_pipeline::readers;
use pdk_record::directory::MANIFEST;
use pdk_record::ledger::Line;
use pdk_replay::replay::Replay;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use pdk_session::connection::Pool;
use pdk_supervise::supervisor::Limits;
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk suite`
#[derive(clap::Args)]
pub struct Arguments {
    /// A suite to show, by its file or its name, or the record of a run whose failures become a suite
    #[arg(value_name = "SUITE|RUN")]
    from: String,
    /// Where the suite of a record's failures goes
    #[arg(short, long = "out", alias = "output", value_name = "FILE.toml")]
    output: Option<PathBuf>,
    /// Only this scenario of the record, by its number, its id or the beginning of that; may be given several times
    #[arg(long = "scenario", value_name = "N|ID")]
    scenarios: Vec<String>,
}

/// Shows a suite, or makes one.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let Arguments { from, output, scenarios } = arguments;
    if Path::new(from).join(MANIFEST).is_file() {
        let output = output.as_ref().ok_or_else(|| {
            Error::new(format!("{from} is the record of a run; say with --out FILE.{ENDING} where the suite of its failures goes"))
        })?;
        let replay = Replay::open(Path::new(from), scenarios)?;
        let lines: Vec<&Line> = replay.lines().collect();
        let place = match scenarios.is_empty() {
            true => from.clone(),
            false => format!("scenario {} of {from}", scenarios.join(", ")),
        };
        let text = again::of_failures(&lines, &name_of(output)?, &place)?;
        return file::write(output, text.as_bytes()).place(format_args!("cannot write {}", output.display()));
    }
    if output.is_some() || !scenarios.is_empty() {
        return Err(Error::new(format!(
            "{from} is not the record of a run; --out and --scenario are for records"
        )));
    }
    let mut loaded = Loaded::find(from)?;
    if loaded.suite.is_recorded() {
        let mut session = global.session("suite", Pool::Here(1), Limits::default(), global.search_path())?;
        let catalog = session.catalog().clone();
        loaded.open(&catalog, &mut |dataset| readers::recording(&mut session, dataset))?;
    }
    let suite = &loaded.suite;
    let all: Vec<Step> = steps(&loaded).collect::<Result<_>>()?;
    if global.json {
        let row = |step: &Step| {
            json!({
                "series": step.series, "number": step.number, "perturbation": step.perturbation, "level": step.level,
                "scenario": step.scenario,
            })
        };
        return print_json(&json!({
            "suite": suite, "blake3": loaded.hash, "scenarios": all.iter().map(row).collect::<Vec<_>>(),
        }));
    }
    println!("{} version {}", suite.name, suite.version);
    if !suite.about.is_empty() {
        println!("{}", pdk_terminal::text::wrapped("", &suite.about));
    }
    println!("BLAKE3      {}", loaded.hash);
    let (pairs, alone) =
        (all.iter().filter(|step| step.is_pair()).count(), all.iter().filter(|step| !step.is_pair()).count());
    println!("scenarios   at most {pairs} for both drivers, {alone} for the new one alone");
    println!("alpha       {}", suite.test.alpha);
    for requirement in suite.required() {
        println!("requires    {}", requirement.described(suite.test.tolerated, suite.drawn()));
    }
    Ok(())
}

/// The name of a suite that goes into a file.
///
/// # Errors
/// If the file's ending is another one.
pub fn name_of(file: &Path) -> Result<String> {
    if file.extension().is_none_or(|ending| ending != ENDING) {
        return Err(Error::new(format!(
            "the name of the suite, {}, has to end in .{ENDING}",
            file.display()
        )));
    }
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let fits = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    Ok(stem.chars().map(fits).collect())
}
