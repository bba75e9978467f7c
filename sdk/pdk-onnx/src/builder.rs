//! Adds nodes to a graph, in a form that its version of the operator set has.

use std::collections::HashSet;

use pdk_sdk::error::Result;

use crate::attributes::{int, ints};
use crate::graph::Graph;
use crate::proto::{AttributeProto, NodeProto};
use crate::site::Site;
use crate::tensor::{Element, Tensor, elements};
use crate::window::Window;

/// A graph that grows.
pub(crate) struct Builder {
    pub graph: Graph,
    /// The values whose gradient is needed.
    pub wanted: HashSet<String>,
    count: usize,
}

impl Builder {
    /// A builder on a graph.
    pub fn new(graph: Graph, wanted: HashSet<String>) -> Self {
        Self { graph, wanted, count: 0 }
    }

    /// Whether the gradient of an input is needed.
    pub fn wants(&self, site: &Site<'_>, place: usize) -> bool {
        site.optional(place).is_some_and(|name| self.wanted.contains(name))
    }

    fn name(&mut self, operator: &str) -> String {
        loop {
            self.count += 1;
            let name = format!("gradient/{}/{operator}", self.count);
            if !self.graph.values.contains(&name) {
                return name;
            }
        }
    }

    /// Adds a node with one output, and gives the name of that.
    pub fn node(
        &mut self,
        operator: &str,
        inputs: &[&str],
        attribute: Vec<AttributeProto>,
    ) -> Result<String> {
        let name = self.name(operator);
        self.named_with(operator, inputs, &name, attribute)?;
        Ok(name)
    }

    /// Adds a node without attributes whose output has this name.
    pub fn named(&mut self, operator: &str, inputs: &[&str], name: &str) -> Result<()> {
        self.named_with(operator, inputs, name, Vec::new())
    }

    /// Gives the gradient of a value the name `gradient/VALUE`, or another one if that is taken.
    pub fn gradient_of(&mut self, value: &str, gradient: &str) -> Result<String> {
        let mut name = format!("gradient/{value}");
        if self.graph.values.contains(&name) {
            name = self.name(value);
        }
        self.named("Identity", &[gradient], &name)?;
        Ok(name)
    }

    fn named_with(
        &mut self,
        operator: &str,
        inputs: &[&str],
        name: &str,
        attribute: Vec<AttributeProto>,
    ) -> Result<()> {
        let node = NodeProto {
            op_type: operator.to_owned(),
            name: name.to_owned(),
            input: inputs.iter().map(|&input| input.to_owned()).collect(),
            output: vec![name.to_owned()],
            attribute,
            ..Default::default()
        };
        self.graph.add_node(node)?;
        // A mistake in a rule shows here, where it can be named.
        self.graph.fact(name)?;
        Ok(())
    }

    /// Adds a constant.
    pub fn constant(&mut self, tensor: &Tensor) -> Result<String> {
        let name = self.name("constant");
        self.graph.values.add_initializer(tensor.to_proto(&name))?;
        Ok(name)
    }

    /// Whole numbers.
    pub fn ints(&mut self, values: impl IntoIterator<Item = i64>) -> Result<String> {
        let values: Vec<_> = values.into_iter().collect();
        self.constant(&Tensor::ints(&values))
    }

    /// The type of a value.
    pub fn element(&self, name: &str) -> Result<Element> {
        Ok(self.graph.fact(name)?.element)
    }

    /// The shape of a value.
    pub fn shape(&self, name: &str) -> Result<Vec<usize>> {
        Ok(self.graph.fact(name)?.shape.clone())
    }

    /// A number of the type of `like`.
    pub fn number(&mut self, like: &str, value: f64) -> Result<String> {
        let element = self.element(like)?;
        self.constant(&Tensor { element, shape: Vec::new(), values: vec![value] })
    }

    /// `operator(a)`.
    pub fn unary(&mut self, operator: &str, a: &str) -> Result<String> {
        self.node(operator, &[a], Vec::new())
    }

    /// `operator(a, b)`.
    pub fn binary(&mut self, operator: &str, a: &str, b: &str) -> Result<String> {
        self.node(operator, &[a, b], Vec::new())
    }

    /// `a * b`.
    pub fn mul(&mut self, a: &str, b: &str) -> Result<String> {
        self.binary("Mul", a, b)
    }

    /// `a * factor`.
    pub fn scale(&mut self, a: &str, factor: f64) -> Result<String> {
        if factor == 1.0 {
            return Ok(a.to_owned());
        }
        let factor = self.number(a, factor)?;
        self.mul(a, &factor)
    }

    /// `a + term`.
    pub fn offset(&mut self, a: &str, term: f64) -> Result<String> {
        let term = self.number(a, term)?;
        self.binary("Add", a, &term)
    }

    /// `1 - a`.
    pub fn complement(&mut self, a: &str) -> Result<String> {
        let one = self.number(a, 1.0)?;
        self.binary("Sub", &one, a)
    }

