//! What a search found: as a value for the pipeline and the record, and as a table of all candidates.

use std::fmt::Write;

use pdk_model::search::{Problem, Space, label};
use pdk_statistics::hypervolume::hypervolume;
use pdk_statistics::point::Point;
use pdk_statistics::ranking::dominates;
use pdk_statistics::tree::{Limits, PUBLISHED, Tree, words};
use serde_json::{Map, Value, json};

use crate::search::trials::{State, Trials};

/// Points on curves over the evaluations.
const CHECKPOINTS: usize = 40;
/// Two failures are distinct if they are farther apart than this, in shares of the ranges: see [`Space::distance`].
const DISTINCT: f64 = 0.1;
/// When the tree of critical regions is split: as published, but for searches in which little is critical.
const LIMITS: Limits = Limits { split_share: 0.02, decrease: 0.01, balanced: true, ..PUBLISHED };

/// The best of what was evaluated so far.
pub struct Front {
    maximised: Vec<bool>,
    reference: Option<Vec<f64>>,
    /// The members, with their numbers.
    members: Vec<(usize, Point)>,
}

impl Front {
    /// Nothing yet.
    pub fn new(problem: &Problem, maximised: &[bool], reference: Option<&[f64]>) -> Self {
        debug_assert_eq!(problem.objectives.len(), maximised.len());
        let turned = reference.map(|reference| turned(reference, maximised));
        Self { maximised: maximised.to_vec(), reference: turned, members: Vec::new() }
    }

    /// Looks at a candidate whose result is known. Whether it is better than what there was.
    pub fn add(&mut self, trials: &Trials, number: usize) -> bool {
        let Some(point) = point(trials, number, &self.maximised) else { return false };
        let covers = |other: &Point| dominates(other, &point) || other.f == point.f;
        if point.violation > 0.0 || self.members.iter().any(|(_, other)| covers(other)) {
            return false;
        }
        self.members.retain(|(_, other)| !dominates(&point, other));
        self.members.push((number, point));
        true
    }

    /// The volume that it dominates up to the reference; 0 without one.
    pub fn hypervolume(&self) -> f64 {
        let Some(reference) = &self.reference else { return 0.0 };
        let values: Vec<Vec<f64>> = self.members.iter().map(|(_, point)| point.f.clone()).collect();
        hypervolume(&values, reference)
    }
}

/// What there is to tell of a search.
pub struct Summary<'a> {
    /// Its name.
    pub name: &'a str,
    /// The strategy with its parameters.
    pub strategy: Value,
    /// Whether the strategy learns nothing, so that others are compared with it.
    pub baseline: bool,
    /// Its seed.
    pub seed: u64,
    /// Why it ended.
    pub stopped: &'static str,
    /// What was searched.
    pub problem: &'a Problem,
    /// Whether each objective is maximised.
    pub maximised: &'a [bool],
    /// All candidates.
    pub trials: &'a Trials,
    /// How many could not be evaluated.
    pub failures: u64,
    /// The best.
    pub front: &'a Front,
}

