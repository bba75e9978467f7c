//! What an ONNX file declares about what goes in and comes out.

use pdk_onnx::proto::{ModelProto, TensorTypeProto, ValueInfoProto};

/// The type of a tensor's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Element {
    /// 32-bit floats.
    Float32,
    /// 16-bit floats.
    Float16,
    /// Bytes.
    Uint8,
    /// Bytes with a sign.
    Int8,
    /// Another type, by its number in ONNX's format.
    Other(i32),
}

/// The names of layouts: batch, time, channels, height and width in their order.
pub const LAYOUTS: [&str; 5] = ["nchw", "nhwc", "ntchw", "nthwc", "ncthw"];

/// The names that the field `dtype` takes.
pub const DTYPES: [&str; 4] = ["float32", "float16", "uint8", "int8"];

impl Element {
    /// The one with this number in ONNX's format (`TensorProto.DataType`).
    pub fn of(number: i32) -> Self {
        match number {
            1 => Self::Float32,
            10 => Self::Float16,
            2 => Self::Uint8,
            3 => Self::Int8,
            other => Self::Other(other),
        }
    }

    /// Its name.
    pub fn name(self) -> String {
        match self {
            Self::Float32 => DTYPES[0].to_owned(),
            Self::Float16 => DTYPES[1].to_owned(),
            Self::Uint8 => DTYPES[2].to_owned(),
            Self::Int8 => DTYPES[3].to_owned(),
            Self::Other(6) => "int32".to_owned(),
            Self::Other(7) => "int64".to_owned(),
            Self::Other(9) => "bool".to_owned(),
            Self::Other(11) => "float64".to_owned(),
            Self::Other(number) => format!("of ONNX's type {number}"),
        }
    }
}

/// An input or an output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Port {
    /// Its name.
    pub name: String,
    /// The type of its numbers.
    pub element: Element,
    /// Its shape; none for what is not a tensor. A dimension that is left open has a name, or `?`.
    pub shape: Option<Vec<Result<usize, String>>>,
}

impl Port {
    /// Its dimensions, as far as they are fixed.
    pub fn dims(&self) -> Vec<Option<usize>> {
        self.shape.iter().flatten().map(|dim| dim.as_ref().ok().copied()).collect()
    }

    /// Its shape as it is written in papers: `(batch, 3, 120, 160)`.
    pub fn shape_text(&self) -> String {
        let dims = self.shape.iter().flatten().map(|dim| match dim {
            Ok(length) => length.to_string(),
            Err(name) => name.clone(),
        });
        format!("({})", dims.collect::<Vec<_>>().join(", "))
    }

    /// How many numbers it has if its batch is one; none if another dimension is left open.
    pub fn values(&self) -> Option<usize> {
        self.shape.as_ref()?;
        self.batch_of_one()?.iter().try_fold(1usize, |product, dim| product.checked_mul(*dim))
    }

    /// Its shape with a batch of one, if that is left open; none if another dimension is.
    pub fn batch_of_one(&self) -> Option<Vec<usize>> {
        let mut dims = self.dims();
        if let Some(first) = dims.first_mut() {
            first.get_or_insert(1);
        }
        dims.into_iter().map(|dim| dim.filter(|dim| *dim > 0)).collect()
    }
}

/// What goes into a network and comes out.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Declared {
    /// What goes in, without weights.
    pub inputs: Vec<Port>,
    /// What comes out.
    pub outputs: Vec<Port>,
}

impl Declared {
    /// What a model declares.
    pub fn of_model(model: &ModelProto) -> Self {
        let Some(graph) = &model.graph else { return Self::default() };
        // Old files list their weights among the inputs.
        let is_weight = |name: &str| graph.initializer.iter().any(|weight| weight.name == name);
        let inputs = graph.input.iter().filter(|input| !is_weight(&input.name)).map(port).collect();
        Self { inputs, outputs: graph.output.iter().map(port).collect() }
    }
}

fn port(value: &ValueInfoProto) -> Port {
    let tensor = value.tensor_type();
    let dims = |tensor: &TensorTypeProto| {
        let dims = tensor.shape.iter().flat_map(|shape| &shape.dim);
        dims.map(|dim| match (dim.dim_value, &dim.dim_param) {
            (Some(length), _) => usize::try_from(length).map_err(|_| length.to_string()),
            (None, Some(name)) => Err(name.clone()),
            (None, None) => Err("?".to_owned()),
        })
        .collect()
    };
    Port {
        name: value.name.clone(),
        element: Element::of(tensor.map_or(0, |tensor| tensor.elem_type)),
        shape: tensor.map(dims),
    }
}
