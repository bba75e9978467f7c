//! Stands in for a simulator: the embedded simulator behind the protocol of another one, for tests of its adapter.
//!
//! `stand_in donkey PORT [OPTION VALUE]...` listens at the port, `stand_in udacity PORT [OPTION VALUE]...` connects to it.
//!
//! | option | value |
//! |---|---|
//! | `--build` | the build that it is, as the adapter calls it |
//! | `--rate` | frames a second that it sends by itself, by the clock; without it, it moves on by one frame for each control |
//! | `--home` | where its road begins, in its coordinates: `x,y,z` |
//! | `--seeds` | a `scenarios.jsonl` that says which seed belongs to which road, so that the same world is seen as there |
//! | `--polls` | `3` or `4`: begins with HTTP long polling, in this version of Engine.IO (`udacity`) |
//! | `--numbers` | `german`: numbers have decimal commas |
//! | `--fault` | `NAME` or `NAME:SECONDS`: what goes wrong |
//! | `--at` | after how many controls of a drive; 20 if it is not said |
//! | `--times` | how often; once if it is not said |
//!
//! | fault | what happens |
//! |---|---|
//! | `close` | hangs up, and is there again at once, or after this many seconds |
//! | `die` | ends |
//! | `hang` | says nothing any more, and takes nothing |
//! | `half` | hangs up in the middle of a message |
//! | `garbage` | sends what is not a message |
//! | `flood` | sends a message of 100 MB |
//! | `freeze` | stands still for this many seconds, and goes on (`udacity`) |

#![allow(clippy::unwrap_used)]

mod donkey;
mod fault;
mod picture;
mod udacity;
mod world;

use std::path::PathBuf;

use fault::Faults;

/// What it has to do.
pub struct Options {
    /// Where it listens or connects.
    pub port: u16,
    /// The build that it is.
    pub build: String,
    /// Frames a second by the clock.
    pub rate: Option<f64>,
    /// Where its road begins.
    pub home: [f64; 3],
    /// Which seed belongs to which road.
    pub seeds: Option<PathBuf>,
    /// Whether numbers have decimal commas.
    pub german: bool,
    /// The version of Engine.IO in which it begins with long polling.
    pub polls: Option<u8>,
    /// What goes wrong.
    pub faults: Faults,
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let which = arguments.next().expect("donkey or udacity");
    let port = arguments.next().expect("a port").parse().expect("a port");
    let mut options = Options {
        port,
        build: String::new(),
        rate: None,
        home: [51.0, 0.6, 50.0],
        seeds: None,
        german: false,
        polls: None,
        faults: Faults::default(),
    };
    while let Some(option) = arguments.next() {
        let value = arguments.next().expect("a value for each option");
        match option.as_str() {
            "--build" => options.build = value,
            "--rate" => options.rate = Some(value.parse().unwrap()),
            "--home" => {
                options.home =
                    value.split(',').map(|n| n.parse().unwrap()).collect::<Vec<_>>().try_into().unwrap();
            }
            "--seeds" => options.seeds = Some(value.into()),
            "--numbers" => options.german = value == "german",
            "--polls" => options.polls = Some(value.parse().unwrap()),
            "--fault" => options.faults.name(&value),
            "--at" => options.faults.at = value.parse().unwrap(),
            "--times" => options.faults.left = value.parse().unwrap(),
            other => panic!("there is no option {other}"),
        }
    }
    match which.as_str() {
        "donkey" => donkey::run(options),
        "udacity" => udacity::run(options),
        other => panic!("there is no stand-in for {other}"),
    }
}
