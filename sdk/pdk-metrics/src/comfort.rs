//! How comfortable a drive is: lateral acceleration and jerk.

use std::f64::consts::PI;

use pdk_model::state::State;

/// Two states that are closer in time than this, in seconds, say nothing about how the speed changes: a simulator may repeat a state,
/// and quotients of tiny times are larger than any vehicle's acceleration.
const CLOSEST: f64 = 1e-4;

/// Measures both from one state to the next.
#[derive(Debug, Clone, Default)]
pub struct Comfort {
    before: Option<State>,
    /// The acceleration along and across, in m/s², and its time.
    acceleration: Option<[f64; 3]>,
    /// In m/s².
    pub lateral_acceleration: Size,
    /// In m/s³.
    pub jerk: Size,
}

impl Comfort {
    /// Notes the next state.
    pub fn look(&mut self, state: &State) {
        if let Some(before) = self.before.replace(*state) {
            let seconds = state.time - before.time;
            if seconds < CLOSEST {
                return;
            }
            let along = (state.speed - before.speed) / seconds;
            let yaw_rate = turned(before.heading, state.heading) / seconds;
            let across = 0.5 * (state.speed + before.speed) * yaw_rate;
            self.lateral_acceleration.add(across.abs(), seconds);
            let time = 0.5 * (state.time + before.time);
            if let Some([along_before, across_before, time_before]) =
                self.acceleration.replace([along, across, time])
            {
                let between = time - time_before;
                let [x, y] = [(along - along_before) / between, (across - across_before) / between];
                self.jerk.add((x * x + y * y).sqrt(), seconds);
            }
        }
    }
}

/// The angle from one heading to another, the short way round.
fn turned(from: f64, to: f64) -> f64 {
    let angle = (to - from) % (2.0 * PI);
    match angle {
        _ if angle > PI => angle - 2.0 * PI,
        _ if angle < -PI => angle + 2.0 * PI,
        _ => angle,
    }
}

/// The size of a quantity over time.
#[derive(Debug, Clone, Default)]
pub struct Size {
    squares: f64,
    seconds: f64,
    max: f64,
}

impl Size {
    fn add(&mut self, size: f64, seconds: f64) {
        self.squares += size * size * seconds;
        self.seconds += seconds;
        self.max = self.max.max(size);
    }

    /// Its root mean square; 0 if nothing was measured.
    pub fn rms(&self) -> f64 {
        if self.seconds > 0.0 { (self.squares / self.seconds).sqrt() } else { 0.0 }
    }

    /// The largest.
    pub fn max(&self) -> f64 {
        self.max
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(states: impl Iterator<Item = (f64, f64, f64)>) -> Comfort {
        let mut comfort = Comfort::default();
        for (time, speed, heading) in states {
            comfort.look(&State { time, speed, heading, ..State::default() });
        }
        comfort
    }

    #[test]
    fn a_steady_bend_has_the_acceleration_of_a_circle_and_no_jerk() {
        // 10 m/s on a radius of 50 m: 2 m/s²; the heading wraps round.
        let comfort = of((0..400).map(|i| {
            let time = f64::from(i) / 20.0;
            (time, 10.0, (3.0 + 0.2 * time) % (2.0 * PI) - PI)
        }));
        assert!((comfort.lateral_acceleration.rms() - 2.0).abs() < 1e-9, "{comfort:?}");
        assert!((comfort.lateral_acceleration.max() - 2.0).abs() < 1e-9);
        assert!(comfort.jerk.max() < 1e-6, "{comfort:?}");
    }

    #[test]
    fn a_brake_that_is_stepped_on_jerks() {
        // Straight on, and from 1 s a deceleration that grows by 3 m/s² each second.
        let comfort = of((0..40).map(|i| {
            let time = f64::from(i) / 20.0;
            let braked = (time - 1.0).max(0.0);
            (time, 20.0 - 1.5 * braked * braked, 0.0)
        }));
        assert_eq!(comfort.lateral_acceleration.max(), 0.0);
        assert!((comfort.jerk.max() - 3.0).abs() < 1e-6, "{comfort:?}");
        assert!(comfort.jerk.rms() > 1.9 && comfort.jerk.rms() < 2.3, "{comfort:?}");
    }

    #[test]
    fn the_wildest_states_that_are_allowed_give_finite_numbers() {
        let comfort = of((0..100_000).map(|i| {
            let sign = |halves: i32| if i / halves % 2 == 0 { 1.0 } else { -1.0 };
            (f64::from(i) * CLOSEST, sign(2) * 1000.0, sign(1) * 1e6)
        }));
        let numbers = [comfort.jerk, comfort.lateral_acceleration].map(|size| [size.rms(), size.max()]);
        assert!(numbers.iter().flatten().all(|number| number.is_finite() && *number > 0.0), "{numbers:?}");
    }

    #[test]
    fn states_without_time_between_them_say_nothing() {
        let comfort = of([(0.0, 5.0, 0.0), (0.0, 9.0, 1.0)].into_iter());
        assert_eq!((comfort.jerk.rms(), comfort.lateral_acceleration.rms()), (0.0, 0.0));
    }
}
