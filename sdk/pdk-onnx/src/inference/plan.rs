//! How each node of a graph is computed, and in which buffers.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use pdk_sdk::error::{Error, Result};

use super::buffer::{Buffer, Constants, Operation, is_single};
use super::choice::Choice;
use super::convolution::Convolution;
use super::declared::{check, constant, count_of};
use super::elementwise::{Binary, Narrowing, Unary};
use super::extremes::Extremes;
use super::functions::Smooth;
use super::fusion::{self, Fusion};
use super::matrix::Product;
use super::movement::{Movement, moved};
use super::neighbours::Neighbours;
use super::normalization::Normalization;
use super::plain::{self, Plain};
use super::pooling::Pool;
use super::power::Power;
use super::quantisation::{Dynamic, Quantisation};
use super::quantised::Quantised;
use super::reduction::Reduction;
use super::resize::Resize;
use super::several::Several;
use super::softmax::Softmax;
use super::standardization::Standardization;
use super::users::Users;
use super::{Operand, Program, Step};
use crate::graph::{Graph, describe};
use crate::operators;
use crate::proto::NodeProto;
use crate::site::Site;
use crate::tensor::{Element, Tensor};

/// The most elements of all values that are kept at a time.
const MOST: usize = 1 << 28;

/// Prepares the outputs of a graph.
///
/// # Errors
/// If an operator or a shape is not known, or a node contradicts itself.
pub fn program(graph: Graph) -> Result<Program> {
    let graph = Arc::new(graph);
    let outputs: Vec<&str> = graph.outputs().iter().map(String::as_str).collect();
    let mut plan = Plan {
        graph: &graph,
        constants: HashMap::new(),
        kept: HashMap::new(),
        buffers: Vec::new(),
        values: HashMap::new(),
        values_known: Vec::new(),
        users: None,
        done: HashSet::new(),
    };
    let inputs = graph.inputs().map(|name| plan.value(name)).collect::<Result<Vec<_>>>()?;
    let needed = graph.needed(&outputs, &HashSet::new());
    let mut unknown: Vec<&str> = graph
        .nodes()
        .iter()
        .zip(&needed)
        .filter(|(node, needed)| **needed && operators::find(node).is_none())
        .map(|(node, _)| node.op_type.as_str())
        .collect();
    unknown.sort_unstable();
    unknown.dedup();
    if !unknown.is_empty() {
        return Err(Error::new(format!("these operators are not known: {}", unknown.join(", "))));
    }
    plan.users = Users::of(&graph, &needed);
    let mut fusions =
        plan.users.as_ref().map(|users| fusion::all(&graph, &needed, users)).unwrap_or_default();
    let needed = fusion::needed(&graph, &fusions);
    let mut steps = Vec::new();
    for (place, node) in graph.nodes().iter().enumerate().filter(|(place, _)| needed[*place]) {
        let step = match fusions.remove(&place) {
            Some(fusion) => plan.fused(fusion).map(Some),
            None if plan.done.contains(&place) => Ok(None),
            None => plan.step(place),
        };
        steps.extend(step.map_err(|error| error.at(describe(node)))?);
    }
    let results = outputs.iter().map(|name| plan.operand(name)).collect::<Result<Vec<_>>>()?;
    plan.allocate(steps, &inputs, results)
}

struct Plan<'a> {
    graph: &'a Arc<Graph>,
    /// What nodes compute from constants alone.
    constants: HashMap<&'a str, Arc<Tensor>>,
    /// The places of constants that are needed while the graph runs.
    kept: HashMap<&'a str, usize>,
    /// The constants at these places.
    buffers: Vec<Buffer>,
    /// The numbers of values that are computed.
    values: HashMap<&'a str, usize>,
    /// Type and number of elements of each.
    values_known: Vec<(Element, usize)>,
    /// Nothing if there is control flow.
    users: Option<Users<'a>>,
    /// Nodes that are computed together with the one before them.
    done: HashSet<usize>,
}