    /// 1 where `operator(a, b)` holds, such as `Greater`, else 0.
    pub fn mask(&mut self, operator: &str, a: &str, b: &str) -> Result<String> {
        let element = self.element(a)?;
        let holds = self.binary(operator, a, b)?;
        self.cast(&holds, element)
    }

    /// 1 where `a` is above the number, else 0.
    pub fn above(&mut self, a: &str, number: f64) -> Result<String> {
        let number = self.number(a, number)?;
        self.mask("Greater", a, &number)
    }

    /// The value in another type.
    pub fn cast(&mut self, a: &str, element: Element) -> Result<String> {
        self.node("Cast", &[a], vec![int("to", i64::from(element.0))])
    }

    /// The value in another shape of as many elements.
    pub fn reshape(&mut self, a: &str, shape: &[usize]) -> Result<String> {
        if self.shape(a)? == shape {
            return Ok(a.to_owned());
        }
        let shape = self.ints(shape.iter().map(|&dim| dim as i64))?;
        self.binary("Reshape", a, &shape)
    }

    /// The value with its axes in another order.
    pub fn transpose(&mut self, a: &str, order: &[usize]) -> Result<String> {
        if order.iter().enumerate().all(|(place, &axis)| place == axis) {
            return Ok(a.to_owned());
        }
        self.node("Transpose", &[a], vec![ints("perm", order.iter().copied())])
    }

    /// The value with its last two axes exchanged.
    pub fn flip(&mut self, a: &str) -> Result<String> {
        let rank = self.shape(a)?.len();
        let mut order: Vec<_> = (0..rank).collect();
        order.swap(rank - 2, rank - 1);
        self.transpose(a, &order)
    }

    /// The sum over some axes, which stay with the length 1.
    pub fn sum(&mut self, a: &str, axes: &[usize]) -> Result<String> {
        if axes.is_empty() {
            return Ok(a.to_owned());
        }
        if self.graph.opset() < 13 {
            return self.node(
                "ReduceSum",
                &[a],
                vec![ints("axes", axes.iter().copied()), int("keepdims", 1)],
            );
        }
        let axes = self.ints(axes.iter().map(|&axis| axis as i64))?;
        self.node("ReduceSum", &[a, &axes], vec![int("keepdims", 1)])
    }

    /// The mean over some axes, which stay with the length 1.
    pub fn mean(&mut self, a: &str, axes: &[usize]) -> Result<String> {
        let shape = self.shape(a)?;
        let count: usize = axes.iter().map(|&axis| shape[axis]).product();
        let sum = self.sum(a, axes)?;
        self.scale(&sum, 1.0 / count as f64)
    }

    /// Undoes a broadcast: sums over what was repeated, so that the shape is `shape`.
    pub fn sum_to(&mut self, a: &str, shape: &[usize]) -> Result<String> {
        let from = self.shape(a)?;
        let added = from.len() - shape.len();
        let repeated = |axis: &usize| from[*axis] != 1 && (*axis < added || shape[*axis - added] == 1);
        let axes: Vec<_> = (0..from.len()).filter(repeated).collect();
        let sum = self.sum(a, &axes)?;
        self.reshape(&sum, shape)
    }

    /// Repeats the value so that its shape is `shape`.
    pub fn spread(&mut self, a: &str, shape: &[usize]) -> Result<String> {
        if self.shape(a)? == shape {
            return Ok(a.to_owned());
        }
        if self.graph.opset() < 8 {
            let ones = Tensor::filled(self.element(a)?, shape, 1.0)?;
            let ones = self.constant(&ones)?;
            return self.mul(a, &ones);
        }
        let shape = self.ints(shape.iter().map(|&dim| dim as i64))?;
        self.binary("Expand", a, &shape)
    }

    /// Zeros.
    pub fn zeros(&mut self, element: Element, shape: &[usize]) -> Result<String> {
        let zeros = Tensor::filled(element, shape, 0.0)?;
        self.constant(&zeros)
    }

    /// What lies from `start` to before `end` along an axis.
    pub fn slice(&mut self, a: &str, axis: usize, start: usize, end: usize) -> Result<String> {
        if start == 0 && end == self.shape(a)?[axis] {
            return Ok(a.to_owned());
        }
        if self.graph.opset() < 10 {
            let attributes = vec![ints("starts", [start]), ints("ends", [end]), ints("axes", [axis])];
            return self.node("Slice", &[a], attributes);
        }
        let [start, end, axis] =
            [self.ints([start as i64])?, self.ints([end as i64])?, self.ints([axis as i64])?];
        self.node("Slice", &[a, &start, &end, &axis], Vec::new())
    }

