//! `NonMaxSuppression`: of boxes that overlap, the one with the highest score. How many remain depends on values, so all have to be
//! constant.

use pdk_sdk::error::{Error, Result};

use super::inputs::{deciding, optional, single};
use super::operator::{Operator, Rule, given};
use crate::order::{greater, lesser};
use crate::site::Site;
use crate::tensor::{Element, Tensor, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("NonMaxSuppression", infer, evaluate, Rule::Zero)];

/// A box by its corners.
#[derive(Clone, Copy)]
struct Area {
    from: [f64; 2],
    to: [f64; 2],
}

impl Area {
    /// Reads four numbers: two corners, or the centre and the size.
    fn new(numbers: &[f64], centred: bool) -> Self {
        let [a, b, c, d] = [0, 1, 2, 3].map(|place| numbers.get(place).copied().unwrap_or(f64::NAN));
        match centred {
            true => Self { from: [a - c / 2.0, b - d / 2.0], to: [a + c / 2.0, b + d / 2.0] },
            false => Self { from: [lesser(a, c), lesser(b, d)], to: [greater(a, c), greater(b, d)] },
        }
    }

    fn size(self) -> f64 {
        (self.to[0] - self.from[0]) * (self.to[1] - self.from[1])
    }

    /// The share of the intersection in the union.
    fn overlap(self, other: Self) -> f64 {
        let side = |axis: usize| {
            let (from, to) =
                (greater(self.from[axis], other.from[axis]), lesser(self.to[axis], other.to[axis]));
            greater(0.0, to - from)
        };
        let common = side(0) * side(1);
        let union = self.size() + other.size() - common;
        if common > 0.0 && union > 0.0 { common / union } else { 0.0 }
    }
}

/// The boxes that remain: batch, class and number of each.
fn remaining(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<[usize; 3]>> {
    let (boxes, scores) = (given(inputs, 0)?, given(inputs, 1)?);
    let (&[batch, count, 4], &[batches, classes, scored]) = (&*boxes.shape, &*scores.shape) else {
        return Err(unfit(boxes, scores));
    };
    if batch != batches || count != scored {
        return Err(unfit(boxes, scores));
    }
    let number = |place: usize| {
        optional(inputs, place).map(|tensor| single(tensor, format_args!("input {}", place + 1))).transpose()
    };
    let most = number(2)?.unwrap_or(0.0);
    let (overlap, least) = (number(3)?.unwrap_or(0.0), number(4)?);
    let centred = site.int("center_point_box", 0) != 0;
    let mut remaining = Vec::new();
    for batch in 0..batches {
        let areas: Vec<_> = boxes.values[batch * count * 4..(batch + 1) * count * 4]
            .chunks_exact(4)
            .map(|numbers| Area::new(numbers, centred))
            .collect();
        for class in 0..classes {
            let scores = &scores.values[(batch * classes + class) * count..][..count];
            let mut open: Vec<usize> =
                (0..count).filter(|&place| least.is_none_or(|least| scores[place] > least)).collect();
            open.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]));
            let mut kept: Vec<usize> = Vec::new();
            for place in open {
                if kept.len() as f64 >= most {
                    break;
                }
                if kept.iter().all(|&other| areas[place].overlap(areas[other]) <= overlap) {
                    kept.push(place);
                }
            }
            remaining.extend(kept.into_iter().map(|place| [batch, class, place]));
        }
    }
    Ok(remaining)
}

fn unfit(boxes: &Tensor, scores: &Tensor) -> Error {
    Error::new(format!(
        "its boxes {} and its scores {} do not go together",
        shape_text(&boxes.shape),
        shape_text(&scores.shape)
    ))
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let inputs = (0..5).map(|place| deciding(site, place)).collect::<Result<Vec<_>>>()?;
    let inputs: Vec<_> = inputs.iter().map(Option::as_deref).collect();
    Ok(vec![Fact::new(Element::INT64, vec![remaining(site, &inputs)?.len(), 3])])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let remaining = remaining(site, inputs)?;
    let values = remaining.iter().flatten().map(|&number| number as f64).collect();
    Ok(vec![Tensor { element: Element::INT64, shape: vec![remaining.len(), 3], values }])
}

#[cfg(test)]
mod tests {
    use crate::testing::computed;

    #[test]
    fn boxes_and_scores_that_do_not_fit_are_errors() {
        let kept = |boxes: &[usize], scores: &[usize], most: &[i64]| {
            computed(11, |s| {
                let (boxes, scores) = (s.drawn(boxes, 0.0, 1.0), s.drawn(scores, 0.0, 1.0));
                let most = s.ints(most);
                s.node("NonMaxSuppression", &[&boxes, &scores, &most], "y", &[]);
            })
        };
        assert_eq!(kept(&[1, 3, 4], &[1, 2, 3], &[1]).unwrap().shape, [2, 3]);
        assert_eq!(kept(&[1, 3, 4], &[1, 2, 3], &[-5]).unwrap().shape, [0, 3]);
        assert!(kept(&[1, 3, 4], &[1, 2, 3], &[1, 2]).is_err());
        assert!(kept(&[1, 3, 5], &[1, 2, 3], &[1]).is_err());
        assert!(kept(&[1, 3, 4], &[1, 2, 2], &[1]).is_err());
        assert!(kept(&[2, 3, 4], &[1, 2, 3], &[1]).is_err());
        assert!(kept(&[3, 4], &[1, 2, 3], &[1]).is_err());
    }

    #[test]
    fn scores_that_are_computed_are_an_error() {
        let result = computed(11, |s| {
            s.input("scores", &[1, 1, 3]);
            let boxes = s.drawn(&[1, 3, 4], 0.0, 1.0);
            s.node("NonMaxSuppression", &[&boxes, "scores"], "y", &[]);
        });
        let error = result.unwrap_err().to_string();
        assert!(error.contains("`scores` has to be a constant"), "{error}");
    }
}
