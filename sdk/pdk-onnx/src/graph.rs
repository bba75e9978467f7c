//! A model's graph with the type and shape of every value, as far as they follow from the inputs.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use pdk_sdk::error::{Error, Result};

use crate::bodies;
use crate::proto::{GraphProto, ModelProto, NodeProto, OperatorSetIdProto, ValueInfoProto};
use crate::shapes::Shapes;
use crate::site::Site;
use crate::tensor::{Element, Tensor, elements};
use crate::values::{Fact, SMALL, Source, Value, Values};

/// A graph whose values are known by type and shape.
#[derive(Clone)]
pub struct Graph {
    ir_version: i64,
    imports: Vec<OperatorSetIdProto>,
    functions: Vec<Vec<u8>>,
    inputs: Vec<ValueInfoProto>,
    outputs: Vec<String>,
    nodes: Vec<NodeProto>,
    /// The values around them that the bodies of control flow use, by the place of the node that has the bodies.
    captured: HashMap<usize, Vec<String>>,
    sparse: Vec<Vec<u8>>,
    /// What the file declares about values whose operator is not known here.
    declared: HashMap<String, Fact>,
    /// What is known of an operator, by a node that has it.
    shapes: fn(&NodeProto) -> Option<&'static Shapes>,
    /// What is known of every value.
    pub(crate) values: Values,
}

impl Graph {
    /// Reads the graph of a model, whose operators `shapes` knows. A batch that is left open is one.
    ///
    /// # Errors
    /// If the graph contradicts itself, or an input leaves more than its batch open.
    pub(crate) fn with(model: ModelProto, shapes: fn(&NodeProto) -> Option<&'static Shapes>) -> Result<Self> {
        let proto = model.graph.unwrap_or_default();
        let own = |domain: &str| domain.is_empty() || domain == "ai.onnx";
        let opset =
            model.opset_import.iter().find(|import| own(&import.domain)).map_or(1, |import| import.version);
        let weights: HashSet<&str> = proto.initializer.iter().map(|tensor| tensor.name.as_str()).collect();
        // Old files list their weights among the inputs.
        let inputs =
            proto.input.iter().filter(|input| !weights.contains(input.name.as_str())).cloned().collect();
        let mut graph = Self {
            // From version 4 on, weights need not be inputs.
            ir_version: model.ir_version.max(4),
            imports: model.opset_import,
            functions: model.functions,
            inputs,
            outputs: proto.output.iter().map(|output| output.name.clone()).collect(),
            declared: declared(&proto),
            sparse: proto.sparse_initializer,
            nodes: Vec::with_capacity(proto.node.len()),
            captured: HashMap::new(),
            shapes,
            values: Values::new(opset),
        };
        for input in graph.inputs.clone() {
            let fact = input_fact(&input)?;
            graph
                .values
                .define(&input.name, Value { fact: Ok(fact), constant: None, source: Source::Input })?;
        }
        for tensor in proto.initializer {
            graph.values.add_initializer(tensor)?;
        }
        for node in proto.node {
            graph.add_node(node)?;
        }
        for output in &graph.outputs {
            if !graph.values.contains(output) {
                return Err(Error::new(format!("nothing computes its output `{output}`")));
            }
        }
        Ok(graph)
    }

    /// Adds an input.
    ///
    /// # Errors
    /// If its name is taken.
    pub(crate) fn add_input(&mut self, name: &str, fact: Fact) -> Result<()> {
        self.inputs.push(ValueInfoProto::tensor(name, fact.element.0, &fact.shape));
        self.values.define(name, Value { fact: Ok(fact), constant: None, source: Source::Input })
    }

    /// Adds a node; everything that goes in has to be there.
    ///
    /// # Errors
    /// If something that goes in is not there, or a name is taken.
    pub(crate) fn add_node(&mut self, node: NodeProto) -> Result<()> {
        for input in node.input.iter().filter(|input| !input.is_empty()) {
            if !self.values.contains(input) {
                let node = describe(&node);
                return Err(Error::new(format!("{node} needs `{input}`, which nothing before it computes")));
            }
        }
        let facts = self.facts_of(&node);
        let source = Source::Node(self.nodes.len());
        for (place, output) in node.output.iter().enumerate().filter(|(_, output)| !output.is_empty()) {
            let fact = match (&facts, self.declared.get(output)) {
                (Ok(facts), _) if place < facts.len() => Ok(facts[place].clone()),
                (_, Some(declared)) => Ok(declared.clone()),
                (Err(error), None) => Err(error.clone()),
                (Ok(_), None) => Err(Error::new(format!("{} has one output too many", describe(&node)))),
            };
            self.values.define(output, Value { fact, constant: None, source })?;
        }
        if let Ok(facts) = &facts {
            self.fold(&node, facts);
        }
        let captured = bodies::captured(&node);
        if !captured.is_empty() {
            self.captured.insert(self.nodes.len(), captured);
        }
        self.nodes.push(node);
        Ok(())
    }

