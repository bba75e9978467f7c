//! Resizing with the filters that networks are trained with, as OpenCV and PIL define them for bytes.
//!
//! All have half-pixel centres: the middle of output pixel `i` lies at `(i + 0.5) * from / to`. Weights are computed in floating point, each
//! operation rounded for itself, and pixels in whole numbers; `area` sums 32-bit floats in a fixed order, as OpenCV does. So the
//! bytes do not depend on the processor.

use pdk_sdk::ops::resize::resize_linear;
use pdk_sdk::prelude::{Frame, FrameBuf, FrameMut};

/// The names that the field takes.
pub const NAMES: [&str; 7] =
    ["bilinear", "nearest", "area", "bicubic", "pil_bilinear", "pil_bicubic", "linear"];

/// A filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// OpenCV's INTER_LINEAR, which does not average when it shrinks.
    Bilinear,
    /// PIL's NEAREST. OpenCV's INTER_NEAREST_EXACT differs from it if the middle of a pixel lies right between two.
    Nearest,
    /// OpenCV's INTER_AREA.
    Area,
    /// OpenCV's INTER_CUBIC, with the parameter -0.75. OpenCV rounds by the instructions of the processor, so that a byte may differ by one.
    Bicubic,
    /// PIL's BILINEAR, which averages when it shrinks.
    PilBilinear,
    /// PIL's BICUBIC, with the parameter -0.5, which averages when it shrinks.
    PilBicubic,
    /// The linear interpolation with which pdk's own networks were trained. It is [`Self::Bilinear`], except for the first and the last rows of a
    /// picture that grows in height, which OpenCV computes as a mix of a row with itself that is rounded twice.
    Linear,
}

impl Filter {
    /// The one of this name.
    pub fn of(name: &str) -> Option<Self> {
        let all = [
            Self::Bilinear,
            Self::Nearest,
            Self::Area,
            Self::Bicubic,
            Self::PilBilinear,
            Self::PilBicubic,
            Self::Linear,
        ];
        NAMES.iter().zip(all).find(|(known, _)| **known == name).map(|(_, filter)| filter)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        NAMES[self as usize]
    }
}

/// Fractional bits of OpenCV's weights and of PIL's.
const CV_BITS: u32 = 11;
const PIL_BITS: u32 = 22;

/// The input pixels of each output pixel along an axis, with their weights.
type Taps<W> = Vec<Vec<(usize, W)>>;

/// The input pixels of each output pixel along an axis, with their shares.
pub(crate) type Weights = Taps<f32>;

/// Where sums of whole numbers are rounded.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Rounding {
    /// At the end.
    Once,
    /// As [`resize_linear`] does: seven bits are kept between, and products lose their last bits.
    Linear,
    /// To bytes after each axis.
    Bytes,
}

/// What is prepared for frames of one size.
enum Way {
    Linear,
    /// Sums of whole numbers, rounded as OpenCV does for cubic and for linear interpolation, or as PIL does.
    Whole {
        columns: Taps<i64>,
        rows: Taps<i64>,
        rounding: Rounding,
    },
    Area {
        columns: Taps<f32>,
        rows: Taps<f32>,
    },
    /// Whole numbers of pixels are averaged.
    Blocks {
        width: usize,
        height: usize,
    },
}

/// Brings frames of one size to another.
pub struct Resizer {
    /// Width and height of the frames that it was prepared for.
    pub from: [usize; 2],
    to: [usize; 2],
    way: Way,
}

