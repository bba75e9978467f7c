//! What is known about the values of a graph: type and shape, small constants, and where each comes from.

use std::collections::HashMap;
use std::sync::Arc;

use pdk_sdk::error::{Error, Result};

use crate::proto::TensorProto;
use crate::tensor::{Element, Tensor, dims, elements};

/// The type and shape of a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fact {
    /// The type of its elements.
    pub element: Element,
    /// Its shape.
    pub shape: Vec<usize>,
}

impl Fact {
    /// A fact.
    pub fn new(element: Element, shape: Vec<usize>) -> Self {
        Self { element, shape }
    }
}

/// What is known about a value.
#[derive(Clone)]
pub(crate) struct Value {
    /// Type and shape, or why they are not known.
    pub fact: Result<Fact>,
    /// Its elements, if they are few and do not depend on the inputs.
    pub constant: Option<Arc<Tensor>>,
    pub source: Source,
}

/// Where a value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// It is an input of the graph.
    Input,
    /// It is a constant: its place among the initializers.
    Initializer(usize),
    /// A node computes it: the node's place.
    Node(usize),
}

/// Constants of at most this many elements are kept as numbers, since others may follow from them, such as shapes.
pub(crate) const SMALL: usize = 1 << 12;

/// The values of a graph, by name.
#[derive(Clone)]
pub(crate) struct Values {
    /// The version of ONNX's operator set.
    pub opset: i64,
    /// The constants, in the order in which they were added.
    pub initializers: Vec<TensorProto>,
    known: HashMap<String, Value>,
}

impl Values {
    /// No values yet.
    pub fn new(opset: i64) -> Self {
        Self { opset, initializers: Vec::new(), known: HashMap::new() }
    }

    /// Adds a value.
    ///
    /// # Errors
    /// If its name is taken.
    pub fn define(&mut self, name: &str, value: Value) -> Result<()> {
        match self.known.insert(name.to_owned(), value) {
            None => Ok(()),
            Some(_) => Err(Error::new(format!("two values are called `{name}`"))),
        }
    }

    /// Adds a constant.
    ///
    /// # Errors
    /// If its shape makes no sense, or its name is taken.
    pub fn add_initializer(&mut self, tensor: TensorProto) -> Result<()> {
        let place = |error: Error| error.at(format!("its weights `{}`", tensor.name));
        let shape = dims(&tensor).map_err(place)?;
        let small = elements(&shape).map_err(place)? <= SMALL && tensor.data_location == 0;
        let constant = match small && tensor.data_type != 8 {
            true => Some(Arc::new(Tensor::from_proto(&tensor).map_err(place)?)),
            false => None,
        };
        let fact = Ok(Fact::new(Element(tensor.data_type), shape));
        let source = Source::Initializer(self.initializers.len());
        self.define(&tensor.name, Value { fact, constant, source })?;
        self.initializers.push(tensor);
        Ok(())
    }

    /// The elements of these values, as far as they are kept.
    pub fn constants(&self, names: &[String]) -> Vec<Option<Arc<Tensor>>> {
        names.iter().map(|name| self.known.get(name)?.constant.clone()).collect()
    }

    /// Keeps the elements of a value.
    pub fn keep(&mut self, name: &str, tensor: Tensor) {
        if let Some(value) = self.known.get_mut(name) {
            value.constant = Some(Arc::new(tensor));
        }
    }

    /// Whether there is a value of this name.
    pub fn contains(&self, name: &str) -> bool {
        self.known.contains_key(name)
    }

    /// The name of a value, as long as the graph lives.
    pub fn name(&self, name: &str) -> Option<&str> {
        self.known.get_key_value(name).map(|(name, _)| name.as_str())
    }

    /// Type and shape of a value.
    ///
    /// # Errors
    /// If the value is missing, or why they are not known.
    pub fn fact(&self, name: &str) -> Result<&Fact> {
        match self.known.get(name) {
            Some(value) => value.fact.as_ref().map_err(Clone::clone),
            None => Err(Error::new(format!("there is no value `{name}`"))),
        }
    }

    /// The elements of a value; nothing if they depend on the inputs, or are many and are not in the file.
    ///
    /// # Errors
    /// If the constant in the file contradicts itself.
    pub fn constant(&self, name: &str) -> Result<Option<Arc<Tensor>>> {
        match self.known.get(name) {
            Some(Value { constant: Some(tensor), .. }) => Ok(Some(tensor.clone())),
            Some(Value { source: Source::Initializer(place), .. }) => {
                let tensor = Tensor::from_proto(&self.initializers[*place]);
                tensor
                    .map(|tensor| Some(Arc::new(tensor)))
                    .map_err(|error| error.at(format!("its weights `{name}`")))
            }
            _ => Ok(None),
        }
    }

    /// Where a value comes from.
    pub fn source(&self, name: &str) -> Option<Source> {
        self.known.get(name).map(|value| value.source)
    }
}