    /// Zeros before and after the value along an axis.
    pub fn pad(&mut self, a: &str, axis: usize, before: usize, after: usize) -> Result<String> {
        if before == 0 && after == 0 {
            return Ok(a.to_owned());
        }
        let rank = self.shape(a)?.len();
        let mut pads = vec![0; 2 * rank];
        (pads[axis], pads[rank + axis]) = (before, after);
        if self.graph.opset() < 11 {
            return self.node("Pad", &[a], vec![ints("pads", pads)]);
        }
        let pads = self.ints(pads.into_iter().map(|pad| pad as i64))?;
        self.binary("Pad", a, &pads)
    }

    /// What lies at these places along an axis.
    pub fn gather(
        &mut self,
        a: &str,
        axis: usize,
        places: impl IntoIterator<Item = usize>,
    ) -> Result<String> {
        let places = self.ints(places.into_iter().map(|place| place as i64))?;
        self.node("Gather", &[a, &places], vec![int("axis", axis as i64)])
    }

    /// The reverse of [`Self::gather`]: an axis of `length` zeros, to which each part of the value along the axis is added
    /// at its place. A part whose place is left out is dropped.
    pub fn scatter(
        &mut self,
        a: &str,
        axis: usize,
        places: &[Option<usize>],
        length: usize,
    ) -> Result<String> {
        let kept = places.iter().position(Option::is_some).unwrap_or(0);
        let end = places.iter().rposition(Option::is_some).map_or(kept, |last| last + 1);
        let (a, places) = (self.slice(a, axis, kept, end)?, &places[kept..end]);
        let run = |start: usize| places.iter().enumerate().all(|(i, place)| *place == Some(start + i));
        if let Some(Some(start)) = places.first().filter(|start| start.is_some_and(run)) {
            return self.pad(&a, axis, *start, length - start - places.len());
        }
        // For each place the parts that go there; the first of each are fetched together, then the second, and so on.
        let mut parts = vec![Vec::new(); length];
        for (part, place) in places.iter().enumerate() {
            if let Some(place) = place {
                parts[*place].push(part);
            }
        }
        let rounds = parts.iter().map(Vec::len).max().unwrap_or(0).max(1);
        let padded = self.pad(&a, axis, 0, 1)?;
        let mut sum: Option<String> = None;
        for round in 0..rounds {
            let places: Vec<_> =
                parts.iter().map(|parts| parts.get(round).copied().unwrap_or(places.len())).collect();
            let term = self.gather(&padded, axis, places)?;
            sum = Some(match sum {
                None => term,
                Some(sum) => self.binary("Add", &sum, &term)?,
            });
        }
        sum.map_or_else(|| Ok(padded), Ok)
    }

    /// A convolution of `a` with a window.
    pub fn conv(&mut self, a: &str, weights: &str, window: &Window, group: usize) -> Result<String> {
        let mut a = a.to_owned();
        let mut after = Vec::new();
        for axis in 0..window.kernel.len() {
            let (covered, length) = (window.extent(axis), window.before[axis] + window.input[axis]);
            a = self.slice(
                &a,
                axis + 2,
                0,
                window.input[axis].saturating_sub(length.saturating_sub(covered)),
            )?;
            after.push(covered.saturating_sub(length));
        }
        let attributes = window.attributes(group, after);
        self.node("Conv", &[&a, weights], attributes)
    }

    /// The reverse of a convolution with a window: from its output's size to its input's.
    pub fn conv_transpose(
        &mut self,
        a: &str,
        weights: &str,
        window: &Window,
        group: usize,
    ) -> Result<String> {
        let mut after = Vec::new();
        let mut missing = Vec::new();
        for axis in 0..window.kernel.len() {
            let (covered, length) = (window.extent(axis), window.before[axis] + window.input[axis]);
            after.push(covered.saturating_sub(length));
            missing.push(length.saturating_sub(covered));
        }
        let mut attributes = window.attributes(group, after);
        attributes.push(ints("output_padding", missing));
        self.node("ConvTranspose", &[a, weights], attributes)
    }

    /// Applies a matrix along an axis: `matrix` has a row for each place of the result and a column for each of `a`.
    pub fn along(&mut self, a: &str, axis: usize, matrix: &[Vec<f64>]) -> Result<String> {
        let (rows, columns) = (matrix.len(), matrix[0].len());
        elements(&[rows, columns])?;
        let element = self.element(a)?;
        let rank = self.shape(a)?.len();
        let values = matrix.iter().flatten().copied().collect();
        let matrix = self.constant(&Tensor { element, shape: vec![rows, columns], values })?;
        // The axis next to the last is where a matrix from the left is applied.
        let mut order: Vec<_> = (0..rank).filter(|&each| each != axis).collect();
        order.insert(rank - 2 + usize::from(axis == rank - 1), axis);
        if axis == rank - 1 {
            let columns = self.flip(&matrix)?;
            return self.binary("MatMul", a, &columns);
        }
        let back: Vec<_> =
            (0..rank).map(|axis| order.iter().position(|&at| at == axis).unwrap_or(axis)).collect();
        let turned = self.transpose(a, &order)?;
        let product = self.binary("MatMul", &matrix, &turned)?;
        self.transpose(&product, &back)
    }
}
