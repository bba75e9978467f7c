//! Says when a scenario is over, and how the vehicle kept to its lane until then.

use pdk_model::outcome::Cause;
use pdk_sdk::prelude::State;
use pdk_trace::telemetry::Sampler;

/// A vehicle that covers less than this share of a metre a second makes no progress.
const STANDSTILL_SPEED: f64 = 0.1;

/// So many seconds of standing still end a scenario.
const STANDSTILL_SECONDS: f64 = 5.0;

/// Looks at every state of a scenario, also at those of frames that the driver did not see.
pub struct Judge {
    duration: f64,
    standing_since: Option<f64>,
    sampler: Sampler,
    samples: u64,
    sum: f64,
    max: f64,
}

impl Judge {
    /// A judge of a scenario with this time limit in seconds.
    pub fn new(duration: f64) -> Self {
        Self { duration, standing_since: None, sampler: Sampler::default(), samples: 0, sum: 0.0, max: 0.0 }
    }

    /// Notes a state, and says whether the scenario ends with it.
    pub fn look(&mut self, state: &State) -> Option<Cause> {
        let end = self.end(state);
        if self.sampler.takes(state.time, end.is_some()) {
            let error = state.cross_track_error.abs();
            self.samples += 1;
            self.sum += error;
            self.max = self.max.max(error);
        }
        end
    }

    fn end(&mut self, state: &State) -> Option<Cause> {
        let standing_since = match state.speed.abs() < STANDSTILL_SPEED {
            true => *self.standing_since.get_or_insert(state.time),
            false => {
                self.standing_since = None;
                state.time
            }
        };
        if state.collision {
            Some(Cause::Collision)
        } else if state.lane_departure {
            Some(Cause::LaneDeparture)
        } else if state.finished {
            Some(Cause::Finished)
        } else if state.time - standing_since >= STANDSTILL_SECONDS {
            Some(Cause::NoProgress)
        } else if state.time + 0.0005 >= self.duration {
            Some(Cause::TimeOut)
        } else {
            None
        }
    }

    /// Mean and largest absolute cross-track error over the telemetry.
    pub fn cross_track_error(&self) -> (f64, f64) {
        (self.sum / self.samples.max(1) as f64, self.max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(time: f64) -> State {
        State { time, speed: 5.0, ..State::default() }
    }

    #[test]
    fn errors_are_those_of_the_telemetry() {
        let mut judge = Judge::new(1.0);
        let mut end = None;
        for frame in 0..100 {
            let cross_track_error = if frame == 1 { 9.0 } else { f64::from(frame) / -30.0 };
            end = judge.look(&State { cross_track_error, ..state(f64::from(frame) / 30.0) });
            if end.is_some() {
                break;
            }
        }
        assert_eq!((end, judge.samples), (Some(Cause::TimeOut), 5));
        let (mean, max) = judge.cross_track_error();
        // Frames 0, 8, 15, 23 and 30.
        assert!((mean - 76.0 / 30.0 / 5.0).abs() < 1e-12 && max == 1.0, "{mean} {max}");
    }

    #[test]
    fn failures_end_a_scenario() {
        let departed = State { lane_departure: true, finished: true, ..state(1.0) };
        assert_eq!(Judge::new(9.0).look(&departed), Some(Cause::LaneDeparture));
        let mut judge = Judge::new(60.0);
        let standing = |time| State { speed: 0.0, ..state(time) };
        assert_eq!(judge.look(&standing(1.0)), None);
        assert_eq!(judge.look(&standing(5.9)), None);
        assert_eq!(judge.look(&standing(6.0)), Some(Cause::NoProgress));
    }

    #[test]
    fn a_pause_that_ends_is_no_standstill() {
        let mut judge = Judge::new(60.0);
        let standing = |time| State { speed: 0.0, ..state(time) };
        judge.look(&standing(1.0));
        judge.look(&state(3.0));
        assert_eq!(judge.look(&standing(7.0)), None);
    }
}
