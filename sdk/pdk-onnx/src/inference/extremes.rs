//! `ArgMax` and `ArgMin`: the places of the greatest and the least elements along an axis.

use pdk_sdk::error::{Error, Result};

use super::buffer::{Buffer, Operation, single};
use super::lanes::{Lanes, Work, dispatch};
use super::sums::extreme;
use crate::site::{Site, axis};

/// A search along an axis.
pub struct Extremes {
    is_greatest: bool,
    /// Whether the last of equal elements is wanted.
    is_last: bool,
    /// The elements along the axis, and how far they are apart.
    length: usize,
    apart: usize,
    /// The farthest element so far of each line that begins in the same row, and its place.
    far: Vec<f32>,
    places: Vec<u32>,
}

impl Extremes {
    /// The search of a node; nothing if it does something else.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn new(site: &Site<'_>) -> Result<Option<Self>> {
        let is_greatest = match site.node.op_type.as_str() {
            "ArgMax" => true,
            "ArgMin" => false,
            _ => return Ok(None),
        };
        let shape = site.shape(0)?;
        let axis = axis(site.int("axis", 0), shape.len())?;
        let apart = shape[axis + 1..].iter().product();
        Ok(Some(Self {
            is_greatest,
            is_last: site.int("select_last_index", 0) != 0,
            length: shape[axis],
            apart,
            far: vec![0.0; apart],
            places: vec![0; apart],
        }))
    }
}

impl Operation for Extremes {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let Buffer::Double(into) = &mut outputs[0] else {
            return Err(Error::new("a place has less than 64 bits, which is a defect in pdk"));
        };
        dispatch(Search { of: self, input: single(inputs, 0)?, into });
        Ok(())
    }
}

struct Search<'a> {
    of: &'a mut Extremes,
    input: &'a [f32],
    into: &'a mut [f64],
}

impl Work for Search<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        match (self.of.is_greatest, self.of.is_last) {
            (true, false) => self.along::<true, false>(),
            (true, true) => self.along::<true, true>(),
            (false, false) => self.along::<false, false>(),
            (false, true) => self.along::<false, true>(),
        }
    }
}

impl Search<'_> {
    #[inline(always)]
    fn along<const GREATEST: bool, const LAST: bool>(self) {
        let Extremes { length, apart, far, places, .. } = self.of;
        let block = (*length * *apart).max(1);
        for (input, into) in self.input.chunks_exact(block).zip(self.into.chunks_exact_mut((*apart).max(1))) {
            if let [into] = into
                && let Some(place) = of_line::<GREATEST, LAST>(input)
            {
                *into = place as f64;
                continue;
            }
            for (row, values) in input.chunks_exact((*apart).max(1)).enumerate() {
                if row == 0 {
                    far.copy_from_slice(values);
                    places.fill(0);
                    continue;
                }
                for ((far, place), value) in far.iter_mut().zip(places.iter_mut()).zip(values) {
                    let is_further = further::<GREATEST, LAST>(*value, *far);
                    *far = if is_further { *value } else { *far };
                    *place = if is_further { row as u32 } else { *place };
                }
            }
            for (into, place) in into.iter_mut().zip(places.iter()) {
                *into = f64::from(*place);
            }
        }
    }
}

/// Whether an element comes before the one that was found. What is not a number is greater than every number.
#[inline(always)]
fn further<const GREATEST: bool, const LAST: bool>(value: f32, far: f32) -> bool {
    let is_beyond = match GREATEST {
        true => (value > far) | (value.is_nan() & !far.is_nan()),
        false => (value < far) | (far.is_nan() & !value.is_nan()),
    };
    is_beyond | (LAST & ((value == far) | (value.is_nan() & far.is_nan())))
}

/// The place in a line; nothing if something in it is not a number.
#[inline(always)]
fn of_line<const GREATEST: bool, const LAST: bool>(line: &[f32]) -> Option<usize> {
    let far = if GREATEST { f32::NEG_INFINITY } else { f32::INFINITY };
    let found = extreme::<GREATEST>(far, line);
    if LAST { line.iter().rposition(|x| *x == found) } else { line.iter().position(|x| *x == found) }
}
