//! Driving scenarios: what is asked for and what came of it.

use pdk_lua::ApiRecord;

use super::field;

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

pub(super) const SCENARIO: ApiRecord = ApiRecord {
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

pub(super) const SESSION_REQUEST: ApiRecord = ApiRecord {
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

pub(super) const DRIVE_REQUEST: ApiRecord = ApiRecord {
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

pub(super) const OUTCOME: ApiRecord = ApiRecord {
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
            "\"passed\" | \"unsafe\" | \"stopped\" | \"late\" | \"void\"",
            "What that says about the driver: it reached the end; it left its lane or hit something; it stood still; it was too \
             slow to reach the end in time; nothing, because a component failed or it is driven elsewhere.",
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

pub(super) const MEASURES: ApiRecord = ApiRecord {
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
