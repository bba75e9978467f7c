//! What is done to frames: perturbations and where and when they are applied.

use pdk_lua::{ApiField, ApiRecord};
use pdk_model::described::{count, joined};
use pdk_model::perturbation::{MODIFIERS, Modifier};

use super::field::field;

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

pub(super) const DURING: ApiRecord = ApiRecord {
    name: "During",
    doc: "A part of a drive: a span of time and a box in its frames. What is left out is not limited.",
    fields: &[
        field("from", "number?", "When it begins, in seconds."),
        field("to", "number?", "When it is over, in seconds; a frame at that time is not in it."),
        field("box", "{ number }?", "Left, top, right, bottom, as shares of the width and height."),
        field("except", "During?", "What of it is not perturbed."),
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
        field(
            "nearer",
            "number?",
            "Perturbs what is at most this many metres away, as the simulator reports.",
        ),
        field(
            "farther",
            "number?",
            "Perturbs what is at least this many metres away, as the simulator reports.",
        ),
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
        field("every", "number?", "A map is made of one frame in this many. The default is every frame."),
        field(
            "change",
            "number?",
            "A map stays until a frame differs from its own by more than this on average, of 255.",
        ),
        field("follow", "boolean?", "Whether a map moves with the image until the next one is made."),
        field("close", "number?", "Gaps up to twice this many pixels across are closed."),
        field("smallest", "number?", "Spots of fewer pixels are left out."),
        field("soft", "number?", "The edges are blended over this many pixels."),
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

const NAME: &[ApiField] = &[field("name", "string", "Its name.")];
const PARAMETERS: &[ApiField] = &[field("[string]", "any", "Its parameters.")];

/// The modifiers as fields of a table.
const OF_MODIFIERS: [ApiField; MODIFIERS.len()] = {
    let mut fields = [field("", "", ""); MODIFIERS.len()];
    let mut place = 0;
    while place < MODIFIERS.len() {
        let Modifier { name, luau_type, doc, .. } = MODIFIERS[place];
        fields[place] = field(name, luau_type, doc);
        place += 1;
    }
    fields
};
const APPLIED_FIELDS: &[&[ApiField]] = &[NAME, &OF_MODIFIERS, PARAMETERS];

pub(super) const APPLIED: ApiRecord = ApiRecord {
    name: "AppliedPerturbation",
    doc: "A perturbation at an intensity with parameters, which stand beside the name. A text such as `\"NAME@2\"` \
          does as well. A level that is left out is 2; one that is a function is evaluated for every frame when the request is made.",
    fields: &joined::<{ count(APPLIED_FIELDS) }>(APPLIED_FIELDS),
};
