//! `Max`, `Min` and `Mean` of any number of values, with shapes that are broadcast.

use pdk_sdk::error::Result;

use super::arithmetic::{infer, join, unbroadcast};
use super::operator::{Operator, Parts, Rule};
use crate::builder::Builder;
use crate::order::further;
use crate::site::Site;
use crate::tensor::Tensor;

pub const OPERATORS: &[Operator] = &[
    Operator::new(
        "Max",
        infer,
        |site, x| extreme(site, x, 1.0),
        Rule::First(|s, b, g| to_the_extreme(s, b, g, "Less")),
    ),
    Operator::new(
        "Min",
        infer,
        |site, x| extreme(site, x, -1.0),
        Rule::First(|s, b, g| to_the_extreme(s, b, g, "Greater")),
    ),
    Operator::new("Mean", infer, mean, Rule::First(gradient_mean)),
];

/// The greatest elements if `sign` is 1, the least ones if it is -1.
fn extreme(site: &Site<'_>, inputs: &[Option<&Tensor>], sign: f64) -> Result<Vec<Tensor>> {
    Ok(vec![join(site, inputs, |a, b| further(a, b, sign))?])
}

/// The gradient goes to the values that equal what was found, in equal shares; all others are `beyond` it, by this operator.
fn to_the_extreme(site: &Site<'_>, b: &mut Builder, g: &str, beyond: &str) -> Result<Parts> {
    let mut shares: Vec<String> = Vec::new();
    let mut count: Option<String> = None;
    for place in 0..site.node.input.len() {
        let other = b.mask(beyond, site.input(place)?, site.output(0)?)?;
        let share = b.complement(&other)?;
        count = Some(match count {
            None => share.clone(),
            Some(count) => b.binary("Add", &count, &share)?,
        });
        shares.push(share);
    }
    let Some(count) = count else { return Ok(Vec::new()) };
    let g = b.binary("Div", g, &count)?;
    let mut parts = Vec::new();
    for (place, share) in shares.iter().enumerate() {
        if b.wants(site, place) {
            parts.push((place, b.mul(&g, share)?));
        }
    }
    unbroadcast(site, b, parts)
}

fn mean(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let mut sum = join(site, inputs, |a, b| a + b)?;
    let count = inputs.len() as f64;
    sum.values.iter_mut().for_each(|sum| *sum /= count);
    Ok(vec![sum])
}

fn gradient_mean(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let count = site.node.input.len();
    let g = b.scale(g, 1.0 / count as f64)?;
    let parts = (0..count).filter(|&place| b.wants(site, place)).map(|place| (place, g.clone())).collect();
    unbroadcast(site, b, parts)
}

#[cfg(test)]
mod tests {
    use crate::gradient::{Target, gradients};
    use crate::graph::Graph;
    use crate::tensor::Tensor;
    use crate::testing::{Sketch, check, fault};

    #[test]
    fn gradients_go_to_the_values_that_were_chosen() {
        for case in ["max", "max/several", "max/same", "min", "min/several", "min/same", "mean"] {
            check(case);
        }
    }

    #[test]
    fn equal_values_share_the_gradient() {
        for operator in ["Max", "Min"] {
            let mut sketch = Sketch::new(13);
            sketch.input("x", &[2]);
            let w = sketch.weights("w", Tensor::floats(&[2], vec![2.0, 5.0]));
            sketch.node(operator, &["x", &w], "y", &[]);
            let graph = Graph::new(sketch.model(&["y"])).unwrap();
            let built = gradients(&graph, Target { value: "y", index: 0 }, &["x"], &[]).unwrap();
            let x = Tensor::floats(&[2], vec![2.0, 2.0]);
            let found =
                Graph::new(built.model).unwrap().evaluate(&[("x", &x)], &[&built.outputs[0]]).unwrap();
            assert_eq!(found[0].values, [0.5, 0.0], "{operator}");
        }
    }

    #[test]
    fn damaged_models_are_refused() {
        for operator in ["Max", "Min", "Mean"] {
            assert!(fault(13, operator, &[], &[]).contains("its input 1 is missing"));
            assert!(fault(13, operator, &[&[2], &[3]], &[]).contains("do not go together"));
        }
    }
}
