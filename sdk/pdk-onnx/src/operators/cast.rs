//! `Cast` and `CastLike`: the elements in another type.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::{Element, Tensor};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Cast", infer_cast, |s, x| convert(s, infer_cast(s)?, x), Rule::First(gradient_cast)),
    Operator::new("CastLike", infer_like, |s, x| convert(s, infer_like(s)?, x), Rule::First(gradient_like)),
];

fn infer_cast(site: &Site<'_>) -> Result<Vec<Fact>> {
    let element = i32::try_from(site.int("to", 0)).map(Element).unwrap_or(Element(0));
    Ok(vec![Fact::new(element, site.shape(0)?.to_vec())])
}

fn infer_like(site: &Site<'_>) -> Result<Vec<Fact>> {
    Ok(vec![Fact::new(site.fact(1)?.element, site.shape(0)?.to_vec())])
}

fn convert(site: &Site<'_>, facts: Vec<Fact>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    let saturate = site.int("saturate", 1) != 0;
    let convert = |Fact { element, .. }: Fact| {
        if element != Element::BOOL && !element.is_float() && !element.is_integer() {
            return Err(Error::new(format!(
                "its elements become {element}, but have to become numbers of a known type"
            )));
        }
        let convert = |&value: &f64| input.element.converted(element, value, saturate);
        let values = input.values.iter().map(convert).collect();
        Ok(Tensor { element, shape: input.shape.clone(), values })
    };
    facts.into_iter().map(convert).collect()
}

fn gradient_cast(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    // A gradient comes from floats alone; what is not a float has none.
    let from = site.fact(0)?.element;
    if from.is_float() { Ok(vec![(0, b.cast(g, from)?)]) } else { Ok(Vec::new()) }
}

fn gradient_like(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let mut parts = gradient_cast(site, b, g)?;
    // Only the type of the other input counts.
    if b.wants(site, 1) {
        let like = site.fact(1)?;
        parts.push((1, b.zeros(like.element, &like.shape)?));
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use crate::graph::Graph;
    use crate::tensor::{Element, Tensor};
    use crate::testing::{Setting, Sketch, check, computed, fault};

    #[test]
    fn gradients_have_the_type_of_what_went_in() {
        check("cast");
        check("cast/like");
    }

    #[test]
    fn what_operators_compute_is_rounded_to_its_type() {
        for (element, expected) in
            [(Element::FLOAT16, 2048.0), (Element::BFLOAT16, 2048.0), (Element(2), 2.0)]
        {
            let mut sketch = Sketch::new(13);
            sketch.input("x", &[1]);
            sketch.node("Cast", &["x"], "narrow", &[("to", Setting::Int(i64::from(element.0)))]);
            sketch.node("Add", &["narrow", "narrow"], "y", &[]);
            let graph = Graph::new(sketch.model(&["y"])).unwrap();
            let x = if element.is_float() { 1024.25 } else { 129.75 };
            let found = graph.evaluate(&[("x", &Tensor::floats(&[1], vec![x]))], &["y"]).unwrap();
            assert_eq!((found[0].element, found[0].values[0]), (element, expected));
        }
    }

    #[test]
    fn integers_keep_their_low_bits_and_floats_are_cut() {
        for (from, to, values, expected) in [
            (7, 2, [300.0, -1.0], [44.0, 255.0]),
            (6, 3, [128.0, -129.0], [-128.0, 127.0]),
            (1, 6, [2.9, -2.9], [2.0, -2.0]),
            (1, 3, [-0.5, f64::NAN], [0.0, 0.0]),
            (6, 9, [-3.0, 0.0], [1.0, 0.0]),
            (1, 17, [17.0, 1e9], [16.0, 448.0]),
        ] {
            let found = computed(19, |s| {
                let x = Tensor { element: Element(from), shape: vec![2], values: values.to_vec() };
                let x = s.weights("x", x);
                s.node("Cast", &[&x], "y", &[("to", Setting::Int(i64::from(to)))]);
            });
            assert_eq!(found.unwrap().values, expected, "{from} to {to}");
        }
    }

    #[test]
    fn types_that_are_not_numbers_are_refused() {
        for to in [0, 8, 14, i64::MAX] {
            let error = fault(13, "Cast", &[&[2]], &[("to", Setting::Int(to))]);
            assert!(error.contains("have to become numbers"), "{error}");
        }
    }
}
