//! Where on the image the cells of a layer look.
//!
//! The middle of a cell's receptive field lies where the windows before it put it: without padding, the first cell does not
//! look at the edge of the image, but half a receptive field away from it. So a map over the cells is not a picture that only
//! has to be stretched.

use std::collections::HashMap;

use pdk_sdk::error::Result;

use crate::graph::Graph;
use crate::operators::{conv, conv_transpose, layout, max_pool, pad, resize, slice};
use crate::proto::NodeProto;
use crate::site::{Site, axis};
use crate::window::Window;

/// An axis of the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageAxis {
    /// Downwards.
    Height,
    /// To the right.
    Width,
}

/// Where the cells along an axis of a layer look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Along which axis of the image.
    pub along: ImageAxis,
    /// Where the middle of the first cell's receptive field lies, in pixels; 0 is the middle of the first pixel.
    pub start: f64,
    /// From the middle of one cell's receptive field to that of the next, in pixels.
    pub step: f64,
    /// The length of a cell's receptive field, in pixels.
    pub size: f64,
}

impl Look {
    /// Moves along the axis by windows of `kernel` elements, `dilation` apart, of which the first begins `before` the axis.
    fn windows(self, kernel: usize, dilation: usize, stride: f64, before: usize) -> Self {
        let reach = (kernel.saturating_sub(1) * dilation) as f64;
        let start = self.start + self.step * (reach / 2.0 - before as f64);
        Self { start, size: self.size + self.step.abs() * reach, step: self.step * stride, ..self }
    }

    /// The reverse of [`Self::windows`].
    fn spread(self, kernel: usize, dilation: usize, stride: f64, before: usize) -> Self {
        let reach = (kernel.saturating_sub(1) * dilation) as f64;
        let start = self.start + self.step * (before as f64 - reach / 2.0) / stride;
        Self { start, size: self.size + self.step.abs() * reach / stride, step: self.step / stride, ..self }
    }
}

/// What each axis of a value looks along; nothing for channels, and where the order is lost.
pub type Looks = Vec<Option<Look>>;

/// Where the cells of every value look, by the value's name. `height` and `width` are the axes of the input that is the
/// image.
pub fn looks(graph: &Graph, image: &str, height: usize, width: usize) -> HashMap<String, Looks> {
    let Ok(fact) = graph.fact(image) else { return HashMap::new() };
    let pixel = |along| Some(Look { along, start: 0.0, step: 1.0, size: 1.0 });
    let mut first = vec![None; fact.shape.len()];
    for (axis, along) in [(height, ImageAxis::Height), (width, ImageAxis::Width)] {
        if let Some(look) = first.get_mut(axis) {
            *look = pixel(along);
        }
    }
    let mut known = HashMap::from([(image.to_owned(), first)]);
    for node in graph.nodes() {
        for output in node.output.iter().filter(|output| !output.is_empty()) {
            // What cannot be followed is left out: its cells have no place on the image.
            let looks = follow(&Site::new(&graph.values, node), &known).ok().flatten();
            if let Some(looks) = looks.filter(|looks| looks.iter().any(Option::is_some)) {
                known.insert(output.clone(), looks);
            }
        }
    }
    known
}

/// Changes each axis of the image by the windows along it; behind a window nothing looks along the batch or the channels.
fn along_windows(looks: &mut Looks, window: &Window, change: fn(Look, usize, usize, f64, usize) -> Look) {
    for (axis, look) in looks.iter_mut().enumerate() {
        *look = look.filter(|_| axis >= 2).map(|look| {
            let axis = axis - 2;
            let (kernel, dilation) = (window.kernel[axis], window.dilations[axis]);
            change(look, kernel, dilation, window.strides[axis] as f64, window.before[axis])
        });
    }
}