/// Everything that was found.
pub fn found(summary: &Summary<'_>) -> Value {
    let Summary { problem, trials, maximised, .. } = summary;
    // What has not been told is not part of the result: how much that is depends on the number of workers.
    let told = trials.told();
    let finished = &trials.all()[..told];
    // Each evaluation once.
    let numbers: Vec<usize> = (0..told).filter(|&n| !matches!(finished[n].state, State::Same(_))).collect();
    let evaluated: Vec<(usize, Point)> =
        numbers.iter().filter_map(|&number| Some((number, point(trials, number, maximised)?))).collect();
    let critical: Vec<&(usize, Point)> = evaluated.iter().filter(|(_, point)| point.critical).collect();
    let distinct = distinct(&problem.space, &critical);
    let tests: Vec<Value> = (0..told).map(|number| test(summary, number)).collect();
    let objectives: Vec<Value> = problem
        .objectives
        .iter()
        .zip(*maximised)
        .map(|(name, maximised)| json!({"name": name, "direction": if *maximised { "maximise" } else { "minimise" }}))
        .collect();
    // Within one search this says how it went; searches can be compared where a reference was given.
    let own_reference = summary.front.reference.clone().or_else(|| worst(&evaluated));
    let mut found = json!({
        "name": summary.name,
        "strategy": summary.strategy,
        "seed": summary.seed,
        "space": problem.space,
        "objectives": objectives,
        "stopped": summary.stopped,
        "evaluations": finished.iter().filter(|trial| trial.counted).count(),
        "proposed": told,
        "duplicates": finished.iter().filter(|trial| trial.same_as.is_some()).count(),
        "failures": summary.failures,
        "critical": critical.len(),
        "first_critical": evaluated.iter().position(|(_, point)| point.critical).map(|place| place + 1),
        "distinct_failures": distinct,
        "front": summary.front.members.iter().map(|(number, _)| *number).collect::<Vec<_>>(),
        "hypervolume_reference": summary.front.reference.as_ref().map(|reference| turned(reference, maximised)),
        "convergence": convergence(&problem.space, &evaluated, own_reference.as_deref()),
        "tree": tree(&problem.space, &evaluated),
        "tests": tests,
    });
    if summary.baseline {
        found["baseline"] = Value::Bool(true);
    }
    found
}

/// Every candidate, a line each, with commas between the columns.
pub fn table(summary: &Summary<'_>) -> String {
    let Summary { problem, trials, .. } = summary;
    let variables = problem.space.variables.iter().map(|variable| variable.name.as_str());
    let objectives = problem.objectives.iter().map(String::as_str);
    let columns: Vec<&str> = ["number"]
        .into_iter()
        .chain(variables)
        .chain(objectives)
        .chain(["violation", "critical", "same_as", "failure", "cause", "verdict", "scenario"])
        .collect();
    let mut text = String::new();
    line(&mut text, columns.iter().map(|column| harmless(column)));
    for number in 0..trials.told() {
        let test = test(summary, number);
        let field = |value: &Value| match value {
            Value::Null => String::new(),
            Value::String(text) => harmless(text),
            value => label(value),
        };
        let variable = |name: &String| field(&test["values"][name]);
        let cells = [field(&test["number"])]
            .into_iter()
            .chain(problem.space.variables.iter().map(|v| variable(&v.name)))
            .chain(problem.objectives.iter().map(|name| field(&test["objectives"][name])))
            .chain(
                ["violation", "critical", "same_as", "failure", "cause", "verdict", "scenario"]
                    .map(|name| field(&test[name])),
            );
        line(&mut text, cells);
    }
    text
}

/// A text that spreadsheets would take for a formula, with an apostrophe before it, which they take for a text. Numbers stay numbers.
fn harmless(text: &str) -> String {
    match text.starts_with(['=', '+', '-', '@', '\t', '\r']) && text.parse::<f64>().is_err() {
        true => format!("'{text}"),
        false => text.to_owned(),
    }
}

fn line(text: &mut String, cells: impl Iterator<Item = String>) {
    for (place, cell) in cells.enumerate() {
        if place > 0 {
            text.push(',');
        }
        // RFC 4180.
        match cell.contains([',', '"', '\n', '\r']) {
            // Writing to a string does not fail.
            true => _ = write!(text, "\"{}\"", cell.replace('"', "\"\"")),
            false => text.push_str(&cell),
        }
    }
    text.push_str("\r\n");
}

