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
        let steps = self.0.steps();
        self.0.rows(outputs[0].single_mut()?, |into, [at, yes_at, no_at]| {
            let (condition, yes, no) = (&condition[at..], &yes[yes_at..], &no[no_at..]);
            match steps {
                [1, 1, 1] => {
                    for (into, (holds, (yes, no))) in
                        into.iter_mut().zip(condition.iter().zip(yes.iter().zip(no)))
                    {
                        *into = choose(*holds, *yes, *no);
                    }
                }
                [1, 1, 0] => {
                    for (into, (holds, yes)) in into.iter_mut().zip(condition.iter().zip(yes)) {
                        *into = choose(*holds, *yes, no[0]);
                    }
                }
                [1, 0, 1] => {
                    for (into, (holds, no)) in into.iter_mut().zip(condition.iter().zip(no)) {
                        *into = choose(*holds, yes[0], *no);
                    }
                }
                [of_condition, of_yes, of_no] => {
                    for (at, into) in into.iter_mut().enumerate() {
                        *into = choose(condition[at * of_condition], yes[at * of_yes], no[at * of_no]);
                    }
                }
            }
        });
        Ok(())
    }
}

/// The one if the condition holds, else the other.
#[inline(always)]
fn choose(condition: f32, yes: f32, no: f32) -> f32 {
    if condition != 0.0 { yes } else { no }
}
