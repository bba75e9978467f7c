//! From frames to the numbers of the image, with the memory of a stack.
//!
//! A frame is resized to the size that crops are meant for, cut, resized to the network's image, converted in colour, and turned into
//! numbers; the stack keeps bytes of earlier frames. The order is that of the programs that train networks, and each step rounds to bytes as
//! theirs do.

use std::collections::VecDeque;

use pdk_sdk::error::Result;
use pdk_sdk::prelude::{Frame, FrameBuf};

use crate::color::Color;
use crate::described::Differences;
use crate::image::Image;
use crate::numbers::Numbers;
use crate::plan::Plan;
use crate::region::{Part, Region};
use crate::resize::{Filter, Resizer};

/// What a place in the image holds, by the ages of frames: 0 is the newest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Slot {
    Frame(usize),
    /// The newer less the older.
    Difference(usize, usize),
}

/// How far apart in an image's tensor neighbours are along its axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Strides {
    across: usize,
    down: usize,
    /// From channel to channel.
    pub(crate) deep: usize,
    /// From one place of the stack to the next.
    next: usize,
}

impl Strides {
    /// Where the first channel of a pixel in a place of the stack is.
    pub(crate) fn place(&self, place: usize, y: usize, x: usize) -> usize {
        place * self.next + y * self.down + x * self.across
    }
}

/// Makes the image of frames.
pub struct Eye {
    pub(crate) image: Image,
    pub(crate) frame: Option<[usize; 2]>,
    pub(crate) region: Region,
    filter: Filter,
    pub(crate) color: Color,
    pub(crate) numbers: Numbers,
    spacing: usize,
    pub(crate) starts_with_zeros: bool,
    pub(crate) slots: Vec<Slot>,
    /// The bytes of frames, the newest first, pixel by pixel.
    seen: VecDeque<Vec<u8>>,
    /// To the size that crops are meant for, and to the network's.
    pub(crate) resizers: [Option<Resizer>; 2],
    whole: FrameBuf,
}

impl Eye {
    /// Prepares for the image of a plan.
    pub fn new(plan: &Plan) -> Self {
        let described = &plan.described;
        let frames = plan.image.frames;
        let differences = (1..frames).rev().map(|age| Slot::Difference(age - 1, age));
        let mut slots: Vec<Slot> = match described.differences {
            Differences::None => (0..frames).rev().map(Slot::Frame).collect(),
            Differences::Only | Differences::Both => differences.collect(),
        };
        if described.newest_first {
            slots.reverse();
        }
        if described.differences == Differences::Both {
            slots.insert(0, Slot::Frame(0));
        }
        Self {
            frame: described.frame,
            region: described.region,
            filter: described.resize,
            color: plan.color,
            numbers: Numbers::new(plan.scale, &described.mean, &described.std, plan.image.channels),
            spacing: described.spacing,
            starts_with_zeros: described.starts_with_zeros,
            slots,
            seen: VecDeque::new(),
            resizers: [None, None],
            whole: FrameBuf::new(1, 1),
            image: plan.image.clone(),
        }
    }

    /// Width and height of the network's image.
    pub fn size(&self) -> (usize, usize) {
        (self.image.width, self.image.height)
    }

    /// The least and the greatest number that a byte becomes.
    pub fn range(&self) -> (f32, f32) {
        self.numbers.range()
    }

    /// The part of a frame of this size that becomes the image, to the nearest pixel.
    ///
    /// # Errors
    /// If nothing is left of the frame.
    pub fn part(&self, width: usize, height: usize) -> Result<Part> {
        let [meant_width, meant_height] = self.frame.unwrap_or([width, height]);
        let part = self.region.part(meant_width, meant_height)?;
        let scaled = |at: usize, from: usize, to: usize| (2 * at * to + from) / (2 * from);
        let (left, top) = (scaled(part.left, meant_width, width), scaled(part.top, meant_height, height));
        let right = scaled(part.left + part.width, meant_width, width).max(left + 1).min(width);
        let bottom = scaled(part.top + part.height, meant_height, height).max(top + 1).min(height);
        Ok(Part {
            left: left.min(right - 1),
            top: top.min(bottom - 1),
            width: right - left.min(right - 1),
            height: bottom - top.min(bottom - 1),
        })
    }

    /// Whether all of a frame becomes the image.
    pub fn sees_all(&self) -> bool {
        self.region == Region::Whole
    }

    /// What the network sees of a frame, in the size of its image and still in red, green and blue.
    ///
    /// # Errors
    /// If nothing is left of the frame.
    pub fn fit(&mut self, frame: Frame<'_>) -> Result<FrameBuf> {
        let (width, height) = self.size();
        let mut fitted = FrameBuf::new(width, height);
        let [first, second] = &mut self.resizers;
        let whole = match self.frame {
            Some(meant) if meant != [frame.width(), frame.height()] => {
                self.whole.resize(meant[0], meant[1]);
                prepared(first, self.filter, frame, meant).resize(frame, self.whole.as_mut());
                self.whole.as_ref()
            }
            _ => frame,
        };
        let part = self.region.part(whole.width(), whole.height())?.of(whole)?;
        prepared(second, self.filter, part, [width, height]).resize(part, fitted.as_mut());
        Ok(fitted)
    }

