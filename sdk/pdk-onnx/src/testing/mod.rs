//! Small models over every operator, for tests of gradients and of those who run them.

mod cases;
#[cfg(test)]
mod damaged;
#[cfg(test)]
mod networks;
#[cfg(test)]
mod official;
mod random;
#[cfg(test)]
mod refusals;
mod sketch;

use pdk_sdk::error::{Error, Result};

pub use cases::{CASES, Case};
pub use random::random;
pub use sketch::{Setting, Sketch};

use crate::gradient::{Gradients, Target, gradients};
use crate::graph::Graph;
use crate::tensor::Tensor;

/// The step of central differences whose values are around 1.
const STEP: f64 = 1e-6;

/// Versions of the operator set at which something changed.
pub const OPSETS: [i64; 15] = [7, 8, 9, 10, 11, 12, 13, 17, 18, 20, 21, 22, 23, 24, 25];

/// Numbers that look random and are always the same, from -1 to 1.
pub fn numbers(seed: u64, count: usize) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

/// The slope of a function of a tensor along one of its values, between two steps away from it.
///
/// # Errors
/// Those of the function.
pub fn slope(
    at: &Tensor,
    place: usize,
    [from, to]: [f64; 2],
    value: impl Fn(&Tensor) -> Result<f64>,
) -> Result<f64> {
    let moved = |step: f64| {
        let mut moved = at.clone();
        moved.values[place] += step;
        value(&moved)
    };
    Ok((moved(to)? - moved(from)?) / (to - from))
}

/// The central differences of a function of a tensor along its values at these places.
///
/// # Errors
/// Those of the function.
pub fn differences(
    at: &Tensor,
    places: impl IntoIterator<Item = usize>,
    step: f64,
    value: impl Fn(&Tensor) -> Result<f64>,
) -> Result<Vec<f64>> {
    places.into_iter().map(|place| slope(at, place, [-step, step], &value)).collect()
}

/// The gradient of `target` with respect to `x`, from the graph that is built and by central differences, both in 64-bit
/// floats, and the model.
///
/// # Errors
/// If the gradient cannot be built or computed.
pub fn both_gradients(
    graph: &Graph,
    target: Target<'_>,
    x: (&str, &Tensor),
    places: &[usize],
) -> Result<(Vec<f64>, Vec<f64>, Gradients)> {
    let built = gradients(graph, target, &[x.0], &[])?;
    let derived = Graph::new(built.model.clone())?;
    let exact = derived.evaluate(&[x], &[&built.outputs[0]])?.swap_remove(0);
    if exact.shape != x.1.shape {
        return Err(Error::new("the gradient has another shape than the value"));
    }
    let value =
        |moved: &Tensor| Ok(graph.evaluate(&[(x.0, moved)], &[target.value])?[0].values[target.index]);
    let differences = differences(x.1, places.iter().copied(), STEP, value)?;
    let exact = places.iter().map(|&place| exact.values[place]).collect();
    Ok((exact, differences, built))
}

/// The largest difference, relative to the largest value.
pub fn relative_error(found: &[f64], expected: &[f64]) -> f64 {
    let largest = expected.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
    let difference = found.iter().zip(expected).fold(0.0f64, |largest, (a, b)| {
        let difference = (a - b).abs();
        if difference.is_nan() { f64::INFINITY } else { largest.max(difference) }
    });
    if difference == 0.0 { 0.0 } else { difference / largest }
}

/// Checks the gradient of a case by central differences, in each version of the operator set that has it.
///
/// # Panics
/// If they differ, or the case is not known.
#[cfg(test)]
pub(crate) fn check(name: &str) {
    let case =
        CASES.iter().find(|case| case.name == name).unwrap_or_else(|| panic!("there is no case `{name}`"));
    let opsets: Vec<_> = OPSETS.into_iter().filter(|opset| case.opsets.contains(opset)).collect();
    assert!(!opsets.is_empty(), "{name} has no version");
    for opset in opsets {
        let place = format!("{name} at version {opset}");
        let graph = Graph::new(case.model(opset)).unwrap_or_else(|error| panic!("{place}: {error}"));
        let x = case.x();
        let all: Vec<_> = (0..x.values.len()).collect();
        let target = Target { value: "target", index: 0 };
        let (exact, differences, _) = both_gradients(&graph, target, ("x", &x), &all)
            .unwrap_or_else(|error| panic!("{place}: {error}"));
        assert!(differences.iter().any(|&value| value != 0.0), "{place}: the gradient is zero");
        let error = relative_error(&exact, &differences);
        assert!(error < 1e-6, "{place}: relative error {error:e}\n{exact:?}\n{differences:?}");
        check_weights(&graph, ("x", &x), name, &place);
    }
}

/// The weights of all cases that have no gradient: sizes, bounds, and what is only compared with.
#[cfg(test)]
const WITHOUT: [&str; 4] = ["scales", "low", "high", "zero"];

/// The case and the weight that has no differences: the exponent of numbers of which some are negative.
#[cfg(test)]
const UNDEFINED: (&str, &str) = ("pow/scalar", "two");

