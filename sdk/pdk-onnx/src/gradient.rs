//! Builds the gradient of one number, or of a sum of several, as nodes of the same graph.
//!
//! The graph is walked from the output back to the values whose gradients are asked for. Each node on the way adds the
//! nodes that its operator's rule gives. So the result is a plain ONNX graph, which runs wherever the model runs.

use std::collections::{HashMap, HashSet};

use pdk_sdk::error::{Error, Result};

use crate::builder::Builder;
use crate::graph::{Graph, describe};
use crate::operators::{self, Rule};
use crate::proto::{ModelProto, NodeProto};
use crate::site::Site;
use crate::tensor::{Element, Tensor};

/// The versions of ONNX's operator set whose operators have the rules that are built in.
pub const OPSETS: std::ops::RangeInclusive<i64> = 7..=25;

/// One number that a graph computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Target<'a> {
    /// The name of the value.
    pub value: &'a str,
    /// Which of its elements, in row-major order.
    pub index: usize,
}

/// A model that computes gradients.
pub struct Gradients {
    /// The model. Its inputs are those of the original; its outputs are the values that were to be kept, then a gradient
    /// for each value that was asked for.
    pub model: ModelProto,
    /// The names of the outputs, in their order.
    pub outputs: Vec<String>,
}

/// Builds a model that computes the values `keep`, and the gradient of `target` with respect to each value in `of`.
///
/// # Errors
/// If an operator in between has no gradient here, a shape is not known, the numbers are not 32-bit or 64-bit floats, or
/// the target does not depend on one of the values.
pub fn gradients(graph: &Graph, target: Target<'_>, of: &[&str], keep: &[&str]) -> Result<Gradients> {
    gradients_of_sum(graph, &[target], of, keep)
}

/// As [`gradients`], of the sum of several numbers.
///
/// # Errors
/// As for [`gradients`], and if there are no targets or the sum does not depend on one of the values.
pub fn gradients_of_sum(
    graph: &Graph,
    targets: &[Target<'_>],
    of: &[&str],
    keep: &[&str],
) -> Result<Gradients> {
    let (first, last) = (OPSETS.start(), OPSETS.end());
    if !OPSETS.contains(&graph.opset()) {
        return Err(Error::new(format!(
            "it is written for version {} of the operator set, but gradients are known for {first} to {last}; export it for \
             one of these",
            graph.opset()
        )));
    }
    let mut between = HashSet::new();
    for target in targets {
        between.extend(self::between(graph, target.value, of)?);
    }
    let lacking = lacking(graph, &between);
    if !lacking.is_empty() {
        return Err(Error::new(format!("these operators have no gradient here: {}", lacking.join(", "))));
    }
    for name in &between {
        if graph.fact(name).is_ok_and(|fact| fact.element.is_float()) {
            float_shape(graph, name)?;
        }
    }

    let mut builder = Builder::new(graph.clone(), between.iter().map(|&name| name.to_owned()).collect());
    let mut known: HashMap<String, Vec<String>> = HashMap::new();
    for target in targets {
        let seed = builder.constant(&seed(graph, *target)?)?;
        known.entry(target.value.to_owned()).or_default().push(seed);
    }
    for node in graph.nodes().iter().rev() {
        if node.output.iter().any(|output| known.contains_key(output)) {
            pass_through(&Site::new(&graph.values, node), &mut builder, &mut known)
                .map_err(|error| error.at(format!("the gradient of {}", describe(node))))?;
        }
    }

    let mut outputs: Vec<String> = keep.iter().map(|&name| name.to_owned()).collect();
    for name in of {
        let gradient = total(&mut builder, &mut known, name)?.ok_or_else(|| {
            Error::new(format!(
                "{} does not change with `{name}`: its gradient is zero everywhere",
                named(targets)
            ))
        })?;
        // An output has to have a name of its own, even if two gradients are one value.
        outputs.push(builder.gradient_of(name, &gradient)?);
    }
    let names: Vec<&str> = outputs.iter().map(String::as_str).collect();
    Ok(Gradients { model: builder.graph.model(&names)?, outputs })
}

/// The gradient of a number with respect to the value that it belongs to: 1 at its place, else 0.
fn seed(graph: &Graph, target: Target<'_>) -> Result<Tensor> {
    let shape = float_shape(graph, target.value)?;
    let count: usize = shape.iter().product();
    if target.index >= count {
        return Err(Error::new(format!(
            "`{}` has {count} numbers, so there is none with the number {}",
            target.value, target.index
        )));
    }
    let mut seed = Tensor::filled(graph.fact(target.value)?.element, shape, 0.0)?;
    seed.values[target.index] = 1.0;
    Ok(seed)
}

/// What targets are called in a sentence.
fn named(targets: &[Target<'_>]) -> String {
    let mut names: Vec<_> = targets.iter().map(|target| format!("`{}`", target.value)).collect();
    names.dedup();
    match names.as_slice() {
        [one] => one.clone(),
        several => format!("the sum of {}", several.join(" and ")),
    }
}

/// The operators between a value and the target that have no gradient here, by name, each once.
pub fn without_gradient(graph: &Graph, target: &str, of: &str) -> Vec<String> {
    between(graph, target, &[of]).map(|between| lacking(graph, &between)).unwrap_or_default()
}

fn lacking(graph: &Graph, between: &HashSet<&str>) -> Vec<String> {
    let on_the_way = |(place, node): &(usize, &NodeProto)| {
        graph.uses(*place).any(|name| between.contains(name))
            && node.output.iter().any(|name| between.contains(name.as_str()))
    };
    let nodes = graph.nodes().iter().enumerate().filter(on_the_way).map(|(_, node)| node);
    let has_none = |node: &&NodeProto| {
        operators::find(node).is_none_or(|operator| matches!(operator.gradient, Rule::Unknown))
    };
    let mut lacking: Vec<String> = nodes.filter(has_none).map(|node| node.op_type.clone()).collect();
    lacking.sort_unstable();
    lacking.dedup();
    lacking
}

/// The values through which the gradient of the target comes to one of `of`, both ends among them. If none comes to it, those through which the
/// target depends on it.
fn between<'a>(graph: &'a Graph, target: &str, of: &[&str]) -> Result<HashSet<&'a str>> {
    let mut between = HashSet::new();
    let (ancestors, derived) = (ancestors(graph, target), derived(graph, target));
    for name in of {
        graph.fact(name)?;
        let moved = moved(graph, name);
        match moved.contains(target) {
            true => between.extend(moved.intersection(&derived)),
            false => between.extend(graph.dependents(name).intersection(&ancestors)),
        }
    }
    Ok(between)
}

