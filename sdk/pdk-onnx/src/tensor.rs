//! Tensors with known elements, held as 64-bit floats whatever their type.

use pdk_sdk::error::{Error, Result};

use crate::bytes;
pub use crate::element::Element;
use crate::proto::TensorProto;

/// The most elements that a tensor may have: more than any driving model needs, and a damaged file may say anything.
const MAX_ELEMENTS: usize = 1 << 30;

/// The number of elements of a shape.
///
/// # Errors
/// If there are too many.
pub fn elements(shape: &[usize]) -> Result<usize> {
    let product = shape.iter().try_fold(1usize, |product, &dim| product.checked_mul(dim));
    product
        .filter(|&product| product <= MAX_ELEMENTS)
        .ok_or_else(|| Error::new(format!("a tensor of the shape {} is too large", shape_text(shape))))
}

/// A shape as it is written in papers: `(1, 3, 120, 160)`.
pub fn shape_text(shape: &[usize]) -> String {
    format!("({})", shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "))
}

/// A tensor with known elements.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    /// The type of the elements.
    pub element: Element,
    /// The shape.
    pub shape: Vec<usize>,
    /// The elements, the last dimension fastest. Integers are exact up to 2^53.
    pub values: Vec<f64>,
}

impl Tensor {
    /// 32-bit floats.
    pub fn floats(shape: &[usize], values: Vec<f64>) -> Self {
        Self { element: Element::FLOAT, shape: shape.to_vec(), values }
    }

    /// 64-bit integers in one dimension.
    pub fn ints(values: &[i64]) -> Self {
        Self {
            element: Element::INT64,
            shape: vec![values.len()],
            values: values.iter().map(|&value| value as f64).collect(),
        }
    }

    /// The same number everywhere.
    ///
    /// # Errors
    /// If the shape is too large.
    pub fn filled(element: Element, shape: &[usize], value: f64) -> Result<Self> {
        Ok(Self { element, shape: shape.to_vec(), values: vec![value; elements(shape)?] })
    }

    /// An element of `shape` for each position, in order.
    ///
    /// # Errors
    /// If the shape is too large.
    pub fn from_fn(
        element: Element,
        shape: &[usize],
        mut value: impl FnMut(&[usize]) -> f64,
    ) -> Result<Self> {
        let mut values = Vec::with_capacity(elements(shape)?);
        for_each_position(shape, |position| values.push(value(position)));
        Ok(Self { element, shape: shape.to_vec(), values })
    }

    /// The elements as whole numbers.
    pub fn to_ints(&self) -> Vec<i64> {
        self.values.iter().map(|&value| value as i64).collect()
    }

    /// The element at a position of a shape that this one is broadcast to.
    pub fn broadcast_at(&self, position: &[usize]) -> f64 {
        let skipped = position.len() - self.shape.len();
        let index = self
            .shape
            .iter()
            .zip(&position[skipped..])
            .fold(0, |index, (&dim, &at)| index * dim + if dim == 1 { 0 } else { at });
        self.values[index]
    }

    /// Reads a constant.
    ///
    /// # Errors
    /// If its shape and its data contradict each other, or it holds no numbers.
    pub fn from_proto(proto: &TensorProto) -> Result<Self> {
        let element = Element(proto.data_type);
        let shape = dims(proto)?;
        let count = elements(&shape)?;
        let values: Vec<f64> = if proto.raw_data.is_empty() {
            match element.0 {
                1 => proto.float_data.iter().map(|&value| f64::from(value)).collect(),
                11 => proto.double_data.clone(),
                7 => proto.int64_data.iter().map(|&value| value as f64).collect(),
                12 | 13 => proto.uint64_data.iter().map(|&value| value as f64).collect(),
                10 | 16..=20 => {
                    let bits = proto.int32_data.iter();
                    bits.map(|&bits| bytes::float(element, bits as u16).unwrap_or(f64::NAN)).collect()
                }
                21 | 22 => bytes::nibbles(element, proto.int32_data.iter().map(|&byte| byte as u8), count),
                2..=6 | 9 => proto.int32_data.iter().map(|&value| f64::from(value)).collect(),
                _ => return Err(Error::new(format!("its elements are {element}, but have to be numbers"))),
            }
        } else if bytes::is_packed(element) {
            if proto.raw_data.len() != count.div_ceil(2) {
                return Err(contradiction(&shape, proto.raw_data.len() * 2));
            }
            bytes::nibbles(element, proto.raw_data.iter().copied(), count)
        } else {
            let size = bytes::width(element)
                .ok_or_else(|| Error::new(format!("its elements are {element}, but have to be numbers")))?;
            if proto.raw_data.len() != count * size {
                return Err(contradiction(&shape, proto.raw_data.len() / size));
            }
            proto.raw_data.chunks_exact(size).map(|read| bytes::read(element, read)).collect()
        };
        if values.len() != count {
            return Err(contradiction(&shape, values.len()));
        }
        Ok(Self { element, shape, values })
    }

    /// The tensor with each element as its type holds it.
    pub(crate) fn rounded(mut self) -> Self {
        if self.element != Element::DOUBLE {
            self.values.iter_mut().for_each(|value| *value = self.element.rounded(*value));
        }
        self
    }

    /// Whether each element is as its type holds it.
    pub(crate) fn is_rounded(&self) -> bool {
        let is_rounded = |value: &f64| value.is_nan() || self.element.rounded(*value) == *value;
        self.element == Element::DOUBLE || self.values.iter().all(is_rounded)
    }

    /// What [`Self::rounded`] gives, but 32-bit floats keep the digits of the 64-bit floats that they are computed as: so differences show slopes.
    pub(crate) fn fitted(self) -> Self {
        if self.element == Element::FLOAT { self } else { self.rounded() }
    }

