//! What a pipeline sees of a scenario that it submitted.

use pdk_model::described::value;
use pdk_model::outcome::{Outcome, Verdict};
use pdk_model::scenario::ScenarioId;
use pdk_sdk::describe::Kind;
use serde_json::{Value, json};

/// The cause of a scenario that another part of the run drives.
pub(crate) const ELSEWHERE: &str = "elsewhere";

/// A scenario that was submitted.
#[derive(Debug, Clone)]
pub(crate) struct Submitted {
    /// Its number in the run, which is its place in the ledger in the end.
    pub number: usize,
    /// What tells it from others.
    pub id: ScenarioId,
    /// What the pipeline calls it this time.
    pub name: Box<str>,
    /// How many frames it may have.
    pub expected: u64,
    /// The driver, if there are no perturbations.
    pub unperturbed: Option<Box<str>>,
    /// Its components that went wrong when they were made, by kind and what they are made from.
    pub fatal: Box<[(Kind, String)]>,
}

/// What a pipeline and the summary see of an outcome.
pub(crate) fn outcome_row(outcome: &Outcome, submitted: &Submitted) -> Value {
    row(submitted, value(&outcome.cause), outcome.cause.verdict(), outcome)
}

/// What a pipeline sees of a scenario that another part of the run drives: the fields of an outcome, which say nothing.
pub(crate) fn row_of_elsewhere(submitted: &Submitted) -> Value {
    row(submitted, ELSEWHERE.into(), Verdict::Void, &Outcome::default())
}

fn row(submitted: &Submitted, cause: Value, verdict: Verdict, outcome: &Outcome) -> Value {
    let Submitted { number, id, name, .. } = submitted;
    let mut row = json!({"number": number, "id": id, "name": name});
    for (field, own) in outcome.values().into_iter().filter(|(field, _)| !field.luau_type.is_empty()) {
        row[field.name] = own;
        // What follows from the cause stands behind it.
        if field.name == "cause" {
            row[field.name] = cause.clone();
            row["verdict"] = value(&verdict);
        }
    }
    row
}
