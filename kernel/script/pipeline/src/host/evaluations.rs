//! What the evaluations of a run came to.

use serde_json::Value;

use crate::evaluation::Results;

/// What evaluations came to.
#[derive(Default)]
pub(super) struct Evaluations {
    /// What the pipeline got back, of those that did not fail.
    pub summaries: Vec<Value>,
    /// How many frames of each that was begun are evaluated here.
    pub own: Vec<usize>,
    /// How long each took.
    pub times: Vec<Value>,
    /// The file with the results, once there is one.
    pub results: Option<Results>,
}
