//! The tables that pipelines write and read, as types for editors.

use pdk_core::modifiers::{DRAWS, PROBABILITY, REGION as APPLIED_REGION, WHERE};
use pdk_lua::{ApiField, ApiRecord};

const fn field(name: &'static str, luau_type: &'static str, doc: &'static str) -> ApiField {
    ApiField { name, luau_type, doc }
}

/// All of them, in the order of the type definition file.
pub const RECORDS: [&ApiRecord; 14] = [
    &COMPONENT,
    &SCHEDULE,
    &REGION,
    &SELECTION,
    &APPLIED,
    &SCENARIO,
    &SESSION_REQUEST,
    &DRIVE_REQUEST,
    &OUTCOME,
    &ROAD_REQUEST,
    &ROAD,
    &EVALUATE_REQUEST,
    &EVALUATION,
    &EVALUATION_ROW,
];

const COMPONENT: ApiRecord = ApiRecord {
    name: "Component",
    doc: "A simulator, driver or dataset reader with parameters, which stand beside the name.",
    fields: &[field("name", "string", "Its name."), field("[string]", "any", "Its parameters.")],
};

const SCHEDULE: ApiRecord = ApiRecord {
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

const REGION: ApiRecord = ApiRecord {
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

const SELECTION: ApiRecord = ApiRecord {
    name: "Selection",
    doc: "Pixels that a saliency map marks: one of the first four fields, and how they are taken.",
    fields: &[
        field("top", "number?", "The share of the frame that matters most, in percent."),
        field("bottom", "number?", "The share of the frame that matters least, in percent."),
        field("random", "number?", "A share of the frame at random, in percent."),
        field("above", "number?", "All pixels whose value, from 0 to 1, is above this one."),
        field("by", "(string | Component)?", "The saliency method that makes the map; `random` needs none."),
        field("every", "number?", "A map is made of one frame in so many; of each where it is left out."),
        field(
            "change",
            "number?",
            "A map stays until a frame differs from its own by more than this on average, of 255.",
        ),
        field("close", "number?", "Gaps up to twice so many pixels across are closed."),
        field("smallest", "number?", "Spots of fewer pixels are left out."),
        field("soft", "number?", "The edges are blended over so many pixels."),
    ],
};

const APPLIED: ApiRecord = ApiRecord {
    name: "AppliedPerturbation",
    doc: "A perturbation at an intensity with parameters, which stand beside the name. A text such as `\"contrast@2\"` \
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
        field(DRAWS.name, "(\"per_frame\" | \"per_sequence\")?", DRAWS.doc),
        field("[string]", "any", "Its parameters."),
    ],
};

const SCENARIO: ApiRecord = ApiRecord {
    name: "Scenario",
    doc: "A road, perturbations with intensities, a seed and a duration.",
    fields: &[
        field(
            "name",
            "string?",
            "What it is called in tables; named after its perturbations where it is left out.",
        ),
        field(
            "road",
            "any",
            "The road in the simulator's own terms; the simulator's default where it is left out.",
        ),
        field(
            "perturbations",
            "{ string | AppliedPerturbation }?",
            "Applied to every frame, one after the other.",
        ),
        field(
            "duration",
            "number?",
            "The time limit in seconds of simulation time; that of the request where it is left out.",
        ),
        field(
            "seed",
            "number?",
            "The seed of all that is drawn, by the simulator and the perturbations. Where it is left out, it follows from the \
             run's seed, the road and `repeat`: so perturbations and levels are compared under the same luck.",
        ),
        field(
            "[\"repeat\"]",
            "number?",
            "Which drive of the same it is, where it is wanted several times: another one gets luck of its own. 0 where it is \
             left out.",
        ),
        field("simulator", "(string | Component)?", "The simulator, where it is not that of the request."),
        field(
            "driver",
            "(string | Component)?",
            "The driver under test, where it is not that of the request.",
        ),
        field("images_every", "number?", "As in the request."),
        field("mode", "(\"lockstep\" | \"realtime\")?", "As in the request."),
    ],
};

const SESSION_REQUEST: ApiRecord = ApiRecord {
    name: "SessionRequest",
    doc: "What `pdk.session` takes: what scenarios have where they do not say it themselves.",
    fields: &[
        field("simulator", "(string | Component)?", "The simulator."),
        field("driver", "(string | Component)?", "The driver under test."),
        field(
            "duration",
            "number?",
            "The time limit of a scenario in seconds of simulation time; 30 where it is left out.",
        ),
        field(
            "images_every",
            "number?",
            "Every how many frames an image goes into the trace: 6 where it is left out, 0 for none.",
        ),
        field("mode", "(\"lockstep\" | \"realtime\")?", "Whether the simulator waits for the driver."),
    ],
};

const DRIVE_REQUEST: ApiRecord = ApiRecord {
    name: "DriveRequest",
    doc: "What `pdk.drive` takes.",
    fields: &[
        field("simulator", "string | Component", "The simulator."),
        field("driver", "string | Component", "The driver under test."),
        field("scenarios", "{ Scenario }", "What to drive."),
        field(
            "duration",
            "number?",
            "The time limit of a scenario in seconds of simulation time; 30 where it is left out.",
        ),
        field(
            "images_every",
            "number?",
            "Every how many frames an image goes into the trace: 6 where it is left out, 0 for none. Of a scenario that fails, \
             the last frame goes there too, and those one and two seconds before where no image is.",
        ),
        field(
            "mode",
            "(\"lockstep\" | \"realtime\")?",
            "Whether the simulator waits for the driver, as it does where this is left out, or goes on by the clock.",
        ),
    ],
};

const OUTCOME: ApiRecord = ApiRecord {
    name: "Outcome",
    doc: "What happened in a scenario.",
    fields: &[
        field("number", "number", "The number of the scenario in its run, from 0."),
        field("id", "string", "What tells the scenario from every other; the same one has it in every run."),
        field("name", "string", "The name of the scenario."),
        field("success", "boolean", "Whether the end of the road was reached."),
        field(
            "cause",
            "\"finished\" | \"lane_departure\" | \"collision\" | \"no_progress\" | \"time_out\" | \"error\"",
            "How it ended.",
        ),
        field("error", "string?", "What failed, where a component did."),
        field("time", "number", "Simulation time at the end in seconds."),
        field("frames", "number", "Frames that were driven."),
        field("skipped_frames", "number", "In real time: frames that the driver was too slow to see."),
        field("progress", "number", "The share of the road that was driven, 0 to 1."),
        field("mean_cross_track_error", "number", "Mean absolute cross-track error in metres."),
        field("max_cross_track_error", "number", "Largest absolute cross-track error in metres."),
        field("digest", "string", "A hash of every frame that the driver saw and every control it gave."),
    ],
};

/// What `pdk.road` takes.
pub const ROAD_REQUEST: ApiRecord = ApiRecord {
    name: "RoadRequest",
    doc: "What `pdk.road` takes: `angles` for a given road, `turns` and `mean_curvature` for an informed one, neither for a \
          random one.",
    fields: &[
        field("angles", "{ number }?", "Degrees turned at each node, positive to the right."),
        field(
            "segment",
            "(number | { number })?",
            "Metres from node to node, 25 where it is left out; one for each angle where they are given.",
        ),
        field("seed", "number?", "The seed of the draws; that of the run where it is left out."),
        field(
            "limit",
            "number?",
            "Largest angle in degrees: 35 for random roads, 60 for informed ones where it is left out.",
        ),
        field("turns", "number?", "Nodes at which the road turns by at least 25 degrees, 0 to 8."),
        field("mean_curvature", "number?", "The mean curvature in 1/m that the road should come near."),
        field(
            "width",
            "number?",
            "Metres from edge to edge, 8 where it is left out; it may not cross itself.",
        ),
        field(
            "smallest_radius",
            "number?",
            "Metres; a road with a tighter bend is not valid. 8.5 where it is left out, which the simulator `lane` can drive.",
        ),
        field("attempts", "number?", "How many roads are drawn until one is valid; 1 where it is left out."),
    ],
};

const ROAD: ApiRecord = ApiRecord {
    name: "Road",
    doc: "What `pdk.road` returns.",
    fields: &[
        field("waypoints", "string", "The waypoints as `x,y,z@x,y,z`, y up, in metres."),
        field(
            "road",
            "{ angles: { number }, segment: number | { number } }",
            "The same in short, as a simulator takes it: the `road` of a scenario for `lane`.",
        ),
        field("angles", "{ number }", "Degrees turned at each node."),
        field("turns", "number", "Nodes at which it turns by at least 25 degrees."),
        field("mean_curvature", "number", "Mean curvature over its nodes in 1/m."),
        field("length", "number", "Its length in metres."),
    ],
};

const EVALUATE_REQUEST: ApiRecord = ApiRecord {
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
        field("frames", "number?", "How many frames from the first; all where it is left out."),
    ],
};

const EVALUATION: ApiRecord = ApiRecord {
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

const EVALUATION_ROW: ApiRecord = ApiRecord {
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
