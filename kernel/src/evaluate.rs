//! The offline loop: perturbs every frame of a dataset and compares what the driver makes of it with the recorded
//! ground truth and with what it made of the original.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use pdk_sdk::abi::PANICKED;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Control, Dataset, DriveContext, Driver, Entry, Frame, FrameBuf};
use serde::Serialize;
use serde_json::{Map, Value};

use crate::chain::{Chain, Level, Spec};
use crate::component::ComponentSpec;
use crate::drive;
use crate::pipeline::fields::Fields;
use crate::record::{Lines, RESULTS, RunDirectory};
use crate::registry::Registry;
use crate::watchdog::Watch;

/// What to evaluate.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Where the frames come from: a path that any reader may open, or a named reader.
    pub dataset: DatasetSpec,
    /// The driver under test.
    pub driver: ComponentSpec,
    /// Each perturbation at each level.
    pub cells: Vec<Spec>,
    /// At most this many frames, from the first.
    pub frames: Option<usize>,
}

/// Where the frames come from.
#[derive(Debug, Clone)]
pub enum DatasetSpec {
    /// A folder; the reader is found by trying.
    Path(String),
    /// A reader with its parameters.
    Reader(ComponentSpec),
}

impl Plan {
    /// Reads what a pipeline wrote.
    ///
    /// # Errors
    /// Where a field is unknown, missing or of the wrong type, or a level is out of range.
    pub fn from_json(request: Value) -> Result<Self> {
        let known = ["dataset", "driver", "perturbations", "levels", "frames"];
        let mut request = Fields::new("pdk.evaluate", request, &known)?;
        let dataset = match request.needed("dataset")? {
            Value::String(path) => DatasetSpec::Path(path),
            other => DatasetSpec::Reader(ComponentSpec::from_json("dataset", &other)?),
        };
        let driver = ComponentSpec::from_json("driver", &request.needed("driver")?)?;
        let perturbations = request.filled_list("perturbations")?;
        let levels = request.filled_list("levels")?;
        let frames = request.whole("frames")?.map(|frames| usize::try_from(frames).unwrap_or(usize::MAX));
        let mut cells = Vec::new();
        for perturbation in &perturbations {
            let own = match perturbation {
                Value::String(text) => text.contains('@'),
                other => other.get("level").is_some(),
            };
            if own {
                return Err(Error::new(format!(
                    "the perturbation {perturbation} has a level of its own; leave it out, because each is evaluated at all `levels`"
                )));
            }
            for level in &levels {
                let level = level.as_f64().ok_or_else(|| {
                    Error::new(format!(
                        "pdk.evaluate: {level} in `levels` is no number; they are numbers from 0 to 4"
                    ))
                })?;
                Level::from_json("levels", &level.into())?;
                cells.push(Spec::from_json(perturbation, level)?);
            }
        }
        Ok(Self { dataset, driver, cells, frames })
    }
}

/// The level of a cell, which is the same for all frames.
fn level_of(cell: &Spec) -> f64 {
    cell.level.constant().unwrap_or_default()
}

/// How an evaluation is run.
pub struct Settings {
    /// The seed of the run.
    pub seed: u64,
    /// The number of threads.
    pub threads: usize,
    /// How long one call of a component may take.
    pub patience: Duration,
    /// The number of the evaluation in its run.
    pub number: u64,
}

/// The result of an evaluation.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// The number of the evaluation in its run, from 0.
    pub evaluation: u64,
    /// Frames that were evaluated.
    pub frames: usize,
    /// Frames that could not be read or driven, with the reason.
    pub bad_frames: Vec<BadFrame>,
    /// Mean absolute steering error on the original frames.
    pub original_steering_error: f64,
    /// One row for each perturbation and level.
    pub rows: Vec<Row>,
}

/// A frame that could not be evaluated.
#[derive(Debug, Clone, Serialize)]
pub struct BadFrame {
    /// Its name.
    pub frame: String,
    /// The reason.
    pub error: String,
}

