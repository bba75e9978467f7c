//! `Gather` at places that are constant.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::{Site, axis};
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("Gather", infer, evaluate, Rule::First(gradient))];

fn along(site: &Site<'_>) -> Result<usize> {
    axis(site.int("axis", 0), site.shape(0)?.len())
}

/// The places as counted from the start.
fn places(indices: &Tensor, length: usize) -> Result<Vec<usize>> {
    let place = |index: i64| {
        let counted = if index < 0 { index + length as i64 } else { index };
        usize::try_from(counted).ok().filter(|&place| place < length)
    };
    let wrong = |index: i64| Error::new(format!("its index {index} is outside the {length} elements"));
    indices.to_ints().into_iter().map(|index| place(index).ok_or_else(|| wrong(index))).collect()
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let axis = along(site)?;
    let fact = site.fact(0)?;
    let shape = [&fact.shape[..axis], site.shape(1)?, &fact.shape[axis + 1..]].concat();
    Ok(vec![Fact::new(fact.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let axis = along(site)?;
    let (input, indices) = (given(inputs, 0)?, given(inputs, 1)?);
    let length = input.shape[axis];
    let places = places(indices, length)?;
    let inner: usize = input.shape[axis + 1..].iter().product();
    let rows = input.values.chunks((length * inner).max(1));
    let values =
        rows.flat_map(|row| places.iter().flat_map(|&place| &row[place * inner..(place + 1) * inner]));
    let values = values.copied().collect();
    Ok(vec![Tensor { element: input.element, shape: infer(site)?.swap_remove(0).shape, values }])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let axis = along(site)?;
    let shape = site.shape(0)?;
    let indices = site.constant(1)?.ok_or_else(|| Error::new("its input 2 is missing"))?;
    let places = places(&indices, shape[axis])?;
    // All axes of the indices as one.
    let flat = [&shape[..axis], &[places.len()], &shape[axis + 1..]].concat();
    let g = b.reshape(g, &flat)?;
    let places: Vec<_> = places.into_iter().map(Some).collect();
    Ok(vec![(0, b.scatter(&g, axis, &places, shape[axis])?)])
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_go_back_to_where_the_elements_came_from() {
        for case in ["gather", "gather/repeated", "gather/one", "gather/matrix", "gather/negative"] {
            check(case);
        }
    }
}
