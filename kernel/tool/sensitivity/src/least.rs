//! The smallest change of a course with which a drive leaves its lane, as far as the derivative finds it.
//!
//! The derivative says in which direction the error grows fastest. A step in that direction is driven, the derivative is taken again where it led
//! to, and so on until the drive leaves its lane; then the change is made smaller: along itself by halves, and by going to the nearest point at which
//! the error is the same by the derivative, as DeepFool does for pictures (Moosavi-Dezfooli et al., DeepFool, CVPR 2016). It is not claimed to be the
//! least of all changes: a drive may come out otherwise far from where the derivative points.

use pdk_model::outcome::Cause;
use pdk_sdk::error::{Error, Result};

use crate::course::{Course, on_courses};
use crate::rehearsal::{Driven, Rehearsal};
use crate::sweep::{Sensitivity, sweep};

/// By how many metres a step is to make the error larger, at first and at most.
const STEP: f64 = 0.2;
const LONGEST_STEP: f64 = 0.6;
/// A step shorter than this leads nowhere.
const SHORTEST_STEP: f64 = 0.02;
/// A step is taken if the error grows by this share of what the derivative says, and the next one is longer from this share on.
const ENOUGH: f64 = 0.2;
const AS_PREDICTED: f64 = 0.6;
/// How far beyond the nearest courses by the derivative it is looked, since the edge is not exactly where that says.
const BEYOND: f64 = 1.3;
/// A step that makes the error larger by less than this many metres is none.
const LEAST_GAIN: f64 = 1e-3;
/// How many steps are taken at most, and how often a change is made smaller.
const STEPS: usize = 25;
const ROUNDS: usize = 3;
/// How often a change is halved to find where the drive begins to leave its lane.
const HALVINGS: usize = 7;

/// A change of the courses of all perturbations with which the drive leaves its lane.
pub struct Change {
    /// The courses.
    pub courses: Vec<Course>,
    /// How far they are from those before, in levels: the root of the mean square over perturbations and the frames of the changed drive.
    pub size: f64,
}

/// What was found.
pub struct Found {
    /// The smallest change by the derivative; none if no step led out of the lane.
    pub change: Option<Change>,
    /// The smallest uniform increase of all levels with which the drive leaves its lane; none if it stays in it at each quarter of a level that was tried.
    pub uniform: Option<f64>,
    /// How many drives it took.
    pub drives: usize,
    /// How many times the derivative was taken.
    pub sweeps: usize,
}

/// Checks that there is a change to search for.
///
/// # Errors
/// If the drive did not stay in its lane to the end.
pub fn check_stayed(driven: &Driven) -> Result<()> {
    match driven.cause {
        Cause::Finished | Cause::TimeOut => Ok(()),
        cause => Err(Error::new(format!(
            "it ended with {}, but --least is for drives that stay in their lane to the end; name one at a lower level, or leave --least out",
            cause.text()
        ))),
    }
}

/// Searches for the smallest change of a drive for which [`check_stayed`] holds.
///
/// # Errors
/// If a component fails.
pub fn least(
    rehearsal: &mut Rehearsal<'_>,
    driven: &Driven,
    sensitivity: &Sensitivity,
    frame_done: &mut dyn FnMut(),
) -> Result<Found> {
    let original = sensitivity.courses.clone();
    let mut search = Search { rehearsal, original, drives: 0, sweeps: 0, frame_done };
    let change = search.leave(driven, sensitivity)?;
    let change = change.map(|(left, stayed)| search.shrink(left, &stayed)).transpose()?;
    let uniform = search.uniform()?;
    Ok(Found { change, uniform, drives: search.drives, sweeps: search.sweeps })
}

struct Search<'a, 'b> {
    rehearsal: &'a mut Rehearsal<'b>,
    original: Vec<Course>,
    drives: usize,
    sweeps: usize,
    frame_done: &'a mut dyn FnMut(),
}

impl Search<'_, '_> {
    fn drive(&mut self, courses: &[Course]) -> Result<Driven> {
        self.drives += 1;
        let applied = on_courses(&self.rehearsal.scenario().perturbations, courses);
        let mut chain = self.rehearsal.chain(&applied)?;
        self.rehearsal.drive(&mut chain, self.frame_done)
    }

    fn leaves(&mut self, courses: &[Course]) -> Result<bool> {
        Ok(left(&self.drive(courses)?))
    }

    fn sweep(&mut self, courses: &[Course], driven: &Driven) -> Result<Sensitivity> {
        self.sweeps += 1;
        sweep(self.rehearsal, courses, driven, self.frame_done)
    }

