//! The values of a graph while it runs.

use std::sync::Arc;

use pdk_sdk::error::{Error, Result};

use crate::tensor::{Element, Tensor};

/// The elements of a value.
#[derive(Debug, Clone, PartialEq)]
pub enum Buffer {
    /// Those of types whose every value a 32-bit float holds: floats of 32 and 16 bits, integers of 8 and 16 bits, truth values.
    Single(Vec<f32>),
    /// Those of wider types. Integers are exact up to 2^53.
    Double(Vec<f64>),
}

impl Buffer {
    /// Elements of a type.
    pub fn of(element: Element, values: &[f64]) -> Self {
        match is_single(element) {
            true => Self::Single(values.iter().map(|&value| value as f32).collect()),
            false => Self::Double(values.to_vec()),
        }
    }

    /// The elements as 64-bit floats.
    pub fn to_doubles(&self) -> Vec<f64> {
        match self {
            Self::Single(values) => values.iter().map(|&value| f64::from(value)).collect(),
            Self::Double(values) => values.clone(),
        }
    }

    /// Puts these elements in.
    pub fn set(&mut self, values: &[f64]) {
        match self {
            Self::Single(into) => into.iter_mut().zip(values).for_each(|(into, value)| *into = *value as f32),
            Self::Double(into) => into.iter_mut().zip(values).for_each(|(into, value)| *into = *value),
        }
    }

    /// The number of elements.
    pub fn len(&self) -> usize {
        match self {
            Self::Single(values) => values.len(),
            Self::Double(values) => values.len(),
        }
    }

    /// Makes room for exactly this many elements.
    pub fn resize(&mut self, count: usize) {
        match self {
            Self::Single(values) => values.resize(count, 0.0),
            Self::Double(values) => values.resize(count, 0.0),
        }
    }

    /// Rounds the elements to their type. As 32-bit or 64-bit floats they are that already.
    pub fn round(&mut self, element: Element) {
        if matches!(element, Element::FLOAT | Element::DOUBLE) {
            return;
        }
        match self {
            // What comparisons compute, and what quantises, mostly.
            Self::Single(values) if element == Element::BOOL && are_whole(values, [0.0, 1.0]) => {}
            Self::Single(values)
                if element
                    .range()
                    .is_some_and(|(low, high)| are_whole(values, [low as f32, high as f32])) => {}
            Self::Single(values) => {
                values.iter_mut().for_each(|value| *value = element.rounded(f64::from(*value)) as f32);
            }
            Self::Double(values) => values.iter_mut().for_each(|value| *value = element.rounded(*value)),
        }
    }

    /// The elements of a type that is computed in 32 bits.
    ///
    /// # Errors
    /// If they are of another, which is a defect.
    pub fn single(&self) -> Result<&[f32]> {
        match self {
            Self::Single(values) => Ok(values),
            Self::Double(_) => Err(Error::new("a value has more than 32 bits, which is a defect in pdk")),
        }
    }

    /// The same, to be written.
    ///
    /// # Errors
    /// As for [`Self::single`].
    pub fn single_mut(&mut self) -> Result<&mut [f32]> {
        match self {
            Self::Single(values) => Ok(values),
            Self::Double(_) => Err(Error::new("a value has more than 32 bits, which is a defect in pdk")),
        }
    }
}

/// 1.5 times 2^23. The floats around it are whole, so that a sum of it and a number of at most 2^22 is rounded to the nearest whole number.
pub const WHOLE: f32 = 12_582_912.0;

/// Whether all elements are whole numbers between two of at most 16 bits, both included.
fn are_whole(values: &[f32], [low, high]: [f32; 2]) -> bool {
    let is_whole = |&value: &f32| {
        let rounded = (value + WHOLE) - WHOLE;
        (rounded.to_bits() == value.to_bits()) & (value >= low) & (value <= high)
    };
    // Without an end at the first that is not, so that compilers use vectors.
    values.chunks(256).all(|some| some.iter().fold(true, |all, value| all & is_whole(value)))
}

/// The elements of a constant, for what is computed in 32 bits.
pub fn singles(tensor: &Tensor) -> Vec<f32> {
    tensor.values.iter().map(|&value| value as f32).collect()
}

/// The constants among the inputs of a node.
pub type Constants = [Option<Arc<Tensor>>];

/// Whether a 32-bit float holds every value of a type.
pub fn is_single(element: Element) -> bool {
    !matches!(element.0, 6 | 7 | 11 | 12 | 13)
}

/// What a node does while the graph runs.
pub trait Operation: Send {
    /// Computes the outputs, which have the sizes that they need, from the inputs.
    ///
    /// # Errors
    /// If it cannot.
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()>;

    /// The number of elements that it keeps beside its outputs.
    fn kept(&self) -> usize {
        0
    }

    /// Makes results below 0 become 0 from now on, as `Relu` does. Returns false, and changes nothing, if it cannot.
    fn cut(&mut self) -> bool {
        false
    }

    /// Whether what it computes are elements of their type already.
    fn is_rounded(&self) -> bool {
        false
    }
}

/// The input at a place, in 32 bits.
///
/// # Errors
/// If it is missing, or wider, which is a defect.
pub fn single<'a>(inputs: &[Option<&'a Buffer>], place: usize) -> Result<&'a [f32]> {
    let input = inputs.get(place).copied().flatten();
    input.ok_or_else(|| Error::new(format!("its input {} is missing", place + 1)))?.single()
}
