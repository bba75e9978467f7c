//! A picture laid over a part of a frame, in whatever perspective, as the weights of its pixels: the same weights lay it and take a gradient back
//! to it.

use crate::frame::{CHANNELS, Frame, FrameMut};

/// Each pixel is looked at in this many places across and down.
const SAMPLES: usize = 4;

/// Where each pixel of a picture lies in a frame.
#[derive(Debug, Clone, Default)]
pub struct Decal {
    spots: Vec<Spot>,
    /// Pixels of the picture with their weights, of one spot after the other.
    weights: Vec<(u32, f32)>,
}

/// A pixel of the frame in which the picture is seen.
#[derive(Debug, Clone, Copy)]
struct Spot {
    x: u32,
    y: u32,
    /// The share of the frame that is still seen there.
    left: f32,
    /// The end of its weights.
    end: u32,
}

/// Which place of a picture is seen at a place of a frame, in perspective: three linear functions of the place (x, y) in pixels from the frame's upper left
/// corner, given by what they are multiplied by and what is added. The first divided by the third says how far across the picture it is, the second divided
/// by the third how far down, from 0 to 1; nothing is seen where the third is not above 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection(pub [[f64; 3]; 3]);

impl Projection {
    /// Over a box of the frame, given by its upper left corner and its sides in pixels.
    pub fn over([left, top]: [f64; 2], [width, height]: [f64; 2]) -> Self {
        Self([[1.0 / width, 0.0, -left / width], [0.0, 1.0 / height, -top / height], [0.0, 0.0, 1.0]])
    }

    /// The place of the picture that is seen at a place.
    fn seen(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let [across, down, depth] = self.0.map(|[by_x, by_y, add]| by_x * x + by_y * y + add);
        let inside = depth > 0.0 && across >= 0.0 && across < depth && down >= 0.0 && down < depth;
        inside.then(|| [across / depth, down / depth])
    }

    /// The columns of a frame of this width in which the picture may be seen at a height, from the first to one after the last.
    fn columns(&self, y: f64, width: usize) -> [usize; 2] {
        let [across, down, depth] = self.0.map(|[by_x, by_y, add]| [by_x, by_y * y + add]);
        let less = |a: [f64; 2], b: [f64; 2]| [a[0] - b[0], a[1] - b[1]];
        let (mut low, mut high) = (0.0, width as f64);
        // Each of these is not below 0 inside the picture.
        for [by_x, add] in [across, less(depth, across), down, less(depth, down), depth] {
            if by_x > 0.0 {
                low = f64::max(low, -add / by_x);
            } else if by_x < 0.0 {
                high = f64::min(high, -add / by_x);
            } else if add < 0.0 {
                return [0, 0];
            }
        }
        // One more on both sides, because of rounding: each place is looked at anyway.
        match low <= high {
            true => [(low as usize).saturating_sub(1), (high.ceil() as usize + 1).min(width)],
            false => [0, 0],
        }
    }
}

