//! What files declare and contain, before anything is made of it.

use std::sync::Arc;

use pdk_sdk::error::{Error, Result};

use crate::graph::Graph;
use crate::operators;
use crate::site::Site;
use crate::tensor::{Tensor, elements, shape_text};
use crate::values::Fact;

/// The most elements of a value: far above those of any driver, and a small file can describe values of any size.
const LARGEST: usize = 1 << 26;

/// The number of elements of a value.
pub fn count_of(fact: &Fact) -> Result<usize> {
    match elements(&fact.shape)? {
        count if count <= LARGEST => Ok(count),
        _ => Err(Error::new(format!(
            "it makes a tensor of the shape {}, and one may have {} million elements",
            shape_text(&fact.shape),
            LARGEST >> 20
        ))),
    }
}

/// Checks that a node computes what the graph knows of its outputs. Where a rule refuses a node, the graph takes what the file declares, which
/// nothing here could rely on.
pub fn check(graph: &Graph, site: &Site<'_>) -> Result<()> {
    let facts = (operators::known(site.node)?.shapes.infer)(site)?;
    for (place, name) in site.node.output.iter().enumerate().filter(|(_, name)| !name.is_empty()) {
        let known = graph.fact(name)?;
        if facts.get(place) != Some(known) {
            return Err(Error::new(format!("its output `{name}` is not as the file declares it")));
        }
        count_of(known)?;
    }
    Ok(())
}

/// The elements of a constant as its type has them; a file may hold others.
pub fn constant(graph: &Graph, name: &str) -> Result<Option<Arc<Tensor>>> {
    Ok(graph.constant(name)?.map(|tensor| match tensor.is_rounded() {
        true => tensor,
        false => Arc::new(Tensor::clone(&tensor).rounded()),
    }))
}
