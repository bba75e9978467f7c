//! Operators that move elements and change none: for each element of the output, where it comes from is known beforehand.
//!
//! The operator's own rule finds that out. It computes twice, from numbers in place of the elements: what moves with the numbers is an
//! element, the rest is constant.

use pdk_sdk::error::Result;

use super::plan::Constants;
use super::buffer::{Buffer, Operation};
use crate::operators::Operator;
use crate::site::Site;
use crate::tensor::{Tensor, elements};

/// The inputs whose elements an operator moves, by their places; nothing if it computes.
pub fn moved(name: &str, inputs: usize) -> Option<Vec<usize>> {
    Some(match name {
        "Concat" => (0..inputs).collect(),
        "Transpose" | "Slice" | "Split" | "Expand" | "Gather" | "Reshape" | "Flatten" | "Squeeze" | "Unsqueeze" | "Identity"
        | "Dropout" | "Tile" | "DepthToSpace" | "SpaceToDepth" | "GatherElements" | "GatherND" | "ReverseSequence"
        | "CenterCropPad" | "Trilu" => vec![0],
        "Pad" => vec![0, 2],
        "Where" => vec![1, 2],
        "ScatterElements" | "Scatter" | "ScatterND" => vec![0, 2],
        _ => return None,
    })
}

/// Elements of an input, or a number, for each element of an output.
pub struct Movement {
    /// The places of the inputs that are read.
    places: Vec<usize>,
    outputs: Vec<Vec<Piece>>,
}

/// Elements that lie side by side in both.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Piece {
    /// From which input, from where on, and how many.
    Elements(u32, u32, u32),
    /// How many, and which number.
    Number(u32, f64),
}

impl Movement {
    /// Where the elements of a node's outputs come from; nothing if that depends on what is computed. `constants` are the inputs that are
    /// constant.
    ///
    /// # Errors
    /// If the operator's rule refuses the node.
    pub fn new(
        operator: &Operator,
        site: &Site<'_>,
        moved: &[usize],
        constants: &Constants,
    ) -> Result<Option<Self>> {
        let reduces = site.text("reduction", "none") != "none";
        let variable: Vec<usize> = (0..constants.len())
            .filter(|&place| site.optional(place).is_some() && constants[place].is_none())
            .collect();
        if reduces || variable.iter().any(|place| !moved.contains(place)) {
            return Ok(None);
        }
        let mut total = 0;
        let mut starts = Vec::new();
        for &place in &variable {
            starts.push(total);
            total += elements(site.shape(place)?)?;
        }
        let tried = |step: usize| {
            let numbered = variable.iter().zip(&starts).map(|(&place, &start)| -> Result<_> {
                let fact = site.fact(place)?;
                let first = start + step;
                let values = (first..first + elements(&fact.shape)?).map(|number| number as f64).collect();
                Ok((place, Tensor { element: fact.element, shape: fact.shape.clone(), values }))
            });
            let numbered = numbered.collect::<Result<Vec<_>>>()?;
            let inputs: Vec<Option<&Tensor>> = constants
                .iter()
                .enumerate()
                .map(|(place, constant)| {
                    let given = numbered.iter().find(|(at, _)| *at == place).map(|(_, tensor)| tensor);
                    given.or(constant.as_deref())
                })
                .collect();
            (operator.shapes.evaluate)(site, &inputs)
        };
        let (first, second) = (tried(1)?, tried(1 + total)?);
        let outputs = first.iter().zip(&second).map(|(first, second)| {
            let mut pieces: Vec<Piece> = Vec::new();
            for (&a, &b) in first.values.iter().zip(&second.values) {
                let is_element = b - a == total as f64 && total > 0;
                let number = a as usize;
                let input = starts.partition_point(|&start| start < number) - usize::from(is_element);
                match pieces.last_mut() {
                    Some(Piece::Elements(from, start, count))
                        if is_element && *from as usize == input && starts[input] + (*start + *count) as usize + 1 == number =>
                    {
                        *count += 1;
                    }
                    Some(Piece::Number(count, value)) if !is_element && value.to_bits() == a.to_bits() => *count += 1,
                    _ if is_element => {
                        pieces.push(Piece::Elements(input as u32, (number - 1 - starts[input]) as u32, 1));
                    }
                    _ => pieces.push(Piece::Number(1, a)),
                }
            }
            pieces
        });
        let outputs = outputs.collect();
        Ok(Some(Self { places: variable, outputs }))
    }
}

impl Operation for Movement {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        for (pieces, output) in self.outputs.iter().zip(outputs) {
            match output {
                Buffer::Single(into) => fill(pieces, into, |value| value as f32, |input, from, count| {
                    match inputs.get(self.places[input]).copied().flatten() {
                        Some(Buffer::Single(values)) => Some(&values[from..from + count]),
                        _ => None,
                    }
                }),
                Buffer::Double(into) => fill(pieces, into, |value| value, |input, from, count| {
                    match inputs.get(self.places[input]).copied().flatten() {
                        Some(Buffer::Double(values)) => Some(&values[from..from + count]),
                        _ => None,
                    }
                }),
            }
        }
        Ok(())
    }
}

/// Fills an output piece by piece.
fn fill<'a, T: Copy + 'a>(
    pieces: &[Piece],
    into: &mut [T],
    number: impl Fn(f64) -> T,
    elements: impl Fn(usize, usize, usize) -> Option<&'a [T]>,
) {
    let mut rest = into;
    for piece in pieces {
        let count = match *piece {
            Piece::Elements(_, _, count) | Piece::Number(count, _) => count as usize,
        };
        let Some((now, later)) = std::mem::take(&mut rest).split_at_mut_checked(count) else { return };
        match *piece {
            Piece::Elements(input, from, _) => {
                if let Some(values) = elements(input as usize, from as usize, count) {
                    now.copy_from_slice(values);
                }
            }
            Piece::Number(_, value) => now.fill(number(value)),
        }
        rest = later;
    }
}
