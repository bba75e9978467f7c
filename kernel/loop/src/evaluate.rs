//! Evaluates frames of a dataset: perturbs them and asks the driver what it makes of them, one after the other as in a drive.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::held::Held;
use pdk_components::registry::Registry;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::prelude::{Control, Dataset, DriveContext, Driver, Entry, Frame, FrameBuf, Predictor};
use pdk_supervise::calls::Function;

use crate::protocol::{EvaluateFrames, Evaluated, EvaluatedFrame, Subject};
use pdk_truth::taken::{Take, Taken};

/// Decoded pictures that are kept for the next perturbation of the same frames, in bytes.
const KEPT_PICTURES: usize = 256 << 20;

/// Values that a job may return, so that its answer is a message that can be sent.
const MOST_VALUES: usize = 4 << 20;

/// A dataset and what looks at its frames, which are kept from one job to the next.
pub struct Evaluator {
    dataset: Held<dyn Dataset>,
    looking: Looking,
    pictures: Pictures,
    perturbed: FrameBuf,
}

/// What looks at frames.
enum Looking {
    Driver(Held<dyn Driver>),
    Predictor(Held<dyn Predictor>, Take),
}

/// What was seen in a frame.
enum Seen {
    Control(Control),
    Taken(Taken),
}

/// Entries of a dataset by their number, as many as there is room for.
#[derive(Default)]
struct Pictures {
    entries: HashMap<usize, Entry>,
    bytes: usize,
}

/// Why a frame has no result.
struct Failed {
    error: Error,
    by_driver: bool,
}

impl From<Error> for Failed {
    fn from(error: Error) -> Self {
        Self { error, by_driver: false }
    }
}

/// Evaluates the frames of a job with the evaluator that is kept, which is made anew for another dataset or driver. `progress` is called
/// for every frame.
///
/// A frame that cannot be read or at which a component fails is bad, and the driver begins anew behind it.
///
/// # Errors
/// If a component cannot be made, or one says that the machine's set-up is wrong.
pub fn frames(
    kept: &mut Option<Evaluator>,
    registry: &Registry,
    job: &EvaluateFrames,
    progress: &mut dyn FnMut(u64),
) -> Result<Evaluated> {
    let mut evaluator = match kept.take() {
        Some(evaluator) if evaluator.is_for(job) => evaluator,
        _ => Evaluator::new(registry, job)?,
    };
    let mut chain = chain(registry, job)?;
    let earliest = chain.as_ref().map_or(job.from, |chain| earliest(chain, job));
    evaluator.pictures.keep_only(earliest, job.end);
    let origin = evaluator.origin(job.sequence)?;
    let mut evaluated = Evaluated { frames: Vec::new(), perturbation_seconds: 0.0, driver_seconds: 0.0 };
    // What a perturbation shows of frames before those of the job. One that cannot be read or perturbed is left out, as it is in a sequence.
    for index in earliest..job.from {
        let Some(earlier) = &mut chain else { break };
        let seen = evaluator.entry(index).and_then(|entry| evaluator.perturb(index, &entry, earlier));
        match seen.map_err(|error| (error.kind(), error)) {
            Ok(()) => {}
            Err((ErrorKind::Configuration, error)) => return Err(error),
            Err((kind, _)) if is_spent(kind) => {
                evaluator = Evaluator::new(registry, job)?;
                chain = self::chain(registry, job)?;
            }
            Err(_) => {}
        }
    }
    let (mut begins, mut values) = (true, 0);
    for index in job.from..job.end {
        let at = Some(index as u64);
        let name = evaluator.dataset.call(Function::Name, at, |dataset| Ok(dataset.name(index)))?;
        let found =
            evaluator.frame((index, &name), (job.sequence, origin), begins, chain.as_mut(), &mut evaluated);
        begins = found.is_err();
        let frame = match found {
            Ok((truth, Seen::Control(control))) => EvaluatedFrame::Good { frame: name, truth, control },
            Ok((truth, Seen::Taken(taken))) => {
                // What a predictor makes of frames before those is not sent.
                values += if index >= job.start { taken.size() } else { 0 };
                if values > MOST_VALUES {
                    return Err(Error::of(
                        ErrorKind::Configuration,
                        format!(
                            "the outputs of {} frames have more than {MOST_VALUES} values, which is too much to send; name those that the \
                             metric needs with `outputs` of the task",
                            index + 1 - job.start
                        ),
                    ));
                }
                EvaluatedFrame::Predicted { frame: name, truth, taken }
            }
            Err(Failed { error, .. }) if error.kind() == ErrorKind::Configuration => return Err(error),
            Err(Failed { error, by_driver }) => {
                if is_spent(error.kind()) {
                    evaluator = Evaluator::new(registry, job)?;
                    chain = self::chain(registry, job)?;
                }
                EvaluatedFrame::Bad { frame: name, error: error.message().to_owned(), by_driver }
            }
        };
        if index >= job.start {
            evaluated.frames.push(frame);
        }
        progress(1);
    }
    *kept = Some(evaluator);
    Ok(evaluated)
}

