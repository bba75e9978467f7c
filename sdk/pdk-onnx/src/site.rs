//! A node in its graph: what goes in, and how it is set, whichever version of its operator it follows.

use std::sync::Arc;

use pdk_sdk::error::{Error, Result};

use crate::proto::{AttributeProto, NodeProto, attribute_type};
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
            None => Ok(self.optional_float(attribute)),
        }
    }

    fn attribute(&self, name: &str) -> Option<&'a AttributeProto> {
        self.node.attribute.iter().find(|attribute| attribute.name == name)
    }

    /// An attribute that is a whole number.
    pub fn int(&self, name: &str, default: i64) -> i64 {
        self.optional_int(name).unwrap_or(default)
    }

    /// An attribute that is a number. Those that are left out are 32-bit floats too.
    pub fn float(&self, name: &str, default: f32) -> f64 {
        self.optional_float(name).unwrap_or(default.into())
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
        let attribute = self.attribute(name)?;
        let zero = || is_zero(attribute, attribute_type::FLOAT).then_some(0.0);
        attribute.f.or_else(zero).map(f64::from)
    }

    /// The whole number of an attribute, if it is given.
    pub fn optional_int(&self, name: &str) -> Option<i64> {
        let attribute = self.attribute(name)?;
        attribute.i.or_else(|| is_zero(attribute, attribute_type::INT).then_some(0))
    }
}

/// Whether an attribute without a number is the number 0 of this type: writers in the third version of protocol buffers leave out zeros.
fn is_zero(attribute: &AttributeProto, of: i32) -> bool {
    let AttributeProto {
        name: _,
        f,
        i,
        s,
        t,
        g,
        floats,
        ints,
        strings,
        tensors,
        graphs,
        tp,
        r#type,
        ref_attr_name,
    } = attribute;
    let is_empty = f.is_none() && i.is_none() && s.is_none() && t.is_none() && g.is_none() && tp.is_none();
    let has_lists = !floats.is_empty() || !ints.is_empty() || !strings.is_empty();
    let has_lists = has_lists || !tensors.is_empty() || !graphs.is_empty();
    ref_attr_name.is_empty() && (*r#type == of || *r#type == 0 && is_empty && !has_lists)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Graph;
    use crate::testing::Sketch;

    /// The attribute `axis` as a whole number, and as a number, of a node that has this attribute.
    fn read(attribute: AttributeProto) -> (i64, f64) {
        let mut sketch = Sketch::new(13);
        sketch.input("x", &[2, 3]);
        sketch.node("Softmax", &["x"], "y", &[]);
        sketch.push_attribute(AttributeProto { name: "axis".into(), ..attribute });
        let graph = Graph::new(sketch.model(&["y"])).unwrap();
        let site = Site::new(&graph.values, &graph.nodes()[0]);
        (site.int("axis", -1), site.float("axis", -1.0))
    }

    #[test]
    fn a_number_whose_field_is_left_out_is_zero() {
        let plain = AttributeProto::default;
        assert_eq!(read(AttributeProto { r#type: attribute_type::INT, ..plain() }), (0, -1.0));
        assert_eq!(read(AttributeProto { r#type: attribute_type::FLOAT, ..plain() }), (-1, 0.0));
        assert_eq!(read(plain()), (0, 0.0));
        assert_eq!(read(AttributeProto { i: Some(1), ..plain() }), (1, -1.0));
        assert_eq!(read(AttributeProto { ints: vec![1], ..plain() }), (-1, -1.0));
        assert_eq!(read(AttributeProto { ref_attr_name: "a".into(), ..plain() }), (-1, -1.0));
    }
}
