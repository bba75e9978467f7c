//! One scenario around the closed loop: simulator, perturbations, driver, and back to the simulator, frame by frame.

use std::time::Duration;

use pdk_bus::{Bus, FrameSample, Stamp, Topic};
use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_chain::view::View;
use pdk_components::held::Held;
use pdk_model::outcome::{Cause, Outcome};
use pdk_model::scenario::Mode;
use pdk_record::trace::step::{Digest, Step};
use pdk_sdk::describe::{ActsOn, Clock};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Camera, Control, DriveContext, Driver, Frame, FrameMut, Simulator, State};
use pdk_sdk::timeline::Told;
use pdk_supervise::calls::Function;
use twox_hash::XxHash3_64;

use crate::annotated::Annotated;
use crate::announced::Announced;
use crate::fault::Fault;
use crate::judge::Judge;
use crate::motion::Motion;
use crate::pace::Pace;
use crate::pictures::{Pictures, Seen};
use crate::protocol::Drive;
use crate::recent::Recent;
use crate::recorder::Recorder;
use crate::stages::{Stage, Stopwatch};

pub use crate::motion::expected_frames;

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
    /// Shows what the driver's network looks at, if that is wanted.
    pub view: Option<&'a mut View>,
}

/// What observes a drive: the recorder, the latest frames, the stopwatch and the progress bar.
pub struct Witnesses<'a> {
    /// Writes the trace; none if the drive leaves no trace.
    pub recorder: Option<&'a Recorder>,
    /// The latest frames.
    pub recent: &'a mut Recent,
    /// Measures the stages.
    pub stopwatch: &'a mut Stopwatch,
    /// Told after every frame.
    pub progress: &'a mut dyn FnMut(u64),
}

/// What is to be driven.
struct Assignment<'a> {
    drive: &'a Drive,
    /// The number of the job.
    number: u64,
    slot: u32,
}

/// How many frames there were.
#[derive(Default)]
struct Count {
    /// Those that were driven.
    frames: u64,
    /// The number of the next frame: above `frames` by those that were skipped.
    sequence: u64,
}

/// A scenario while it is driven.
pub struct Run<'a> {
    job: Assignment<'a>,
    judge: Judge,
    digest: Digest,
    count: Count,
    pace: Pace<'a>,
    motion: Motion,
    annotated: Annotated,
    pictures: Pictures,
    /// What was applied to the vehicle last.
    applied: Control,
    cause: Cause,
    under_way: bool,
}

