//! Any operator by its own rule, in 64-bit floats that are then rounded to its type.

use std::sync::Arc;

use pdk_sdk::error::{Error, Place, Result};

use super::buffer::{Buffer, Constants, Operation};
use crate::graph::{Graph, describe};
use crate::operators::{self, Operator};
use crate::proto::NodeProto;
use crate::site::Site;
use crate::tensor::Tensor;

/// A node whose operator is computed by its rule.
pub struct Plain {
    graph: Arc<Graph>,
    node: usize,
    operator: &'static Operator,
    constants: Vec<Option<Arc<Tensor>>>,
}

impl Plain {
    /// The node at a place of a graph, with those of its inputs that are constant.
    pub fn new(graph: Arc<Graph>, node: usize, operator: &'static Operator, constants: &Constants) -> Self {
        Self { graph, node, operator, constants: constants.to_vec() }
    }
}

impl Operation for Plain {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let node = &self.graph.nodes()[self.node];
        let site = Site::new(&self.graph.values, node);
        let tensors = inputs.iter().enumerate().map(|(place, input)| {
            let (Some(input), None) = (input, &self.constants[place]) else { return Ok(None) };
            let fact = site.fact(place)?;
            Ok(Some(Tensor { element: fact.element, shape: fact.shape.clone(), values: input.to_doubles() }))
        });
        let tensors = tensors.collect::<Result<Vec<_>>>()?;
        let known = self.constants.iter().map(Option::as_deref);
        let given: Vec<Option<&Tensor>> = tensors
            .iter()
            .map(Option::as_ref)
            .zip(known)
            .map(|(computed, known)| computed.or(known))
            .collect();
        let results = (self.operator.shapes.evaluate)(&site, &given).place(describe(node))?;
        for (place, output) in outputs.iter_mut().enumerate().filter(|(place, _)| !is_left_out(node, *place))
        {
            let result = results.get(place).filter(|result| result.values.len() == output.len());
            let result = result.ok_or_else(|| {
                Error::new(format!("its output {} is not computed here", place + 1)).at(describe(node))
            })?;
            // Rounded to 32 bits first, an element could be rounded twice, and an integer lose the bits that it keeps.
            output.set(&result.clone().fitted().values);
        }
        Ok(())
    }
}

/// Whether a node has no use for its output at a place.
fn is_left_out(node: &NodeProto, place: usize) -> bool {
    node.output.get(place).is_none_or(String::is_empty)
}

/// What a node computes from constants.
///
/// # Errors
/// As its operator's rule.
pub fn evaluate(site: &Site<'_>, constants: &Constants) -> Result<Vec<Tensor>> {
    let operator = operators::known(site.node)?;
    let given: Vec<Option<&Tensor>> = constants.iter().map(Option::as_deref).collect();
    (operator.shapes.evaluate)(site, &given)
}
