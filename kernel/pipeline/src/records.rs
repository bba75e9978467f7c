//! The tables that pipelines write and read, as types for editors.

use pdk_core::modifiers::{
    ATTENTION as APPLIED_ATTENTION, DRAWS, PROBABILITY, REGION as APPLIED_REGION, WHERE,
};
use pdk_lua::{ApiField, ApiRecord};

const fn field(name: &'static str, luau_type: &'static str, doc: &'static str) -> ApiField {
    ApiField { name, luau_type, doc }
}

/// All of them, in the order of the type definition file.
pub const RECORDS: [&ApiRecord; 28] = [
    &COMPONENT,
    &SCHEDULE,
    &REGION,
    &SELECTION,
    &ATTENTION,
    &APPLIED,
    &FAILURE_CRITERIA,
    &SCENARIO,
    &SESSION_REQUEST,
    &DRIVE_REQUEST,
    &OUTCOME,
    &MEASURES,
    &ESTIMATE,
    &PAIRED,
    &INDEPENDENT,
    &TRIAL,
    &FAILING_LEVEL,
    &BISECTION,
    &SEARCH_RANGE,
    &SEARCH_STRATEGY,
    &SEARCH_JUDGEMENT,
    &SEARCH_REQUEST,
    &SEARCH_RESULT,
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

const ATTENTION: ApiRecord = ApiRecord {
    name: "Attention",
    doc: "The saliency maps that a perturbation follows.",
    fields: &[
        field("by", "string | Component", "The saliency method that makes them."),
        field("every", "number?", "As in `Selection`."),
        field("change", "number?", "As in `Selection`."),
        field("follow", "boolean?", "As in `Selection`."),
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
        field(APPLIED_ATTENTION.name, "(string | Attention)?", APPLIED_ATTENTION.doc),
        field(DRAWS.name, "(\"per_frame\" | \"per_sequence\")?", DRAWS.doc),
        field("[string]", "any", "Its parameters."),
    ],
};

const FAILURE_CRITERIA: ApiRecord = ApiRecord {
    name: "FailureCriteria",
    doc: "What counts as a failure, besides a collision and the time limit, which always do.",
    fields: &[
        field(
            "lane_departure",
            "number?",
            "The absolute cross-track error in metres at which the vehicle has left its lane. Where it is left out, the simulator \
             says that itself: `lane` at 2. As published: 2 for DonkeyCar, 4 for Udacity.",
        ),
        field(
            "comparison",
            "(\"at_least\" | \"more_than\")?",
            "Whether the error has to reach `lane_departure`, as published and where it is left out, or to exceed it.",
        ),
        field(
            "standstill_speed",
            "number?",
            "A vehicle slower than this stands still; 0.1 m/s where it is left out.",
        ),
        field(
            "standstill_seconds",
            "number?",
            "So many seconds of standing still end a drive; 5 where it is left out.",
        ),
        field(
            "over_line",
            "number?",
            "The absolute cross-track error in metres at which a wheel is over the line, which is measured and ends nothing. 1.1 \
             where it is left out: a vehicle 1.8 m wide in a lane of 4 m.",
        ),
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
        field(
            "failure",
            "FailureCriteria?",
            "What counts as a failure; what it leaves out is as in the request.",
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
        field("failure", "FailureCriteria?", "What counts as a failure."),
        field(
            "images_every",
            "number?",
            "Every how many frames an image goes into the trace: 6 where it is left out, 0 for none.",
        ),
        field(
            "mode",
            "(\"lockstep\" | \"realtime\")?",
            "Whether the simulator waits for the driver, as it does where this is left out and it can.",
        ),
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
        field("failure", "FailureCriteria?", "What counts as a failure."),
        field(
            "images_every",
            "number?",
            "Every how many frames an image goes into the trace: 6 where it is left out, 0 for none. Of a scenario that fails, \
             the last frame goes there too, and those one and two seconds before where no image is.",
        ),
        field(
            "mode",
            "(\"lockstep\" | \"realtime\")?",
            "Whether the simulator waits for the driver, as it does where this is left out and it can, or goes on by the clock.",
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
            "\"finished\" | \"lane_departure\" | \"collision\" | \"no_progress\" | \"time_out\" | \"error\" | \"elsewhere\"",
            "How it ended; `elsewhere` where another part of the run drives it (`--shard`).",
        ),
        field(
            "verdict",
            "\"passed\" | \"unsafe\" | \"stopped\" | \"void\"",
            "What that says about the driver: it reached the end; it left its lane or hit something; it stood still or was too \
             slow, which endangers nobody; nothing, because a component failed or it is driven elsewhere.",
        ),
        field("error", "string?", "What failed, where a component did."),
        field("time", "number", "Simulation time at the end in seconds."),
        field("frames", "number", "Frames that were driven."),
        field("skipped_frames", "number", "In real time: frames that the driver was too slow to see."),
        field("progress", "number", "The share of the road that was driven, 0 to 1."),
        field(
            "mean_cross_track_error",
            "number",
            "Mean absolute cross-track error over all frames in metres. Drives that were cut short are not comparable in it.",
        ),
        field("max_cross_track_error", "number", "Largest absolute cross-track error in metres."),
        field("measures", "Measures?", "What else was measured; nothing where a component failed before."),
        field("digest", "string", "A hash of every frame that the driver saw and every control it gave."),
    ],
};

const MEASURES: ApiRecord = ApiRecord {
    name: "Measures",
    doc: "What is measured of a drive besides its end.",
    fields: &[
        field("over_line_from", "number?", "When a wheel was over the line first, in seconds."),
        field("over_line_seconds", "number", "For how many seconds a wheel was over the line."),
        field("rms_lateral_acceleration", "number", "Root mean square of speed times yaw rate, in m/s²."),
        field("max_lateral_acceleration", "number", "The largest of these."),
        field(
            "rms_jerk",
            "number",
            "Root mean square of the change of the acceleration along and across, in m/s³.",
        ),
        field("max_jerk", "number", "The largest of these."),
    ],
};

const ESTIMATE: ApiRecord = ApiRecord {
    name: "Estimate",
    doc: "A value with its interval.",
    fields: &[
        field("value", "number", "The value."),
        field("low", "number", "The lower end of its interval."),
        field("high", "number", "The upper end."),
    ],
};

const PAIRED: ApiRecord = ApiRecord {
    name: "Paired",
    doc: "What two conditions on the same roads differ by.",
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
            "How likely a mean difference of at least this size is where the conditions do not differ: a randomisation test over \
             roads.",
        ),
        field("roads", "number", "Roads that have both."),
    ],
};

