//! `Conv` and `ConvTranspose`: which elements of the input each output is a sum over, as lists of offsets.
//!
//! A transposed convolution is as many convolutions as its strides have phases: the outputs of a phase are sums over the same taps.

use std::collections::BTreeMap;

use pdk_sdk::error::{Error, Result};

use super::buffer::{Buffer, Operation, single, singles};
use super::lanes::{LANES, Number};
use super::planar::{self, Row, Rows};
use super::product::{self, Packed, Place};
use super::wide;
use crate::operators::{conv, conv_transpose};
use crate::site::Site;
use crate::tensor::{Tensor, elements, for_each_position};

/// A convolution, or one that is transposed.
pub struct Convolution<N = f32> {
    batch: usize,
    group: usize,
    /// Channels of the input in a group.
    depth: usize,
    /// Channels of the output in a group.
    filters: usize,
    /// The elements of a channel of the output.
    plane: usize,
    /// The lengths of a channel of the input, and how it is laid out before it is read.
    input: Vec<usize>,
    layout: Layout,
    parts: Vec<Part<N>>,
    /// The input as it is read, with what is around it.
    laid_out: Vec<N>,
    /// Whether the weights are constant: then they have been packed.
    is_constant: bool,
    bias: Option<Vec<N>>,
    transposed: bool,
    /// Whether results below 0 become 0.
    is_cut: bool,
}

/// Outputs that are sums over the same taps.
struct Part<N> {
    taps: Vec<u32>,
    /// For each tap the channel and the element of the kernel.
    elements: Vec<(usize, usize)>,
    places: Places,
    /// By group.
    weights: Vec<Weights<N>>,
}

/// Where the outputs are.
enum Places {
    Each(Vec<Place>),
    Rows(Rows),
    /// With registers of sixteen lanes.
    Wide(Rows),
}

enum Weights<N> {
    Outputs(Packed<N>),
    Places(planar::Weights<N>),
    Wide(wide::Weights<N>),
}

/// How a channel of the input is laid out.
struct Layout {
    /// Elements before the input along each axis.
    before: Vec<usize>,
    /// The lengths with what is before and behind.
    lengths: Vec<usize>,
    /// Along the last axis, elements whose places are the same modulo this lie side by side.
    phases: usize,
    /// Whether the input has to be copied for that.
    is_copied: bool,
}

impl Layout {
    fn new(input: &[usize], before: &[usize], lengths: Vec<usize>, phases: usize) -> Result<Self> {
        // A row of each phase may have one element more than its share.
        let mut rows = lengths.clone();
        if let Some(last) = rows.last_mut() {
            *last = last.saturating_add(phases);
        }
        elements(&rows)?;
        let is_copied = phases > 1 || lengths != input;
        Ok(Self { before: before.to_vec(), lengths, phases, is_copied })
    }

    /// The length of a row of one phase.
    fn row(&self) -> usize {
        self.lengths[self.lengths.len() - 1].div_ceil(self.phases)
    }

    /// The number of elements of a channel.
    fn plane(&self) -> usize {
        self.lengths[..self.lengths.len() - 1].iter().product::<usize>() * self.row() * self.phases
    }

    /// Where an element is, by its places from the beginning of what is before.
    fn at(&self, place: impl IntoIterator<Item = usize>) -> usize {
        let (last, mut offset) = (self.lengths.len() - 1, 0);
        for (axis, at) in place.into_iter().enumerate() {
            offset = match axis == last {
                true => (offset * self.phases + at % self.phases) * self.row() + at / self.phases,
                false => offset * self.lengths[axis] + at,
            };
        }
        offset
    }

