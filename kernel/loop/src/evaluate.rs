//! Evaluates frames of a dataset: perturbs them and asks the driver what it makes of them, one after the other as in a drive.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::prelude::{Control, Dataset, DriveContext, Driver, Entry, FrameBuf};
use pdk_supervise::calls::Function;

use crate::held::Held;
use crate::protocol::{EvaluateFrames, Evaluated, EvaluatedFrame};

/// Decoded pictures that are kept for the next perturbation of the same frames, in bytes.
const KEPT_PICTURES: usize = 256 << 20;

/// A dataset and a driver that are kept from one job to the next.
pub struct Evaluator {
    dataset: Held<dyn Dataset>,
    driver: Held<dyn Driver>,
    pictures: Pictures,
    perturbed: FrameBuf,
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
        _ => Evaluator::new(registry, &job.dataset, &job.driver)?,
    };
    let mut chain = chain(registry, job)?;
    evaluator.pictures.keep_only(job.from, job.end);
    let origin = evaluator.origin(job.sequence)?;
    let mut evaluated = Evaluated { frames: Vec::new(), perturbation_seconds: 0.0, driver_seconds: 0.0 };
    let mut begins = true;
    for index in job.from..job.end {
        let at = Some(index as u64);
        let name = evaluator.dataset.call(Function::Name, at, |dataset| Ok(dataset.name(index)))?;
        let found = evaluator.frame(index, (job.sequence, origin), begins, chain.as_mut(), &mut evaluated);
        begins = found.is_err();
        let frame = match found {
            Ok((truth, control)) => EvaluatedFrame::Good { frame: name, truth, control },
            Err(Failed { error, .. }) if error.kind() == ErrorKind::Configuration => return Err(error),
            Err(Failed { error, by_driver }) => {
                if error.kind() == ErrorKind::Panic {
                    // What panicked may be in any state.
                    evaluator = Evaluator::new(registry, &job.dataset, &job.driver)?;
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

fn chain(registry: &Registry, job: &EvaluateFrames) -> Result<Option<Chain>> {
    let make = |applied| Chain::new(registry, std::slice::from_ref(applied), job.seed);
    job.perturbation.as_ref().map(make).transpose()
}

impl Evaluator {
    fn new(registry: &Registry, dataset: &ComponentSpec, driver: &ComponentSpec) -> Result<Self> {
        let (reader, _) = registry.dataset(&dataset.name, &dataset.parameters)?;
        let (instance, _) = registry.driver(&driver.name, &driver.parameters)?;
        Ok(Self {
            dataset: Held::new(Kind::Dataset, dataset.clone(), reader),
            driver: Held::new(Kind::Driver, driver.clone(), instance),
            pictures: Pictures::default(),
            perturbed: FrameBuf::default(),
        })
    }

    fn is_for(&self, job: &EvaluateFrames) -> bool {
        (self.dataset.component(), self.driver.component()) == (&job.dataset, &job.driver)
    }

    /// The time of the first frame of a sequence; 0 if the reader does not know it.
    fn origin(&mut self, sequence: usize) -> Result<f64> {
        let at = Some(sequence as u64);
        let position = self.dataset.call(Function::Position, at, |dataset| Ok(dataset.position(sequence)))?;
        Ok(if position.time.is_finite() { position.time } else { 0.0 })
    }

    /// What was recorded with a frame, and what the driver makes of it. `sequence` says where its sequence begins: the number of the
    /// frame, and its time.
    fn frame(
        &mut self,
        index: usize,
        sequence: (usize, f64),
        begins: bool,
        chain: Option<&mut Chain>,
        times: &mut Evaluated,
    ) -> Result<(Control, Control), Failed> {
        let at = Some(index as u64);
        let Self { dataset, driver, pictures, perturbed } = self;
        let entry = pictures
            .entry(index, || dataset.call(Function::Read, at, |dataset| plausible(dataset.read(index)?)))?;
        let mut frame = entry.frame.as_ref();
        if let Some(chain) = chain {
            let started = Instant::now();
            perturbed.resize(frame.width(), frame.height());
            chain.apply(frame, perturbed.as_mut(), &Moment::new(index as u64, entry.time).alone())?;
            times.perturbation_seconds += seconds(started.elapsed());
            frame = perturbed.as_ref();
        }
        let (first, origin) = sequence;
        let frame_index = (index - first) as u64;
        let cx = DriveContext { frame_index, time: entry.time - origin, speed: f64::NAN };
        let by_driver = |error| Failed { error, by_driver: true };
        let started = Instant::now();
        if begins {
            driver.call(Function::Reset, at, |driver| driver.reset()).map_err(by_driver)?;
        }
        let control = driver
            .call(Function::Drive, at, |driver| driver.drive(frame, &cx)?.checked())
            .map_err(by_driver)?;
        times.driver_seconds += seconds(started.elapsed());
        Ok((Control { steering: entry.steering, throttle: entry.throttle }, control))
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
    match [entry.steering, entry.throttle, entry.time].iter().all(|value| value.is_finite()) {
        true => Ok(entry),
        false => Err(Error::of(
            ErrorKind::Nonsense,
            format!(
                "the record has steering {}, throttle {} and time {}, which have to be numbers",
                entry.steering, entry.throttle, entry.time
            ),
        )),
    }
}
