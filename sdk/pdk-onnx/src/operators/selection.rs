//! `ArgMax` and `ArgMin`, the places of the greatest and the least elements, and `TopK`, the first ones in their order.

use std::cmp::Ordering;

use pdk_sdk::error::{Error, Result};

use super::inputs::{deciding, single, taken};
use super::operator::{Operator, Rule};
use crate::site::{Site, axis};
use crate::tensor::{Element, Tensor};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("ArgMax", infer_place, |site, inputs| place(site, inputs, Ordering::Greater), Rule::Zero),
    Operator::new("ArgMin", infer_place, |site, inputs| place(site, inputs, Ordering::Less), Rule::Zero),
    Operator::new("TopK", infer_top, top, Rule::Unknown),
];

/// The order of two elements. What is not a number comes last.
fn order(a: f64, b: f64) -> Ordering {
    a.partial_cmp(&b).unwrap_or_else(|| a.is_nan().cmp(&b.is_nan()))
}

/// The elements along an axis, in the order of the places of what comes out, whose shape has a length of its own along it.
fn lines(input: &Tensor, axis: usize) -> impl Iterator<Item = Vec<f64>> {
    let length = input.shape[axis];
    let inner: usize = input.shape[axis + 1..].iter().product();
    let blocks = input.values.chunks((length * inner).max(1));
    blocks.flat_map(move |block| {
        (0..inner).map(move |column| block.iter().skip(column).step_by(inner).copied().collect())
    })
}

fn infer_place(site: &Site<'_>) -> Result<Vec<Fact>> {
    let mut shape = site.shape(0)?.to_vec();
    let axis = axis(site.int("axis", 0), shape.len())?;
    if shape[axis] == 0 {
        return Err(Error::new("its axis has no elements"));
    }
    match site.int("keepdims", 1) {
        0 => drop(shape.remove(axis)),
        _ => shape[axis] = 1,
    }
    Ok(vec![Fact::new(Element::INT64, shape)])
}

fn place(site: &Site<'_>, inputs: &[Option<&Tensor>], further: Ordering) -> Result<Vec<Tensor>> {
    let (fact, input) = (infer_place(site)?.swap_remove(0), taken(site, inputs, 0)?);
    let axis = axis(site.int("axis", 0), input.shape.len())?;
    let last = site.int("select_last_index", 0) != 0;
    let place = |line: Vec<f64>| {
        let mut best = 0;
        for place in 1..line.len() {
            let order = order(line[place], line[best]);
            if order == further || last && order.is_eq() {
                best = place;
            }
        }
        best as f64
    };
    let values = lines(input, axis).map(place).collect();
    Ok(vec![Tensor { element: fact.element, shape: fact.shape, values }])
}

/// The axis and how many of its elements are wanted.
fn wanted(site: &Site<'_>) -> Result<(usize, usize)> {
    let shape = site.shape(0)?;
    let axis = axis(site.int("axis", -1), shape.len())?;
    let count = match deciding(site, 1)? {
        Some(count) => single(&count, "count")? as i64,
        None => site.optional_int("k").ok_or_else(|| Error::new("its `k` is missing"))?,
    };
    match usize::try_from(count) {
        Ok(count) if count <= shape[axis] => Ok((axis, count)),
        _ => Err(Error::new(format!("its axis has {} elements, but {count} are wanted", shape[axis]))),
    }
}

fn infer_top(site: &Site<'_>) -> Result<Vec<Fact>> {
    let (axis, count) = wanted(site)?;
    let fact = site.fact(0)?;
    let mut shape = fact.shape.clone();
    shape[axis] = count;
    Ok(vec![Fact::new(fact.element, shape.clone()), Fact::new(Element::INT64, shape)])
}

fn top(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let ((axis, count), input) = (wanted(site)?, taken(site, inputs, 0)?);
    let mut shape = input.shape.clone();
    shape[axis] = count;
    let mut values = Tensor::filled(input.element, &shape, 0.0)?;
    let mut places = Tensor { element: Element::INT64, ..values.clone() };
    let inner: usize = shape[axis + 1..].iter().product();
    let largest = site.int("largest", 1) != 0;
    for (number, line) in lines(input, axis).enumerate() {
        let mut sorted: Vec<usize> = (0..line.len()).collect();
        // The sort is stable: of equal elements the first comes first.
        sorted.sort_by(|&a, &b| if largest { order(line[b], line[a]) } else { order(line[a], line[b]) });
        for (rank, place) in sorted.into_iter().take(count).enumerate() {
            let to = (number / inner * count + rank) * inner + number % inner;
            values.values[to] = line[place];
            places.values[to] = place as f64;
        }
    }
    Ok(vec![values, places])
}

#[cfg(test)]
mod tests {
    use crate::tensor::Tensor;
    use crate::testing::Setting::Int;
    use crate::testing::computed;

    #[test]
    fn axes_and_counts_outside_are_errors() {
        let place = |shape: &[usize], axis: i64| {
            computed(13, |s| {
                let x = s.drawn(shape, -1.0, 1.0);
                s.node("ArgMax", &[&x], "y", &[("axis", Int(axis))]);
            })
        };
        assert!(place(&[2, 3], -1).is_ok());
        assert!(place(&[2, 3], 2).is_err());
        assert!(place(&[2, 0], 1).is_err());
        assert_eq!(place(&[2, 0], 0).unwrap().shape, [1, 0]);
        assert!(place(&[], 0).is_err());
        let top = |counts: &[i64], axis: i64| {
            computed(13, |s| {
                let (x, count) = (s.drawn(&[2, 3], -1.0, 1.0), s.ints(counts));
                s.node("TopK", &[&x, &count], "y", &[("axis", Int(axis))]);
            })
        };
        assert_eq!(top(&[0], 0).unwrap().shape, [0, 3]);
        for (counts, axis) in [(&[4][..], 1), (&[-1], 1), (&[1, 1], 1), (&[], 1), (&[1], 2)] {
            assert!(top(counts, axis).is_err(), "{counts:?} {axis}");
        }
        let attribute = computed(9, |s| {
            let x = s.drawn(&[2, 3], -1.0, 1.0);
            s.node("TopK", &[&x], "y", &[("k", Int(2))]);
        });
        assert_eq!(attribute.unwrap().shape, [2, 2]);
    }

    #[test]
    fn what_is_not_a_number_is_the_greatest() {
        let x = Tensor::floats(&[4], vec![1.0, f64::NAN, 3.0, f64::NAN]);
        for (operator, expected) in [("ArgMax", 1.0), ("ArgMin", 0.0)] {
            let result = computed(13, |s| {
                let x = s.weights("x", x.clone());
                s.node(operator, &[&x], "y", &[]);
            });
            assert_eq!(result.unwrap().values, [expected]);
        }
    }

    #[test]
    fn a_count_that_is_computed_is_an_error_that_names_the_remedy() {
        let result = computed(13, |s| {
            s.input("count", &[1]);
            let x = s.drawn(&[2, 3], -1.0, 1.0);
            s.node("TopK", &[&x, "count"], "y", &[]);
        });
        assert_eq!(
            result.unwrap_err().to_string(),
            "node `topk_0` (TopK): the size of what it computes depends on values: its input `count` has to be a constant, \
             but is computed"
        );
    }
}
