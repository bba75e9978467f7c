//! What the evaluations of a run came to.

use pdk_record::shard::EvaluatedFrames;
use serde_json::Value;

use crate::evaluation::Results;

/// What evaluations came to.
#[derive(Default)]
pub(super) struct Evaluations {
    /// What the pipeline got back.
    pub summaries: Vec<Value>,
    /// What each of them went through.
    pub frames: Vec<EvaluatedFrames>,
    /// How many frames of each were evaluated here.
    pub own: Vec<usize>,
    /// How long each took.
    pub times: Vec<Value>,
    /// The file with the results, once there is one.
    pub results: Option<Results>,
}
