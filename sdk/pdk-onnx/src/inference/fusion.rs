//! Quantised networks whose convolutions and products of matrices are written in floats: between `DequantizeLinear` and `QuantizeLinear`.
//!
//! They are computed in integers, as other runtimes do it: what goes in is what stands before `DequantizeLinear`, and if `QuantizeLinear` is all
//! that follows, or `Relu` and then that, the sums become integers at once. Real numbers would give the same; floats are rounded on the
//! way, so that a result near a tie may be another integer.

use std::collections::HashMap;
use std::sync::Arc;

use pdk_sdk::error::Result;

use super::buffer::singles;
use super::declared::{check, constant};
use super::quantisation::Range;
use super::quantised::{Finish, Quantised, To, Zero, are_of, is_byte};
use super::users::Users;
use crate::graph::Graph;
use crate::proto::NodeProto;
use crate::site::{Site, axis};
use crate::tensor::{Element, Tensor};
use crate::values::Source;

/// Nodes that are computed together.
pub struct Fusion<'a> {
    /// What they are computed from.
    pub inputs: Vec<&'a str>,
    pub operation: Quantised,
    /// The nodes, of which the last one has the output.
    pub nodes: Vec<usize>,
}

/// The nodes of a graph that are computed together, by the place of the last one. Nodes that contradict themselves are not among them,
/// and are refused when they are planned one by one.
pub fn all<'a>(graph: &'a Graph, needed: &[bool], users: &Users<'_>) -> HashMap<usize, Fusion<'a>> {
    let mut fusions = HashMap::new();
    for place in (0..graph.nodes().len()).filter(|place| needed[*place]) {
        if let Ok(Some(fusion)) = (Search { graph, users }).fusion(place) {
            fusions.insert(fusion.nodes[fusion.nodes.len() - 1], fusion);
        }
    }
    fusions
}

/// The nodes that are still needed to compute the outputs.
pub fn needed(graph: &Graph, fusions: &HashMap<usize, Fusion<'_>>) -> Vec<bool> {
    let mut needed = vec![false; graph.nodes().len()];
    let mut open: Vec<&str> = graph.outputs().iter().map(String::as_str).collect();
    while let Some(name) = open.pop() {
        let Some(Source::Node(place)) = graph.source(name) else { continue };
        if std::mem::replace(&mut needed[place], true) {
            continue;
        }
        match fusions.get(&place) {
            Some(fusion) => open.extend(&fusion.inputs),
            None => open.extend(graph.nodes()[place].input.iter().map(String::as_str)),
        }
    }
    needed
}

/// Integers before `DequantizeLinear`.
struct Dequantised<'a> {
    name: &'a str,
    shape: &'a [usize],
    scales: Vec<f32>,
    zeros: Vec<f32>,
    /// The axis along which the factors lie.
    axis: usize,
}

struct Search<'a, 'b> {
    graph: &'a Graph,
    users: &'b Users<'b>,
}