    /// Copies the channels of an input to where they are read.
    fn lay_out<N: Copy>(&self, input: &[usize], channels: &[N], into: &mut [N]) {
        let width = input[input.len() - 1];
        let outer = &input[..input.len() - 1];
        let rows = channels.chunks_exact((outer.iter().product::<usize>() * width).max(1));
        for (channel, plane) in rows.zip(into.chunks_exact_mut(self.plane().max(1))) {
            let mut rows = channel.chunks_exact(width.max(1));
            for_each_position(outer, |place| {
                let Some(row) = rows.next() else { return };
                let place = place.iter().zip(&self.before).map(|(at, before)| at + before);
                let start = self.before[input.len() - 1];
                if self.phases == 2 {
                    let to = self.at(place.chain([0]));
                    return split(row, start, self.row(), &mut plane[to..]);
                }
                if self.phases == 1 {
                    let to = self.at(place.chain([start]));
                    plane[to..to + width].copy_from_slice(row);
                    return;
                }
                let first = self.at(place.chain([0]));
                for phase in 0..self.phases {
                    // The first element of the row that belongs to this phase.
                    let skipped = (phase + self.phases - start % self.phases) % self.phases;
                    let to = first + phase * self.row() + (start + skipped) / self.phases;
                    let values = row.iter().skip(skipped).step_by(self.phases);
                    plane[to..].iter_mut().zip(values).for_each(|(into, value)| *into = *value);
                }
            });
        }
    }
}

impl Convolution {
    /// `Conv`.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn new(site: &Site<'_>, weights: Option<&Tensor>, bias: Option<&Tensor>) -> Result<Self> {
        let (image, kernel) = (site.shape(0)?, site.shape(1)?);
        Ok(Self::over(site, image, kernel, kernel[1])?.with(weights, bias))
    }

    /// `ConvTranspose`.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn transposed(site: &Site<'_>, weights: Option<&Tensor>, bias: Option<&Tensor>) -> Result<Self> {
        let (window, group) = conv_transpose::window(site)?;
        let (image, kernel) = (site.shape(0)?, site.shape(1)?);
        let (depth, filters) = (image[1] / group, kernel[1]);
        let axes = window.kernel.len();
        // An output at `o` is a sum over the taps `t` for which `o + before - t dilation` is a multiple of the stride: of the input there.
        let reach = |axis: usize| (window.kernel[axis] - 1) * window.dilations[axis] / window.strides[axis];
        let before: Vec<usize> = (0..axes).map(reach).collect();
        let quotient = |axis: usize, at: usize| (at + window.before[axis]) / window.strides[axis];
        let lengths = (0..axes).map(|axis| {
            let farthest = window.input[axis].checked_sub(1).map_or(0, |last| quotient(axis, last) + 1);
            before[axis] + farthest.max(window.output[axis])
        });
        let layout = Layout::new(&window.output, &before, lengths.collect(), 1)?;
        // Only phases that have outputs, of which there may be fewer than the strides say.
        let mut phases: BTreeMap<Vec<usize>, Vec<Place>> = BTreeMap::new();
        let mut to = 0;
        for_each_position(&window.input, |place| {
            let phase = |axis: usize| (place[axis] + window.before[axis]) % window.strides[axis];
            let from = layout.at((0..axes).map(|axis| quotient(axis, place[axis])));
            phases.entry((0..axes).map(phase).collect()).or_default().push(Place { from: from as u32, to });
            to += 1;
        });
        let parts = phases.into_iter().map(|(phase, places)| {
            // Offsets are counted from the farthest element, so that none is negative.
            let tap = |axis: usize, at: usize| {
                let reach = at * window.dilations[axis];
                let distance = reach.checked_sub(phase[axis])?;
                (distance % window.strides[axis] == 0).then(|| before[axis] - distance / window.strides[axis])
            };
            let places = by_rows(places, filters, window.strides[axes - 1]);
            Part::new(&layout, depth, &window.kernel, places, tap)
        });
        let parts = parts.collect::<Result<_>>()?;
        let plane = window.input.iter().product();
        let shape = Shape { batch: image[0], group, depth, filters, plane, transposed: true };
        Ok(Self::of(shape, window.output, layout, parts)?.with(weights, bias))
    }

    /// The same with constant weights and a constant bias, as far as they are.
    fn with(mut self, weights: Option<&Tensor>, bias: Option<&Tensor>) -> Self {
        self.bias = bias.map(singles);
        if let Some(weights) = weights {
            let bias = self.bias.take().unwrap_or_default();
            self.pack(&singles(weights), &bias);
            self.is_constant = true;
        }
        self
    }
}