impl Resizer {
    /// Prepares to bring frames to a size.
    pub fn new(filter: Filter, from: [usize; 2], to: [usize; 2]) -> Self {
        let axes = |axis: fn(usize, usize) -> Taps<i64>, rounding: Rounding| {
            let [columns, rows] = [0, 1].map(|i| axis(from[i], to[i]));
            Way::Whole { columns, rows, rounding }
        };
        let pil = |filter: fn(f64) -> f64, support: f64| {
            let [columns, rows] = [0, 1].map(|i| pil_taps(from[i], to[i], filter, support));
            Way::Whole { columns, rows, rounding: Rounding::Bytes }
        };
        let shrinks = (0..2).all(|i| from[i] >= to[i]);
        let blocks = (0..2).all(|i| from[i].is_multiple_of(to[i]));
        let way = match filter {
            Filter::Bilinear if to[1] > from[1] => {
                let (columns, rows) = (linear_taps(from[0], to[0], true), linear_taps(from[1], to[1], false));
                Way::Whole { columns, rows, rounding: Rounding::Linear }
            }
            Filter::Linear | Filter::Bilinear => Way::Linear,
            Filter::Nearest => axes(nearest_taps, Rounding::Once),
            Filter::Bicubic => axes(cubic_taps, Rounding::Once),
            Filter::Area if shrinks && blocks => {
                Way::Blocks { width: from[0] / to[0], height: from[1] / to[1] }
            }
            Filter::Area if shrinks => {
                let [columns, rows] = [0, 1].map(|i| area_taps(from[i], to[i]));
                Way::Area { columns, rows }
            }
            Filter::Area => axes(grown_area_taps, Rounding::Linear),
            Filter::PilBilinear => pil(|x| (1.0 - x.abs()).max(0.0), 1.0),
            Filter::PilBicubic => pil(|x| cubic(x.abs(), -0.5), 2.0),
        };
        Self { from, to, way }
    }

    /// The shares of input pixels in each output pixel, across and down. What is rounded is left out.
    pub(crate) fn weights(&self) -> [Weights; 2] {
        let whole = |taps: &Taps<i64>, one: f64| -> Weights {
            let share = |(place, weight): &(usize, i64)| (*place, (*weight as f64 / one) as f32);
            taps.iter().map(|taps| taps.iter().map(share).collect()).collect()
        };
        let (from, to) = (self.from, self.to);
        if from == to {
            return to.map(|length| (0..length).map(|place| vec![(place, 1.0)]).collect());
        }
        match &self.way {
            Way::Linear => [0, 1].map(|i| whole(&linear_taps(from[i], to[i], true), f64::from(1 << CV_BITS))),
            Way::Whole { columns, rows, rounding } => {
                let bits = if *rounding == Rounding::Bytes { PIL_BITS } else { CV_BITS };
                [columns, rows].map(|taps| whole(taps, f64::from(1 << bits)))
            }
            Way::Area { columns, rows } => [columns.clone(), rows.clone()],
            Way::Blocks { width, height } => [(to[0], *width), (to[1], *height)].map(|(length, block)| {
                let taps =
                    |place: usize| (place * block..(place + 1) * block).map(|at| (at, 1.0 / block as f32));
                (0..length).map(|place| taps(place).collect()).collect()
            }),
        }
    }

    /// Resizes a frame of the size that was prepared for.
    pub fn resize(&self, src: Frame<'_>, mut dst: FrameMut<'_>) {
        if self.from == self.to {
            return dst.copy_from(src);
        }
        match &self.way {
            Way::Linear => resize_linear(src, dst),
            Way::Whole { columns, rows, rounding: Rounding::Bytes } => in_two_steps(src, dst, columns, rows),
            Way::Whole { columns, rows, rounding } => {
                whole(src, dst, columns, rows, *rounding == Rounding::Linear);
            }
            Way::Area { columns, rows } => area(src, dst, columns, rows),
            Way::Blocks { width, height } => average_blocks(src, dst, *width, *height),
        }
    }
}

/// The pixel in which the middle of each output pixel lies. The place is summed up step by step, as PIL does, which decides what happens
/// if it lies right between two pixels.
fn nearest_taps(from: usize, to: usize) -> Taps<i64> {
    let step = from as f64 / to as f64;
    let mut place = step * 0.5;
    (0..to)
        .map(|_| {
            let taps = vec![((place as usize).min(from - 1), 1 << CV_BITS)];
            place += step;
            taps
        })
        .collect()
}

/// Keys' cubic of a distance, in the order of operations that OpenCV and PIL have in common.
fn cubic(x: f64, a: f64) -> f64 {
    match x {
        x if x < 1.0 => ((a + 2.0) * x - (a + 3.0)) * x * x + 1.0,
        x if x < 2.0 => (((x - 5.0) * x + 8.0) * x - 4.0) * a,
        _ => 0.0,
    }
}

/// Weights as OpenCV rounds them, which need not sum to one.
fn fixed(weight: f32) -> i64 {
    (weight * (1 << CV_BITS) as f32).round_ties_even() as i64
}