const INDEPENDENT: ApiRecord = ApiRecord {
    name: "Independent",
    doc: "What two samples differ by that have nothing to do with each other.",
    fields: &[
        field(
            "effect_size",
            "number",
            "The probability that a value of the first is larger than one of the second, with ties as one half: 0.5 where they do \
             not differ (Vargha and Delaney's A).",
        ),
        field(
            "p",
            "number",
            "How likely such a difference is where they do not differ: the two-sided test of Mann and Whitney.",
        ),
    ],
};

const TRIAL: ApiRecord = ApiRecord {
    name: "Trial",
    doc: "A drive at a level.",
    fields: &[field("level", "number", "The level."), field("failed", "boolean", "Whether it failed.")],
};

const FAILING_LEVEL: ApiRecord = ApiRecord {
    name: "FailingLevel",
    doc: "The level at which the probability of failing reaches one half.",
    fields: &[
        field(
            "level",
            "number?",
            "The level: the lowest that was driven where it is reached there already, nothing where it is not reached up to the \
             highest.",
        ),
        field("low", "number?", "The lower end of its interval, in the same terms."),
        field("high", "number?", "The upper end; nothing where it may lie above the highest level."),
        field("drives", "number", "How many drives it was found with."),
    ],
};

const BISECTION: ApiRecord = ApiRecord {
    name: "Bisection",
    doc: "Levels in which the failing level is looked for.",
    fields: &[
        field("lowest", "number?", "The lowest level; 0 where it is left out."),
        field("highest", "number?", "The highest level; 4 where it is left out."),
        field(
            "resolution",
            "number?",
            "How close the levels that were survived and failed come in the end; 0.25 where it is left out.",
        ),
    ],
};

const SEARCH_RANGE: ApiRecord = ApiRecord {
    name: "SearchRange",
    doc: "The values that a variable of a search may take: one of the fields.",
    fields: &[
        field("integer", "{ number }?", "The smallest and the largest of whole numbers."),
        field("real", "{ number }?", "The smallest and the largest of all numbers."),
        field(
            "ordinal",
            "{ any }?",
            "A list in which neighbours are alike, such as perturbations ranked by their effect.",
        ),
        field("choice", "{ any }?", "A list in whose order nothing lies."),
    ],
};

const SEARCH_STRATEGY: ApiRecord = ApiRecord {
    name: "SearchStrategy",
    doc: "A strategy of the pipeline's own.",
    fields: &[
        field(
            "start",
            "((problem: { variables: { any }, objectives: { string }, evaluations: number? }, random: Random) -> ())?",
            "Called once. A variable has `name` and `type`, and `min` and `max` or `values`. Everything that is drawn comes from \
             `random`.",
        ),
        field(
            "ask",
            "(n: number) -> { { [string]: any } }",
            "The next candidates, at most `n`, each a table with a value for each variable. None where the search is over.",
        ),
        field(
            "tell",
            "((results: { { id: number, values: { [string]: any }, objectives: { number }, violation: number, critical: boolean, \
             failure: string? } }) -> ())?",
            "How the candidates of the last `ask` did: all of them, in their order. Objectives are those of the search in the order \
             of their names, and smaller is better; there are none where a candidate could not be evaluated.",
        ),
        field("batch", "number?", "How many candidates it is asked for at once; 16 where it is left out."),
    ],
};

