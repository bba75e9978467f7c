//! Finds the colour of the screen behind a clip and takes it out.
//!
//! The model is a mixture: a pixel is `a * foreground + (1 - a) * screen`, with the foreground free of the screen's hue.
//! Then the share of the screen is what the pixel's chroma has along the screen's, and the foreground is what is left when
//! that share of the screen is subtracted, so that what lies half over the screen carries none of it. This is the keyer
//! of Keith Jack, Video Demystified (chroma keying), with the thresholds measured on the clip.

use pdk_sdk::prelude::*;

use crate::edges::{Edges, Width};
use crate::picture::{Layout, Picture, Samples, luma_and_chroma, rgb};

/// Chroma at least this far from grey counts as saturated, of at most about 119.
const SATURATED: f32 = 40.0;
/// The share of the border that the screen has to fill.
const LEAST_SHARE: f64 = 0.35;
/// Luma of a lit screen does not spread wider than this, as a standard deviation.
const LARGEST_SPREAD: f64 = 30.0;
/// Tangent of the angle from the screen's hue at which a colour has nothing of the screen.
const HUE_TANGENT: f32 = 1.0;
/// Foreground from this share on is opaque.
const OPAQUE: f32 = 0.95;
/// A screen whose noise is at most this is even.
const QUIET: f32 = 0.08;
/// Neighbours are mixed if that leaves at most this share of the noise.
const CALMER: f32 = 0.6;
/// Pixels looked at in each direction when the screen is searched for.
const GRID: usize = 240;

/// What makes a clip's pixels transparent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Matte {
    /// The clip has an alpha channel.
    Alpha,
    /// A screen of one colour.
    Screen(Screen),
}

/// The colour of a screen and how much of it there has to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Screen {
    /// Luma, blue and red chroma, without offsets.
    colour: [f32; 3],
    /// Foreground up to this share is noise of the screen.
    noise: f32,
    /// Neighbours are mixed first: the colours of the clip are dithered or noisy.
    smooth: bool,
    /// The clip is one of pdk's own, which are drawn with soft edges.
    known: bool,
}

impl Matte {
    /// Looks for the screen in a few pictures of a clip. `key` is the screen's colour where the user gives it.
    ///
    /// # Errors
    /// If no colour dominates, or the given one does not occur.
    pub fn find(pictures: &[Picture], key: Option<[u8; 3]>) -> Result<Self> {
        if key.is_none() && pictures.iter().any(Picture::has_transparency) {
            return Ok(Self::Alpha);
        }
        let halved: Vec<Samples> = pictures
            .iter()
            .map(|picture| {
                let mut samples = Samples::default();
                samples.fill(picture, true);
                samples
            })
            .collect();
        let plain = Screen::find(&halved, key, false);
        let is_video = pictures.iter().any(|picture| picture.layout == Layout::Yuv420);
        if is_video || plain.as_ref().is_ok_and(|screen| screen.noise <= QUIET) {
            return plain.map(Self::Screen);
        }
        let mut smoothed = halved;
        smoothed.iter_mut().for_each(Samples::smooth);
        match (plain, Screen::find(&smoothed, key, true)) {
            (Ok(plain), Ok(smooth)) if smooth.noise > CALMER * plain.noise => Ok(Self::Screen(plain)),
            (_, Ok(smooth)) => Ok(Self::Screen(smooth)),
            (plain, Err(_)) => plain.map(Self::Screen),
        }
    }
}

impl Screen {
    /// Looks for the screen in a few pictures.
    fn find(pictures: &[Samples], key: Option<[u8; 3]>, smooth: bool) -> Result<Self> {
        let colour = match key {
            Some(key) => {
                let colour = luma_and_chroma(key.map(f32::from));
                if length(colour) < SATURATED / 2.0 {
                    return Err(Error::new(format!(
                        "the key colour {} is nearly grey and cannot be told from what lies before it; take a saturated one",
                        hex(key)
                    )));
                }
                colour
            }
            None => dominant(pictures)?,
        };
        let noise = noise_of(pictures, colour).ok_or_else(|| {
            Error::new(format!(
                "the key colour {} does not occur in the clip; `auto` finds the screen's colour",
                hex(key.unwrap_or_default())
            ))
        })?;
        Ok(Self { colour, noise, smooth, known: false })
    }