    /// The facts of what a node computes.
    fn facts_of(&self, node: &NodeProto) -> Result<Vec<Fact>> {
        // If something that goes in is not known, its reason is the reason.
        for input in node.input.iter().filter(|input| !input.is_empty()) {
            self.fact(input)?;
        }
        let operator = (self.shapes)(node).ok_or_else(|| {
            Error::new(format!("the shape of what {} computes is not known", describe(node)))
        })?;
        let facts =
            (operator.infer)(&Site::new(&self.values, node)).map_err(|error| error.at(describe(node)))?;
        for fact in &facts {
            elements(&fact.shape).map_err(|error| error.at(describe(node)))?;
        }
        Ok(facts)
    }

    /// Keeps what a node computes, if that follows from small constants alone. It is rounded to its type, because shapes follow from it: 0.7 times
    /// 10 is 7 in 32-bit floats and less in 64-bit ones.
    fn fold(&mut self, node: &NodeProto, facts: &[Fact]) {
        let Some(operator) = (self.shapes)(node) else { return };
        if facts.iter().any(|fact| fact.shape.iter().product::<usize>() > SMALL) {
            return;
        }
        let inputs = self.values.constants(&node.input);
        let known = node.input.iter().zip(&inputs).all(|(name, tensor)| name.is_empty() || tensor.is_some());
        if !known && !operator.needs_only_shapes {
            return;
        }
        let inputs: Vec<Option<&Tensor>> = inputs.iter().map(Option::as_deref).collect();
        // A value that cannot be computed is not a constant, and the code that needs one reports it.
        let Ok(tensors) = (operator.evaluate)(&Site::new(&self.values, node), &inputs) else { return };
        for (name, tensor) in node.output.iter().zip(tensors) {
            self.values.keep(name, tensor.rounded());
        }
    }

    /// The version of ONNX's operator set.
    pub fn opset(&self) -> i64 {
        self.values.opset
    }

    /// What goes in, without weights.
    pub fn inputs(&self) -> impl Iterator<Item = &str> {
        self.inputs.iter().map(|input| input.name.as_str())
    }

    /// What comes out.
    pub fn outputs(&self) -> &[String] {
        &self.outputs
    }

    /// The nodes, in an order in which they can be computed.
    pub fn nodes(&self) -> &[NodeProto] {
        &self.nodes
    }

    /// Type and shape of a value.
    ///
    /// # Errors
    /// If the value is missing, or why they are not known.
    pub fn fact(&self, name: &str) -> Result<&Fact> {
        self.values.fact(name)
    }

    /// The elements of a value; none if they depend on the inputs, or are many and are not in the file.
    ///
    /// # Errors
    /// If the constant in the file contradicts itself.
    pub fn constant(&self, name: &str) -> Result<Option<Arc<Tensor>>> {
        self.values.constant(name)
    }

    /// Where a value comes from.
    pub fn source(&self, name: &str) -> Option<Source> {
        self.values.source(name)
    }

    /// The values that the node at a place uses: what goes in, in order, and then what its bodies use of the values around them.
    pub(crate) fn uses(&self, place: usize) -> impl Iterator<Item = &str> {
        let captured = self.captured.get(&place).into_iter().flatten();
        self.nodes[place].input.iter().chain(captured).map(String::as_str)
    }

    /// The nodes that are needed to compute these values from the inputs and from `given`.
    pub(crate) fn needed(&self, values: &[&str], given: &HashSet<&str>) -> Vec<bool> {
        let mut needed = vec![false; self.nodes.len()];
        let mut open: Vec<&str> = values.to_vec();
        while let Some(name) = open.pop() {
            if let Some(Source::Node(place)) = self.source(name).filter(|_| !given.contains(name))
                && !std::mem::replace(&mut needed[place], true)
            {
                open.extend(self.uses(place));
            }
        }
        needed
    }

