//! What a session and its workers say to each other: JSON, a line a message. `docs/worker-protocol.md` is its page.
//!
//! The session speaks first, with [`ToWorker::Hello`]; the worker answers [`FromWorker::Ready`] and from then on gets jobs, at most
//! as many at a time as it has slots. For each it says how far it is and, once, what it came to. It ends when its input ends.

use std::path::PathBuf;

use pdk_components::catalog::Catalog;
use pdk_components::search_path::SearchPath;
use pdk_model::component::ComponentSpec;
use pdk_model::error::ErrorKind;
use pdk_model::outcome::{Cause, Outcome};
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::{Scenario, ScenarioId};
use pdk_model::search::{Candidate, Evaluated as EvaluatedCandidate, Problem};
use pdk_sdk::describe::Kind;
use pdk_sdk::error::Error;
use pdk_sdk::input_files::InputFiles;
use pdk_sdk::prelude::{Camera, Control};
use serde::{Deserialize, Serialize};

use crate::stages::Times;
use pdk_truth::taken::{Take, Taken};

/// The version of the protocol, which has to be the same at both ends. `docs/worker-protocol.md` says what is a new version.
pub const VERSION: u32 = 2;
/// The minor version. A session sends no work that is newer than the minor version of the worker, and both ends ignore fields and messages that are
/// newer than their own.
pub const MINOR: u32 = 2;

/// A message to a worker.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToWorker {
    /// Who calls, and how scenarios are driven.
    Hello(Hello),
    /// Something to do.
    Job(Box<Job>),
}

/// The first message.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// [`VERSION`].
    pub protocol: u32,
    /// [`MINOR`].
    #[serde(default)]
    pub minor: u32,
    /// The run's name on the topics: letters, digits, dashes and underscores.
    pub run: String,
    /// How long one call of a component may take, in seconds.
    pub patience: f64,
    /// How much memory a process with components may take, in MiB.
    pub memory: u64,
    /// Where components are looked for besides the usual places.
    pub search: SearchPath,
}

/// Something to do, under a number that the session chooses.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Job {
    /// The number, which answers carry.
    pub number: u64,
    /// The number of the slot that does it: no two jobs have the same at the same time, so ports may be derived from it.
    pub slot: u32,
    /// The id of the scenario that is to be driven, as the session understands it. A worker that understands it otherwise, because it
    /// does not know a field, does not drive it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<ScenarioId>,
    /// Whether a pool has put files elsewhere that the scenario names in the words of a command. Such a scenario has another id for the
    /// worker, and is driven nevertheless; its trace has the session's.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub moved: bool,
    /// What to do.
    pub work: Work,
}

impl Job {
    /// The id of a scenario that is to be driven, under which it is recorded.
    pub fn id(&self, drive: &Drive) -> ScenarioId {
        self.scenario.unwrap_or_else(|| drive.scenario.id())
    }
}

/// What there is to do.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Work {
    /// Drive a scenario.
    Drive(Box<Drive>),
    /// Evaluate frames of a dataset, one after the other.
    Evaluate(Box<EvaluateFrames>),
    /// Make a component and describe it.
    Make(Make),
    /// List the files that a component would read besides those that its parameters name. Only a worker of this machine gets it.
    InputFiles(Make),
    /// Take a step of a search. Only a worker of this machine gets it, which does nothing else.
    Search(Box<SearchStep>),
}

impl Work {
    /// What of it came when the version had grown, and how often it had by then; none if the version had it from the start.
    pub fn came_later(&self) -> Option<(u32, &'static str)> {
        match self {
            Self::Evaluate(frames) if matches!(frames.subject, Subject::Predictor { .. }) => {
                Some((1, "predictors"))
            }
            // An id protects a scenario from a worker that does not know the field.
            Self::Evaluate(frames)
                if frames.perturbation.as_ref().is_some_and(|one| one.during.is_some()) =>
            {
                Some((1, "the modifier `during`"))
            }
            _ => None,
        }
    }
}