/// The result of a candidate, as a strategy receives it.
fn test(summary: &Summary<'_>, number: usize) -> Value {
    let trial = &summary.trials.all()[number];
    let mut test = Map::new();
    test.insert("number".into(), number.into());
    test.insert("values".into(), Value::Object(trial.values.clone()));
    let Some(verdict) = summary.trials.verdict(number) else { return Value::Object(test) };
    if let Some(values) = &verdict.objectives {
        let named =
            summary.problem.objectives.iter().cloned().zip(values.iter().map(|value| Value::from(*value)));
        test.insert("objectives".into(), Value::Object(named.collect()));
    }
    let violation: f64 = verdict.violations.iter().map(|violation| violation.max(0.0)).sum();
    if violation > 0.0 {
        test.insert("violation".into(), violation.into());
    }
    test.insert("critical".into(), verdict.critical.into());
    if let Some(first) = trial.same_as {
        test.insert("same_as".into(), first.into());
    }
    if let Some(failure) = &verdict.failure {
        test.insert("failure".into(), failure.as_str().into());
    }
    if let Some(outcome) = &verdict.outcome {
        test.insert("cause".into(), outcome["cause"].clone());
        test.insert("verdict".into(), outcome["verdict"].clone());
        test.insert("scenario".into(), outcome["id"].clone());
    }
    Value::Object(test)
}

/// A candidate that was evaluated as numbers, with all objectives to be minimised.
fn point(trials: &Trials, number: usize, maximised: &[bool]) -> Option<Point> {
    let verdict = trials.verdict(number)?;
    let values = verdict.objectives.as_ref()?;
    let violation = verdict.violations.iter().map(|violation| violation.max(0.0)).sum();
    let x = trials.all()[number].positions.clone()?;
    Some(Point { x, f: turned(values, maximised), violation, critical: verdict.critical })
}

/// Objectives with the sign that makes smaller better, or back.
fn turned(values: &[f64], maximised: &[bool]) -> Vec<f64> {
    values.iter().zip(maximised).map(|(value, maximised)| if *maximised { -value } else { *value }).collect()
}

/// The worst value of each objective among all.
fn worst(evaluated: &[(usize, Point)]) -> Option<Vec<f64>> {
    let mut all = evaluated.iter().map(|(_, point)| &point.f);
    let first = all.next()?.clone();
    Some(all.fold(first, |worst, f| worst.iter().zip(f).map(|(a, b)| a.max(*b)).collect()))
}

/// Critical candidates of which each two are farther apart than [`DISTINCT`]: the first, and each that is unlike all before it.
fn distinct(space: &Space, critical: &[&(usize, Point)]) -> Vec<usize> {
    let mut kept: Vec<&(usize, Point)> = Vec::new();
    for candidate in critical {
        if kept.iter().all(|other| space.distance(&other.1.x, &candidate.1.x) > DISTINCT) {
            kept.push(candidate);
        }
    }
    kept.iter().map(|(number, _)| *number).collect()
}

/// What was reached after how many evaluations.
fn convergence(space: &Space, evaluated: &[(usize, Point)], reference: Option<&[f64]>) -> Vec<Value> {
    let mut curve = Vec::new();
    let mut front: Vec<&Point> = Vec::new();
    let (mut critical, mut kept, mut done): (usize, Vec<&Point>, usize) = (0, Vec::new(), 0);
    for step in 1..=CHECKPOINTS.min(evaluated.len()) {
        let until = evaluated.len() * step / CHECKPOINTS.min(evaluated.len());
        for (_, point) in &evaluated[done..until] {
            critical += usize::from(point.critical);
            if point.critical && kept.iter().all(|other| space.distance(&other.x, &point.x) > DISTINCT) {
                kept.push(point);
            }
            if point.violation <= 0.0
                && !front.iter().any(|other| dominates(other, point) || other.f == point.f)
            {
                front.retain(|other| !dominates(point, other));
                front.push(point);
            }
        }
        done = until;
        let values: Vec<Vec<f64>> = front.iter().map(|point| point.f.clone()).collect();
        curve.push(json!({
            "evaluations": until,
            "hypervolume": reference.map(|reference| hypervolume(&values, reference)),
            "critical": critical,
            "distinct_failures": kept.len(),
        }));
    }
    curve
}