impl<'a> Plan<'a> {
    /// The number of a value that is computed.
    fn value(&mut self, name: &'a str) -> Result<usize> {
        let (element, count) = match name {
            // An output that is not wanted.
            "" => (Element::FLOAT, 0),
            name => {
                let fact = self.graph.fact(name)?;
                (fact.element, count_of(fact)?)
            }
        };
        let number = self.values_known.len();
        self.values_known.push((element, count));
        self.values.insert(name, number);
        Ok(number)
    }

    fn constant(&self, name: &str) -> Result<Option<Arc<Tensor>>> {
        match self.constants.get(name) {
            Some(tensor) => Ok(Some(tensor.clone())),
            None => constant(self.graph, name),
        }
    }

    /// What a name stands for while the graph runs.
    fn operand(&mut self, name: &'a str) -> Result<Operand> {
        if let Some(number) = self.values.get(name) {
            return Ok(Operand::Computed(*number));
        }
        if let Some(place) = self.kept.get(name) {
            return Ok(Operand::Constant(*place));
        }
        let tensor = self.constant(name)?.ok_or_else(|| Error::new(format!("`{name}` is not computed")))?;
        self.kept.insert(name, self.buffers.len());
        self.buffers.push(Buffer::of(tensor.element, &tensor.values));
        Ok(Operand::Constant(self.buffers.len() - 1))
    }

    /// How a node is computed; nothing if it is constant.
    fn step(&mut self, place: usize) -> Result<Option<Step>> {
        let graph = self.graph;
        let node = &graph.nodes()[place];
        let site = Site::new(&graph.values, node);
        let constants =
            node.input.iter().map(|name| match self.values.contains_key(name.as_str()) || name.is_empty() {
                true => Ok(None),
                false => self.constant(name),
            });
        let constants = constants.collect::<Result<Vec<_>>>()?;
        check(graph, &site)?;
        let is_constant =
            node.input.iter().zip(&constants).all(|(name, known)| name.is_empty() || known.is_some());
        let outputs_known = node
            .output
            .iter()
            .all(|name| name.is_empty() || graph.constant(name).is_ok_and(|known| known.is_some()));
        if outputs_known {
            return Ok(None);
        }
        if is_constant {
            for (name, tensor) in node.output.iter().zip(plain::evaluate(&site, &constants)?) {
                self.constants.insert(name, Arc::new(tensor.rounded()));
            }
            return Ok(None);
        }
        let mut operation = operation(graph, place, &site, &constants)?;
        let mut outputs = &node.output;
        if let Some(relu) = self.relu_behind(node)
            && operation.cut()
        {
            self.done.insert(relu);
            outputs = &graph.nodes()[relu].output;
        }
        self.step_of(operation, node.input.iter().map(String::as_str), outputs).map(Some)
    }

    /// The place of `Relu`, if that is all that the output of a node is for. One that contradicts itself is refused when it is planned.
    fn relu_behind(&self, node: &NodeProto) -> Option<usize> {
        let [output] = node.output.as_slice() else { return None };
        let place = self.users.as_ref()?.only(output)?;
        let relu = &self.graph.nodes()[place];
        let fits = relu.op_type == "Relu" && check(self.graph, &Site::new(&self.graph.values, relu)).is_ok();
        fits.then_some(place)
    }

    /// How nodes that belong together are computed.
    fn fused(&mut self, fusion: Fusion<'a>) -> Result<Step> {
        let graph = self.graph;
        let outputs = fusion.nodes.last().map_or(&[][..], |last| &graph.nodes()[*last].output);
        self.step_of(Box::new(fusion.operation), fusion.inputs.iter().copied(), outputs)
    }

    /// An operation between values.
    fn step_of(
        &mut self,
        operation: Box<dyn Operation>,
        inputs: impl Iterator<Item = &'a str>,
        names: &'a [String],
    ) -> Result<Step> {
        let inputs = inputs.map(|name| match name {
            "" => Ok(None),
            name => self.operand(name).map(Some),
        });
        let inputs = inputs.collect::<Result<Vec<_>>>()?;
        let mut outputs = Vec::new();
        for name in names {
            let number = self.value(name)?;
            outputs.push((number, self.values_known[number].0, self.values_known[number].1));
        }
        Ok(Step {
            operation,
            inputs,
            results: outputs.iter().map(|_| Buffer::Single(Vec::new())).collect(),
            outputs,
        })
    }

