//! One scenario around the closed loop: simulator, perturbations, driver, and back to the simulator, frame by frame.

use std::time::{Duration, Instant};

use pdk_bus::{Bus, FrameSample, Stamp, Topic};
use pdk_chain::chain::Chain;
use pdk_chain::moment::{Labels, Moment};
use pdk_chain::view::View;
use pdk_model::outcome::{Cause, Outcome};
use pdk_model::scenario::{Mode, Scenario};
use pdk_record::trace::step::{Digest, ImageTopic, Step};
use pdk_sdk::describe::Clock;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::prelude::{Camera, Control, DriveContext, Driver, Frame, FrameMut, Simulator, State};
use pdk_sdk::timeline::{Timeline, Told};
use pdk_supervise::calls::Function;
use twox_hash::XxHash3_64;

use crate::held::Held;
use crate::judge::Judge;
use crate::protocol::Drive;
use crate::recent::Recent;
use crate::recorder::Recorder;
use crate::stages::{Stage, Stopwatch};
use crate::way::Way;

/// A simulator may deliver so many times the frames that its rate and the time limit make, and so many more; a scenario
/// whose time does not go on would never end.
const PATIENT_FACTOR: u64 = 10;
const PATIENT_FRAMES: u64 = 1000;

/// About so many frames a scenario has at most.
pub fn expected_frames(scenario: &Scenario, rate: f64) -> u64 {
    (scenario.duration * rate).ceil() as u64 + 1
}

/// Why a scenario could not be driven to its end.
pub enum Fault {
    /// The simulator failed.
    Simulator(Error),
    /// Another component failed: the outcome of this scenario.
    Component(Error),
    /// pdk itself failed, or the machine: the end of the run.
    Kernel(Error),
}

/// Topics that were made and do not work any more: other processes see their memory too. Another time it may go better.
impl From<pdk_bus::Error> for Fault {
    fn from(error: pdk_bus::Error) -> Self {
        Fault::Component(Error::of(ErrorKind::Lost, format!("the topics of the scenario: {error}")))
    }
}

/// What a scenario is driven with.
pub struct Instances<'a> {
    /// The simulator.
    pub simulator: &'a mut Held<dyn Simulator>,
    /// Its camera.
    pub camera: Camera,
    /// Whose clock it goes by.
    pub clock: Clock,
    /// The perturbations.
    pub chain: &'a mut Chain,
    /// The driver under test.
    pub driver: &'a mut Held<dyn Driver>,
    /// The topics.
    pub bus: &'a Bus,
    /// Shows what the driver's network looks at, where somebody wants to see it.
    pub view: Option<&'a mut View>,
}

/// What looks on.
pub struct Witnesses<'a> {
    /// Writes the trace; none where nobody wants one.
    pub recorder: Option<&'a Recorder>,
    /// The latest frames.
    pub recent: &'a mut Recent,
    /// Measures the stages.
    pub stopwatch: &'a mut Stopwatch,
    /// Told after every frame.
    pub progress: &'a mut dyn FnMut(u64),
}

/// A scenario while it is driven.
pub struct Run<'a> {
    drive: &'a Drive,
    number: u64,
    slot: u32,
    judge: Judge,
    digest: Digest,
    frames: u64,
    /// The number of the next frame: above `frames` by those that were skipped.
    sequence: u64,
    /// When frame 0 was due, in real time.
    began: Instant,
    state: State,
    /// The times of the states; none before the first one.
    timeline: Option<Timeline>,
    way: Way,
    /// What the driver said last.
    control: Control,
    /// Number and time of the last frame, and the frame as camera and driver saw it, which stays in shared memory until the next one.
    last: Option<(u64, f64, [FrameSample; 2])>,
    /// What the simulator can tell apart and what the pixels of the frame show, where perturbations need it.
    labels: Option<(Vec<String>, Vec<u8>)>,
    /// How far away the pixels of the frame are, where perturbations need it.
    depth: Option<Vec<f32>>,
    /// The number of the latest image that was recorded.
    last_image: Option<u64>,
    cause: Cause,
    under_way: bool,
}

impl<'a> Run<'a> {
    /// A scenario that is job `number`, on this slot.
    pub fn new(drive: &'a Drive, number: u64, slot: u32) -> Self {
        Self {
            drive,
            number,
            slot,
            judge: Judge::new(drive.scenario.failure, drive.scenario.duration),
            digest: Digest::default(),
            frames: 0,
            sequence: 0,
            began: Instant::now(),
            state: State::default(),
            timeline: None,
            way: Way::default(),
            control: Control::default(),
            last: None,
            labels: None,
            depth: None,
            last_image: None,
            cause: Cause::Error,
            under_way: false,
        }
    }