/// Where what a node computes looks; nothing if the order of the cells is lost.
fn follow(site: &Site<'_>, known: &HashMap<String, Looks>) -> Result<Option<Looks>> {
    let node = site.node;
    let Some(first) = site.optional(0).and_then(|name| known.get(name)) else {
        return Ok(widest(site, known));
    };
    let mut looks = first.clone();
    match node.op_type.as_str() {
        "Conv" | "MaxPool" | "AveragePool" => {
            let window = if node.op_type == "Conv" { conv::window(site)?.0 } else { max_pool::window(site)? };
            along_windows(&mut looks, &window, Look::windows);
        }
        "ConvTranspose" => along_windows(&mut looks, &conv_transpose::window(site)?.0, Look::spread),
        "Pad" => {
            for (look, (before, _)) in looks.iter_mut().flatten().zip(padded_axes(site, first)?) {
                look.start -= look.step * before as f64;
            }
        }
        "Slice" => {
            for (axis, places) in slice::kept(site)? {
                let step = places.windows(2).next().map_or(1.0, |pair| pair[1] as f64 - pair[0] as f64);
                looks[axis] = looks[axis].zip(places.first()).map(|(look, &at)| Look {
                    start: look.start + look.step * at as f64,
                    step: look.step * step,
                    ..look
                });
            }
        }
        "Resize" | "Upsample" => {
            for (axis, ((scale, size), &length)) in
                resize::scales(site)?.into_iter().zip(site.shape(0)?).enumerate()
            {
                if let Some(look) = &mut looks[axis]
                    && (size != length || scale != 1.0)
                {
                    let origin = |at| resize::origin(site, at, scale, length, size, std::convert::identity);
                    let (zero, one) = (origin(0)?, origin(1)?);
                    look.start += look.step * zero;
                    look.step *= one - zero;
                    look.size += look.step.abs();
                }
            }
        }
        "Transpose" => looks = layout::order(site)?.into_iter().map(|axis| first[axis]).collect(),
        "Split" => looks[axis(site.int("axis", 0), first.len())?] = None,
        "Reshape" | "Squeeze" | "Unsqueeze" | "Flatten" => {
            return Ok(renamed(site.shape(0)?, site.output_shape()?, first));
        }
        "Concat" => {
            let Some(mut looks) = widest(site, known) else { return Ok(None) };
            looks[axis(site.int("axis", 1), first.len())?] = None;
            return Ok(Some(looks));
        }
        _ if leaves_places(node) => return Ok(widest(site, known)),
        _ => return Ok(None),
    }
    Ok(Some(looks))
}

/// The pads of the axes that have a place on the image.
fn padded_axes(site: &Site<'_>, looks: &Looks) -> Result<Vec<(i64, i64)>> {
    Ok(pad::pads(site)?
        .into_iter()
        .zip(looks)
        .filter(|(_, look)| look.is_some())
        .map(|(pads, _)| pads)
        .collect())
}

/// Whether each element of what a node computes has the place of the elements that it comes from.
fn leaves_places(node: &NodeProto) -> bool {
    matches!(
        node.op_type.as_str(),
        "Add"
            | "Sub"
            | "Mul"
            | "Div"
            | "Pow"
            | "Sum"
            | "Mean"
            | "Min"
            | "Max"
            | "Mod"
            | "BitShift"
            | "BitwiseAnd"
            | "BitwiseOr"
            | "BitwiseXor"
            | "BitwiseNot"
            | "Xor"
            | "IsNaN"
            | "IsInf"
            | "Where"
            | "Sqrt"
            | "Neg"
            | "Abs"
            | "Exp"
            | "Log"
            | "Tanh"
            | "Sigmoid"
            | "Erf"
            | "Reciprocal"
            | "Sin"
            | "Cos"
            | "Tan"
            | "Asin"
            | "Acos"
            | "Atan"
            | "Sinh"
            | "Cosh"
            | "Asinh"
            | "Acosh"
            | "Atanh"
            | "Relu"
            | "LeakyRelu"
            | "PRelu"
            | "Elu"
            | "Celu"
            | "Selu"
            | "ThresholdedRelu"
            | "Shrink"
            | "Mish"
            | "Swish"
            | "HardSigmoid"
            | "HardSwish"
            | "Softplus"
            | "Softsign"
            | "Clip"
            | "Gelu"
            | "Identity"
            | "Dropout"
            | "Cast"
            | "CastLike"
            | "QuantizeLinear"
            | "DequantizeLinear"
            | "BatchNormalization"
            | "LayerNormalization"
            | "InstanceNormalization"
            | "GroupNormalization"
            | "MeanVarianceNormalization"
            | "RMSNormalization"
            | "LpNormalization"
            | "Softmax"
            | "LogSoftmax"
            | "Hardmax"
            | "LRN"
    )
}

/// Of all that goes in, broadcast, the cells with the largest receptive field along each axis.
fn widest(site: &Site<'_>, known: &HashMap<String, Looks>) -> Option<Looks> {
    if !leaves_places(site.node) && site.node.op_type != "Concat" {
        return None;
    }
    let inputs: Vec<_> = site.node.input.iter().filter_map(|name| known.get(name)).collect();
    let rank = inputs.iter().map(|looks| looks.len()).max()?;
    let mut widest: Looks = vec![None; rank];
    for looks in inputs {
        for (into, look) in widest[rank - looks.len()..].iter_mut().zip(looks) {
            let larger = look.is_some_and(|look| into.is_none_or(|into: Look| look.size > into.size));
            if larger {
                *into = *look;
            }
        }
    }
    Some(widest)
}

