//! Makes a scenario that failed as small as it can be and still fail: a shorter chain, lower intensities, a simpler and shorter road, a
//! shorter drive. Then says how often what is left fails with other random draws.
//!
//! A smaller scenario counts as one that still fails where it ends for the same cause. Everything is tried under the scenario's own
//! seed; what depends on luck shows in the share of fresh seeds under which the result fails. Attempts that do not depend on each
//! other are driven together, and of those that still fail the first is taken, so that the result does not depend on the number of
//! workers.

use indicatif::ProgressBar;
use pdk_model::canonical::canonical;
use pdk_model::level::Level;
use pdk_model::level_scale::LevelScale;
use pdk_model::outcome::{Cause, Outcome};
use pdk_model::scenario::Scenario;
use pdk_record::ledger::Line;
use pdk_sdk::error::Result;
use pdk_sdk::seed;
use pdk_session::session::Session;
use pdk_statistics::estimate::{CONFIDENCE, Estimate};
use pdk_statistics::share::share;
use serde_json::Value;

use crate::drives;

/// Duration is reported in steps of this, in seconds.
const TENTH: f64 = 0.1;
/// A road has at least this many nodes.
const FEWEST_NODES: usize = 2;

/// What a scenario was shrunk to.
#[derive(Debug, Clone)]
pub struct Shrunk {
    /// What is left.
    pub scenario: Scenario,
    /// Its outcome.
    pub outcome: Outcome,
    /// What was made smaller, one clause each.
    pub steps: Vec<String>,
    /// How many attempts it took.
    pub attempts: usize,
    /// Under how many fresh seeds it failed, and how many drives say so: those in which no component failed.
    pub failed: (usize, usize),
}

/// The lowest level on a scale.
fn lowest(scale: Option<&LevelScale>) -> f64 {
    match scale {
        Some(LevelScale::Measured(measured)) => measured.reach().map_or(0.0, |(low, _)| low),
        _ => 0.0,
    }
}

/// How far to go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// How near an intensity comes to the lowest that fails.
    pub precision: f64,
    /// How many fresh seeds are tried at the end.
    pub draws: usize,
}

/// Shrinks a recorded scenario.
///
/// # Errors
/// If it did not fail, does not any more, or was driven in real time, or if the session cannot go on.
pub fn shrink(session: &mut Session, line: &Line, limits: Limits, progress: &ProgressBar) -> Result<Shrunk> {
    drives::check_failed(line, "shrink")?;
    drives::check_lockstep(line, "nothing can be shrunk")?;
    let mut shrinking = Shrinking {
        session,
        cause: line.outcome.cause,
        scenario: line.scenario.clone(),
        outcome: line.outcome.clone(),
        steps: Vec::new(),
        attempts: 0,
        progress,
    };
    let again = shrinking.drive(vec![line.scenario.clone()])?.remove(0);
    drives::check_same_cause(line, &again)?;
    shrinking.outcome = again;
    shrinking.chain()?;
    shrinking.intensities(limits.precision)?;
    shrinking.road()?;
    // A simpler road may fail with less.
    shrinking.chain()?;
    shrinking.intensities(limits.precision)?;
    shrinking.duration()?;
    let failed = shrinking.fresh(limits.draws)?;
    let Shrinking { scenario, outcome, steps, attempts, .. } = shrinking;
    Ok(Shrunk { scenario, outcome, steps, attempts, failed })
}

struct Shrinking<'a> {
    session: &'a mut Session,
    cause: Cause,
    scenario: Scenario,
    outcome: Outcome,
    steps: Vec<String>,
    attempts: usize,
    progress: &'a ProgressBar,
}