    /// Whether the simulator has come to put the vehicle at the start.
    pub fn is_under_way(&self) -> bool {
        self.under_way
    }

    /// Drives it to its end.
    ///
    /// # Errors
    /// Where a component fails, or the routing.
    pub fn drive(&mut self, with: &mut Instances<'_>, witnesses: &mut Witnesses<'_>) -> Result<(), Fault> {
        let scenario = &self.drive.scenario;
        // A simulator with its own clock keeps the time itself.
        let paced = scenario.mode == Mode::Realtime && with.clock == Clock::Stepped;
        let period = Duration::from_secs_f64(1.0 / with.camera.rate);
        witnesses.stopwatch.start(paced.then_some(period));
        witnesses.recent.clear();
        let slot = self.slot;
        let annotations = with.chain.annotations();
        with.simulator
            .call(Function::Annotate, None, |simulator| {
                simulator.annotate(annotations);
                Ok(())
            })
            .map_err(Fault::Simulator)?;
        with.simulator
            .call(Function::Reset, None, |simulator| simulator.reset(scenario, slot))
            .map_err(Fault::Simulator)?;
        self.under_way = true;
        with.driver.call(Function::Reset, None, |driver| driver.reset()).map_err(Fault::Component)?;
        if let Some(recorder) = witnesses.recorder {
            recorder.event(0.0, false, &self.drive.name);
            let waypoints = with
                .simulator
                .call(Function::Waypoints, None, |simulator| Ok(simulator.waypoints()))
                .map_err(Fault::Simulator)?;
            if !waypoints.is_empty() {
                recorder.road(waypoint_string(&waypoints));
            }
        }
        let pixels = with.camera.width as usize * with.camera.height as usize;
        if annotations.labels {
            let names = with.simulator.call(Function::Labels, None, |simulator| Ok(simulator.label_names()));
            self.labels = Some((names.map_err(Fault::Component)?, vec![0; pixels]));
        }
        self.depth = annotations.depth.then(|| vec![0.0; pixels]);
        self.timeline = Some(Timeline::new(with.clock, with.camera.rate));
        self.began = Instant::now();
        loop {
            witnesses.stopwatch.start_step();
            let end = self.step(with, witnesses)?;
            witnesses.stopwatch.end_step();
            (witnesses.progress)(1);
            if let Some(cause) = end {
                self.cause = cause;
                return Ok(());
            }
        }
    }

