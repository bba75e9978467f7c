//! Which of a scenario's steps its telemetry is made of: one every quarter of a second, and the last.

use pdk_record::trace::step::Step;

/// Seconds of simulation time between two samples of the telemetry.
pub const INTERVAL: f64 = 0.25;

/// Chooses samples by their times, as they come.
#[derive(Debug, Clone, Default)]
pub struct Sampler {
    next: f64,
}

impl Sampler {
    /// Whether a state at this time is a sample; `last` says that the scenario ends with it.
    pub fn takes(&mut self, time: f64, last: bool) -> bool {
        // Half a millisecond allows for times that are sums of rounded frame times.
        let due = last || time + 0.0005 >= self.next;
        if due {
            self.next += INTERVAL;
        }
        due
    }
}

/// The telemetry of a scenario with these steps.
pub fn samples(steps: &[Step]) -> Vec<Step> {
    let mut sampler = Sampler::default();
    let last = steps.len().saturating_sub(1);
    let taken = steps.iter().enumerate();
    taken.filter(|(i, step)| sampler.takes(step.state.time, *i == last)).map(|(_, step)| *step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::State;

    #[test]
    fn there_is_a_sample_every_quarter_of_a_second_and_at_the_end() {
        let step = |sequence: u64| {
            let state = State { time: sequence as f64 / 30.0, ..State::default() };
            Step { sequence, state, ..Step::default() }
        };
        let steps: Vec<Step> = (0..32).map(step).collect();
        let frames: Vec<u64> = samples(&steps).iter().map(|step| step.sequence).collect();
        assert_eq!(frames, [0, 8, 15, 23, 30, 31]);
        assert!(samples(&[]).is_empty());
    }
}