    /// Gives each value a buffer, which it leaves to others after its last use.
    fn allocate(self, mut steps: Vec<Step>, inputs: &[usize], results: Vec<Operand>) -> Result<Program> {
        let mut last_use = vec![0; self.values_known.len()];
        for (number, step) in steps.iter().enumerate() {
            for operand in step.inputs.iter().flatten() {
                if let Operand::Computed(value) = operand {
                    last_use[*value] = number;
                }
            }
            // An output that nothing uses.
            step.outputs.iter().for_each(|(value, ..)| last_use[*value] = last_use[*value].max(number));
        }
        for operand in &results {
            if let Operand::Computed(value) = operand {
                last_use[*value] = usize::MAX;
            }
        }
        let mut buffers: Vec<(bool, usize)> = Vec::new();
        let mut free: Vec<usize> = Vec::new();
        let mut places = vec![usize::MAX; self.values_known.len()];
        let mut take = |value: usize, free: &mut Vec<usize>| {
            let (element, count) = self.values_known[value];
            let fits = |place: &usize| buffers[*place].0 == is_single(element);
            // The smallest that is large enough, else the largest.
            let best = free.iter().copied().filter(fits).min_by_key(|place| {
                let room = buffers[*place].1;
                if room >= count { (0, room) } else { (1, usize::MAX - room) }
            });
            match best {
                Some(place) => {
                    free.retain(|other| *other != place);
                    buffers[place].1 = buffers[place].1.max(count);
                    place
                }
                None => {
                    buffers.push((is_single(element), count));
                    buffers.len() - 1
                }
            }
        };
        for &value in inputs {
            places[value] = take(value, &mut free);
        }
        for (number, step) in steps.iter_mut().enumerate() {
            for (value, ..) in &mut step.outputs {
                places[*value] = take(*value, &mut free);
            }
            let used = step.inputs.iter().flatten().filter_map(|operand| match operand {
                Operand::Computed(value) => Some(*value),
                Operand::Constant(_) => None,
            });
            let mut done: Vec<usize> = used.chain(step.outputs.iter().map(|(value, ..)| *value)).collect();
            done.retain(|value| last_use[*value] == number);
            done.sort_unstable();
            done.dedup();
            free.extend(done.iter().map(|value| places[*value]));
        }
        let counts = buffers.iter().map(|(_, count)| *count);
        let kept = steps.iter().map(|step| step.operation.kept());
        let total = counts.chain(kept).fold(0usize, usize::saturating_add);
        if total > MOST {
            return Err(Error::new(format!(
                "its values have {} million elements at a time, and may have {}",
                total >> 20,
                MOST >> 20
            )));
        }
        let placed = |operand: &mut Operand| {
            if let Operand::Computed(value) = operand {
                *value = places[*value];
            }
        };
        for step in &mut steps {
            step.inputs.iter_mut().flatten().for_each(placed);
            step.outputs.iter_mut().for_each(|(value, ..)| *value = places[*value]);
        }
        let mut outputs = results;
        outputs.iter_mut().for_each(placed);
        let known =
            |value: &usize| (places[*value], self.values_known[*value].0, self.values_known[*value].1);
        let room = |(single, count): (bool, usize)| match single {
            true => Buffer::Single(Vec::with_capacity(count)),
            false => Buffer::Double(Vec::with_capacity(count)),
        };
        Ok(Program {
            steps,
            inputs: inputs.iter().map(known).collect(),
            outputs,
            constants: self.buffers,
            buffers: buffers.into_iter().map(room).collect(),
        })
    }
}