const SEARCH_JUDGEMENT: ApiRecord = ApiRecord {
    name: "SearchJudgement",
    doc: "What is said of a candidate.",
    fields: &[
        field(
            "objectives",
            "{ [string]: number }?",
            "A value for each objective. For a scenario, those that are left out are fields of its outcome, or `time_to_failure` (the \
             share of the road that was left) or `criticality` (negative where the driver failed, the less the earlier).",
        ),
        field(
            "critical",
            "boolean?",
            "Whether it shows what is searched for; for a scenario, whether the driver failed where it is left out.",
        ),
        field(
            "violations",
            "{ number }?",
            "By how much each constraint is violated that shows only now; 0 or less where it holds.",
        ),
    ],
};

const SEARCH_REQUEST: ApiRecord = ApiRecord {
    name: "SearchRequest",
    doc: "What `pdk.search` takes.",
    fields: &[
        field("space", "{ [string]: SearchRange }", "The variables."),
        field(
            "constraints",
            "{ ((values: { [string]: any }) -> number) | { weights: { [string]: number }, at_most: number } }?",
            "What has to hold for a candidate to be evaluated: functions that return at most 0, and sums of weights times values \
             that are at most a number. The value of an ordinal is its place in its list, from 0.",
        ),
        field(
            "objectives",
            "{ [string]: \"minimise\" | \"maximise\" }",
            "What is to be best. Several are a compromise: what no other is better than in all of them.",
        ),
        field("strategy", "string | Component | SearchStrategy", "Who proposes: see `pdk list search`."),
        field(
            "evaluate",
            "(values: { [string]: any }) -> Scenario | SearchJudgement",
            "Makes a scenario of the values of a candidate, or evaluates it by itself: then what it returns has `objectives`.",
        ),
        field(
            "outcome",
            "((outcome: Outcome, values: { [string]: any }) -> SearchJudgement)?",
            "Judges the outcome of a scenario. Not called where a component failed.",
        ),
        field(
            "stop",
            "{ evaluations: number?, seconds: number?, hypervolume: number? }",
            "When to stop, whichever comes first: after so many different candidates, after so much time, or when the best \
             compromises dominate such a volume.",
        ),
        field(
            "reference",
            "{ [string]: number }?",
            "The worst value of each objective that counts for the hypervolume.",
        ),
        field("name", "string?", "What the files in the record are called; `search` where it is left out."),
        field(
            "seed",
            "number?",
            "The seed of what the strategy draws; that of the run where it is left out.",
        ),
        field("simulator", "(string | Component)?", "The simulator of the scenarios."),
        field("driver", "(string | Component)?", "The driver under test."),
        field("duration", "number?", "The time limit of a scenario in seconds of simulation time."),
        field("images_every", "number?", "As in `DriveRequest`."),
        field("mode", "(\"lockstep\" | \"realtime\")?", "As in `DriveRequest`."),
    ],
};

const SEARCH_RESULT: ApiRecord = ApiRecord {
    name: "SearchResult",
    doc: "What `pdk.search` returns. Candidates go by their numbers, from 0.",
    fields: &[
        field("name", "string", "What the files in the record are called."),
        field(
            "stopped",
            "\"evaluations\" | \"seconds\" | \"hypervolume\" | \"strategy\" | \"exhausted\" | \"nothing new\"",
            "Why it ended: a limit was reached, the strategy proposed no more, every candidate was evaluated, or ten thousand in a \
             row were known.",
        ),
        field("evaluations", "number", "How many different candidates were evaluated."),
        field("proposed", "number", "How many were proposed."),
        field(
            "duplicates",
            "number",
            "How many were the same as an earlier one, and answered with its result.",
        ),
        field("failures", "number", "How many could not be evaluated."),
        field("critical", "number", "How many different candidates are critical."),
        field(
            "first_critical",
            "number?",
            "How many different candidates were evaluated up to the first critical one; none where there is none.",
        ),
        field(
            "distinct_failures",
            "{ number }",
            "Critical candidates that differ by more than a tenth of the ranges.",
        ),
        field("front", "{ number }", "The candidates that no other is better than."),
        field(
            "tests",
            "{ { number: number, values: { [string]: any }, objectives: { [string]: number }?, violation: number?, \
             critical: boolean?, same_as: number?, failure: string?, cause: string?, scenario: string? } }",
            "All candidates.",
        ),
        field(
            "tree",
            "{ nodes: { any }, critical_regions: { { region: string, evaluations: number, critical: number, share: number } } }?",
            "The decision tree over all evaluations, and the regions in which most are critical, in words.",
        ),
        field(
            "convergence",
            "{ { evaluations: number, hypervolume: number?, critical: number, distinct_failures: number } }",
            "What was reached after how many evaluations. Where there is no `reference`, hypervolumes are those up to the worst value \
             of each objective in this search.",
        ),
        field(
            "[string]",
            "any",
            "What was asked for: space, objectives, strategy, seed, `hypervolume_reference`.",
        ),
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
