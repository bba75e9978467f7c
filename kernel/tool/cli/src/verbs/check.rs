//! `pdk check`: what a plugin author runs before shipping. The plugin is loaded in a process of its own, so that one
//! that hangs, crashes or exits is a finding like any other. A perturbation in Lua is checked the same way.

mod script;

use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use pdk_components::loader::Plugin;
use pdk_model::text::parse_value;
use pdk_notice::println;
use pdk_pipeline::settings::{Override, refuse_repeated};
use pdk_sdk::config::Config;
use pdk_sdk::describe::Description;
use pdk_sdk::error::{Error, ErrorKind, Place, Result};
use pdk_sdk::suggest;
use pdk_sdk::testing;
use pdk_supervise::supervisor::LOOK;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::{Global, print_json};

/// Arguments of `pdk check`
#[derive(clap::Args)]
pub struct Arguments {
    /// The plugin's library, or the file of a perturbation in Lua
    #[arg(value_name = "PLUGIN")]
    plugin: PathBuf,
    /// How many seconds one check may take
    #[arg(long, default_value_t = 30.0, value_name = "SECONDS")]
    patience: f64,
    /// Set a parameter of a component, such as a file that it needs
    #[arg(long = "set", value_name = "COMPONENT.PARAMETER=VALUE")]
    values: Vec<Override>,
    /// Load the plugin in this process, skip this many component checks, and report in JSON lines
    #[arg(long, hide = true)]
    worker: Option<usize>,
}

/// The check that opens the library.
const LOADING: &str = "loading the plugin";
/// What comes after the last check.
const LEAVING: &str = "the end of the process";

/// What the process with the plugin reports, a line each.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Report {
    /// What is done next; where nothing follows, this is where it ended.
    Begin(String),
    /// What the last step came to: nothing, or a sentence.
    End(Option<String>),
    /// Something that is worth knowing and no failure.
    Note(String),
    /// What the plugin carries.
    Carries { name: String, version: String, components: Vec<String> },
    /// All steps were taken.
    Done,
}

/// Checks a plugin and prints what it carries.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if let Some(skipped) = arguments.worker {
        return work(arguments, skipped);
    }
    let patience = Duration::try_from_secs_f64(arguments.patience).map_err(|_| {
        Error::new(format!("--patience is {}, but has to be a number of seconds", arguments.patience))
    })?;
    let mut findings = Findings::default();
    let mut checked = 0;
    // A process that the plugin hangs or ends is followed by another, which takes up after the fatal check.
    while let Some(count) = observe(arguments, patience, checked, &mut findings)? {
        checked += count;
    }
    findings.print(global, &arguments.plugin)
}

/// Watches a process that checks the components of the plugin from check number `skipped` on. Returns how many checks
/// it began if it did not come to its end, and where there may be more.
fn observe(
    arguments: &Arguments,
    patience: Duration,
    skipped: usize,
    findings: &mut Findings,
) -> Result<Option<usize>> {
    let executable = std::env::current_exe().place("cannot find the pdk executable")?;
    let mut child = Command::new(executable)
        .args(["check", "--worker", &skipped.to_string()])
        .args(arguments.values.iter().map(|Override { key, value }| format!("--set={key}={value}")))
        .arg(&arguments.plugin)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .place("cannot start a process for the plugin")?;
    let reports = read_reports(&mut child)?;

    let mut current = LOADING.to_owned();
    let mut began = 0;
    let mut ended = true;
    let hung = loop {
        let report = reports.recv_timeout(patience);
        if !ended && matches!(report, Ok(Report::Begin(_) | Report::Done)) {
            findings.add(
                &current,
                Some("its result was lost; does the plugin write to standard output?".to_owned()),
            );
        }
        match report {
            Ok(Report::Begin(step)) => {
                began += usize::from(step != LOADING);
                current = step;
                ended = false;
            }
            Ok(Report::End(failure)) => {
                // Loading is a check of the first process only.
                if current != LOADING || skipped == 0 || failure.is_some() {
                    findings.add(&current, failure);
                }
                ended = true;
            }
            Ok(Report::Note(note)) => findings.notes.push(note),
            Ok(Report::Carries { name, version, components }) => {
                findings.carries = Some((name, version, components))
            }
            Ok(Report::Done) => {
                current = LEAVING.to_owned();
                ended = true;
            }
            Err(mpsc::RecvTimeoutError::Timeout) => break true,
            Err(mpsc::RecvTimeoutError::Disconnected) => break false,
        }
    };
    // A plugin that closes standard output ends the reports, but not its process.
    let status = match hung {
        true => None,
        false => ended_within(&mut child, patience).place("cannot wait for the process of the plugin")?,
    };
    match status {
        Some(status) if current == LEAVING && status.success() => return Ok(None),
        Some(status) => findings.add(&current, Some(format!("the plugin ended the process ({status})"))),
        None => {
            child.kill().place("cannot end the process of the plugin")?;
            child.wait().place("cannot wait for the process of the plugin")?;
            findings.add(&current, Some(format!("it has not come back for {} s", patience.as_secs_f64())));
        }
    }
    Ok((current != LOADING && current != LEAVING).then_some(began))
}

