//! What the tests of this crate share: small models, made here, and the real one if it is at hand.

use std::path::{Path, PathBuf};

use pdk_onnx::Element;
use pdk_onnx::proto::{
    self as pb, DimensionProto, TensorShapeProto, TensorTypeProto, TypeProto, ValueInfoProto,
};
use prost::Message;
use tempfile::NamedTempFile;

/// A model whose outputs are weighted sums of all its input values.
pub struct Pilot {
    /// The input's shape; a word is a dimension that is left open.
    pub dims: Vec<String>,
    /// The input's type.
    pub element: Element,
    /// Name and number of values of each output.
    pub outputs: Vec<(&'static str, usize)>,
    /// The name of a second input of one number, which is added to each output.
    pub second_input: Option<&'static str>,
    /// The name of another output, which has the values of the first.
    pub copy: Option<&'static str>,
    /// The operator that flattens the image; another one makes a model that no one can run.
    pub operator: &'static str,
    /// Factor on all weights.
    pub gain: f32,
}

impl Pilot {
    /// A model with an input of this shape, and one output of steering and throttle.
    pub fn new(dims: &[&str]) -> Self {
        Self {
            dims: dims.iter().map(|&dim| dim.to_owned()).collect(),
            element: Element::FLOAT,
            outputs: vec![("control", 2)],
            second_input: None,
            copy: None,
            operator: "Flatten",
            gain: 1.0,
        }
    }

    /// The number of input values of one image.
    fn values(&self) -> usize {
        self.dims.iter().skip(1).filter_map(|dim| dim.parse::<usize>().ok()).product::<usize>().min(10_000)
    }

    /// The weight of input value `value` in the sum `column` of output `output`.
    pub fn weight(&self, output: usize, column: usize, value: usize) -> f32 {
        let step = (value * 7 + column * 13 + output * 29) % 23;
        self.gain * (step as f32 - 11.0) / 20_000.0
    }

    /// The sums for these input values.
    pub fn expected(&self, input: &[f32]) -> Vec<Vec<f64>> {
        let sum = |output, column| {
            input
                .iter()
                .enumerate()
                .map(|(i, v)| f64::from(*v) * f64::from(self.weight(output, column, i)))
                .sum()
        };
        let columns = self.outputs.iter().map(|(_, columns)| *columns).enumerate();
        columns.map(|(output, columns)| (0..columns).map(|column| sum(output, column)).collect()).collect()
    }

    /// The model as an ONNX file's content.
    pub fn bytes(&self) -> Vec<u8> {
        let values = self.values();
        let mut graph = pb::GraphProto { name: "pilot".into(), ..Default::default() };
        graph.input.push(value_info("image", self.element, &self.dims));
        if let Some(name) = self.second_input {
            graph.input.push(value_info(name, Element::FLOAT, &["1".into(), "1".into()]));
        }
        graph.node.push(node(self.operator, &["image"], "flat"));
        for (output, (name, columns)) in self.outputs.iter().enumerate() {
            let weights = (0..values * columns).map(|i| self.weight(output, i % columns, i / columns));
            graph.initializer.push(pb::TensorProto {
                name: format!("weights_{output}"),
                dims: vec![values as i64, *columns as i64],
                data_type: Element::FLOAT.0,
                raw_data: weights.flat_map(f32::to_le_bytes).collect::<Vec<u8>>(),
                ..Default::default()
            });
            let weights = format!("weights_{output}");
            match self.second_input {
                None => graph.node.push(node("MatMul", &["flat", &weights], name)),
                Some(second) => {
                    let sum = format!("sum_{output}");
                    graph.node.push(node("MatMul", &["flat", &weights], &sum));
                    graph.node.push(node("Add", &[&sum, second], name));
                }
            }
            graph.output.push(value_info(name, Element::FLOAT, &[self.dims[0].clone(), columns.to_string()]));
        }
        if let Some(copy) = self.copy {
            let (of, columns) = self.outputs[0];
            graph.node.push(node("Identity", &[of], copy));
            graph.output.push(value_info(copy, Element::FLOAT, &[self.dims[0].clone(), columns.to_string()]));
        }
        let opset = pb::OperatorSetIdProto { version: 17, ..Default::default() };
        let model = pb::ModelProto {
            ir_version: 8,
            opset_import: vec![opset],
            graph: Some(graph),
            ..Default::default()
        };
        model.encode_to_vec()
    }

    /// The model as a file.
    pub fn file(&self) -> NamedTempFile {
        let file = NamedTempFile::with_suffix(".onnx").unwrap();
        std::fs::write(file.path(), self.bytes()).unwrap();
        file
    }
}

fn node(operator: &str, inputs: &[&str], output: &str) -> pb::NodeProto {
    pb::NodeProto {
        op_type: operator.into(),
        name: output.into(),
        input: inputs.iter().map(|&input| input.into()).collect(),
        output: vec![output.into()],
        ..Default::default()
    }
}

fn value_info(name: &str, element: Element, dims: &[String]) -> ValueInfoProto {
    let dim = dims.iter().map(|dim| match dim.parse() {
        Ok(value) => DimensionProto { dim_value: Some(value), dim_param: None },
        Err(_) => DimensionProto { dim_value: None, dim_param: Some(dim.clone()) },
    });
    let shape = Some(TensorShapeProto { dim: dim.collect() });
    let tensor_type = Some(TensorTypeProto { elem_type: element.0, shape });
    ValueInfoProto { name: name.into(), r#type: Some(TypeProto { tensor_type }) }
}

/// A file or folder of the data that lies outside the repository; says so if it is not there.
pub fn shared(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("PDK_TEST_DATA")
        .map(PathBuf::from)
        .unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"));
    let found = [root.join(name), root.join("data").join(name)].into_iter().find(|path| path.exists());
    if found.is_none() {
        println!("skipped: there is no `{name}` under {}", root.display());
    }
    found
}
