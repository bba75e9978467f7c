//! `MatMul`: products of matrices, in stacks that are broadcast.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::{Element, Tensor, broadcast, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("MatMul", infer, evaluate, Rule::First(gradient))];

/// The shapes of both inputs as stacks of matrices: a vector is one row on the left, one column on the right.
pub fn matrices(a: &[usize], b: &[usize]) -> Result<[Vec<usize>; 2]> {
    let (mut a, mut b) = (a.to_vec(), b.to_vec());
    if a.len() == 1 {
        a.insert(0, 1);
    }
    if b.len() == 1 {
        b.push(1);
    }
    if a.len() < 2 || b.len() < 2 || a[a.len() - 1] != b[b.len() - 2] {
        return Err(Error::new(format!(
            "its matrices {} and {} do not go together",
            shape_text(&a),
            shape_text(&b)
        )));
    }
    Ok([a, b])
}

/// The shape of the product of two stacks of matrices.
pub fn product_shape(a: &[usize], b: &[usize]) -> Result<Vec<usize>> {
    let mut shape = broadcast(&[&a[..a.len() - 2], &b[..b.len() - 2]])?;
    shape.extend([a[a.len() - 2], b[b.len() - 1]]);
    Ok(shape)
}

/// The shape of the product of two inputs of these shapes, of which a vector has no rows or columns.
pub fn result_shape(a: &[usize], b: &[usize]) -> Result<Vec<usize>> {
    let [left, right] = matrices(a, b)?;
    let mut shape = product_shape(&left, &right)?;
    if b.len() == 1 {
        shape.pop();
    }
    if a.len() == 1 {
        shape.remove(shape.len() - 1 - usize::from(b.len() != 1));
    }
    Ok(shape)
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let shape = result_shape(site.shape(0)?, site.shape(1)?)?;
    Ok(vec![Fact::new(site.fact(0)?.element, shape)])
}

fn evaluate(_: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (a, b) = (given(inputs, 0)?, given(inputs, 1)?);
    Ok(vec![Tensor { shape: result_shape(&a.shape, &b.shape)?, ..multiply(a, b)? }])
}

/// The products of two stacks of matrices, as a stack: a vector has a row or a column there. Integers wrap as their type does.
pub fn multiply(a: &Tensor, b: &Tensor) -> Result<Tensor> {
    let [a_shape, b_shape] = matrices(&a.shape, &b.shape)?;
    let shape = product_shape(&a_shape, &b_shape)?;
    let (rank, inner) = (shape.len(), a_shape[a_shape.len() - 1]);
    // The place of a matrix in its stack, which is broadcast.
    let start = |shape: &[usize], at: &[usize]| {
        let batch = &shape[..shape.len() - 2];
        let at = &at[rank - shape.len()..];
        let stack =
            batch.iter().zip(at).fold(0, |index, (&dim, &at)| index * dim + if dim == 1 { 0 } else { at });
        stack * shape[shape.len() - 2] * shape[shape.len() - 1]
    };
    let columns = shape[rank - 1];
    Tensor::from_fn(a.element, &shape, |at| {
        let left = &a.values[start(&a_shape, at) + at[rank - 2] * inner..];
        let right = &b.values[start(&b_shape, at)..];
        let pairs = (0..inner).map(|k| (left[k], right[k * columns + at[rank - 1]]));
        sum_of_products(a.element, pairs)
    })
}

/// The sum of products. That of integers is exact, and wraps as their type does.
pub fn sum_of_products(element: Element, pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    match element.is_integer() {
        true => element
            .wrapped(pairs.fold(0, |sum, (a, b)| (a as i128).wrapping_mul(b as i128).wrapping_add(sum))),
        false => pairs.map(|(a, b)| a * b).sum(),
    }
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let shapes = matrices(site.shape(0)?, site.shape(1)?)?;
    let g = b.reshape(g, &product_shape(&shapes[0], &shapes[1])?)?;
    let mut parts = Vec::new();
    for place in 0..2 {
        if b.wants(site, place) {
            let other = b.reshape(site.input(1 - place)?, &shapes[1 - place])?;
            let other = b.flip(&other)?;
            let product =
                if place == 0 { b.binary("MatMul", &g, &other)? } else { b.binary("MatMul", &other, &g)? };
            let sum = b.sum_to(&product, &shapes[place])?;
            parts.push((place, b.reshape(&sum, site.shape(place)?)?));
        }
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_are_right_for_matrices_stacks_and_vectors() {
        for case in [
            "matmul",
            "matmul/right",
            "matmul/stacks",
            "matmul/stacks_right",
            "matmul/vector",
            "matmul/vector_right",
            "matmul/both",
        ] {
            check(case);
        }
    }
}
