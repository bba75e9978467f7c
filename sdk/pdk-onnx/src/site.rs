//! A node in its graph: what goes in, and how it is set, whichever version of its operator it follows.

use std::sync::Arc;

use pdk_sdk::error::{Error, Result};

use crate::proto::{AttributeProto, NodeProto};
use crate::tensor::Tensor;
use crate::values::{Fact, Values};

/// A node in its graph.
pub(crate) struct Site<'a> {
    pub values: &'a Values,
    pub node: &'a NodeProto,
}

impl<'a> Site<'a> {
    pub fn new(values: &'a Values, node: &'a NodeProto) -> Self {
        Self { values, node }
    }

    /// The version of ONNX's operator set.
    pub fn opset(&self) -> i64 {
        self.values.opset
    }

    /// The name of what goes in at a place; nothing if it is left out.
    pub fn optional(&self, place: usize) -> Option<&'a str> {
        self.node.input.get(place).map(String::as_str).filter(|name| !name.is_empty())
    }

    /// The name of what goes in at a place.
    pub fn input(&self, place: usize) -> Result<&'a str> {
        self.optional(place).ok_or_else(|| Error::new(format!("its input {} is missing", place + 1)))
    }

    /// The name of what comes out at a place.
    pub fn output(&self, place: usize) -> Result<&'a str> {
        let name = self.node.output.get(place).map(String::as_str).filter(|name| !name.is_empty());
        name.ok_or_else(|| Error::new(format!("its output {} is missing", place + 1)))
    }

    /// Type and shape of what goes in.
    pub fn fact(&self, place: usize) -> Result<&'a Fact> {
        self.values.fact(self.input(place)?)
    }

    /// The shape of what goes in.
    pub fn shape(&self, place: usize) -> Result<&'a [usize]> {
        Ok(&self.fact(place)?.shape)
    }

    /// The shape of what comes out first.
    pub fn output_shape(&self) -> Result<&'a [usize]> {
        Ok(&self.fact_of_output()?.shape)
    }

    /// Type and shape of what comes out first.
    pub fn fact_of_output(&self) -> Result<&'a Fact> {
        self.values.fact(self.output(0)?)
    }

    /// The elements of what goes in, which may not depend on the image; nothing if it is left out.
    pub fn constant(&self, place: usize) -> Result<Option<Arc<Tensor>>> {
        let Some(name) = self.optional(place) else { return Ok(None) };
        match self.values.constant(name)? {
            Some(tensor) => Ok(Some(tensor)),
            None => Err(Error::new(format!("its input `{name}` has to be a constant, but is computed"))),
        }
    }

    /// Whole numbers that an input holds, or an attribute in older versions of the operator.
    pub fn ints_at(&self, place: usize, attribute: &str) -> Result<Option<Vec<i64>>> {
        match self.constant(place)? {
            Some(tensor) => Ok(Some(tensor.to_ints())),
            None => Ok(self.ints(attribute).map(<[i64]>::to_vec)),
        }
    }

    /// A number that an input holds, or an attribute in older versions of the operator.
    pub fn number_at(&self, place: usize, attribute: &str) -> Result<Option<f64>> {
        match self.constant(place)? {
            Some(tensor) if tensor.values.len() == 1 => Ok(Some(tensor.values[0])),
            Some(_) => Err(Error::new(format!("its input {} has to be one number", place + 1))),
            None => Ok(self.attribute(attribute).and_then(|attribute| attribute.f).map(f64::from)),
        }
    }

    fn attribute(&self, name: &str) -> Option<&'a AttributeProto> {
        self.node.attribute.iter().find(|attribute| attribute.name == name)
    }

    /// An attribute that is a whole number.
    pub fn int(&self, name: &str, default: i64) -> i64 {
        self.attribute(name).and_then(|attribute| attribute.i).unwrap_or(default)
    }

    /// An attribute that is a number. Those that are left out are 32-bit floats too.
    pub fn float(&self, name: &str, default: f32) -> f64 {
        self.attribute(name).and_then(|attribute| attribute.f).unwrap_or(default).into()
    }

    /// An attribute of whole numbers; nothing if it is left out.
    pub fn ints(&self, name: &str) -> Option<&'a [i64]> {
        self.attribute(name).map(|attribute| attribute.ints.as_slice())
    }

    /// An attribute that is a text.
    pub fn text(&self, name: &str, default: &'a str) -> &'a str {
        self.attribute(name)
            .and_then(|a| a.s.as_deref())
            .and_then(|s| std::str::from_utf8(s).ok())
            .unwrap_or(default)
    }

    /// An attribute of texts; nothing if it is left out.
    pub fn texts(&self, name: &str) -> Option<Vec<&'a str>> {
        let texts = self.attribute(name)?.strings.iter();
        Some(texts.map(|text| std::str::from_utf8(text).unwrap_or_default()).collect())
    }

    /// An attribute that is a tensor; nothing if it is left out.
    pub fn tensor(&self, name: &str) -> Result<Option<Tensor>> {
        self.attribute(name).and_then(|attribute| attribute.t.as_ref()).map(Tensor::from_proto).transpose()
    }

    /// Attributes of numbers, for constants.
    pub fn floats(&self, name: &str) -> Option<&'a [f32]> {
        self.attribute(name).map(|attribute| attribute.floats.as_slice())
    }

    /// The number of an attribute, if it is given.
    pub fn optional_float(&self, name: &str) -> Option<f64> {
        self.attribute(name).and_then(|attribute| attribute.f).map(f64::from)
    }

    /// The whole number of an attribute, if it is given.
    pub fn optional_int(&self, name: &str) -> Option<i64> {
        self.attribute(name).and_then(|attribute| attribute.i)
    }
}

/// The place of an axis, which may be counted from the end.
pub(crate) fn axis(axis: i64, rank: usize) -> Result<usize> {
    let counted = if axis < 0 { axis + rank as i64 } else { axis };
    usize::try_from(counted)
        .ok()
        .filter(|&axis| axis < rank)
        .ok_or_else(|| Error::new(format!("its axis {axis} is outside the {rank} axes")))
}

/// The places of axes in the order of the list, where they may be counted from the end.
pub(crate) fn axes(list: &[i64], rank: usize) -> Result<Vec<usize>> {
    let axes = list.iter().map(|&each| axis(each, rank)).collect::<Result<Vec<_>>>()?;
    match axes.iter().enumerate().any(|(place, axis)| axes[..place].contains(axis)) {
        true => Err(Error::new("one of its axes is named twice")),
        false => Ok(axes),
    }
}