    /// One frame around the loop.
    fn step(
        &mut self,
        with: &mut Instances<'_>,
        witnesses: &mut Witnesses<'_>,
    ) -> Result<Option<Cause>, Fault> {
        let Instances { simulator, camera, chain, driver, bus, view, .. } = with;
        let stopwatch = &mut *witnesses.stopwatch;
        let (width, height) = (camera.width as usize, camera.height as usize);
        let sequence = self.sequence;
        let stamp = Stamp { scenario: self.number, sequence, time: sequence as f64 / camera.rate };
        let wrong_size = |error: pdk_sdk::ops::FrameError| Fault::Kernel(Error::new(error));

        let mut loan = bus.loan_frame(Topic::Raw, stamp)?;
        let target = FrameMut::new(&mut loan, width, height).map_err(wrong_size)?;
        let state = stopwatch
            .measure(Stage::Simulator, || {
                simulator.call(Function::Frame, Some(sequence), |s| s.frame(target))
            })
            .map_err(Fault::Simulator)?;
        self.check(&state, Told::Frame, simulator, camera.rate)?;
        let raw = loan.publish()?;
        let raw_frame = Frame::new(&raw, width, height).map_err(wrong_size)?;
        bus.publish_state(stamp, state)?;

        if let Some((_, pixels)) = self.labels.as_mut().filter(|(names, _)| !names.is_empty()) {
            stopwatch
                .measure(Stage::Simulator, || {
                    simulator.call(Function::Labels, Some(sequence), |s| s.labels(pixels))
                })
                .map_err(Fault::Component)?;
        }
        let labels = self.labels.as_ref().map(|(names, pixels)| Labels { names, pixels });
        if let Some(depth) = self.depth.as_mut() {
            stopwatch
                .measure(Stage::Simulator, || {
                    simulator.call(Function::Depth, Some(sequence), |s| s.depth(depth))
                })
                .map_err(Fault::Component)?;
        }
        let moment = Moment::new(sequence, state.time)
            .at_speed(state.speed)
            .after(self.way.reach(state.time, state.speed))
            .with_labels(labels)
            .with_depth(self.depth.as_deref());

        let mut loan = bus.loan_frame(Topic::Perturbed, stamp)?;
        let target = FrameMut::new(&mut loan, width, height).map_err(wrong_size)?;
        stopwatch
            .measure(Stage::Perturbation, || chain.apply(raw_frame, target, &moment))
            .map_err(Fault::Component)?;
        let perturbed = loan.publish()?;
        let perturbed_frame = Frame::new(&perturbed, width, height).map_err(wrong_size)?;

        let cx = DriveContext { frame_index: sequence, time: state.time, speed: state.speed };
        let control = stopwatch
            .measure(Stage::Driver, || {
                driver.call(Function::Drive, Some(sequence), |d| d.drive(perturbed_frame, &cx)?.checked())
            })
            .map_err(Fault::Component)?;
        bus.publish_control(stamp, control)?;

        let frame_hash = XxHash3_64::oneshot(&perturbed);
        self.digest.add(frame_hash, &control);
        if let Some(recorder) = witnesses.recorder {
            recorder.step(Step { sequence, state, control, frame_hash });
            let every = self.drive.images_every;
            if every > 0 && sequence.is_multiple_of(every) {
                recorder.image(ImageTopic::Raw, sequence, state.time, raw_frame);
                if let Some(view) = view {
                    let picture = view.picture(perturbed_frame, &moment).map_err(Fault::Component)?;
                    recorder.image(ImageTopic::Attention, sequence, state.time, picture.as_ref());
                }
                // It comes last, so that whoever reads the trace has the other ones then.
                recorder.image(ImageTopic::Perturbed, sequence, state.time, perturbed_frame);
                self.last_image = Some(sequence);
            }
            // Where every image is written, none is left for the end.
            if every != 1 {
                witnesses.recent.look(sequence, state.time, raw_frame, perturbed_frame);
            }
        }
        self.last = Some((sequence, state.time, [raw, perturbed]));
        self.frames += 1;
        self.sequence += 1;
        self.state = state;
        let end = self.judge.look(&state);
        if end.is_some() {
            return Ok(end);
        }
        self.act(control, with, witnesses.stopwatch)
    }

    /// Hands the control to the simulator. In real time the control before held while the driver was thinking: each state that
    /// the vehicle went through meanwhile is judged like any other.
    fn act(
        &mut self,
        control: Control,
        with: &mut Instances<'_>,
        stopwatch: &mut Stopwatch,
    ) -> Result<Option<Cause>, Fault> {
        let rate = with.camera.rate;
        let period = Duration::from_secs_f64(1.0 / rate);
        let sequence = self.sequence - 1;
        if with.clock == Clock::Own {
            let state = stopwatch
                .measure(Stage::Simulator, || {
                    with.simulator.call(Function::Act, Some(sequence), |simulator| simulator.act(control))
                })
                .map_err(Fault::Simulator)?;
            self.check(&state, Told::Act, with.simulator, rate)?;
            let passed = ((state.time - self.state.time) * rate).round() as u64;
            self.sequence += passed.saturating_sub(1);
            self.control = control;
            return Ok(None);
        }
        let skipped = match self.drive.scenario.mode {
            Mode::Lockstep => 0,
            Mode::Realtime => self.skipped(sequence).unwrap_or_else(|| self.missed(sequence, period)),
        };
        for number in 0..=skipped {
            let held = if number < skipped { self.control } else { control };
            let at = sequence + number;
            let state = stopwatch
                .measure(Stage::Simulator, || with.simulator.call(Function::Act, Some(at), |s| s.act(held)))
                .map_err(Fault::Simulator)?;
            self.check(&state, Told::Act, with.simulator, rate)?;
            // The state behind the last of them comes with the next frame, which is judged then.
            if number < skipped {
                self.sequence += 1;
                self.state = state;
                if let Some(cause) = self.judge.look(&state) {
                    return Ok(Some(cause));
                }
            }
        }
        self.control = control;
        if self.drive.scenario.mode == Mode::Realtime && self.drive.skips.is_none() {
            stopwatch.wait(self.due(self.sequence, period));
        }
        Ok(None)
    }

