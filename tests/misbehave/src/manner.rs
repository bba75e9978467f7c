//! How a component misbehaves, and where: its parameters and what it does by them.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::ending::{self, Ending};
use crate::process;

/// Who behaves.
const BEHAVE: &str = "behave";

/// Ways of which `pdk check` is shown none: they take too long or too much memory, change the process that checks, or do not repeat.
const NOT_SHOWN: [&str; 2] = ["large_camera", "draw"];

/// How a component misbehaves, and where.
pub struct Manner {
    /// The value of the parameter `how`.
    pub how: String,
    /// The only frame at which it does; at all of them if there is none.
    only_at: Option<u64>,
}

impl Manner {
    /// Reads the parameters, and misbehaves if that is if it does.
    pub fn new(config: &Config) -> Self {
        let manner =
            Self { how: config.text("how").to_owned(), only_at: u64::try_from(config.integer("at")).ok() };
        manner.reach("new");
        manner
    }

    /// Whether it misbehaves in this way.
    pub fn is(&self, how: &str) -> bool {
        self.how == how
    }

    /// Misbehaves if this function is if it does.
    pub fn reach(&self, function: &str) {
        misbehave(&self.how, function);
    }

    /// Misbehaves if this function and frame are if it does.
    pub fn reach_frame(&self, function: &str, frame: u64) {
        if self.is_at(frame) {
            self.reach(function);
        }
    }

    /// Does to the process what it is asked to, if this frame is if it does.
    pub fn disturb(&self, frame: u64) {
        if self.is_at(frame) {
            process::disturb(&self.how);
        }
    }

    fn is_at(&self, frame: u64) -> bool {
        self.only_at.is_none_or(|only| only == frame)
    }
}

/// Misbehaves in one of the ways that every function can, if `how` names this function.
fn misbehave(how: &str, function: &str) {
    match how.split_once("_in_") {
        Some((way, place)) if place == function => match way {
            "panic" => panic!("as asked to in `{function}`"),
            "hang" => loop {
                std::thread::sleep(std::time::Duration::from_secs(3600));
            },
            way => {
                if let Some(ending) = Ending::named(way) {
                    ending::end(ending);
                }
            }
        },
        _ => {}
    }
}

/// The parameters of a component that can misbehave in all of `functions` and in `own` ways. `pdk check` runs a process for
/// each example that ends it, so it is shown some of the ways for the last of `functions` only.
pub fn describe(mut description: Description, functions: &[&str], own: &[&str]) -> Description {
    misbehave(&std::env::var("MISBEHAVE").unwrap_or_default(), "describe");
    let everywhere = |way: &str| functions.iter().map(|f| format!("{way}_in_{f}")).collect::<Vec<_>>();
    let in_all = ["panic", "exit", "abort"].map(everywhere).concat();
    let in_last = ["hang", "segfault", "kill", "quit"].map(everywhere);
    let own: Vec<_> = own.iter().map(|&how| how.to_owned()).collect();
    let behave = vec![BEHAVE.to_owned()];

    let last = in_last.iter().filter_map(|ways| ways.last().cloned()).collect();
    let shown = [behave.clone(), in_all.clone(), last, own.clone()].concat();
    let hidden = |how: &str| NOT_SHOWN.contains(&how) || process::WAYS.contains(&how);
    for how in shown.iter().filter(|how| !hidden(how)) {
        description = description.example(json!({ "how": how }));
    }
    let options = [behave, in_all, in_last.concat(), own].concat();
    let options: Vec<_> = options.iter().map(String::as_str).collect();
    description
        .not_default()
        .parameter(Parameter::choice("how", &options, "how it misbehaves"))
        .parameter(Parameter::integer("at", -1, "the only frame at which it does; -1 for all"))
}