/// How a process ended; none if it goes on for longer than this.
fn ended_within(child: &mut Child, longest: Duration) -> io::Result<Option<ExitStatus>> {
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if begin.elapsed() >= longest {
            return Ok(None);
        }
        // As a rule it ends right after its output.
        std::thread::sleep((begin.elapsed() / 20).clamp(Duration::from_millis(1), LOOK));
    }
}

/// Reads the reports on a thread, so that waiting for them can end.
fn read_reports(child: &mut Child) -> Result<mpsc::Receiver<Report>> {
    let stdout = child.stdout.take().ok_or_else(|| Error::new("the process of the plugin has no output"))?;
    let (sender, reports) = mpsc::channel();
    std::thread::spawn(move || {
        for line in BufReader::new(stdout).lines().map_while(std::io::Result::ok) {
            // What is not a report was printed by the plugin itself.
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
    notes: Vec<String>,
}

impl Findings {
    fn add(&mut self, step: &str, failure: Option<String>) {
        self.steps.push((step.to_owned(), failure));
    }

    fn print(&self, global: &Global, plugin: &Path) -> Result<()> {
        let failures = self.steps.iter().filter(|(_, failure)| failure.is_some()).count();
        if global.json {
            let steps: Vec<_> = self
                .steps
                .iter()
                .map(|(step, failure)| json!({ "check": step, "failure": failure }))
                .collect();
            let (name, version, components) = self.carries.clone().unwrap_or_default();
            print_json(&json!({
                "name": name, "version": version, "components": components, "checks": steps, "notes": self.notes
            }))?;
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
            for note in &self.notes {
                println!("note {note}");
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

/// The process with the plugin: takes each step from number `skipped` on, and reports it.
fn work(arguments: &Arguments, skipped: usize) -> Result<()> {
    if script::is_script(&arguments.plugin) {
        script::work(arguments, skipped);
        report(&Report::Done);
        return Ok(());
    }
    let plugin = match step(LOADING, || {
        let plugin = Plugin::load(&arguments.plugin)?;
        known(&plugin.description.components, arguments)?;
        Ok(plugin)
    }) {
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
    if skipped == 0 {
        plugin.skipped.iter().for_each(|sentence| report(&Report::Note(sentence.clone())));
    }
    let mut number = 0;
    for (index, description) in components.iter().enumerate() {
        for (parameters, name) in parameters(description, &arguments.values)? {
            number += 1;
            if number <= skipped {
                continue;
            }
            let remedy = "cannot be run; give it what it needs with --set COMPONENT.PARAMETER=VALUE or Description::example";
            step(&name, || {
                let config = Config::check(description, &parameters).place(remedy)?;
                check(&plugin, index, description, &config)
            });
        }
    }
    report(&Report::Done);
    Ok(())
}

/// Checks that all parameters that the command line sets are of one of the components.
fn known(components: &[Description], arguments: &Arguments) -> Result<()> {
    refuse_repeated(&arguments.values)?;
    for Override { key, value } in &arguments.values {
        parse_value(value).map_err(|error| error.at(format_args!("--set {key}")))?;
        let names = components.iter().map(|component| component.name.as_str());
        let component = key.split_once('.').map(|(component, _)| component);
        if component.is_none_or(|component| !names.clone().any(|name| name == component)) {
            let hint = suggest::hint(component.unwrap_or(key), names);
            return Err(Error::new(format!(
                "--set {key}: write COMPONENT.PARAMETER=VALUE with a component of the plugin; {hint}"
            )));
        }
    }
    Ok(())
}

/// The parameters that a component is checked with, and what each check is called: its examples, or its defaults where
/// it has none, and what the command line sets.
fn parameters(description: &Description, values: &[Override]) -> Result<Vec<(Map<String, Value>, String)>> {
    let name = format!("{} `{}`", description.kind, description.name);
    let defaults = [Map::new()];
    let (examples, named): (&[_], _) = match description.examples.as_slice() {
        [] => (&defaults, false),
        examples => (examples, examples.len() > 1),
    };
    let prepare = |example: &Map<String, Value>| {
        let mut parameters = example.clone();
        for Override { key, value } in values {
            if let Some((component, parameter)) = key.split_once('.')
                && component == description.name
            {
                let value = parse_value(value).map_err(|error| error.at(format_args!("--set {key}")))?;
                parameters.insert(parameter.to_owned(), value);
            }
        }
        Ok((parameters, if named { format!("{name} with {}", json!(example)) } else { name.clone() }))
    };
    examples.iter().map(prepare).collect()
}

fn step<T>(name: &str, work: impl FnOnce() -> Result<T>) -> Option<T> {
    report(&Report::Begin(name.to_owned()));
    let result = work();
    report(&Report::End(result.as_ref().err().map(ToString::to_string)));
    result.ok()
}

fn report(report: &Report) {
    if let Ok(line) = serde_json::to_string(report) {
        // In a line of its own whatever the plugin wrote before, and in one piece whatever it writes meanwhile. A report
        // that cannot be written is missed by the process that watches.
        let mut stdout = std::io::stdout().lock();
        let _ = stdout.write_all(format!("\n{line}\n").as_bytes()).and_then(|()| stdout.flush());
    }
}

fn check(plugin: &Plugin, index: usize, description: &Description, config: &Config) -> Result<()> {
    let mut make = |config: &Config| plugin.create(index, config.values());
    outside(description, testing::check(description, config, &mut make))
}

/// A component that needs a program besides pdk cannot be checked without it, which is not a mistake of the plugin.
fn outside(description: &Description, checked: Result<()>) -> Result<()> {
    match checked {
        Err(error) if description.external && matches!(error.kind(), ErrorKind::Lost | ErrorKind::Late) => {
            let Description { kind, name, .. } = description;
            report(&Report::Note(format!("{kind} `{name}` was made and not used, because {error}")));
            Ok(())
        }
        checked => checked,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_closes_its_output_and_goes_on_is_not_waited_for() {
        let start = |script: &str| {
            let mut command = Command::new("sh");
            command.args(["-c", script]).stdout(Stdio::piped()).spawn().unwrap()
        };
        let mut going_on = start("exec >&-; exec sleep 1000");
        let reports = read_reports(&mut going_on).unwrap();
        assert!(reports.recv().is_err());
        assert_eq!(ended_within(&mut going_on, Duration::from_millis(50)).unwrap(), None);
        going_on.kill().unwrap();
        going_on.wait().unwrap();
        let ended = ended_within(&mut start("exit 3"), Duration::from_secs(60)).unwrap();
        assert_eq!(ended.and_then(|status| status.code()), Some(3));
    }
}
