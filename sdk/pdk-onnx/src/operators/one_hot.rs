//! `OneHot`: each index becomes a row that is on at one place and off elsewhere.

use pdk_sdk::error::{Error, Result};

use super::inputs::{deciding, single, taken};
use super::operator::{Operator, Rule};
use crate::site::{Site, axis};
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("OneHot", infer, evaluate, Rule::First(gradient))];

/// The axis that is added, and its length.
fn added(site: &Site<'_>) -> Result<(usize, usize)> {
    let axis = axis(site.int("axis", -1), site.shape(0)?.len() + 1)?;
    let depth = deciding(site, 1)?.ok_or_else(|| Error::new("its input 2 is missing"))?;
    let depth = single(&depth, "depth")?;
    if !(0.0..1e15).contains(&depth) {
        return Err(Error::new(format!("its depth {depth} is not a length")));
    }
    Ok((axis, depth as usize))
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let (axis, depth) = added(site)?;
    let values = site.fact(2)?;
    if values.shape != [2] {
        return Err(Error::new("its input 3 has to hold two numbers, that for off and that for on"));
    }
    let mut shape = site.shape(0)?.to_vec();
    shape.insert(axis, depth);
    Ok(vec![Fact::new(values.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let ((axis, depth), fact) = (added(site)?, infer(site)?.swap_remove(0));
    let (indices, values) = (taken(site, inputs, 0)?, taken(site, inputs, 2)?);
    let mut result = Tensor::filled(fact.element, &fact.shape, values.values[0])?;
    let inner: usize = indices.shape[axis..].iter().product();
    for (place, &index) in indices.values.iter().enumerate() {
        // An index outside leaves its row off.
        let index = index.trunc();
        let counted = if index < 0.0 { index + depth as f64 } else { index };
        if counted >= 0.0 && counted < depth as f64 {
            let (row, column) = (place / inner, place % inner);
            result.values[(row * depth + counted as usize) * inner + column] = values.values[1];
        }
    }
    Ok(vec![result])
}

/// It is constant in steps of the indices; the numbers for off and on have no gradient here.
fn gradient(_: &Site<'_>, _: &mut crate::builder::Builder, _: &str) -> Result<super::operator::Parts> {
    Ok(Vec::new())
}

#[cfg(test)]
mod tests {
    use crate::tensor::Tensor;
    use crate::testing::Setting::Int;
    use crate::testing::computed;

    fn on(indices: &[f64], depth: f64, values: usize, axis: i64) -> pdk_sdk::error::Result<Tensor> {
        computed(11, |s| {
            let indices = s.weights("indices", Tensor::floats(&[indices.len()], indices.to_vec()));
            let depth = s.weights("depth", Tensor::floats(&[], vec![depth]));
            let values = s.weights("values", Tensor::floats(&[values], vec![0.5; values]));
            s.node("OneHot", &[&indices, &depth, &values], "y", &[("axis", Int(axis))]);
        })
    }

    #[test]
    fn depths_that_are_not_lengths_are_errors() {
        for depth in [-1.0, f64::NAN, 1e30, 1e14] {
            assert!(on(&[0.0], depth, 2, -1).is_err(), "{depth}");
        }
        assert!(on(&[0.0], 3.0, 1, -1).is_err());
        assert!(on(&[0.0], 3.0, 2, 2).is_err());
        assert_eq!(on(&[0.0], 0.0, 2, 0).unwrap().shape, [0, 1]);
        let far = on(&[1e300, -1e300, f64::NAN, -4.0], 3.0, 2, 0).unwrap();
        assert_eq!(far.shape, [3, 4]);
    }
}