fn cubic_taps(from: usize, to: usize) -> Taps<i64> {
    let scale = from as f64 / to as f64;
    let last = from as i64 - 1;
    let tap = |i: usize| {
        let centre = ((i as f64 + 0.5) * scale - 0.5) as f32;
        let first = centre.floor();
        let x = centre - first;
        // In 32-bit floats, as OpenCV computes them.
        const A: f32 = -0.75;
        let before = ((A * (x + 1.0) - 5.0 * A) * (x + 1.0) + 8.0 * A) * (x + 1.0) - 4.0 * A;
        let left = ((A + 2.0) * x - (A + 3.0)) * x * x + 1.0;
        let y = 1.0 - x;
        let right = ((A + 2.0) * y - (A + 3.0)) * y * y + 1.0;
        let weights = [before, left, right, 1.0 - before - left - right];
        let places = (-1..3).map(|offset| (first as i64 + offset).clamp(0, last) as usize);
        places.zip(weights.map(fixed)).collect()
    };
    (0..to).map(tap).collect()
}

/// The two pixels between which the middle of each output pixel lies. Beyond the outermost, `keeps` takes the outermost alone; else it is mixed
/// with itself.
fn linear_taps(from: usize, to: usize, keeps: bool) -> Taps<i64> {
    let scale = from as f64 / to as f64;
    let last = from as i64 - 1;
    let tap = |i: usize| {
        let centre = (i as f64 + 0.5) * scale - 0.5;
        let centre = if keeps { centre.clamp(0.0, last as f64) } else { centre };
        let first = centre.floor();
        let share = centre - first;
        let weight = |share: f64| (share * f64::from(1 << CV_BITS)).round_ties_even() as i64;
        let place = |offset: i64| (first as i64 + offset).clamp(0, last) as usize;
        vec![(place(0), weight(1.0 - share)), (place(1), weight(share))]
    };
    (0..to).map(tap).collect()
}

/// How OpenCV's INTER_AREA enlarges: linear, from the edges of pixels.
fn grown_area_taps(from: usize, to: usize) -> Taps<i64> {
    let (scale, inverse) = (from as f64 / to as f64, to as f64 / from as f64);
    let tap = |i: usize| {
        let first = (i as f64 * scale).floor();
        let share = ((i + 1) as f64 - (first + 1.0) * inverse) as f32;
        let share = if share <= 0.0 { 0.0 } else { share - share.floor() };
        let first = (first as usize).min(from - 1);
        vec![(first, fixed(1.0 - share)), ((first + 1).min(from - 1), fixed(share))]
    };
    (0..to).map(tap).collect()
}

/// The shares of the pixels that an output pixel covers.
fn area_taps(from: usize, to: usize) -> Taps<f32> {
    // What is thinner is left out.
    const LEAST: f64 = 1e-3;
    let scale = from as f64 / to as f64;
    let tap = |i: usize| {
        let start = i as f64 * scale;
        let end = start + scale;
        let covered = scale.min(from as f64 - start);
        let last = (end.floor() as usize).min(from - 1);
        let first = (start.ceil() as usize).min(last);
        let mut taps = Vec::new();
        if first as f64 - start > LEAST {
            taps.push((first - 1, ((first as f64 - start) / covered) as f32));
        }
        taps.extend((first..last).map(|place| (place, (1.0 / covered) as f32)));
        if end - last as f64 > LEAST {
            taps.push((last, ((end - last as f64).min(1.0).min(covered) / covered) as f32));
        }
        taps
    };
    (0..to).map(tap).collect()
}

/// PIL's weights: the filter, widened by the factor by which the axis shrinks.
fn pil_taps(from: usize, to: usize, filter: fn(f64) -> f64, support: f64) -> Taps<i64> {
    let scale = from as f64 / to as f64;
    let widened = scale.max(1.0);
    let support = support * widened;
    let tap = |i: usize| {
        let centre = (i as f64 + 0.5) * scale;
        let first = (centre - support + 0.5).max(0.0) as usize;
        let end = ((centre + support + 0.5) as usize).min(from);
        let weights: Vec<f64> =
            (first..end).map(|place| filter((place as f64 - centre + 0.5) * (1.0 / widened))).collect();
        let sum: f64 = weights.iter().sum();
        let one = f64::from(1 << PIL_BITS);
        let fixed = weights.iter().map(|weight| {
            let scaled = weight / sum * one;
            (if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 }) as i64
        });
        (first..end).zip(fixed).collect()
    };
    (0..to).map(tap).collect()
}

