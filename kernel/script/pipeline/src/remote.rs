//! A pipeline that is another program, in any language: its calls come as lines of JSON on standard input, and what they return goes back
//! on standard output. `docs/session-protocol.md` is the page about it.
//!
//! What a call does is what the function of the same name does in Lua.

use std::cell::Cell;
use std::io;
use std::path::PathBuf;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use pdk_loop::lines::{self, Found};
use pdk_model::component::ComponentSpec;
use pdk_model::text::Unique;
use pdk_sdk::error::{Error, ErrorKind, Place, Result};
use pdk_session::interrupt::{self, Wish};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::finished::Finished;
use crate::follow::{Failed, Told, tell};
use crate::host::Host;
use crate::host::driving::stop_if_dropped;
use crate::requests::Defaults;
use crate::run::{Options, Script, start};
use crate::scored::{Scoring, Step};
use crate::tickets::Tickets;
use crate::values::from_program;

/// The version of the protocol.
pub const VERSION: u32 = 1;

/// How often it is looked whether the user wants an end, while nothing is called.
const LOOK: Duration = Duration::from_millis(100);

/// What the program calls.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Call {
    /// `pdk.settings`.
    Settings(Unique),
    /// What scenarios have from here on if they do not say it, as `pdk.session` takes it.
    Defaults(Unique),
    /// Submits scenarios; returns a ticket for each.
    Submit(Vec<Unique>),
    /// Waits for the outcome of a ticket.
    Wait(Value),
    /// Waits for the next outcome.
    Next {},
    /// `pdk.evaluate`.
    Evaluate(Unique),
    /// What the function of a task returned for a picture; returns the next one, or the result.
    Scored(Vec<Value>),
    /// `pdk.save`.
    Save { name: String, value: Unique },
    /// `pdk.road`.
    Road(Unique),
    /// Frames a second of a simulator.
    Rate(Unique),
    /// The components there are.
    Catalog {},
    /// The pipeline is at its end: what is under way is finished.
    End {},
}

/// Hears what comes on standard input. If that ends before the pipeline does, the program is gone, and with it the reader
/// wants outcomes; for a pipeline in Lua any end of the input says so.
fn listen(calls: Option<mpsc::Sender<Found<Call>>>) -> Result<()> {
    let (sender, unused) = mpsc::channel();
    let sender = calls.unwrap_or(sender);
    let over = Cell::new(false);
    let hear = move |found: Found<Call>| {
        match &found {
            Found::Message(Call::End {}) => over.set(true),
            Found::End if !over.get() => interrupt::abandon(),
            _ => {}
        }
        found
    };
    let listening = std::thread::Builder::new().name("program".into()).spawn(move || {
        // Kept, so that reading goes on to the end.
        let _unused = unused;
        lines::read_all(io::stdin().lock(), &sender, hear);
    });
    listening.map(drop).place("cannot start a thread")
}

/// Ends a run of a pipeline in Lua where the program that started it is gone.
///
/// # Errors
/// If the system does not allow it.
pub fn follow() -> Result<()> {
    listen(None)
}

/// Does what a program calls, until it is at its end or gone. `program` is the file that calls, for the record.
///
/// # Errors
/// If nothing could be begun: the file cannot be read, or no worker can be started.
pub fn serve(program: Option<PathBuf>, options: Options) -> Result<Finished> {
    let (sender, calls) = mpsc::channel();
    let script = match program {
        Some(file) => Script::read(&file)?,
        None => Script::without_text("session"),
    };
    listen(Some(sender))?;
    let host = start(script, Box::new(|_| Vec::new()), options)?;
    tell(&Told::Ready { protocol: VERSION, pdk: env!("CARGO_PKG_VERSION"), slots: host.slots() });
    let mut server = Server { defaults: host.defaults(), host, scoring: None, tickets: Tickets::new("wait") };
    let ended = server.serve(&calls);
    Ok(server.host.finish(ended))
}

struct Server {
    host: Host,
    /// An evaluation whose function has a picture.
    scoring: Option<Box<Scoring>>,
    defaults: Defaults,
    tickets: Tickets,
}

