//! Evaluates frames of a dataset: perturbs them and asks the driver what it makes of them.

use std::time::{Duration, Instant};

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::registry::Registry;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::prelude::{Control, Dataset, DriveContext, Driver, Entry, FrameBuf};
use pdk_supervise::calls::Function;

use crate::held::Held;
use crate::protocol::{Evaluated, Evaluation, Failure};

/// Instances for one evaluation.
pub struct Evaluator {
    evaluation: Evaluation,
    dataset: Held<dyn Dataset>,
    driver: Held<dyn Driver>,
    /// One for each perturbation of the evaluation.
    chains: Vec<Chain>,
    perturbed: FrameBuf,
}

impl Evaluator {
    /// The evaluator that is kept, made anew where another evaluation is asked for.
    ///
    /// # Errors
    /// If a component cannot be made.
    pub fn kept<'a>(
        kept: &'a mut Option<Self>,
        registry: &Registry,
        evaluation: &Evaluation,
    ) -> Result<&'a mut Self> {
        if kept.as_ref().is_some_and(|evaluator| evaluator.evaluation != *evaluation) {
            *kept = None;
        }
        match kept {
            Some(evaluator) => Ok(evaluator),
            None => Ok(kept.insert(Self::new(registry, evaluation)?)),
        }
    }

    fn new(registry: &Registry, evaluation: &Evaluation) -> Result<Self> {
        let Evaluation { dataset, driver, perturbations, seed } = evaluation;
        let (reader, _) = registry.dataset(&dataset.name, &dataset.parameters)?;
        let (instance, _) = registry.driver(&driver.name, &driver.parameters)?;
        let chain = |applied| Chain::new(registry, std::slice::from_ref(applied), *seed);
        Ok(Self {
            evaluation: evaluation.clone(),
            dataset: Held::new(Kind::Dataset, dataset.clone(), reader),
            driver: Held::new(Kind::Driver, driver.clone(), instance),
            chains: perturbations.iter().map(chain).collect::<Result<_>>()?,
            perturbed: FrameBuf::default(),
        })
    }

    /// Evaluates a frame.
    ///
    /// # Errors
    /// If the frame cannot be read, or a component fails; with the name of the frame, unless that is what failed.
    pub fn evaluate(&mut self, index: usize) -> Result<Evaluated, Failure> {
        let frame =
            self.dataset.call(Function::Name, Some(index as u64), |dataset| Ok(dataset.name(index)))?;
        self.evaluate_named(index, frame.clone())
            .map_err(|error| Failure { frame: Some(frame), ..Failure::from(error) })
    }

    fn evaluate_named(&mut self, index: usize, frame: String) -> Result<Evaluated> {
        let at = Some(index as u64);
        let entry = self.dataset.call(Function::Read, at, |dataset| plausible(dataset.read(index)?))?;
        let cx = DriveContext { frame_index: index as u64, time: entry.time, speed: f64::NAN };
        let source = entry.frame.as_ref();
        let Self { driver, chains, perturbed, .. } = self;
        let (mut perturbing, mut driving) = (Duration::ZERO, Duration::ZERO);
        let mut drive = |frame: pdk_sdk::prelude::Frame<'_>| {
            let started = Instant::now();
            // Every frame counts for itself: what a driver remembers must not leak from one into the next.
            driver.call(Function::Reset, at, |driver| driver.reset())?;
            let control = driver.call(Function::Drive, at, |driver| driver.drive(frame, &cx)?.checked());
            driving += started.elapsed();
            control
        };
        let original = drive(source)?;
        perturbed.resize(source.width(), source.height());
        let mut controls = Vec::with_capacity(chains.len());
        for chain in chains {
            let started = Instant::now();
            chain.apply(source, perturbed.as_mut(), &Moment::new(index as u64, entry.time).alone())?;
            perturbing += started.elapsed();
            controls.push(drive(perturbed.as_ref())?);
        }
        Ok(Evaluated {
            frame,
            truth: Control { steering: entry.steering, throttle: entry.throttle },
            original,
            perturbed: controls,
            perturbation_seconds: perturbing.as_secs_f64(),
            driver_seconds: driving.as_secs_f64(),
        })
    }
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
