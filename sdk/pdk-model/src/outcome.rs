//! What came of a scenario.

use serde::{Deserialize, Serialize};

use crate::described::described;
use crate::error::ErrorKind;

/// How a scenario ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The end of the road was reached: the only success.
    Finished,
    /// The vehicle left its lane.
    LaneDeparture,
    /// The vehicle hit something.
    Collision,
    /// The vehicle stood still.
    NoProgress,
    /// The time limit came before the end of the road.
    TimeOut,
    /// A component failed; nothing can be said about the driver.
    #[default]
    Error,
}

/// What a scenario says about the driver.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The end of the road was reached.
    #[default]
    Passed,
    /// The vehicle left its lane or hit something.
    Unsafe,
    /// The vehicle stood still, on the road.
    Stopped,
    /// The vehicle was too slow to reach the end in time.
    Late,
    /// Nothing: a component failed.
    Void,
}

impl Verdict {
    /// Whether the driver failed, in whatever way.
    pub fn failed(self) -> bool {
        matches!(self, Self::Unsafe | Self::Stopped | Self::Late)
    }
}

/// The sentence about a driver whose drives without perturbation came out like this; none if none of them failed. Drives that say nothing
/// about the driver do not count. `driver` is what the sentence calls it.
pub fn failing_unperturbed(driver: &str, drives: impl IntoIterator<Item = Verdict>) -> Option<String> {
    let (mut judged, mut failed, mut late) = (0, 0, 0);
    for verdict in drives.into_iter().filter(|verdict| *verdict != Verdict::Void) {
        judged += 1;
        failed += usize::from(verdict.failed());
        late += usize::from(verdict == Verdict::Late);
    }
    let of = match judged {
        1 => "its only drive".to_owned(),
        judged => format!("{failed} of {judged} drives"),
    };
    let fails = match late {
        _ if failed == 0 => return None,
        0 => format!("fails {of} without any perturbation"),
        late if late == failed => format!("runs out of time in {of} without any perturbation"),
        late => format!("fails {of} without any perturbation, {late} of them because the time ran out"),
    };
    let remedy = if late > 0 { "; raise `duration`" } else { "" };
    Some(format!("{driver} {fails}, so its failures under perturbations say little about these{remedy}."))
}

impl Cause {
    /// What it says about the driver.
    pub fn verdict(self) -> Verdict {
        match self {
            Cause::Finished => Verdict::Passed,
            Cause::LaneDeparture | Cause::Collision => Verdict::Unsafe,
            Cause::NoProgress => Verdict::Stopped,
            Cause::TimeOut => Verdict::Late,
            Cause::Error => Verdict::Void,
        }
    }

    /// As it is written in tables.
    pub fn text(self) -> &'static str {
        match self {
            Cause::Finished => "finished",
            Cause::LaneDeparture => "lane departure",
            Cause::Collision => "collision",
            Cause::NoProgress => "no progress",
            Cause::TimeOut => "time-out",
            Cause::Error => "error",
        }
    }
}

described! {
    /// What came of a scenario.
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    pub struct Outcome {
        /// Whether the end of the road was reached.
        success: bool, Luau "boolean", JSON "boolean";
        /// How it ended; for scripts, `elsewhere` if another part of the run drives it (`--shard`).
        cause: Cause,
            Luau "\"finished\" | \"lane_departure\" | \"collision\" | \"no_progress\" | \"time_out\" | \"error\" | \"elsewhere\"",
            JSON "text: `finished`, `lane_departure`, `collision`, `no_progress`, `time_out` or `error`";
        /// Which component failed, and how, in one sentence.
        error: Option<String>, Luau "string?", JSON "text", "with `error`" unless "Option::is_none";
        /// In which way it failed: one of the [kinds](worker-protocol.md#kinds-of-errors).
        error_kind: Option<ErrorKind>, Luau "", JSON "text", "with `error`" unless "Option::is_none";
        /// Simulation time of the last state that was judged, in seconds.
        time: f64, Luau "number", JSON "number, s";
        /// Frames that were driven. If the process was lost, the number of the frame at which it was.
        frames: u64, Luau "number", JSON "whole number";
        /// Frames that the driver did not see, because it was at work on an earlier one or the simulator has its own clock.
        skipped_frames: u64, Luau "number", JSON "whole number", "if not 0" unless "is_zero";
        /// The share of the road that was driven, 0 to 1.
        progress: f64, Luau "number", JSON "number, 0 to 1";
        /// The mean of the absolute cross-track error over all judged states, in metres. That of a drive that was cut short is not comparable
        /// with that of one that reached the end: how soon it failed is.
        mean_cross_track_error: f64, Luau "number", JSON "number, m";
        /// The largest absolute cross-track error in metres.
        max_cross_track_error: f64, Luau "number", JSON "number, m";
        /// What else was measured; nothing if a component failed before a state was judged.
        measures: Option<Box<Measures>>, Luau "Measures?", JSON "object", "if a state was judged" unless "Option::is_none";
        /// A hash of every frame that the driver saw and every control that it gave: equal for equal drives. Empty if the process was lost.
        digest: String, Luau "string", JSON "text, 32 digits, or empty";
    }
}