    /// The values that change when `name` changes, itself among them.
    pub(crate) fn dependents(&self, name: &str) -> HashSet<&str> {
        let mut dependents = HashSet::from_iter(self.values.name(name));
        for (place, node) in self.nodes.iter().enumerate() {
            if self.uses(place).any(|name| dependents.contains(name)) {
                dependents.extend(node.output.iter().map(String::as_str).filter(|output| !output.is_empty()));
            }
        }
        dependents
    }

    /// A model that computes these values, with as few nodes as that takes.
    ///
    /// # Errors
    /// If the type or shape of one of them is not known.
    pub fn model(&self, outputs: &[&str]) -> Result<ModelProto> {
        // Bodies of control flow may use any value, without naming it in the node.
        let whole = self
            .nodes
            .iter()
            .any(|node| node.attribute.iter().any(|a| a.g.is_some() || !a.graphs.is_empty()));
        let needed = match whole {
            true => vec![true; self.nodes.len()],
            false => self.needed(outputs, &HashSet::new()),
        };
        let node: Vec<_> = self
            .nodes
            .iter()
            .zip(needed)
            .filter(|(_, needed)| *needed)
            .map(|(node, _)| node.clone())
            .collect();
        let used: HashSet<&str> = node
            .iter()
            .flat_map(|node| &node.input)
            .map(String::as_str)
            .chain(outputs.iter().copied())
            .collect();
        let initializers =
            self.values.initializers.iter().filter(|tensor| whole || used.contains(tensor.name.as_str()));
        let output = outputs.iter().map(|name| {
            let fact = self.fact(name)?;
            Ok(ValueInfoProto::tensor(name, fact.element.0, &fact.shape))
        });
        let input = self.inputs.iter().map(|input| {
            let fact = self.fact(&input.name)?;
            Ok(ValueInfoProto::tensor(&input.name, fact.element.0, &fact.shape))
        });
        let graph = GraphProto {
            name: "pdk".to_owned(),
            input: input.collect::<Result<_>>()?,
            output: output.collect::<Result<_>>()?,
            initializer: initializers.cloned().collect(),
            sparse_initializer: self.sparse.clone(),
            node,
            value_info: Vec::new(),
        };
        Ok(ModelProto {
            ir_version: self.ir_version,
            producer_name: "pdk".to_owned(),
            opset_import: self.imports.clone(),
            functions: self.functions.clone(),
            graph: Some(graph),
        })
    }
}

/// A node by name and operator, for messages.
pub(crate) fn describe(node: &NodeProto) -> String {
    let name = match (node.name.as_str(), node.output.iter().find(|output| !output.is_empty())) {
        ("", Some(output)) => output,
        (name, _) => name,
    };
    format!("node `{name}` ({})", node.op_type)
}

/// Type and shape of an input, whose batch may be left open.
fn input_fact(input: &ValueInfoProto) -> Result<Fact> {
    let name = &input.name;
    let tensor =
        input.tensor_type().ok_or_else(|| Error::new(format!("its input `{name}` is not a tensor")))?;
    let open = || {
        Error::new(format!(
            "its input `{name}` has the shape {}, in which more than the batch is open; export the model with a fixed size",
            tensor.shape_text()
        ))
    };
    let dims = tensor.shape.as_ref().ok_or_else(open)?.dim.iter().enumerate();
    let shape = dims.map(|(place, dim)| match dim.dim_value {
        Some(value) if value > 0 => Ok(value as usize),
        _ if place == 0 => Ok(1),
        _ => Err(open()),
    });
    let shape = shape.collect::<Result<Vec<_>>>()?;
    elements(&shape).map_err(|error| error.at(format!("its input `{name}`")))?;
    Ok(Fact::new(Element(tensor.elem_type), shape))
}

/// What a file declares about the values between inputs and outputs, where it leaves nothing open.
fn declared(proto: &GraphProto) -> HashMap<String, Fact> {
    let facts = proto.value_info.iter().chain(&proto.output).filter_map(|value| {
        let tensor = value.tensor_type()?;
        let dims = tensor
            .shape
            .as_ref()?
            .dim
            .iter()
            .map(|dim| dim.dim_value.and_then(|dim| usize::try_from(dim).ok()));
        Some((value.name.clone(), Fact::new(Element(tensor.elem_type), dims.collect::<Option<Vec<_>>>()?)))
    });
    facts.collect()
}
