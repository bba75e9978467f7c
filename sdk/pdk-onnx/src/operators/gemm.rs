//! `Gemm`: a product of two matrices, and a sum.

use pdk_sdk::error::{Error, Result};

use super::inputs::optional;
use super::matmul;
use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::{Tensor, broadcast, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("Gemm", infer, evaluate, Rule::First(gradient))];

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let (a, b) = (site.shape(0)?, site.shape(1)?);
    let wrong =
        || Error::new(format!("its matrices {} and {} do not go together", shape_text(a), shape_text(b)));
    let (&[mut rows, mut inner], &[mut other, mut columns]) = (a, b) else { return Err(wrong()) };
    if site.int("transA", 0) != 0 {
        std::mem::swap(&mut rows, &mut inner);
    }
    if site.int("transB", 0) != 0 {
        std::mem::swap(&mut other, &mut columns);
    }
    if inner != other {
        return Err(wrong());
    }
    let shape = vec![rows, columns];
    if site.optional(2).is_some() && broadcast(&[&shape, site.shape(2)?])? != shape {
        let (sum, product) = (shape_text(site.shape(2)?), shape_text(&shape));
        return Err(Error::new(format!("its sum of the shape {sum} is larger than its product {product}")));
    }
    Ok(vec![Fact::new(site.fact(0)?.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (a, b) = (given(inputs, 0)?, given(inputs, 1)?);
    let c = optional(inputs, 2);
    let (alpha, beta) = (site.float("alpha", 1.0), site.float("beta", 1.0));
    let (turned_a, turned_b) = (site.int("transA", 0) != 0, site.int("transB", 0) != 0);
    let inner = a.shape[usize::from(!turned_a)];
    let result = Tensor::from_fn(a.element, site.output_shape()?, |at| {
        let product = |k: usize| {
            let left = if turned_a { a.values[k * a.shape[1] + at[0]] } else { a.values[at[0] * inner + k] };
            let right = if turned_b { b.values[at[1] * inner + k] } else { b.values[k * b.shape[1] + at[1]] };
            (left, right)
        };
        let sum = matmul::sum_of_products(a.element, (0..inner).map(product));
        let result = alpha * sum + c.map_or(0.0, |c| beta * c.broadcast_at(at));
        // The sum of two integers wraps, as each of them does.
        if a.element.is_integer() { a.element.wrapped(result as i128) } else { result }
    });
    Ok(vec![result?])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let turned = [site.int("transA", 0) != 0, site.int("transB", 0) != 0];
    // An input as it is multiplied, or the transpose of that.
    let matrix = |b: &mut Builder, place: usize, transposed: bool| match turned[place] != transposed {
        true => b.flip(site.input(place)?),
        false => Ok(site.input(place)?.to_owned()),
    };
    let mut parts = Vec::new();
    // For Y = A B the gradients are G B' and A' G, and the transposes of these where A or B is transposed.
    for place in [0, 1].into_iter().filter(|&place| b.wants(site, place)).collect::<Vec<_>>() {
        let other = matrix(b, 1 - place, !turned[place])?;
        let g = if turned[place] { b.flip(g)? } else { g.to_owned() };
        let product = if (place == 0) != turned[place] {
            b.binary("MatMul", &g, &other)
        } else {
            b.binary("MatMul", &other, &g)
        };
        parts.push((place, b.scale(&product?, site.float("alpha", 1.0))?));
    }
    if b.wants(site, 2) {
        let sum = b.sum_to(g, site.shape(2)?)?;
        parts.push((2, b.scale(&sum, site.float("beta", 1.0))?));
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use crate::tensor::{Element, Tensor};
    use crate::testing::{check, computed};

    #[test]
    fn products_of_integers_are_exact_and_sums_that_are_too_large_are_refused() {
        let summed = |shape: &[usize]| {
            computed(13, |s| {
                let [a, b, c] = [("a", &[1, 2][..]), ("b", &[2, 1]), ("c", shape)].map(|(name, shape)| {
                    s.weights(name, Tensor::filled(Element::INT32, shape, 2147483647.0).unwrap())
                });
                s.node("Gemm", &[&a, &b, &c], "y", &[]);
            })
        };
        // Of two times the square of 2^31 - 1 the low bits are 2. The sum with 2^31 - 1 wraps once more.
        assert_eq!(summed(&[1]).unwrap().values, [-2147483647.0]);
        let error = summed(&[3]).unwrap_err().to_string();
        assert!(error.contains("its sum of the shape (3) is larger"), "{error}");
    }

    #[test]
    fn gradients_are_right_for_each_order_of_the_matrices() {
        for case in [
            "gemm",
            "gemm/a",
            "gemm/b",
            "gemm/both",
            "gemm/right",
            "gemm/right_a",
            "gemm/right_b",
            "gemm/right_both",
            "gemm/sum",
        ] {
            check(case);
        }
    }
}