impl Decal {
    /// Finds where a picture of this width and height is seen in frames of a width and height.
    pub fn new(frame: [usize; 2], [width, height]: [usize; 2], projection: &Projection) -> Self {
        let mut decal = Self::default();
        let mut taps: Vec<(u32, f32)> = Vec::new();
        let inside = |at: usize, pixel: usize| pixel as f64 + (at as f64 + 0.5) / SAMPLES as f64;
        for y in 0..frame[1] {
            let columns = (0..SAMPLES).map(|at| projection.columns(inside(at, y), frame[0]));
            let columns = columns.filter(|[start, end]| start < end);
            let Some([start, end]) = columns.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]) else {
                continue;
            };
            for x in start..end {
                taps.clear();
                let mut left = 1.0;
                // Samples beside each other are mostly between the same four pixels of the picture.
                let mut cell = ([0; 4], [0.0; 4]);
                for sample in 0..SAMPLES * SAMPLES {
                    let place = [inside(sample % SAMPLES, x), inside(sample / SAMPLES, y)];
                    let Some([u, v]) = projection.seen(place) else { continue };
                    let share = 1.0 / (SAMPLES * SAMPLES) as f32;
                    left -= share;
                    let ([top, bottom], [first, second]) = (pair(v, height), pair(u, width));
                    let corners = [(top, first), (top, second), (bottom, first), (bottom, second)];
                    let pixels = corners.map(|((row, _), (column, _))| (row * width + column) as u32);
                    if cell.0 != pixels {
                        flush(&mut taps, cell);
                        cell = (pixels, [0.0; 4]);
                    }
                    for (sum, ((_, down), (_, across))) in cell.1.iter_mut().zip(corners) {
                        *sum += share * down * across;
                    }
                }
                flush(&mut taps, cell);
                if !taps.is_empty() {
                    decal.weights.extend(&taps);
                    let end = decal.weights.len() as u32;
                    decal.spots.push(Spot { x: x as u32, y: y as u32, left, end });
                }
            }
        }
        decal
    }

    /// How many pixels of the frame it touches.
    pub fn pixels(&self) -> usize {
        self.spots.len()
    }

    /// Lays the picture, whose values are given row by row with three a pixel, over a frame.
    pub fn lay(&self, picture: &[f32], frame: FrameMut<'_>) {
        self.lay_where(picture, frame, |_, _| true);
    }

    /// The same at those pixels, given by column and row, at which it is not hidden.
    pub fn lay_where(
        &self,
        picture: &[f32],
        mut frame: FrameMut<'_>,
        is_seen: impl Fn(usize, usize) -> bool,
    ) {
        for (spot, weights) in self.spots() {
            let (x, y) = (spot.x as usize, spot.y as usize);
            if !is_seen(x, y) {
                continue;
            }
            let mut sums = frame.as_ref().pixel(x, y).map(|value| f32::from(value) * spot.left);
            for &(pixel, weight) in weights {
                let values = &picture[pixel as usize * CHANNELS..][..CHANNELS];
                sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value * weight);
            }
            frame.set_pixel(x, y, sums.map(|sum| (sum + 0.5) as u8));
        }
    }

    /// Adds to the gradient with respect to the picture what follows from one with respect to a frame of this width, and makes the latter that with
    /// respect to the frame before the picture was laid.
    pub fn back(&self, of_frame: &mut [f32], width: usize, of_picture: &mut [f32]) {
        self.back_where(of_frame, width, of_picture, |_, _| true);
    }

    /// The same from those pixels, given by column and row, at which it is not hidden.
    pub fn back_where(
        &self,
        of_frame: &mut [f32],
        width: usize,
        of_picture: &mut [f32],
        is_seen: impl Fn(usize, usize) -> bool,
    ) {
        for (spot, weights) in self.spots() {
            let (x, y) = (spot.x as usize, spot.y as usize);
            if !is_seen(x, y) {
                continue;
            }
            let from = &mut of_frame[(y * width + x) * CHANNELS..][..CHANNELS];
            for &(pixel, weight) in weights {
                let into = &mut of_picture[pixel as usize * CHANNELS..][..CHANNELS];
                into.iter_mut().zip(&*from).for_each(|(sum, value)| *sum += value * weight);
            }
            from.iter_mut().for_each(|value| *value *= spot.left);
        }
    }

    /// The spots with their weights.
    fn spots(&self) -> impl Iterator<Item = (&Spot, &[(u32, f32)])> {
        let starts = std::iter::once(0).chain(self.spots.iter().map(|spot| spot.end));
        self.spots
            .iter()
            .zip(starts)
            .map(|(spot, start)| (spot, &self.weights[start as usize..spot.end as usize]))
    }
}

/// The values of a frame, for [`Decal::lay`].
pub fn values(picture: Frame<'_>) -> Vec<f32> {
    picture.rows().flatten().map(|value| f32::from(*value)).collect()
}

/// The same picture in its mean colour.
pub fn mean(picture: &[f32]) -> Vec<f32> {
    let mut sums = [0.0f64; CHANNELS];
    picture.iter().enumerate().for_each(|(at, value)| sums[at % CHANNELS] += f64::from(*value));
    let count = (picture.len() / CHANNELS) as f64;
    (0..picture.len()).map(|at| (sums[at % CHANNELS] / count) as f32).collect()
}

/// The two neighbours of a place along an axis of this length, with their weights; at the ends both are the outermost.
fn pair(place: f64, length: usize) -> [(usize, f32); 2] {
    let at = (place * length as f64 - 0.5).clamp(0.0, (length - 1) as f64);
    let first = at as usize;
    let share = (at - first as f64) as f32;
    [(first, 1.0 - share), ((first + 1).min(length - 1), share)]
}

/// Adds the weights of four pixels to those that are known.
fn flush(taps: &mut Vec<(u32, f32)>, (pixels, weights): ([u32; 4], [f32; 4])) {
    pixels.into_iter().zip(weights).for_each(|(pixel, weight)| add(taps, pixel, weight));
}

