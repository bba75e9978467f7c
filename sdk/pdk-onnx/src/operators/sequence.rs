//! `CumSum` and `ReverseSequence`: what happens along an axis, in its order.

use pdk_sdk::error::{Error, Result};

use super::inputs::{single, taken};
use super::operator::{Operator, Parts, Rule, same};
use super::positions::{index, strides};
use crate::attributes::int;
use crate::builder::Builder;
use crate::site::{Site, axis};
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("CumSum", same, cumulate, Rule::First(gradient)),
    Operator::new("ReverseSequence", infer_reversed, reverse, Rule::Unknown),
];

fn cumulate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let input = taken(site, inputs, 0)?;
    let axis = axis(single(taken(site, inputs, 1)?, "axis")? as i64, input.shape.len())?;
    let (exclusive, backwards) = (site.int("exclusive", 0) != 0, site.int("reverse", 0) != 0);
    let (length, inner) = (input.shape[axis], input.shape[axis + 1..].iter().product::<usize>());
    let mut result = input.clone();
    for block in result.values.chunks_mut((length * inner).max(1)) {
        for column in 0..inner {
            let mut total = 0.0;
            for place in 0..length {
                let place = if backwards { length - 1 - place } else { place };
                let value = &mut block[place * inner + column];
                let next = input.element.sum(total, *value);
                *value = if exclusive { total } else { next };
                total = next;
            }
        }
    }
    Ok(vec![result])
}

/// What is added to all later sums gets the sum of all later gradients.
fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let attributes =
        [int("exclusive", site.int("exclusive", 0)), int("reverse", i64::from(site.int("reverse", 0) == 0))];
    Ok(vec![(0, b.node("CumSum", &[g, site.input(1)?], attributes.into())?)])
}

/// The axes of the batch and of the time.
fn batch_and_time(site: &Site<'_>) -> Result<[usize; 2]> {
    let shape = site.shape(0)?;
    let (batch, time) =
        (axis(site.int("batch_axis", 1), shape.len())?, axis(site.int("time_axis", 0), shape.len())?);
    if batch == time {
        return Err(Error::new("its `batch_axis` and its `time_axis` are one axis"));
    }
    if site.shape(1)? != [shape[batch]] {
        return Err(Error::new("it does not have one length for each sequence of its batch"));
    }
    Ok([batch, time])
}

fn infer_reversed(site: &Site<'_>) -> Result<Vec<Fact>> {
    batch_and_time(site)?;
    same(site)
}

fn reverse(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let [batch, time] = batch_and_time(site)?;
    let (input, lengths) = (taken(site, inputs, 0)?, taken(site, inputs, 1)?.to_ints());
    let whole = input.shape[time];
    let length = |length: &i64| usize::try_from(*length).ok().filter(|&length| length <= whole);
    let lengths: Option<Vec<_>> = lengths.iter().map(length).collect();
    let lengths =
        lengths.ok_or_else(|| Error::new(format!("one of its lengths is outside the {whole} elements")))?;
    let strides = strides(&input.shape);
    let value = |at: &[usize]| {
        let (place, length) = (at[time], lengths[at[batch]]);
        let from = if place < length { length - 1 - place } else { place };
        input.values[index(&strides, at) - place * strides[time] + from * strides[time]]
    };
    Ok(vec![Tensor::from_fn(input.element, &input.shape, value)?])
}

#[cfg(test)]
mod tests {
    use crate::testing::Setting::Int;
    use crate::testing::computed;

    #[test]
    fn axes_and_lengths_outside_are_errors() {
        let summed = |axes: &[i64]| {
            computed(14, |s| {
                let (x, axis) = (s.drawn(&[2, 3], -1.0, 1.0), s.ints(axes));
                s.node("CumSum", &[&x, &axis], "y", &[]);
            })
        };
        assert!(summed(&[1]).is_ok());
        for axes in [&[2][..], &[-3], &[i64::MIN], &[0, 1], &[]] {
            assert!(summed(axes).is_err(), "{axes:?}");
        }
        let reversed = |lengths: &[i64], time: i64| {
            computed(14, |s| {
                let (x, lengths) = (s.drawn(&[2, 3], -1.0, 1.0), s.ints(lengths));
                s.node("ReverseSequence", &[&x, &lengths], "y", &[("time_axis", Int(time))]);
            })
        };
        assert!(reversed(&[0, 1, 2], 0).is_ok());
        assert!(reversed(&[0, 1, 3], 0).is_err());
        assert!(reversed(&[0, 1, -1], 0).is_err());
        assert!(reversed(&[0, 1], 0).is_err());
        assert!(reversed(&[0, 1, 2], 1).is_err());
        assert!(reversed(&[0, 1, 2], 7).is_err());
    }
}