/// How the driver did under one perturbation at one level.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The perturbation.
    pub perturbation: String,
    /// The perturbation with its parameters, which tells it from the same one with others.
    pub label: String,
    /// Its level.
    pub level: f64,
    /// Mean absolute difference between the prediction on the perturbed frame and the recorded steering.
    pub steering_error: f64,
    /// Mean absolute difference between the predictions on the perturbed and on the original frame.
    pub steering_drift: f64,
    /// The same for the throttle.
    pub throttle_error: f64,
    /// The same for the throttle.
    pub throttle_drift: f64,
}

/// How long it took: the part of the result that differs from run to run.
#[derive(Debug, Clone, Serialize)]
pub struct Performance {
    /// Threads that were used.
    pub threads: usize,
    /// Perturbed frames, each with a prediction.
    pub perturbed_frames: usize,
    /// Wall time in seconds.
    pub wall_seconds: f64,
    /// Perturbed frames per second of wall time.
    pub frames_per_second: f64,
    /// Mean time of one perturbation in milliseconds, over all perturbations and levels.
    pub perturbation_milliseconds: f64,
    /// Mean time of one prediction in milliseconds.
    pub driver_milliseconds: f64,
}

/// One line of the results.
#[derive(Serialize)]
struct Line<'a> {
    evaluation: u64,
    index: usize,
    frame: &'a str,
    perturbation: &'a str,
    label: &'a str,
    level: f64,
    truth: Control,
    original: Control,
    perturbed: Control,
}

/// What one frame gave.
struct FrameResult {
    index: usize,
    frame: String,
    outcome: Result<Predictions>,
    perturbation_time: Duration,
    driver_time: Duration,
}

struct Predictions {
    truth: Control,
    original: Control,
    /// One for each cell of the plan.
    perturbed: Vec<Control>,
}

/// Labels of the calls under watch; from `PERTURBATIONS` on there is one for each cell of the plan.
const DATASET: usize = 0;
const DRIVER: usize = 1;
const PERTURBATIONS: usize = 2;

/// Opens the dataset of a plan. A reader that takes longer than `patience` for it ends the process.
///
/// # Errors
/// Where no reader can open it.
pub fn open_dataset(
    registry: &Registry,
    spec: &DatasetSpec,
    patience: Duration,
) -> Result<(ComponentSpec, Box<dyn Dataset>)> {
    match spec {
        DatasetSpec::Reader(spec) => Ok((spec.clone(), open_with(registry, spec, patience)?)),
        DatasetSpec::Path(path) => {
            let mut reasons = Vec::new();
            for reader in registry.of_kind(Kind::Dataset) {
                let name = reader.description.name.clone();
                let parameters = Map::from_iter([("path".to_owned(), Value::String(path.clone()))]);
                let spec = ComponentSpec { name, parameters };
                match open_with(registry, &spec, patience) {
                    Ok(dataset) => return Ok((spec, dataset)),
                    Err(error) => reasons.push(error.to_string()),
                }
            }
            Err(Error::new(match reasons.is_empty() {
                true => format!("cannot open the dataset {path}: no dataset reader is installed"),
                false => format!("cannot open the dataset {path}: {}", reasons.join("; ")),
            }))
        }
    }
}

/// Opens a dataset with a reader.
fn open_with(registry: &Registry, spec: &ComponentSpec, patience: Duration) -> Result<Box<dyn Dataset>> {
    let watch = Watch::new(vec![format!("dataset `{}`", spec.name)], patience);
    watch.call(0, || Ok(registry.dataset(&spec.name, &spec.parameters)?.0))
}

