//! `pdk check`: what a plugin author runs before shipping. The plugin is loaded in a process of its own, so that one
//! that hangs, crashes or exits is a finding like any other.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use pdk::loader::Plugin;
use pdk_sdk::abi::host::Instance;
use pdk_sdk::config::Config;
use pdk_sdk::describe::{Description, Kind};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::testing;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk check`
#[derive(clap::Args)]
pub struct Arguments {
    /// The plugin's library
    #[arg(value_name = "PLUGIN")]
    plugin: PathBuf,
    /// How many seconds one check may take
    #[arg(long, default_value_t = 30.0, value_name = "SECONDS")]
    patience: f64,
    /// Load the plugin in this very process and report in JSON lines
    #[arg(long, hide = true)]
    worker: bool,
}

/// What the process with the plugin reports, a line each.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Report {
    /// What is done next; where nothing follows, this is where it ended.
    Begin(String),
    /// What the last step came to: nothing, or a sentence.
    End(Option<String>),
    /// What the plugin carries.
    Carries { name: String, version: String, components: Vec<String> },
    /// All steps were taken.
    Done,
}

/// Checks a plugin and prints what it carries.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if arguments.worker {
        return work(arguments);
    }
    let patience = Duration::try_from_secs_f64(arguments.patience)
        .map_err(|_| Error::new(format!("--patience is {}, but has to be a number of seconds", arguments.patience)))?;
    let executable = std::env::current_exe().place("cannot find the pdk executable")?;
    let mut child = Command::new(executable)
        .arg("check")
        .arg("--worker")
        .arg(&arguments.plugin)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .place("cannot start a process for the plugin")?;
    let reports = read_reports(&mut child)?;

    let mut findings = Findings::default();
    let mut current = "loading the plugin".to_owned();
    let hung = loop {
        match reports.recv_timeout(patience) {
            Ok(Report::Begin(step)) => current = step,
            Ok(Report::End(failure)) => findings.add(&current, failure),
            Ok(Report::Carries { name, version, components }) => findings.carries = Some((name, version, components)),
            Ok(Report::Done) => current = "the end of the process".to_owned(),
            Err(mpsc::RecvTimeoutError::Timeout) => break true,
            Err(mpsc::RecvTimeoutError::Disconnected) => break false,
        }
    };
    if hung {
        child.kill().place("cannot end the process of the plugin")?;
        findings.add(&current, Some(format!("it has not come back for {} s", arguments.patience)));
    }
    let status = child.wait().place("cannot wait for the process of the plugin")?;
    if !hung && (current != "the end of the process" || !status.success()) {
        findings.add(&current, Some(format!("the plugin ended the process ({status})")));
    }
    findings.print(global, &arguments.plugin)
}

/// Reads the reports on a thread, so that waiting for them can end.
fn read_reports(child: &mut std::process::Child) -> Result<mpsc::Receiver<Report>> {
    let stdout = child.stdout.take().ok_or_else(|| Error::new("the process of the plugin has no output"))?;
    let (sender, reports) = mpsc::channel();
    std::thread::spawn(move || {
        for line in BufReader::new(stdout).lines().map_while(std::io::Result::ok) {
            // What is no report was printed by the plugin itself.
            if let Ok(report) = serde_json::from_str(&line)
                && sender.send(report).is_err()
            {
                return;
            }
        }
    });
    Ok(reports)
}

#[derive(Default)]
struct Findings {
    carries: Option<(String, String, Vec<String>)>,
    steps: Vec<(String, Option<String>)>,
}

impl Findings {
    fn add(&mut self, step: &str, failure: Option<String>) {
        self.steps.push((step.to_owned(), failure));
    }

    fn print(&self, global: &Global, plugin: &std::path::Path) -> Result<()> {
        let failures = self.steps.iter().filter(|(_, failure)| failure.is_some()).count();
        if global.json {
            let steps: Vec<_> = self.steps.iter().map(|(step, failure)| json!({ "check": step, "failure": failure })).collect();
            let (name, version, components) = self.carries.clone().unwrap_or_default();
            print_json(&json!({ "name": name, "version": version, "components": components, "checks": steps }))?;
        } else {
            if let Some((name, version, components)) = &self.carries {
                println!("{name} {version} carries {}", components.join(", "));
            }
            for (step, failure) in &self.steps {
                match failure {
                    None => println!("ok   {step}"),
                    Some(failure) => println!("FAIL {step}: {failure}"),
                }
            }
        }
        match failures {
            0 => Ok(()),
            failures => Err(Error::new(format!(
                "{} fails {failures} of {} checks",
                plugin.display(),
                self.steps.len()
            ))),
        }
    }
}

/// The process with the plugin: takes each step and reports it.
fn work(arguments: &Arguments) -> Result<()> {
    let plugin = match step("loading the plugin", || Plugin::load(&arguments.plugin)) {
        Some(plugin) => plugin,
        None => {
            report(&Report::Done);
            return Ok(());
        }
    };
    let components = &plugin.description.components;
    report(&Report::Carries {
        name: plugin.description.name.clone(),
        version: plugin.description.version.clone(),
        components: components.iter().map(|c| format!("{} `{}`", c.kind, c.name)).collect(),
    });
    for (index, description) in components.iter().enumerate() {
        for config in testing::configs(description) {
            let name = format!("{} `{}`", description.kind, description.name);
            match config {
                Ok(config) => {
                    step(&name, || check(&plugin, index, description, &config));
                }
                Err(error) => {
                    step(&name, || Err::<(), _>(error.at("cannot be run; give it an example with Description::example")));
                }
            }
        }
    }
    report(&Report::Done);
    Ok(())
}

fn step<T>(name: &str, work: impl FnOnce() -> Result<T>) -> Option<T> {
    report(&Report::Begin(name.to_owned()));
    let result = work();
    report(&Report::End(result.as_ref().err().map(ToString::to_string)));
    result.ok()
}

fn report(report: &Report) {
    if let Ok(line) = serde_json::to_string(report) {
        println!("{line}");
    }
}

fn check(plugin: &Plugin, index: usize, description: &Description, config: &Config) -> Result<()> {
    let wrong_kind = || Error::new("the instance is of another kind than described");
    /// The factory that the test kit asks for instances of a kind.
    macro_rules! make {
        ($kind:ident) => {
            &mut |config: &Config| match plugin.create(index, config.values())? {
                Instance::$kind(instance) => Ok(instance),
                _ => Err(wrong_kind()),
            }
        };
    }
    match description.kind {
        Kind::Perturbation => testing::check_perturbation(description, config, make!(Perturbation)),
        Kind::Simulator => testing::check_simulator(config, make!(Simulator)),
        Kind::Driver => testing::check_driver(config, make!(Driver)),
        Kind::Saliency => testing::check_saliency(config, make!(Saliency)),
        Kind::Search => testing::check_search(config, make!(Search)),
        Kind::Dataset => testing::check_dataset(config, make!(Dataset)),
    }
}
