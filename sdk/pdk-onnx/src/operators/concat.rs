//! `Concat` and `Split`.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::attributes::int;
use crate::builder::Builder;
use crate::site::{Site, axis};
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Concat", infer_concat, evaluate_concat, Rule::First(gradient_concat)),
    Operator::new("Split", infer_split, evaluate_split, Rule::Each(gradient_split)),
];

fn along(site: &Site<'_>, default: i64) -> Result<usize> {
    axis(site.int("axis", default), site.shape(0)?.len())
}

/// The lengths of all inputs along the axis.
fn pieces(site: &Site<'_>, axis: usize) -> Result<Vec<usize>> {
    let first = site.shape(0)?;
    let lengths = (0..site.node.input.len()).map(|place| {
        let shape = site.shape(place)?;
        let fits = shape.len() == first.len()
            && (0..first.len()).all(|each| each == axis || shape[each] == first[each]);
        if fits { Ok(shape[axis]) } else { Err(Error::new("the shapes of its inputs do not go together")) }
    });
    lengths.collect()
}

fn infer_concat(site: &Site<'_>) -> Result<Vec<Fact>> {
    let axis = along(site, 1)?;
    let mut fact = site.fact(0)?.clone();
    fact.shape[axis] = pieces(site, axis)?.iter().sum();
    Ok(vec![fact])
}

fn evaluate_concat(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let axis = along(site, 1)?;
    let fact = infer_concat(site)?.swap_remove(0);
    let outer: usize = fact.shape[..axis].iter().product();
    let mut values = Vec::with_capacity(fact.shape.iter().product());
    for row in 0..outer {
        for place in 0..inputs.len() {
            let input = given(inputs, place)?;
            let length = input.values.len() / outer.max(1);
            values.extend_from_slice(&input.values[row * length..][..length]);
        }
    }
    Ok(vec![Tensor { element: fact.element, shape: fact.shape, values }])
}

fn gradient_concat(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let axis = along(site, 1)?;
    let mut parts = Vec::new();
    let mut start = 0;
    for (place, length) in pieces(site, axis)?.into_iter().enumerate() {
        if b.wants(site, place) {
            parts.push((place, b.slice(g, axis, start, start + length)?));
        }
        start += length;
    }
    Ok(parts)
}

/// The lengths of all outputs along the axis.
fn shares(site: &Site<'_>, axis: usize) -> Result<Vec<usize>> {
    let (length, count) = (site.shape(0)?[axis], site.node.output.len());
    let lengths = match site.ints_at(1, "split")? {
        Some(lengths) => lengths,
        None => {
            let share = length.div_ceil(count.max(1));
            (0..count).map(|place| length.saturating_sub(place * share).min(share) as i64).collect()
        }
    };
    let fits = lengths.len() == count
        && lengths.iter().all(|&share| share >= 0)
        && lengths.iter().sum::<i64>() == length as i64;
    match fits {
        true => Ok(lengths.into_iter().map(|share| share as usize).collect()),
        false => Err(Error::new(format!("it cannot split {length} into the {count} parts {lengths:?}"))),
    }
}

fn infer_split(site: &Site<'_>) -> Result<Vec<Fact>> {
    let axis = along(site, 0)?;
    let facts = shares(site, axis)?.into_iter().map(|share| {
        let mut fact = site.fact(0)?.clone();
        fact.shape[axis] = share;
        Ok(fact)
    });
    facts.collect()
}

fn evaluate_split(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let axis = along(site, 0)?;
    let input = given(inputs, 0)?;
    let inner: usize = input.shape[axis + 1..].iter().product();
    let row = inner * input.shape[axis];
    let mut start = 0;
    let mut parts = Vec::new();
    for fact in infer_split(site)? {
        let length = fact.shape[axis] * inner;
        let values =
            input.values.chunks(row.max(1)).flat_map(|row| &row[start..start + length]).copied().collect();
        parts.push(Tensor { element: fact.element, shape: fact.shape, values });
        start += length;
    }
    Ok(parts)
}

fn gradient_split(site: &Site<'_>, b: &mut Builder, g: &[Option<String>]) -> Result<Parts> {
    let axis = along(site, 0)?;
    let facts = infer_split(site)?;
    let parts = facts.iter().zip(g).map(|(fact, g)| match g {
        Some(g) => Ok(g.clone()),
        None => b.zeros(fact.element, &fact.shape),
    });
    let parts = parts.collect::<Result<Vec<_>>>()?;
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    Ok(vec![(0, b.node("Concat", &parts, vec![int("axis", axis as i64)])?)])
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_go_to_the_right_parts() {
        for case in ["concat", "concat/front", "concat/twice", "split", "split/lengths", "split/one_used"] {
            check(case);
        }
    }
}
