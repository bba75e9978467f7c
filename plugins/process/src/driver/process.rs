//! The driver `process`.

use std::time::Instant;

use pdk_adapter::Deadline;
use pdk_adapter::process::Launched;
use pdk_bus::Stamp;
use pdk_sdk::prelude::*;

use crate::exchange::Exchange;
use crate::options::Options;
use crate::room::{AGAIN, absent, room_name, who};

/// A program of the user's.
pub struct Process {
    options: Options,
    /// As it is named to users.
    who: String,
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
        let description = Description::driver(
            "process",
            "A program of yours, in any language, that gets frames and gives controls through shared memory",
        );
        Options::describe(description, "driver")
    }

    fn new(config: &Config) -> Result<Self> {
        let options = Options::read(config)?;
        let who = who("driver", &options.exchange, &options.command);
        Ok(Self { options, who, open: None, scenario: 0 })
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        Options::input_files(config)
    }
}

impl Driver for Process {
    fn reset(&mut self) -> Result<()> {
        self.scenario += 1;
        Ok(())
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        let Options { command, exchange: name, start, answer, .. } = &self.options;
        if self.open.as_ref().is_some_and(|open| !open.exchange.fits(&frame)) {
            self.open = None;
        }
        let open = match &mut self.open {
            Some(open) => open,
            None => {
                let exchange =
                    Exchange::new(&room_name("driver", name, command), frame.width(), frame.height())?;
                let process = exchange.room().launch("driver", command)?;
                self.open.insert(Open { process, exchange, answered: false })
            }
        };
        let stamp = Stamp { scenario: self.scenario, sequence: cx.frame_index, time: cx.time };
        let (deadline, fresh) = match open.answered {
            true => (Deadline::new(*answer, "answer_seconds"), false),
            false => (Deadline::new(*start, "start_seconds"), true),
        };
        let Open { process, exchange, answered } = open;
        exchange.send(frame, stamp, cx.speed)?;
        let mut sent = Instant::now();
        let control = exchange.answer(stamp, &deadline, &self.who, |exchange| {
            process.as_mut().map_or(Ok(()), Launched::check)?;
            if fresh && sent.elapsed() >= AGAIN {
                sent = Instant::now();
                exchange.send(frame, stamp, cx.speed)?;
            }
            Ok(())
        });
        let control = control.map_err(|error| match error.kind() {
            ErrorKind::Late if command.is_empty() && !exchange.is_heard() => {
                absent("driver", name, &deadline)
            }
            _ => error,
        })?;
        *answered = true;
        Ok(control)
    }
}