/// The looks where axes of the length 1 come or go; nothing if other axes change.
fn renamed(from: &[usize], to: &[usize], looks: &Looks) -> Option<Looks> {
    let mut rest = from.iter().zip(looks).filter(|(dim, _)| **dim != 1);
    let mut renamed = Vec::with_capacity(to.len());
    for &dim in to {
        renamed.push(match dim {
            1 => None,
            _ => match rest.next() {
                Some((&before, look)) if before == dim => *look,
                _ => return None,
            },
        });
    }
    rest.next().is_none().then_some(renamed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Setting::{Int, Ints, Text};
    use crate::testing::{Setting, Sketch};

    fn look(build: impl Fn(&mut Sketch), shape: &[usize]) -> Option<[(f64, f64, f64); 2]> {
        let mut sketch = Sketch::new(13);
        sketch.input("x", shape);
        build(&mut sketch);
        let graph = Graph::new(sketch.model(&["y"])).unwrap();
        let looks = looks(&graph, "x", 2, 3);
        let found = |along| {
            looks
                .get("y")?
                .iter()
                .flatten()
                .find(|look| look.along == along)
                .map(|look| (look.start, look.step, look.size))
        };
        Some([found(ImageAxis::Height)?, found(ImageAxis::Width)?])
    }

    fn conv(s: &mut Sketch, from: &str, to: &str, kernel: usize, settings: &[(&str, Setting<'_>)]) {
        let weights = s.drawn(&[1, 1, kernel, kernel], -1.0, 1.0);
        s.node("Conv", &[from, &weights], to, settings);
    }

    #[test]
    fn cells_of_a_valid_convolution_look_away_from_the_edge() {
        let stride = [("strides", Ints(&[2, 2]))];
        let found = look(
            |s| {
                conv(s, "x", "a", 5, &stride);
                conv(s, "a", "r", 5, &stride);
                s.node("Relu", &["r"], "y", &[]);
            },
            &[1, 1, 40, 60],
        );
        // The first window reaches from 0 to 4, the second covers five of those, two apart.
        assert_eq!(found, Some([(6.0, 4.0, 13.0); 2]));
        let same = look(|s| conv(s, "x", "y", 3, &[("auto_pad", Text("SAME_UPPER"))]), &[1, 1, 8, 8]);
        assert_eq!(same, Some([(0.0, 1.0, 3.0); 2]));
    }

    #[test]
    fn pads_cuts_and_sizes_are_followed() {
        let pool = [("kernel_shape", Ints(&[2, 2])), ("strides", Ints(&[2, 2]))];
        let shape = [1, 1, 8, 8];
        assert_eq!(look(|s| s.node("MaxPool", &["x"], "y", &pool), &shape), Some([(0.5, 2.0, 2.0); 2]));
        let cut = |s: &mut Sketch| {
            let [starts, ends, axes, steps] =
                [[1, 7], [i64::MAX, i64::MIN], [2, 3], [1, -1]].map(|values| s.ints(&values));
            s.node("Slice", &["x", &starts, &ends, &axes, &steps], "y", &[]);
        };
        assert_eq!(look(cut, &shape), Some([(1.0, 1.0, 1.0), (7.0, -1.0, 1.0)]));
        let padded =
            |s: &mut Sketch| s.with_ints(11, "Pad", "x", "y", ("pads", &[0, 0, 2, 0, 0, 0, 0, 3]), &[]);
        assert_eq!(look(padded, &shape), Some([(-2.0, 1.0, 1.0), (0.0, 1.0, 1.0)]));
        let larger = |s: &mut Sketch| {
            s.node("MaxPool", &["x"], "a", &pool);
            let weights = s.drawn(&[1, 1, 2, 2], -1.0, 1.0);
            s.node("ConvTranspose", &["a", &weights], "y", &[("strides", Ints(&[2, 2]))]);
        };
        assert_eq!(look(larger, &shape), Some([(0.0, 1.0, 3.0); 2]));
    }

    #[test]
    fn the_order_is_followed_through_transposes_and_lost_by_flattening() {
        let turned = look(
            |s| {
                s.node("Transpose", &["x"], "t", &[("perm", Ints(&[0, 2, 3, 1]))]);
                s.with_ints(13, "Unsqueeze", "t", "y", ("axes", &[1]), &[]);
            },
            &[1, 3, 8, 9],
        );
        assert_eq!(turned, Some([(0.0, 1.0, 1.0); 2]));
        assert_eq!(look(|s| s.node("Flatten", &["x"], "y", &[("axis", Int(1))]), &[1, 3, 8, 9]), None);
        assert_eq!(look(|s| s.node("GlobalAveragePool", &["x"], "y", &[]), &[1, 3, 8, 9]), None);
    }
}