/// A scenario to drive.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Drive {
    /// What to drive.
    pub scenario: Scenario,
    /// What it is called.
    pub name: String,
    /// Where the trace goes, from the root; none for no trace.
    pub trace: Option<PathBuf>,
    /// Every how many frames an image goes into the trace; 0 for none.
    pub images_every: u64,
    /// In real time: which frames to skip, instead of those that the clock says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skips: Option<Vec<Skip>>,
    /// The saliency method whose maps of what the driver saw go into the trace with the images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<ComponentSpec>,
}

/// Frames that were skipped in real time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skip {
    /// The number of the frame behind which they came.
    pub behind: u64,
    /// How many they were.
    pub count: u64,
}

/// Frames of a dataset to evaluate: they belong to one sequence and are driven one after the other, so that the driver remembers
/// earlier ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EvaluateFrames {
    /// The dataset.
    pub dataset: ComponentSpec,
    /// What looks at the frames.
    #[serde(flatten)]
    pub subject: Subject,
    /// What every frame goes through; none for the frames as they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perturbation: Option<AppliedPerturbation>,
    /// What random numbers come from.
    pub seed: u64,
    /// The first frame of the sequence, from 0: the driver counts frames and time from here.
    pub sequence: usize,
    /// The first frame before `from` that a perturbation may be shown, because the one before it ended the process.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub earliest: Option<usize>,
    /// The first frame that is driven. What the driver makes of those before `start` does not count.
    pub from: usize,
    /// The first frame whose result counts.
    pub start: usize,
    /// The frame behind the last.
    pub end: usize,
}

/// What looks at the frames of a dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Subject {
    /// A driver under test.
    Driver(ComponentSpec),
    /// A predictor under test, with what is taken from its outputs.
    Predictor {
        /// The predictor.
        component: ComponentSpec,
        /// What is taken.
        take: Take,
    },
}

/// A component to make.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Make {
    /// Its kind.
    pub kind: Kind,
    /// Its name and parameters.
    pub component: ComponentSpec,
}

/// A step of a search: what of it is there is done in this order.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SearchStep {
    /// Begin a search, which ends the one before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<StartSearch>,
    /// Tell these results.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tell: Vec<EvaluatedCandidate>,
    /// Ask for this many candidates.
    #[serde(default)]
    pub ask: usize,
}

/// A search to begin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StartSearch {
    /// The strategy.
    pub strategy: ComponentSpec,
    /// What it searches.
    pub problem: Problem,
    /// The key of all that it draws.
    pub key: [u8; 32],
}

/// What a worker says.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FromWorker {
    /// It can be given jobs.
    Ready(Ready),
    /// This many more frames of a job are done.
    Progress(Progress),
    /// A job is done.
    Done(Done),
    /// A component ended the process outside of a job, such as when an instance was dropped; one sentence.
    Trouble(String),
    /// It cannot go on, and why.
    Failed(String),
}

impl ToWorker {
    /// The names of the messages.
    pub const NAMES: [&str; 2] = ["hello", "job"];
}

impl FromWorker {
    /// The names of the messages.
    pub const NAMES: [&str; 5] = ["ready", "progress", "done", "trouble", "failed"];
}

/// The answer to [`Hello`].
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Ready {
    /// [`VERSION`].
    pub protocol: u32,
    /// [`MINOR`].
    #[serde(default)]
    pub minor: u32,
    /// The version of pdk.
    pub pdk: String,
    /// How many jobs it takes at a time.
    pub slots: u32,
    /// The components it has.
    pub catalog: Catalog,
    /// What it found but cannot use, one sentence each.
    pub refused: Vec<String>,
    /// What lies beside the pipeline and cannot be used: the name that it would have had, and why.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub passed_over: Vec<(String, String)>,
}

/// How far a job is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Progress {
    /// The job.
    pub number: u64,
    /// Frames since the last message.
    pub frames: u64,
}

/// What a job came to.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Done {
    /// The job.
    pub number: u64,
    /// What it came to.
    pub answer: Answer,
}

