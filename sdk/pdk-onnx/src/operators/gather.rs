//! `Gather`. It has a gradient if its places are constant.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::{Site, axis};
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("Gather", infer, evaluate, Rule::First(gradient))];

fn along(site: &Site<'_>) -> Result<usize> {
    axis(site.int("axis", 0), site.shape(0)?.len())
}

/// The places as counted from the start.
fn places(indices: &Tensor, length: usize) -> Result<Vec<usize>> {
    let place = |index: i64| {
        let counted = if index < 0 { index + length as i64 } else { index };
        usize::try_from(counted).ok().filter(|&place| place < length)
    };
    let wrong = |index: i64| Error::new(format!("its index {index} is outside the {length} elements"));
    indices.to_ints().into_iter().map(|index| place(index).ok_or_else(|| wrong(index))).collect()
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let axis = along(site)?;
    let fact = site.fact(0)?;
    let shape = [&fact.shape[..axis], site.shape(1)?, &fact.shape[axis + 1..]].concat();
    Ok(vec![Fact::new(fact.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let axis = along(site)?;
    let (input, indices) = (given(inputs, 0)?, given(inputs, 1)?);
    let length = input.shape[axis];
    let places = places(indices, length)?;
    let inner: usize = input.shape[axis + 1..].iter().product();
    let rows = input.values.chunks((length * inner).max(1));
    let values =
        rows.flat_map(|row| places.iter().flat_map(|&place| &row[place * inner..(place + 1) * inner]));
    let values = values.copied().collect();
    Ok(vec![Tensor { element: input.element, shape: infer(site)?.swap_remove(0).shape, values }])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let axis = along(site)?;
    let shape = site.shape(0)?;
    let indices = site.constant(1)?.ok_or_else(|| Error::new("its input 2 is missing"))?;
    let places = places(&indices, shape[axis])?;
    // All axes of the indices as one.
    let flat = [&shape[..axis], &[places.len()], &shape[axis + 1..]].concat();
    let g = b.reshape(g, &flat)?;
    let places: Vec<_> = places.into_iter().map(Some).collect();
    Ok(vec![(0, b.scatter(&g, axis, &places, shape[axis])?)])
}

#[cfg(test)]
mod tests {
    use crate::gradient::{Target, gradients};
    use crate::graph::Graph;
    use crate::tensor::Tensor;
    use crate::testing::{Sketch, check, computed};

    /// A row of three numbers and places in it that are computed.
    fn computed_places() -> Graph {
        let mut sketch = Sketch::new(13);
        sketch.input("x", &[3]);
        sketch.input("place", &[2]);
        sketch.node("Cast", &["place"], "places", &[("to", crate::testing::Setting::Int(7))]);
        sketch.node("Gather", &["x", "places"], "y", &[]);
        Graph::new(sketch.model(&["y"])).unwrap()
    }

    #[test]
    fn places_may_be_computed_but_then_have_no_gradient() {
        let graph = computed_places();
        let (x, place) = (Tensor::floats(&[3], vec![5.0, 6.0, 7.0]), Tensor::floats(&[2], vec![2.0, -3.0]));
        let values = graph.evaluate(&[("x", &x), ("place", &place)], &["y"]).unwrap();
        assert_eq!(values[0].values, [7.0, 5.0]);
        let outside = Tensor::floats(&[2], vec![2.0, 3.0]);
        let error = graph.evaluate(&[("x", &x), ("place", &outside)], &["y"]).unwrap_err().to_string();
        assert!(error.contains("its index 3 is outside the 3 elements"), "{error}");
        let error = gradients(&graph, Target { value: "y", index: 0 }, &["x"], &[]).err().unwrap();
        assert!(error.to_string().contains("its input `places` has to be a constant"), "{error}");
    }

    #[test]
    fn places_outside_are_errors() {
        for place in [3, -4, i64::MIN, i64::MAX] {
            let result = computed(13, |s| {
                let (x, places) = (s.drawn(&[3], -1.0, 1.0), s.ints(&[place]));
                s.node("Gather", &[&x, &places], "y", &[]);
            });
            assert!(result.is_err(), "{place}");
        }
    }

    #[test]
    fn gradients_go_back_to_where_the_elements_came_from() {
        for case in ["gather", "gather/repeated", "gather/one", "gather/matrix", "gather/negative"] {
            check(case);
        }
    }
}
