//! How sure a conclusion is.

use pdk_lua::ApiRecord;

use super::field::field;

pub(super) const ESTIMATE: ApiRecord = ApiRecord {
    name: "Estimate",
    doc: "A value with its interval.",
    fields: &[
        field("value", "number", "The value."),
        field("low", "number", "The lower end of its interval."),
        field("high", "number", "The upper end."),
    ],
};

pub(super) const PAIRED: ApiRecord = ApiRecord {
    name: "Paired",
    doc: "The difference between two conditions on the same roads.",
    fields: &[
        field("difference", "Estimate", "The mean over roads of the first minus the second."),
        field(
            "effect_size",
            "number",
            "The matched-pairs rank-biserial correlation: 1 where all roads that differ point upwards, -1 where all point \
             downwards.",
        ),
        field(
            "p",
            "number",
            "How likely a mean difference of this size or more is if the conditions do not differ: the mid-p-value of a \
             randomisation test over roads. It is for this comparison alone, not adjusted for others.",
        ),
        field("roads", "number", "Roads that have both."),
    ],
};

pub(super) const INDEPENDENT: ApiRecord = ApiRecord {
    name: "Independent",
    doc: "The difference between two independent samples.",
    fields: &[
        field(
            "effect_size",
            "number",
            "The probability that a value of the first is larger than one of the second, with ties as one half: 0.5 if they do \
             not differ (Vargha and Delaney's A).",
        ),
        field(
            "p",
            "number",
            "The p-value of the two-sided Mann-Whitney test: how likely a difference of this size is if the two do not differ.",
        ),
    ],
};

pub(super) const TRIAL: ApiRecord = ApiRecord {
    name: "Trial",
    doc: "A drive at a level.",
    fields: &[field("level", "number", "The level."), field("failed", "boolean", "Whether it failed.")],
};

pub(super) const FAILING_LEVEL: ApiRecord = ApiRecord {
    name: "FailingLevel",
    doc: "The level at which the probability of failing reaches one half.",
    fields: &[
        field(
            "level",
            "number?",
            "The level: the lowest that was driven if it is reached there already, nothing if it is not reached up to the \
             highest.",
        ),
        field(
            "low",
            "number?",
            "The lower end of its interval, a level that was driven; nil if it lies above the highest.",
        ),
        field("high", "number?", "The upper end; nil if it may lie above the highest level."),
        field("highest", "number", "The highest level that was driven."),
        field("drives", "number", "How many drives it was found with."),
    ],
};

pub(super) const BISECTION: ApiRecord = ApiRecord {
    name: "Bisection",
    doc: "Levels in which the failing level is looked for.",
    fields: &[
        field("lowest", "number?", "The lowest level. The default is 0."),
        field("highest", "number?", "The highest level. The default is 4."),
        field(
            "resolution",
            "number?",
            "How close the survived and the failed level come in the end. The default is 0.25.",
        ),
    ],
};
