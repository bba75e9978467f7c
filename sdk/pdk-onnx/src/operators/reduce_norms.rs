//! Reductions of functions of the elements: `ReduceProd`, `ReduceL1`, `ReduceL2`, `ReduceLogSum`, `ReduceLogSumExp` and
//! `ReduceSumSquare`.

use pdk_sdk::error::Result;

use super::functions::{sign, times};
use super::operator::{Operator, Parts, Rule, given};
use super::reduce::{fold, infer, kept, spread};
use crate::builder::Builder;
use crate::order::greater;
use crate::site::Site;
use crate::tensor::{Element, Tensor};

pub const OPERATORS: &[Operator] = &[
    Operator::new("ReduceProd", infer, product, Rule::Unknown),
    Operator::new("ReduceL1", infer, |s, x| summed(s, x, |_, x| x.abs(), |sum| sum), Rule::First(sizes)),
    Operator::new("ReduceL2", infer, |s, x| summed(s, x, square, libm::sqrt), Rule::First(length)),
    Operator::new("ReduceLogSum", infer, |s, x| summed(s, x, |_, x| x, libm::log), Rule::First(log_sum)),
    Operator::new("ReduceLogSumExp", infer, evaluate_log_sum_exp, Rule::First(log_sum_exp)),
    Operator::new("ReduceSumSquare", infer, |s, x| summed(s, x, square, |sum| sum), Rule::First(squares)),
];

/// Gives what is computed for each group the shape that comes out.
fn shaped(site: &Site<'_>, groups: Tensor) -> Result<Vec<Tensor>> {
    Ok(vec![Tensor { shape: infer(site)?.swap_remove(0).shape, ..groups }])
}

fn product(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    shaped(site, fold(input, &kept(site)?, 1.0, |product, x| input.element.product(product, x))?)
}

fn square(element: Element, x: f64) -> f64 {
    element.product(x, x)
}

/// A function of the sum of functions of the elements.
fn summed(
    site: &Site<'_>,
    inputs: &[Option<&Tensor>],
    of_each: fn(Element, f64) -> f64,
    of_sum: fn(f64) -> f64,
) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    let element = input.element;
    let mut sums = fold(input, &kept(site)?, 0.0, |sum, x| element.sum(sum, of_each(element, x)))?;
    sums.values.iter_mut().for_each(|sum| *sum = of_sum(*sum));
    shaped(site, sums)
}

fn evaluate_log_sum_exp(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (x, kept) = (given(inputs, 0)?, kept(site)?);
    // Less the greatest of each group, so that nothing overflows.
    let mut greatest = fold(x, &kept, f64::NEG_INFINITY, greater)?;
    greatest.values.iter_mut().filter(|value| value.is_infinite()).for_each(|value| *value = 0.0);
    let mut values = x.values.iter();
    let powers = Tensor::from_fn(x.element, &x.shape, |at| {
        libm::exp(values.next().copied().unwrap_or_default() - greatest.broadcast_at(at))
    })?;
    let mut sums = fold(&powers, &kept, 0.0, |sum, power| sum + power)?;
    let logs = sums.values.iter_mut().zip(&greatest.values);
    logs.for_each(|(sum, greatest)| *sum = greatest + libm::log(*sum));
    shaped(site, sums)
}

fn sizes(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let sign = sign(b, site.input(0)?)?;
    let g = spread(site, b, g)?;
    times(b, &g, &sign)
}

fn length(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    // A group of zeros has no slope; its gradient is 0 / 1.
    let y = site.output(0)?;
    let above = b.above(y, 0.0)?;
    let none = b.complement(&above)?;
    let divisor = b.binary("Add", y, &none)?;
    let share = b.binary("Div", g, &divisor)?;
    let share = spread(site, b, &share)?;
    times(b, &share, site.input(0)?)
}

fn log_sum(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let sum = b.unary("Exp", site.output(0)?)?;
    let share = b.binary("Div", g, &sum)?;
    Ok(vec![(0, spread(site, b, &share)?)])
}

fn log_sum_exp(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let logs = spread(site, b, site.output(0)?)?;
    let rest = b.binary("Sub", site.input(0)?, &logs)?;
    let share = b.unary("Exp", &rest)?;
    let g = spread(site, b, g)?;
    times(b, &g, &share)
}

fn squares(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let g = spread(site, b, g)?;
    let g = b.scale(&g, 2.0)?;
    times(b, &g, site.input(0)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gradient::{Target, gradients};
    use crate::graph::Graph;
    use crate::testing::{Setting, Sketch, check, fault};

    #[test]
    fn gradients_are_right_for_each_set_of_axes() {
        for operator in ["l1", "l2", "log_sum", "log_sum_exp", "sum_square"] {
            for case in ["", "/axes", "/dropped"] {
                check(&format!("reduce_{operator}{case}"));
            }
        }
    }

    #[test]
    fn a_group_of_zeros_has_the_gradient_0_of_its_length() {
        let mut sketch = Sketch::new(13);
        sketch.input("x", &[1, 2]);
        sketch.node("ReduceL2", &["x"], "y", &[]);
        let graph = Graph::new(sketch.model(&["y"])).unwrap();
        let built = gradients(&graph, Target { value: "y", index: 0 }, &["x"], &[]).unwrap();
        let x = Tensor::floats(&[1, 2], vec![0.0, 0.0]);
        let found = Graph::new(built.model).unwrap().evaluate(&[("x", &x)], &[&built.outputs[0]]).unwrap();
        assert_eq!(found[0].values, [0.0, 0.0]);
    }

    #[test]
    fn large_logarithms_do_not_overflow() {
        let mut sketch = Sketch::new(13);
        sketch.input("x", &[2]);
        sketch.node("ReduceLogSumExp", &["x"], "y", &[("keepdims", Setting::Int(0))]);
        let graph = Graph::new(sketch.model(&["y"])).unwrap();
        let y = graph.evaluate(&[("x", &Tensor::floats(&[2], vec![1000.0, 1000.0]))], &["y"]).unwrap();
        assert!((y[0].values[0] - 1000.0 - std::f64::consts::LN_2).abs() < 1e-9, "{y:?}");
    }

    #[test]
    fn damaged_models_are_refused() {
        for operator in OPERATORS {
            let axes = |axes| [("axes", Setting::Ints(axes))];
            assert!(fault(11, operator.name, &[], &[]).contains("its input 1 is missing"));
            assert!(
                fault(11, operator.name, &[&[2]], &axes(&[1])).contains("its axis 1 is outside the 1 axes")
            );
            assert!(fault(11, operator.name, &[&[2]], &axes(&[0, -1])).contains("named twice"));
        }
    }
}
