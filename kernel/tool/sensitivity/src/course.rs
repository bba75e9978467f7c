//! The level of every frame, and courses beside it.

use pdk_model::level::{FrameLevels, Level, MAX_INTENSITY};
use pdk_model::level_scale::LevelScale;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::error::{Error, Result};

/// By how much levels are changed to see what follows. Less drowns in the rounding of frames to 8 bits.
pub const STEP: f64 = 0.25;

/// The levels of a perturbation at the frames of a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    rate: f64,
    /// The lowest and the highest level that the perturbation reaches.
    reach: (f64, f64),
    levels: Vec<f64>,
}

impl Course {
    /// The course of a perturbation over this many frames at this many frames a second.
    ///
    /// # Errors
    /// If some frames are left as they are, which is not a level that could be changed a little.
    pub fn of(applied: &AppliedPerturbation, frames: usize, rate: f64) -> Result<Self> {
        let level = |frame: usize| {
            applied.level.at(frame as f64 / rate).ok_or_else(|| {
                Error::new(format!(
                    "{} leaves frames as they are between its pulses, so it has no level there; give the pulse a `rest`",
                    applied.name
                ))
            })
        };
        Ok(Self { rate, reach: reach(applied), levels: (0..frames).map(level).collect::<Result<_>>()? })
    }

    /// The level of each frame.
    pub fn levels(&self) -> &[f64] {
        &self.levels
    }

    /// How much higher its lowest level can be.
    pub fn room(&self) -> f64 {
        self.levels.iter().map(|level| self.reach.1 - level).fold(0.0, f64::max)
    }

    /// The course with this much more at each frame, between the lowest and the highest level that the perturbation reaches.
    pub fn shifted(&self, by: impl Fn(usize) -> f64) -> Self {
        let (low, high) = self.reach;
        let shift = |(frame, level): (usize, &f64)| (level + by(frame)).clamp(low, high);
        Self { levels: self.levels.iter().enumerate().map(shift).collect(), ..*self }
    }

    /// The course this share of the way to another one.
    pub fn towards(&self, other: &Self, share: f64) -> Self {
        self.shifted(|frame| share * (other.levels[frame] - self.levels[frame]))
    }

    /// The course a [`STEP`] lower and a [`STEP`] higher, as far as there are levels.
    pub fn beside(&self) -> [Self; 2] {
        [-STEP, STEP].map(|by| self.shifted(|_| by))
    }

    /// The perturbation on this course.
    pub fn apply(&self, applied: &AppliedPerturbation) -> AppliedPerturbation {
        let frames = FrameLevels { rate: self.rate, levels: self.levels.clone() };
        AppliedPerturbation { level: Level::Frames { frames }, ..applied.clone() }
    }
}

/// The lowest and the highest level that a perturbation reaches, which on a measured scale may be less than the published ones.
fn reach(applied: &AppliedPerturbation) -> (f64, f64) {
    let measured = match &applied.level_scale {
        Some(LevelScale::Measured(measured)) => measured.reach(),
        _ => None,
    };
    measured.unwrap_or((0.0, MAX_INTENSITY))
}

/// The perturbations of a scenario on these courses.
pub fn on_courses(perturbations: &[AppliedPerturbation], courses: &[Course]) -> Vec<AppliedPerturbation> {
    courses.iter().zip(perturbations).map(|(course, applied)| course.apply(applied)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_model::level::Pulse;
    use pdk_model::level_scale::MeasuredScale;

    #[test]
    fn courses_stay_within_the_levels() {
        let course = Course::of(&AppliedPerturbation::new("x", 3.5), 3, 20.0).unwrap();
        assert_eq!(course.shifted(|frame| frame as f64).levels(), [3.5, 4.0, 4.0]);
        assert_eq!(course.shifted(|_| -9.0).levels(), [0.0; 3]);
        let other = course.shifted(|frame| -(frame as f64));
        assert_eq!(course.towards(&other, 0.5).levels(), [3.5, 3.0, 2.5]);
        let applied = course.apply(&AppliedPerturbation::new("x", 1.0));
        assert_eq!([0.0, 0.1, 9.0].map(|time| applied.level.at(time)), [Some(3.5); 3]);
    }

    #[test]
    fn courses_on_a_measured_scale_stay_within_its_reach() {
        let points = vec![[0.5, 0.0], [3.25, 8.0]];
        let scale = MeasuredScale { name: "own".to_owned(), version: 1, points };
        let applied = AppliedPerturbation {
            level_scale: Some(LevelScale::Measured(scale.clone())),
            ..AppliedPerturbation::new("x", 3.0)
        };
        let course = Course::of(&applied, 2, 20.0).unwrap();
        assert_eq!((course.room(), course.shifted(|_| 9.0).room()), (0.25, 0.0));
        for changed in [course.shifted(|_| -9.0)].into_iter().chain(course.beside()) {
            scale.check(&changed.apply(&applied).level).unwrap();
        }
        assert_eq!(course.shifted(|frame| 9.0 * frame as f64 - 4.0).levels(), [0.5, 3.25]);
    }

    #[test]
    fn a_pulse_without_rest_has_no_level_in_between() {
        let pulse = Pulse { level: 2.0, rest: None, period: 1.0, duration: 0.5, start: 0.0 };
        let mut applied = AppliedPerturbation::new("fog", 1.0);
        applied.level = Level::Pulse { pulse: pulse.clone() };
        assert!(Course::of(&applied, 30, 20.0).unwrap_err().to_string().contains("`rest`"));
        applied.level = Level::Pulse { pulse: Pulse { rest: Some(0.5), ..pulse } };
        assert_eq!(Course::of(&applied, 20, 20.0).unwrap().levels()[9..11], [2.0, 0.5]);
    }
}