impl<N: Number> Convolution<N> {
    /// A convolution of an image with a kernel of these shapes, which has as many numbers for each filter and place of the kernel as
    /// `depth` says. Its weights are packed later.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn over(site: &Site<'_>, image: &[usize], kernel: &[usize], depth: usize) -> Result<Self> {
        let (window, group) = conv::window_over(site, image, kernel)?;
        let filters = kernel[0] / group;
        let last = window.kernel.len() - 1;
        // So that the elements of neighbouring places are neighbours too, if those may become lanes.
        let width = window.output[last];
        let are_places = filters < LANES && width >= LANES || wide::is_faster(filters, width);
        let phases = if are_places { window.strides[last] } else { 1 };
        let lengths =
            (0..=last).map(|axis| window.extent(axis).max(window.before[axis] + window.input[axis]));
        let layout = Layout::new(&window.input, &window.before, lengths.collect(), phases)?;
        let mut places = Vec::new();
        for_each_position(&window.output, |place| {
            let from = layout.at(place.iter().zip(&window.strides).map(|(at, stride)| at * stride));
            places.push(Place { from: from as u32, to: places.len() as u32 });
        });
        let places = by_rows(places, filters, 1);
        let tap = |axis: usize, at: usize| Some(at * window.dilations[axis]);
        let part = Part::new(&layout, depth, &window.kernel, places, tap)?;
        let plane = window.output.iter().product();
        let shape = Shape { batch: image[0], group, depth, filters, plane, transposed: false };
        Self::of(shape, window.input, layout, vec![part])
    }

    fn of(shape: Shape, input: Vec<usize>, layout: Layout, parts: Vec<Part<N>>) -> Result<Self> {
        let Shape { batch, group, depth, filters, plane, transposed } = shape;
        let room = if layout.is_copied { elements(&[depth, layout.plane()])? } else { 0 };
        elements(&[filters, plane, 2])?;
        Ok(Self {
            batch,
            group,
            depth,
            filters,
            plane,
            input,
            layout,
            parts,
            laid_out: vec![N::default(); room],
            is_constant: false,
            bias: None,
            transposed,
            is_cut: false,
        })
    }

    /// Packs the weights for every part.
    pub fn pack(&mut self, weights: &[N], bias: &[N]) {
        let (group, depth, filters, transposed) = (self.group, self.depth, self.filters, self.transposed);
        for part in &mut self.parts {
            // Weights of a convolution are by filter, channel and element; of a transposed one, by channel, filter and element.
            let taps = weights.len() / (group * depth * filters).max(1);
            let elements = &part.elements;
            part.weights = (0..group)
                .map(|group| {
                    let weight = |filter: usize, tap: usize| {
                        let (channel, element) = elements[tap];
                        let row = match transposed {
                            true => (group * depth + channel) * filters + filter,
                            false => (group * filters + filter) * depth + channel,
                        };
                        weights[row * taps + element]
                    };
                    let start =
                        |filter: usize| bias.get(group * filters + filter).copied().unwrap_or_default();
                    match &part.places {
                        Places::Each(places) => Weights::Outputs(Packed::new(
                            filters,
                            elements.len(),
                            places.len(),
                            weight,
                            start,
                        )),
                        Places::Rows(_) => {
                            Weights::Places(planar::Weights::new(filters, elements.len(), weight, start))
                        }
                        Places::Wide(_) => {
                            Weights::Wide(wide::Weights::new(filters, elements.len(), weight, start))
                        }
                    }
                })
                .collect();
        }
    }
}

/// Copies a row to two phases: the elements at even places begin at the first element of `into`, the others `length` behind it. The first
/// element of the row is at the place `start`.
fn split<N: Copy>(row: &[N], start: usize, length: usize, into: &mut [N]) {
    let (front, behind) = into.split_at_mut(length);
    let (first, second) = match start % 2 {
        0 => (&mut front[start / 2..], &mut behind[start / 2..]),
        _ => (&mut behind[start / 2..], &mut front[start / 2 + 1..]),
    };
    let (pairs, last) = row.as_chunks::<2>();
    for (([one, other], first), second) in pairs.iter().zip(&mut *first).zip(second) {
        (*first, *second) = (*one, *other);
    }
    if let [last] = last {
        first[pairs.len()] = *last;
    }
}

struct Shape {
    batch: usize,
    group: usize,
    depth: usize,
    filters: usize,
    plane: usize,
    transposed: bool,
}