described! {
    /// The measures of a drive besides how it ended.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
    pub struct Measures {
        /// When a wheel was over the line for the first time, in seconds of simulation time.
        over_line_from: Option<f64>, Luau "number?", JSON "number, s", "if one was" unless "Option::is_none";
        /// For how many seconds a wheel was over the line.
        over_line_seconds: f64, Luau "number", JSON "number, s";
        /// The root mean square of the lateral acceleration, speed times yaw rate, in m/s².
        rms_lateral_acceleration: f64, Luau "number", JSON "number, m/s²";
        /// The largest lateral acceleration.
        max_lateral_acceleration: f64, Luau "number", JSON "number, m/s²";
        /// The root mean square of the jerk, the change of the acceleration along and across, in m/s³.
        rms_jerk: f64, Luau "number", JSON "number, m/s³";
        /// The largest jerk.
        max_jerk: f64, Luau "number", JSON "number, m/s³";
    }
}

impl Outcome {
    /// That of a scenario in which a component failed before anything could be measured.
    pub fn of_error(kind: ErrorKind, message: String) -> Self {
        Self { error: Some(message), error_kind: Some(kind), ..Self::default() }
    }
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outcome_is_read_back_as_it_was() {
        let success = Outcome {
            success: true,
            cause: Cause::Finished,
            error: None,
            error_kind: None,
            time: 21.35,
            frames: 427,
            skipped_frames: 0,
            progress: 1.0,
            mean_cross_track_error: 0.1,
            max_cross_track_error: 0.7,
            measures: None,
            digest: "00ff".into(),
        };
        let failure = Outcome {
            success: false,
            cause: Cause::Error,
            error: Some("driver `x`: it is gone".into()),
            error_kind: Some(ErrorKind::Lost),
            skipped_frames: 3,
            ..success.clone()
        };
        let measures = Measures { over_line_from: Some(3.5), over_line_seconds: 0.5, ..Measures::default() };
        let measured = Outcome { measures: Some(Box::new(measures)), ..success.clone() };
        for (outcome, fields) in [(success, 8), (failure, 11), (measured, 9)] {
            let written = serde_json::to_value(&outcome).unwrap();
            assert_eq!(written.as_object().unwrap().len(), fields);
            assert_eq!(serde_json::from_value::<Outcome>(written).unwrap(), outcome);
        }
    }

    #[test]
    fn to_stop_is_a_failure_and_not_unsafe() {
        assert_eq!(Cause::NoProgress.verdict(), Verdict::Stopped);
        assert_eq!(Cause::TimeOut.verdict(), Verdict::Late);
        assert_eq!(Cause::LaneDeparture.verdict(), Verdict::Unsafe);
        let failed = [Verdict::Passed, Verdict::Unsafe, Verdict::Stopped, Verdict::Void].map(Verdict::failed);
        assert_eq!(failed, [false, true, true, false]);
    }

    #[test]
    fn a_driver_that_runs_out_of_time_is_not_called_bad() {
        use Verdict::{Late, Passed, Unsafe};
        assert_eq!(failing_unperturbed("Driver `x`", [Passed, Passed]), None);
        let sentence =
            |drives: &[Verdict]| failing_unperturbed("Driver `x`", drives.iter().copied()).unwrap();
        assert_eq!(
            sentence(&[Unsafe]),
            "Driver `x` fails its only drive without any perturbation, so its failures under perturbations say little about these."
        );
        assert_eq!(
            sentence(&[Late, Passed]),
            "Driver `x` runs out of time in 1 of 2 drives without any perturbation, so its failures under perturbations say little about \
             these; raise `duration`."
        );
        assert!(sentence(&[Late, Unsafe]).starts_with(
            "Driver `x` fails 2 of 2 drives without any perturbation, 1 of them because the time ran out, so"
        ));
    }
}
