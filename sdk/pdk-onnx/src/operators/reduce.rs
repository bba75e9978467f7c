//! `ReduceSum`, `ReduceMean`, `ReduceMax`, `ReduceMin` and `GlobalMaxPool`.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::order::further;
use crate::site::{Site, axes};
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new(
        "ReduceSum",
        infer,
        |site, inputs| sum(site, inputs, |_| 1.0),
        Rule::First(|s, b, g| share_out(s, b, g, |_| 1.0)),
    ),
    Operator::new(
        "ReduceMean",
        infer,
        |site, inputs| sum(site, inputs, |count| count as f64),
        Rule::First(|s, b, g| share_out(s, b, g, share)),
    ),
    Operator::new(
        "ReduceMax",
        infer,
        |site, inputs| extreme(site, inputs, &kept(site)?, 1.0),
        Rule::First(|s, b, g| to_the_extreme(s, b, g, &kept(s)?, "Less")),
    ),
    Operator::new(
        "ReduceMin",
        infer,
        |site, inputs| extreme(site, inputs, &kept(site)?, -1.0),
        Rule::First(|s, b, g| to_the_extreme(s, b, g, &kept(s)?, "Greater")),
    ),
    Operator::new(
        "GlobalMaxPool",
        |site| Ok(vec![Fact::new(site.fact(0)?.element, pooled(site)?)]),
        |site, inputs| extreme(site, inputs, &pooled(site)?, 1.0),
        Rule::First(|s, b, g| to_the_extreme(s, b, g, &pooled(s)?, "Less")),
    ),
];

/// The share of each of this many elements in their mean.
fn share(count: usize) -> f64 {
    1.0 / count as f64
}

/// The axes that are reduced.
fn reduced(site: &Site<'_>) -> Result<Vec<usize>> {
    let rank = site.shape(0)?.len();
    match site.ints_at(1, "axes")?.filter(|list| !list.is_empty()) {
        Some(list) => axes(&list, rank),
        None if site.int("noop_with_empty_axes", 0) != 0 => Ok(Vec::new()),
        None => Ok((0..rank).collect()),
    }
}

/// The shape in which reduced axes have the length 1.
pub fn kept(site: &Site<'_>) -> Result<Vec<usize>> {
    let reduced = reduced(site)?;
    let dims = site.shape(0)?.iter().enumerate();
    Ok(dims.map(|(axis, &dim)| if reduced.contains(&axis) { 1 } else { dim }).collect())
}

/// The shape in which all axes behind the channels have the length 1.
pub fn pooled(site: &Site<'_>) -> Result<Vec<usize>> {
    let shape = site.shape(0)?;
    if shape.len() < 3 {
        return Err(Error::new("its input has no spatial axes"));
    }
    Ok(shape.iter().enumerate().map(|(axis, &dim)| if axis < 2 { dim } else { 1 }).collect())
}

pub fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    if site.int("keepdims", 1) != 0 {
        return Ok(vec![Fact::new(fact.element, kept(site)?)]);
    }
    let reduced = reduced(site)?;
    let dims = fact.shape.iter().enumerate().filter(|(axis, _)| !reduced.contains(axis));
    Ok(vec![Fact::new(fact.element, dims.map(|(_, &dim)| dim).collect())])
}

fn sum(site: &Site<'_>, inputs: &[Option<&Tensor>], divisor: fn(usize) -> f64) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    let mut sums = fold(input, &kept(site)?, 0.0, |sum, value| input.element.sum(sum, value))?;
    let divisor = divisor(input.values.len() / sums.values.len().max(1));
    // A mean of integers is cut.
    let share = |sum: f64| if input.element.is_integer() { (sum / divisor).trunc() } else { sum / divisor };
    sums.values.iter_mut().for_each(|sum| *sum = share(*sum));
    Ok(vec![Tensor { shape: infer(site)?.swap_remove(0).shape, ..sums }])
}

/// The greatest elements if `sign` is 1, the least ones if it is -1.
fn extreme(site: &Site<'_>, inputs: &[Option<&Tensor>], kept: &[usize], sign: f64) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    let start = input.element.saturated(f64::NEG_INFINITY * sign);
    let found = fold(input, kept, start, |far, value| further(far, value, sign))?;
    Ok(vec![Tensor { shape: site.output_shape()?.to_vec(), ..found }])
}