    /// How far courses are from the original ones over this many frames, as the root of the mean square.
    fn size(&self, courses: &[Course], frames: usize) -> f64 {
        let squares = |(course, original): (&Course, &Course)| -> f64 {
            let levels = course.levels().iter().zip(original.levels()).take(frames);
            levels.map(|(a, b)| (a - b) * (a - b)).sum()
        };
        let count = courses.len() * frames.max(1);
        (courses.iter().zip(&self.original).map(squares).sum::<f64>() / count as f64).sqrt()
    }

    /// Steps until the drive leaves its lane; the courses with which it does, and those one step before.
    fn leave(
        &mut self,
        driven: &Driven,
        sensitivity: &Sensitivity,
    ) -> Result<Option<(Vec<Course>, Vec<Course>)>> {
        let mut at = self.original.clone();
        let (mut found, mut error) = (sensitivity.clone(), driven.worst().1);
        let mut step = STEP;
        for _ in 0..STEPS {
            let Some(next) = stepped(&at, &found.influence, step) else { return Ok(None) };
            let driven = self.drive(&next)?;
            if left(&driven) {
                return Ok(Some((next, at)));
            }
            let gained = driven.worst().1 - error;
            if gained > ENOUGH * step {
                error += gained;
                found = self.sweep(&next, &driven)?;
                at = next;
                step = if gained > AS_PREDICTED * step { (1.5 * step).min(LONGEST_STEP) } else { step };
            } else {
                step /= 2.0;
                if step < SHORTEST_STEP {
                    return Ok(None);
                }
            }
        }
        Ok(None)
    }

    /// Makes a change smaller.
    fn shrink(&mut self, left_with: Vec<Course>, stayed_with: &[Course]) -> Result<Change> {
        let (original, all) = (self.original.clone(), self.rehearsal.frames());
        let mut best = self.between(stayed_with, &left_with)?;
        best = self.between(&original, &best)?;
        for _ in 0..ROUNDS {
            // Where the drive stays in its lane, so that there is a largest error.
            let near = towards(&original, &best, 1.0 - 2.0 / f64::from(1 << HALVINGS));
            let driven = self.drive(&near)?;
            if left(&driven) {
                best = self.between(&original, &near)?;
                continue;
            }
            let found = self.sweep(&near, &driven)?;
            let Some(nearest) = nearest(&original, &best, &found.influence) else { break };
            let beyond = towards(&original, &nearest, BEYOND);
            if self.size(&beyond, all) >= BEYOND * self.size(&best, all) || !self.leaves(&beyond)? {
                break;
            }
            let smaller = self.between(&original, &beyond)?;
            if self.size(&smaller, all) >= 0.99 * self.size(&best, all) {
                break;
            }
            best = smaller;
        }
        let frames = self.drive(&best)?.places.len();
        Ok(Change { size: self.size(&best, frames), courses: best })
    }

    /// Between courses with which the drive stays in its lane and others with which it leaves it, those nearest to the former with which it leaves.
    fn between(&mut self, stays: &[Course], leaves: &[Course]) -> Result<Vec<Course>> {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = (low + high) / 2.0;
            match self.leaves(&towards(stays, leaves, middle))? {
                true => high = middle,
                false => low = middle,
            }
        }
        Ok(towards(stays, leaves, high))
    }

    /// The smallest uniform increase: the first quarter of a level with which the drive leaves its lane, and from there to a hundredth.
    fn uniform(&mut self) -> Result<Option<f64>> {
        const QUARTER: f64 = 0.25;
        let original = self.original.clone();
        let room = original.iter().map(Course::room).fold(0.0, f64::max);
        let mut leaves = |by: f64| {
            let raised: Vec<Course> = original.iter().map(|course| course.shifted(|_| by)).collect();
            self.leaves(&raised)
        };
        let quarters = (room / QUARTER).ceil() as u32;
        for quarter in 1..=quarters {
            let mut high = QUARTER * f64::from(quarter);
            if !leaves(high)? {
                continue;
            }
            let mut low = high - QUARTER;
            while high - low > 0.01 {
                let middle = (low + high) / 2.0;
                match leaves(middle)? {
                    true => high = middle,
                    false => low = middle,
                }
            }
            return Ok(Some(high));
        }
        Ok(None)
    }
}

/// Whether a drive left its lane.
fn left(driven: &Driven) -> bool {
    driven.cause == Cause::LaneDeparture
}

fn towards(from: &[Course], to: &[Course], share: f64) -> Vec<Course> {
    from.iter().zip(to).map(|(from, to)| from.towards(to, share)).collect()
}