/// Whether components have to be made anew after such an error: what panicked may be in any state, and one whose program is gone does not
/// start it again.
fn is_spent(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::Panic | ErrorKind::Lost)
}

fn chain(registry: &Registry, job: &EvaluateFrames) -> Result<Option<Chain>> {
    let make = |applied| Chain::new(registry, std::slice::from_ref(applied), job.seed);
    job.perturbation.as_ref().map(make).transpose()
}

/// The first frame that a perturbation has to see, because it shows later ones something of it.
fn earliest(chain: &Chain, job: &EvaluateFrames) -> usize {
    job.from
        .saturating_sub(chain.history())
        .max(job.sequence)
        .max(job.earliest.unwrap_or_default())
        .min(job.from)
}

impl Evaluator {
    /// A frame as it was recorded, which is read if it is not kept.
    fn entry(&mut self, index: usize) -> Result<Entry> {
        let Self { dataset, pictures, .. } = self;
        let at = Some(index as u64);
        pictures.entry(index, || dataset.call(Function::Read, at, |dataset| plausible(dataset.read(index)?)))
    }

    /// Perturbs a frame into `perturbed`.
    fn perturb(&mut self, index: usize, entry: &Entry, chain: &mut Chain) -> Result<()> {
        let frame = entry.frame.as_ref();
        self.perturbed.resize(frame.width(), frame.height());
        chain.apply(frame, self.perturbed.as_mut(), &Moment::new(index as u64, entry.time).alone())
    }

    fn new(registry: &Registry, job: &EvaluateFrames) -> Result<Self> {
        let (reader, _) = registry.dataset(&job.dataset.name, &job.dataset.parameters)?;
        let looking = match &job.subject {
            Subject::Driver(driver) => {
                let (instance, _) = registry.driver(&driver.name, &driver.parameters)?;
                Looking::Driver(Held::new(Kind::Driver, driver.clone(), instance))
            }
            Subject::Predictor { component, take } => {
                let (instance, _) = registry.predictor(&component.name, &component.parameters)?;
                Looking::Predictor(Held::new(Kind::Predictor, component.clone(), instance), take.clone())
            }
        };
        Ok(Self {
            dataset: Held::new(Kind::Dataset, job.dataset.clone(), reader),
            looking,
            pictures: Pictures::default(),
            perturbed: FrameBuf::default(),
        })
    }

    fn is_for(&self, job: &EvaluateFrames) -> bool {
        let same = match (&self.looking, &job.subject) {
            (Looking::Driver(held), Subject::Driver(driver)) => held.component() == driver,
            (Looking::Predictor(held, taken), Subject::Predictor { component, take }) => {
                (held.component(), taken) == (component, take)
            }
            _ => false,
        };
        same && *self.dataset.component() == job.dataset
    }

