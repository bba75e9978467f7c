//! Smooth activations: `Mish`, `Softsign` and `Swish`.

use pdk_sdk::error::Result;

use super::functions::{each, sigmoid, softplus, times};
use super::operator::{Operator, Parts, Rule, same};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::Tensor;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Mish", same, |_, x| each(x, |x| x * libm::tanh(softplus(x))), Rule::First(mish)),
    Operator::new("Softsign", same, |_, x| each(x, softsign), Rule::First(softsign_gradient)),
    Operator::new("Swish", same, evaluate_swish, Rule::First(swish)),
];

fn mish(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    // With t = tanh(softplus(x)) the slope is t + x (1 - t^2) sigmoid(x).
    let x = site.input(0)?;
    let soft = b.unary("Softplus", x)?;
    let t = b.unary("Tanh", &soft)?;
    let square = b.mul(&t, &t)?;
    let rest = b.complement(&square)?;
    let logistic = b.unary("Sigmoid", x)?;
    let rise = b.mul(x, &rest)?;
    let rise = b.mul(&rise, &logistic)?;
    let slope = b.binary("Add", &t, &rise)?;
    times(b, g, &slope)
}

pub fn softsign(x: f64) -> f64 {
    x / (1.0 + x.abs())
}

fn softsign_gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let size = b.unary("Abs", site.input(0)?)?;
    let divisor = b.offset(&size, 1.0)?;
    let square = b.mul(&divisor, &divisor)?;
    Ok(vec![(0, b.binary("Div", g, &square)?)])
}

fn evaluate_swish(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let alpha = site.float("alpha", 1.0);
    each(inputs, |x| x * sigmoid(alpha * x))
}

fn swish(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    // With s = sigmoid(alpha x) the slope is s + alpha x s (1 - s).
    let x = b.scale(site.input(0)?, site.float("alpha", 1.0))?;
    let s = b.unary("Sigmoid", &x)?;
    let rest = b.complement(&s)?;
    let rise = b.mul(&x, &s)?;
    let rise = b.mul(&rise, &rest)?;
    let slope = b.binary("Add", &s, &rise)?;
    times(b, g, &slope)
}

#[cfg(test)]
mod tests {
    use crate::gradient::Target;
    use crate::graph::Graph;
    use crate::tensor::Tensor;
    use crate::testing::{Setting, Sketch, both_gradients, check, fault, relative_error};

    #[test]
    fn gradients_are_right() {
        check("mish");
        check("softsign");
    }

    #[test]
    fn swish_is_scaled_within() {
        let mut sketch = Sketch::new(22);
        sketch.input("x", &[2]);
        sketch.node("Swish", &["x"], "y", &[("alpha", Setting::Float(2.0))]);
        let graph = Graph::new(sketch.model(&["y"])).unwrap();
        let y = graph.evaluate(&[("x", &Tensor::floats(&[2], vec![0.5, -1000.0]))], &["y"]).unwrap();
        assert!((y[0].values[0] - 0.5 / (1.0 + libm::exp(-1.0))).abs() < 1e-12, "{y:?}");
        assert_eq!(y[0].values[1], 0.0);
        // Version 24 of the operator set has it, for which the cases have no gradients.
        let x = Tensor::floats(&[2], vec![0.5, -1.5]);
        for index in 0..2 {
            let target = Target { value: "y", index };
            let (exact, differences, _) = both_gradients(&graph, target, ("x", &x), &[0, 1]).unwrap();
            assert!(relative_error(&exact, &differences) < 1e-6, "{exact:?} {differences:?}");
        }
    }

    #[test]
    fn damaged_models_are_refused() {
        for operator in ["Mish", "Softsign", "Swish"] {
            assert!(fault(22, operator, &[], &[]).contains("its input 1 is missing"));
        }
    }
}
