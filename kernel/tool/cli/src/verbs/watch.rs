//! `pdk watch`: a run in the browser, while it goes on and afterwards.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use pdk_notice::{eprintln, println};
use pdk_record::directory::MANIFEST;
use pdk_sdk::error::{Error, Result};
use pdk_watch::server;
use serde_json::json;

use super::{Global, print_json, report};

/// How often a run that has not begun is looked for.
const LOOK: Duration = Duration::from_millis(100);

/// Arguments of `pdk watch`
#[derive(clap::Args)]
pub struct Arguments {
    /// The folder of the record [default: that of the run under way that started last]
    #[arg(value_name = "RUN")]
    record: Option<PathBuf>,
    /// The port on the loopback interface [default: a free one]
    #[arg(long, value_name = "PORT", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// How many seconds to wait for the run to begin
    #[arg(long, value_name = "SECONDS", default_value_t = 0)]
    wait: u64,
    /// Show it in the browser
    #[arg(long)]
    open: bool,
}

/// Serves the page until Ctrl-C ends the process.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let record = record(arguments)?;
    let server = server::start(&record, arguments.port)?;
    if global.json {
        print_json(&json!({ "url": server.address, "record": server.record }))?;
    } else {
        println!("Watch: {}", server.address);
        eprintln!("Ctrl-C ends it");
    }
    if arguments.open
        && let Err(error) = report::open(Path::new(&server.address))
    {
        // The page is there all the same.
        eprintln!("pdk: warning: {error}");
    }
    loop {
        std::thread::park();
    }
}

/// The record to watch, which is waited for as long as the user wants.
fn record(arguments: &Arguments) -> Result<PathBuf> {
    let started = Instant::now();
    loop {
        let found = match &arguments.record {
            Some(record) => Some(record.clone()).filter(|record| record.join(MANIFEST).is_file()),
            None => server::latest()?,
        };
        if let Some(found) = found {
            return Ok(found);
        }
        if started.elapsed() >= Duration::from_secs(arguments.wait) {
            return Err(Error::new(match &arguments.record {
                Some(record) => format!(
                    "{} holds no record: it has no {MANIFEST}; name the folder that `pdk run` printed, or wait for a run that writes \
                     there with --wait",
                    record.display()
                ),
                None => "no run is under way on this machine; name the folder of a record, or wait for a run with --wait".to_owned(),
            }));
        }
        std::thread::sleep(LOOK);
    }
}
