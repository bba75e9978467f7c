//! `Where` and `Expand`.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::{Tensor, broadcast};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Where", infer_where, evaluate_where, Rule::First(gradient_where)),
    Operator::new("Expand", infer_expand, evaluate_expand, Rule::First(gradient_expand)),
];

fn infer_where(site: &Site<'_>) -> Result<Vec<Fact>> {
    let shape = broadcast(&[site.shape(0)?, site.shape(1)?, site.shape(2)?])?;
    Ok(vec![Fact::new(site.fact(1)?.element, shape)])
}

fn evaluate_where(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let [condition, yes, no] = [given(inputs, 0)?, given(inputs, 1)?, given(inputs, 2)?];
    let chosen = Tensor::from_fn(yes.element, site.output_shape()?, |at| {
        let from = if condition.broadcast_at(at) != 0.0 { yes } else { no };
        from.broadcast_at(at)
    });
    Ok(vec![chosen?])
}

fn gradient_where(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let holds = b.cast(site.input(0)?, site.fact(1)?.element)?;
    let mut parts = Vec::new();
    for place in 1..3 {
        if b.wants(site, place) {
            let share = if place == 1 { holds.clone() } else { b.complement(&holds)? };
            let part = b.mul(g, &share)?;
            parts.push((place, b.sum_to(&part, site.shape(place)?)?));
        }
    }
    Ok(parts)
}

fn infer_expand(site: &Site<'_>) -> Result<Vec<Fact>> {
    let shape = site.constant(1)?.map(|shape| shape.to_ints()).unwrap_or_default();
    let shape = shape.into_iter().map(usize::try_from).collect::<Result<Vec<_>, _>>();
    let shape = shape.map_err(|_| Error::new("the shape that it is to have is negative"))?;
    Ok(vec![Fact::new(site.fact(0)?.element, broadcast(&[site.shape(0)?, &shape])?)])
}

fn evaluate_expand(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    let shape = &infer_expand(site)?[0].shape;
    Ok(vec![Tensor::from_fn(input.element, shape, |at| input.broadcast_at(at))?])
}

fn gradient_expand(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    Ok(vec![(0, b.sum_to(g, site.shape(0)?)?)])
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_are_right_on_both_sides_and_through_broadcasts() {
        for case in ["where", "where/no", "where/condition", "where/broadcast", "expand", "expand/rank"] {
            check(case);
        }
    }
}
