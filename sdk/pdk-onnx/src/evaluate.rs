//! Computes values in 64-bit floats, plainly: the reference for every faster way to run a graph.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use pdk_sdk::error::{Error, Place, Result};

use crate::graph::{Graph, describe};
use crate::operators;
use crate::site::Site;
use crate::tensor::{Tensor, shape_text};

impl Graph {
    /// Computes `values` from `given`: the graph's inputs, or any values in their place.
    ///
    /// # Errors
    /// If an operator is not known here, or something that is needed is not given.
    pub fn evaluate(&self, given: &[(&str, &Tensor)], values: &[&str]) -> Result<Vec<Tensor>> {
        let mut known: HashMap<&str, Cow<'_, Tensor>> = HashMap::new();
        for (name, tensor) in given {
            let shape = &self.fact(name)?.shape;
            if *shape != tensor.shape {
                let (given, shape) = (shape_text(&tensor.shape), shape_text(shape));
                return Err(Error::new(format!("`{name}` has the shape {shape}, but {given} is given")));
            }
            known.insert(name, Cow::Borrowed(tensor));
        }
        let names: HashSet<&str> = known.keys().copied().collect();
        let needed = self.needed(values, &names);
        for (node, _) in self.nodes().iter().zip(needed).filter(|(_, needed)| *needed) {
            let operator = operators::known(node)?;
            for name in node.input.iter().filter(|name| !name.is_empty()) {
                self.take_constant(name, &mut known)?;
            }
            let inputs: Vec<Option<&Tensor>> =
                node.input.iter().map(|name| known.get(name.as_str()).map(AsRef::as_ref)).collect();
            let outputs =
                (operator.shapes.evaluate)(&Site::new(&self.values, node), &inputs).place(describe(node))?;
            for (name, tensor) in node.output.iter().zip(outputs) {
                // An output that is left out has an empty name, as has an input that is left out.
                if !name.is_empty() && !names.contains(name.as_str()) {
                    known.insert(name, Cow::Owned(tensor.fitted()));
                }
            }
        }
        let results = values.iter().map(|name| {
            self.take_constant(name, &mut known)?;
            known
                .get(name)
                .map(|tensor| tensor.clone().into_owned())
                .ok_or_else(|| Error::new(format!("`{name}` is not computed")))
        });
        results.collect()
    }

    /// Puts a value beside those that are known, if it is a constant of the file.
    fn take_constant<'a>(&self, name: &'a str, known: &mut HashMap<&'a str, Cow<'_, Tensor>>) -> Result<()> {
        if !known.contains_key(name) {
            let tensor =
                self.constant(name)?.ok_or_else(|| Error::new(format!("`{name}` has to be given")))?;
            known.insert(name, Cow::Owned((*tensor).clone()));
        }
        Ok(())
    }
}