/// The values that the target depends on, itself among them.
fn ancestors<'a>(graph: &'a Graph, target: &str) -> HashSet<&'a str> {
    let needed = graph.needed(&[target], &HashSet::new());
    let places = (0..needed.len()).filter(|place| needed[*place]);
    let values = places
        .flat_map(|place| graph.uses(place).chain(graph.nodes()[place].output.iter().map(String::as_str)));
    values.chain(graph.values.name(target)).filter(|name| !name.is_empty()).collect()
}

/// Whether gradients pass a node. What is constant, or constant in steps, such as a shape, stops them.
pub(crate) fn passes(node: &NodeProto) -> bool {
    operators::find(node).is_none_or(|operator| !matches!(operator.gradient, Rule::Zero))
}

/// The values from which gradients come to a value, itself among them.
fn moved<'a>(graph: &'a Graph, name: &str) -> HashSet<&'a str> {
    // Only floats have gradients.
    let may_have_one =
        |name: &&str| !name.is_empty() && !graph.fact(name).is_ok_and(|fact| !fact.element.is_float());
    let mut moved = HashSet::from_iter(graph.values.name(name));
    for (place, node) in graph.nodes().iter().enumerate().filter(|(_, node)| passes(node)) {
        if graph.uses(place).any(|name| moved.contains(name)) {
            moved.extend(node.output.iter().map(String::as_str).filter(may_have_one));
        }
    }
    moved
}

/// The values to which the gradient of the target comes, itself among them.
fn derived<'a>(graph: &'a Graph, target: &str) -> HashSet<&'a str> {
    let mut derived = HashSet::from_iter(graph.values.name(target));
    for (place, node) in graph.nodes().iter().enumerate().rev().filter(|(_, node)| passes(node)) {
        if node.output.iter().any(|output| derived.contains(output.as_str())) {
            derived.extend(graph.uses(place).filter(|name| !name.is_empty()));
        }
    }
    derived
}

/// The shape of a value of 32-bit or 64-bit floats.
pub(crate) fn float_shape<'a>(graph: &'a Graph, name: &str) -> Result<&'a [usize]> {
    let fact = graph.fact(name)?;
    match fact.element {
        Element::FLOAT | Element::DOUBLE => Ok(&fact.shape),
        other => Err(Error::new(format!(
            "`{name}` is {other}, but gradients need FLOAT (32 bit) or DOUBLE; export the model in 32 bit"
        ))),
    }
}

/// Takes the gradients of what a node computes to what goes into it.
fn pass_through(
    site: &Site<'_>,
    builder: &mut Builder,
    known: &mut HashMap<String, Vec<String>>,
) -> Result<()> {
    let totals = site.node.output.iter().map(|output| total(builder, known, output));
    let totals = totals.collect::<Result<Vec<_>>>()?;
    let Some(operator) = operators::find(site.node) else { return Ok(()) };
    let parts = match (operator.gradient, totals.as_slice()) {
        (Rule::Unknown | Rule::Zero, _) => return Ok(()),
        (Rule::Each(rule), totals) => rule(site, builder, totals)?,
        (Rule::First(rule), [Some(first), rest @ ..]) if rest.iter().all(Option::is_none) => {
            rule(site, builder, first)?
        }
        (Rule::First(_), _) => return Err(Error::new("only its first output has one here")),
    };
    for (place, name) in site.node.input.iter().enumerate() {
        let given = parts.iter().any(|(part, _)| *part == place);
        if !given && builder.wants(site, place) && site.fact(place)?.element.is_float() {
            return Err(Error::new(format!("it has none with respect to its input `{name}`")));
        }
    }
    for (place, gradient) in parts {
        if builder.wants(site, place) {
            known.entry(site.input(place)?.to_owned()).or_default().push(gradient);
        }
    }
    Ok(())
}

/// The sum of all gradients that have come to a value.
fn total(
    builder: &mut Builder,
    known: &mut HashMap<String, Vec<String>>,
    name: &str,
) -> Result<Option<String>> {
    let Some(parts) = known.get_mut(name) else { return Ok(None) };
    let mut parts = std::mem::take(parts).into_iter();
    let Some(mut sum) = parts.next() else { return Ok(None) };
    for part in parts {
        sum = builder.binary("Add", &sum, &part)?;
    }
    known.insert(name.to_owned(), vec![sum.clone()]);
    Ok(Some(sum))
}
