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

/// A part of a frame: columns and rows.
pub type Part = [std::ops::Range<usize>; 2];

impl Decal {
    /// Finds where a picture lies in a part of a frame. `place` says for places of the frame, in pixels from its upper left corner, which place of the
    /// picture is seen there, from 0 to 1 across and down; anything else is beside it.
    pub fn new(
        [columns, rows]: Part,
        [width, height]: [usize; 2],
        place: impl Fn([f64; 2]) -> Option<[f64; 2]>,
    ) -> Self {
        let mut decal = Self::default();
        let mut taps: Vec<(u32, f32)> = Vec::new();
        for (y, x) in rows.flat_map(|y| columns.clone().map(move |x| (y, x))) {
            taps.clear();
            let mut left = 1.0;
            for sample in 0..SAMPLES * SAMPLES {
                let inside = |at: usize, pixel: usize| pixel as f64 + (at as f64 + 0.5) / SAMPLES as f64;
                let seen = place([inside(sample % SAMPLES, x), inside(sample / SAMPLES, y)]);
                let Some([u, v]) = seen.filter(|uv| uv.iter().all(|at| (0.0..1.0).contains(at))) else {
                    continue;
                };
                let share = 1.0 / (SAMPLES * SAMPLES) as f32;
                left -= share;
                for (row, down) in pair(v, height) {
                    for (column, across) in pair(u, width) {
                        add(&mut taps, (row * width + column) as u32, share * down * across);
                    }
                }
            }
            if !taps.is_empty() {
                decal.weights.extend(&taps);
                let end = decal.weights.len() as u32;
                decal.spots.push(Spot { x: x as u32, y: y as u32, left, end });
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

    /// Adds to the gradient with respect to the picture what follows from one with respect to a frame of this width.
    pub fn back(&self, of_frame: &[f32], width: usize, of_picture: &mut [f32]) {
        for (spot, weights) in self.spots() {
            let from = &of_frame[(spot.y as usize * width + spot.x as usize) * CHANNELS..][..CHANNELS];
            for &(pixel, weight) in weights {
                let into = &mut of_picture[pixel as usize * CHANNELS..][..CHANNELS];
                into.iter_mut().zip(from).for_each(|(sum, value)| *sum += value * weight);
            }
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

    #[test]
    fn a_picture_in_its_own_size_is_shown_as_it_is_and_the_rest_stays() {
        let (picture, before) = (frame(5, 4), frame(12, 9));
        let place = |[x, y]: [f64; 2]| Some([(x - 3.0) / 5.0, (y - 2.0) / 4.0]);
        let decal = Decal::new([0..12, 0..9], [5, 4], place);
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
        let skewed = |[x, y]: [f64; 2]| Some([(x - 2.0) / (3.0 + 0.4 * y), (y - 1.0) / 7.0]);
        let decal = Decal::new([0..12, 0..9], [5, 4], skewed);
        decal.lay(&[90.0; 60], after.as_mut());
        assert_eq!(after.as_ref().pixel(3, 5), [90; 3]);
    }

    #[test]
    fn a_gradient_goes_back_by_the_same_weights() {
        let skewed = |[x, y]: [f64; 2]| Some([(x - 2.0) / (3.0 + 0.9 * y), (y - 0.7) / 6.0]);
        let decal = Decal::new([1..11, 0..9], [3, 2], skewed);
        let of_frame: Vec<f32> = (0..12 * 9 * 3).map(|at| (at * 7 % 13) as f32 - 6.0).collect();
        let mut of_picture = vec![0.0; 18];
        decal.back(&of_frame, 12, &mut of_picture);
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
    }
}
