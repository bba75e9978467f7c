//! Functions of angles and hyperbolic functions, and their inverses.

use super::functions::each;
use super::operator::{Operator, Rule, same};

pub const OPERATORS: &[Operator] = &[
    Operator::new("Tan", same, |_, x| each(x, libm::tan), Rule::Unknown),
    Operator::new("Asin", same, |_, x| each(x, libm::asin), Rule::Unknown),
    Operator::new("Acos", same, |_, x| each(x, libm::acos), Rule::Unknown),
    Operator::new("Atan", same, |_, x| each(x, libm::atan), Rule::Unknown),
    Operator::new("Sinh", same, |_, x| each(x, libm::sinh), Rule::Unknown),
    Operator::new("Cosh", same, |_, x| each(x, libm::cosh), Rule::Unknown),
    Operator::new("Asinh", same, |_, x| each(x, libm::asinh), Rule::Unknown),
    Operator::new("Acosh", same, |_, x| each(x, libm::acosh), Rule::Unknown),
    Operator::new("Atanh", same, |_, x| each(x, libm::atanh), Rule::Unknown),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Graph;
    use crate::tensor::Tensor;
    use crate::testing::{Sketch, fault};

    #[test]
    fn numbers_outside_the_domain_give_no_number() {
        for operator in ["Asin", "Acos", "Acosh", "Atanh"] {
            let mut sketch = Sketch::new(9);
            sketch.input("x", &[1]);
            sketch.node(operator, &["x"], "y", &[]);
            let graph = Graph::new(sketch.model(&["y"])).unwrap();
            let y = graph.evaluate(&[("x", &Tensor::floats(&[1], vec![-2.0]))], &["y"]).unwrap();
            assert!(y[0].values[0].is_nan(), "{operator}");
        }
    }

    #[test]
    fn damaged_models_are_refused() {
        for operator in OPERATORS {
            assert!(fault(9, operator.name, &[], &[]).contains("its input 1 is missing"));
        }
    }
}
