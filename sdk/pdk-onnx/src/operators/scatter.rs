//! `ScatterElements` with its older name `Scatter`, and `ScatterND`: data in which single elements or blocks are replaced, or joined with
//! updates.

use pdk_sdk::error::{Error, Result};

use super::gather_elements::{along, unfit};
use super::inputs::taken;
use super::operator::{Operator, Rule, same};
use super::positions::{counted, index, strides};
use crate::order::further;
use crate::site::Site;
use crate::tensor::{Element, Tensor, for_each_position};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Scatter", infer_elements, scatter_elements, Rule::Unknown),
    Operator::new("ScatterElements", infer_elements, scatter_elements, Rule::Unknown),
    Operator::new("ScatterND", infer_blocks, scatter_blocks, Rule::Unknown),
];

/// How an element and its update are joined.
fn join(site: &Site<'_>) -> Result<fn(Element, f64, f64) -> f64> {
    match site.text("reduction", "none") {
        "none" => Ok(|_, _, update| update),
        "add" => Ok(Element::sum),
        "mul" => Ok(Element::product),
        "max" => Ok(|_, a, b| further(a, b, 1.0)),
        "min" => Ok(|_, a, b| further(a, b, -1.0)),
        other => Err(Error::new(format!("its `reduction` `{other}` is not known here"))),
    }
}

fn infer_elements(site: &Site<'_>) -> Result<Vec<Fact>> {
    along(site)?;
    join(site)?;
    if site.shape(1)? != site.shape(2)? {
        return Err(Error::new("its indices and its updates have different shapes"));
    }
    same(site)
}

fn scatter_elements(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    infer_elements(site)?;
    let (along, join) = (along(site)?, join(site)?);
    let mut result = taken(site, inputs, 0)?.clone();
    let (indices, updates) = (taken(site, inputs, 1)?, taken(site, inputs, 2)?);
    let strides = strides(&result.shape);
    let mut starts = Vec::with_capacity(indices.values.len());
    for_each_position(&indices.shape, |at| {
        starts.push(index(&strides, at) - at[along] * strides[along]);
    });
    for ((start, &index), &update) in starts.into_iter().zip(&indices.values).zip(&updates.values) {
        let place = start + counted(index, result.shape[along])? * strides[along];
        result.values[place] = join(result.element, result.values[place], update);
    }
    Ok(vec![result])
}

/// The number of axes that an index counts along.
fn depth(site: &Site<'_>) -> Result<usize> {
    let (data, indices) = (site.shape(0)?, site.shape(1)?);
    let depth = indices.last().copied().filter(|depth| (1..=data.len()).contains(depth));
    let depth = depth.ok_or_else(|| unfit(site))?;
    if site.shape(2)? != [&indices[..indices.len() - 1], &data[depth..]].concat() {
        return Err(Error::new("its updates do not have the shape that its data and its indices leave"));
    }
    Ok(depth)
}

fn infer_blocks(site: &Site<'_>) -> Result<Vec<Fact>> {
    depth(site)?;
    join(site)?;
    same(site)
}

fn scatter_blocks(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (depth, join) = (depth(site)?, join(site)?);
    let mut result = taken(site, inputs, 0)?.clone();
    let (indices, updates) = (taken(site, inputs, 1)?, taken(site, inputs, 2)?);
    let block: usize = result.shape[depth..].iter().product();
    for (list, updates) in indices.values.chunks(depth).zip(updates.values.chunks(block.max(1))) {
        let mut place = 0;
        for (&index, &length) in list.iter().zip(&result.shape) {
            place = place * length + counted(index, length)?;
        }
        for (value, &update) in result.values[place * block..].iter_mut().zip(updates) {
            *value = join(result.element, *value, update);
        }
    }
    Ok(vec![result])
}

#[cfg(test)]
mod tests {
    use crate::tensor::{Element, Tensor};
    use crate::testing::Setting::Text;
    use crate::testing::computed;

    fn scattered(operator: &str, shapes: [&[usize]; 2], indices: &[i64], reduction: &str) -> bool {
        let result = computed(18, |s| {
            let (x, updates) = (s.drawn(&[2, 3], -1.0, 1.0), s.drawn(shapes[1], -1.0, 1.0));
            let indices = s.weights("indices", Tensor { shape: shapes[0].to_vec(), ..Tensor::ints(indices) });
            s.node(operator, &[&x, &indices, &updates], "y", &[("reduction", Text(reduction))]);
        });
        result.is_ok()
    }

    #[test]
    fn indices_outside_and_shapes_that_do_not_fit_are_errors() {
        let elements = |shapes, indices: &[i64]| scattered("ScatterElements", shapes, indices, "add");
        assert!(elements([&[1, 2], &[1, 2]], &[1, -2]));
        assert!(!elements([&[1, 2], &[1, 2]], &[1, 2]));
        assert!(!elements([&[1, 2], &[2, 1]], &[1, 0]));
        assert!(!elements([&[1, 4], &[1, 4]], &[0; 4]));
        assert!(!elements([&[2], &[2]], &[0; 2]));
        assert!(!scattered("ScatterElements", [&[1, 2], &[1, 2]], &[1, 1], "median"));
        let blocks = |shapes, indices: &[i64]| scattered("ScatterND", shapes, indices, "max");
        assert!(blocks([&[1, 1], &[1, 3]], &[-1]));
        assert!(!blocks([&[1, 1], &[1, 3]], &[2]));
        assert!(!blocks([&[1, 1], &[1, 2]], &[0]));
        assert!(!blocks([&[1, 3], &[1]], &[0; 3]));
        assert!(!blocks([&[], &[]], &[0]));
        assert!(!blocks([&[1, 0], &[1, 2, 3]], &[]));
        assert!(!scattered("ScatterND", [&[1, 1], &[1, 3]], &[0], "median"));
    }

    #[test]
    fn integers_wrap() {
        let result = computed(16, |s| {
            let ints = |value: i64| Tensor { element: Element::INT32, ..Tensor::ints(&[value]) };
            let x = s.weights("x", ints(i64::from(i32::MAX)));
            let (places, updates) = (s.ints(&[0]), s.weights("updates", ints(2)));
            s.node("ScatterElements", &[&x, &places, &updates], "y", &[("reduction", Text("add"))]);
        });
        assert_eq!(result.unwrap().values, [f64::from(i32::MIN + 1)]);
    }
}
