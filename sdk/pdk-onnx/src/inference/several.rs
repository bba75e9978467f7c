//! `Sum`, `Mean`, `Max` and `Min` of any number of operands, whose shapes are broadcast, in 64-bit floats.

use pdk_sdk::error::Result;

use super::broadcast::Broadcast;
use super::buffer::{Buffer, Operation, single};
use crate::order::further;
use crate::site::Site;

/// What is computed of the elements at a place.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Sum,
    Mean,
    Greatest,
    Least,
}

/// Operands that are joined one after another.
pub struct Several {
    kind: Kind,
    /// The way through the result and each operand.
    ways: Vec<Broadcast<2>>,
    joined: Vec<f64>,
}

impl Several {
    /// The operands of a node; nothing if it does something else with them.
    ///
    /// # Errors
    /// If the shapes do not go together.
    pub fn new(site: &Site<'_>) -> Result<Option<Self>> {
        let kind = match site.node.op_type.as_str() {
            "Sum" => Kind::Sum,
            "Mean" => Kind::Mean,
            "Max" => Kind::Greatest,
            "Min" => Kind::Least,
            _ => return Ok(None),
        };
        let shape = site.output_shape()?;
        let ways = (0..site.node.input.len()).map(|place| Broadcast::new([shape, site.shape(place)?]));
        let ways = ways.collect::<Result<_>>()?;
        Ok(Some(Self { kind, ways, joined: vec![0.0; shape.iter().product()] }))
    }

    /// Joins the operands from the first to the last.
    fn join(&mut self, inputs: &[Option<&Buffer>], join: impl Fn(f64, f64) -> f64) -> Result<()> {
        for (place, way) in self.ways.iter_mut().enumerate() {
            let input = single(inputs, place)?;
            let [_, step] = way.steps();
            let join =
                |joined: f64, x: f32| if place == 0 { f64::from(x) } else { join(joined, f64::from(x)) };
            way.rows(&mut self.joined, |row, [_, at]| match step {
                0 => row.iter_mut().for_each(|joined| *joined = join(*joined, input[at])),
                _ => {
                    let elements = input[at..].iter().step_by(step);
                    row.iter_mut().zip(elements).for_each(|(joined, x)| *joined = join(*joined, *x));
                }
            });
        }
        Ok(())
    }
}

impl Operation for Several {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        match self.kind {
            Kind::Sum | Kind::Mean => self.join(inputs, |a, b| a + b)?,
            Kind::Greatest => self.join(inputs, |a, b| further(a, b, 1.0))?,
            Kind::Least => self.join(inputs, |a, b| further(a, b, -1.0))?,
        }
        let divisor = if matches!(self.kind, Kind::Mean) { self.ways.len() as f64 } else { 1.0 };
        let elements = outputs[0].single_mut()?.iter_mut().zip(&self.joined);
        elements.for_each(|(into, joined)| *into = (joined / divisor) as f32);
        Ok(())
    }
}
