//! `Where` with a condition that is computed.

use pdk_sdk::error::Result;

use super::broadcast::Broadcast;
use super::buffer::{Buffer, Operation, single};
use crate::site::Site;

/// A choice between two operands, element by element.
pub struct Choice(Broadcast<3>);

impl Choice {
    /// The choice of a node.
    ///
    /// # Errors
    /// If the shapes do not go together.
    pub fn new(site: &Site<'_>) -> Result<Self> {
        Ok(Self(Broadcast::new([site.shape(0)?, site.shape(1)?, site.shape(2)?])?))
    }
}

impl Operation for Choice {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let [condition, yes, no] = [single(inputs, 0)?, single(inputs, 1)?, single(inputs, 2)?];
        let [of_condition, of_yes, of_no] = self.0.steps();
        self.0.rows(outputs[0].single_mut()?, |into, [from, yes_from, no_from]| {
            let length = into.len();
            // As many as there are in a row, so that no place in it is checked again.
            let row = |of: &'_ [f32], from: usize, step: usize| {
                from..from + if step == 1 { length } else { of.len() - from }
            };
            let condition = &condition[row(condition, from, of_condition)];
            let yes = &yes[row(yes, yes_from, of_yes)];
            let no = &no[row(no, no_from, of_no)];
            match (of_condition, of_yes, of_no) {
                (1, 1, 1) => choose(into, condition, |at| yes[at], |at| no[at]),
                (1, 1, 0) => choose(into, condition, |at| yes[at], |_| no[0]),
                (1, 0, 1) => choose(into, condition, |_| yes[0], |at| no[at]),
                (1, 0, 0) => choose(into, condition, |_| yes[0], |_| no[0]),
                _ => {
                    for (at, into) in into.iter_mut().enumerate() {
                        let holds = condition[at * of_condition] != 0.0;
                        *into = if holds { yes[at * of_yes] } else { no[at * of_no] };
                    }
                }
            }
        });
        Ok(())
    }
}

/// Chooses for each element of a row.
#[inline(always)]
fn choose(into: &mut [f32], condition: &[f32], yes: impl Fn(usize) -> f32, no: impl Fn(usize) -> f32) {
    for (at, (into, condition)) in into.iter_mut().zip(condition).enumerate() {
        let [yes, no] = [yes(at), no(at)];
        *into = if *condition != 0.0 { yes } else { no };
    }
}