/// Evaluates every frame, perturbation and level, and writes a line for each. The lines come in the order of the
/// frames, and are the same for any number of threads.
///
/// # Errors
/// Where a component cannot be made, no frame can be evaluated, or the record cannot be written.
pub fn evaluate(
    registry: &Registry,
    plan: &Plan,
    settings: &Settings,
    directory: &RunDirectory,
    progress: &ProgressBar,
) -> Result<(Summary, Performance)> {
    let (reader, dataset) = open_dataset(registry, &plan.dataset, settings.patience)?;
    let frames = plan.frames.unwrap_or(usize::MAX).min(dataset.len());
    if frames == 0 {
        return Err(Error::new("the dataset has no frames; name a folder that has some"));
    }
    let threads = settings.threads.clamp(1, frames);
    let workers =
        (0..threads).map(|_| Worker::new(registry, plan, &reader, settings)).collect::<Result<Vec<_>>>()?;
    drop(dataset);

    progress.set_length(frames as u64);
    let started = Instant::now();
    let mut collector = Collector::new(plan, settings.number, directory.lines(RESULTS)?);
    let next = AtomicUsize::new(0);
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        for mut worker in workers {
            let (sender, next, stop) = (sender.clone(), &next, &stop);
            scope.spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= frames || sender.send(worker.evaluate(index)).is_err() {
                        break;
                    }
                }
                worker.instances.drop(&worker.watch);
            });
        }
        drop(sender);
        for result in &receiver {
            progress.inc(1);
            if let Err(error) = result.and_then(|result| collector.add(result)) {
                stop.store(true, Ordering::Relaxed);
                return Err(error);
            }
        }
        Ok(())
    })?;
    progress.finish_and_clear();
    collector.finish(threads, started.elapsed())
}

/// One thread's instances.
struct Worker<'a> {
    registry: &'a Registry,
    plan: &'a Plan,
    reader: &'a ComponentSpec,
    seed: u64,
    instances: Instances,
    perturbed: FrameBuf,
    watch: Watch,
}

struct Instances {
    dataset: Box<dyn Dataset>,
    driver: Box<dyn Driver>,
    chains: Vec<Chain>,
}

impl Instances {
    fn new(
        registry: &Registry,
        plan: &Plan,
        reader: &ComponentSpec,
        seed: u64,
        watch: &Watch,
    ) -> Result<Self> {
        let (dataset, _) = watch.call(DATASET, || registry.dataset(&reader.name, &reader.parameters))?;
        let (driver, _) =
            watch.call(DRIVER, || registry.driver(&plan.driver.name, &plan.driver.parameters))?;
        let chain = |(number, cell): (usize, &Spec)| {
            watch.call(PERTURBATIONS + number, || Chain::new(registry, std::slice::from_ref(cell), seed, 0))
        };
        let chains = plan.cells.iter().enumerate().map(chain).collect::<Result<_>>()?;
        Ok(Self { dataset, driver, chains })
    }

    /// What a component does at its end is under watch as well.
    fn drop(self, watch: &Watch) {
        watch.call(DATASET, || drop(self.dataset));
        watch.call(DRIVER, || drop(self.driver));
        for (number, chain) in self.chains.into_iter().enumerate() {
            watch.call(PERTURBATIONS + number, || drop(chain));
        }
    }
}

impl<'a> Worker<'a> {
    fn new(
        registry: &'a Registry,
        plan: &'a Plan,
        reader: &'a ComponentSpec,
        settings: &Settings,
    ) -> Result<Self> {
        let components = [format!("dataset `{}`", reader.name), format!("driver `{}`", plan.driver.name)];
        let cells = plan.cells.iter().map(|cell| format!("perturbation `{cell}`"));
        let watch = Watch::new(components.into_iter().chain(cells).collect(), settings.patience);
        let seed = settings.seed;
        let instances = Instances::new(registry, plan, reader, seed, &watch)?;
        Ok(Self { registry, plan, reader, seed, instances, perturbed: FrameBuf::default(), watch })
    }

    /// Evaluates a frame. What is wrong with the frame is part of its result.
    ///
    /// # Errors
    /// Where a component panicked and new instances cannot be made.
    fn evaluate(&mut self, index: usize) -> Result<FrameResult> {
        let frame = self.watch.call(DATASET, || self.instances.dataset.name(index));
        let (mut perturbation_time, mut driver_time) = (Duration::ZERO, Duration::ZERO);
        let entry = self.watch.call(DATASET, || self.instances.dataset.read(index)).and_then(plausible);
        let outcome = entry
            .map_err(|error| error.at(format_args!("dataset `{}`", self.reader.name)))
            .and_then(|entry| self.predict(index, &entry, &mut perturbation_time, &mut driver_time));
        // Or the frames that this thread happens to get next would fail as well.
        if outcome.as_ref().is_err_and(|error| error.message().contains(PANICKED)) {
            let fresh = Instances::new(self.registry, self.plan, self.reader, self.seed, &self.watch)?;
            std::mem::replace(&mut self.instances, fresh).drop(&self.watch);
        }
        Ok(FrameResult { index, frame, outcome, perturbation_time, driver_time })
    }

