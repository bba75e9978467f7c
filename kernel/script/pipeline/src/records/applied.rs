//! What is done to frames: perturbations and where and when they are applied.

use pdk_components::modifiers::{
    ATTENTION as APPLIED_ATTENTION, DRAWS, PROBABILITY, REGION as APPLIED_REGION, WHERE,
};
use pdk_lua::ApiRecord;

use super::field;

pub(super) const COMPONENT: ApiRecord = ApiRecord {
    name: "Component",
    doc: "A simulator, driver or dataset reader with parameters, which stand beside the name.",
    fields: &[field("name", "string", "Its name."), field("[string]", "any", "Its parameters.")],
};

pub(super) const SCHEDULE: ApiRecord = ApiRecord {
    name: "Schedule",
    doc: "An intensity that changes over time: one of the fields. Times are seconds since the start of the scenario.",
    fields: &[
        field(
            "ramp",
            "{ from: number, to: number, start: number?, end: number }?",
            "Rises or falls evenly, and stays before and after.",
        ),
        field(
            "pulse",
            "{ level: number, rest: number?, period: number, duration: number, start: number? }?",
            "Goes on and off; without `rest` the frame is left as it is while it is off.",
        ),
        field("points", "{ { number } }?", "Points of time and level, between which it is linear."),
    ],
};

pub(super) const REGION: ApiRecord = ApiRecord {
    name: "Region",
    doc: "A part of the frame: one of the fields. Coordinates are shares of the width and height, from 0 to 1.",
    fields: &[
        field("box", "{ number }?", "Left, top, right, bottom."),
        field("polygon", "{ { number } }?", "Corners of x and y."),
        field(
            "mask",
            "string?",
            "An image file that is stretched over the frame: white is perturbed, black or transparent is not, what lies \
             between is blended.",
        ),
    ],
};

pub(super) const SELECTION: ApiRecord = ApiRecord {
    name: "Selection",
    doc: "Pixels that are chosen: by one of the first fields (`nearer` and `farther` go together), and how they are taken.",
    fields: &[
        field("top", "number?", "The share of the frame that matters most, in percent."),
        field("bottom", "number?", "The share of the frame that matters least, in percent."),
        field("random", "number?", "A share of the frame at random, in percent."),
        field("above", "number?", "All pixels whose value, from 0 to 1, is above this one."),
        field("label", "(string | { string })?", "What the simulator's own labels say that pixels show."),
        field("nearer", "number?", "What is at most so many metres away, as the simulator says."),
        field("farther", "number?", "What is at least so many metres away, as the simulator says."),
        field(
            "mask",
            "(string | Component)?",
            "A mask, which says itself how much of each pixel is perturbed.",
        ),
        field(
            "by",
            "(string | Component)?",
            "The saliency method that makes the map, for `top`, `bottom` and `above`.",
        ),
        field("every", "number?", "A map is made of one frame in so many; of each where it is left out."),
        field(
            "change",
            "number?",
            "A map stays until a frame differs from its own by more than this on average, of 255.",
        ),
        field("follow", "boolean?", "Whether a map moves with the image until the next one is made."),
        field("close", "number?", "Gaps up to twice so many pixels across are closed."),
        field("smallest", "number?", "Spots of fewer pixels are left out."),
        field("soft", "number?", "The edges are blended over so many pixels."),
    ],
};

pub(super) const ATTENTION: ApiRecord = ApiRecord {
    name: "Attention",
    doc: "The saliency maps that a perturbation follows.",
    fields: &[
        field("by", "string | Component", "The saliency method that makes them."),
        field("every", "number?", "As in `Selection`."),
        field("change", "number?", "As in `Selection`."),
        field("follow", "boolean?", "As in `Selection`."),
    ],
};

pub(super) const APPLIED: ApiRecord = ApiRecord {
    name: "AppliedPerturbation",
    doc: "A perturbation at an intensity with parameters, which stand beside the name. A text such as `\"NAME@2\"` \
          does as well.",
    fields: &[
        field("name", "string", "Its name."),
        field(
            "level",
            "(number | Schedule | ((time: number) -> number))?",
            "Its intensity: 0 to 4, any number in between, or a course of such numbers over time in seconds. 2 where it \
             is left out. A function is evaluated for every frame when the request is made.",
        ),
        field(PROBABILITY.name, "number?", PROBABILITY.doc),
        field(APPLIED_REGION.name, "Region?", APPLIED_REGION.doc),
        field(WHERE.name, "Selection?", WHERE.doc),
        field(APPLIED_ATTENTION.name, "(string | Attention)?", APPLIED_ATTENTION.doc),
        field(DRAWS.name, "(\"per_frame\" | \"per_sequence\")?", DRAWS.doc),
        field("[string]", "any", "Its parameters."),
    ],
};
