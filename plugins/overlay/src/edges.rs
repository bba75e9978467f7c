//! Colours at the edges of things before a screen.
//!
//! A pixel by itself does not say what it is a mixture of: half of the screen's green and half of blue look like a teal thing. And
//! video keeps colours at half the size of brightness, so that the screen's hue reaches some pixels into what lies before it. So
//! a pixel near the screen is taken for a mixture of the screen and of the thing beside it, as that looks further inside, if it
//! lies near the line between the two colours. Its alpha is its place on that line, and its colour is the thing's.
//!
//! What is too thin to have an inside has the colour of its most opaque pixel that differs most from the screen. Rain, hair and whatever else has
//! no opaque pixel stays as the keyer leaves it.

use pdk_sdk::ops::edges::spread;

use crate::picture::{Samples, rgb};

/// How far the edges of a picture reach.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Width {
    /// Each pixel has a colour of its own: edges are softened at most.
    Sharp,
    /// Colours are those of video, or were made smooth, at half the size of brightness.
    Blurred,
}

impl Width {
    /// Pixels at most this far from the screen may have some of it.
    fn of_edge(self) -> usize {
        match self {
            Self::Sharp => 2,
            Self::Blurred => 4,
        }
    }

    /// The inside of a thing is looked for at most this far from such a pixel.
    fn reach(self) -> usize {
        self.of_edge() + 2
    }
}

/// How far from the line between two colours a mixture of them may lie, as a share of its length.
const TOLERANCE: f32 = 0.45;

/// Gives edges the colours of what they belong to. The memory is kept from frame to frame.
#[derive(Debug, Default)]
pub struct Edges {
    /// What is near the screen.
    near: Vec<bool>,
    /// The insides of things, and what is near them.
    inside: Vec<bool>,
    reached: Vec<bool>,
    /// What is opaque, and what is near that.
    opaque: Vec<bool>,
    beside: Vec<bool>,
    since: Vec<usize>,
    offsets: Vec<(isize, isize)>,
}

impl Edges {
    /// Changes the edges in a keyed picture, premultiplied red, green, blue and alpha. `screen` is the screen's colour, and `alpha` scales a
    /// place on the line between screen and thing.
    pub fn clean(
        &mut self,
        samples: &Samples,
        screen: [f32; 3],
        width: Width,
        alpha: impl Fn(f32) -> f32,
        rgba: &mut [u8],
    ) {
        let alphas = || rgba.chunks_exact(4).map(|pixel| pixel[3]);
        self.near.clear();
        self.near.extend(alphas().map(|alpha| alpha == 0));
        spread(&mut self.near, samples.width, width.of_edge(), true, &mut self.since);
        self.inside.clear();
        self.inside.extend(alphas().zip(&self.near).map(|(alpha, near)| alpha == 255 && !near));
        self.reached.clone_from(&self.inside);
        spread(&mut self.reached, samples.width, width.reach(), true, &mut self.since);
        self.opaque.clear();
        self.opaque.extend(alphas().map(|alpha| alpha == 255));
        self.beside.clone_from(&self.opaque);
        spread(&mut self.beside, samples.width, width.of_edge(), true, &mut self.since);
        self.look_within(width.reach() as isize);
        for at in 0..self.near.len() {
            let thing = match (self.near[at], self.reached[at], self.beside[at]) {
                (false, ..) | (_, false, false) => None,
                (_, false, _) => self.purest(samples, at, screen, width.of_edge() as isize),
                _ => self.nearest(samples, at),
            };
            let Some(thing) = thing else { continue };
            let pixel = colour(samples, at);
            let line: [f32; 3] = std::array::from_fn(|i| thing[i] - screen[i]);
            let from: [f32; 3] = std::array::from_fn(|i| pixel[i] - screen[i]);
            let length = dot(line, line);
            // A thing of the screen's colour does not lie beside it.
            if length <= 0.0 {
                continue;
            }
            let place = dot(from, line) / length;
            let rest: [f32; 3] = std::array::from_fn(|i| from[i] - place * line[i]);
            if dot(rest, rest) > TOLERANCE * TOLERANCE * length {
                continue;
            }
            let alpha = alpha(place.clamp(0.0, 1.0)) * 255.0;
            let out = &mut rgba[4 * at..][..4];
            for (out, value) in out.iter_mut().zip(rgb(thing)) {
                *out = ((value / 255.0).clamp(0.0, 1.0) * alpha + 0.5) as u8;
            }
            out[3] = (alpha + 0.5) as u8;
        }
    }

    /// Sets the places around a pixel, the nearest first.
    fn look_within(&mut self, reach: isize) {
        if self.offsets.len() == (2 * reach as usize + 1).pow(2) {
            return;
        }
        self.offsets = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| (x, y))).collect();
        self.offsets.sort_by_key(|(x, y)| (x * x + y * y, *y, *x));
    }

    /// The colour of the nearest thing: the mean of its insides around the nearest place.
    fn nearest(&self, samples: &Samples, at: usize) -> Option<[f32; 3]> {
        let (width, height) = (samples.width as isize, samples.height as isize);
        let (x, y) = (at as isize % width, at as isize / width);
        let inside = |x: isize, y: isize| {
            let is_there = (0..width).contains(&x) && (0..height).contains(&y);
            Some((y * width + x) as usize).filter(|&at| is_there && self.inside[at])
        };
        let (x, y) =
            self.offsets.iter().map(|(dx, dy)| (x + dx, y + dy)).find(|&(x, y)| inside(x, y).is_some())?;
        let (mut sums, mut count) = ([0.0; 3], 0.0);
        for (x, y) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy))) {
            if let Some(at) = inside(x, y) {
                sums.iter_mut().zip(colour(samples, at)).for_each(|(sum, value)| *sum += value);
                count += 1.0;
            }
        }
        Some(sums.map(|sum| sum / count))
    }

    /// The colour of the opaque pixel at most `distance` rows and columns away that differs most from the screen.
    fn purest(&self, samples: &Samples, at: usize, screen: [f32; 3], distance: isize) -> Option<[f32; 3]> {
        let (width, height) = (samples.width as isize, samples.height as isize);
        let (x, y) = (at as isize % width, at as isize / width);
        let mut best = (0.0, None);
        for y in (y - distance).max(0)..(y + distance + 1).min(height) {
            for x in (x - distance).max(0)..(x + distance + 1).min(width) {
                let at = (y * width + x) as usize;
                let own = colour(samples, at);
                let from: [f32; 3] = std::array::from_fn(|i| own[i] - screen[i]);
                let far = dot(from, from);
                if self.opaque[at] && far > best.0 {
                    best = (far, Some(own));
                }
            }
        }
        best.1
    }
}

/// Luma and chroma of a pixel, without offsets.
fn colour(samples: &Samples, at: usize) -> [f32; 3] {
    [
        f32::from(samples.luma[at]) - 16.0,
        f32::from(samples.blue[at]) - 128.0,
        f32::from(samples.red[at]) - 128.0,
    ]
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