    fn predict(
        &mut self,
        index: usize,
        entry: &Entry,
        perturbation_time: &mut Duration,
        driver_time: &mut Duration,
    ) -> Result<Predictions> {
        let cx = DriveContext { frame_index: index as u64, time: entry.time, speed: f64::NAN };
        let source = entry.frame.as_ref();
        let Self { plan, instances: Instances { driver, chains, .. }, perturbed, watch, .. } = self;
        let mut drive = |frame: Frame<'_>| {
            let started = Instant::now();
            // Every frame counts for itself: what a driver remembers must not leak from one into the next.
            let control = watch.call(DRIVER, || driver.reset().and_then(|()| driver.drive(frame, &cx)));
            *driver_time += started.elapsed();
            control
                .and_then(drive::checked)
                .map_err(|error| error.at(format_args!("driver `{}`", plan.driver.name)))
        };
        let original = drive(source)?;
        perturbed.resize(source.width(), source.height());
        let mut controls = Vec::with_capacity(chains.len());
        for (number, chain) in chains.iter_mut().enumerate() {
            let started = Instant::now();
            watch.call(PERTURBATIONS + number, || {
                chain.apply(source, perturbed.as_mut(), index as u64, entry.time)
            })?;
            *perturbation_time += started.elapsed();
            controls.push(drive(perturbed.as_ref())?);
        }
        let truth = Control { steering: entry.steering, throttle: entry.throttle };
        Ok(Predictions { truth, original, perturbed: controls })
    }
}

/// A frame that a prediction can be compared with.
fn plausible(entry: Entry) -> Result<Entry> {
    match [entry.steering, entry.throttle, entry.time].iter().all(|value| value.is_finite()) {
        true => Ok(entry),
        false => Err(Error::new(format!(
            "the record has steering {}, throttle {} and time {}, which have to be numbers",
            entry.steering, entry.throttle, entry.time
        ))),
    }
}

/// Puts the frames back in order, writes their lines and sums them up.
struct Collector<'a> {
    plan: &'a Plan,
    /// The number of the evaluation in its run.
    number: u64,
    /// What each cell is called without its level.
    labels: Vec<String>,
    lines: Lines,
    /// Frames that came before their turn.
    waiting: BTreeMap<usize, FrameResult>,
    next: usize,
    frames: usize,
    bad_frames: Vec<BadFrame>,
    original_error: f64,
    sums: Vec<[f64; 4]>,
    perturbation_time: Duration,
    driver_time: Duration,
    text: Vec<u8>,
}

impl<'a> Collector<'a> {
    fn new(plan: &'a Plan, number: u64, lines: Lines) -> Self {
        Self {
            plan,
            number,
            labels: plan.cells.iter().map(Spec::label).collect(),
            lines,
            waiting: BTreeMap::new(),
            next: 0,
            frames: 0,
            bad_frames: Vec::new(),
            original_error: 0.0,
            sums: vec![[0.0; 4]; plan.cells.len()],
            perturbation_time: Duration::ZERO,
            driver_time: Duration::ZERO,
            text: Vec::new(),
        }
    }

    fn add(&mut self, result: FrameResult) -> Result<()> {
        self.waiting.insert(result.index, result);
        while let Some(result) = self.waiting.remove(&self.next) {
            self.next += 1;
            self.write(result)?;
        }
        Ok(())
    }

