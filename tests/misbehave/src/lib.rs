//! A plugin whose only work is to misbehave: one component of each kind, all named `misbehave`, with a parameter `how`.
//!
//! Every function that pdk calls can panic, hang or end the process: `panic_in_apply`, `hang_in_new`, `exit_in_drop`.
//! Beyond that each kind has ways of its own to return something wrong. Without `how` a component behaves.
//!
//! The description itself misbehaves where the environment variable `MISBEHAVE` says so: `panic_in_describe`.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

mod dataset;
mod driver;
mod perturbation;
mod saliency;
mod search;
mod simulator;

pdk_sdk::export! {
    perturbations: [perturbation::Misbehaving],
    simulators: [simulator::Misbehaving],
    drivers: [driver::Misbehaving],
    saliencies: [saliency::Misbehaving],
    searches: [search::Misbehaving],
    datasets: [dataset::Misbehaving],
}

/// Who behaves.
const BEHAVE: &str = "behave";

/// How a component misbehaves, and where.
struct Manner {
    how: String,
    /// The only frame at which it does; at all of them where there is none.
    only_at: Option<u64>,
}

impl Manner {
    fn new(config: &Config) -> Self {
        let manner =
            Self { how: config.text("how").to_owned(), only_at: u64::try_from(config.integer("at")).ok() };
        manner.reach("new");
        manner
    }

    /// Whether it misbehaves in this way.
    fn is(&self, how: &str) -> bool {
        self.how == how
    }

    /// Misbehaves if this function is where it does.
    fn reach(&self, function: &str) {
        misbehave(&self.how, function);
    }

    /// Misbehaves if this function and frame are where it does.
    fn reach_frame(&self, function: &str, frame: u64) {
        if self.only_at.is_none_or(|only| only == frame) {
            self.reach(function);
        }
    }
}

/// Misbehaves in one of the ways that every function can, if `how` names this function.
fn misbehave(how: &str, function: &str) {
    match how.split_once("_in_") {
        Some(("panic", place)) if place == function => panic!("as asked to in `{function}`"),
        Some(("exit", place)) if place == function => std::process::exit(0),
        Some(("hang", place)) if place == function => loop {
            std::thread::sleep(std::time::Duration::from_secs(3600));
        },
        _ => {}
    }
}

/// The parameters of a component that can misbehave in all of `functions` and in `own` ways, with an example for
/// `pdk check` of everything but hanging, which it shows in the last of `functions` only.
fn describe(mut description: Description, functions: &[&str], own: &[&str]) -> Description {
    misbehave(&std::env::var("MISBEHAVE").unwrap_or_default(), "describe");
    let everywhere = |way: &str| functions.iter().map(|f| format!("{way}_in_{f}")).collect::<Vec<_>>();
    let hang_in_last = everywhere("hang").pop();
    let examples = [vec![BEHAVE.to_owned()], everywhere("panic"), everywhere("exit")].concat();
    let examples = examples.into_iter().chain(hang_in_last).chain(own.iter().map(|&how| how.to_owned()));
    // A frame of that size takes too long and too much memory to check by the way.
    for how in examples.filter(|how| how != "large_camera") {
        description = description.example(json!({ "how": how }));
    }
    let options =
        [vec![BEHAVE.to_owned()], everywhere("panic"), everywhere("exit"), everywhere("hang")].concat();
    let options: Vec<_> = options.iter().map(String::as_str).chain(own.iter().copied()).collect();
    description
        .not_default()
        .parameter(Parameter::choice("how", &options, "how it misbehaves"))
        .parameter(Parameter::integer("at", -1, "the only frame at which it does; -1 for all"))
}