impl Server {
    fn serve(&mut self, calls: &mpsc::Receiver<Found<Call>>) -> Result<()> {
        loop {
            let returned = match calls.recv_timeout(LOOK) {
                Ok(Found::Message(Call::End {})) => return stop_if_dropped(),
                Ok(Found::End) | Err(RecvTimeoutError::Disconnected) => return Err(interrupt::error()),
                Err(RecvTimeoutError::Timeout) => match interrupt::wish() {
                    Wish::Drop => return Err(interrupt::error()),
                    _ => continue,
                },
                Ok(Found::Message(call)) => self.call(call),
                Ok(Found::Nonsense(error, _)) => Err(Error::of(
                    ErrorKind::Nonsense,
                    format!("what came is not a call ({error}); see docs/session-protocol.md"),
                )),
            };
            match &returned {
                Ok(value) => tell(&Told::Returned(value)),
                Err(error) => tell(&Told::Failed(Failed::from(error))),
            }
        }
    }

    fn call(&mut self, call: Call) -> Result<Value> {
        let Self { host, defaults, tickets, scoring } = self;
        match call {
            Call::Settings(Unique(given)) => host.settings(from_program(given)),
            Call::Defaults(Unique(given)) => {
                *defaults = host.defaults().read("defaults", from_program(given))?;
                Ok(Value::Null)
            }
            Call::Submit(scenarios) => {
                let one = |(number, Unique(scenario))| {
                    stop_if_dropped()?;
                    defaults.submission(&format!("scenario {number}"), from_program(scenario))
                };
                let submissions = scenarios.into_iter().enumerate().map(one).collect::<Result<Vec<_>>>()?;
                let prepared = submissions.into_iter().map(|submission| host.prepare(submission));
                let prepared = prepared.collect::<Result<Vec<_>>>()?;
                let numbers: Vec<u64> =
                    host.submit(prepared)?.into_iter().map(|ticket| tickets.add(ticket)).collect();
                Ok(json!(numbers))
            }
            Call::Wait(ticket) => {
                let outcome = tickets.wait(host, &ticket)?;
                tickets.ticket(&ticket).into_iter().for_each(|ticket| host.hand_over(ticket));
                Ok(outcome)
            }
            Call::Next {} => {
                let outcome = tickets.next(host)?;
                tickets.ticket(&outcome["ticket"]).into_iter().for_each(|ticket| host.hand_over(ticket));
                Ok(outcome)
            }
            Call::Evaluate(Unique(request)) => {
                let request = from_program(request);
                // One that failed is over.
                *scoring = None;
                match request["task"]["kind"] == "function" {
                    true => Ok(answer(Scoring::begin(host, request)?, scoring)),
                    false => host.evaluate(request),
                }
            }
            Call::Scored(returned) => {
                let under_way = scoring.take().ok_or_else(|| {
                    Error::new(
                        "`scored` has no picture; call `evaluate` with a task of the kind `function` first",
                    )
                })?;
                Ok(answer(under_way.go_on(host, returned)?, scoring))
            }
            Call::Save { name, value: Unique(value) } => {
                host.save(&name.into(), &value).map(|()| Value::Null)
            }
            Call::Road(Unique(request)) => host.road(from_program(request)),
            Call::Rate(Unique(simulator)) => {
                Ok(host.rate(&ComponentSpec::from_json("simulator", &from_program(simulator))?)?.into())
            }
            Call::Catalog {} => host.catalog(),
            Call::End {} => Ok(Value::Null),
        }
    }
}

/// What a program gets of an evaluation with a function of its own.
fn answer(step: Step, scoring: &mut Option<Box<Scoring>>) -> Value {
    match step {
        Step::Picture(under_way, seen) => {
            *scoring = Some(under_way);
            json!({ "seen": seen })
        }
        Step::Finished(result) => result,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_are_read_and_others_are_refused() {
        let read = |text: &str| serde_json::from_str::<Call>(text).map(|call| format!("{call:?}"));
        assert_eq!(read(r#"{"next":{}}"#).unwrap(), "Next");
        assert_eq!(read(r#"{"wait":3}"#).unwrap(), "Wait(Number(3))");
        assert!(
            read(r#"{"submit":[{"seed":18446744073709551615}]}"#).unwrap().contains("18446744073709551615")
        );
        for wrong in [
            r#"{"submit":[{"a":{"b":1,"b":2}}]}"#,
            r#"{"nxt":{}}"#,
            r#"{"submit":{}}"#,
            r#"{"save":{"name":"a.json"}}"#,
            r#"{"next":{"a":1}}"#,
            "3",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
