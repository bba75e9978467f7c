//! The least change of a course with which a drive leaves its lane.
//!
//! The derivative says in which direction the error grows fastest. A step in that direction is driven, the derivative is taken again where it led
//! to, and so on until the drive leaves its lane; then the change is made smaller: along itself by halves, and by going to the nearest point at which
//! the error is the same by the derivative, as DeepFool does for pictures (Moosavi-Dezfooli et al., DeepFool, CVPR 2016). It is not claimed to be the
//! least of all changes: a drive may come out otherwise far from where the derivative points.

use pdk_model::level::MAX_INTENSITY;
use pdk_model::outcome::Cause;
use pdk_sdk::error::{Error, Result};

use crate::course::Course;
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
/// How many steps are taken at most, and how often a change is made smaller.
const STEPS: usize = 25;
const ROUNDS: usize = 3;
/// How often a change is halved to find where the drive begins to leave its lane.
const HALVINGS: usize = 7;

/// A change of the courses of all perturbations, and the drive with it.
#[derive(Clone)]
pub struct Change {
    /// The courses.
    pub courses: Vec<Course>,
    /// How far they are from those before, as the root of the mean square over frames and perturbations, in levels.
    pub size: f64,
}

/// What was found.
pub struct Found {
    /// The least change by the derivative; none if no step led anywhere.
    pub change: Option<Change>,
    /// How much higher the levels have to be if all are raised alike; none if the drive stays in its lane even at the highest.
    pub alike: Option<f64>,
    /// How many drives it took, without those for `alike`.
    pub drives: usize,
    /// How many times the derivative was taken.
    pub sweeps: usize,
}

/// Searches for the least change.
///
/// # Errors
/// If the drive did not stay in its lane to the end, or a component fails.
pub fn least(
    rehearsal: &mut Rehearsal<'_>,
    driven: &Driven,
    sensitivity: &Sensitivity,
    frame_done: &mut dyn FnMut(),
) -> Result<Found> {
    if !matches!(driven.cause, Cause::Finished | Cause::TimeOut) {
        return Err(Error::new(format!(
            "it ended with {}, and the least change is searched for drives that stay in their lane to the end; name one at a lower level",
            driven.cause.text()
        )));
    }
    let original = sensitivity.courses.clone();
    let mut search = Search { rehearsal, original, drives: 0, sweeps: 0, frame_done };
    let change = search.leave(driven, sensitivity)?;
    let change = change.map(|(left, stayed)| search.shrink(left, &stayed)).transpose()?;
    let (drives, sweeps) = (search.drives, search.sweeps);
    let alike = search.alike()?;
    Ok(Found { change, alike, drives, sweeps })
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
        let applied = self.rehearsal.scenario().perturbations.clone();
        let applied: Vec<_> =
            courses.iter().zip(&applied).map(|(course, applied)| course.apply(applied)).collect();
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

    fn size(&self, courses: &[Course]) -> f64 {
        let squares = |(course, original): (&Course, &Course)| -> f64 {
            course.levels().iter().zip(original.levels()).map(|(a, b)| (a - b) * (a - b)).sum()
        };
        let count: usize = courses.iter().map(|course| course.levels().len()).sum();
        (courses.iter().zip(&self.original).map(squares).sum::<f64>() / count.max(1) as f64).sqrt()
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
        let original = self.original.clone();
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
            if self.size(&beyond) >= BEYOND * self.size(&best) || !self.leaves(&beyond)? {
                break;
            }
            let smaller = self.between(&original, &beyond)?;
            if self.size(&smaller) >= 0.99 * self.size(&best) {
                break;
            }
            best = smaller;
        }
        Ok(Change { size: self.size(&best), courses: best })
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

    /// How much higher the levels have to be if all are raised alike, to a hundredth of a level.
    fn alike(&mut self) -> Result<Option<f64>> {
        let mut leaves = |by: f64| {
            let raised: Vec<Course> = self.original.iter().map(|course| course.shifted(|_| by)).collect();
            self.leaves(&raised)
        };
        let (mut low, mut high) = (0.0, MAX_INTENSITY);
        if !leaves(high)? {
            return Ok(None);
        }
        while high - low > 0.01 {
            let middle = (low + high) / 2.0;
            match leaves(middle)? {
                true => high = middle,
                false => low = middle,
            }
        }
        Ok(Some(high))
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
    // More than it takes without ends of levels, until the ends leave nothing.
    let mut length = metres / squares;
    let mut best = at(length);
    let mut last = 0.0;
    while best.1.abs() < 0.99 * metres.abs() && best.1.abs() > 1.01 * last {
        last = best.1.abs();
        length *= 1.5;
        best = at(length);
    }
    (best.1.abs() > 1e-3).then_some(best.0)
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
        assert!((gained(&from, &to, &influence[0]) - 0.1).abs() < 1e-9);
        let by: Vec<f64> = to[0].levels().iter().map(|level| level - 2.0).collect();
        assert!((by[2] + 2.0 * by[0]).abs() < 1e-9 && by[1] == 0.0 && by[3] == 0.0, "{by:?}");
    }

    #[test]
    fn where_levels_are_at_their_ends_others_take_over() {
        let from: Vec<Course> = vec![courses(2.0)[0].shifted(|frame| if frame == 0 { 1.9 } else { 0.0 })];
        let influence = vec![vec![0.3, 0.1, 0.1, 0.0]];
        let to = stepped(&from, &influence, 0.3).unwrap();
        assert_eq!(to[0].levels()[0], 4.0);
        assert!(gained(&from, &to, &influence[0]) > 0.99 * 0.3);
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
        assert!((gained(&from, &nearest, &influence[0]) - 0.1).abs() < 1e-9);
        assert!(away(&nearest) < away(&detour));
    }
}