    /// The time of the first frame of a sequence; 0 if the reader does not know it.
    fn origin(&mut self, sequence: usize) -> Result<f64> {
        let at = Some(sequence as u64);
        let position = self.dataset.call(Function::Position, at, |dataset| Ok(dataset.position(sequence)))?;
        Ok(if position.time.is_finite() { position.time } else { 0.0 })
    }

    /// What was recorded with a frame, and what is seen in it. `sequence` says where its sequence begins: the number of the frame, and
    /// its time.
    fn frame(
        &mut self,
        (index, name): (usize, &str),
        sequence: (usize, f64),
        begins: bool,
        chain: Option<&mut Chain>,
        times: &mut Evaluated,
    ) -> Result<(Control, Seen), Failed> {
        let at = Some(index as u64);
        let entry = self.entry(index)?;
        let mut frame = entry.frame.as_ref();
        if let Some(chain) = chain {
            let started = Instant::now();
            self.perturb(index, &entry, chain)?;
            times.perturbation_seconds += seconds(started.elapsed());
            frame = self.perturbed.as_ref();
        }
        let (first, origin) = sequence;
        let frame_index = (index - first) as u64;
        let cx = DriveContext { frame_index, time: entry.time - origin, speed: entry.speed };
        let by_driver = |error| Failed { error, by_driver: true };
        let started = Instant::now();
        let seen = self.looking.look((frame, name), &cx, at, begins).map_err(by_driver)?;
        times.driver_seconds += seconds(started.elapsed());
        Ok((Control { steering: entry.steering, throttle: entry.throttle }, seen))
    }
}

impl Looking {
    fn look(
        &mut self,
        (frame, name): (Frame<'_>, &str),
        cx: &DriveContext,
        at: Option<u64>,
        begins: bool,
    ) -> Result<Seen> {
        match self {
            Self::Driver(driver) => {
                if begins {
                    driver.call(Function::Reset, at, |driver| driver.reset())?;
                }
                driver
                    .call(Function::Drive, at, |driver| driver.drive(frame, cx)?.checked())
                    .map(Seen::Control)
            }
            Self::Predictor(predictor, take) => {
                if begins {
                    predictor.call(Function::Reset, at, |predictor| predictor.reset())?;
                }
                let size = (frame.width(), frame.height());
                predictor
                    .call(Function::Predict, at, |predictor| {
                        take.from(predictor.predict(frame, cx)?, name, size)
                    })
                    .map(Seen::Taken)
            }
        }
    }
}

impl Pictures {
    /// Forgets what is not among these frames, so that there is room for them.
    fn keep_only(&mut self, from: usize, end: usize) {
        self.entries.retain(|index, _| (from..end).contains(index));
        self.bytes = self.entries.values().map(|entry| entry.frame.data().len()).sum();
    }

    /// An entry, which is read if it is not kept.
    fn entry(&mut self, index: usize, read: impl FnOnce() -> Result<Entry>) -> Result<Entry> {
        if let Some(entry) = self.entries.get(&index) {
            return Ok(entry.clone());
        }
        let entry = read()?;
        let bytes = entry.frame.data().len();
        if self.bytes + bytes <= KEPT_PICTURES {
            self.bytes += bytes;
            self.entries.insert(index, entry.clone());
        }
        Ok(entry)
    }
}

fn seconds(duration: Duration) -> f64 {
    duration.as_secs_f64()
}

/// A frame that a prediction can be compared with.
fn plausible(entry: Entry) -> Result<Entry> {
    match entry.is_plausible() {
        true => Ok(entry),
        false => Err(Error::of(
            ErrorKind::Nonsense,
            format!(
                "the record has steering {}, throttle {}, speed {} and time {}, which have to be finite",
                entry.steering, entry.throttle, entry.speed, entry.time
            ),
        )),
    }
}
