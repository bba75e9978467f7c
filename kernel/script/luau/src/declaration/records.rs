//! The tables that a script writes and is given, field by field.

use crate::api::{ApiField, ApiRecord};

const fn field(name: &'static str, luau_type: &'static str, doc: &'static str) -> ApiField {
    ApiField::of_scripts(name, luau_type, doc)
}

/// The table that a script returns.
pub const PERTURBATION: ApiRecord = ApiRecord {
    name: "Perturbation",
    doc: "What the file of a perturbation returns, or that of a mask, which has `mask` in place of `apply`. A perturbation that acts on what \
          the driver gets besides the frame has `observe`, and one that acts on controls `actuate`.",
    fields: &[
        field("doc", "string", "One line that says what it does, without a full stop."),
        field(
            "apply",
            "((image: Image, cx: Context) -> ())?",
            "Changes `image`, a copy of the camera's frame, in place. The result has to depend on the image and \
                  on `cx` alone, so that any frame can be computed again on its own, or from as many frames before it as `history` says.",
        ),
        field(
            "observe",
            "((observation: Observation, cx: Context) -> ())?",
            "Changes in place what the driver gets besides the frame. It has an effect in drives alone.",
        ),
        field(
            "actuate",
            "((control: Control, cx: Context) -> ())?",
            "Changes in place the control that is applied to the vehicle from this frame to the next. It has an effect in drives alone.",
        ),
        field(
            "mask",
            "((image: Image, cx: Context) -> ())?",
            "Makes a mask of `image`, a copy of the camera's frame, in place: white is perturbed, black is not, what lies \
                  between is blended. It goes by brightness.",
        ),
        field(
            "name",
            "string?",
            "Its name: lower-case letters, digits and underscores. The default is the file's name.",
        ),
        field("family", "string?", "The family under which it is listed, such as \"noise\"."),
        field("source", "string?", "Where the algorithm comes from: a paper, a standard or a model."),
        field("mathematics", "string?", "What it computes, in one line of mathematics."),
        field(
            "draws_per_sequence",
            "string?",
            "What it draws once per sequence with `cx.sequence_random`, such as \"where drops sit\".",
        ),
        field(
            "draws_per_frame",
            "string?",
            "What it draws anew for every frame with `cx.frame_random`, such as \"the noise\".",
        ),
        field(
            "history",
            "number?",
            "How many frames before the one at hand it needs, up to 240: they are in `cx.history`. The default is 0.",
        ),
        field(
            "divergence",
            "(string | { string })?",
            "How it differs from what was published: a sentence, or a list of sentences.",
        ),
        field(
            "grows_with",
            "{ [string]: number | boolean | string | { number } }?",
            "Values of its parameters with which its strength grows with the intensity, where its levels are out of \
                  order; a list has a value for each level.",
        ),
        field(
            "version",
            "number?",
            "Version of the algorithm. Raise it with every change of the output. The default is 1.",
        ),
        field(
            "temporal",
            "(\"static\" | \"dynamic\")?",
            "Whether the effect moves over time. The default is \"static\".",
        ),
        field("default", "boolean?", "Whether it belongs to the default set. The default is true."),
        field(
            "geometry",
            "(\"kept\" | \"moved\" | \"altered\")?",
            "What it does to the places of things in the frame, for labels: \"kept\" if everything stays in its place, \"moved\" if \
                  `move_point` says where to, \"altered\" if it cannot say. If it is missing, labels are refused, unless there is `move_point`.",
        ),
        field(
            "move_point",
            "((x: number, y: number, width: number, height: number, cx: Context) -> (number?, number?))?",
            "The place to which it moves a point of the frame, in pixels from the centre of the first. Returns nothing for a point that has \
                  nowhere to go.",
        ),
        field(
            "source_point",
            "((x: number, y: number, width: number, height: number, cx: Context) -> (number?, number?))?",
            "The way back: the point of the camera's frame whose colour is seen at a point of the perturbed one. Masks need it.",
        ),
        field("parameters", "{ Parameter }?", "What a user can set."),
    ],
};

/// An entry of the table's `parameters`.
pub const PARAMETER: ApiRecord = ApiRecord {
    name: "Parameter",
    doc: "A parameter of a perturbation. It has either `levels`, and then follows the intensity, or a `default`.",
    fields: &[
        field("name", "string", "Its name, under which `cx` has its value."),
        field("doc", "string", "One line that says what it is."),
        field("levels", "{ number }?", "The values at the intensities 0, 1, 2, 3 and 4."),
        field("default", "(number | boolean | string)?", "The value if the user sets none."),
        field(
            "type",
            "(\"number\" | \"integer\" | \"boolean\" | \"choice\" | \"text\")?",
            "Its type. If it is missing, it follows from `levels`, `options` or `default`.",
        ),
        field("options", "{ string }?", "The values that a choice allows."),
        field("min", "number?", "The smallest value allowed."),
        field("max", "number?", "The largest value allowed."),
        field("unit", "string?", "Its unit."),
    ],
};

/// What `apply` is given beside the image. The parameters are there as well, each under its name.
pub const CONTEXT: ApiRecord = ApiRecord {
    name: "Context",
    doc: "What a perturbation knows about the frame at hand.",
    fields: &[
        field("intensity", "number", "The intensity: any number from 0 to 4."),
        field("frame_index", "number", "The number of the frame in its sequence, from 0."),
        field("time", "number", "Simulation time in seconds since the start of the sequence."),
        field(
            "history",
            "{ Earlier }",
            "The frames before this one, the latest first: as many as `history` of the perturbation says, fewer at the beginning of a sequence, \
                  and none for a picture that stands alone.",
        ),
        field(
            "period",
            "number?",
            "How long a frame lasts at the camera's rate, in seconds. It is known in drives.",
        ),
        field("frame_random", "Random", "Random numbers that are drawn anew for every frame."),
        field("sequence_random", "Random", "Random numbers that are the same for all frames of a sequence."),
        field("[string]", "any", "The parameters, each under its name."),
    ],
};

/// An entry of `cx.history`.
pub const EARLIER: ApiRecord = ApiRecord {
    name: "Earlier",
    doc: "A frame before the one at hand: as the perturbation was given it, or, of one with `observe` or `actuate`, what passed at it.",
    fields: &[
        field("image", "Image", "Its pixels: a copy, as large as the frame at hand."),
        field("given", "any", "The table that the perturbation was given: a `Control` or an `Observation`."),
        field("passed", "any", "The same as the perturbation passed it on."),
        field("frame_index", "number", "The number of the frame in its sequence."),
        field("time", "number", "Its simulation time in seconds."),
    ],
};

/// What `actuate` is given.
pub const CONTROL: ApiRecord = ApiRecord {
    name: "Control",
    doc: "What the driver decided at a frame.",
    fields: &[
        field("steering", "number", "-1 (full left) to 1 (full right)."),
        field("throttle", "number", "-1 (full brake) to 1 (full throttle)."),
    ],
};

/// What `observe` is given.
pub const OBSERVATION: ApiRecord = ApiRecord {
    name: "Observation",
    doc: "What the driver gets besides the frame.",
    fields: &[
        field("time", "number", "Seconds since the start of the drive."),
        field(
            "speed",
            "number",
            "The vehicle's speed in metres per second; not a number if it is not known.",
        ),
    ],
};
