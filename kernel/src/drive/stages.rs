//! How long the stages of the loop take.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

/// The stages of a step, as they follow each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The simulator renders the frame.
    Simulator,
    /// The perturbations change it.
    Perturbation,
    /// The driver looks at it and decides.
    Driver,
    /// Everything else: routing, record, supervision.
    Kernel,
}

const STAGES: usize = 4;

/// Room is made beforehand for at most so many steps: ten hours at 30 frames a second.
const LARGEST_RESERVE: usize = 1 << 20;

/// Measures the stages of each step of a loop.
pub struct Stopwatch {
    budget: Duration,
    step_started: Instant,
    /// The time of each stage in the step at hand.
    current: [Duration; STAGES],
    /// Nanoseconds of each stage, step by step.
    steps: [Vec<u32>; STAGES],
    overruns: u64,
}

/// The times of a stage in microseconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct StageTimes {
    /// Half of the steps took no longer.
    pub median_microseconds: f64,
    /// 99 of 100 steps took no longer.
    pub p99_microseconds: f64,
}

/// The times of a loop.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct LoopTimes {
    /// Steps that were measured.
    pub steps: u64,
    /// Steps that took longer than a frame lasts.
    pub overruns: u64,
    /// The simulator.
    pub simulator: StageTimes,
    /// The perturbations.
    pub perturbation: StageTimes,
    /// The driver.
    pub driver: StageTimes,
    /// Everything else.
    pub kernel: StageTimes,
}

impl Stopwatch {
    /// A stopwatch for a loop of about so many steps, which should take no longer than `budget` each.
    pub fn new(budget: Duration, steps: usize) -> Self {
        let steps = steps.min(LARGEST_RESERVE);
        Self {
            budget,
            step_started: Instant::now(),
            current: [Duration::ZERO; STAGES],
            steps: std::array::from_fn(|_| Vec::with_capacity(steps)),
            overruns: 0,
        }
    }

    /// Starts a step.
    pub fn start_step(&mut self) {
        self.step_started = Instant::now();
        self.current = [Duration::ZERO; STAGES];
    }

    /// Measures a part of a stage.
    pub fn measure<T>(&mut self, stage: Stage, work: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let result = work();
        self.current[stage as usize] += started.elapsed();
        result
    }

    /// Waits until the next frame is due: that is nobody's work.
    pub fn wait(&mut self, until: Instant) {
        let started = Instant::now();
        std::thread::sleep(until.saturating_duration_since(started));
        self.step_started += started.elapsed();
    }

    /// Ends a step: what was not measured was the kernel's.
    pub fn end_step(&mut self) {
        let total = self.step_started.elapsed();
        let measured: Duration = self.current.iter().sum();
        self.current[Stage::Kernel as usize] += total.saturating_sub(measured);
        self.overruns += u64::from(total > self.budget);
        for (steps, time) in self.steps.iter_mut().zip(self.current) {
            steps.push(u32::try_from(time.as_nanos()).unwrap_or(u32::MAX));
        }
    }

    /// Adds the steps of another loop.
    pub fn merge(&mut self, other: Self) {
        self.overruns += other.overruns;
        for (mine, theirs) in self.steps.iter_mut().zip(other.steps) {
            mine.extend(theirs);
        }
    }

    /// Sums up.
    pub fn times(&self) -> LoopTimes {
        let [simulator, perturbation, driver, kernel] = self.steps.each_ref().map(|steps| stage_times(steps));
        LoopTimes {
            steps: self.steps[0].len() as u64,
            overruns: self.overruns,
            simulator,
            perturbation,
            driver,
            kernel,
        }
    }
}

fn stage_times(steps: &[u32]) -> StageTimes {
    let mut sorted = steps.to_vec();
    sorted.sort_unstable();
    let at = |share: f64| match sorted.len() {
        0 => 0.0,
        len => f64::from(sorted[((len - 1) as f64 * share).round() as usize]) / 1e3,
    };
    StageTimes { median_microseconds: at(0.5), p99_microseconds: at(0.99) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_measured_is_the_kernels() {
        let mut stopwatch = Stopwatch::new(Duration::from_secs(1), 1);
        stopwatch.start_step();
        stopwatch.measure(Stage::Driver, || std::thread::sleep(Duration::from_millis(5)));
        std::thread::sleep(Duration::from_millis(2));
        stopwatch.end_step();
        let times = stopwatch.times();
        assert_eq!((times.steps, times.overruns), (1, 0));
        assert!(times.driver.median_microseconds >= 5_000.0);
        assert!(times.kernel.median_microseconds >= 2_000.0);
        assert_eq!(times.simulator.median_microseconds, 0.0);
    }

    #[test]
    fn quantiles_are_those_of_the_sorted_steps() {
        let steps: Vec<u32> = (0..=100).rev().map(|v| v * 1000).collect();
        assert_eq!(stage_times(&steps), StageTimes { median_microseconds: 50.0, p99_microseconds: 99.0 });
    }
}
