//! What a page is about, as plain data. Texts may hold anything: they are escaped when the page is made.

use pdk_model::component::ComponentSpec;
pub use pdk_model::outcome::{Measures, Verdict};
use serde::Serialize;

/// A run.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Run {
    /// What the run is called.
    pub title: String,
    /// The folder of its record, as the reader of the page would write it.
    pub folder: String,
    /// When it began, in seconds since 1970 in universal time.
    pub started: Option<u64>,
    /// How the record shows that the run did not come to its end, as a sentence.
    pub unfinished: Option<String>,
    /// What was run.
    pub setup: Setup,
    /// What was driven: an entry for each simulator, driver and mode.
    pub drives: Vec<Drive>,
    /// What was evaluated on recordings.
    pub evaluations: Vec<Evaluation>,
    /// What was evaluated on pictures with predictors.
    pub tasks: Vec<Task>,
    /// What was searched.
    pub searches: Vec<Search>,
    /// How long driving took, all scenarios together; none if nothing was driven.
    pub drive_times: Option<DriveTimes>,
    /// How long each evaluation took.
    pub evaluate_times: Vec<EvaluateTimes>,
    /// Further records that the page is about; drives, evaluations and searches are those of all.
    pub others: Vec<Other>,
}

/// A further record.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Other {
    /// Its folder.
    pub folder: String,
    /// How it shows that its run did not come to its end.
    pub unfinished: Option<String>,
    /// What was run.
    pub setup: Setup,
}

/// What has to be equal for two runs to be equal.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Setup {
    /// The version of pdk.
    pub version: String,
    /// The seed.
    pub seed: u64,
    /// The file of the pipeline.
    pub pipeline: String,
    /// Its text.
    pub source: String,
    /// Names and texts of the modules that it requires.
    pub modules: Vec<(String, String)>,
    /// The command that repeats the run.
    pub command: String,
    /// Names and values of the settings.
    pub settings: Vec<(String, String)>,
    /// The components.
    pub components: Vec<Component>,
    /// Names and hashes of other files, such as models.
    pub files: Vec<(String, String)>,
    /// The machine.
    pub machine: String,
}

/// A component in use.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Component {
    /// Such as "driver".
    pub kind: String,
    /// Its name.
    pub name: String,
    /// The version of its algorithm.
    pub version: u32,
    /// What it says of itself.
    pub info: String,
    /// The file that it comes from.
    pub file: String,
    /// The hash of that file.
    pub hash: String,
}

/// What was driven with one simulator, one driver and in one mode.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Drive {
    /// The simulator with its parameters.
    pub simulator: String,
    /// The driver with its parameters.
    pub driver: String,
    /// The same as data.
    #[serde(skip)]
    pub driver_spec: Option<ComponentSpec>,
    /// What happens while the driver is at work, such as "lockstep".
    pub mode: String,
    /// The centre lines of the roads: points of x to the right and z ahead, in metres.
    pub roads: Vec<Vec<[f64; 2]>>,
    /// The scenarios, in order.
    pub scenarios: Vec<Scenario>,
}

/// A scenario that was driven.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Scenario {
    /// Its number in the run.
    pub index: u64,
    /// Its name.
    pub name: String,
    /// The perturbation without its level; none if there is none.
    pub perturbation: Option<String>,
    /// The level of the perturbation; none if it has none, or no single one.
    pub level: Option<f64>,
    /// The number of its road in [`Drive::roads`]; none if the simulator did not report it.
    pub road: Option<usize>,
    /// What tells its road from the others of the run.
    pub road_id: String,
    /// The seed of all that was drawn: on the same road, drives with the same one had the same luck.
    pub seed: u64,
    /// Which drive of the same scenario it is.
    pub repeat: u64,
    /// What it says about the driver.
    pub verdict: Verdict,
    /// How it ended, such as "lane departure".
    pub cause: String,
    /// The error of a component; empty if there was none.
    pub error: String,
    /// Simulation time at the end in seconds.
    pub time: f64,
    /// Frames that the driver did not see, because it was still at work on an earlier one.
    pub skipped_frames: u64,
    /// The share of the road that was driven, 0 to 1.
    pub progress: f64,
    /// Mean absolute cross-track error in metres.
    pub mean_error: f64,
    /// Largest absolute cross-track error in metres.
    pub max_error: f64,
    /// What else was measured; none if a component failed before anything was.
    pub measures: Option<Measures>,
    /// Where the vehicle was.
    pub path: Vec<Place>,
    /// Why its trace could not be read, which leaves it without road, path and frames; empty if it could.
    pub unreadable: String,
    /// The command that replays it.
    pub replay: String,
    /// The address of a clip of it, relative to the page; empty if there is none.
    pub clip: String,
    /// The last recorded frames, in order; for a few failures only.
    pub shots: Vec<Shot>,
}

