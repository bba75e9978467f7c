//! `Mod`, and operators on the bits of integers: `BitShift`, `BitwiseAnd`, `BitwiseOr`, `BitwiseXor` and `BitwiseNot`.

use pdk_sdk::error::{Error, Result};

use super::arithmetic::{binary, infer};
use super::functions::each;
use super::operator::{Operator, Rule, given, same};
use crate::site::Site;
use crate::tensor::{Element, Tensor};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Mod", infer_pair, remainder, Rule::Unknown),
    Operator::new("BitShift", infer_pair, shift, Rule::Zero),
    Operator::new("BitwiseAnd", infer_pair, |s, x| bitwise(s, x, |a, b| a & b), Rule::Zero),
    Operator::new("BitwiseOr", infer_pair, |s, x| bitwise(s, x, |a, b| a | b), Rule::Zero),
    Operator::new("BitwiseXor", infer_pair, |s, x| bitwise(s, x, |a, b| a ^ b), Rule::Zero),
    Operator::new("BitwiseNot", same, not, Rule::Zero),
];

/// The facts of an operator on two values.
fn infer_pair(site: &Site<'_>) -> Result<Vec<Fact>> {
    site.fact(1)?;
    infer(site)
}

/// The remainder of a division. It has the sign of the divisor, or with `fmod` that of the dividend.
fn remainder(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let element = given(inputs, 0)?.element;
    match (site.int("fmod", 0) != 0, element.is_integer()) {
        (true, _) => binary(site, inputs, |a, b| a % b),
        (false, true) => binary(site, inputs, |a, b| {
            let rest = a % b;
            if rest != 0.0 && (rest < 0.0) != (b < 0.0) { rest + b } else { rest }
        }),
        (false, false) => Err(Error::new(format!(
            "its numbers are {element}, but without `fmod` have to be integers; export it with `fmod` = 1"
        ))),
    }
}

/// The type of the integers that go in.
fn integer(inputs: &[Option<&Tensor>]) -> Result<Element> {
    match given(inputs, 0)?.element {
        element if element.is_integer() => Ok(element),
        element => Err(Error::new(format!("its numbers are {element}, but have to be integers"))),
    }
}

fn shift(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let element = integer(inputs)?;
    let left = match site.text("direction", "") {
        "LEFT" => true,
        "RIGHT" => false,
        other => {
            return Err(Error::new(format!("its direction is `{other}`, but has to be LEFT or RIGHT")));
        }
    };
    binary(site, inputs, |a, by| {
        let (a, by) = (element.whole(a), element.whole(by));
        match u32::try_from(by).ok().filter(|&by| by < 64) {
            Some(by) if left => element.wrapped(a << by),
            Some(by) => (a >> by) as f64,
            // Nothing is left of the bits.
            None => 0.0,
        }
    })
}

fn bitwise(site: &Site<'_>, inputs: &[Option<&Tensor>], f: fn(i128, i128) -> i128) -> Result<Vec<Tensor>> {
    let element = integer(inputs)?;
    binary(site, inputs, |a, b| element.wrapped(f(element.whole(a), element.whole(b))))
}

fn not(_: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let element = integer(inputs)?;
    each(inputs, |x| element.wrapped(!element.whole(x)))
}

#[cfg(test)]
mod tests {
    use crate::tensor::{Element, Tensor};
    use crate::testing::{Setting, computed, fault};

    fn of_pair(operator: &str, element: i32, a: f64, b: f64, settings: &[(&str, Setting<'_>)]) -> f64 {
        let found = computed(18, |s| {
            let [a, b] = [("a", a), ("b", b)].map(|(name, value)| {
                let element = Element(element);
                s.weights(name, Tensor { element, shape: vec![1], values: vec![value] })
            });
            s.node(operator, &[&a, &b], "y", settings);
        });
        found.unwrap().values[0]
    }

    #[test]
    fn bits_that_leave_the_type_are_lost() {
        let left = [("direction", Setting::Text("LEFT"))];
        let right = [("direction", Setting::Text("RIGHT"))];
        assert_eq!(of_pair("BitShift", 2, 129.0, 1.0, &left), 2.0);
        assert_eq!(of_pair("BitShift", 2, 129.0, 8.0, &left), 0.0);
        assert_eq!(of_pair("BitShift", 13, 3.0, 63.0, &left), libm::ldexp(1.0, 63));
        assert_eq!(of_pair("BitShift", 13, 3.0, 64.0, &right), 0.0);
        assert_eq!(of_pair("BitShift", 4, 3.0, 1.0, &right), 1.0);
        assert_eq!(of_pair("BitwiseAnd", 3, -1.0, 6.0, &[]), 6.0);
        assert_eq!(of_pair("BitwiseXor", 3, -1.0, 6.0, &[]), -7.0);
    }

    #[test]
    fn remainders_have_the_sign_that_is_asked_for_and_divisions_by_0_do_not_end_the_program() {
        let fmod = [("fmod", Setting::Int(1))];
        assert_eq!(of_pair("Mod", 6, -7.0, 3.0, &[]), 2.0);
        assert_eq!(of_pair("Mod", 6, -7.0, 3.0, &fmod), -1.0);
        assert_eq!(of_pair("Mod", 6, 7.0, -3.0, &[]), -2.0);
        assert_eq!(of_pair("Mod", 6, 7.0, 0.0, &[]), 0.0);
    }

    #[test]
    fn damaged_models_are_refused() {
        let pair: &[&[usize]] = &[&[2], &[2]];
        assert!(fault(18, "Mod", pair, &[]).contains("without `fmod` have to be integers"));
        for operator in ["BitwiseAnd", "BitwiseOr", "BitwiseXor", "BitShift"] {
            assert!(
                fault(18, operator, pair, &[]).contains("its numbers are FLOAT, but have to be integers")
            );
            assert!(fault(18, operator, &[&[2], &[3]], &[]).contains("do not go together"));
            assert!(fault(18, operator, &[&[2]], &[]).contains("its input 2 is missing"));
        }
        assert!(fault(18, "BitwiseNot", pair, &[]).contains("have to be integers"));
        let undirected = computed(18, |s| {
            let a = s.ints(&[1]);
            s.node("BitShift", &[&a, &a], "y", &[]);
        });
        let error = undirected.unwrap_err().to_string();
        assert!(error.contains("its direction is ``, but has to be LEFT or RIGHT"), "{error}");
    }
}
