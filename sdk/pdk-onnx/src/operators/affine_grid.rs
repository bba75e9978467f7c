//! `AffineGrid`: the points at which an image is read after a rotation, a shift or a change of size.

use pdk_sdk::error::{Error, Result};

use super::inputs::{deciding, taken};
use super::operator::{Operator, Rule};
use super::positions::lengths;
use crate::site::Site;
use crate::tensor::{Tensor, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("AffineGrid", infer, evaluate, Rule::Unknown)];

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    let size = deciding(site, 1)?.ok_or_else(|| Error::new("its input 2 is missing"))?.to_ints();
    let size = lengths(&size, "size")?;
    let axes = size.len().saturating_sub(2);
    if !(2..=3).contains(&axes) || fact.shape != [size[0], axes, axes + 1] {
        return Err(Error::new(format!(
            "its matrices {} do not fit an image of the size {size:?}",
            shape_text(&fact.shape)
        )));
    }
    let shape = [&size[..1], &size[2..], &[axes]].concat();
    Ok(vec![Fact::new(fact.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (fact, matrices) = (infer(site)?.swap_remove(0), taken(site, inputs, 0)?);
    let axes = fact.shape.len() - 2;
    let corners = site.int("align_corners", 0) != 0;
    let point = |at: usize, length: usize| match corners {
        true if length == 1 => 0.0,
        true => 2.0 * at as f64 / (length - 1) as f64 - 1.0,
        false => (2 * at + 1) as f64 / length as f64 - 1.0,
    };
    let value = |at: &[usize]| {
        let row = &matrices.values[(at[0] * axes + at[axes + 1]) * (axes + 1)..][..axes + 1];
        // The first number of a point belongs to the last axis.
        let along = |axis: usize| row[axis] * point(at[axes - axis], fact.shape[axes - axis]);
        (0..axes).map(along).sum::<f64>() + row[axes]
    };
    Ok(vec![Tensor::from_fn(fact.element, &fact.shape, value)?])
}

#[cfg(test)]
mod tests {
    use crate::testing::Setting::Int;
    use crate::testing::computed;

    #[test]
    fn matrices_and_sizes_that_do_not_fit_are_errors() {
        let grid = |matrices: &[usize], size: &[i64]| {
            computed(20, |s| {
                let (matrices, size) = (s.drawn(matrices, -1.0, 1.0), s.ints(size));
                s.node("AffineGrid", &[&matrices, &size], "y", &[("align_corners", Int(1))]);
            })
        };
        assert_eq!(grid(&[1, 2, 3], &[1, 3, 1, 4]).unwrap().shape, [1, 1, 4, 2]);
        assert_eq!(grid(&[1, 2, 3], &[1, 3, 0, 4]).unwrap().shape, [1, 0, 4, 2]);
        for size in [
            &[1, 3, 4][..],
            &[1],
            &[],
            &[2, 3, 4, 4],
            &[1, 3, 4, 4, 4],
            &[1, 3, -4, 4],
            &[1, 3, i64::MAX, i64::MAX],
        ] {
            assert!(grid(&[1, 2, 3], size).is_err(), "{size:?}");
        }
        assert!(grid(&[2, 3], &[1, 3, 4, 4]).is_err());
    }
}
