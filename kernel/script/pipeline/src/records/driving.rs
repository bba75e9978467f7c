//! Driving scenarios: what is asked for and what came of it.

use pdk_lua::{ApiField, ApiRecord};
use pdk_model::described::{count, joined, picked};
use pdk_model::outcome::{Measures, Outcome};
use pdk_model::scenario::Scenario;

use super::field::field;
use crate::requests::SHARED;

pub(super) const FAILURE_CRITERIA: ApiRecord = ApiRecord {
    name: "FailureCriteria",
    doc: "What counts as a failure, besides a collision and the time limit, which always do.",
    fields: &[
        field(
            "lane_departure",
            "number?",
            "The absolute cross-track error in metres at which the vehicle has left its lane. If it is left out, the simulator \
             decides. The published study has 2 for one simulator and 4 for another.",
        ),
        field(
            "comparison",
            "(\"at_least\" | \"more_than\")?",
            "Whether the error has to reach `lane_departure`, which is the default and as published, or to exceed it.",
        ),
        field(
            "standstill_speed",
            "number?",
            "A vehicle slower than this stands still. The default is 0.1 m/s.",
        ),
        field(
            "standstill_seconds",
            "number?",
            "A drive ends after this many seconds of standing still. The default is 5.",
        ),
        field(
            "over_line",
            "number?",
            "The absolute cross-track error in metres at which a wheel is over the line, which is measured and ends nothing. 1.1 \
             if it is left out: a vehicle 1.8 m wide in a lane of 4 m.",
        ),
    ],
};

/// What a pipeline can say about a scenario besides what decides its outcome.
const BESIDES: &[ApiField] = &[
    field("name", "string?", "What it is called in tables; named after its perturbations if it is left out."),
    field(
        "images_every",
        "number?",
        "Every how many frames an image goes into the trace: 6 if it is left out, 0 for none. Of a scenario that fails, \
         the last frame goes there too, and those one and two seconds before if no image of them is there.",
    ),
];

const SCENARIO_FIELDS: &[&[ApiField]] = &[Scenario::FIELDS, BESIDES];
const OF_SCENARIO: [ApiField; count(SCENARIO_FIELDS)] = joined(SCENARIO_FIELDS);

pub(super) const SCENARIO: ApiRecord = ApiRecord {
    name: "Scenario",
    doc: "A road, perturbations with intensities, a seed and a duration. What it leaves out is as in the request.",
    fields: &OF_SCENARIO,
};

const OF_REQUEST: [ApiField; SHARED.len()] = picked(&OF_SCENARIO, SHARED);

pub(crate) const SESSION_REQUEST: ApiRecord = ApiRecord {
    name: "SessionRequest",
    doc: "What `pdk.session` takes: defaults for scenarios.",
    fields: &OF_REQUEST,
};

const DRIVE_FIELDS: &[&[ApiField]] = &[&[field("scenarios", "{ Scenario }", "What to drive.")], &OF_REQUEST];

pub(super) const DRIVE_REQUEST: ApiRecord = ApiRecord {
    name: "DriveRequest",
    doc: "What `pdk.drive` takes: scenarios, and defaults for them.",
    fields: &joined::<{ count(DRIVE_FIELDS) }>(DRIVE_FIELDS),
};

/// What scripts know about an outcome besides its own fields.
const SUBMITTED: &[ApiField] = &[
    field("number", "number", "The number of the scenario in its run, from 0."),
    field(
        "id",
        "string",
        "Identifies the scenario: it is the same in every run, and no other scenario has it.",
    ),
    field("name", "string", "The name of the scenario."),
];

/// What follows from the cause of an outcome, and stands behind it.
const VERDICT: &[ApiField] = &[field(
    "verdict",
    "\"passed\" | \"unsafe\" | \"stopped\" | \"late\" | \"void\"",
    "What that says about the driver: it reached the end; it left its lane or hit something; it stood still; it was too \
     slow to reach the end in time; nothing, because a component failed or it is driven elsewhere.",
)];

const OUTCOME_FIELDS: &[&[ApiField]] = {
    let (before, after) = Outcome::FIELDS.split_at(2);
    &[SUBMITTED, before, VERDICT, after]
};

pub(super) const OUTCOME: ApiRecord = ApiRecord {
    name: "Outcome",
    doc: "What happened in a scenario.",
    fields: &joined::<{ count(OUTCOME_FIELDS) }>(OUTCOME_FIELDS),
};

pub(super) const MEASURES: ApiRecord = ApiRecord {
    name: "Measures",
    doc: "The measures of a drive besides how it ended.",
    fields: Measures::FIELDS,
};