/// Adds a weight to that of a pixel.
fn add(taps: &mut Vec<(u32, f32)>, pixel: u32, weight: f32) {
    match taps.iter_mut().find(|(known, _)| *known == pixel) {
        Some((_, sum)) => *sum += weight,
        None if weight > 0.0 => taps.push((pixel, weight)),
        None => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FrameBuf;

    fn frame(width: usize, height: usize) -> FrameBuf {
        let bytes = (0..width * height * 3).map(|at| (at * 31 % 251) as u8).collect();
        FrameBuf::from_vec(bytes, width, height).unwrap()
    }

    /// Wider below than above.
    const SKEWED: Projection = Projection([[1.0, 0.0, -2.0], [0.0, 1.0, -1.0], [0.0, 0.4, 3.0]]);

    /// The pixels of a frame in which any sample shows the picture, by looking at all of them.
    fn touched(frame: [usize; 2], projection: &Projection) -> usize {
        let is_touched = |at: &usize| {
            let sample = |sample: usize| {
                let inside = |at: usize| (at as f64 + 0.5) / SAMPLES as f64;
                let x = (at % frame[0]) as f64 + inside(sample % SAMPLES);
                projection.seen([x, (at / frame[0]) as f64 + inside(sample / SAMPLES)]).is_some()
            };
            (0..SAMPLES * SAMPLES).any(sample)
        };
        (0..frame[0] * frame[1]).filter(is_touched).count()
    }

    proptest::proptest! {
        #[test]
        fn no_pixel_is_left_out(rows in proptest::array::uniform9(-2.0f64..2.0)) {
            let [a, b, c, d, e, f, g, h, i] = rows;
            // Anything from a picture that covers the frame to one of which a part is behind the camera.
            let projection = Projection([[a, b, c * 20.0], [d, e, f * 20.0], [g, h, i * 20.0]]);
            let decal = Decal::new([31, 17], [5, 4], &projection);
            proptest::prop_assert_eq!(decal.pixels(), touched([31, 17], &projection));
        }
    }

    #[test]
    fn a_picture_in_its_own_size_is_shown_as_it_is_and_the_rest_stays() {
        let (picture, before) = (frame(5, 4), frame(12, 9));
        let decal = Decal::new([12, 9], [5, 4], &Projection::over([3.0, 2.0], [5.0, 4.0]));
        assert_eq!(decal.pixels(), 20);
        let mut after = before.clone();
        decal.lay(&values(picture.as_ref()), after.as_mut());
        for (x, y) in (0..12 * 9).map(|at| (at % 12, at / 12)) {
            let found = after.as_ref().pixel(x, y);
            match (3..8).contains(&x) && (2..6).contains(&y) {
                // Samples within a pixel are mixed with their neighbours; the picture is a slope there, but for its jumps.
                true => assert!(found != before.as_ref().pixel(x, y), "{x} {y}"),
                false => assert_eq!(found, before.as_ref().pixel(x, y), "{x} {y}"),
            }
        }
        // One colour stays what it is, whatever its perspective.
        let decal = Decal::new([12, 9], [5, 4], &SKEWED);
        decal.lay(&[90.0; 60], after.as_mut());
        assert_eq!(after.as_ref().pixel(3, 5), [90; 3]);
    }

    #[test]
    fn a_gradient_goes_back_by_the_same_weights() {
        let decal = Decal::new([12, 9], [3, 2], &SKEWED);
        let of_frame: Vec<f32> = (0..12 * 9 * 3).map(|at| (at * 7 % 13) as f32 - 6.0).collect();
        let (mut of_picture, mut of_before) = (vec![0.0; 18], of_frame.clone());
        decal.back(&mut of_before, 12, &mut of_picture);
        let sum = |picture: &[f32]| -> f32 {
            let mut laid = FrameBuf::new(12, 9);
            decal.lay(picture, laid.as_mut());
            laid.data().iter().zip(&of_frame).map(|(value, slope)| f32::from(*value) * slope).sum()
        };
        for at in 0..18 {
            let mut picture = vec![20.0; 18];
            picture[at] = 220.0;
            let difference = (sum(&picture) - sum(&[20.0; 18])) / 200.0;
            assert!((difference - of_picture[at]).abs() < 0.5, "{at}: {difference} {}", of_picture[at]);
        }
        // What is seen of the frame itself.
        let laid = |value: u8| {
            let mut frame = FrameBuf::from_vec(vec![value; 12 * 9 * 3], 12, 9).unwrap();
            decal.lay(&[0.0; 18], frame.as_mut());
            frame
        };
        for ((seen, of_frame), of_before) in laid(200).data().iter().zip(&of_frame).zip(&of_before) {
            assert!(
                (of_frame * f32::from(*seen) / 200.0 - of_before).abs() < 0.02,
                "{of_frame} {seen} {of_before}"
            );
        }
        // What is hidden gives nothing, and keeps what it had.
        let (mut of_hidden, mut kept) = (vec![0.0; 18], of_frame.clone());
        decal.back_where(&mut kept, 12, &mut of_hidden, |_, _| false);
        assert!(of_hidden == [0.0; 18] && kept == of_frame);
    }
}
