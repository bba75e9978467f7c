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
        field(
            "trust",
            "boolean?",
            "Whether a driver is ranked even if its check speaks against it. The default is false: then `pdk.evaluate` ends with an \
             error that says why.",
        ),
        field(
            "tolerance",
            "number?",
            "The drift of the steering for which `levels` of the result say from which level on it is exceeded. The default is 0.1.",
        ),
    ],
};

pub(super) const EVALUATION: ApiRecord = ApiRecord {
    name: "Evaluation",
    doc: "What `pdk.evaluate` returns.",
    fields: &[
        field("evaluation", "number", "The number of the evaluation in its run, from 0."),
        field("frames", "number", "Frames that were evaluated."),
        field(
            "sequences",
            "number",
            "Stretches of the recording without a gap, each driven from its first frame to its last.",
        ),
        field("bad_frames", "{ { frame: string, error: string } }", "Frames that were left out, and why."),
        field("check", "EvaluationCheck", "How the driver does on the original frames, beside a constant."),
        field("original_steering_error", "number", "Mean absolute steering error on the original frames."),
        field("original_steering_error_interval", "EvaluationInterval?", "Its interval."),
        field("original_throttle_error", "number", "Mean absolute throttle error on the original frames."),
        field("rows", "{ EvaluationRow }", "One for each perturbation and level."),
        field("tolerance", "number", "The drift that `levels` are about."),
        field("levels", "{ EvaluationLevel }", "One for each perturbation."),
    ],
};

pub(super) const EVALUATION_INTERVAL: ApiRecord = ApiRecord {
    name: "EvaluationInterval",
    doc: "Where a mean over frames may lie, with a probability of 95 %. Frames resemble their neighbours, so it is found by drawing \
          blocks of frames that follow each other. There is none if the frames make fewer than three blocks.",
    fields: &[field("low", "number", "Its lower end."), field("high", "number", "Its upper end.")],
};

pub(super) const EVALUATION_CHECK: ApiRecord = ApiRecord {
    name: "EvaluationCheck",
    doc: "How a driver does on the original frames.",
    fields: &[
        field("frames", "number", "Frames that the driver decided on."),
        field("steering", "EvaluationNumberCheck", "How it steers."),
        field("throttle", "EvaluationNumberCheck", "Its throttle."),
        field("failed", "number", "The share of frames for which it gave no usable number."),
        field("refusal", "string?", "Why the driver cannot be ranked. None if nothing speaks against it."),
    ],
};

pub(super) const EVALUATION_NUMBER_CHECK: ApiRecord = ApiRecord {
    name: "EvaluationNumberCheck",
    doc: "A number that a driver gives for the original frames, beside constants.",
    fields: &[
        field("error", "number", "Mean absolute error of the driver."),
        field("constant", "number", "The best constant: the median of what was recorded."),
        field("constant_error", "number", "Its mean absolute error."),
        field("mean", "number", "The mean of what was recorded."),
        field("mean_error", "number", "Its mean absolute error."),
        field("at_limit", "number", "The share of outputs at -1 or 1."),
        field("same", "number", "The share of outputs that are the same number."),
    ],
};

pub(super) const EVALUATION_LEVEL: ApiRecord = ApiRecord {
    name: "EvaluationLevel",
    doc: "From which level on a perturbation makes the steering drift by more than the tolerance. Between levels that were measured the \
          drift counts as a straight line.",
    fields: &[
        field("perturbation", "string", "The perturbation."),
        field("label", "string", "The perturbation with its parameters."),
        field(
            "level",
            "number?",
            "The level. It is the lowest if the tolerance is exceeded there already, and none if it is not at the highest.",
        ),
        field("low", "number?", "The lowest level that is possible, by the intervals of the drift."),
        field(
            "high",
            "number?",
            "The highest level that is possible. None if the highest level may not be enough.",
        ),
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
        field("steering_error_interval", "EvaluationInterval?", "Its interval."),
        field(
            "steering_drift",
            "number",
            "Mean absolute difference from the prediction on the original frame.",
        ),
        field("steering_drift_interval", "EvaluationInterval?", "Its interval."),
        field("throttle_error", "number", "Mean absolute difference from the recorded throttle."),
        field("throttle_error_interval", "EvaluationInterval?", "Its interval."),
        field(
            "throttle_drift",
            "number",
            "Mean absolute difference from the prediction on the original frame.",
        ),
        field("throttle_drift_interval", "EvaluationInterval?", "Its interval."),
    ],
};
