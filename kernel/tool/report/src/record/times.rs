//! How long it took, from the file with times.

use pdk_record::times::LoopTimes;
use serde::Deserialize;

use crate::view::{DriveTimes, EvaluateTimes};

/// The file with times.
#[derive(Deserialize)]
pub struct Performance {
    /// When the run began, in seconds since 1970 in universal time.
    pub started_unix_seconds: u64,
    drive: Option<Drive>,
    evaluations: Vec<Evaluation>,
}

/// All scenarios of the closed loop together.
#[derive(Deserialize)]
struct Drive {
    workers: u64,
    frames_per_second: f64,
    real_time_factor: f64,
    stages: LoopTimes,
}

#[derive(Deserialize)]
struct Evaluation {
    workers: u64,
    perturbed_frames: u64,
    frames_per_second: f64,
    perturbation_milliseconds: f64,
    driver_milliseconds: f64,
}

impl Performance {
    /// The times of the closed loop; none if nothing was driven.
    pub fn drive(&self) -> Option<DriveTimes> {
        let Drive { workers, frames_per_second, real_time_factor, stages } = self.drive.as_ref()?;
        Some(DriveTimes {
            workers: *workers,
            frames_per_second: *frames_per_second,
            real_time_factor: *real_time_factor,
            steps: stages.steps,
            overruns: stages.overruns,
            stages: [&stages.simulator, &stages.perturbation, &stages.driver, &stages.kernel]
                .map(|stage| (stage.median_microseconds / 1e3, stage.p99_microseconds / 1e3)),
        })
    }

    /// The times of each evaluation.
    pub fn evaluations(&self) -> Vec<EvaluateTimes> {
        let times = |evaluation: &Evaluation| EvaluateTimes {
            workers: evaluation.workers,
            frames: evaluation.perturbed_frames,
            frames_per_second: evaluation.frames_per_second,
            perturbation: evaluation.perturbation_milliseconds,
            driver: evaluation.driver_milliseconds,
        };
        self.evaluations.iter().map(times).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn the_times_are_those_of_the_file() {
        let stage = |median: f64| json!({"median_microseconds": median, "p99_microseconds": 2.0 * median});
        let read = |drive: Value| -> Performance {
            let evaluation = json!({
                "workers": 2, "perturbed_frames": 90, "wall_seconds": 3.0, "frames_per_second": 30.0,
                "perturbation_milliseconds": 1.5, "driver_milliseconds": 4.5,
            });
            let file = json!({"started_unix_seconds": 7, "drive": drive, "evaluations": [evaluation]});
            serde_json::from_value(file).unwrap()
        };
        let times = read(json!({
            "workers": 4, "wall_seconds": 5.0, "frames_per_second": 800.0, "real_time_factor": 40.0, "stages": {
                "steps": 4000, "overruns": 3, "simulator": stage(1000.0), "perturbation": stage(2000.0),
                "driver": stage(3000.0), "kernel": stage(4000.0),
            },
        }));
        let drive = times.drive().unwrap();
        assert_eq!((drive.workers, drive.steps, drive.overruns), (4, 4000, 3));
        assert_eq!(drive.stages, [(1.0, 2.0), (2.0, 4.0), (3.0, 6.0), (4.0, 8.0)]);
        let [evaluation] = &times.evaluations()[..] else { panic!("no evaluation") };
        assert_eq!((evaluation.workers, evaluation.frames, evaluation.driver), (2, 90, 4.5));
        assert!(read(Value::Null).drive().is_none());
    }
}
