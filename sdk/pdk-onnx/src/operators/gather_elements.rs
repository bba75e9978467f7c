//! `GatherElements` and `GatherND`: single elements or blocks, each from a place of its own.

use pdk_sdk::error::{Error, Result};

use super::inputs::taken;
use super::operator::{Operator, Rule};
use super::positions::{counted, index, strides};
use crate::site::{Site, axis};
use crate::tensor::{Tensor, elements, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("GatherElements", infer_elements, gather_elements, Rule::Unknown),
    Operator::new("GatherND", infer_blocks, gather_blocks, Rule::Unknown),
];

/// The axis along which indices count, if they fit the data on all others.
pub fn along(site: &Site<'_>) -> Result<usize> {
    let (data, indices) = (site.shape(0)?, site.shape(1)?);
    let along = axis(site.int("axis", 0), data.len())?;
    let fits = |place: usize| place == along || indices[place] <= data[place];
    if indices.len() == data.len() && (0..data.len()).all(fits) {
        return Ok(along);
    }
    Err(unfit(site))
}

/// Says that data and indices do not go together.
pub fn unfit(site: &Site<'_>) -> Error {
    let text = |place| site.shape(place).map(shape_text).unwrap_or_default();
    Error::new(format!("its indices {} do not fit its data {}", text(1), text(0)))
}

fn infer_elements(site: &Site<'_>) -> Result<Vec<Fact>> {
    along(site)?;
    Ok(vec![Fact::new(site.fact(0)?.element, site.shape(1)?.to_vec())])
}

fn gather_elements(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let along = along(site)?;
    let (data, indices) = (taken(site, inputs, 0)?, taken(site, inputs, 1)?);
    let strides = strides(&data.shape);
    let mut values = Vec::with_capacity(elements(&indices.shape)?);
    let mut places = Vec::with_capacity(indices.values.len());
    crate::tensor::for_each_position(&indices.shape, |at| {
        places.push(index(&strides, at) - at[along] * strides[along]);
    });
    for (place, &index) in places.into_iter().zip(&indices.values) {
        values.push(data.values[place + counted(index, data.shape[along])? * strides[along]]);
    }
    Ok(vec![Tensor { element: data.element, shape: indices.shape.clone(), values }])
}

/// The number of axes of the batch, and the number of axes that an index counts along.
fn batch_and_depth(site: &Site<'_>) -> Result<(usize, usize)> {
    let (data, indices) = (site.shape(0)?, site.shape(1)?);
    let batch = usize::try_from(site.int("batch_dims", 0)).unwrap_or(usize::MAX);
    let Some(&depth) = indices.last() else { return Err(unfit(site)) };
    let fits = batch < data.len().min(indices.len())
        && (1..=data.len() - batch).contains(&depth)
        && data[..batch] == indices[..batch];
    if fits { Ok((batch, depth)) } else { Err(unfit(site)) }
}

fn infer_blocks(site: &Site<'_>) -> Result<Vec<Fact>> {
    let (batch, depth) = batch_and_depth(site)?;
    let (data, indices) = (site.fact(0)?, site.shape(1)?);
    let shape = [&indices[..indices.len() - 1], &data.shape[batch + depth..]].concat();
    Ok(vec![Fact::new(data.element, shape)])
}

fn gather_blocks(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let ((batch, depth), fact) = (batch_and_depth(site)?, infer_blocks(site)?.swap_remove(0));
    let (data, indices) = (taken(site, inputs, 0)?, taken(site, inputs, 1)?);
    let mut values = Vec::with_capacity(elements(&fact.shape)?);
    let block: usize = data.shape[batch + depth..].iter().product();
    let of_batch: usize = data.shape[batch..].iter().product();
    let rows: usize = indices.shape[batch..indices.shape.len() - 1].iter().product();
    for (row, list) in indices.values.chunks(depth).enumerate() {
        let mut place = 0;
        for (&index, &length) in list.iter().zip(&data.shape[batch..]) {
            place = place * length + counted(index, length)?;
        }
        let start = row / rows * of_batch + place * block;
        values.extend_from_slice(&data.values[start..start + block]);
    }
    Ok(vec![Tensor { element: data.element, shape: fact.shape, values }])
}

#[cfg(test)]
mod tests {
    use crate::tensor::Tensor;
    use crate::testing::Setting::Int;
    use crate::testing::computed;

    fn gathered(operator: &str, setting: (&str, i64), shape: &[usize], indices: &[i64]) -> bool {
        let result = computed(13, |s| {
            let x = s.drawn(&[2, 3], -1.0, 1.0);
            let indices = s.weights("indices", Tensor { shape: shape.to_vec(), ..Tensor::ints(indices) });
            s.node(operator, &[&x, &indices], "y", &[(setting.0, Int(setting.1))]);
        });
        result.is_ok()
    }

    #[test]
    fn indices_outside_and_shapes_that_do_not_fit_are_errors() {
        let elements = |axis, shape: &[usize], indices: &[i64]| {
            gathered("GatherElements", ("axis", axis), shape, indices)
        };
        assert!(elements(1, &[1, 4], &[0, 2, -3, 1]));
        assert!(!elements(1, &[1, 1], &[3]));
        assert!(!elements(1, &[1, 1], &[-4]));
        assert!(!elements(1, &[3, 1], &[0, 0, 0]));
        assert!(!elements(1, &[1], &[0]));
        assert!(!elements(2, &[1, 1], &[0]));
        assert!(elements(0, &[0, 1], &[]));
        let blocks = |batch, shape: &[usize], indices: &[i64]| {
            gathered("GatherND", ("batch_dims", batch), shape, indices)
        };
        assert!(blocks(0, &[1, 2], &[1, -1]));
        assert!(blocks(1, &[2, 1], &[2, 0]));
        assert!(!blocks(0, &[1, 2], &[2, 0]));
        assert!(!blocks(0, &[1, 3], &[0, 0, 0]));
        assert!(!blocks(1, &[2, 2], &[0, 0, 0, 0]));
        assert!(!blocks(1, &[1, 1], &[0]));
        assert!(!blocks(2, &[2, 3], &[0; 6]));
        assert!(!blocks(-1, &[1, 1], &[0]));
        assert!(!blocks(0, &[], &[0]));
        assert!(!blocks(0, &[1, 0], &[]));
        assert!(blocks(0, &[0, 1], &[]));
    }
}
