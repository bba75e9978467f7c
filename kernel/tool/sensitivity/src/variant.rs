//! A level a little lower and a little higher, by which it is differentiated.

use pdk_chain::chain::Chain;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::error::Result;

use crate::course::Course;
use crate::rehearsal::Rehearsal;

/// The course of a perturbation a step lower and a step higher, with the chains.
pub struct Variant {
    courses: [Course; 2],
    /// The chain with the lower course, and that with the higher one.
    pub chains: [Chain; 2],
}

impl Variant {
    /// The variant of the perturbation of this number, which is on this course.
    ///
    /// # Errors
    /// If a perturbation cannot be made.
    pub fn new(
        rehearsal: &Rehearsal<'_>,
        perturbations: &[AppliedPerturbation],
        number: usize,
        course: &Course,
    ) -> Result<Self> {
        let courses = course.beside();
        let chain = |course: &Course| {
            let mut changed = perturbations.to_vec();
            changed[number] = course.apply(&perturbations[number]);
            rehearsal.chain(&changed)
        };
        let chains = [chain(&courses[0])?, chain(&courses[1])?];
        Ok(Self { chains, courses })
    }

    /// How far the two levels of a frame are apart: less than two steps at the ends of the scale.
    pub fn distance(&self, frame: usize) -> f64 {
        let [low, high] = self.courses.each_ref().map(|course| course.levels()[frame]);
        high - low
    }
}
