//! Gusts of wind from the side, which turn the vehicle.
//!
//! How fast a crosswind turns a vehicle that is not steered against it is what its sensitivity is measured by (ISO 12021). A gust rises and falls as
//! one minus a cosine, the shape in which aircraft are tested against gusts (EASA CS-25.341).

use std::f64::consts::PI;

use pdk_sdk::prelude::{Key, Random};

/// Seconds without wind between two gusts.
const CALM: [f64; 2] = [1.0, 5.0];
/// How long a gust lasts, in seconds.
const LENGTH: [f64; 2] = [1.0, 3.0];
/// How strong a gust is, as a share of the strongest.
const STRENGTH: [f64; 2] = [0.5, 1.0];
/// The speed in metres per second from which on a vehicle turns as fast as it can; a slower one turns more slowly.
const FULL_SPEED: f64 = 10.0;

/// The gusts of a drive.
pub struct Gusts {
    /// The fastest turn in radians per second; 0 for no wind.
    strongest: f64,
    random: Random,
    /// The one under way, or the next one.
    gust: Gust,
}

#[derive(Default)]
struct Gust {
    begins: f64,
    ends: f64,
    /// The fastest turn, positive to the right.
    peak: f64,
}

impl Gusts {
    /// Gusts of which the strongest turn a vehicle at this many radians per second.
    pub fn new(strongest: f64, key: &Key) -> Self {
        Self { strongest, random: key.sequence(), gust: Gust::default() }
    }

    /// How fast the wind turns a vehicle of a speed at a time in seconds, in radians per second, positive to the right. Times do not go back.
    pub fn turn(&mut self, time: f64, speed: f64) -> f64 {
        if self.strongest == 0.0 {
            return 0.0;
        }
        while self.gust.ends <= time {
            let calm = self.random.uniform(CALM[0], CALM[1]);
            let begins = self.gust.ends + calm;
            let ends = begins + self.random.uniform(LENGTH[0], LENGTH[1]);
            let side = if self.random.unit() < 0.5 { -1.0 } else { 1.0 };
            let peak = side * self.random.uniform(STRENGTH[0], STRENGTH[1]) * self.strongest;
            self.gust = Gust { begins, ends, peak };
        }
        let Gust { begins, ends, peak } = self.gust;
        if time < begins {
            return 0.0;
        }
        let shape = (1.0 - libm::cos(2.0 * PI * ((time - begins) / (ends - begins)))) / 2.0;
        peak * shape * (speed / FULL_SPEED).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course(strongest: f64, key: u8) -> Vec<f64> {
        let mut gusts = Gusts::new(strongest, &Key([key; 32]));
        (0..4000).map(|step| gusts.turn(f64::from(step) * 0.05, 12.0)).collect()
    }

    #[test]
    fn gusts_come_and_go_to_both_sides_and_none_is_stronger_than_the_strongest() {
        let course = course(0.2, 1);
        assert!(course.iter().all(|turn| turn.abs() <= 0.2));
        assert!(course.iter().any(|turn| *turn > 0.12) && course.iter().any(|turn| *turn < -0.12));
        let calm = course.iter().filter(|turn| **turn == 0.0).count() as f64 / 4000.0;
        assert!((0.4..0.8).contains(&calm), "{calm}");
        // They rise and fall without a jump.
        assert!(course.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 0.035));
        assert_eq!(course[0], 0.0);
    }

    #[test]
    fn they_follow_from_the_key_alone_and_slow_vehicles_turn_less() {
        assert_eq!(course(0.2, 1), course(0.2, 1));
        assert_ne!(course(0.2, 1), course(0.2, 2));
        // Twice as strong is the same wind.
        assert!(course(0.2, 1).iter().zip(course(0.4, 1)).all(|(a, b)| (2.0 * a - b).abs() < 1e-12));
        assert!(course(0.0, 1).iter().all(|turn| *turn == 0.0));
        let at = |speed: f64| {
            let mut gusts = Gusts::new(0.2, &Key([1; 32]));
            (0..200).map(|step| gusts.turn(f64::from(step) * 0.05, speed).abs()).fold(0.0, f64::max)
        };
        assert!((at(5.0) - at(10.0) / 2.0).abs() < 1e-12 && at(10.0) == at(30.0) && at(0.0) == 0.0);
    }
}
