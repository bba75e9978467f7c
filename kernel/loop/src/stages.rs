//! How long the stages of the loop take.

use std::time::{Duration, Instant};

use pdk_record::times::{LoopTimes, StageTimes};
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

/// Times are counted in classes, of which there are this many from one power of two to the next: each is 3 % wide.
const CLASSES_PER_OCTAVE: usize = 1 << CLASS_BITS;
const CLASS_BITS: u32 = 5;
/// Up to 2^40 ns, which is 18 minutes.
const CLASSES: usize = 40 * CLASSES_PER_OCTAVE;

/// How often a time fell into each class.
#[derive(Clone)]
struct Counts(Box<[u32]>);

impl Counts {
    fn new() -> Self {
        Self(vec![0; CLASSES].into_boxed_slice())
    }

    fn add(&mut self, time: Duration) {
        let class = class_of(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
        self.0[class] = self.0[class].saturating_add(1);
    }
}

/// The class of a time in nanoseconds: its highest bit, and the bits behind that.
fn class_of(nanoseconds: u64) -> usize {
    let time = nanoseconds.max(1 << CLASS_BITS);
    let octave = time.ilog2();
    let behind = (time >> (octave - CLASS_BITS)) as usize & (CLASSES_PER_OCTAVE - 1);
    (octave as usize * CLASSES_PER_OCTAVE + behind).min(CLASSES - 1)
}

/// The middle of a class in microseconds.
fn microseconds(class: usize) -> f64 {
    let (octave, behind) = (class / CLASSES_PER_OCTAVE, class % CLASSES_PER_OCTAVE);
    let width = (1u64 << octave) as f64 / CLASSES_PER_OCTAVE as f64;
    ((1u64 << octave) as f64 + (behind as f64 + 0.5) * width) / 1e3
}

/// Measures the stages of each step of a loop.
pub struct Stopwatch {
    /// How long a step may take; none if the simulator waits.
    budget: Option<Duration>,
    step_started: Instant,
    /// The time of each stage in the step at hand.
    current: [Duration; STAGES],
    counts: [Counts; STAGES],
    steps: u64,
    overruns: u64,
}

impl Stopwatch {
    /// A stopwatch.
    pub fn new() -> Self {
        Self {
            budget: None,
            step_started: Instant::now(),
            current: [Duration::ZERO; STAGES],
            counts: std::array::from_fn(|_| Counts::new()),
            steps: 0,
            overruns: 0,
        }
    }

    /// Starts a scenario, whose steps have to take no longer than `budget` if there is one.
    pub fn start(&mut self, budget: Option<Duration>) {
        self.budget = budget;
        (self.steps, self.overruns) = (0, 0);
        self.counts.iter_mut().for_each(|counts| counts.0.fill(0));
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

    /// Waits until the next frame is due. The time counts for no component.
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
        self.steps += 1;
        self.overruns += u64::from(self.budget.is_some_and(|budget| total > budget));
        for (counts, time) in self.counts.iter_mut().zip(self.current) {
            counts.add(time);
        }
    }

    /// The times of the scenario.
    pub fn times(&self) -> Times {
        let occupied = |counts: &Counts| {
            let classes = counts.0.iter().enumerate().filter(|(_, count)| **count > 0);
            classes.map(|(class, count)| (class as u32, u64::from(*count))).collect()
        };
        Times { steps: self.steps, overruns: self.overruns, counts: self.counts.each_ref().map(occupied) }
    }
}

impl Default for Stopwatch {
    fn default() -> Self {
        Self::new()
    }
}

/// The times of many steps, which can be added up over scenarios and workers.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// Steps that were measured.
    pub steps: u64,
    /// Steps in real time that took longer than a frame lasts.
    pub overruns: u64,
    /// For each stage the classes of time that occurred, in order, and how often.
    counts: [Vec<(u32, u64)>; STAGES],
}

impl Times {
    /// Adds others.
    pub fn add(&mut self, other: &Times) {
        self.steps += other.steps;
        self.overruns += other.overruns;
        for (mine, theirs) in self.counts.iter_mut().zip(&other.counts) {
            for (class, count) in theirs {
                match mine.binary_search_by_key(class, |(class, _)| *class) {
                    Ok(place) => mine[place].1 += count,
                    Err(place) => mine.insert(place, (*class, *count)),
                }
            }
        }
    }

    /// Median and 99th percentile of each stage.
    pub fn summary(&self) -> LoopTimes {
        let [simulator, perturbation, driver, kernel] = self.counts.each_ref().map(|counts| StageTimes {
            median_microseconds: quantile(counts, 0.5),
            p99_microseconds: quantile(counts, 0.99),
        });
        LoopTimes { steps: self.steps, overruns: self.overruns, simulator, perturbation, driver, kernel }
    }
}

/// The time that this share of all is not above; 0 if there are none.
fn quantile(counts: &[(u32, u64)], share: f64) -> f64 {
    let all: u64 = counts.iter().map(|(_, count)| count).sum();
    let wanted = (all.saturating_sub(1) as f64 * share).round() as u64;
    let mut below = 0;
    for (class, count) in counts {
        below += count;
        if below > wanted {
            return microseconds(*class as usize);
        }
    }
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_measured_is_the_kernels() {
        let mut stopwatch = Stopwatch::new();
        stopwatch.start(Some(Duration::from_secs(1)));
        stopwatch.start_step();
        stopwatch.measure(Stage::Driver, || std::thread::sleep(Duration::from_millis(5)));
        std::thread::sleep(Duration::from_millis(2));
        stopwatch.end_step();
        let times = stopwatch.times().summary();
        assert_eq!((times.steps, times.overruns), (1, 0));
        assert!(times.driver.median_microseconds >= 4_900.0);
        assert!(times.kernel.median_microseconds >= 1_960.0);
        assert!(times.simulator.median_microseconds < 1.0);
    }

    #[test]
    fn only_real_time_has_a_budget() {
        for (budget, overruns) in [(None, 0), (Some(Duration::ZERO), 1)] {
            let mut stopwatch = Stopwatch::new();
            stopwatch.start(budget);
            stopwatch.start_step();
            stopwatch.end_step();
            assert_eq!(stopwatch.times().overruns, overruns);
        }
    }

    #[test]
    fn quantiles_are_exact_to_two_percent_however_times_are_added_up() {
        let times = |range: std::ops::RangeInclusive<u64>| {
            let mut counts = Counts::new();
            range.for_each(|v| counts.add(Duration::from_micros(v)));
            let occupied: Vec<_> = counts
                .0
                .iter()
                .enumerate()
                .filter(|(_, n)| **n > 0)
                .map(|(c, n)| (c as u32, u64::from(*n)))
                .collect();
            Times { steps: 1, overruns: 0, counts: std::array::from_fn(|_| occupied.clone()) }
        };
        let mut sum = times(501..=1000);
        sum.add(&times(1..=500));
        assert_eq!(sum, Times { steps: 2, ..times(1..=1000) });
        let StageTimes { median_microseconds, p99_microseconds } = sum.summary().driver;
        assert!((median_microseconds / 500.0 - 1.0).abs() < 0.02, "{median_microseconds}");
        assert!((p99_microseconds / 990.0 - 1.0).abs() < 0.02, "{p99_microseconds}");
        assert_eq!(quantile(&[], 0.5), 0.0);
        for extreme in [0, 1, 31, 32, u64::MAX] {
            assert!(class_of(extreme) < CLASSES);
        }
    }
}