/// The courses changed in the direction of the influence so far that the error changes by this much by the derivative; none if the levels are
/// at their ends wherever the influence points.
fn stepped(courses: &[Course], influence: &[Vec<f64>], metres: f64) -> Option<Vec<Course>> {
    let at = |length: f64| -> (Vec<Course>, f64) {
        let (mut changed, mut gained) = (Vec::with_capacity(courses.len()), 0.0);
        for (course, influence) in courses.iter().zip(influence) {
            let by = |frame: usize| influence.get(frame).map_or(0.0, |influence| length * influence);
            let moved = course.shifted(by);
            let levels = moved.levels().iter().zip(course.levels());
            gained += levels.zip(influence).map(|((new, old), by)| (new - old) * by).sum::<f64>();
            changed.push(moved);
        }
        (changed, gained)
    };
    let squares: f64 = influence.iter().flatten().map(|by| by * by).sum();
    if squares == 0.0 {
        return None;
    }
    // More than it takes without ends of levels, until it is enough or the ends leave nothing.
    let (mut short, mut length) = (0.0, metres / squares);
    let mut gained = at(length).1.abs();
    while gained < metres.abs() {
        (short, length) = (length, 1.5 * length);
        let more = at(length).1.abs();
        if more <= 1.001 * gained {
            break;
        }
        gained = more;
    }
    // And no more than that.
    for _ in 0..20 {
        let middle = (short + length) / 2.0;
        match at(middle).1.abs() < metres.abs() {
            true => short = middle,
            false => length = middle,
        }
    }
    let (changed, gained) = at(length);
    (gained.abs() > LEAST_GAIN).then_some(changed)
}

/// The nearest courses to the original ones at which the error is by the derivative what it is at `left_with`.
fn nearest(original: &[Course], left_with: &[Course], influence: &[Vec<f64>]) -> Option<Vec<Course>> {
    let metres: f64 = original
        .iter()
        .zip(left_with)
        .zip(influence)
        .map(|((from, to), influence)| {
            let levels = to.levels().iter().zip(from.levels());
            levels.zip(influence).map(|((to, from), by)| (to - from) * by).sum::<f64>()
        })
        .sum();
    stepped(original, influence, metres)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_model::perturbation::AppliedPerturbation;

    fn courses(level: f64) -> Vec<Course> {
        vec![Course::of(&AppliedPerturbation::new("x", level), 4, 20.0).unwrap()]
    }

    /// What a change comes to by the derivative.
    fn gained(from: &[Course], to: &[Course], influence: &[f64]) -> f64 {
        to[0]
            .levels()
            .iter()
            .zip(from[0].levels())
            .zip(influence)
            .map(|((to, from), by)| (to - from) * by)
            .sum()
    }

    #[test]
    fn a_step_is_as_long_as_the_derivative_says_and_along_it() {
        let (from, influence) = (courses(2.0), vec![vec![0.1, 0.0, -0.2, 0.0]]);
        let to = stepped(&from, &influence, 0.1).unwrap();
        assert!((gained(&from, &to, &influence[0]) - 0.1).abs() < 1e-6);
        let by: Vec<f64> = to[0].levels().iter().map(|level| level - 2.0).collect();
        assert!((by[2] + 2.0 * by[0]).abs() < 1e-6 && by[1] == 0.0 && by[3] == 0.0, "{by:?}");
    }

    #[test]
    fn where_levels_are_at_their_ends_others_take_over() {
        let from: Vec<Course> = vec![courses(2.0)[0].shifted(|frame| if frame == 0 { 1.9 } else { 0.0 })];
        let influence = vec![vec![0.3, 0.1, 0.1, 0.0]];
        let to = stepped(&from, &influence, 0.3).unwrap();
        assert_eq!(to[0].levels()[0], 4.0);
        assert!((gained(&from, &to, &influence[0]) - 0.3).abs() < 1e-6);
        // And nothing is left once all of them are.
        assert!(stepped(&courses(4.0), &influence, 0.3).is_none());
        assert!(stepped(&courses(2.0), &[vec![0.0; 4]], 0.3).is_none());
    }

    #[test]
    fn the_nearest_courses_have_the_same_effect() {
        let (from, influence) = (courses(1.0), vec![vec![0.1, 0.2, 0.0, 0.0]]);
        let detour = vec![from[0].shifted(|frame| [0.0, 0.5, 0.7, 0.2][frame])];
        let nearest = nearest(&from, &detour, &influence).unwrap();
        let away = |courses: &[Course]| -> f64 {
            courses[0].levels().iter().map(|level| (level - 1.0) * (level - 1.0)).sum()
        };
        assert!((gained(&from, &nearest, &influence[0]) - 0.1).abs() < 1e-6);
        assert!(away(&nearest) < away(&detour));
    }
}
