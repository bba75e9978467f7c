//! Evaluating drivers on recorded datasets.

use pdk_lua::ApiRecord;

use super::field;

pub(super) const EVALUATE_REQUEST: ApiRecord = ApiRecord {
    name: "EvaluateRequest",
    doc: "What `pdk.evaluate` takes.",
    fields: &[
        field(
            "dataset",
            "string | Component",
            "A folder that any reader may open, or a reader with its parameters.",
        ),
        field("driver", "string | Component", "The driver under test."),
        field("perturbations", "{ string | AppliedPerturbation }", "Each is applied by itself."),
        field("levels", "{ number }", "The intensities at which each is applied."),
        field("frames", "number?", "How many frames, from the first. The default is all."),
    ],
};

pub(super) const EVALUATION: ApiRecord = ApiRecord {
    name: "Evaluation",
    doc: "What `pdk.evaluate` returns.",
    fields: &[
        field("evaluation", "number", "The number of the evaluation in its run, from 0."),
        field("frames", "number", "Frames that were evaluated."),
        field("bad_frames", "{ { frame: string, error: string } }", "Frames that were left out, and why."),
        field("original_steering_error", "number", "Mean absolute steering error on the original frames."),
        field("rows", "{ EvaluationRow }", "One for each perturbation and level."),
    ],
};

pub(super) const EVALUATION_ROW: ApiRecord = ApiRecord {
    name: "EvaluationRow",
    doc: "How the driver did under one perturbation at one level. Steering and throttle are from -1 to 1.",
    fields: &[
        field("perturbation", "string", "The perturbation."),
        field(
            "label",
            "string",
            "The perturbation with its parameters, as on the command line without the level.",
        ),
        field("level", "number", "Its intensity."),
        field("steering_error", "number", "Mean absolute difference from the recorded steering."),
        field(
            "steering_drift",
            "number",
            "Mean absolute difference from the prediction on the original frame.",
        ),
        field("throttle_error", "number", "Mean absolute difference from the recorded throttle."),
        field(
            "throttle_drift",
            "number",
            "Mean absolute difference from the prediction on the original frame.",
        ),
    ],
};