/// Shifts the fraction away, rounding halves up, and keeps to what a byte holds.
fn byte(sum: i64, bits: u32) -> u8 {
    ((sum + (1 << (bits - 1))) >> bits).clamp(0, 255) as u8
}

/// Sums across, then down. Both are exact, or as in linear interpolation, where seven bits of a sum are kept and the last bits of products
/// are not.
fn whole(src: Frame<'_>, mut dst: FrameMut<'_>, columns: &Taps<i64>, rows: &Taps<i64>, linear: bool) {
    let width = columns.len() * 3;
    let mut across = vec![0i64; width * src.height()];
    for (y, sums) in across.chunks_exact_mut(width).enumerate() {
        let row = src.row(y);
        for (taps, sums) in columns.iter().zip(sums.chunks_exact_mut(3)) {
            for &(place, weight) in taps {
                let pixel = &row[place * 3..][..3];
                sums.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += i64::from(*value) * weight);
            }
            if linear {
                sums.iter_mut().for_each(|sum| *sum >>= 4);
            }
        }
    }
    for (y, taps) in rows.iter().enumerate() {
        for (x, value) in dst.row_mut(y).iter_mut().enumerate() {
            let products = taps.iter().map(|(place, weight)| across[place * width + x] * weight);
            *value = match linear {
                true => byte(products.map(|product| product >> 16).sum(), 2),
                false => byte(products.sum(), 2 * CV_BITS),
            };
        }
    }
}

/// Resizes to bytes along one axis and then along the other, as PIL does: across first, unless the width grows and the height shrinks.
fn in_two_steps(src: Frame<'_>, mut dst: FrameMut<'_>, columns: &Taps<i64>, rows: &Taps<i64>) {
    let down_first = columns.len() > src.width() && rows.len() < src.height();
    let resized = match down_first {
        true => across(down(src, rows).as_ref(), columns),
        false => down(across(src, columns).as_ref(), rows),
    };
    dst.copy_from(resized.as_ref());
}

/// Resizes across to bytes. A width that stays as it is is not touched.
fn across(src: Frame<'_>, columns: &Taps<i64>) -> FrameBuf {
    let mut dst = FrameBuf::new(columns.len(), src.height());
    if columns.len() == src.width() {
        dst.as_mut().copy_from(src);
        return dst;
    }
    for (from, to) in src.rows().zip(dst.as_mut().rows_mut()) {
        for (taps, pixel) in columns.iter().zip(to.chunks_exact_mut(3)) {
            for (channel, value) in pixel.iter_mut().enumerate() {
                let products =
                    taps.iter().map(|(place, weight)| i64::from(from[place * 3 + channel]) * weight);
                *value = byte(products.sum(), PIL_BITS);
            }
        }
    }
    dst
}

/// Resizes down to bytes. A height that stays as it is is not touched.
fn down(src: Frame<'_>, rows: &Taps<i64>) -> FrameBuf {
    let mut dst = FrameBuf::new(src.width(), rows.len());
    if rows.len() == src.height() {
        dst.as_mut().copy_from(src);
        return dst;
    }
    for (taps, to) in rows.iter().zip(dst.as_mut().rows_mut()) {
        for (x, value) in to.iter_mut().enumerate() {
            let products = taps.iter().map(|(place, weight)| i64::from(src.row(*place)[x]) * weight);
            *value = byte(products.sum(), PIL_BITS);
        }
    }
    dst
}

