//! What is taken from the outputs of a predictor, in the process that runs it, so that large outputs do not travel.

use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::prelude::Output;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::distances::Distances;
use crate::segments::Segments;

/// What is taken from the outputs of each frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Take {
    /// The places of the largest values of an output: the classes with the highest scores.
    Top {
        /// The output; none for the first.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        output: Option<String>,
        /// How many.
        count: usize,
    },
    /// Outputs as they are.
    Outputs {
        /// Their names; none for all.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        names: Vec<String>,
    },
    /// How many pixels of each class an output finds.
    Segments {
        /// The output; none for the first.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        output: Option<String>,
        /// The masks of the frames.
        truth: Segments,
    },
    /// How far an output is from measured distances.
    Distances {
        /// The output; none for the first.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        output: Option<String>,
        /// The distances of the frames.
        truth: Distances,
    },
}

/// What was taken from the outputs of a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Taken {
    /// See [`Take::Top`].
    Top(Vec<usize>),
    /// See [`Take::Outputs`].
    Outputs {
        /// Pixels in a row of the frame.
        width: usize,
        /// Rows of the frame.
        height: usize,
        /// The outputs.
        outputs: Vec<TakenOutput>,
    },
    /// Numbers about outputs that were compared with the truth where the network runs.
    Measured(Value),
}

/// An output as it was given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TakenOutput {
    /// Its name.
    pub name: String,
    /// How many values it has along each axis.
    pub shape: Vec<usize>,
    /// Its values; none for what is not a finite number.
    pub values: Vec<Option<f32>>,
}

impl Take {
    /// Takes from the outputs of a frame of this name and size.
    ///
    /// # Errors
    /// If there is no such output, or the frame has nothing to compare it with.
    pub fn from(&self, outputs: Vec<Output>, frame: &str, (width, height): (usize, usize)) -> Result<Taken> {
        match self {
            Self::Top { output, count } => {
                let scores = one(&outputs, output.as_deref())?;
                Ok(Taken::Top(pdk_metrics::classification::top(&scores.values, *count)))
            }
            Self::Segments { output, truth } => {
                let Output { shape, values, .. } = one(&outputs, output.as_deref())?;
                let pixels = truth.compare(frame, shape, values)?;
                Ok(Taken::Measured(
                    json!({"right": pixels.right, "predicted": pixels.predicted, "labelled": pixels.labelled}),
                ))
            }
            Self::Distances { output, truth } => {
                let Output { shape, values, .. } = one(&outputs, output.as_deref())?;
                let errors = truth.compare(frame, shape, values)?;
                Ok(Taken::Measured(json!({
                    "abs_rel": errors.absolute_relative, "rmse": errors.root_mean_square, "delta_1.25": errors.near,
                })))
            }
            Self::Outputs { names } => {
                names.iter().try_for_each(|name| find(&outputs, name).map(drop))?;
                let wanted = |output: &Output| names.is_empty() || names.contains(&output.name);
                let finite = |value: f32| Some(value).filter(|value| value.is_finite());
                let outputs = outputs.into_iter().filter(wanted).map(|Output { name, shape, values }| {
                    TakenOutput { name, shape, values: values.into_iter().map(finite).collect() }
                });
                Ok(Taken::Outputs { width, height, outputs: outputs.collect() })
            }
        }
    }
}

/// The output of a name, or the first.
fn one<'a>(outputs: &'a [Output], name: Option<&str>) -> Result<&'a Output> {
    match name {
        Some(name) => find(outputs, name),
        None => outputs.first().ok_or_else(|| Error::of(ErrorKind::Nonsense, "it gives no outputs")),
    }
}

fn find<'a>(outputs: &'a [Output], name: &str) -> Result<&'a Output> {
    outputs.iter().find(|output| output.name == name).ok_or_else(|| {
        let names: Vec<String> = outputs.iter().map(|output| format!("`{}`", output.name)).collect();
        Error::of(
            ErrorKind::Configuration,
            format!("there is no output `{name}`; its outputs are {}", names.join(", ")),
        )
    })
}

impl Taken {
    /// The number of values that travel.
    pub fn size(&self) -> usize {
        match self {
            Self::Top(classes) => classes.len(),
            Self::Outputs { outputs, .. } => outputs.iter().map(|output| output.values.len()).sum(),
            Self::Measured(_) => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outputs() -> Vec<Output> {
        let output = |name: &str, values: &[f32]| Output {
            name: name.into(),
            shape: vec![1, values.len()],
            values: values.into(),
        };
        vec![output("scores", &[0.1, 0.7, f32::NAN, 0.2]), output("other", &[f32::INFINITY, 1.5])]
    }

    #[test]
    fn the_largest_scores_are_taken_where_the_network_runs() {
        let top = |output: Option<&str>| Take::Top { output: output.map(str::to_owned), count: 2 };
        assert_eq!(top(None).from(outputs(), "a.png", (8, 6)).unwrap(), Taken::Top(vec![1, 3]));
        assert_eq!(top(Some("other")).from(outputs(), "a.png", (8, 6)).unwrap(), Taken::Top(vec![0, 1]));
        let error = top(Some("score")).from(outputs(), "a.png", (8, 6)).unwrap_err();
        assert_eq!(error.message(), "there is no output `score`; its outputs are `scores`, `other`");
    }

    #[test]
    fn outputs_travel_as_they_are_but_for_what_is_not_finite() {
        let taken = Take::Outputs { names: vec!["other".into()] }.from(outputs(), "a.png", (8, 6)).unwrap();
        assert_eq!(taken.size(), 2);
        let text = serde_json::to_string(&taken).unwrap();
        assert!(text.contains("[null,1.5]"), "{text}");
        assert_eq!(serde_json::from_str::<Taken>(&text).unwrap(), taken);
        assert_eq!(Take::Outputs { names: Vec::new() }.from(outputs(), "a.png", (8, 6)).unwrap().size(), 6);
    }
}
