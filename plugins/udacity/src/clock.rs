//! The time of a drive in a simulator that does not tell its own.
//!
//! It is this machine's time, without what passes while the simulator stands still: a simulator that sends nothing for seconds has not driven
//! for seconds, and its driver is not late.

use std::time::Instant;

/// A simulator's world moves on by at most this many seconds from one frame to the next, however long that took: Unity's maximum time step.
const STEP: f64 = 1.0 / 3.0;

/// The time since the start of a scenario.
#[derive(Debug)]
pub struct Clock {
    time: f64,
    /// Until when the time has been looked at.
    until: Instant,
    /// What has passed until then and is not driving time yet.
    owed: f64,
    /// The most that counts from one telemetry to the next.
    step: f64,
}

impl Clock {
    /// A scenario begins, in which `rate` telemetries a second are expected.
    pub fn new(rate: f64, now: Instant) -> Self {
        Self { time: 0.0, until: now, owed: 0.0, step: STEP.max(1.5 / rate) }
    }

    /// Telemetry has come: the time that it shows. If several have come since the last look, each makes up for a part of what has passed.
    pub fn heard(&mut self, now: Instant) -> f64 {
        self.owed += self.pass(now);
        let step = self.owed.min(self.step);
        self.owed -= step;
        self.time += step;
        self.time
    }

    /// All that has come has been heard: what has passed besides, the simulator stood still.
    pub fn caught_up(&mut self) {
        self.owed = 0.0;
    }

    /// A simulator that answers commands is sent one: until now it drove on under the last one.
    pub fn asked(&mut self, now: Instant) {
        self.time += self.pass(now);
    }

    fn pass(&mut self, now: Instant) -> f64 {
        let passed = now.saturating_duration_since(self.until).as_secs_f64();
        self.until = now;
        passed
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn is(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }

    #[test]
    fn a_gap_is_not_driving_time() {
        let start = Instant::now();
        let at = |seconds: f64| start + Duration::from_secs_f64(seconds);
        let mut clock = Clock::new(20.0, start);
        is(clock.heard(at(0.05)), 0.05);
        clock.caught_up();
        // Frozen for three seconds.
        is(clock.heard(at(3.05)), 0.05 + STEP);
        clock.caught_up();
        is(clock.heard(at(3.1)), 0.1 + STEP);
    }

    #[test]
    fn a_driver_that_takes_long_is_late() {
        let start = Instant::now();
        let at = |seconds: f64| start + Duration::from_secs_f64(seconds);
        let mut clock = Clock::new(20.0, start);
        // Forty telemetries have come meanwhile.
        let time = (0..40).map(|_| clock.heard(at(2.0))).last().unwrap();
        is(time, 2.0);
        // One that answers commands sends nothing by itself.
        let mut clock = Clock::new(20.0, start);
        clock.asked(at(2.0));
        is(clock.heard(at(2.01)), 2.01);
    }

    #[test]
    fn a_slow_rate_is_not_a_gap() {
        let start = Instant::now();
        let mut clock = Clock::new(1.0, start);
        is(clock.heard(start + Duration::from_secs(1)), 1.0);
    }
}
