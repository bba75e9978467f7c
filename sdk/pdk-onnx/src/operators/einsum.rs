//! `Einsum`: sums of products after an equation that names each axis by a letter.

use pdk_sdk::error::{Error, Result};

use super::inputs::taken;
use super::operator::{Operator, Rule};
use super::positions::{index, strides};
use crate::site::Site;
use crate::tensor::{Tensor, elements, for_each_position, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("Einsum", infer, evaluate, Rule::Unknown)];

/// An axis in an equation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Label {
    Letter(char),
    /// One of those that the dots stand for, counted from the last.
    Dots(usize),
}

/// An equation as read from its text: the axes of each input and of what comes out, and the length of each.
struct Equation {
    inputs: Vec<Vec<Label>>,
    output: Vec<Label>,
    lengths: Vec<(Label, usize)>,
}

/// The axes that a term names, if the dots in it stand for `dots` axes.
fn labels(term: &str, dots: usize) -> Result<Vec<Label>> {
    let letters = |text: &str| -> Result<Vec<Label>> {
        let label = |letter: char| match letter.is_ascii_alphabetic() {
            true => Ok(Label::Letter(letter)),
            false => Err(Error::new(format!("its equation has `{letter}` where a letter has to be"))),
        };
        text.chars().map(label).collect()
    };
    match term.split_once("...") {
        None => letters(term),
        Some((before, after)) => {
            let dots = (0..dots).rev().map(Label::Dots);
            Ok(letters(before)?.into_iter().chain(dots).chain(letters(after)?).collect())
        }
    }
}

fn equation(site: &Site<'_>) -> Result<Equation> {
    let text: String = site.text("equation", "").chars().filter(|letter| !letter.is_whitespace()).collect();
    let (left, right) = text.split_once("->").map_or((&*text, None), |(left, right)| (left, Some(right)));
    let terms: Vec<&str> = left.split(',').collect();
    if text.is_empty() || terms.len() != site.node.input.len() {
        return Err(Error::new(format!(
            "its equation `{text}` does not have one term for each of its {} inputs",
            site.node.input.len()
        )));
    }
    let (mut inputs, mut lengths, mut most_dots) = (Vec::new(), Vec::<(Label, usize)>::new(), 0);
    for (place, term) in terms.into_iter().enumerate() {
        let shape = site.shape(place)?;
        let unfit = || Error::new(format!("its term `{term}` does not fit its input {}", shape_text(shape)));
        let named = term.chars().filter(|letter| *letter != '.').count();
        let dots = shape.len().checked_sub(named).ok_or_else(unfit)?;
        let labels = labels(term, dots)?;
        if labels.len() != shape.len() {
            return Err(unfit());
        }
        if term.contains("...") {
            most_dots = most_dots.max(dots);
        }
        for (&label, &length) in labels.iter().zip(shape) {
            match lengths.iter_mut().find(|(known, _)| *known == label) {
                None => lengths.push((label, length)),
                Some((_, known)) if *known == 1 => *known = length,
                Some((_, known)) if length == 1 || *known == length => {}
                Some(_) => return Err(unfit()),
            }
        }
        inputs.push(labels);
    }
    let output = match right {
        Some(term) => labels(term, most_dots)?,
        // The dots, and in the order of the alphabet what is named once.
        None => {
            let times = |label: &Label| inputs.iter().flatten().filter(|other| *other == label).count();
            let mut letters: Vec<char> = Vec::new();
            for (label, _) in &lengths {
                if let Label::Letter(letter) = label
                    && times(label) == 1
                {
                    letters.push(*letter);
                }
            }
            letters.sort_unstable();
            let dots = (0..most_dots).rev().map(Label::Dots);
            dots.chain(letters.into_iter().map(Label::Letter)).collect()
        }
    };
    for (place, label) in output.iter().enumerate() {
        if output[..place].contains(label) || !lengths.iter().any(|(known, _)| known == label) {
            return Err(Error::new(format!(
                "what comes out of its equation `{text}` names an axis twice or anew"
            )));
        }
    }
    Ok(Equation { inputs, output, lengths })
}

