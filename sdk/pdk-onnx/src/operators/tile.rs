//! `Tile`: repeats a value along its axes.

use pdk_sdk::error::{Error, Result};

use super::inputs::{deciding, taken};
use super::operator::{Operator, Parts, Rule};
use super::positions::{index, lengths, strides};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("Tile", infer, evaluate, Rule::First(gradient))];

/// How often the value is repeated along each axis.
fn repeats(site: &Site<'_>) -> Result<Vec<usize>> {
    let rank = site.shape(0)?.len();
    let list = deciding(site, 1)?.ok_or_else(|| Error::new("its input 2 is missing"))?.to_ints();
    match lengths(&list, "repeats")? {
        repeats if repeats.len() == rank => Ok(repeats),
        repeats => {
            Err(Error::new(format!("it has {} repeats, but its input has {rank} axes", repeats.len())))
        }
    }
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    let repeats = repeats(site)?;
    let shape = fact.shape.iter().zip(&repeats).map(|(dim, times)| dim.checked_mul(*times));
    let shape: Option<Vec<_>> = shape.collect();
    let shape = shape.ok_or_else(|| Error::new(format!("its repeats {repeats:?} are too large")))?;
    Ok(vec![Fact::new(fact.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let input = taken(site, inputs, 0)?;
    let (shape, strides) = (infer(site)?.swap_remove(0).shape, strides(&input.shape));
    let mut from = vec![0; shape.len()];
    let value = |at: &[usize]| {
        from.iter_mut().zip(at).zip(&input.shape).for_each(|((from, at), dim)| *from = at % dim);
        input.values[index(&strides, &from)]
    };
    Ok(vec![Tensor::from_fn(input.element, &shape, value)?])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let (shape, repeats) = (site.shape(0)?, repeats(site)?);
    // Each axis as two: which repetition, and the place in it.
    let parted: Vec<_> = repeats.iter().zip(shape).flat_map(|(&times, &dim)| [times, dim]).collect();
    let axes: Vec<_> = (0..shape.len()).filter(|&axis| repeats[axis] != 1).map(|axis| 2 * axis).collect();
    let g = b.reshape(g, &parted)?;
    let g = b.sum(&g, &axes)?;
    Ok(vec![(0, b.reshape(&g, shape)?)])
}

#[cfg(test)]
mod tests {
    use crate::testing::{check, computed};

    #[test]
    fn gradients_are_summed_over_repetitions() {
        for case in ["tile", "tile/one_axis"] {
            check(case);
        }
    }

    #[test]
    fn repeats_that_do_not_fit_are_errors_and_none_leave_nothing() {
        let tiled = |repeats: &[i64]| {
            computed(13, |s| {
                let x = s.drawn(&[2, 3], -1.0, 1.0);
                let repeats = s.ints(repeats);
                s.node("Tile", &[&x, &repeats], "y", &[]);
            })
        };
        for repeats in [&[2][..], &[1, 1, 1], &[-1, 1], &[i64::MAX, 1], &[1 << 40, 1 << 40]] {
            assert!(tiled(repeats).is_err(), "{repeats:?}");
        }
        assert_eq!(tiled(&[0, 2]).unwrap().shape, [0, 6]);
        let missing = computed(13, |s| {
            let x = s.drawn(&[2, 3], -1.0, 1.0);
            s.node("Tile", &[&x], "y", &[]);
        });
        assert!(missing.unwrap_err().to_string().ends_with("its input 2 is missing"));
    }
}
