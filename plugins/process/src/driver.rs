//! The driver `process`.

use std::time::{Duration, Instant};

use pdk_adapter::process::{Launch, Launched, command_line};
use pdk_adapter::{Deadline, settings};
use pdk_bus::Stamp;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, json};

use crate::exchange::Exchange;

/// How often the first frame is sent, until it has been answered.
const AGAIN: Duration = Duration::from_millis(100);

/// A program of the user's.
pub struct Process {
    command: Vec<String>,
    name: String,
    /// As it is named to users.
    title: String,
    start: Duration,
    answer: Duration,
    /// Made with the first frame, whose size says how large it has to be.
    open: Option<Open>,
    /// Which scenario it is, as the other process sees it.
    scenario: u64,
}

/// The exchange, and the process that was started for it. The process ends first.
struct Open {
    process: Option<Launched>,
    exchange: Exchange,
    /// Whether it has answered a frame: until then it may still be starting.
    answered: bool,
}

impl Component for Process {
    fn description() -> Description {
        Description::driver(
            "process",
            "A program of yours, in any language, that gets frames and gives controls through shared memory",
        )
        .external()
        // A check is not to wait for a program that is not there.
        .example(json!({ "start_seconds": 1 }))
        .parameter(Parameter::json(
            "command",
            Value::Null,
            "the program and its arguments, as a list of texts; null for one that runs already",
        ))
        .parameter(Parameter {
            default: "driver".into(),
            ..Parameter::text("exchange", "the name by which one that runs already finds its frames")
        })
        .parameter(
            Parameter::number(
                "start_seconds",
                45.0,
                "how long it may take for the first answer; where that is 60 s or more, pdk's own `patience` has to be raised with it",
            )
                .range(0.01, 3600.0)
                .unit("s"),
        )
        .parameter(
            Parameter::number("answer_seconds", 5.0, "how long it may take for any other answer")
                .range(0.001, 3600.0)
                .unit("s"),
        )
    }

    fn new(config: &Config) -> Result<Self> {
        let name = config.text("exchange").to_owned();
        let fits = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || name.len() > 40 || !name.chars().all(fits) {
            return Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "`exchange` is `{name}`, but has to be 1 to 40 letters, digits, dashes and underscores"
                ),
            ));
        }
        let seconds = |name| Duration::from_secs_f64(config.number(name));
        let command = settings::words("command", config.value("command"))?;
        let title = match command.is_empty() {
            false => format!("the driver `{}`", command_line(&command)),
            true => format!("the driver of the exchange `{name}`"),
        };
        Ok(Self {
            command,
            name,
            title,
            start: seconds("start_seconds"),
            answer: seconds("answer_seconds"),
            open: None,
            scenario: 0,
        })
    }
}

impl Driver for Process {
    fn reset(&mut self) -> Result<()> {
        self.scenario += 1;
        Ok(())
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        if self.open.as_ref().is_some_and(|open| !open.exchange.fits(&frame)) {
            self.open = None;
        }
        let open = match &mut self.open {
            Some(open) => open,
            None => self.open.insert(start(&self.command, &self.name, &frame)?),
        };
        let stamp = Stamp { scenario: self.scenario, sequence: cx.frame_index, time: cx.time };
        let (deadline, fresh) = match open.answered {
            true => (Deadline::new(self.answer, "answer_seconds"), false),
            false => (Deadline::new(self.start, "start_seconds"), true),
        };
        let Open { process, exchange, answered } = open;
        exchange.send(frame, stamp, cx.speed)?;
        let mut sent = Instant::now();
        let control = exchange.answer(stamp, &deadline, &self.title, |exchange| {
            process.as_mut().map_or(Ok(()), Launched::check)?;
            // Whoever comes late has not seen the frame.
            if fresh && sent.elapsed() >= AGAIN {
                sent = Instant::now();
                exchange.send(frame, stamp, cx.speed)?;
            }
            Ok(())
        });
        // With nobody at the other end there is nobody to wait longer for.
        let control = control.map_err(|error| match error.kind() {
            ErrorKind::Late if self.command.is_empty() && !exchange.has_listeners() => {
                nobody(&self.name, &deadline)
            }
            _ => error,
        })?;
        *answered = true;
        Ok(control)
    }
}

fn nobody(name: &str, deadline: &Deadline) -> Error {
    Error::of(
        ErrorKind::Late,
        format!(
            "no driver is at the exchange `{name}`, which was waited for {:.1} s; start one, in Python with pdk_driver.serve(drive, \
             exchange=\"{name}\"), or let pdk start it with `command`",
            deadline.elapsed().as_secs_f64()
        ),
    )
}

fn start(command: &[String], name: &str, frame: &Frame<'_>) -> Result<Open> {
    let name = match command.is_empty() {
        true => format!("driver-{name}"),
        false => format!("driver-{}", std::process::id()),
    };
    let exchange = Exchange::new(&name, frame.width(), frame.height())?;
    let process = match command.is_empty() {
        true => None,
        false => {
            let folder = exchange.folder().to_string_lossy();
            let environment = [("PDK_EXCHANGE", folder.as_ref())];
            let launch =
                Launch { what: "driver", parameter: "command", words: command, environment: &environment };
            Some(Launched::start(&launch)?)
        }
    };
    Ok(Open { process, exchange, answered: false })
}
