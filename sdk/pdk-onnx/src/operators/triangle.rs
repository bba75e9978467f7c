//! `Trilu`, which keeps a triangle of each matrix, and `EyeLike`, which draws a diagonal.

use pdk_sdk::error::{Error, Result};

use super::inputs::{optional, single, taken};
use super::operator::{Operator, Parts, Rule};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::{Element, Tensor, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Trilu", infer_triangle, triangle, Rule::First(gradient)),
    Operator::new("EyeLike", infer_eye, eye, Rule::Zero).needing_shapes_alone(),
];

fn infer_triangle(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    if fact.shape.len() < 2 {
        return Err(Error::new(format!(
            "its input {} does not consist of matrices",
            shape_text(&fact.shape)
        )));
    }
    Ok(vec![fact.clone()])
}

/// Whether a place belongs to the triangle that ends at a diagonal.
fn belongs(site: &Site<'_>, diagonal: i64, [row, column]: [usize; 2]) -> bool {
    let edge = diagonal.saturating_add(row as i64);
    if site.int("upper", 1) != 0 { column as i64 >= edge } else { column as i64 <= edge }
}

fn triangle(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let shape = infer_triangle(site)?.swap_remove(0).shape;
    let input = taken(site, inputs, 0)?;
    let diagonal = optional(inputs, 1).map_or(Ok(0.0), |k| single(k, "diagonal"))? as i64;
    let rank = shape.len();
    let mut values = input.values.iter();
    let value = |at: &[usize]| {
        let value = values.next().copied().unwrap_or_default();
        if belongs(site, diagonal, [at[rank - 2], at[rank - 1]]) { value } else { 0.0 }
    };
    Ok(vec![Tensor::from_fn(input.element, &shape, value)?])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let shape = infer_triangle(site)?.swap_remove(0).shape;
    let diagonal = site.constant(1)?.map_or(Ok(0.0), |k| single(&k, "diagonal"))? as i64;
    let mask = Tensor::from_fn(site.fact(0)?.element, &shape[shape.len() - 2..], |at| {
        f64::from(u8::from(belongs(site, diagonal, [at[0], at[1]])))
    });
    let mask = b.constant(&mask?)?;
    Ok(vec![(0, b.mul(g, &mask)?)])
}

fn infer_eye(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    if fact.shape.len() != 2 {
        return Err(Error::new(format!("its input {} is not a matrix", shape_text(&fact.shape))));
    }
    match site.int("dtype", i64::from(fact.element.0)) {
        element @ (1..=7 | 9..=13 | 16) => Ok(vec![Fact::new(Element(element as i32), fact.shape.clone())]),
        element => Err(Error::new(format!("its `dtype` {element} is not a type of numbers"))),
    }
}

fn eye(site: &Site<'_>, _: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let fact = infer_eye(site)?.swap_remove(0);
    let diagonal = site.int("k", 0);
    let value = |at: &[usize]| f64::from(u8::from(diagonal.saturating_add(at[0] as i64) == at[1] as i64));
    Ok(vec![Tensor::from_fn(fact.element, &fact.shape, value)?])
}

#[cfg(test)]
mod tests {
    use crate::testing::Setting::Int;
    use crate::testing::{check, computed};

    #[test]
    fn gradients_pass_within_the_triangle_alone() {
        for case in ["trilu", "trilu/lower"] {
            check(case);
        }
    }

    #[test]
    fn what_is_not_a_matrix_is_an_error() {
        for (operator, shape) in [("Trilu", &[3][..]), ("EyeLike", &[3]), ("EyeLike", &[1, 2, 3])] {
            let result = computed(14, |s| {
                let x = s.drawn(shape, -1.0, 1.0);
                s.node(operator, &[&x], "y", &[]);
            });
            assert!(result.is_err(), "{operator} {shape:?}");
        }
    }

    #[test]
    fn diagonals_far_outside_leave_nothing() {
        for k in [i64::MAX, i64::MIN] {
            let sum = |operator: &str| {
                let result = computed(14, |s| {
                    let (x, k) = (s.drawn(&[2, 2], 1.0, 2.0), s.ints(&[k]));
                    match operator {
                        "Trilu" => s.node(operator, &[&x, &k], "y", &[]),
                        _ => s.node(operator, &[&x], "y", &[("k", Int(i64::MAX))]),
                    }
                });
                result.unwrap().values.iter().sum::<f64>()
            };
            assert_eq!(sum("Trilu") == 0.0, k > 0);
            assert_eq!(sum("EyeLike"), 0.0);
        }
        let type_of_texts = computed(14, |s| {
            let x = s.drawn(&[2, 2], 1.0, 2.0);
            s.node("EyeLike", &[&x], "y", &[("dtype", Int(8))]);
        });
        assert!(type_of_texts.is_err());
    }
}
