//! `Slice`, forwards and backwards, with steps.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::{Site, axis};
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("Slice", infer, evaluate, Rule::First(gradient))];

/// The axes that are cut, each with the places that are kept.
pub fn kept(site: &Site<'_>) -> Result<Vec<(usize, Vec<usize>)>> {
    let shape = site.shape(0)?;
    let missing = || Error::new("its start and end are missing");
    let starts = site.ints_at(1, "starts")?.ok_or_else(missing)?;
    let ends = site.ints_at(2, "ends")?.ok_or_else(missing)?;
    let axes = site.ints_at(3, "axes")?.unwrap_or_else(|| (0..starts.len() as i64).collect());
    let steps = site.ints_at(4, "steps")?.unwrap_or_else(|| vec![1; starts.len()]);
    if [ends.len(), axes.len(), steps.len()] != [starts.len(); 3] {
        return Err(Error::new("its starts, ends, axes and steps differ in number"));
    }
    let mut kept = Vec::new();
    for (place, &each) in axes.iter().enumerate() {
        let axis = axis(each, shape.len())?;
        let length = shape[axis] as i64;
        let counted = |value: i64| if value < 0 { value.saturating_add(length) } else { value };
        let (start, end, step) = (counted(starts[place]), counted(ends[place]), steps[place]);
        let places = match step {
            0 => return Err(Error::new("its step is 0")),
            1.. => (start.clamp(0, length)..end.clamp(0, length)).step_by(step as usize).collect::<Vec<_>>(),
            _ => {
                let (start, end) = (start.clamp(-1, length - 1), end.clamp(-1, length - 1));
                (end + 1..start + 1).rev().step_by(step.unsigned_abs() as usize).collect()
            }
        };
        kept.push((axis, places.into_iter().map(|place| place as usize).collect()));
    }
    Ok(kept)
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let mut fact = site.fact(0)?.clone();
    for (axis, places) in kept(site)? {
        fact.shape[axis] = places.len();
    }
    Ok(vec![fact])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    let kept = kept(site)?;
    let fact = infer(site)?.swap_remove(0);
    let mut source = Vec::new();
    let cut = Tensor::from_fn(fact.element, &fact.shape, |at| {
        source.clear();
        source.extend_from_slice(at);
        kept.iter().for_each(|(axis, places)| source[*axis] = places[at[*axis]]);
        input.broadcast_at(&source)
    });
    Ok(vec![cut?])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let shape = site.shape(0)?;
    let mut g = g.to_owned();
    for (axis, places) in kept(site)? {
        let places: Vec<_> = places.into_iter().map(Some).collect();
        g = b.scatter(&g, axis, &places, shape[axis])?;
    }
    Ok(vec![(0, g)])
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_go_back_to_where_the_elements_came_from() {
        for case in ["slice", "slice/open", "slice/steps", "slice/backwards", "slice/several"] {
            check(case);
        }
    }
}
