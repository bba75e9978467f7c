//! `pdk export`: the record of a run for other tools.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use pdk_export::Kind;
use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_record::directory::{EXPORT, RunDirectory, SCENARIOS};
use pdk_report::{published, record};
use pdk_sdk::error::Result;
use serde_json::json;

use super::{Global, check_folder, print_json};

/// Arguments of `pdk export`
#[derive(clap::Args)]
pub struct Arguments {
    /// The folder of the record
    #[arg(value_name = "RUN")]
    record: PathBuf,
    /// What to write
    #[arg(long, value_enum, default_value = "json", value_name = "FORMAT")]
    to: Format,
    /// Where to write it: a folder, made if it is not there [default: RUN/export]; of json a file [default: standard output]
    #[arg(short, long = "out", alias = "output", value_name = "DIR|FILE")]
    output: Option<PathBuf>,
}

/// A format of `pdk export`
#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// The scenarios in the JSON shape of the published tool
    Json,
    /// Flat CSV: a line for each scenario, one for each frame, one for each offline result, and the tables of the report
    Csv,
    /// The tables of the report as Markdown
    Md,
    /// The tables of the report for LaTeX, with the package booktabs
    Tex,
    /// The pictures of the report, with texts as texts
    Svg,
    /// JUnit XML: a test case for each scenario
    Junit,
    /// What was driven of an operational design domain, what failed, and what is open: JSON and a page
    Odd,
}

/// Reads a run and writes it in the format.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let kind = match arguments.to {
        Format::Json => return published(global, &arguments.record, arguments.output.as_deref()),
        Format::Csv => Kind::Csv,
        Format::Md => Kind::Markdown,
        Format::Tex => Kind::Latex,
        Format::Svg => Kind::Svg,
        Format::Junit => Kind::Junit,
        Format::Odd => Kind::Odd,
    };
    let folder = arguments.output.clone().unwrap_or_else(|| arguments.record.join(EXPORT));
    check_folder(&folder)?;
    let written = pdk_export::write(&arguments.record, kind, &folder)?;
    for warning in &written.warnings {
        eprintln!("pdk: warning: {warning}");
    }
    if global.json {
        return print_json(&json!({ "files": written.files }));
    }
    for file in &written.files {
        println!("{}", file.display());
    }
    Ok(())
}

/// The scenarios in the published shape.
fn published(global: &Global, record: &Path, output: Option<&Path>) -> Result<()> {
    let (outcomes, cut_off) = published::outcomes(&RunDirectory::open(record)?)?;
    if cut_off {
        eprintln!("pdk: warning: {}", record::cut_off_warning(&record.join(SCENARIOS)));
    }
    match output {
        None => print_json(&json!(outcomes)),
        Some(path) => {
            published::write(path, &outcomes)?;
            if global.json {
                print_json(&json!({ "output": path, "scenarios": outcomes.len() }))?;
            }
            Ok(())
        }
    }
}
