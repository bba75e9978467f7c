//! Values that do not depend on what goes in, or on its shape alone: `Constant`, `ConstantOfShape`, `Shape`, `Size` and `Range`.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Rule, given};
use crate::order::greater;
use crate::site::Site;
use crate::tensor::{Element, Tensor, elements};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new(
        "Constant",
        |site| fact_of(constant(site)?),
        |site, _| Ok(vec![constant(site)?]),
        Rule::Zero,
    ),
    Operator::new("ConstantOfShape", |site| Ok(vec![of_shape(site)?.0]), evaluate_of_shape, Rule::Zero),
    Operator::new("Shape", |site| fact_of(shape(site)?), |site, _| Ok(vec![shape(site)?]), Rule::Zero)
        .needing_shapes_alone(),
    Operator::new("Size", |site| fact_of(size(site)?), |site, _| Ok(vec![size(site)?]), Rule::Zero)
        .needing_shapes_alone(),
    Operator::new("Range", infer_range, evaluate_range, Rule::Zero),
];

fn fact_of(tensor: Tensor) -> Result<Vec<Fact>> {
    Ok(vec![Fact::new(tensor.element, tensor.shape)])
}

fn constant(site: &Site<'_>) -> Result<Tensor> {
    if let Some(tensor) = site.tensor("value")? {
        return Ok(tensor);
    }
    if let Some(number) = site.optional_float("value_float") {
        return Ok(Tensor::floats(&[], vec![number]));
    }
    if let Some(number) = site.optional_int("value_int") {
        return Ok(Tensor { shape: Vec::new(), ..Tensor::ints(&[number]) });
    }
    if let Some(numbers) = site.floats("value_floats") {
        return Ok(Tensor::floats(
            &[numbers.len()],
            numbers.iter().map(|&number| f64::from(number)).collect(),
        ));
    }
    match site.ints("value_ints") {
        Some(numbers) => Ok(Tensor::ints(numbers)),
        None => Err(Error::new("it holds no numbers")),
    }
}

/// Type, shape and value of `ConstantOfShape`.
fn of_shape(site: &Site<'_>) -> Result<(Fact, f64)> {
    let shape = site.constant(0)?.map(|shape| shape.to_ints()).unwrap_or_default();
    let shape = shape.into_iter().map(usize::try_from).collect::<Result<Vec<_>, _>>();
    let shape = shape.map_err(|_| Error::new("the shape that it is to have is negative"))?;
    let (element, value) = match site.tensor("value")? {
        Some(tensor) => (tensor.element, tensor.values.first().copied().unwrap_or(0.0)),
        None => (Element::FLOAT, 0.0),
    };
    Ok((Fact::new(element, shape), value))
}

fn evaluate_of_shape(site: &Site<'_>, _: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (fact, value) = of_shape(site)?;
    Ok(vec![Tensor::filled(fact.element, &fact.shape, value)?])
}

fn shape(site: &Site<'_>) -> Result<Tensor> {
    let shape = site.shape(0)?;
    let rank = shape.len() as i64;
    let place = |value: i64| (if value < 0 { value + rank } else { value }).clamp(0, rank) as usize;
    let (start, end) = (place(site.int("start", 0)), place(site.int("end", rank)));
    let dims: Vec<i64> = shape[start..end.max(start)].iter().map(|&dim| dim as i64).collect();
    Ok(Tensor::ints(&dims))
}

fn size(site: &Site<'_>) -> Result<Tensor> {
    Ok(Tensor { shape: Vec::new(), ..Tensor::ints(&[elements(site.shape(0)?)? as i64]) })
}

/// Start, step and number of a range.
fn range(site: &Site<'_>) -> Result<(f64, f64, usize)> {
    let number =
        |place| site.number_at(place, "")?.ok_or_else(|| Error::new("one of its three numbers is missing"));
    let (start, limit, step) = (number(0)?, number(1)?, number(2)?);
    let count = greater(0.0, ((limit - start) / step).ceil());
    if !count.is_finite() {
        return Err(Error::new("its range has no end"));
    }
    Ok((start, step, elements(&[count as usize])?))
}

fn infer_range(site: &Site<'_>) -> Result<Vec<Fact>> {
    Ok(vec![Fact::new(site.fact(0)?.element, vec![range(site)?.2])])
}

fn evaluate_range(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (start, step, count) = range(site)?;
    let values = (0..count).map(|place| start + step * place as f64).collect();
    Ok(vec![Tensor { element: given(inputs, 0)?.element, shape: vec![count], values }])
}

#[cfg(test)]
mod tests {
    use crate::graph::Graph;
    use crate::inference::Program;
    use crate::testing::{Setting, Sketch, check};

    #[test]
    fn shapes_that_are_computed_in_32_bit_floats_are_those_of_32_bit_floats() {
        let mut s = Sketch::new(13);
        s.input("x", &[10, 3]);
        let share = s.weights("share", crate::Tensor::floats(&[], vec![0.7]));
        s.node("Shape", &["x"], "whole", &[]);
        s.node("Cast", &["whole"], "floats", &[("to", Setting::Int(1))]);
        s.node("Mul", &["floats", &share], "product", &[]);
        s.node("Floor", &["product"], "floor", &[]);
        s.node("Cast", &["floor"], "shape", &[("to", Setting::Int(7))]);
        s.node("ConstantOfShape", &["shape"], "y", &[]);
        let graph = Graph::new(s.model(&["y"])).unwrap();
        // The nearest 32-bit float to 0.7 is less, and 10 times that is nearest to 7.
        assert_eq!(graph.fact("y").unwrap().shape, [7, 2]);
        let mut outputs = [Vec::new()];
        Program::new(graph).unwrap().run(&[vec![0.0; 30]], &mut outputs).unwrap();
        assert_eq!(outputs[0], [0.0; 14]);
    }

    #[test]
    fn shapes_that_are_computed_are_followed() {
        for case in ["reshape/computed", "expand/computed", "reshape/range"] {
            check(case);
        }
    }
}