    /// A screen of a known colour that a video has kept well.
    pub fn known(rgb: [u8; 3]) -> Self {
        Self { colour: luma_and_chroma(rgb.map(f32::from)), noise: 0.05, smooth: false, known: true }
    }

    /// Takes the samples of a picture as the screen was found in them, and says how far edges reach there.
    pub fn samples(&self, picture: &Picture, halve: bool, samples: &mut Samples) -> Width {
        samples.fill(picture, halve);
        if self.smooth {
            samples.smooth();
        }
        if self.smooth || picture.layout == Layout::Yuv420 && !halve { Width::Blurred } else { Width::Sharp }
    }

    /// How opaque what has this share of the screen is.
    fn alpha(&self, share: f32) -> f32 {
        ((1.0 - share - self.noise) / (OPAQUE - self.noise)).clamp(0.0, 1.0)
    }

    /// The share of the screen in a pixel, from its chroma; noise leads beyond 0 and 1.
    fn share(&self, blue: f32, red: f32) -> f32 {
        let magnitude = length(self.colour);
        let direction = [self.colour[1] / magnitude, self.colour[2] / magnitude];
        let along = blue * direction[0] + red * direction[1];
        let across = (blue * direction[1] - red * direction[0]).abs();
        (along - across / HUE_TANGENT) / magnitude
    }

    /// The screen's colour in red, green and blue.
    #[cfg(test)]
    pub fn rgb(&self) -> [f32; 3] {
        rgb(self.colour)
    }
}

fn length([_, blue, red]: [f32; 3]) -> f32 {
    (blue * blue + red * red).sqrt()
}

fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Calls `visit` with the luma and chroma of pixels on a grid over all pictures, and whether they lie at the border.
fn for_each_sample(pictures: &[Samples], mut visit: impl FnMut([f32; 3], bool)) {
    for samples in pictures {
        let (width, height) = (samples.width, samples.height);
        let edge = (width.min(height) / 10).max(1);
        let step = |size: usize| size.div_ceil(GRID);
        for y in (0..height).step_by(step(height)) {
            for x in (0..width).step_by(step(width)) {
                let at = y * width + x;
                let border = x < edge || y < edge || x >= width - edge || y >= height - edge;
                let value = |plane: &[u8], offset: f32| f32::from(plane[at]) - offset;
                let colour =
                    [value(&samples.luma, 16.0), value(&samples.blue, 128.0), value(&samples.red, 128.0)];
                visit(colour, border);
            }
        }
    }
}

/// The saturated colour that fills most of the border.
fn dominant(pictures: &[Samples]) -> Result<[f32; 3]> {
    const BINS: usize = 32;
    let bin = |chroma: f32| ((chroma + 128.0) / 8.0) as usize;
    let mut counts = vec![0u64; BINS * BINS];
    let mut total = 0u64;
    for_each_sample(pictures, |colour, border| {
        total += u64::from(border);
        if border && length(colour) >= SATURATED {
            counts[bin(colour[1]) * BINS + bin(colour[2])] += 1;
        }
    });
    // The centre of the fullest block of three by three bins.
    let around = |centre: usize| {
        let (row, column) = (centre / BINS, centre % BINS);
        let rows = row.saturating_sub(1)..(row + 2).min(BINS);
        rows.flat_map(move |r| (column.saturating_sub(1)..(column + 2).min(BINS)).map(move |c| r * BINS + c))
    };
    let mut best = (0, 0);
    for centre in 0..BINS * BINS {
        let count: u64 = around(centre).map(|i| counts[i]).sum();
        if count > best.0 {
            best = (count, centre);
        }
    }
    let mut sums = [0.0f64; 3];
    let (mut squares, mut count) = (0.0f64, 0.0f64);
    for_each_sample(pictures, |colour, border| {
        let (row, column) = (bin(colour[1]), bin(colour[2]));
        let near = row.abs_diff(best.1 / BINS) <= 1 && column.abs_diff(best.1 % BINS) <= 1;
        if border && near && length(colour) >= SATURATED {
            sums.iter_mut().zip(colour).for_each(|(sum, value)| *sum += f64::from(value));
            squares += f64::from(colour[0]).powi(2);
            count += 1.0;
        }
    });
    let share = count / total.max(1) as f64;
    let spread = (squares / count.max(1.0) - (sums[0] / count.max(1.0)).powi(2)).max(0.0).sqrt();
    if share < LEAST_SHARE || spread > LARGEST_SPREAD {
        return Err(Error::new(format!(
            "it is not a green-screen clip: no even, saturated colour fills its border (the nearest to one fills {:.0} %); take a \
             clip before a screen of one colour, or name the colour in `key`",
            share * 100.0
        )));
    }
    Ok(sums.map(|sum| (sum / count) as f32))
}

