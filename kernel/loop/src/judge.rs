//! Says when a scenario is over, and measures the drive until then.

use pdk_metrics::comfort::Comfort;
use pdk_model::failure::FailureCriteria;
use pdk_model::outcome::{Cause, Measures};
use pdk_sdk::prelude::{Scenario, State};

/// Looks at every state of a scenario, also at those of frames that the driver did not see.
pub struct Judge {
    criteria: FailureCriteria,
    duration: f64,
    standing_since: Option<f64>,
    states: u64,
    sum: f64,
    max: f64,
    /// The time of the state before.
    before: f64,
    over_line_from: Option<f64>,
    over_line_seconds: f64,
    comfort: Comfort,
}

impl Judge {
    /// The judge of a scenario.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            criteria: scenario.failure,
            duration: scenario.duration,
            standing_since: None,
            states: 0,
            sum: 0.0,
            max: 0.0,
            before: 0.0,
            over_line_from: None,
            over_line_seconds: 0.0,
            comfort: Comfort::default(),
        }
    }

    /// Notes a state, and says whether the scenario ends with it.
    pub fn look(&mut self, state: &State) -> Option<Cause> {
        let error = state.cross_track_error.abs();
        self.states += 1;
        self.sum += error;
        self.max = self.max.max(error);
        let passed = (state.time - self.before).max(0.0);
        if error >= self.criteria.over_line {
            // The first state counts for no time, because its start is not known.
            self.over_line_seconds += if self.states > 1 { passed } else { 0.0 };
            self.over_line_from.get_or_insert(state.time);
        }
        self.comfort.look(state);
        self.before = state.time;
        self.end(state)
    }

    fn end(&mut self, state: &State) -> Option<Cause> {
        let standing_since = match state.speed.abs() < self.criteria.standstill_speed {
            true => *self.standing_since.get_or_insert(state.time),
            false => {
                self.standing_since = None;
                state.time
            }
        };
        if state.collision {
            Some(Cause::Collision)
        } else if self.criteria.departed(state) {
            Some(Cause::LaneDeparture)
        } else if state.finished {
            Some(Cause::Finished)
        } else if state.time - standing_since >= self.criteria.standstill_seconds {
            Some(Cause::NoProgress)
        } else if state.time + 0.0005 >= self.duration {
            Some(Cause::TimeOut)
        } else {
            None
        }
    }

    /// Mean and largest absolute cross-track error over all states.
    pub fn cross_track_error(&self) -> (f64, f64) {
        (self.sum / self.states.max(1) as f64, self.max)
    }

    /// What else was measured; none before the first state.
    pub fn measures(&self) -> Option<Measures> {
        (self.states > 0).then(|| Measures {
            over_line_from: self.over_line_from,
            over_line_seconds: self.over_line_seconds,
            rms_lateral_acceleration: self.comfort.lateral_acceleration.rms(),
            max_lateral_acceleration: self.comfort.lateral_acceleration.max(),
            rms_jerk: self.comfort.jerk.rms(),
            max_jerk: self.comfort.jerk.max(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_model::failure::Comparison;

    fn state(time: f64) -> State {
        State { time, speed: 5.0, ..State::default() }
    }

    fn judge_by(failure: FailureCriteria, duration: f64) -> Judge {
        Judge::new(&Scenario { failure, duration, ..Scenario::default() })
    }

    fn judge(duration: f64) -> Judge {
        judge_by(FailureCriteria::default(), duration)
    }

    #[test]
    fn errors_are_those_of_all_states() {
        let mut judge = judge(1.0);
        let mut end = None;
        for frame in 0..100 {
            let cross_track_error = if frame == 1 { 9.0 } else { f64::from(frame) / -30.0 };
            end = judge.look(&State { cross_track_error, ..state(f64::from(frame) / 30.0) });
            if end.is_some() {
                break;
            }
        }
        assert_eq!((end, judge.states), (Some(Cause::TimeOut), 31));
        let (mean, max) = judge.cross_track_error();
        // 0 to 30 thirtieths, with 9 in the place of one of them.
        assert!(
            (mean - (465.0 / 30.0 - 1.0 / 30.0 + 9.0) / 31.0).abs() < 1e-12 && max == 9.0,
            "{mean} {max}"
        );
    }

    #[test]
    fn failures_end_a_scenario() {
        let departed = State { lane_departure: true, finished: true, ..state(1.0) };
        assert_eq!(judge(9.0).look(&departed), Some(Cause::LaneDeparture));
        let mut judge = judge(60.0);
        let standing = |time| State { speed: 0.0, ..state(time) };
        assert_eq!(judge.look(&standing(1.0)), None);
        assert_eq!(judge.look(&standing(5.9)), None);
        assert_eq!(judge.look(&standing(6.0)), Some(Cause::NoProgress));
    }

    #[test]
    fn a_pause_that_ends_is_not_a_standstill() {
        let mut judge = judge(60.0);
        let standing = |time| State { speed: 0.0, ..state(time) };
        judge.look(&standing(1.0));
        judge.look(&state(3.0));
        assert_eq!(judge.look(&standing(7.0)), None);
    }

    #[test]
    fn the_criteria_are_those_of_the_scenario() {
        let at = |criteria: FailureCriteria, cross_track_error: f64| {
            let state = State { cross_track_error, lane_departure: true, ..state(1.0) };
            judge_by(criteria, 60.0).look(&state)
        };
        let own = FailureCriteria { lane_departure: Some(4.0), ..FailureCriteria::default() };
        // What the simulator says does not count then.
        assert_eq!((at(own, -3.9), at(own, -4.0)), (None, Some(Cause::LaneDeparture)));
        assert_eq!(at(FailureCriteria { comparison: Comparison::MoreThan, ..own }, 4.0), None);
        assert_eq!(at(FailureCriteria::default(), 0.0), Some(Cause::LaneDeparture));
        let patient = FailureCriteria { standstill_seconds: 9.0, standstill_speed: 6.0, ..own };
        let mut judge = judge_by(patient, 60.0);
        assert_eq!(
            [0.0, 8.9, 9.0].map(|time| judge.look(&state(time))),
            [None, None, Some(Cause::NoProgress)]
        );
    }

    #[test]
    fn a_wheel_over_the_line_is_measured_and_ends_nothing() {
        let mut judge = judge(60.0);
        for (frame, cross_track_error) in [0.0, 1.0, 1.1, 1.5, 1.0, -1.2, 0.0].into_iter().enumerate() {
            assert_eq!(judge.look(&State { cross_track_error, ..state(frame as f64 * 0.5) }), None);
        }
        let measures = judge.measures().unwrap();
        assert_eq!((measures.over_line_from, measures.over_line_seconds), (Some(1.0), 1.5));
        assert!(judge_by(FailureCriteria::default(), 1.0).measures().is_none());
    }
}