impl<'a> Search<'a, '_> {
    /// The node at a place with those around it, if it is a sum of products of integers.
    fn fusion(&self, place: usize) -> Result<Option<Fusion<'a>>> {
        let node = &self.graph.nodes()[place];
        let is_convolution = match node.op_type.as_str() {
            "Conv" => true,
            "MatMul" | "Gemm" => false,
            _ => return Ok(None),
        };
        let site = Site::new(&self.graph.values, node);
        let is_plain = node.op_type != "Gemm"
            || site.int("transA", 0) == 0
                && [site.float("alpha", 1.0), site.float("beta", 1.0)].iter().all(|factor| *factor == 1.0);
        let (Some(left), Some(right)) = (self.dequantised(&site, 0)?, self.dequantised(&site, 1)?) else {
            return Ok(None);
        };
        let (nodes, to) = self.end(place, &site)?;
        // Before anything is made of sizes that a file only declares.
        for node in nodes.iter().map(|place| &self.graph.nodes()[*place]) {
            check(self.graph, &Site::new(&self.graph.values, node))?;
        }
        let ([left_scale], [left_zero], true) =
            (left.scales.as_slice(), left.zeros.as_slice(), is_plain && !left.shape.is_empty())
        else {
            return Ok(None);
        };
        let is_turned = node.op_type == "Gemm" && site.int("transB", 0) != 0;
        let rank = right.shape.len();
        // The axis of the filters, or of the columns.
        let outputs = if is_convolution || is_turned { 0 } else { rank.saturating_sub(1) };
        if right.scales.len() > 1 && (right.axis != outputs || rank < 2) {
            return Ok(None);
        }
        let factors: Vec<f32> = right.scales.iter().map(|scale| left_scale * scale).collect();
        let count = right.shape.get(outputs).copied().unwrap_or(1);
        let Some(bias) = self.bias(&site, count)? else { return Ok(None) };
        let plane = site.output_shape()?.get(2..).unwrap_or_default().iter().product();
        // A bias that was quantised is whole in steps of the sums, up to what its factor was rounded by; any other is added to the results.
        let whole = whole(&bias, &factors);
        let (bias, terms) = match whole {
            Some(whole) => (whole, Vec::new()),
            None => (Vec::new(), bias),
        };
        let (factors, terms) = match to {
            To::Range(_) => {
                let scale = self.number(&self.graph.nodes()[nodes[nodes.len() - 1]], 1)?.unwrap_or(f32::NAN);
                let scaled = |numbers: Vec<f32>| numbers.iter().map(|number| number / scale).collect();
                (scaled(factors), scaled(terms))
            }
            _ => (factors, terms),
        };
        let finish = Finish { to, factors, terms, length: if is_convolution { plane } else { 1 } };
        if !finish.is_finite() {
            return Ok(None);
        }
        let zero = Zero::Known(*left_zero);
        let known = constant(self.graph, right.name)?;
        let mut inputs = vec![left.name];
        let operation = match (is_convolution, known) {
            (true, Some(kernel)) => {
                Quantised::convolution(&site, left.shape, &kernel, &right.zeros, &bias, zero, finish)?
            }
            (true, None) => return Ok(None),
            (false, Some(matrix)) => {
                let matrix = if is_turned { turned(&matrix) } else { Tensor::clone(&matrix) };
                let shapes = [left.shape, matrix.shape.as_slice()];
                Quantised::matrices(shapes, Some((&matrix, &right.zeros)), (1, 0.0), &bias, zero, finish)?
            }
            (false, None) if is_turned || right.zeros.len() != 1 => return Ok(None),
            (false, None) => {
                inputs.push(right.name);
                let shapes = [left.shape, right.shape];
                Quantised::matrices(shapes, None, (1, right.zeros[0]), &bias, zero, finish)?
            }
        };
        Ok(operation.map(|operation| Fusion { inputs, operation, nodes }))
    }

    /// What an input was before `DequantizeLinear`, if it was integers of 8 bits.
    fn dequantised(&self, site: &Site<'_>, place: usize) -> Result<Option<Dequantised<'a>>> {
        let Some(Source::Node(at)) = site.optional(place).and_then(|name| self.graph.source(name)) else {
            return Ok(None);
        };
        let node = &self.graph.nodes()[at];
        let site = Site::new(&self.graph.values, node);
        if node.op_type != "DequantizeLinear" || site.int("block_size", 0) != 0 {
            return Ok(None);
        }
        check(self.graph, &site)?;
        let (integers, result) = (site.fact(0)?, site.fact_of_output()?);
        let (Some(scales), zeros) = (self.known(node, 1)?, self.known(node, 2)?) else { return Ok(None) };
        let is_known = zeros.is_some() || site.optional(2).is_none();
        let are_floats = result.element == Element::FLOAT && scales.element == Element::FLOAT;
        if !is_byte(integers.element) || !are_floats || !is_known || scales.shape.len() > 1 {
            return Ok(None);
        }
        let zeros = zeros.map_or_else(|| vec![0.0; scales.values.len()], |zeros| singles(&zeros));
        // One number needs no axis, whatever the attribute says.
        let axis = match scales.values.len() {
            1 => 0,
            _ => axis(site.int("axis", 1), integers.shape.len())?,
        };
        let fits = zeros.len() == scales.values.len() && are_of(integers.element, &zeros);
        Ok(fits.then(|| Dequantised {
            name: node.input[0].as_str(),
            shape: &integers.shape,
            scales: singles(&scales),
            zeros,
            axis,
        }))
    }

    /// What is added to the sums. Nothing if it is not constant, or not one number for each output.
    fn bias(&self, site: &Site<'_>, count: usize) -> Result<Option<Vec<f32>>> {
        if site.node.op_type == "MatMul" || site.optional(2).is_none() {
            return Ok(Some(Vec::new()));
        }
        let bias = self.known(site.node, 2)?;
        let fits = |bias: &Tensor| bias.values.len() == count && bias.shape.last() == Some(&count);
        Ok(bias.filter(|bias| fits(bias)).map(|bias| singles(&bias)))
    }

    /// The nodes from a sum to what its results become.
    fn end(&self, place: usize, site: &Site<'_>) -> Result<(Vec<usize>, To)> {
        let floats = (vec![place], To::Floats);
        let (mut nodes, mut name, mut is_cut) = (vec![place], site.output(0)?, false);
        loop {
            let Some(next) = self.users.only(name) else { return Ok(floats) };
            let node = &self.graph.nodes()[next];
            let site = Site::new(&self.graph.values, node);
            nodes.push(next);
            match node.op_type.as_str() {
                "Relu" if !is_cut => (name, is_cut) = (site.output(0)?, true),
                "QuantizeLinear" if site.int("block_size", 0) == 0 => {
                    let element = site.fact_of_output()?.element;
                    let zero = match site.optional(2) {
                        Some(_) => self.number(node, 2)?,
                        None => Some(0.0),
                    };
                    let range = zero.and_then(|zero| Range::of(element, zero));
                    let (Some(mut range), Some(scale), true) =
                        (range, self.number(node, 1)?, is_byte(element))
                    else {
                        return Ok(floats);
                    };
                    if !are_of(element, &[range.zero]) {
                        return Ok(floats);
                    }
                    // With another scale, the larger floats become the smaller integers, if any.
                    if is_cut && (scale <= 0.0 || scale.is_nan()) {
                        return Ok(floats);
                    }
                    if is_cut {
                        range.bounds[0] = range.bounds[0].max(range.zero);
                    }
                    return Ok((nodes, To::Range(range)));
                }
                _ => return Ok(floats),
            }
        }
    }

    /// A constant input of a node.
    fn known(&self, node: &NodeProto, place: usize) -> Result<Option<Arc<Tensor>>> {
        match node.input.get(place).filter(|name| !name.is_empty()) {
            Some(name) => constant(self.graph, name),
            None => Ok(None),
        }
    }

    /// The one number of a constant input.
    fn number(&self, node: &NodeProto, place: usize) -> Result<Option<f32>> {
        let one = |tensor: &Tensor| (tensor.values.len() == 1).then(|| tensor.values[0] as f32);
        Ok(self.known(node, place)?.and_then(|tensor| one(&tensor)))
    }
}

/// Terms as whole numbers of steps of the sums, if each is within a thousandth of one.
fn whole(terms: &[f32], factors: &[f32]) -> Option<Vec<i32>> {
    let steps = terms.iter().zip(factors.iter().cycle()).map(|(term, factor)| {
        let steps = f64::from(*term) / f64::from(*factor);
        let whole = steps.round_ties_even();
        let near = (steps - whole).abs() <= 1e-3f64.max(whole.abs() * f64::from(f32::EPSILON));
        // Sums have to have room for it.
        (near && whole.abs() <= f64::from(1 << 30)).then_some(whole as i32)
    });
    steps.collect()
}

/// A matrix whose rows are the columns of another.
fn turned(matrix: &Tensor) -> Tensor {
    let (rows, columns) = (matrix.shape[0], matrix.shape[1]);
    let values = (0..columns).flat_map(|column| {
        matrix.values.iter().skip(column).step_by(columns.max(1)).take(rows).copied().collect::<Vec<_>>()
    });
    Tensor { element: matrix.element, shape: vec![columns, rows], values: values.collect() }
}
