//! Any operator by its own rule, in 64-bit floats that are then rounded to its type.

use std::sync::Arc;

use pdk_sdk::error::{Place, Result};

use super::buffer::{Buffer, Constants, Operation};
use crate::graph::{Graph, describe};
use crate::operators::{self, Operator};
use crate::site::Site;
use crate::tensor::Tensor;

/// A node whose operator is computed by its rule.
pub struct Plain {
    graph: Arc<Graph>,
    node: usize,
    operator: &'static Operator,
}

impl Plain {
    /// The node at a place of a graph.
    pub fn new(graph: Arc<Graph>, node: usize, operator: &'static Operator) -> Self {
        Self { graph, node, operator }
    }
}

impl Operation for Plain {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let node = &self.graph.nodes()[self.node];
        let site = Site::new(&self.graph.values, node);
        let tensors = inputs.iter().enumerate().map(|(place, input)| {
            let Some(input) = input else { return Ok(None) };
            let fact = site.fact(place)?;
            Ok(Some(Tensor { element: fact.element, shape: fact.shape.clone(), values: input.to_doubles() }))
        });
        let tensors = tensors.collect::<Result<Vec<_>>>()?;
        let given: Vec<Option<&Tensor>> = tensors.iter().map(Option::as_ref).collect();
        let results = (self.operator.shapes.evaluate)(&site, &given).place(describe(node))?;
        for (output, result) in outputs.iter_mut().zip(results) {
            // Rounded to 32 bits first, an element could be rounded twice, and an integer lose the bits that it keeps.
            output.set(&result.fitted().values);
        }
        Ok(())
    }
}

/// What a node computes from constants.
///
/// # Errors
/// As its operator's rule.
pub fn evaluate(site: &Site<'_>, constants: &Constants) -> Result<Vec<Tensor>> {
    let operator = operators::known(site.node)?;
    let given: Vec<Option<&Tensor>> = constants.iter().map(Option::as_deref).collect();
    (operator.shapes.evaluate)(site, &given).place(describe(site.node))
}