    /// How many frames are to be skipped behind this one, where that is not for the clock to say.
    fn skipped(&self, sequence: u64) -> Option<u64> {
        let skips = self.drive.skips.as_ref()?;
        Some(skips.iter().find(|skip| skip.behind == sequence).map_or(0, |skip| skip.count))
    }

    /// When a frame is due, in real time.
    fn due(&self, sequence: u64, period: Duration) -> Instant {
        self.began + period.mul_f64(sequence as f64)
    }

    /// How many frames went by since this one was due, besides the next.
    fn missed(&self, sequence: u64, period: Duration) -> u64 {
        let late = Instant::now().saturating_duration_since(self.due(sequence, period));
        (late.as_secs_f64() / period.as_secs_f64()) as u64
    }

    /// Says whether a scenario can be judged by a state: what a vehicle can do, and a time that goes on. Whatever simulator it comes
    /// from, it is believed nowhere else before.
    fn check(
        &mut self,
        state: &State,
        told: Told,
        simulator: &Held<dyn Simulator>,
        rate: f64,
    ) -> Result<(), Fault> {
        let nonsense = |error: Error| Fault::Component(error.at(simulator.label()));
        let goes_on = |timeline: &mut Timeline| timeline.go_on(state.time, told);
        let believed = state.check().and_then(|()| self.timeline.as_mut().map_or(Ok(()), goes_on));
        believed.map_err(|error| {
            let (kind, sentence) = (error.kind(), error.message());
            nonsense(Error::of(kind, format!("{sentence}, in the state of frame {}", self.sequence)))
        })?;
        let limit = PATIENT_FRAMES + PATIENT_FACTOR * expected_frames(&self.drive.scenario, rate);
        if self.frames > limit {
            return Err(nonsense(Error::of(
                ErrorKind::Nonsense,
                format!(
                    "after {limit} frames it says that {} s have passed of {} s, so its time does not go on",
                    state.time, self.drive.scenario.duration
                ),
            )));
        }
        Ok(())
    }

    /// What came of it; `error` is what failed. The recorder gets the last frames of a failure and the end.
    pub fn into_outcome(self, error: Option<&Error>, camera: Camera, witnesses: &Witnesses<'_>) -> Outcome {
        if let Some(recorder) = witnesses.recorder {
            if self.cause != Cause::Finished {
                self.record_last_frames(recorder, camera, witnesses.recent);
            }
            let text = error.map_or(self.cause.text(), Error::message);
            recorder.event(self.state.time, self.cause != Cause::Finished, text);
        }
        let (mean_cross_track_error, max_cross_track_error) = self.judge.cross_track_error();
        Outcome {
            success: self.cause == Cause::Finished,
            cause: self.cause,
            error: error.map(|error| error.message().to_owned()),
            error_kind: error.map(Error::kind),
            time: self.state.time,
            frames: self.frames,
            skipped_frames: self.sequence - self.frames,
            progress: self.state.progress,
            mean_cross_track_error,
            max_cross_track_error,
            measures: self.judge.measures().map(Box::new),
            digest: self.digest.text(),
        }
    }

    /// Records the last frame and those some seconds before it, as far as they are not recorded yet.
    fn record_last_frames(&self, recorder: &Recorder, camera: Camera, recent: &Recent) {
        let Some((sequence, time, [raw, perturbed])) = &self.last else { return };
        let later = |sequence: u64| self.last_image.is_none_or(|last| sequence > last);
        for pair in recent.before_the_end(*sequence, *time) {
            if later(pair.sequence) {
                recorder.image(ImageTopic::Raw, pair.sequence, pair.time, pair.raw.as_ref());
                recorder.image(ImageTopic::Perturbed, pair.sequence, pair.time, pair.perturbed.as_ref());
            }
        }
        if later(*sequence) {
            let (width, height) = (camera.width as usize, camera.height as usize);
            for (topic, sample) in [(ImageTopic::Raw, raw), (ImageTopic::Perturbed, perturbed)] {
                // It was a frame of this size when it was published.
                if let Ok(frame) = Frame::new(sample, width, height) {
                    recorder.image(topic, *sequence, *time, frame);
                }
            }
        }
    }
}

/// The road as a waypoint string.
fn waypoint_string(points: &[[f64; 3]]) -> String {
    let points: Vec<_> = points.iter().map(|[x, y, z]| format!("{x},{y},{z}")).collect();
    points.join("@")
}