    /// Writes a constant.
    pub fn to_proto(&self, name: &str) -> TensorProto {
        TensorProto {
            name: name.to_owned(),
            dims: self.shape.iter().map(|&dim| dim as i64).collect(),
            data_type: self.element.0,
            raw_data: bytes::bytes(self.element, &self.values),
            ..TensorProto::default()
        }
    }
}

/// The shape of a constant.
///
/// # Errors
/// If a dimension is negative.
pub fn dims(proto: &TensorProto) -> Result<Vec<usize>> {
    let shape = proto.dims.iter().map(|&dim| usize::try_from(dim)).collect::<Result<Vec<_>, _>>();
    shape.map_err(|_| Error::new(format!("its shape is {:?}, but cannot be negative", proto.dims)))
}

fn contradiction(shape: &[usize], found: usize) -> Error {
    Error::new(format!("it holds {found} numbers, which is not what its shape {} says", shape_text(shape)))
}

/// Calls `visit` with each position of a shape, the last dimension fastest.
pub fn for_each_position(shape: &[usize], mut visit: impl FnMut(&[usize])) {
    if shape.contains(&0) {
        return;
    }
    let mut position = vec![0; shape.len()];
    loop {
        visit(&position);
        let Some(axis) = (0..shape.len()).rev().find(|&axis| position[axis] + 1 < shape[axis]) else {
            return;
        };
        position[axis] += 1;
        position[axis + 1..].fill(0);
    }
}

/// The shape that several are broadcast to.
///
/// # Errors
/// If they do not go together.
pub fn broadcast(shapes: &[&[usize]]) -> Result<Vec<usize>> {
    let rank = shapes.iter().map(|shape| shape.len()).max().unwrap_or(0);
    let mut result = vec![1; rank];
    for shape in shapes {
        for (into, &dim) in result[rank - shape.len()..].iter_mut().zip(*shape) {
            if *into == 1 {
                *into = dim;
            } else if dim != 1 && dim != *into {
                let texts: Vec<_> = shapes.iter().map(|shape| shape_text(shape)).collect();
                return Err(Error::new(format!("the shapes {} do not go together", texts.join(" and "))));
            }
        }
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_are_read_from_each_place_that_may_hold_them() {
        let raw = Tensor::floats(&[2, 2], vec![1.0, -2.5, 0.0, 7.0]);
        assert_eq!(Tensor::from_proto(&raw.to_proto("w")).unwrap(), raw);
        let listed = TensorProto {
            dims: vec![2, 2],
            data_type: 1,
            float_data: vec![1.0, -2.5, 0.0, 7.0],
            ..Default::default()
        };
        assert_eq!(Tensor::from_proto(&listed).unwrap(), raw);
        for values in [vec![i64::from(i32::MIN), 0, 5], vec![]] {
            let ints = Tensor::ints(&values);
            assert_eq!(Tensor::from_proto(&ints.to_proto("i")).unwrap().to_ints(), values);
        }
        for (number, values) in
            [(2, [0.0, 255.0]), (3, [-128.0, 127.0]), (5, [-300.0, 3.0]), (13, [5.0, 1e15])]
        {
            let small = Tensor { element: Element(number), shape: vec![2], values: values.to_vec() };
            assert_eq!(Tensor::from_proto(&small.to_proto("s")).unwrap(), small);
        }
        let quarters =
            TensorProto { dims: vec![3], data_type: 22, raw_data: vec![0x71, 0x0f], ..Default::default() };
        assert_eq!(Tensor::from_proto(&quarters).unwrap().values, [1.0, 7.0, -1.0]);
        let halves = TensorProto {
            dims: vec![4],
            data_type: 10,
            int32_data: vec![0x3c00, 0xc100, 0x0001, 0x7c00],
            ..Default::default()
        };
        assert_eq!(Tensor::from_proto(&halves).unwrap().values, [1.0, -2.5, 2f64.powi(-24), f64::INFINITY]);
    }

    #[test]
    fn constants_that_contradict_themselves_are_refused() {
        let error = |proto: &TensorProto| Tensor::from_proto(proto).unwrap_err().to_string();
        let short = TensorProto { dims: vec![3], data_type: 1, raw_data: vec![0; 8], ..Default::default() };
        assert_eq!(error(&short), "it holds 2 numbers, which is not what its shape (3) says");
        let negative = TensorProto { dims: vec![-3], data_type: 1, ..Default::default() };
        assert!(error(&negative).contains("negative"));
        let huge = TensorProto { dims: vec![1 << 40, 1 << 40], data_type: 1, ..Default::default() };
        assert!(error(&huge).contains("too large"));
        let packed = TensorProto { dims: vec![3], data_type: 22, raw_data: vec![0; 3], ..Default::default() };
        assert_eq!(error(&packed), "it holds 6 numbers, which is not what its shape (3) says");
        let text =
            TensorProto { dims: vec![1], data_type: 8, string_data: vec![vec![65]], ..Default::default() };
        assert!(error(&text).contains("STRING"));
    }

    #[test]
    fn shapes_are_broadcast_from_the_right() {
        assert_eq!(broadcast(&[&[3, 1], &[2, 1, 4], &[]]).unwrap(), [2, 3, 4]);
        let error = broadcast(&[&[3], &[2]]).unwrap_err().to_string();
        assert_eq!(error, "the shapes (3) and (2) do not go together");
        let column = Tensor::floats(&[2, 1], vec![1.0, 2.0]);
        assert_eq!([column.broadcast_at(&[5, 1, 7]), column.broadcast_at(&[0, 0, 2])], [2.0, 1.0]);
    }
}
