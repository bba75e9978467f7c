//! What a pipeline asks of a predictor.

use pdk_model::component::ComponentSpec;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::error::{Error, Result};
use serde_json::Value;

use crate::fields::Fields;
use crate::requests::{DatasetSpec, cells, dataset};

/// What goes through a predictor, and what is asked of it.
pub struct Request {
    /// Where the pictures come from.
    pub dataset: DatasetSpec,
    /// The predictor under test.
    pub predictor: ComponentSpec,
    /// The metric with its parameters.
    pub task: Value,
    /// Each perturbation at each level.
    pub cells: Vec<AppliedPerturbation>,
    /// At most this many pictures, from the first.
    pub frames: Option<usize>,
    /// Whether labels stay where they are if a perturbation moves things.
    pub keep_labels: bool,
}

impl Request {
    /// Whether a request is one for a predictor.
    pub fn is(request: &Value) -> bool {
        request.get("task").is_some()
    }

    /// Reads what a pipeline wrote.
    ///
    /// # Errors
    /// If a field is unknown, missing or of the wrong type, or a level is out of range.
    pub fn from_json(request: Value) -> Result<Self> {
        let known = ["dataset", "predictor", "task", "perturbations", "levels", "frames"];
        let mut fields = Fields::new("pdk.evaluate", request, &known)?;
        let task = fields.needed("task")?;
        if !task.is_object() {
            return Err(Error::new(format!(
                "pdk.evaluate: `task` is {task}, but has to be a table such as {{ kind = \"classification\" }}"
            )));
        }
        let keep_labels = task["keep_labels"].as_bool().unwrap_or_default();
        Ok(Self {
            keep_labels,
            dataset: dataset(&mut fields)?,
            predictor: ComponentSpec::from_json("predictor", &fields.needed("predictor")?)?,
            task,
            cells: if fields.has("perturbations") { cells(&mut fields)? } else { Vec::new() },
            frames: fields.whole("frames")?.map(|frames| usize::try_from(frames).unwrap_or(usize::MAX)),
        })
    }
}