impl<N> Part<N> {
    /// The taps of a kernel. `tap` says how far an element of it lies from where a place begins, along an axis; none if it is not an
    /// element for this part.
    fn new(
        layout: &Layout,
        depth: usize,
        kernel: &[usize],
        places: Places,
        tap: impl Fn(usize, usize) -> Option<usize>,
    ) -> Result<Self> {
        let plane = layout.plane();
        if u32::try_from(depth.saturating_mul(plane)).is_err() {
            return Err(Error::new("its input is too large"));
        }
        let mut within = Vec::new();
        let mut element = 0;
        for_each_position(kernel, |place| {
            let offsets: Option<Vec<usize>> =
                place.iter().enumerate().map(|(axis, &at)| tap(axis, at)).collect();
            within.extend(offsets.map(|offsets| (layout.at(offsets), element)));
            element += 1;
        });
        let all =
            (0..depth).flat_map(|channel| within.iter().map(move |(tap, element)| (channel, tap, element)));
        Ok(Self {
            taps: all.clone().map(|(channel, tap, _)| (channel * plane + tap) as u32).collect(),
            elements: all.map(|(channel, _, element)| (channel, *element)).collect(),
            places,
            weights: Vec::new(),
        })
    }
}

/// Places as rows, if they are better as lanes than outputs: there are few outputs, or their number fills registers badly, and all rows are
/// wide. `step` is how far apart the outputs of neighbouring places are.
fn by_rows(places: Vec<Place>, filters: usize, step: usize) -> Places {
    let follows = |before: &Place, after: &Place| {
        after.from == before.from + 1 && after.to as usize == before.to as usize + step
    };
    let rows: Vec<&[Place]> = places.chunk_by(follows).collect();
    let width = rows.first().map_or(0, |row| row.len());
    let is_wide = step == 1 && wide::is_faster(filters, width);
    let are_few = filters < LANES && width >= LANES;
    if !(is_wide || are_few) || rows.iter().any(|row| row.len() != width) {
        return Places::Each(places);
    }
    let rows = rows.iter().map(|row| Row { from: row[0].from, to: row[0].to }).collect();
    let rows = Rows { rows, width, step };
    if is_wide { Places::Wide(rows) } else { Places::Rows(rows) }
}

impl<N: Number> Convolution<N> {
    /// The number of results.
    pub fn results(&self) -> usize {
        self.batch * self.group * self.filters * self.plane
    }

    /// The number of elements that are kept from one image to the next.
    pub fn kept(&self) -> usize {
        self.laid_out.len()
    }

    /// Convolves an image; the weights have been packed.
    ///
    /// # Errors
    /// If they are packed for other places, which is a defect.
    pub fn convolve(&mut self, image: &[N], result: &mut [N]) -> Result<()> {
        let (channel, plane) = (self.input.iter().product::<usize>(), self.plane);
        for number in 0..self.batch * self.group {
            let image = &image[number * self.depth * channel..][..self.depth * channel];
            let into = &mut result[number * self.filters * plane..][..self.filters * plane];
            let group = number % self.group;
            let input = match self.layout.is_copied {
                true => {
                    self.layout.lay_out(&self.input, image, &mut self.laid_out);
                    &self.laid_out
                }
                false => image,
            };
            for part in &self.parts {
                match (&part.weights[group], &part.places) {
                    (Weights::Outputs(packed), Places::Each(places)) => {
                        product::sum(input, packed, &part.taps, places, plane, self.is_cut, into);
                    }
                    (Weights::Places(weights), Places::Rows(rows)) => {
                        planar::sum(input, weights, &part.taps, rows, plane, self.is_cut, into);
                    }
                    (Weights::Wide(weights), Places::Wide(rows)) => {
                        wide::sum(input, weights, &part.taps, rows, plane, self.is_cut, into);
                    }
                    _ => {
                        return Err(Error::new(
                            "its weights are packed for other places, which is a defect in pdk",
                        ));
                    }
                }
            }
        }
        Ok(())
    }
}

impl Operation for Convolution {
    fn kept(&self) -> usize {
        Self::kept(self)
    }

    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        if !self.is_constant {
            let weights = single(inputs, 1)?;
            let bias = match (&self.bias, inputs.get(2)) {
                (Some(bias), _) => bias.clone(),
                (None, Some(Some(_))) => single(inputs, 2)?.to_vec(),
                (None, _) => Vec::new(),
            };
            self.pack(weights, &bias);
        }
        self.convolve(single(inputs, 0)?, outputs[0].single_mut()?)
    }

    fn cut(&mut self) -> bool {
        self.is_cut = true;
        true
    }
}
