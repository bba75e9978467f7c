//! Models that are put together in a few lines.

use super::numbers;
use crate::proto::{
    AttributeProto, GraphProto, ModelProto, NodeProto, OperatorSetIdProto, ValueInfoProto, attribute_type,
};
use crate::tensor::{Element, Tensor};

/// The value of an attribute.
#[derive(Debug, Clone, Copy)]
pub enum Setting<'a> {
    /// A whole number.
    Int(i64),
    /// Whole numbers.
    Ints(&'a [i64]),
    /// A number.
    Float(f32),
    /// A text.
    Text(&'a str),
}

/// A model in the making.
#[derive(Clone)]
pub struct Sketch {
    opset: i64,
    graph: GraphProto,
}

impl Sketch {
    /// An empty model for a version of the operator set.
    pub fn new(opset: i64) -> Self {
        Self { opset, graph: GraphProto { name: "sketch".into(), ..Default::default() } }
    }

    /// The version of the operator set.
    pub fn opset(&self) -> i64 {
        self.opset
    }

    /// Adds an input of 32-bit floats.
    pub fn input(&mut self, name: &str, shape: &[usize]) {
        self.graph.input.push(ValueInfoProto::tensor(name, Element::FLOAT.0, shape));
    }

    /// Adds a constant.
    pub fn weights(&mut self, name: &str, tensor: Tensor) -> String {
        self.graph.initializer.push(tensor.to_proto(name));
        name.to_owned()
    }

    /// Adds weights that look random, from `low` to `high`.
    pub fn drawn(&mut self, shape: &[usize], low: f64, high: f64) -> String {
        let seed = self.graph.initializer.len() as u64 + 7;
        let values = numbers(seed, shape.iter().product());
        // As 32-bit floats, which is what a file holds.
        let values = values.into_iter().map(|v| f64::from((low + (high - low) * (v + 1.0) / 2.0) as f32));
        let name = format!("w{}", self.graph.initializer.len());
        self.weights(&name, Tensor::floats(shape, values.collect()))
    }

    /// Adds whole numbers.
    pub fn ints(&mut self, values: &[i64]) -> String {
        let name = format!("i{}", self.graph.initializer.len());
        self.weights(&name, Tensor::ints(values))
    }

    /// Adds a node.
    pub fn node(&mut self, operator: &str, inputs: &[&str], output: &str, settings: &[(&str, Setting<'_>)]) {
        self.split(operator, inputs, &[output], settings);
    }

    /// Adds a node with several outputs.
    pub fn split(
        &mut self,
        operator: &str,
        inputs: &[&str],
        outputs: &[&str],
        settings: &[(&str, Setting<'_>)],
    ) {
        self.graph.node.push(NodeProto {
            op_type: operator.into(),
            name: format!("{}_{}", operator.to_lowercase(), self.graph.node.len()),
            input: inputs.iter().map(|&input| input.into()).collect(),
            output: outputs.iter().map(|&output| output.into()).collect(),
            attribute: settings.iter().map(|(name, setting)| attribute(name, *setting)).collect(),
            ..Default::default()
        });
    }

    /// Adds an attribute to the last node.
    pub fn push_attribute(&mut self, attribute: AttributeProto) {
        self.graph.node.iter_mut().last().into_iter().for_each(|node| node.attribute.push(attribute.clone()));
    }

    /// Adds a node with whole numbers, by name, that are an attribute before the version `since`, and its next input from
    /// then on.
    pub fn with_ints(
        &mut self,
        since: i64,
        operator: &str,
        input: &str,
        output: &str,
        (name, values): (&str, &[i64]),
        settings: &[(&str, Setting<'_>)],
    ) {
        if self.opset >= since {
            let values = self.ints(values);
            return self.node(operator, &[input, &values], output, settings);
        }
        let settings: Vec<_> = settings.iter().copied().chain([(name, Setting::Ints(values))]).collect();
        self.node(operator, &[input], output, &settings);
    }

    /// The model with these outputs, whose shapes are left open.
    pub fn model(&self, outputs: &[&str]) -> ModelProto {
        let mut graph = self.graph.clone();
        graph.output = outputs
            .iter()
            .map(|name| {
                let mut output = ValueInfoProto::tensor(name, Element::FLOAT.0, &[]);
                let tensor = output.r#type.as_mut().and_then(|r#type| r#type.tensor_type.as_mut());
                tensor.into_iter().for_each(|tensor| tensor.shape = None);
                output
            })
            .collect();
        let opset = OperatorSetIdProto { version: self.opset, ..Default::default() };
        ModelProto {
            ir_version: if self.opset > 20 { 10 } else { 8 },
            producer_name: "sketch".into(),
            opset_import: vec![opset],
            graph: Some(graph),
            ..Default::default()
        }
    }
}

fn attribute(name: &str, setting: Setting<'_>) -> AttributeProto {
    let plain = AttributeProto { name: name.to_owned(), ..Default::default() };
    match setting {
        Setting::Int(value) => AttributeProto { i: Some(value), r#type: attribute_type::INT, ..plain },
        Setting::Ints(values) => {
            AttributeProto { ints: values.to_vec(), r#type: attribute_type::INTS, ..plain }
        }
        Setting::Float(value) => AttributeProto { f: Some(value), r#type: attribute_type::FLOAT, ..plain },
        Setting::Text(text) => {
            AttributeProto { s: Some(text.as_bytes().to_vec()), r#type: attribute_type::STRING, ..plain }
        }
    }
}
