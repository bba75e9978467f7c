//! Scenarios as test cases of JUnit XML, which the services that run tests show.

use minijinja::{AutoEscape, Environment, UndefinedBehavior, context};
use pdk_model::outcome::{Cause, Verdict};
use pdk_record::ledger::Line;
use pdk_sdk::error::{Error, Result};

const NAME: &str = "junit.xml";

/// The scenarios of a run of this name. A driver that failed is a failure, and a component that failed an error.
///
/// # Errors
/// If the file cannot be made.
pub fn junit(name: &str, lines: &[Line], replay: &dyn Fn(usize) -> String) -> Result<String> {
    let count = |of: &dyn Fn(&Line) -> bool| lines.iter().filter(|line| of(line)).count();
    let place = |error: minijinja::Error| Error::new(format!("cannot make the JUnit file ({error:#})"));
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.set_trim_blocks(true);
    environment.set_lstrip_blocks(true);
    environment.add_template(NAME, include_str!("template/junit.xml")).map_err(place)?;
    let cases: Vec<_> = lines
        .iter()
        .enumerate()
        .map(|(number, line)| {
            let outcome = &line.outcome;
            let kind = match outcome.cause.verdict() {
                Verdict::Passed => "",
                Verdict::Void => "error",
                Verdict::Unsafe | Verdict::Stopped | Verdict::Late => "failure",
            };
            context! {
                name => written(&format!("{number}: {}", line.name)),
                class => written(&format!("{name}.{}.{}", line.scenario.simulator.name, line.scenario.driver.name)),
                time => outcome.time,
                kind,
                cause => outcome.cause.text(),
                message => written(&match &outcome.error {
                    Some(error) => error.clone(),
                    None => format!(
                        "{} after {:.2} s, {:.0} % of the road; largest cross-track error {:.3} m",
                        outcome.cause.text(), outcome.time, 100.0 * outcome.progress, outcome.max_cross_track_error
                    ),
                }),
                id => line.id.to_string(),
                replay => written(&replay(number)),
            }
        })
        .collect();
    let page = context! {
        name => written(name),
        tests => lines.len(),
        failures => count(&|line| line.outcome.cause.verdict().failed()),
        errors => count(&|line| line.outcome.cause == Cause::Error),
        time => lines.iter().map(|line| line.outcome.time).sum::<f64>(),
        cases,
    };
    environment.get_template(NAME).and_then(|template| template.render(page)).map_err(place)
}

/// A text without what XML 1.0 cannot hold, escaped or not.
fn written(text: &str) -> String {
    let holds = |letter: char| {
        matches!(letter, '\t' | '\n' | '\r')
            || (letter >= ' ' && !('\u{fffe}'..='\u{ffff}').contains(&letter))
    };
    text.chars().map(|letter| if holds(letter) { letter } else { '\u{fffd}' }).collect()
}
