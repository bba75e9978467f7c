//! Which nodes use a value: what is used by one node alone can be computed together with it.

use std::collections::HashMap;

use crate::graph::Graph;

/// The users of each value among the nodes that are needed.
pub struct Users<'a> {
    /// The nodes that use a value; none for an output of the graph.
    users: HashMap<&'a str, Vec<Option<usize>>>,
}

impl<'a> Users<'a> {
    /// The users of the values of a graph. Nothing if there is control flow: its bodies may use any value, without naming it in the node.
    pub fn of(graph: &'a Graph, needed: &[bool]) -> Option<Self> {
        let nodes = || graph.nodes().iter().enumerate().filter(|(place, _)| needed[*place]);
        if nodes().any(|(_, node)| node.attribute.iter().any(|a| a.g.is_some() || !a.graphs.is_empty())) {
            return None;
        }
        let mut users: HashMap<&str, Vec<Option<usize>>> = HashMap::new();
        for (place, node) in nodes() {
            node.input.iter().for_each(|name| users.entry(name).or_default().push(Some(place)));
        }
        graph.outputs().iter().for_each(|name| users.entry(name).or_default().push(None));
        Some(Self { users })
    }

    /// The place of the node that alone uses a value, once.
    pub fn only(&self, name: &str) -> Option<usize> {
        match self.users.get(name)?.as_slice() {
            [user] => *user,
            _ => None,
        }
    }
}