/// What a job came to.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// A scenario was driven, to whatever end.
    Driven(Driven),
    /// Frames were evaluated.
    Evaluated(Evaluated),
    /// A component was made.
    Made(Made),
    /// The files that a component would read were listed.
    InputFiles(Vec<InputFiles>),
    /// A step of a search was taken; these are the candidates that were asked for.
    Proposed(Vec<Candidate>),
    /// A component failed, so that there is no result.
    Failed(Failure),
    /// Something else failed, such as the disk: nothing is to be expected of the next job either.
    Broken(Failure),
}

impl Answer {
    /// Whether it is what was asked for, whatever came of the driving.
    pub fn is_good(&self) -> bool {
        match self {
            Self::Driven(driven) => driven.outcome.cause != Cause::Error,
            Self::Evaluated(_) | Self::Made(_) | Self::InputFiles(_) | Self::Proposed(_) => true,
            Self::Failed(_) | Self::Broken(_) => false,
        }
    }
}

/// A scenario's outcome and what else there is to know.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Driven {
    /// What happened.
    pub outcome: Outcome,
    /// Frames per second of simulation time; 0 where the simulator did not come to tell.
    pub rate: f64,
    /// How long the stages of the steps took.
    pub times: Times,
    /// What was noticed, such as a component that changed the working directory; one sentence each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

impl Driven {
    /// What becomes of a scenario whose process was lost after this many frames.
    pub fn lost(kind: ErrorKind, message: String, frames: u64) -> Self {
        let outcome = Outcome { frames, ..Outcome::of_error(kind, message) };
        Self { outcome, rate: 0.0, times: Times::default(), warnings: Vec::new() }
    }
}

/// What frames gave.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Evaluated {
    /// One for each frame, in their order.
    pub frames: Vec<EvaluatedFrame>,
    /// Time of all perturbations together, in seconds.
    pub perturbation_seconds: f64,
    /// Time of all predictions together, in seconds.
    pub driver_seconds: f64,
}

/// What a frame gave.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(untagged)]
pub enum EvaluatedFrame {
    /// The driver decided.
    Good {
        /// The name of the frame.
        frame: String,
        /// What was recorded; not a number if it was not.
        #[serde(with = "crate::recorded")]
        truth: Control,
        /// What the driver makes of it.
        control: Control,
    },
    /// The predictor gave its outputs.
    Predicted {
        /// The name of the frame.
        frame: String,
        /// What was recorded; not a number if it was not.
        #[serde(with = "crate::recorded")]
        truth: Control,
        /// What was taken from them.
        taken: Taken,
    },
    /// It could not be read, or a component failed.
    Bad {
        /// The name of the frame.
        frame: String,
        /// The reason.
        error: String,
        /// Whether it was the driver or the predictor that failed.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        by_driver: bool,
    },
}

/// What a component is like once it is made.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Made {
    /// A simulator's camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    /// The number of frames in a dataset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<usize>,
    /// The frames of a dataset that begin a sequence: see [`crate::sequences`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sequences: Vec<usize>,
    /// What a driver or a dataset says of itself.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub info: Vec<(String, String)>,
}

/// An error on its way to the session.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// Its kind.
    pub kind: ErrorKind,
    /// Its sentence.
    pub message: String,
    /// Of an evaluation: the number of the frame at which the process was lost, if that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<u64>,
    /// Of an evaluation: whether the driver was at work.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub by_driver: bool,
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self { kind: error.kind(), message: error.message().to_owned(), at: None, by_driver: false }
    }
}

impl From<Failure> for Error {
    fn from(failure: Failure) -> Self {
        Error::of(failure.kind, failure.message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_names_are_those_of_all_messages() {
        let known = |error: serde_json::Error, names: &[&str]| {
            let names: Vec<_> = names.iter().map(|name| format!("`{name}`")).collect();
            let error = error.to_string();
            let listed = error.split_once("expected ").unwrap().1.split(" at ").next().unwrap();
            assert_eq!(listed.trim_start_matches("one of ").replace(" or ", ", "), names.join(", "));
        };
        let unknown = r#"{"later":0}"#;
        known(serde_json::from_str::<ToWorker>(unknown).unwrap_err(), &ToWorker::NAMES);
        known(serde_json::from_str::<FromWorker>(unknown).unwrap_err(), &FromWorker::NAMES);
    }
}