impl Shrinking<'_> {
    /// Drives scenarios, and returns their outcomes in the same order.
    fn drive(&mut self, scenarios: Vec<Scenario>) -> Result<Vec<Outcome>> {
        self.attempts += scenarios.len();
        self.progress.set_message(format!("{} drives", self.attempts));
        drives::outcomes(self.session, scenarios, self.progress)
    }

    /// Takes the first of these that still fails, with what it is called. Whether there is one.
    fn take_first(&mut self, smaller: Vec<(Scenario, String)>) -> Result<bool> {
        let outcomes = self.drive(smaller.iter().map(|(scenario, _)| scenario.clone()).collect())?;
        let found = smaller.into_iter().zip(outcomes).find(|(_, outcome)| outcome.cause == self.cause);
        let Some(((scenario, step), outcome)) = found else { return Ok(false) };
        (self.scenario, self.outcome) = (scenario, outcome);
        self.steps.push(step);
        Ok(true)
    }

    /// Leaves out perturbations that are not needed.
    fn chain(&mut self) -> Result<()> {
        loop {
            let without = |place: usize| {
                let mut scenario = self.scenario.clone();
                let left_out = scenario.perturbations.remove(place);
                (scenario, format!("{} is not needed", left_out.short_name()))
            };
            let smaller: Vec<_> = (0..self.scenario.perturbations.len()).map(without).collect();
            if smaller.is_empty() || !self.take_first(smaller)? {
                return Ok(());
            }
        }
    }

    /// Lowers intensities that do not change over time: halves the interval in which failing begins.
    fn intensities(&mut self, precision: f64) -> Result<()> {
        for place in 0..self.scenario.perturbations.len() {
            let Level::Constant(before) = self.scenario.perturbations[place].level else { continue };
            let at = |scenario: &Scenario, level: f64| {
                let mut scenario = scenario.clone();
                scenario.perturbations[place].level = Level::Constant(level);
                scenario
            };
            let least = lowest(self.scenario.perturbations[place].level_scale.as_ref());
            let (mut passes, mut fails) = (least, before);
            let weakest = at(&self.scenario, least);
            if before > least && self.fails(weakest)? {
                fails = least;
            }
            while fails - passes > precision {
                let middle = (fails + passes) / 2.0;
                match self.fails(at(&self.scenario, middle))? {
                    true => fails = middle,
                    false => passes = middle,
                }
            }
            if fails < before {
                let name = &self.scenario.perturbations[place].name;
                self.steps.push(format!("{name} at {} instead of {}", short(fails), short(before)));
            }
        }
        Ok(())
    }

    /// Whether a scenario still fails; then it takes the place of that before.
    fn fails(&mut self, scenario: Scenario) -> Result<bool> {
        let outcome = self.drive(vec![scenario.clone()])?.remove(0);
        let fails = outcome.cause == self.cause;
        if fails {
            (self.scenario, self.outcome) = (scenario, outcome);
        }
        Ok(fails)
    }

    /// Cuts the road off behind and before the failure, and makes what is left straight if that changes nothing. Only roads of
    /// angles can be simplified.
    fn road(&mut self) -> Result<()> {
        let Some(mut angles) = self.angles() else { return Ok(()) };
        let segments = angles.len();
        for from_the_end in [true, false] {
            while angles.len() > FEWEST_NODES {
                let mut shorter = angles.clone();
                let place = if from_the_end { shorter.len() - 1 } else { 0 };
                shorter.remove(place);
                let Some(scenario) = self.with_angles(&shorter, Some(place)) else { break };
                if !self.fails(scenario)? {
                    break;
                }
                angles = shorter;
            }
        }
        if angles.len() < segments {
            self.steps.push(format!("a road of {} nodes instead of {segments}", angles.len()));
        }
        for place in 0..angles.len() {
            if angles[place] == 0.0 {
                continue;
            }
            let mut simpler = angles.clone();
            simpler[place] = 0.0;
            let Some(scenario) = self.with_angles(&simpler, None) else { continue };
            if self.fails(scenario)? {
                self.steps.push(format!(
                    "straight at node {} instead of {} degrees",
                    place + 1,
                    angles[place]
                ));
                angles = simpler;
            }
        }
        Ok(())
    }

    fn angles(&self) -> Option<Vec<f64>> {
        self.scenario.road.get("angles")?.as_array()?.iter().map(Value::as_f64).collect()
    }

    /// The scenario on a road with other angles; `removed` is the node that is gone, and its segment with it.
    fn with_angles(&self, angles: &[f64], removed: Option<usize>) -> Option<Scenario> {
        let mut scenario = self.scenario.clone();
        let road = scenario.road.as_object_mut()?;
        road.insert("angles".into(), angles.iter().copied().map(number).collect());
        if let (Some(place), Some(Value::Array(segments))) = (removed, road.get_mut("segment"))
            && place < segments.len()
        {
            segments.remove(place);
        }
        Some(scenario)
    }

    /// Lets the drive end soon after it failed.
    fn duration(&mut self) -> Result<()> {
        if self.cause == Cause::TimeOut {
            return Ok(());
        }
        let duration = ((self.outcome.time / TENTH).ceil() + 1.0) * TENTH;
        // As it is read.
        let duration = (duration * 10.0).round() / 10.0;
        if duration >= self.scenario.duration {
            return Ok(());
        }
        let before = self.scenario.duration;
        let scenario = Scenario { duration, ..self.scenario.clone() };
        self.take_first(vec![(scenario, format!("{duration} s instead of {before} s"))]).map(drop)
    }

    /// Under how many of the fresh seeds it fails, of those under which no component failed, which says nothing about it.
    fn fresh(&mut self, draws: usize) -> Result<(usize, usize)> {
        let (seed, road) = (self.scenario.seed, canonical(&self.scenario.road));
        let seeds: Vec<u64> =
            (1..=draws as u64).map(|repeat| seed::of_scenario(seed, &road, repeat)).collect();
        let scenarios = seeds.into_iter().map(|seed| Scenario { seed, ..self.scenario.clone() }).collect();
        let outcomes = self.drive(scenarios)?;
        let judged = || outcomes.iter().filter(|outcome| outcome.cause != Cause::Error);
        Ok((judged().filter(|outcome| !outcome.success).count(), judged().count()))
    }
}