/// How much foreground there seems to be where there is only the screen; none if the colour does not occur.
fn noise_of(pictures: &[Samples], colour: [f32; 3]) -> Option<f32> {
    const STEPS: usize = 1000;
    let screen = Screen { colour, noise: 0.0, smooth: false, known: false };
    let mut counts = [0u64; STEPS + 1];
    let mut total = 0u64;
    for_each_sample(pictures, |sample, _| {
        total += 1;
        let foreground = (1.0 - screen.share(sample[1], sample[2])).abs();
        let luma = (sample[0] - colour[0]).abs();
        if foreground < 0.3 && luma < 40.0 {
            counts[(foreground * STEPS as f32) as usize] += 1;
        }
    });
    let near: u64 = counts.iter().sum();
    if near * 200 < total {
        return None;
    }
    // The median tells the noise apart from foreground that is scattered over the screen, such as rain. Four times the
    // median of noise is 2.7 of its standard deviations.
    let mut seen = 0;
    let median = counts.iter().position(|count| {
        seen += count;
        seen * 2 >= near
    })?;
    Some((4.0 * median as f32 / STEPS as f32 + 0.02).clamp(0.03, 0.3))
}

/// What to do with each chroma: the share of the screen to subtract, and the factor that brings what is left to its
/// alpha. A factor of 0 is a transparent pixel.
#[derive(Debug, Clone)]
pub struct Keyer {
    screen: Screen,
    table: Vec<[f32; 2]>,
}

impl Keyer {
    /// A keyer for a screen.
    pub fn new(screen: Screen) -> Self {
        let entry = |i: usize| {
            let (blue, red) = ((i >> 8) as f32 - 128.0, (i & 255) as f32 - 128.0);
            let share = screen.share(blue, red).clamp(0.0, 1.0);
            let foreground = 1.0 - share;
            let alpha = screen.alpha(share);
            [share, if alpha > 0.0 { alpha / foreground } else { 0.0 }]
        };
        Self { screen, table: (0..1 << 16).map(entry).collect() }
    }

    /// Takes the screen out of the edges of a picture that was keyed.
    pub fn clean(&self, samples: &Samples, width: Width, edges: &mut Edges, rgba: &mut [u8]) {
        if !self.screen.known {
            edges.clean(samples, self.screen.colour, width, |place| self.screen.alpha(1.0 - place), rgba);
        }
    }

    /// Writes premultiplied red, green, blue and alpha of every pixel.
    pub fn key(&self, samples: &Samples, rgba: &mut Vec<u8>) {
        rgba.resize(samples.width * samples.height * 4, 0);
        let [screen_luma, screen_blue, screen_red] = self.screen.colour;
        let magnitude = length(self.screen.colour);
        let direction = [screen_blue / magnitude, screen_red / magnitude];
        let chroma = samples.blue.iter().zip(&samples.red);
        for ((out, &luma), (&blue, &red)) in rgba.chunks_exact_mut(4).zip(&samples.luma).zip(chroma) {
            let [share, factor] = self.table[usize::from(blue) << 8 | usize::from(red)];
            if factor == 0.0 {
                out.fill(0);
                continue;
            }
            let alpha = (1.0 - share) * factor;
            let luma = (f32::from(luma) - 16.0 - share * screen_luma) * factor;
            let mut blue = (f32::from(blue) - 128.0 - share * screen_blue) * factor;
            let mut red = (f32::from(red) - 128.0 - share * screen_red) * factor;
            // Light that the screen throws on the edges of things: the rest of its hue goes wherever the screen shows through,
            // from a twelfth on in full, and from pale colours, which show it most.
            let spill = blue * direction[0] + red * direction[1];
            if spill > 0.0 {
                let pale = 2.0 - (blue * blue + red * red).sqrt() / (0.2 * magnitude);
                let removed = spill * (share * 12.0).max(pale).clamp(0.0, 1.0);
                blue -= removed * direction[0];
                red -= removed * direction[1];
            }
            let alpha = (alpha * 255.0).min(255.0);
            let colour = rgb([luma, blue, red]);
            for (out, value) in out.iter_mut().zip(colour) {
                *out = (value.clamp(0.0, alpha) + 0.5) as u8;
            }
            out[3] = (alpha + 0.5) as u8;
        }
    }
}

