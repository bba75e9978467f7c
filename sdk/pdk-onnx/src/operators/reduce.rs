//! `ReduceMean` and `ReduceSum`.

use pdk_sdk::error::Result;

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::{Site, axes};
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new(
        "ReduceSum",
        infer,
        |site, inputs| reduce(site, inputs, |_| 1.0),
        Rule::First(|s, b, g| spread(s, b, g, |_| 1.0)),
    ),
    Operator::new(
        "ReduceMean",
        infer,
        |site, inputs| reduce(site, inputs, share),
        Rule::First(|s, b, g| spread(s, b, g, share)),
    ),
];

/// The share of each of this many elements in their mean.
fn share(count: usize) -> f64 {
    1.0 / count as f64
}

/// The axes that are summed over.
fn summed(site: &Site<'_>) -> Result<Vec<usize>> {
    let rank = site.shape(0)?.len();
    match site.ints_at(1, "axes")?.filter(|list| !list.is_empty()) {
        Some(list) => axes(&list, rank),
        None if site.int("noop_with_empty_axes", 0) != 0 => Ok(Vec::new()),
        None => Ok((0..rank).collect()),
    }
}

/// The shape with the length 1 where it is summed over.
fn kept(site: &Site<'_>) -> Result<Vec<usize>> {
    let summed = summed(site)?;
    let dims = site.shape(0)?.iter().enumerate();
    Ok(dims.map(|(axis, &dim)| if summed.contains(&axis) { 1 } else { dim }).collect())
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    if site.int("keepdims", 1) != 0 {
        return Ok(vec![Fact::new(fact.element, kept(site)?)]);
    }
    let summed = summed(site)?;
    let dims = fact.shape.iter().enumerate().filter(|(axis, _)| !summed.contains(axis));
    Ok(vec![Fact::new(fact.element, dims.map(|(_, &dim)| dim).collect())])
}

fn reduce(site: &Site<'_>, inputs: &[Option<&Tensor>], weight: fn(usize) -> f64) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    let kept = kept(site)?;
    let mut sums = Tensor::filled(input.element, &kept, 0.0)?;
    let mut from = input.values.iter();
    crate::tensor::for_each_position(&input.shape, |at| {
        let index =
            kept.iter().zip(at).fold(0, |index, (&dim, &at)| index * dim + if dim == 1 { 0 } else { at });
        sums.values[index] += from.next().copied().unwrap_or_default();
    });
    let weight = weight(input.values.len() / sums.values.len().max(1));
    sums.values.iter_mut().for_each(|sum| *sum *= weight);
    Ok(vec![Tensor { shape: infer(site)?.swap_remove(0).shape, ..sums }])
}

fn spread(site: &Site<'_>, b: &mut Builder, g: &str, weight: fn(usize) -> f64) -> Result<Parts> {
    let (shape, kept) = (site.shape(0)?, kept(site)?);
    let count = shape.iter().product::<usize>() / kept.iter().product::<usize>().max(1);
    let g = b.reshape(g, &kept)?;
    let g = b.scale(&g, weight(count))?;
    Ok(vec![(0, b.spread(&g, shape)?)])
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_are_spread_over_what_was_summed() {
        for operator in ["reduce_sum", "reduce_mean"] {
            for case in ["", "/axes", "/dropped", "/last"] {
                check(&format!("{operator}{case}"));
            }
        }
    }
}
