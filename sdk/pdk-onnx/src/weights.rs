//! The weights of a graph: the numbers in its file that training changes.

use std::collections::HashSet;

use crate::gradient::passes;
use crate::graph::Graph;
use crate::values::Source;

/// The inputs that set an operator: bounds, factors of sizes, and the statistics that training counts instead of deriving them.
const SETTINGS: &[(&str, &[usize])] = &[
    ("BatchNormalization", &[3, 4]),
    ("Clip", &[1, 2]),
    ("Dropout", &[1]),
    ("OneHot", &[1, 2]),
    ("Pad", &[2]),
    ("Resize", &[1, 2]),
    ("Upsample", &[1]),
];

/// The weights of floats with respect to which an output may have a gradient, in the order of the nodes that use them. Constants that nodes
/// hold are among them, but not single numbers without an axis, which are part of a formula.
pub(crate) fn weights(graph: &Graph) -> Vec<&str> {
    let mut derived: HashSet<&str> = graph.outputs().iter().map(String::as_str).collect();
    for (place, node) in graph.nodes().iter().enumerate().rev() {
        if !node.output.iter().any(|output| derived.contains(output.as_str())) || !passes(node) {
            continue;
        }
        let settings = SETTINGS.iter().find(|(operator, _)| *operator == node.op_type);
        let is_setting = |place: &usize| settings.is_some_and(|(_, places)| places.contains(place));
        let inputs = graph.uses(place).enumerate().filter(|(place, _)| !is_setting(place));
        derived.extend(inputs.map(|(_, name)| name));
    }
    let is_weight = |name: &str| {
        let Ok(fact) = graph.fact(name) else { return false };
        let is_in_file = match graph.source(name) {
            Some(Source::Initializer(_)) => true,
            Some(Source::Node(place)) => graph.nodes()[place].op_type == "Constant" && !fact.shape.is_empty(),
            _ => false,
        };
        is_in_file && fact.element.is_float() && derived.contains(name)
    };
    let mut taken = HashSet::new();
    let used = (0..graph.nodes().len()).flat_map(|place| graph.uses(place));
    used.filter(|name| is_weight(name) && taken.insert(*name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objective::{Objective, values};
    use crate::tensor::Tensor;
    use crate::testing::{Setting, Sketch};

    fn graph(build: impl Fn(&mut Sketch)) -> Graph {
        let mut sketch = Sketch::new(13);
        sketch.input("x", &[1, 2, 4, 4]);
        build(&mut sketch);
        Graph::new(sketch.model(&["y"])).unwrap()
    }

    #[test]
    fn bounds_factors_of_sizes_and_running_statistics_are_not_weights() {
        let graph = graph(|s| {
            for name in ["factor", "term", "mean", "variance"] {
                s.weights(name, Tensor::floats(&[2], vec![0.5, 1.5]));
            }
            s.weights("low", Tensor::floats(&[], vec![0.0]));
            s.weights("scales", Tensor::floats(&[4], vec![1.0, 1.0, 2.0, 2.0]));
            s.weights("compared", Tensor::floats(&[4], vec![0.5; 4]));
            s.node("BatchNormalization", &["x", "factor", "term", "mean", "variance"], "n", &[]);
            s.node("Clip", &["n", "low"], "c", &[]);
            s.node("Resize", &["c", "", "scales"], "r", &[("mode", Setting::Text("nearest"))]);
            s.node("ReduceMax", &["r"], "m", &[("keepdims", Setting::Int(0))]);
            s.node("Greater", &["m", "compared"], "holds", &[]);
            s.node("Cast", &["holds"], "mask", &[("to", Setting::Int(1))]);
            s.node("Mul", &["m", "mask"], "y", &[]);
        });
        let named = values(&graph, &["weights".to_owned()]).unwrap();
        assert_eq!(named, ["factor", "term"]);
        assert!(Objective::parse("sum(y)", &graph).unwrap().gradients(&graph, &named).is_ok());
    }

    #[test]
    fn weights_in_constant_nodes_count_and_single_numbers_do_not() {
        let graph = graph(|s| {
            for (name, shape) in [("kernel", &[2, 2, 1, 1][..]), ("half", &[])] {
                let values = vec![0.5; shape.iter().product()];
                let value = Tensor::floats(shape, values).to_proto("value");
                s.node("Constant", &[], name, &[]);
                s.push_attribute(crate::proto::AttributeProto {
                    name: "value".into(),
                    t: Some(value),
                    r#type: crate::proto::attribute_type::TENSOR,
                    ..Default::default()
                });
            }
            s.node("Conv", &["x", "kernel"], "c", &[]);
            s.node("Mul", &["c", "half"], "y", &[]);
        });
        let named = values(&graph, &["weights".to_owned()]).unwrap();
        assert_eq!(named, ["kernel"]);
        let built = Objective::parse("sum(y)", &graph).unwrap().gradients(&graph, &named).unwrap();
        assert_eq!(built.outputs, ["objective", "gradient/kernel"]);
    }

    #[test]
    fn a_graph_without_weights_says_so() {
        let graph = graph(|s| s.node("Relu", &["x"], "y", &[]));
        let error = values(&graph, &["weights".to_owned()]).unwrap_err().to_string();
        assert!(error.contains("no weights of floats"), "{error}");
    }
}
