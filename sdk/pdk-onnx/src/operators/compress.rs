//! `Compress`, which keeps what a condition selects, and `NonZero`, the positions of elements that are not zero: their sizes depend on values,
//! which have to be constant.

use pdk_sdk::error::{Error, Result};

use super::inputs::{deciding, taken};
use super::operator::{Operator, Rule, given};
use crate::site::{Site, axis};
use crate::tensor::{Element, Tensor, for_each_position};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Compress", infer_compressed, compress, Rule::Unknown),
    Operator::new("NonZero", infer_positions, positions, Rule::Zero),
];

/// The axis along which parts are kept, and its length. Without an axis all elements are in one.
fn along(site: &Site<'_>) -> Result<(Option<usize>, usize)> {
    let shape = site.shape(0)?;
    match site.optional_int("axis") {
        Some(number) => axis(number, shape.len()).map(|axis| (Some(axis), shape[axis])),
        None => Ok((None, shape.iter().product())),
    }
}

/// The places that a condition selects.
fn selected(condition: &Tensor, length: usize) -> Result<Vec<usize>> {
    if condition.shape.len() != 1 || condition.values.len() > length {
        return Err(Error::new(format!(
            "its condition has {} elements, but has to be one row of at most {length}",
            condition.values.len()
        )));
    }
    let places = condition.values.iter().enumerate();
    Ok(places.filter(|(_, value)| **value != 0.0).map(|(place, _)| place).collect())
}

fn infer_compressed(site: &Site<'_>) -> Result<Vec<Fact>> {
    let (axis, length) = along(site)?;
    let condition = deciding(site, 1)?.ok_or_else(|| Error::new("its input 2 is missing"))?;
    let count = selected(&condition, length)?.len();
    let mut fact = site.fact(0)?.clone();
    match axis {
        Some(axis) => fact.shape[axis] = count,
        None => fact.shape = vec![count],
    }
    Ok(vec![fact])
}

fn compress(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let ((axis, length), input) = (along(site)?, taken(site, inputs, 0)?);
    let places = selected(given(inputs, 1)?, length)?;
    let inner: usize = axis.map_or(1, |axis| input.shape[axis + 1..].iter().product());
    let rows = input.values.chunks((length * inner).max(1));
    let values =
        rows.flat_map(|row| places.iter().flat_map(|&place| &row[place * inner..(place + 1) * inner]));
    let values = values.copied().collect();
    let mut shape = input.shape.clone();
    match axis {
        Some(axis) => shape[axis] = places.len(),
        None => shape = vec![places.len()],
    }
    Ok(vec![Tensor { element: input.element, shape, values }])
}

fn infer_positions(site: &Site<'_>) -> Result<Vec<Fact>> {
    let input = deciding(site, 0)?.ok_or_else(|| Error::new("its input 1 is missing"))?;
    let count = input.values.iter().filter(|value| **value != 0.0).count();
    Ok(vec![Fact::new(Element::INT64, vec![input.shape.len(), count])])
}

fn positions(_: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    let mut found = vec![Vec::new(); input.shape.len()];
    let mut values = input.values.iter();
    let mut count = 0;
    for_each_position(&input.shape, |at| {
        if values.next().is_some_and(|value| *value != 0.0) {
            count += 1;
            found.iter_mut().zip(at).for_each(|(found, &at)| found.push(at as f64));
        }
    });
    Ok(vec![Tensor { element: Element::INT64, shape: vec![found.len(), count], values: found.concat() }])
}

#[cfg(test)]
mod tests {
    use crate::tensor::{Element, Tensor};
    use crate::testing::Setting::Int;
    use crate::testing::computed;

    #[test]
    fn conditions_that_do_not_fit_are_errors() {
        let compressed = |condition: &[i64], shape: &[usize], axis: i64| {
            computed(11, |s| {
                let x = s.drawn(&[2, 3], -1.0, 1.0);
                let condition =
                    Tensor { element: Element::BOOL, shape: shape.to_vec(), ..Tensor::ints(condition) };
                let condition = s.weights("condition", condition);
                s.node("Compress", &[&x, &condition], "y", &[("axis", Int(axis))]);
            })
        };
        assert_eq!(compressed(&[1], &[1], 1).unwrap().shape, [2, 1]);
        assert_eq!(compressed(&[], &[0], 0).unwrap().shape, [0, 3]);
        assert!(compressed(&[1, 0, 1], &[3], 0).is_err());
        assert!(compressed(&[1, 0], &[2, 1], 0).is_err());
        assert!(compressed(&[1, 0], &[2], 2).is_err());
        let scalar = computed(13, |s| {
            let x = s.weights("x", Tensor::floats(&[], vec![2.0]));
            s.node("NonZero", &[&x], "y", &[]);
        });
        assert_eq!(scalar.unwrap().shape, [0, 1]);
    }

    #[test]
    fn values_that_are_computed_are_errors() {
        for operator in ["NonZero", "Compress"] {
            let result = computed(13, |s| {
                s.input("x", &[2]);
                s.node(operator, &["x", if operator == "Compress" { "x" } else { "" }], "y", &[]);
            });
            let error = result.unwrap_err().to_string();
            assert!(error.contains("has to be a constant"), "{error}");
        }
    }
}