/// Checks the gradients with respect to all weights of a case by central differences.
#[cfg(test)]
fn check_weights(graph: &Graph, x: (&str, &Tensor), case: &str, place: &str) {
    let nodes = graph.nodes().iter().flat_map(|node| &node.input).map(String::as_str);
    let is_weight = |name: &&str| {
        matches!(graph.source(name), Some(crate::values::Source::Initializer(_)))
            && graph.fact(name).is_ok_and(|fact| fact.element.is_float() && !fact.shape.contains(&0))
    };
    let mut weights: Vec<_> = nodes.filter(is_weight).collect();
    weights.sort_unstable();
    weights.dedup();
    let target = Target { value: "target", index: 0 };
    for name in weights {
        let built = match gradients(graph, target, &[name], &[]) {
            Ok(built) => built,
            Err(error) => {
                assert!(WITHOUT.contains(&name), "{place}: `{name}`: {error}");
                continue;
            }
        };
        assert!(!WITHOUT.contains(&name), "{place}: `{name}` has a gradient");
        let weight = graph.constant(name).unwrap().unwrap();
        let derived = Graph::new(built.model).unwrap();
        let exact = derived.evaluate(&[x], &[&built.outputs[0]]).unwrap().swap_remove(0);
        assert_eq!(exact.shape, weight.shape, "{place}: `{name}`");
        let value = |moved: &Tensor| Ok(graph.evaluate(&[x, (name, moved)], &["target"])?[0].values[0]);
        let differences = differences(&weight, 0..weight.values.len(), STEP, value).unwrap();
        let is_undefined = differences.iter().any(|difference| difference.is_nan());
        assert_eq!(is_undefined, (case, name) == UNDEFINED, "{place}: `{name}`: {differences:?}");
        if is_undefined {
            continue;
        }
        let error = relative_error(&exact.values, &differences);
        assert!(error < 1e-6, "{place}: `{name}`: relative error {error:e}\n{exact:?}\n{differences:?}");
    }
}

/// The error of a model whose one operator has inputs of these shapes. What is declared about its output does not hide the damage.
///
/// # Panics
/// If the model is computed.
#[cfg(test)]
pub(crate) fn fault(
    opset: i64,
    operator: &str,
    shapes: &[&[usize]],
    settings: &[(&str, Setting<'_>)],
) -> String {
    let mut sketch = Sketch::new(opset);
    let names: Vec<_> = (0..shapes.len()).map(|place| format!("x{place}")).collect();
    names.iter().zip(shapes).for_each(|(name, shape)| sketch.input(name, shape));
    let names: Vec<_> = names.iter().map(String::as_str).collect();
    sketch.node(operator, &names, "y", settings);
    let tensors: Vec<_> =
        shapes.iter().map(|shape| Tensor::filled(crate::Element::FLOAT, shape, 1.0).unwrap()).collect();
    let given: Vec<_> = names.iter().copied().zip(&tensors).collect();
    let mut model = sketch.model(&["y"]);
    let error = Graph::new(model.clone()).and_then(|graph| {
        graph.fact("y")?;
        graph.evaluate(&given, &["y"])
    });
    model.graph.iter_mut().for_each(|graph| {
        graph.value_info.push(crate::proto::ValueInfoProto::tensor("y", crate::Element::FLOAT.0, &[3]));
    });
    let declared = Graph::new(model).and_then(|graph| graph.evaluate(&given, &["y"]));
    assert!(declared.is_err(), "{operator} of {shapes:?} is computed if its output is declared");
    error.err().unwrap_or_else(|| panic!("{operator} of {shapes:?} is computed")).to_string()
}

/// What a graph computes as `y` from constants alone.
#[cfg(test)]
pub(crate) fn computed(opset: i64, build: impl Fn(&mut Sketch)) -> Result<Tensor> {
    let mut sketch = Sketch::new(opset);
    build(&mut sketch);
    let graph = Graph::new(sketch.model(&["y"]))?;
    graph.fact("y")?;
    Ok(graph.evaluate(&[], &["y"])?.swap_remove(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_graphs_have_the_gradients_that_central_differences_show() {
        let mut operators = std::collections::BTreeSet::new();
        for seed in 0..60 {
            let opset = OPSETS[seed as usize % OPSETS.len()];
            let model = random(seed, opset);
            operators
                .extend(model.graph.iter().flat_map(|graph| &graph.node).map(|node| node.op_type.clone()));
            let graph = Graph::new(model).unwrap_or_else(|error| panic!("graph {seed}: {error}"));
            let shape = graph.fact("x").unwrap().shape.clone();
            let x = Tensor::floats(&shape, numbers(seed + 1000, shape.iter().product()));
            let all: Vec<_> = (0..x.values.len()).collect();
            let target = Target { value: "target", index: 0 };
            let (exact, differences, _) = both_gradients(&graph, target, ("x", &x), &all)
                .unwrap_or_else(|error| panic!("graph {seed}: {error}"));
            let error = relative_error(&exact, &differences);
            assert!(error < 1e-5, "graph {seed} at version {opset}: relative error {error:e}");
        }
        assert!(operators.len() > 25, "{operators:?}");
    }
}