/// A level as people read it.
fn short(level: f64) -> f64 {
    (level * 1000.0).round() / 1000.0
}

/// A whole number without a point.
fn number(value: f64) -> Value {
    if value.fract() == 0.0 && value.abs() < 1e15 { Value::from(value as i64) } else { Value::from(value) }
}

/// Under how many of the fresh seeds what is left fails, and the probability of failing, in words; empty if none was tried.
pub fn luck(shrunk: &Shrunk) -> String {
    let (failed, all) = shrunk.failed;
    share(failed as u64, all as u64, CONFIDENCE).map_or_else(String::new, |Estimate { low, high, .. }| {
        format!(
            "With other random draws it fails in {failed} of {all} drives; the probability of failure is {low:.2} to {high:.2} ({:.0} %)",
            100.0 * CONFIDENCE
        )
    })
}

/// A pipeline that drives a scenario, for anyone to run. `more` says what else there is to know of it, without a full stop; may be empty.
///
/// # Errors
/// If the scenario cannot be JSON.
pub fn script(scenario: &Scenario, outcome: &Outcome, more: &str, name: &str) -> Result<String> {
    let more = if more.is_empty() { String::new() } else { format!("\n-- {more}.") };
    // Whatever a scenario holds is a field of it in a pipeline too.
    let fields = serde_json::to_value(scenario)?;
    let field = |(name, value): (&String, &Value)| {
        let value = match (name.as_str(), value) {
            ("simulator" | "driver", value) => component(value),
            ("perturbations", Value::Array(list)) => {
                let list: Vec<String> =
                    list.iter().map(|one| format!("\t\t\t{},\n", component(one))).collect();
                format!("{{\n{}\t\t}}", list.concat())
            }
            (_, value) => lua(value),
        };
        format!("\t\t{} = {value},\n", key(name))
    };
    // A pipeline names files, and pdk notes what is in them.
    let fields = fields.as_object().into_iter().flatten().filter(|(name, _)| *name != "files");
    let fields: Vec<String> = fields.map(field).collect();
    Ok(format!(
        "-- {}: {} after {:.2} s.{more}\n--\n--   pdk run {name}\n\npdk.show(pdk.drive({{\n\timages_every = 1,\n\tscenarios = {{ \
         {{\n{}\t}} }},\n}}))\n",
        scenario.default_name(),
        outcome.cause.text(),
        outcome.time,
        fields.concat(),
    ))
}

/// A component as a pipeline writes it: a name, or a table with its parameters beside its name.
fn component(value: &Value) -> String {
    let mut table = value.as_object().cloned().unwrap_or_default();
    if let Some(Value::Object(parameters)) = table.shift_remove("parameters") {
        table.extend(parameters);
    }
    match table.get("name") {
        Some(name) if table.len() == 1 => lua(name),
        _ => lua(&Value::Object(table)),
    }
}

/// A value as Lua writes it.
fn lua(value: &Value) -> String {
    match value {
        Value::Null => "nil".to_owned(),
        Value::Array(list) => format!("{{ {} }}", list.iter().map(lua).collect::<Vec<_>>().join(", ")),
        Value::Object(table) => {
            let field = |(name, value): (&String, &Value)| format!("{} = {}", key(name), lua(value));
            format!("{{ {} }}", table.iter().map(field).collect::<Vec<_>>().join(", "))
        }
        Value::String(words) => text(words),
        // A whole number as a whole one.
        Value::Number(value) => value.as_f64().map_or_else(
            || value.to_string(),
            |float| match value.as_u64() {
                Some(whole) => whole.to_string(),
                None => number(float).to_string(),
            },
        ),
        Value::Bool(value) => value.to_string(),
    }
}

/// The name of a field.
fn key(name: &str) -> String {
    let plain = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && !RESERVED.contains(&name);
    if plain { name.to_owned() } else { format!("[{}]", text(name)) }
}

/// Words that are not names in Luau.
const RESERVED: [&str; 21] = [
    "and", "break", "do", "else", "elseif", "end", "false", "for", "function", "if", "in", "local", "nil",
    "not", "or", "repeat", "return", "then", "true", "until", "while",
];

fn text(words: &str) -> String {
    let mut quoted = String::from('"');
    for c in words.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            '\n' => quoted.push_str("\\n"),
            c if c.is_control() => quoted.push_str(&format!("\\u{{{:x}}}", u32::from(c))),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_are_written_as_lua() {
        let value = json!({"road": {"angles": [0, -12.5, 3.0]}, "a-b": "say \"x\"\n", "end": true});
        assert_eq!(
            lua(&value),
            r#"{ road = { angles = { 0, -12.5, 3 } }, ["a-b"] = "say \"x\"\n", ["end"] = true }"#
        );
    }
}
