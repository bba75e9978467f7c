//! The values around them that the bodies of control flow use, such as those of `If` and `Loop`: the node does not name them.

use std::collections::BTreeSet;

use prost::Message;

use crate::proto::{GraphProto, NodeProto};

/// Bodies within bodies are read to this depth: networks have two or three, and a damaged file may have any number.
const DEEPEST: usize = 16;

/// The names that the bodies of a node use without defining them, in alphabetical order.
pub(crate) fn captured(node: &NodeProto) -> Vec<String> {
    from_bodies(node, DEEPEST).into_iter().collect()
}

fn from_bodies(node: &NodeProto, depth: usize) -> BTreeSet<String> {
    let Some(depth) = depth.checked_sub(1) else { return BTreeSet::new() };
    let bodies = node.attribute.iter().flat_map(|attribute| attribute.g.iter().chain(&attribute.graphs));
    let bodies = bodies.filter_map(|bytes| GraphProto::decode(bytes.as_slice()).ok());
    bodies.flat_map(|body| from_body(&body, depth)).collect()
}

fn from_body(body: &GraphProto, depth: usize) -> BTreeSet<String> {
    let mut names: BTreeSet<String> = body.output.iter().map(|output| output.name.clone()).collect();
    for node in &body.node {
        names.extend(node.input.iter().cloned());
        names.extend(from_bodies(node, depth));
    }
    let inputs = body.input.iter().map(|input| &input.name);
    let constants = body.initializer.iter().map(|tensor| &tensor.name);
    let own: BTreeSet<&String> =
        inputs.chain(constants).chain(body.node.iter().flat_map(|node| &node.output)).collect();
    names.retain(|name| !name.is_empty() && !own.contains(name));
    names
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::proto::{AttributeProto, ValueInfoProto};

    fn node(input: &[&str], output: &str, body: Option<&GraphProto>) -> NodeProto {
        let attribute =
            body.map(|body| AttributeProto { g: Some(body.encode_to_vec()), ..Default::default() });
        NodeProto {
            op_type: "Add".into(),
            input: input.iter().map(|&name| name.into()).collect(),
            output: vec![output.into()],
            attribute: attribute.into_iter().collect(),
            ..Default::default()
        }
    }

    #[test]
    fn bodies_use_the_names_that_they_do_not_define() {
        let inner = GraphProto {
            node: vec![node(&["far", "sum"], "result", None)],
            output: vec![ValueInfoProto::tensor("result", 1, &[1])],
            ..Default::default()
        };
        let body = GraphProto {
            input: vec![ValueInfoProto::tensor("step", 1, &[1])],
            node: vec![node(&["step", "near", ""], "sum", None), node(&[], "deep", Some(&inner))],
            output: ["deep", "passed"].map(|name| ValueInfoProto::tensor(name, 1, &[1])).into(),
            ..Default::default()
        };
        assert_eq!(captured(&node(&["condition"], "y", Some(&body))), ["far", "near", "passed"]);
        assert_eq!(captured(&node(&["x"], "y", None)), [""; 0]);
    }

    #[test]
    fn bodies_in_bodies_without_end_and_damaged_ones_are_left_out() {
        let mut body = GraphProto { node: vec![node(&["x"], "y", None)], ..Default::default() };
        for _ in 0..100 {
            body = GraphProto { node: vec![node(&["outer"], "y", Some(&body))], ..Default::default() };
        }
        assert_eq!(captured(&node(&[], "y", Some(&body))), ["outer"]);
        let damaged = AttributeProto { g: Some(vec![0xff; 9]), ..Default::default() };
        assert!(captured(&NodeProto { attribute: vec![damaged], ..Default::default() }).is_empty());
    }
}
