//! Evaluating drivers on recorded datasets.

use pdk_lua::ApiRecord;

use super::field::field;

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
        field("original_steering_error", "number?", "Mean absolute steering error on the original frames."),
        field("original_steering_error_interval", "EvaluationInterval?", "Its interval."),
        field("original_throttle_error", "number?", "Mean absolute throttle error on the original frames."),
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
        field("error", "number?", "Mean absolute error of the driver."),
        field("constant", "number?", "The best constant: the median of what was recorded."),
        field("constant_error", "number?", "Its mean absolute error."),
        field("mean", "number?", "The mean of what was recorded."),
        field("mean_error", "number?", "Its mean absolute error."),
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
        field("steering_error", "number?", "Mean absolute difference from the recorded steering."),
        field("steering_error_interval", "EvaluationInterval?", "Its interval."),
        field(
            "steering_drift",
            "number",
            "Mean absolute difference from the prediction on the original frame.",
        ),
        field("steering_drift_interval", "EvaluationInterval?", "Its interval."),
        field("throttle_error", "number?", "Mean absolute difference from the recorded throttle."),
        field("throttle_error_interval", "EvaluationInterval?", "Its interval."),
        field(
            "throttle_drift",
            "number",
            "Mean absolute difference from the prediction on the original frame.",
        ),
        field("throttle_drift_interval", "EvaluationInterval?", "Its interval."),
    ],
};

pub(super) const TASK_REQUEST: ApiRecord = ApiRecord {
    name: "TaskRequest",
    doc: "What `pdk.evaluate` takes for a network that does not drive.",
    fields: &[
        field(
            "dataset",
            "string | Component",
            "A folder that any reader may open, or a reader with its parameters.",
        ),
        field("predictor", "string | Component", "The predictor under test, with its `model`."),
        field("task", "Task", "The metric with the labels."),
        field(
            "perturbations",
            "{ string | AppliedPerturbation }?",
            "Each is applied by itself. Without any, the pictures are evaluated as they are.",
        ),
        field("levels", "{ number }?", "The intensities at which each is applied."),
        field("frames", "number?", "How many pictures, from the first. The default is all."),
    ],
};

pub(super) const TASK: ApiRecord = ApiRecord {
    name: "Task",
    doc: "A metric. Which fields there are depends on `kind`.",
    fields: &[
        field(
            "kind",
            "\"classification\" | \"detection\" | \"segmentation\" | \"depth\" | \"trajectory\" | \"function\"",
            "The metric.",
        ),
        field(
            "labels",
            "(string | { [string]: any })?",
            "What the pictures show. Classification: `folders` (the default: the first folder of a picture's name is its class), or a \
             table of a class for each name. Detection: a JSON file of COCO, or a folder of text files of YOLO. Segmentation, depth: a folder \
             with a file for each picture. Trajectory: a table of a list of points { x, y } for each name. Function: a table of what the function gets, by name.",
        ),
        field(
            "classes",
            "({ string } | string)?",
            "Classification: the classes in the order in which the network has them. The default is the order of their names. \
             Segmentation: likewise, without a default. Detection: the output with the class of each box. The default is `classes`.",
        ),
        field(
            "output",
            "string?",
            "Classification: the output with the scores. Segmentation: the one with the scores of the classes or the classes of each place. \
             Depth: the one with the distances. Trajectory: the one with the points. The default is the first.",
        ),
        field(
            "baseline",
            "(string | { name: string, clean: number?, errors: { [string]: number } })?",
            "Classification: what corruption errors are relative to. `alexnet`, or the mean top-1 error of another network over the \
             levels of each perturbation, with its error on the pictures as they are.",
        ),
        field("boxes", "string?", "Detection: the output with the boxes. The default is `boxes`."),
        field("scores", "string?", "Detection: the output with the scores. The default is `scores`."),
        field(
            "corners",
            "boolean?",
            "Detection: whether a box is its left, top, right and bottom. Else it is left, top, width and height. The default is true.",
        ),
        field(
            "units",
            "(string | { width: number, height: number })?",
            "Detection: whether boxes are in `pixels` of the picture (the default), in `shares` of its size, or in pixels of the \
             network's input of this size.",
        ),
        field(
            "replace",
            "{ string }?",
            "Segmentation, depth: two texts: what the name of a picture ends with before its ending, and what that of its label ends with \
             instead.",
        ),
        field(
            "values",
            "{ number }?",
            "Segmentation: the value of a mask that stands for each class. The default is 0, 1, 2 and so on.",
        ),
        field(
            "ignore",
            "(number | { number } | string)?",
            "Segmentation: the values of pixels that do not count, or `others` for all that are of no class. The default is 255.",
        ),
        field("unit", "number?", "Depth: the metres that 1 stands for in a label. PNG files need it."),
        field(
            "nearest",
            "number?",
            "Depth: the smallest distance that counts, in metres. The default is 0.001.",
        ),
        field("farthest", "number?", "Depth: the largest distance that counts. There is none by default."),
        field(
            "median",
            "boolean?",
            "Depth: whether predictions are multiplied by what gives them the median of the labels, for networks that know distances up to \
             a factor. The default is false.",
        ),
        field(
            "keep_labels",
            "boolean?",
            "Detection, segmentation, depth: whether labels stay where they are under perturbations that move things. The default is \
             false: they are an error.",
        ),
        field("outputs", "{ string }?", "Function: the outputs that it gets. The default is all."),
        field(
            "score",
            "((seen: { outputs: { [string]: { shape: { number }, values: { number } } }, label: any, name: string, width: number, \
             height: number, recorded: { steering: number?, throttle: number? }? }) -> number | { [string]: number })?",
            "Function: returns a number about a picture, or several by name. Their means are the result. `recorded` is what the dataset has.",
        ),
    ],
};

pub(super) const TASK_RESULT: ApiRecord = ApiRecord {
    name: "TaskResult",
    doc: "What `pdk.evaluate` returns for a task.",
    fields: &[
        field("evaluation", "number", "The number of the evaluation in its run, from 0."),
        field("task", "string", "The metric."),
        field("frames", "number", "Pictures that were evaluated."),
        field("bad_frames", "{ { frame: string, error: string } }", "Pictures that were left out, and why."),
        field("original", "{ TaskTotal }", "The metric on the pictures as they are."),
        field(
            "rows",
            "{ { perturbation: string, label: string, level: number, totals: { TaskTotal } } }",
            "The metric under each perturbation at each level.",
        ),
        field(
            "corruption_errors",
            "{ baseline: string, over: number, of: number, mce: number?, relative_mce: number?, rows: { { label: string, error: number, baseline_error: number?, \
             ce: number?, relative_ce: number? } } }?",
            "The errors of a classification relative to those of its baseline, where 1 is as good as that; `mce` is the mean over `over` of \
             the `of` perturbations that the baseline has.",
        ),
    ],
};

pub(super) const TASK_TOTAL: ApiRecord = ApiRecord {
    name: "TaskTotal",
    doc: "A number about pictures.",
    fields: &[
        field("name", "string", "What it is, such as `top1_error` or `ap`."),
        field("value", "number?", "The number. None if the pictures do not have it."),
        field("interval", "EvaluationInterval?", "Its interval, if it is a mean over pictures."),
    ],
};
