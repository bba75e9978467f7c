//! `Pad` in each mode; negative pads cut.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::{Site, axes};
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("Pad", infer, evaluate, Rule::First(gradient))];

/// For each axis, what is added before and behind; a negative number is cut.
pub fn pads(site: &Site<'_>) -> Result<Vec<(i64, i64)>> {
    let rank = site.shape(0)?.len();
    let pads = site.ints_at(1, "pads")?.ok_or_else(|| Error::new("it has no pads"))?;
    let padded = match site.ints_at(3, "")? {
        Some(list) => axes(&list, rank)?,
        None => (0..rank).collect(),
    };
    if pads.len() != 2 * padded.len() {
        return Err(Error::new(format!("it has {} pads for {} axes", pads.len(), padded.len())));
    }
    let mut all = vec![(0, 0); rank];
    for (place, &axis) in padded.iter().enumerate() {
        all[axis] = (pads[place], pads[padded.len() + place]);
    }
    Ok(all)
}

/// For each axis, where each element comes from; nothing if it is the constant.
fn sources(site: &Site<'_>) -> Result<Vec<Vec<Option<usize>>>> {
    let mode = site.text("mode", "constant");
    let axes = pads(site)?.into_iter().zip(site.shape(0)?).map(|((before, after), &length)| {
        let length = length as i64;
        let total = before.checked_add(after).and_then(|pads| pads.checked_add(length));
        let total = total.filter(|total| (0..=1 << 30).contains(total)).ok_or_else(|| {
            Error::new(format!("its pads {before} and {after} do not fit an axis of the length {length}"))
        })?;
        if length == 0 && total > 0 && mode != "constant" {
            return Err(Error::new(format!(
                "its mode `{mode}` has nothing to repeat along an axis of the length 0"
            )));
        }
        let place = |at: i64| match mode {
            "edge" => Ok(Some(at.clamp(0, length - 1))),
            "wrap" => Ok(Some(at.rem_euclid(length.max(1)))),
            "reflect" => {
                let period = (2 * (length - 1)).max(1);
                let folded = at.rem_euclid(period);
                Ok(Some(if folded < length { folded } else { period - folded }))
            }
            "constant" => Ok(Some(at).filter(|at| (0..length).contains(at))),
            other => Err(Error::new(format!("its mode `{other}` is not known here"))),
        };
        let places = (0..total).map(|at| Ok(place(at.saturating_sub(before))?.map(|place| place as usize)));
        places.collect::<Result<Vec<_>>>()
    });
    axes.collect()
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    Ok(vec![Fact::new(site.fact(0)?.element, sources(site)?.iter().map(Vec::len).collect())])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    let sources = sources(site)?;
    let constant = site.number_at(2, "value")?.unwrap_or(0.0);
    let shape: Vec<_> = sources.iter().map(Vec::len).collect();
    let mut source = vec![0; shape.len()];
    let padded = Tensor::from_fn(input.element, &shape, |at| {
        for (axis, &at) in at.iter().enumerate() {
            match sources[axis][at] {
                Some(place) => source[axis] = place,
                None => return constant,
            }
        }
        input.broadcast_at(&source)
    });
    Ok(vec![padded?])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let shape = site.shape(0)?;
    let mut g = g.to_owned();
    for (axis, places) in sources(site)?.iter().enumerate() {
        g = b.scatter(&g, axis, places, shape[axis])?;
    }
    Ok(vec![(0, g)])
}

#[cfg(test)]
mod tests {
    use crate::graph::Graph;
    use crate::testing::{Sketch, check};

    #[test]
    fn pads_belong_to_the_axes_in_the_order_that_names_them() {
        let mut s = Sketch::new(18);
        s.input("x", &[1, 1, 2, 4]);
        let (pads, axes) = (s.ints(&[1, 0, 1, 3]), s.ints(&[3, 2]));
        s.node("Pad", &["x", &pads, "", &axes], "y", &[]);
        let graph = Graph::new(s.model(&["y"])).unwrap();
        assert_eq!(graph.fact("y").unwrap().shape, [1, 1, 5, 6]);
    }

    #[test]
    fn gradients_are_right_in_each_mode() {
        for case in ["pad", "pad/negative", "pad/edge", "pad/reflect", "pad/axes"] {
            check(case);
        }
    }
}