    fn write(&mut self, result: FrameResult) -> Result<()> {
        self.perturbation_time += result.perturbation_time;
        self.driver_time += result.driver_time;
        let predictions = match result.outcome {
            Ok(predictions) => predictions,
            Err(error) => {
                let bad = BadFrame { frame: result.frame, error: error.to_string() };
                self.lines.write(&serde_json::json!({
                    "evaluation": self.number, "index": result.index, "frame": bad.frame, "error": bad.error,
                }))?;
                self.bad_frames.push(bad);
                return Ok(());
            }
        };
        self.frames += 1;
        let Predictions { truth, original, perturbed } = predictions;
        self.original_error += (original.steering - truth.steering).abs();
        self.text.clear();
        let cells = self.plan.cells.iter().zip(&self.labels).zip(&mut self.sums);
        for (((cell, label), sums), control) in cells.zip(perturbed) {
            sums[0] += (control.steering - truth.steering).abs();
            sums[1] += (control.steering - original.steering).abs();
            sums[2] += (control.throttle - truth.throttle).abs();
            sums[3] += (control.throttle - original.throttle).abs();
            let line = Line {
                evaluation: self.number,
                index: result.index,
                frame: &result.frame,
                perturbation: &cell.name,
                label,
                level: level_of(cell),
                truth,
                original,
                perturbed: control,
            };
            serde_json::to_writer(&mut self.text, &line)?;
            self.text.write_all(b"\n")?;
        }
        self.lines.write_text(&self.text)
    }

    fn finish(mut self, threads: usize, wall: Duration) -> Result<(Summary, Performance)> {
        self.lines.sync()?;
        if self.frames == 0 {
            let first = self.bad_frames.first().map(|bad| format!("{}: {}", bad.frame, bad.error));
            return Err(Error::new(format!(
                "none of the {} frames could be evaluated; the first: {}",
                self.bad_frames.len(),
                first.unwrap_or_default()
            )));
        }
        let count = self.frames as f64;
        let rows = self.plan.cells.iter().zip(self.labels).zip(&self.sums).map(|((cell, label), sums)| Row {
            perturbation: cell.name.clone(),
            label,
            level: level_of(cell),
            steering_error: sums[0] / count,
            steering_drift: sums[1] / count,
            throttle_error: sums[2] / count,
            throttle_drift: sums[3] / count,
        });
        let perturbed = count * self.plan.cells.len() as f64;
        let performance = Performance {
            threads,
            perturbed_frames: self.frames * self.plan.cells.len(),
            wall_seconds: wall.as_secs_f64(),
            frames_per_second: perturbed / wall.as_secs_f64(),
            perturbation_milliseconds: self.perturbation_time.as_secs_f64() * 1e3 / perturbed.max(1.0),
            driver_milliseconds: self.driver_time.as_secs_f64() * 1e3 / (perturbed + count),
        };
        let summary = Summary {
            evaluation: self.number,
            frames: self.frames,
            original_steering_error: self.original_error / count,
            rows: rows.collect(),
            bad_frames: self.bad_frames,
        };
        Ok((summary, performance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn mistakes_are_named() {
        let error = |field: &str, value: Value| {
            let mut request =
                json!({"dataset": "x", "driver": "y", "perturbations": ["fog"], "levels": [1], "frames": 3});
            assert_eq!(Plan::from_json(request.clone()).unwrap().cells.len(), 1);
            request[field] = value;
            Plan::from_json(request).unwrap_err().to_string()
        };
        for (field, value, start) in [
            ("levels", json!([]), "pdk.evaluate: `levels` is empty; give it"),
            ("perturbations", json!([]), "pdk.evaluate: `perturbations` is empty; give it"),
            ("perturbations", json!("fog"), "pdk.evaluate: `perturbations` is \"fog\", but has to be a list"),
            ("levels", json!(["high"]), "pdk.evaluate: \"high\" in `levels` is no number"),
            ("levels", json!([9]), "the level in `levels` is 9, but has to be"),
            ("frames", json!(-1), "pdk.evaluate: `frames` is -1, but has to be a whole number"),
            ("perturbations", json!(["fog@1"]), "the perturbation \"fog@1\" has a level of its own"),
            ("frmes", json!(1), "pdk.evaluate: there is no field `frmes`; did you mean `frames`?"),
        ] {
            let error = error(field, value);
            assert!(error.starts_with(start), "{error}");
        }
    }
}