impl Equation {
    /// The length of each axis, those that come out first.
    fn ordered(&self) -> Vec<(Label, usize)> {
        let length = |label: &Label| self.lengths.iter().find(|(known, _)| known == label).copied();
        let summed = self.lengths.iter().filter(|(label, _)| !self.output.contains(label)).copied();
        self.output.iter().filter_map(length).chain(summed).collect()
    }
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let equation = equation(site)?;
    let shape = equation.ordered()[..equation.output.len()].iter().map(|(_, length)| *length).collect();
    Ok(vec![Fact::new(site.fact(0)?.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let equation = equation(site)?;
    let ordered = equation.ordered();
    let whole: Vec<usize> = ordered.iter().map(|(_, length)| *length).collect();
    elements(&whole)?;
    let (shape, summed) = whole.split_at(equation.output.len());
    let tensors = (0..equation.inputs.len()).map(|place| taken(site, inputs, place));
    let tensors = tensors.collect::<Result<Vec<_>>>()?;
    // How far each axis of the equation moves in each input. A broadcast axis does not move.
    let steps = equation.inputs.iter().zip(&tensors).map(|(labels, tensor)| {
        let own: Vec<_> = labels.iter().zip(&tensor.shape).zip(strides(&tensor.shape)).collect();
        let step = |(label, _): &(Label, usize)| -> usize {
            own.iter().filter(|((known, dim), _)| *known == label && **dim > 1).map(|(_, step)| step).sum()
        };
        ordered.iter().map(step).collect::<Vec<usize>>()
    });
    let steps: Vec<Vec<usize>> = steps.collect();
    let element = site.fact(0)?.element;
    let value = |at: &[usize]| {
        let mut total = 0.0;
        let starts: Vec<usize> = steps.iter().map(|steps| index(&steps[..at.len()], at)).collect();
        for_each_position(summed, |inner| {
            let mut factors = tensors
                .iter()
                .zip(&steps)
                .zip(&starts)
                .map(|((tensor, steps), start)| tensor.values[start + index(&steps[at.len()..], inner)]);
            let first = factors.next().unwrap_or(1.0);
            total = element.sum(total, factors.fold(first, |a, b| element.product(a, b)));
        });
        total
    };
    Ok(vec![Tensor::from_fn(element, shape, value)?])
}

#[cfg(test)]
mod tests {
    use crate::tensor::Tensor;
    use crate::testing::Setting::Text;
    use crate::testing::computed;

    fn summed(equation: &str, shapes: &[&[usize]]) -> pdk_sdk::error::Result<Tensor> {
        computed(12, |s| {
            let inputs: Vec<_> = shapes
                .iter()
                .enumerate()
                .map(|(place, shape)| {
                    let ones = vec![1.0; shape.iter().product()];
                    s.weights(&format!("x{place}"), Tensor::floats(shape, ones))
                })
                .collect();
            let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
            s.node("Einsum", &inputs, "y", &[("equation", Text(equation))]);
        })
    }

    #[test]
    fn dots_broadcast_and_what_comes_out_may_be_left_out() {
        for (equation, shapes, shape, value) in [
            ("ij,jk", &[&[2, 3][..], &[3, 4]][..], &[2, 4][..], 3.0),
            ("ba", &[&[2, 3]], &[3, 2], 1.0),
            ("ii", &[&[3, 3]], &[], 3.0),
            ("... i j , ...jk -> ...ik", &[&[5, 1, 2, 3], &[4, 3, 2]], &[5, 4, 2, 2], 3.0),
            ("...i->i", &[&[2, 3, 4]], &[4], 6.0),
            ("...,...", &[&[2], &[2]], &[2], 1.0),
            ("a,a->", &[&[0], &[0]], &[], 0.0),
        ] {
            let result = summed(equation, shapes).unwrap();
            assert_eq!(result.shape, shape, "{equation}");
            assert!(result.values.iter().all(|&found| found == value), "{equation}: {result:?}");
        }
    }

    #[test]
    fn equations_that_do_not_fit_are_errors() {
        for (equation, shapes) in [
            ("", &[&[2, 3][..]][..]),
            ("ij,jk->ik", &[&[2, 3]]),
            ("ij", &[&[2, 3], &[3, 4]]),
            ("ij,jk->ik", &[&[2, 3], &[4, 4]]),
            ("ijk", &[&[2, 3]]),
            ("i", &[&[2, 3]]),
            ("i.j", &[&[2, 3]]),
            ("......", &[&[2, 3]]),
            ("i1", &[&[2, 3]]),
            ("ij->ii", &[&[2, 3]]),
            ("ij->k", &[&[2, 3]]),
            ("ij->i->j", &[&[2, 3]]),
            ("ij->...i...", &[&[2, 3]]),
            ("a,b,c,d->", &[&[1000], &[1000], &[1000], &[1000]]),
        ] {
            assert!(summed(equation, shapes).is_err(), "{equation}");
        }
    }
}
