//! The tables that a script writes and is given, field by field.

use crate::api::{ApiField, ApiRecord};

/// The table that a script returns.
pub const PERTURBATION: ApiRecord = ApiRecord {
    name: "Perturbation",
    doc: "What the file of a perturbation returns, or that of a mask, which has `mask` in place of `apply`.",
    fields: &[
        ApiField {
            name: "doc",
            luau_type: "string",
            doc: "One line that says what it does, without a full stop.",
        },
        ApiField {
            name: "apply",
            luau_type: "((image: Image, cx: Context) -> ())?",
            doc: "Changes `image`, a copy of the camera's frame, in place. The result has to depend on the image and \
                  on `cx` alone, so that any frame can be computed again on its own.",
        },
        ApiField {
            name: "mask",
            luau_type: "((image: Image, cx: Context) -> ())?",
            doc: "Makes a mask of `image`, a copy of the camera's frame, in place: white is perturbed, black is not, what lies \
                  between is blended. It goes by brightness.",
        },
        ApiField {
            name: "name",
            luau_type: "string?",
            doc: "Its name: lower-case letters, digits and underscores. The file's name where it is left out.",
        },
        ApiField {
            name: "family",
            luau_type: "string?",
            doc: "The family under which it is listed, such as \"noise\".",
        },
        ApiField {
            name: "source",
            luau_type: "string?",
            doc: "Where the algorithm comes from: a paper, a standard or a model.",
        },
        ApiField {
            name: "mathematics",
            luau_type: "string?",
            doc: "What it computes, in one line of mathematics.",
        },
        ApiField {
            name: "draws_per_sequence",
            luau_type: "string?",
            doc: "What it draws once per sequence with `cx.sequence_random`, such as \"where drops sit\".",
        },
        ApiField {
            name: "draws_per_frame",
            luau_type: "string?",
            doc: "What it draws anew for every frame with `cx.frame_random`, such as \"the noise\".",
        },
        ApiField {
            name: "divergence",
            luau_type: "(string | { string })?",
            doc: "Where it differs from what was published, a sentence or a list of them.",
        },
        ApiField {
            name: "grows_with",
            luau_type: "{ [string]: number | boolean | string | { number } }?",
            doc: "Values of its parameters with which its strength grows with the intensity, where its levels are out of \
                  order; a list has a value for each level.",
        },
        ApiField {
            name: "version",
            luau_type: "number?",
            doc: "Version of the algorithm, 1 where it is left out. Raise it with every change of the output.",
        },
        ApiField {
            name: "temporal",
            luau_type: "(\"static\" | \"dynamic\")?",
            doc: "Whether the effect moves over time; \"static\" where it is left out.",
        },
        ApiField {
            name: "default",
            luau_type: "boolean?",
            doc: "Whether it belongs to the default set; true where it is left out.",
        },
        ApiField { name: "parameters", luau_type: "{ Parameter }?", doc: "What a user can set." },
    ],
};

/// An entry of the table's `parameters`.
pub const PARAMETER: ApiRecord = ApiRecord {
    name: "Parameter",
    doc: "A parameter of a perturbation. It has either `levels`, and then follows the intensity, or a `default`.",
    fields: &[
        ApiField { name: "name", luau_type: "string", doc: "Its name, under which `cx` has its value." },
        ApiField { name: "doc", luau_type: "string", doc: "One line that says what it is." },
        ApiField {
            name: "levels",
            luau_type: "{ number }?",
            doc: "The values at the intensities 0, 1, 2, 3 and 4.",
        },
        ApiField {
            name: "default",
            luau_type: "(number | boolean | string)?",
            doc: "The value where the user sets none.",
        },
        ApiField {
            name: "type",
            luau_type: "(\"number\" | \"integer\" | \"boolean\" | \"choice\" | \"text\")?",
            doc: "Its type; follows from `levels`, `options` or `default` where it is left out.",
        },
        ApiField { name: "options", luau_type: "{ string }?", doc: "The values that a choice allows." },
        ApiField { name: "min", luau_type: "number?", doc: "The smallest value allowed." },
        ApiField { name: "max", luau_type: "number?", doc: "The largest value allowed." },
        ApiField { name: "unit", luau_type: "string?", doc: "Its unit." },
    ],
};

/// What `apply` is given beside the image. The parameters are there as well, each under its name.
pub const CONTEXT: ApiRecord = ApiRecord {
    name: "Context",
    doc: "What a perturbation knows about the frame at hand.",
    fields: &[
        ApiField {
            name: "intensity",
            luau_type: "number",
            doc: "The intensity: 0 to 4, any number in between.",
        },
        ApiField {
            name: "frame_index",
            luau_type: "number",
            doc: "The number of the frame in its sequence, from 0.",
        },
        ApiField {
            name: "time",
            luau_type: "number",
            doc: "Simulation time in seconds since the start of the sequence.",
        },
        ApiField {
            name: "frame_random",
            luau_type: "Random",
            doc: "Random numbers that are drawn anew for every frame.",
        },
        ApiField {
            name: "sequence_random",
            luau_type: "Random",
            doc: "Random numbers that are the same for all frames of a sequence.",
        },
        ApiField { name: "[string]", luau_type: "any", doc: "The parameters, each under its name." },
    ],
};
