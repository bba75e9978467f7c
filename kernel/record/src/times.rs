//! How long the stages of the loop took, as `performance.json` has it.

use serde::{Deserialize, Serialize};

/// The times of a stage in microseconds, exact to 2 %.
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
    /// Steps in real time that took longer than a frame lasts.
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