/// Averages by shares of pixels.
fn area(src: Frame<'_>, mut dst: FrameMut<'_>, columns: &Taps<f32>, rows: &Taps<f32>) {
    let width = columns.len() * 3;
    let (mut across, mut sums) = (vec![0f32; width], vec![0f32; width]);
    for (y, taps) in rows.iter().enumerate() {
        sums.fill(0.0);
        for &(place, share) in taps {
            let row = src.row(place);
            across.fill(0.0);
            for (taps, sums) in columns.iter().zip(across.chunks_exact_mut(3)) {
                for &(place, share) in taps {
                    let pixel = &row[place * 3..][..3];
                    sums.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += f32::from(*value) * share);
                }
            }
            sums.iter_mut().zip(&across).for_each(|(sum, value)| *sum += share * value);
        }
        for (value, sum) in dst.row_mut(y).iter_mut().zip(&sums) {
            *value = sum.round_ties_even() as u8;
        }
    }
}

/// Averages blocks of pixels.
fn average_blocks(src: Frame<'_>, mut dst: FrameMut<'_>, width: usize, height: usize) {
    let share = 1.0 / (width * height) as f32;
    for y in 0..dst.height() {
        for (x, value) in dst.row_mut(y).iter_mut().enumerate() {
            let (column, channel) = (x / 3, x % 3);
            let places = (0..height)
                .flat_map(|down| (0..width).map(move |right| (y * height + down, column * width + right)));
            let sum: u32 = places.map(|(row, column)| u32::from(src.row(row)[column * 3 + channel])).sum();
            // OpenCV rounds halves of 2x2 pixels up, and of others to even.
            *value = match (width, height) {
                (2, 2) => ((sum + 2) >> 2) as u8,
                _ => (sum as f32 * share).round_ties_even() as u8,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture with edges and slopes.
    fn picture(width: usize, height: usize) -> FrameBuf {
        let bytes =
            (0..width * height * 3).map(|i| ((i * 7919) % 251) as u8 / 2 + (i / (3 * width) * 5 % 128) as u8);
        FrameBuf::from_vec(bytes.collect(), width, height).unwrap()
    }

    fn resized(filter: Filter, src: &FrameBuf, width: usize, height: usize) -> FrameBuf {
        let mut dst = FrameBuf::new(width, height);
        Resizer::new(filter, [src.width(), src.height()], [width, height]).resize(src.as_ref(), dst.as_mut());
        dst
    }

    #[test]
    fn every_filter_keeps_a_constant_picture_and_one_of_the_same_size() {
        for name in NAMES {
            let filter = Filter::of(name).unwrap();
            assert_eq!(filter.name(), name);
            let flat = FrameBuf::from_vec(vec![173; 31 * 17 * 3], 31, 17).unwrap();
            for (width, height) in [(1, 1), (9, 5), (31, 40), (70, 17), (62, 34)] {
                let dst = resized(filter, &flat, width, height);
                assert!(dst.data().iter().all(|value| *value == 173), "{name} {width}x{height}");
            }
            let src = picture(31, 17);
            assert_eq!(resized(filter, &src, 31, 17), src, "{name}");
        }
    }

    #[test]
    fn bilinear_is_linear_except_in_the_outermost_rows_of_a_picture_that_grows() {
        for (width, height, outer) in [(40, 30, 1), (9, 44, 2), (31, 17, 0), (12, 9, 0)] {
            let src = picture(31, 17);
            let [bilinear, linear] =
                [Filter::Bilinear, Filter::Linear].map(|f| resized(f, &src, width, height));
            for y in outer..height - outer {
                assert_eq!(bilinear.as_ref().row(y), linear.as_ref().row(y), "{width}x{height} row {y}");
            }
            for (a, b) in bilinear.data().iter().zip(linear.data()) {
                assert!(a.abs_diff(*b) <= 1);
            }
        }
    }

    #[test]
    fn filters_that_average_keep_the_mean_and_the_others_take_pixels() {
        let src = picture(64, 48);
        let mean = |frame: &FrameBuf| {
            frame.data().iter().map(|v| f64::from(*v)).sum::<f64>() / frame.data().len() as f64
        };
        for filter in [Filter::Area, Filter::PilBilinear, Filter::PilBicubic] {
            let small = resized(filter, &src, 20, 15);
            assert!((mean(&small) - mean(&src)).abs() < 1.5, "{filter:?}: {} {}", mean(&small), mean(&src));
        }
        let third = resized(Filter::Nearest, &picture(9, 9), 3, 3);
        assert_eq!(third.as_ref().pixel(1, 2), picture(9, 9).as_ref().pixel(4, 7));
    }
}
