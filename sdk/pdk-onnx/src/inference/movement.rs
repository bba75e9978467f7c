//! Operators that move elements and change none: for each element of the output, where it comes from is known beforehand.
//!
//! The operator's own rule finds that out. It computes twice, from numbers in place of the elements: what moves with the numbers is an
//! element, the rest is constant.

use pdk_sdk::error::{Error, Result};

use super::buffer::{Buffer, Constants, Operation};
use crate::operators::Operator;
use crate::site::Site;
use crate::tensor::{Tensor, elements};

/// The inputs whose elements an operator moves, by their places; nothing if it computes.
pub fn moved(name: &str, inputs: usize) -> Option<Vec<usize>> {
    Some(match name {
        "Concat" => (0..inputs).collect(),
        "Transpose" | "Slice" | "Split" | "Expand" | "Gather" | "Reshape" | "Flatten" | "Squeeze"
        | "Unsqueeze" | "Identity" | "Dropout" | "Tile" | "DepthToSpace" | "SpaceToDepth"
        | "GatherElements" | "GatherND" | "ReverseSequence" | "CenterCropPad" | "Trilu" | "Compress"
        | "MaxUnpool" => vec![0],
        "Pad" => vec![0, 2],
        "Where" => vec![1, 2],
        "OneHot" => vec![2],
        "ScatterElements" | "Scatter" | "ScatterND" => vec![0, 2],
        _ => return None,
    })
}

/// Elements of an input, or a number, for each element of an output.
pub struct Movement {
    /// The places of the inputs that are read.
    places: Vec<usize>,
    outputs: Vec<Moves>,
}

/// How an output is filled.
enum Moves {
    Pieces(Vec<Piece>),
    /// Where each element comes from, in the first of the inputs that are read: shorter than many pieces of few elements.
    Each(Vec<u32>),
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
        for (place, name) in site.node.output.iter().enumerate().filter(|(_, name)| !name.is_empty()) {
            let count = elements(&site.values.fact(name)?.shape)?;
            if first.get(place).is_none_or(|tensor| tensor.values.len() != count) {
                return Err(Error::new(format!("its output {} is not computed here", place + 1)));
            }
        }
        let outputs = first.iter().zip(&second).map(|(first, second)| {
            let mut pieces: Vec<Piece> = Vec::new();
            for (&a, &b) in first.values.iter().zip(&second.values) {
                let is_element = b - a == total as f64 && total > 0;
                let number = a as usize;
                let input = starts.partition_point(|&start| start < number) - usize::from(is_element);
                match pieces.last_mut() {
                    Some(Piece::Elements(from, start, count))
                        if is_element
                            && *from as usize == input
                            && starts[input] + (*start + *count) as usize + 1 == number =>
                    {
                        *count += 1;
                    }
                    Some(Piece::Number(count, value)) if !is_element && value.to_bits() == a.to_bits() => {
                        *count += 1
                    }
                    _ if is_element => {
                        pieces.push(Piece::Elements(input as u32, (number - 1 - starts[input]) as u32, 1));
                    }
                    _ => pieces.push(Piece::Number(1, a)),
                }
            }
            let short = variable.len() == 1 && pieces.len() > first.values.len() / 4;
            match short && pieces.iter().all(|piece| matches!(piece, Piece::Elements(..))) {
                true => Moves::Each(first.values.iter().map(|number| *number as u32 - 1).collect()),
                false => Moves::Pieces(pieces),
            }
        });
        let outputs = outputs.collect();
        Ok(Some(Self { places: variable, outputs }))
    }
}

impl Operation for Movement {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let input = |input: usize| inputs.get(self.places[input]).copied().flatten();
        for (moves, output) in self.outputs.iter().zip(outputs) {
            match output {
                Buffer::Single(into) => moves.fill(
                    into,
                    |value| value as f32,
                    |place| match input(place) {
                        Some(Buffer::Single(values)) => values,
                        _ => &[],
                    },
                ),
                Buffer::Double(into) => moves.fill(
                    into,
                    |value| value,
                    |place| match input(place) {
                        Some(Buffer::Double(values)) => values,
                        _ => &[],
                    },
                ),
            }
        }
        Ok(())
    }
}

impl Moves {
    /// Fills an output.
    fn fill<'a, T: Copy + 'a>(
        &self,
        into: &mut [T],
        number: impl Fn(f64) -> T,
        input: impl Fn(usize) -> &'a [T],
    ) {
        match self {
            Self::Each(places) => {
                let values = input(0);
                into.iter_mut().zip(places).for_each(|(into, place)| *into = values[*place as usize]);
            }
            Self::Pieces(pieces) => {
                let mut rest = into;
                for piece in pieces {
                    let (Piece::Elements(_, _, count) | Piece::Number(count, _)) = *piece;
                    let Some((now, later)) = rest.split_at_mut_checked(count as usize) else { return };
                    match *piece {
                        Piece::Elements(place, from, _) => {
                            now.copy_from_slice(&input(place as usize)[from as usize..][..now.len()]);
                        }
                        Piece::Number(_, value) => now.fill(number(value)),
                    }
                    rest = later;
                }
            }
        }
    }
}