/// A sample of where the vehicle was.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Place {
    /// Metres to the right.
    pub x: f64,
    /// Metres ahead.
    pub z: f64,
    /// Cross-track error in metres; the sign says the side.
    pub error: f64,
}

/// A recorded frame as JPEG, as the camera and as the driver saw it.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Shot {
    /// Simulation time in seconds.
    pub time: f64,
    /// As the camera saw it.
    pub raw: Vec<u8>,
    /// As the driver saw it.
    pub perturbed: Vec<u8>,
    /// As the driver saw it, with what its network looked at laid over; empty if it was not asked for.
    pub attention: Vec<u8>,
}

/// What perturbations do to predictions on a recording. Errors are means of absolute differences.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Evaluation {
    /// Its number in the run.
    pub number: u64,
    /// The driver that was tested, with its parameters; empty if the record does not say it.
    pub driver: String,
    /// The dataset, with its parameters; empty if the record does not say it.
    pub dataset: String,
    /// Frames that were evaluated.
    pub frames: usize,
    /// Names of frames that could not be evaluated, with the reason.
    pub bad_frames: Vec<(String, String)>,
    /// Steering without perturbation against the recorded truth; not a number if no steering was recorded.
    pub original_error: f64,
    /// The same of the best constant.
    pub constant_error: f64,
    /// One for each perturbation and level.
    pub cells: Vec<EvaluationCell>,
    /// The frames on which perturbations do most harm, the worst first.
    pub worst: Vec<WorstFrame>,
}

/// A perturbation at a level on all frames of a recording.
#[derive(Debug, Clone, Default, Serialize)]
pub struct EvaluationCell {
    /// The perturbation without its level.
    pub perturbation: String,
    /// The level.
    pub level: f64,
    /// Steering against the recorded truth; not a number if none was recorded.
    pub error: f64,
    /// Steering against that without perturbation.
    pub drift: f64,
    /// Where the error may lie, with a probability of 95 %. None if the frames are too few to say.
    pub error_interval: Option<(f64, f64)>,
    /// Where the drift may lie.
    pub drift_interval: Option<(f64, f64)>,
    /// The error on each frame, by its number; the drift if no steering was recorded.
    #[serde(skip)]
    pub frames: Vec<(usize, f64)>,
}

/// The steering on one frame.
#[derive(Debug, Clone, Default, Serialize)]
pub struct WorstFrame {
    /// The name of the frame.
    pub frame: String,
    /// The perturbation without its level.
    pub perturbation: String,
    /// The level.
    pub level: f64,
    /// As recorded.
    pub truth: f64,
    /// Without perturbation.
    pub original: f64,
    /// With it.
    pub perturbed: f64,
}

/// What perturbations do to a predictor.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Task {
    /// The number of the evaluation in the run.
    pub number: u64,
    /// The metric.
    pub name: String,
    /// Pictures that were evaluated.
    pub frames: usize,
    /// The numbers of the metric.
    pub numbers: Vec<TaskNumber>,
    /// Names of pictures that could not be evaluated, with the reason.
    pub bad_frames: Vec<(String, String)>,
}

/// A number of a metric.
#[derive(Debug, Clone, Default, Serialize)]
pub struct TaskNumber {
    /// What it is.
    pub name: String,
    /// The number without perturbation.
    pub original: Option<f64>,
    /// For perturbations and levels the number under them.
    pub cells: Vec<(String, f64, f64)>,
}