impl<'a> Run<'a> {
    /// A scenario that is job `number`, on this slot.
    pub fn new(drive: &'a Drive, number: u64, slot: u32) -> Self {
        Self {
            job: Assignment { drive, number, slot },
            judge: Judge::new(&drive.scenario),
            digest: Digest::default(),
            count: Count::default(),
            pace: Pace::start(1.0, None),
            motion: Motion::default(),
            annotated: Annotated::default(),
            pictures: Pictures::default(),
            applied: Control::default(),
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
    /// If a component fails, or the routing.
    pub fn drive(&mut self, with: &mut Instances<'_>, witnesses: &mut Witnesses<'_>) -> Result<(), Fault> {
        self.start(with, witnesses)?;
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

    /// Puts the vehicle at the start of the road.
    fn start(&mut self, with: &mut Instances<'_>, witnesses: &mut Witnesses<'_>) -> Result<(), Fault> {
        let Assignment { drive, slot, .. } = self.job;
        let (scenario, rate) = (&drive.scenario, with.camera.rate);
        // A simulator with its own clock keeps the time itself.
        let paced = scenario.mode == Mode::Realtime && with.clock == Clock::Stepped;
        witnesses.stopwatch.start(paced.then_some(Duration::from_secs_f64(1.0 / rate)));
        witnesses.recent.clear();
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
            recorder.event(0.0, false, &drive.name);
            let waypoints = with
                .simulator
                .call(Function::Waypoints, None, |simulator| Ok(simulator.waypoints()))
                .map_err(Fault::Simulator)?;
            let road = waypoint_string(&waypoints);
            if let Some(trace) = drive.trace.clone() {
                let announced = Announced {
                    number: self.job.number,
                    name: drive.name.clone(),
                    trace,
                    road: road.clone(),
                };
                let text = serde_json::to_string(&announced).map_err(|error| Fault::Kernel(error.into()))?;
                // A folder that is full or gone says nothing about the scenario.
                with.bus.announce(&text).map_err(|error| Fault::Kernel(Error::new(error.to_string())))?;
            }
            if !waypoints.is_empty() {
                recorder.road(road);
            }
        }
        self.annotated = Annotated::new(annotations, with.camera, with.simulator)?;
        self.motion = Motion::start(scenario, with.clock, rate);
        self.pace = Pace::start(rate, drive.skips.as_deref());
        Ok(())
    }

    /// One frame around the loop.
    fn step(
        &mut self,
        with: &mut Instances<'_>,
        witnesses: &mut Witnesses<'_>,
    ) -> Result<Option<Cause>, Fault> {
        let sequence = self.count.sequence;
        let size = [with.camera.width as usize, with.camera.height as usize];
        let stamp = Stamp { scenario: self.job.number, sequence, time: sequence as f64 / with.camera.rate };
        let (raw, state) = self.render(with, witnesses.stopwatch, stamp)?;
        let raw_frame = frame(&raw, size)?;
        with.bus.publish_state(stamp, state)?;

        let Instances { simulator, chain, driver, bus, view, .. } = with;
        let stopwatch = &mut *witnesses.stopwatch;
        self.annotated.look(simulator, sequence, stopwatch)?;
        let moment = Moment::new(sequence, state.time)
            .at_speed(state.speed)
            .after(self.motion.reach(&state))
            .at_rate(with.camera.rate)
            .with_labels(self.annotated.labels())
            .with_depth(self.annotated.depth());

        let mut loan = bus.loan_frame(Topic::Perturbed, stamp)?;
        let target = FrameMut::new(&mut loan, size[0], size[1]).map_err(wrong_size)?;
        let cx = DriveContext { frame_index: sequence, time: state.time, speed: state.speed };
        let observed = stopwatch
            .measure(Stage::Perturbation, || {
                chain.apply(raw_frame, target, &moment)?;
                chain.pass(ActsOn::Observation, cx.numbers(), &moment)
            })
            .map_err(Fault::Component)?;
        let cx = observed.map_or(cx, |[time, speed]| DriveContext { time, speed, ..cx });
        let perturbed = loan.publish()?;
        let perturbed_frame = frame(&perturbed, size)?;

        let control = stopwatch
            .measure(Stage::Driver, || {
                driver.call(Function::Drive, Some(sequence), |d| d.drive(perturbed_frame, &cx)?.checked())
            })
            .map_err(Fault::Component)?;
        bus.publish_control(stamp, control)?;
        let applied = stopwatch
            .measure(Stage::Perturbation, || chain.pass(ActsOn::Control, control.numbers(), &moment))
            .map_err(Fault::Component)?
            .map(Control::from_numbers);

        let frame_hash = XxHash3_64::oneshot(&perturbed);
        self.digest.add(frame_hash, &control);
        if let Some(recorder) = witnesses.recorder {
            recorder.step(Step { sequence, state, control, frame_hash, observed, applied });
            let (every, time) = (self.job.drive.images_every, state.time);
            let seen = Seen { sequence, time, raw: raw_frame, perturbed: perturbed_frame, moment: &moment };
            self.pictures.record(&seen, every, recorder, witnesses.recent, view.as_deref_mut())?;
        }
        self.pictures.keep(sequence, state.time, [raw, perturbed]);
        self.count.frames += 1;
        self.count.sequence += 1;
        self.motion.state = state;
        match self.judge.look(&state) {
            Some(end) => Ok(Some(end)),
            None => self.act(applied.unwrap_or(control), with, witnesses.stopwatch),
        }
    }

    /// The simulator renders a frame straight into shared memory.
    fn render(
        &mut self,
        with: &mut Instances<'_>,
        stopwatch: &mut Stopwatch,
        stamp: Stamp,
    ) -> Result<(FrameSample, State), Fault> {
        let Instances { simulator, camera, bus, .. } = with;
        let mut loan = bus.loan_frame(Topic::Raw, stamp)?;
        let target = FrameMut::new(&mut loan, camera.width as usize, camera.height as usize);
        let target = target.map_err(wrong_size)?;
        let state = stopwatch
            .measure(Stage::Simulator, || {
                simulator.call(Function::Frame, Some(stamp.sequence), |s| s.frame(target))
            })
            .map_err(Fault::Simulator)?;
        self.believe(&state, Told::Frame, simulator)?;
        Ok((loan.publish()?, state))
    }

    /// Hands the control to the simulator. In real time the control before held while the driver was thinking: each state that
    /// the vehicle went through meanwhile is judged like any other.
    fn act(
        &mut self,
        control: Control,
        with: &mut Instances<'_>,
        stopwatch: &mut Stopwatch,
    ) -> Result<Option<Cause>, Fault> {
        let sequence = self.count.sequence - 1;
        if with.clock == Clock::Own {
            let state = stopwatch
                .measure(Stage::Simulator, || {
                    with.simulator.call(Function::Act, Some(sequence), |simulator| simulator.act(control))
                })
                .map_err(Fault::Simulator)?;
            self.believe(&state, Told::Act, with.simulator)?;
            let passed = ((state.time - self.motion.state.time) * with.camera.rate).round() as u64;
            self.count.sequence += passed.saturating_sub(1);
            self.applied = control;
            return Ok(None);
        }
        let mode = self.job.drive.scenario.mode;
        let skipped = match mode {
            Mode::Lockstep => 0,
            Mode::Realtime => self.pace.skipped(sequence),
        };
        for number in 0..=skipped {
            let held = if number < skipped { self.applied } else { control };
            let at = sequence + number;
            let state = stopwatch
                .measure(Stage::Simulator, || with.simulator.call(Function::Act, Some(at), |s| s.act(held)))
                .map_err(Fault::Simulator)?;
            self.believe(&state, Told::Act, with.simulator)?;
            // The state behind the last of them comes with the next frame, which is judged then.
            if number < skipped {
                self.count.sequence += 1;
                self.motion.state = state;
                if let Some(cause) = self.judge.look(&state) {
                    return Ok(Some(cause));
                }
            }
        }
        self.applied = control;
        if mode == Mode::Realtime && self.pace.is_by_clock() {
            stopwatch.wait(self.pace.due(self.count.sequence));
        }
        Ok(None)
    }

    fn believe(&mut self, state: &State, told: Told, simulator: &Held<dyn Simulator>) -> Result<(), Fault> {
        self.motion.believe(state, told, [self.count.sequence, self.count.frames], simulator)
    }

    /// What came of it; `error` is what failed. The recorder gets the last frames of a failure and the end.
    pub fn into_outcome(self, error: Option<&Error>, camera: Camera, witnesses: &Witnesses<'_>) -> Outcome {
        if let Some(recorder) = witnesses.recorder {
            if self.cause != Cause::Finished {
                self.pictures.record_last(recorder, camera, witnesses.recent);
            }
            let text = error.map_or(self.cause.text(), Error::message);
            recorder.event(self.motion.state.time, self.cause != Cause::Finished, text);
        }
        let (mean_cross_track_error, max_cross_track_error) = self.judge.cross_track_error();
        Outcome {
            success: self.cause == Cause::Finished,
            cause: self.cause,
            error: error.map(|error| error.message().to_owned()),
            error_kind: error.map(Error::kind),
            time: self.motion.state.time,
            frames: self.count.frames,
            skipped_frames: self.count.sequence - self.count.frames,
            progress: self.motion.state.progress,
            mean_cross_track_error,
            max_cross_track_error,
            measures: self.judge.measures().map(Box::new),
            digest: self.digest.text(),
        }
    }
}

/// A frame in shared memory.
fn frame(sample: &FrameSample, [width, height]: [usize; 2]) -> Result<Frame<'_>, Fault> {
    Frame::new(sample, width, height).map_err(wrong_size)
}

fn wrong_size(error: pdk_sdk::ops::FrameError) -> Fault {
    Fault::Kernel(Error::new(error))
}

/// The road as a waypoint string.
fn waypoint_string(points: &[[f64; 3]]) -> String {
    let points: Vec<_> = points.iter().map(|[x, y, z]| format!("{x},{y},{z}")).collect();
    points.join("@")
}
