//! `CenterCropPad`: cuts an axis on both sides, or puts zeros there, until it has a given length.

use pdk_sdk::error::{Error, Result};

use super::inputs::{deciding, taken};
use super::operator::{Operator, Rule};
use super::positions::{index, lengths, strides};
use crate::site::{Site, axes};
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("CenterCropPad", infer, evaluate, Rule::Unknown)];

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    let rank = fact.shape.len();
    let axes = site.ints("axes").map_or_else(|| Ok((0..rank).collect()), |list| axes(list, rank))?;
    let size = deciding(site, 1)?.ok_or_else(|| Error::new("its input 2 is missing"))?.to_ints();
    let size = lengths(&size, "shape")?;
    if size.len() != axes.len() {
        return Err(Error::new(format!("it has {} lengths for {} axes", size.len(), axes.len())));
    }
    let mut shape = fact.shape.clone();
    for (axis, length) in axes.into_iter().zip(size) {
        shape[axis] = length;
    }
    Ok(vec![Fact::new(fact.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (fact, input) = (infer(site)?.swap_remove(0), taken(site, inputs, 0)?);
    let strides = strides(&input.shape);
    let mut from = vec![0; input.shape.len()];
    let value = |at: &[usize]| {
        for (axis, from) in from.iter_mut().enumerate() {
            let (old, new) = (input.shape[axis], fact.shape[axis]);
            // If the difference is odd, the smaller half is in front.
            let place = match old >= new {
                true => Some(at[axis] + (old - new) / 2),
                false => at[axis].checked_sub((new - old) / 2),
            };
            match place.filter(|&place| place < old) {
                Some(place) => *from = place,
                None => return 0.0,
            }
        }
        input.values[index(&strides, &from)]
    };
    Ok(vec![Tensor::from_fn(fact.element, &fact.shape, value)?])
}

#[cfg(test)]
mod tests {
    use crate::tensor::Tensor;
    use crate::testing::Setting::Ints;
    use crate::testing::computed;

    fn resized(size: &[i64], axes: &[i64]) -> pdk_sdk::error::Result<Tensor> {
        computed(18, |s| {
            let x = s.weights("x", Tensor::floats(&[2, 3], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
            let size = s.ints(size);
            s.node("CenterCropPad", &[&x, &size], "y", &[("axes", Ints(axes))]);
        })
    }

    #[test]
    fn sizes_and_axes_that_do_not_fit_are_errors() {
        assert_eq!(resized(&[3, 2], &[0, -1]).unwrap().values, [1.0, 2.0, 4.0, 5.0, 0.0, 0.0]);
        assert_eq!(resized(&[0], &[0]).unwrap().shape, [0, 3]);
        for (size, axes) in [
            (&[3][..], &[0, 1][..]),
            (&[3, 3], &[1]),
            (&[3, 3], &[1, 1]),
            (&[3], &[2]),
            (&[-3], &[0]),
            (&[i64::MAX], &[0]),
        ] {
            assert!(resized(size, axes).is_err(), "{size:?} {axes:?}");
        }
    }
}