/// How a node is computed.
fn operation(
    graph: &Arc<Graph>,
    place: usize,
    site: &Site<'_>,
    constants: &Constants,
) -> Result<Box<dyn Operation>> {
    let node = site.node;
    let operator = operators::known(node)?;
    let mut computed = Vec::new();
    for (place, _) in constants
        .iter()
        .enumerate()
        .filter(|(place, known)| known.is_none() && site.optional(*place).is_some())
    {
        computed.push(site.fact(place)?.element);
    }
    let results =
        node.output.iter().filter(|name| !name.is_empty()).map(|name| Ok(graph.fact(name)?.element));
    let results = results.collect::<Result<Vec<_>>>()?;
    let all = |fits: fn(Element) -> bool| computed.iter().chain(&results).all(|element| fits(*element));

    if let Some(moved) = moved(&node.op_type, constants.len())
        && (all(is_single) || all(|element| !is_single(element)))
        && let Some(movement) = Movement::new(operator, site, &moved, constants)?
    {
        return Ok(Box::new(movement));
    }
    if let Some(quantisation) = Quantisation::new(site, constants)? {
        return Ok(Box::new(quantisation));
    }
    if let Some(dynamic) = Dynamic::new(site)? {
        return Ok(Box::new(dynamic));
    }
    if let Some(narrowing) = Narrowing::new(site)? {
        return Ok(Box::new(narrowing));
    }
    if let Some(quantised) = Quantised::of(site, constants)? {
        return Ok(Box::new(quantised));
    }
    if all(|element| element.is_float() && is_single(element)) {
        // Axes and exponents are often 64-bit integers.
        if let Some(reduction) = Reduction::new(site)? {
            return Ok(Box::new(reduction));
        }
        if let Some(power) = Power::new(site, constants) {
            return Ok(Box::new(power));
        }
    }
    let in_single = |place: usize| {
        site.optional(place).is_none() || site.fact(place).is_ok_and(|fact| is_single(fact.element))
    };
    if all(|element| element.is_float() && is_single(element)) && (0..node.input.len().min(3)).all(in_single)
    {
        let known = |place: usize| constants.get(place).and_then(Option::as_deref);
        // Weights are packed once if what is added to the sums is constant too.
        let weights = known(1).filter(|_| site.optional(2).is_none() || known(2).is_some());
        match node.op_type.as_str() {
            "Conv" => return Ok(Box::new(Convolution::new(site, weights, known(2))?)),
            "ConvTranspose" => return Ok(Box::new(Convolution::transposed(site, weights, known(2))?)),
            "MatMul" => return Ok(Box::new(Product::stacks(site, known(1))?)),
            "Gemm" => return Ok(Box::new(Product::and_sum(site, known(1), known(2))?)),
            "Resize" | "Upsample" => return Ok(Box::new(Resize::new(site)?)),
            "LRN" => return Ok(Box::new(Neighbours::new(site)?)),
            "Softmax" | "LogSoftmax" => return Ok(Box::new(Softmax::new(site)?)),
            _ => {}
        }
        if let Some(pool) = Pool::new(site)? {
            return Ok(Box::new(pool));
        }
        if let Some(standardization) = Standardization::new(site)? {
            return Ok(Box::new(standardization));
        }
        if node.op_type == "BatchNormalization"
            && let Some(normalization) = Normalization::new(site, constants)?
        {
            return Ok(Box::new(normalization));
        }
        if let Some(unary) = Unary::new(site)? {
            return Ok(Box::new(unary));
        }
        if let Some(smooth) = Smooth::new(site) {
            return Ok(Box::new(smooth));
        }
    }
    if computed.iter().all(|element| is_single(*element))
        && let Some(extremes) = Extremes::new(site)?
    {
        return Ok(Box::new(extremes));
    }
    let floats = computed.iter().all(|element| element.is_float());
    if all(is_single) && in_single(0) && in_single(1) {
        if node.op_type == "Cast"
            && let Some(unary) = Unary::new(site)?
        {
            return Ok(Box::new(unary));
        }
        if node.op_type == "Where" && in_single(2) {
            return Ok(Box::new(Choice::new(site)?));
        }
        if floats && let Some(binary) = Binary::new(site)? {
            return Ok(Box::new(binary));
        }
        let are_floats = floats && results.iter().all(|element| element.is_float());
        if are_floats
            && (2..node.input.len()).all(in_single)
            && let Some(several) = Several::new(site)?
        {
            return Ok(Box::new(several));
        }
    }
    Ok(Box::new(Plain::new(graph.clone(), place, operator, constants)))
}
