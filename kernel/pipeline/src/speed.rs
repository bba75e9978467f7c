//! How fast it went, as a line for people.

use crate::{drive, evaluate};

/// Frames, wall time, frames a second and the multiple of real time.
pub fn of_drive(performance: &drive::Performance) -> String {
    let drive::Performance { wall_seconds, frames_per_second, real_time_factor, stages, .. } = performance;
    format!(
        "{} frames in {wall_seconds:.1} s: {frames_per_second:.0} a second, {real_time_factor:.1} times real time",
        stages.steps
    )
}

/// Perturbed frames, wall time and frames a second.
pub fn of_evaluation(performance: &evaluate::Performance) -> String {
    let evaluate::Performance { perturbed_frames, wall_seconds, frames_per_second, .. } = performance;
    format!("{perturbed_frames} perturbed frames in {wall_seconds:.1} s: {frames_per_second:.0} a second")
}