/// How long driving took.
#[derive(Debug, Clone, Default, Serialize)]
pub struct DriveTimes {
    /// Scenarios at the same time, at most.
    pub workers: u64,
    /// Frames per second of wall time.
    pub frames_per_second: f64,
    /// Simulated seconds per second of wall time.
    pub real_time_factor: f64,
    /// Frames.
    pub steps: u64,
    /// Frames that took longer than they last.
    pub overruns: u64,
    /// Median and 99th percentile in milliseconds of simulator, perturbation, driver and kernel.
    pub stages: [(f64, f64); 4],
}

/// How long evaluating took.
#[derive(Debug, Clone, Default, Serialize)]
pub struct EvaluateTimes {
    /// Frames at the same time, at most.
    pub workers: u64,
    /// Perturbed frames.
    pub frames: u64,
    /// Perturbed frames per second of wall time.
    pub frames_per_second: f64,
    /// Mean time of a perturbation in milliseconds.
    pub perturbation: f64,
    /// Mean time of a prediction in milliseconds.
    pub driver: f64,
}

/// A search.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Search {
    /// Its name.
    pub name: String,
    /// The strategy with its parameters.
    pub strategy: String,
    /// Whether the strategy learns nothing, so that others are compared with it.
    pub baseline: bool,
    /// The seed.
    pub seed: u64,
    /// Why it ended.
    pub stopped: String,
    /// How many different candidates were evaluated.
    pub evaluations: usize,
    /// How many were the same as an earlier one.
    pub duplicates: usize,
    /// How many could not be evaluated.
    pub failures: usize,
    /// How many different ones are critical.
    pub critical: usize,
    /// How many were evaluated up to the first critical one.
    pub first_critical: Option<usize>,
    /// What tells its setting from others: space, objectives, reference, and what all of its scenarios share but for road and
    /// perturbations. Searches with the same can be compared.
    pub setting: String,
    /// The simulator; empty if none was driven, or not the same in all scenarios.
    pub simulator: String,
    /// The driver; empty as for the simulator.
    pub driver: String,
    /// Whether its hypervolumes have a reference that was given, so that they can be compared.
    pub has_reference: bool,
    /// The names of the variables.
    pub variables: Vec<String>,
    /// What each may be, in words.
    pub ranges: Vec<String>,
    /// The names of the objectives.
    pub objectives: Vec<String>,
    /// All candidates.
    pub tests: Vec<Test>,
    /// Critical ones that are unlike each other.
    pub distinct: Vec<usize>,
    /// Those that no other is better than.
    pub front: Vec<usize>,
    /// Where most are critical.
    pub regions: Vec<Region>,
    /// The tree over all of them, each node before those beneath it.
    pub tree: Vec<Branch>,
    /// What was reached after how many.
    pub convergence: Vec<Reached>,
}

/// A candidate of a search.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Test {
    /// The value of each variable.
    pub values: Vec<String>,
    /// The same as numbers; empty if one is out of its range.
    pub positions: Vec<f64>,
    /// Its objectives; empty if it could not be evaluated.
    pub objectives: Vec<f64>,
    /// Whether it is critical.
    pub critical: bool,
    /// How its scenario ended.
    pub cause: String,
    /// The command that replays it; empty if it drove none.
    pub replay: String,
}

/// A region of a space.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Region {
    /// Which, in words.
    pub words: String,
    /// How many were evaluated there.
    pub evaluations: usize,
    /// How many of these are critical.
    pub critical: usize,
}

/// A node of a tree.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Branch {
    /// How many nodes lie above it.
    pub depth: usize,
    /// What tells it from the other node beneath the same.
    pub words: String,
    /// How many were evaluated there.
    pub evaluations: usize,
    /// How many of these are critical.
    pub critical: usize,
}

/// What was reached after this many evaluations.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Reached {
    /// How many.
    pub evaluations: usize,
    /// The hypervolume of the best so far.
    pub hypervolume: f64,
    /// Critical candidates that are unlike each other.
    pub distinct: usize,
}