/// Joins the elements that fall together in a shape whose reduced axes have the length 1.
pub fn fold(input: &Tensor, kept: &[usize], start: f64, join: impl Fn(f64, f64) -> f64) -> Result<Tensor> {
    let mut folded = Tensor::filled(input.element, kept, start)?;
    let mut from = input.values.iter();
    crate::tensor::for_each_position(&input.shape, |at| {
        let index =
            kept.iter().zip(at).fold(0, |index, (&dim, &at)| index * dim + if dim == 1 { 0 } else { at });
        if let Some(value) = from.next() {
            folded.values[index] = join(folded.values[index], *value);
        }
    });
    Ok(folded)
}

/// A value of each group, such as the gradient, at each element of the group.
pub fn spread(site: &Site<'_>, b: &mut Builder, groups: &str) -> Result<String> {
    let groups = b.reshape(groups, &kept(site)?)?;
    b.spread(&groups, site.shape(0)?)
}

/// The gradient goes to all elements of a group, with the weight that belongs to their number.
fn share_out(site: &Site<'_>, b: &mut Builder, g: &str, weight: fn(usize) -> f64) -> Result<Parts> {
    let count = site.shape(0)?.iter().product::<usize>() / kept(site)?.iter().product::<usize>().max(1);
    let g = b.scale(g, weight(count))?;
    Ok(vec![(0, spread(site, b, &g)?)])
}

/// The gradient goes to the elements that equal what was found, in equal shares; all others are `beyond` it, by this operator.
fn to_the_extreme(site: &Site<'_>, b: &mut Builder, g: &str, kept: &[usize], beyond: &str) -> Result<Parts> {
    let shape = site.shape(0)?;
    let found = b.reshape(site.output(0)?, kept)?;
    let input = site.input(0)?;
    let found = b.spread(&found, shape)?;
    // Old versions of Equal do not compare floats.
    let other = b.mask(beyond, input, &found)?;
    let equal = b.complement(&other)?;
    let axes: Vec<_> = (0..shape.len()).filter(|&axis| kept[axis] != shape[axis]).collect();
    let count = b.sum(&equal, &axes)?;
    let g = b.reshape(g, kept)?;
    let g = b.binary("Div", &g, &count)?;
    let g = b.spread(&g, shape)?;
    Ok(vec![(0, b.mul(&equal, &g)?)])
}

#[cfg(test)]
mod tests {
    use crate::gradient::{Target, gradients};
    use crate::graph::Graph;
    use crate::tensor::{Element, Tensor};
    use crate::testing::{Sketch, check, computed};

    #[test]
    fn gradients_are_spread_over_what_was_summed() {
        for operator in ["reduce_sum", "reduce_mean"] {
            for case in ["", "/axes", "/dropped", "/last"] {
                check(&format!("{operator}{case}"));
            }
        }
    }

    #[test]
    fn gradients_go_to_the_greatest_or_the_least() {
        for operator in ["reduce_max", "reduce_min"] {
            for case in ["", "/axes", "/dropped", "/last"] {
                check(&format!("{operator}{case}"));
            }
        }
        check("global_max_pool");
    }

    #[test]
    fn sums_of_integers_wrap_and_their_means_are_cut() {
        for (operator, value, count, expected) in
            [("ReduceMean", 3.0, 49, 3.0), ("ReduceSum", 2147483647.0, 2, -2.0), ("ReduceMax", -7.0, 3, -7.0)]
        {
            let found = computed(13, |s| {
                let x = s.weights("x", Tensor::filled(Element::INT32, &[count], value).unwrap());
                s.node(operator, &[&x], "y", &[]);
            });
            assert_eq!(found.unwrap().values, [expected], "{operator}");
        }
    }

    #[test]
    fn equal_elements_share_the_gradient() {
        for (operator, values, expected) in [
            ("ReduceMax", [2.0, -1.0, 2.0, 0.0], [0.5, 0.0, 0.5, 0.0]),
            ("ReduceMin", [2.0, -1.0, 2.0, -1.0], [0.0, 0.5, 0.0, 0.5]),
        ] {
            let mut sketch = Sketch::new(13);
            sketch.input("x", &[1, 4]);
            sketch.node(operator, &["x"], "y", &[]);
            let graph = Graph::new(sketch.model(&["y"])).unwrap();
            let built = gradients(&graph, Target { value: "y", index: 0 }, &["x"], &[]).unwrap();
            let x = Tensor::floats(&[1, 4], values.to_vec());
            let found =
                Graph::new(built.model).unwrap().evaluate(&[("x", &x)], &[&built.outputs[0]]).unwrap();
            assert_eq!(found[0].values, expected, "{operator}");
        }
    }
}