/// The tree of critical regions, with its leaves in words.
fn tree(space: &Space, evaluated: &[(usize, Point)]) -> Value {
    let points: Vec<&Point> = evaluated.iter().map(|(_, point)| point).collect();
    if points.is_empty() {
        return Value::Null;
    }
    let tree = Tree::new(space, &points, LIMITS);
    let node = |node: &pdk_statistics::tree::Node| {
        json!({
            "region": words(space, &node.region),
            "evaluations": node.rows.len(),
            "critical": node.critical,
            "split": node.split.map(|split| {
                let mut below = tree.nodes[0].region.clone();
                below[split.variable] = tree.nodes[split.below].region[split.variable];
                json!({ "condition": words(space, &below), "below": split.below, "above": split.above })
            }),
        })
    };
    let mut regions: Vec<&pdk_statistics::tree::Node> = tree.leaves();
    regions.retain(|leaf| leaf.share() > 0.5);
    regions.sort_by_key(|leaf| std::cmp::Reverse(leaf.critical));
    let region = |leaf: &&pdk_statistics::tree::Node| {
        json!({
            "region": words(space, &leaf.region),
            "evaluations": leaf.rows.len(),
            "critical": leaf.critical,
            "share": leaf.share(),
        })
    };
    json!({
        "nodes": tree.nodes.iter().map(node).collect::<Vec<_>>(),
        "critical_regions": regions.iter().map(region).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::trials::Admitted;
    use crate::search::verdict::Verdict;
    use pdk_model::search::{Candidate, Range, Variable};

    /// Of a search that was told five results, and has these candidates under way when it ends.
    fn after_five(under_way: &[f64], reference: Option<&[f64]>) -> Value {
        let variable = Variable { name: "x".into(), range: Range::Real { min: 0.0, max: 9.0 } };
        let space = Space { variables: vec![variable], constraints: Vec::new() };
        let problem = Problem { space, objectives: vec!["f".into()], evaluations: None };
        let mut trials = Trials::new(problem.clone(), vec![false]);
        let mut front = Front::new(&problem, &[false], reference);
        // The third is the same as the first, the last is out of range.
        for (id, x) in [5.0, 3.0, 5.0, 1.0, 20.0].iter().chain(under_way).enumerate() {
            let values = Map::from_iter([("x".to_owned(), Value::from(*x))]);
            if let Admitted::New = trials.admit(Candidate { id: id as u64, values }).unwrap() {
                trials.count(None);
                let verdict = Verdict { objectives: Some(vec![*x]), ..Verdict::default() };
                trials.complete(State::Done(verdict));
            }
        }
        for number in 0..5 {
            trials.tell().unwrap();
            front.add(&trials, number);
        }
        let (strategy, stopped) = (Value::Null, "hypervolume");
        found(&Summary {
            name: "search",
            strategy,
            baseline: false,
            seed: 0,
            stopped,
            problem: &problem,
            maximised: &[false],
            trials: &trials,
            failures: 1,
            front: &front,
        })
    }

    #[test]
    fn what_is_under_way_at_the_end_is_not_counted() {
        let found = after_five(&[], Some(&[10.0]));
        for (field, count) in [("evaluations", 3), ("proposed", 5), ("duplicates", 1)] {
            assert_eq!(found[field], count, "{field}");
        }
        assert_eq!(found.to_string(), after_five(&[7.0, 5.0, 8.0], Some(&[10.0])).to_string());
    }

    #[test]
    fn a_reference_is_reported_if_it_was_given() {
        assert_eq!(after_five(&[], Some(&[10.0]))["hypervolume_reference"], json!([10.0]));
        let without = after_five(&[], None);
        assert!(without["hypervolume_reference"].is_null());
        // Up to the worst of its own.
        assert_eq!(without["convergence"][2]["hypervolume"], 4.0);
    }
}