    /// Writes the image of a frame, which has its size, and of those before it, and remembers it.
    pub fn see(&mut self, fitted: Frame<'_>, values: &mut [f32]) {
        let most = (self.image.frames - 1) * self.spacing + 1;
        let mut bytes = match self.seen.len() >= most {
            true => self.seen.pop_back().unwrap_or_default(),
            false => Vec::new(),
        };
        self.convert(fitted, &mut bytes);
        self.seen.push_front(bytes);
        let at = |age: usize| {
            let found = self.seen.get(age * self.spacing);
            found.or(if self.starts_with_zeros { None } else { self.seen.back() })
        };
        self.write(at, values);
    }

    /// Writes the image of a frame, which has its size, as if it were the first.
    pub fn see_first(&self, fitted: Frame<'_>, values: &mut [f32]) {
        let mut bytes = Vec::new();
        self.convert(fitted, &mut bytes);
        let at = |age: usize| (age == 0 || !self.starts_with_zeros).then_some(&bytes);
        self.write(at, values);
    }

    /// Forgets all frames.
    pub fn forget(&mut self) {
        self.seen.clear();
    }

    /// The bytes of a frame in the network's colours.
    fn convert(&self, fitted: Frame<'_>, bytes: &mut Vec<u8>) {
        let channels = self.image.channels;
        bytes.resize(self.image.width * self.image.height * channels, 0);
        let pixels = fitted.rows().flat_map(|row| row.as_chunks::<3>().0);
        match bytes.as_chunks_mut::<3>() {
            (into, []) if channels == 3 && self.color == Color::Rgb => {
                into.iter_mut().zip(pixels).for_each(|(into, pixel)| *into = *pixel);
            }
            (into, []) if channels == 3 => {
                into.iter_mut().zip(pixels).for_each(|(into, pixel)| *into = self.color.pixel(*pixel));
            }
            _ => {
                for (into, pixel) in bytes.chunks_exact_mut(channels).zip(pixels) {
                    into.copy_from_slice(&self.color.pixel(*pixel)[..channels]);
                }
            }
        }
    }

    /// How the image's tensor is laid out.
    pub(crate) fn strides(&self) -> Strides {
        let stride = |letter: char| {
            let axis = self.image.axis(letter);
            axis.map(|axis| self.image.shape[axis + 1..].iter().product::<usize>())
        };
        let [across, down, deep] = ['w', 'h', 'c'].map(|letter| stride(letter).unwrap_or_default());
        // Without an axis for time, frames are joined along the channels.
        Strides { across, down, deep, next: stride('t').unwrap_or(deep * self.image.channels) }
    }

    /// Writes all places; `at` has the bytes of the frame of an age.
    fn write<'a>(&self, at: impl Fn(usize) -> Option<&'a Vec<u8>>, values: &mut [f32]) {
        for (place, slot) in self.slots.iter().enumerate() {
            match *slot {
                Slot::Frame(age) => self.write_place(place, at(age), values, |_, number| number),
                Slot::Difference(newer, older) => {
                    self.write_place(place, at(newer), values, |_, number| number);
                    self.write_place(place, at(older), values, |newer, number| newer - number);
                }
            }
        }
    }

    /// Writes a place of the stack: what becomes of the values there and the numbers of a frame, which are 0 if there is none.
    fn write_place(
        &self,
        place: usize,
        bytes: Option<&Vec<u8>>,
        values: &mut [f32],
        becomes: impl Fn(f32, f32) -> f32,
    ) {
        let strides = self.strides();
        let (width, channels) = (self.image.width, self.image.channels);
        for channel in 0..channels {
            let table = self.numbers.table(channel);
            for y in 0..self.image.height {
                let into = &mut values[strides.place(place, y, 0) + channel * strides.deep..];
                let into = &mut into[..(width - 1) * strides.across + 1];
                let row = bytes.map(|bytes| &bytes[y * width * channels..][..width * channels]);
                match (row, row.map(<[u8]>::as_chunks::<3>)) {
                    // What nearly all networks have, without steps that are not known before.
                    (_, Some((pixels, []))) if channels == 3 && strides.across == 1 => {
                        for (into, pixel) in into.iter_mut().zip(pixels) {
                            *into = becomes(*into, table[usize::from(pixel[channel])]);
                        }
                    }
                    (Some(row), _) => {
                        let bytes = row.iter().skip(channel).step_by(channels);
                        for (into, byte) in into.iter_mut().step_by(strides.across.max(1)).zip(bytes) {
                            *into = becomes(*into, table[usize::from(*byte)]);
                        }
                    }
                    (None, _) => into
                        .iter_mut()
                        .step_by(strides.across.max(1))
                        .for_each(|into| *into = becomes(*into, 0.0)),
                }
            }
        }
    }
}

/// The resizer for frames like this one, made again if their size has changed.
fn prepared<'a>(
    kept: &'a mut Option<Resizer>,
    filter: Filter,
    frame: Frame<'_>,
    to: [usize; 2],
) -> &'a Resizer {
    let from = [frame.width(), frame.height()];
    if kept.as_ref().is_none_or(|resizer| resizer.from != from) {
        *kept = None;
    }
    kept.get_or_insert_with(|| Resizer::new(filter, from, to))
}

#[cfg(test)]
#[path = "eye_tests.rs"]
mod tests;
