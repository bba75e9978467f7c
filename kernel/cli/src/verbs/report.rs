//! `pdk report`: a page about a run.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use pdk_core::directory::REPORT;
use pdk_core::{eprintln, println};
use pdk_report::record::{self, Read};
use pdk_sdk::error::{Error, Result};
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk report`
#[derive(clap::Args)]
pub struct Arguments {
    /// The folder of the record
    #[arg(value_name = "RUN")]
    record: PathBuf,
    /// Where to write the page [default: RUN/report.html]
    #[arg(short, long, alias = "output", value_name = "FILE.html")]
    out: Option<PathBuf>,
    /// Show it in the browser
    #[arg(long)]
    open: bool,
}

/// Writes the page and says where it is.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let page = arguments.out.clone().unwrap_or_else(|| arguments.record.join(REPORT));
    let Read { run, warnings } = record::read(&arguments.record, &page)?;
    for warning in &warnings {
        eprintln!("pdk: warning: {warning}");
    }
    let text = pdk_report::render(&run)?;
    std::fs::write(&page, &text).map_err(|error| {
        Error::new(format!("cannot write {} ({error}); name another place with --out", page.display()))
    })?;
    if global.json {
        print_json(&json!({
            "output": page, "scenarios": record::scenarios(&run), "evaluations": run.evaluations.len(),
            "unfinished": run.unfinished.is_some(),
        }))?;
    } else {
        println!("Report: {}", page.display());
    }
    if arguments.open
        && let Err(error) = open(&page)
    {
        // The page is there all the same.
        eprintln!("pdk: warning: {error}");
    }
    Ok(())
}

/// Hands the page to the program that the system shows such files with.
fn open(page: &Path) -> Result<()> {
    let program = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };
    let quiet = || Stdio::null();
    let ended = Command::new(program).arg(page).stdin(quiet()).stdout(quiet()).stderr(quiet()).status();
    match ended {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(Error::new(format!(
            "`{program}` did not open {} ({status}); open it in a browser yourself",
            page.display()
        ))),
        Err(error) => Err(Error::new(format!(
            "cannot start `{program}` ({error}); open {} in a browser yourself",
            page.display()
        ))),
    }
}