/// Writes premultiplied red, green, blue and alpha of a picture that has an alpha channel.
pub fn premultiply(picture: &Picture, rgba: &mut Vec<u8>) {
    rgba.clear();
    rgba.extend(picture.data.chunks_exact(4).flat_map(|pixel| {
        let scaled = |value: u8| ((u32::from(value) * u32::from(pixel[3]) + 127) / 255) as u8;
        [scaled(pixel[0]), scaled(pixel[1]), scaled(pixel[2]), pixel[3]]
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    const GREEN: [f32; 3] = [5.0, 193.0, 66.0];

    /// A picture whose pixels `colour` gives as `(foreground, alpha)`, over a screen.
    fn over(
        screen: [f32; 3],
        width: usize,
        height: usize,
        colour: impl Fn(usize, usize) -> ([f32; 3], f32),
    ) -> Picture {
        let mut picture = Picture::default();
        picture.reset(width, height, Layout::Rgba);
        for (i, pixel) in picture.data.chunks_exact_mut(4).enumerate() {
            let (foreground, alpha) = colour(i % width, i / width);
            for c in 0..3 {
                pixel[c] = (foreground[c] * alpha + screen[c] * (1.0 - alpha) + 0.5) as u8;
            }
            pixel[3] = 255;
        }
        picture
    }

    fn keyed(picture: &Picture, matte: Matte) -> Vec<u8> {
        let Matte::Screen(screen) = matte else { panic!("{matte:?}") };
        let (mut samples, mut rgba) = (Samples::default(), Vec::new());
        let width = screen.samples(picture, false, &mut samples);
        let keyer = Keyer::new(screen);
        keyer.key(&samples, &mut rgba);
        keyer.clean(&samples, width, &mut Edges::default(), &mut rgba);
        rgba
    }

    #[test]
    fn the_screen_is_found_whatever_its_colour() {
        for screen in [GREEN, [0.0, 255.0, 0.0], [20.0, 40.0, 230.0], [0.0, 177.0, 64.0]] {
            let picture = over(screen, 64, 48, |x, y| {
                ([30.0; 3], f32::from(u8::from(x.abs_diff(32) + y.abs_diff(24) < 14)))
            });
            let Matte::Screen(found) = Matte::find(&[picture], None).unwrap() else { panic!("no screen") };
            let rgb = found.rgb();
            assert!(rgb.iter().zip(screen).all(|(a, b)| (a - b).abs() < 3.0), "{screen:?} {rgb:?}");
        }
    }

    #[test]
    fn mixtures_with_greys_come_out_as_they_went_in() {
        for shade in [0.0, 60.0, 140.0, 255.0] {
            let alpha_at = |x: usize| (x.saturating_sub(8) as f32 / 40.0).min(1.0);
            let picture = over(GREEN, 64, 20, |x, y| {
                ([shade; 3], if (4..16).contains(&y) && x < 56 { alpha_at(x) } else { 0.0 })
            });
            let matte = Matte::find(std::slice::from_ref(&picture), None).unwrap();
            let rgba = keyed(&picture, matte);
            for x in 0..56 {
                let pixel = &rgba[(10 * 64 + x) * 4..][..4];
                let alpha = alpha_at(x);
                // Thresholds at both ends move alpha by a few hundredths.
                assert!(
                    (f32::from(pixel[3]) / 255.0 - alpha).abs() < 0.06,
                    "{shade} {x}: {pixel:?}, alpha {alpha}"
                );
                for c in 0..3 {
                    let expected = shade * f32::from(pixel[3]) / 255.0;
                    assert!((f32::from(pixel[c]) - expected).abs() < 9.0, "{shade} {x}: {pixel:?}");
                }
                // No fringe: green is not above the others.
                assert!(
                    i32::from(pixel[1]) <= i32::from(pixel[0].max(pixel[2])) + 4,
                    "{shade} {x}: {pixel:?}"
                );
            }
        }
    }

    #[test]
    fn colours_far_from_the_screen_are_opaque_and_unchanged() {
        for colour in [[230.0, 40.0, 30.0], [240.0, 220.0, 60.0], [60.0, 90.0, 220.0], [20.0, 18.0, 16.0]] {
            let picture = over(GREEN, 40, 40, |x, y| {
                (colour, f32::from(u8::from(x.abs_diff(20) < 8 && y.abs_diff(20) < 8)))
            });
            let matte = Matte::find(std::slice::from_ref(&picture), None).unwrap();
            let pixel = &keyed(&picture, matte)[(20 * 40 + 20) * 4..][..4];
            assert_eq!(pixel[3], 255, "{colour:?}");
            assert!((0..3).all(|c| (f32::from(pixel[c]) - colour[c]).abs() < 4.0), "{colour:?}: {pixel:?}");
        }
    }

    #[test]
    fn a_noisy_screen_is_transparent_everywhere() {
        let mut random = Key([3; 32]).sequence();
        let mut picture = over(GREEN, 80, 60, |_, _| ([0.0; 3], 0.0));
        for pixel in picture.data.chunks_exact_mut(4) {
            for value in &mut pixel[..3] {
                *value = (f64::from(*value) + 6.0 * random.normal()).clamp(0.0, 255.0) as u8;
            }
        }
        let matte = Matte::find(std::slice::from_ref(&picture), None).unwrap();
        let rgba = keyed(&picture, matte);
        let visible = rgba.chunks(4).filter(|pixel| pixel[3] > 0).count();
        assert!(visible * 200 < 80 * 60, "{visible} pixels show");
    }

    #[test]
    fn what_has_no_screen_is_refused() {
        let grey = over([90.0; 3], 40, 30, |x, _| ([x as f32 * 6.0, 80.0, 100.0], 0.5));
        let error = Matte::find(std::slice::from_ref(&grey), None).unwrap_err().to_string();
        assert!(error.starts_with("it is not a green-screen clip") && error.contains("`key`"), "{error}");
        let error = Matte::find(std::slice::from_ref(&grey), Some([0, 255, 0])).unwrap_err().to_string();
        assert!(error.contains("#00ff00 does not occur"), "{error}");
        let error = Matte::find(&[grey], Some([90, 91, 92])).unwrap_err().to_string();
        assert!(error.contains("nearly grey"), "{error}");
    }

    #[test]
    fn a_key_that_the_user_gives_is_taken() {
        let picture = over(GREEN, 40, 30, |x, _| ([200.0, 30.0, 30.0], f32::from(u8::from(x > 12))));
        // Red fills most of the border; the user means the green.
        let found = Matte::find(std::slice::from_ref(&picture), Some([5, 193, 66])).unwrap();
        let rgba = keyed(&picture, found);
        assert_eq!((rgba[3], rgba[20 * 4 + 3]), (0, 255));
    }

    #[test]
    fn transparency_of_its_own_is_kept() {
        let mut picture = over(GREEN, 4, 1, |_, _| ([0.0; 3], 0.0));
        picture.data[3] = 128;
        assert_eq!(Matte::find(std::slice::from_ref(&picture), None).unwrap(), Matte::Alpha);
        let mut rgba = Vec::new();
        premultiply(&picture, &mut rgba);
        assert_eq!(rgba[..8], [3, 97, 33, 128, 5, 193, 66, 255]);
    }
}
