//! Snow on glass: a field of densities that flakes and the bank at the lower edge are added to, and its look.
//!
//! Flakes are stamps: pictures of irregular clumps, made once from a fixed key, that are laid turned and scaled.

use pdk_sdk::prelude::*;

use crate::lens::{Backdrop, Lens, smooth, to_byte};

/// Number of stamps.
pub const STAMPS: usize = 12;
/// Rows and columns of a stamp.
const SIDE: usize = 64;
/// A stamp reaches this many radii of its flake from the middle.
const REACH: f32 = 1.35;
/// What a density of 1 counts.
const THICKNESS: f32 = 1.35;
/// Density of the bank well below its surface.
const BANK: f32 = 5.0;
/// Side of the picture of the bank's grain in heights of the frame.
const GRAIN: f32 = 0.5;

/// Densities, row by row.
type Picture = [f32; SIDE * SIDE];

/// The snow on the lens.
pub struct SnowCover {
    width: usize,
    height: usize,
    density: Vec<f32>,
    /// First and last column with snow in each row.
    rows: Vec<(usize, usize)>,
    stamps: Vec<Picture>,
    grain: Vec<Picture>,
    /// Opacity, light and transparency to the scene's light of each pixel of a row.
    look: Vec<[f32; 3]>,
    /// The height of the bank in each column.
    bank: Vec<f32>,
}

impl SnowCover {
    pub fn new() -> Self {
        let mut random = Key([0x5f; 32]).sequence();
        let stamps = (0..STAMPS).map(|_| stamp(&mut random)).collect();
        let noise = Noise::new(&mut random);
        let grain = vec![picture(|u, v| noise.at(u, v))];
        Self {
            width: 0,
            height: 0,
            density: Vec::new(),
            rows: Vec::new(),
            stamps,
            grain,
            look: Vec::new(),
            bank: Vec::new(),
        }
    }

    /// Takes all snow away.
    pub fn clear(&mut self, lens: &Lens) {
        if (self.width, self.height) != (lens.width, lens.height) {
            (self.width, self.height) = (lens.width, lens.height);
            self.density.clear();
            self.density.resize(lens.width * lens.height, 0.0);
            self.look.resize(lens.width, [0.0; 3]);
            self.bank.resize(lens.width, 0.0);
            self.rows.clear();
            self.rows.resize(lens.height, (usize::MAX, 0));
        }
        for (y, (first, last)) in self.rows.iter_mut().enumerate() {
            if *first <= *last {
                self.density[y * self.width + *first..=y * self.width + *last].fill(0.0);
            }
            (*first, *last) = (usize::MAX, 0);
        }
    }

    /// The part of a row between two places in pixels, marked as covered, with its first column.
    fn part(&mut self, y: usize, left: f32, right: f32) -> Option<(usize, &mut [f32])> {
        if right < 0.0 || left > (self.width - 1) as f32 || left > right {
            return None;
        }
        let first = left.max(0.0).ceil() as usize;
        let last = (right.floor() as usize).min(self.width - 1);
        if first > last {
            return None;
        }
        let covered = &mut self.rows[y];
        *covered = (covered.0.min(first), covered.1.max(last));
        Some((first, &mut self.density[y * self.width + first..=y * self.width + last]))
    }

    /// Adds a flake with its middle at a place and a radius in heights of the frame.
    pub fn add(
        &mut self,
        lens: &Lens,
        (x, y): (f32, f32),
        radius: f32,
        stamp: usize,
        turn: [f32; 2],
        density: f32,
    ) {
        // A flake smaller than a pixel covers part of one: it is drawn as large as a pixel, and thinner.
        let asked = radius * lens.unit;
        let radius = asked.max(0.6);
        let density = density * (asked / radius) * (asked / radius);
        if density < 0.004 {
            return;
        }
        let (cx, cy) = lens.to_pixels(x, y);
        let reach = REACH * radius;
        let top = (cy - reach).ceil().max(0.0);
        let bottom = (cy + reach).floor().min((self.height - 1) as f32);
        if bottom < top {
            return;
        }
        let stamps = std::mem::take(&mut self.stamps);
        // Stamp pixels per frame pixel.
        let scale = (SIDE - 2) as f32 / (2.0 * reach);
        let (right, down) = (turn[0] * scale, turn[1] * scale);
        let middle = 0.5 * (SIDE - 1) as f32;
        for row in top as usize..=bottom as usize {
            let dy = row as f32 - cy;
            let half = (reach * reach - dy * dy).max(0.0).sqrt();
            let Some((first, part)) = self.part(row, cx - half, cx + half) else { continue };
            let dx = first as f32 - cx;
            let (u, v) = (middle + dx * right - dy * down, middle + dx * down + dy * right);
            for (i, value) in part.iter_mut().enumerate() {
                let step = i as i32 as f32;
                *value += density * sample(&stamps[stamp], u + step * right, v + step * down);
            }
        }
        self.stamps = stamps;
    }

    /// Adds the bank: `heights` has its height in heights of the frame, at places [`Bank`] apart.
    pub fn add_bank(&mut self, lens: &Lens, bank: &Bank) {
        let highest = bank.heights.iter().fold(0.0f32, |a, &b| a.max(b));
        if highest <= 1e-4 {
            return;
        }
        let floor = lens.height as f32 / lens.unit;
        let top = ((floor - 1.7 * highest - 0.002) * lens.unit).floor().max(0.0) as usize;
        let pictures = std::mem::take(&mut self.grain);
        let Some(picture) = pictures.first() else { return };
        let scale = SIDE as f32 / (GRAIN * lens.unit);
        let middle = 0.5 * self.width as f32;
        for (x, height) in self.bank.iter_mut().enumerate() {
            *height = bank.at((x as f32 + 0.5 - middle) / lens.unit);
        }
        let heights = std::mem::take(&mut self.bank);
        for y in top.min(lens.height)..lens.height {
            let above = floor - (y as f32 + 0.5) / lens.unit;
            let down = mirrored(above * lens.unit * scale);
            let Some((_, part)) = self.part(y, 0.0, (lens.width - 1) as f32) else { continue };
            for (x, (value, &height)) in part.iter_mut().zip(&heights).enumerate() {
                // The surface is nowhere higher than this.
                if height <= 1e-4 || above > 1.7 * height + 0.002 {
                    continue;
                }
                let grain = sample(picture, mirrored((x as i32 as f32 + 0.5 - middle) * scale), down);
                let surface = height * (1.0 + 0.5 * grain);
                let inside = smooth((surface - above) / (Bank::SOFT * 0.5 + 0.6 * height) + 0.1);
                *value += BANK * inside * (1.0 + 0.4 * grain) * (height * 60.0).min(1.0);
            }
        }
        self.bank = heights;
        self.grain = pictures;
    }

    /// Adds how opaque the snow is, 0 to 255, to all channels of a frame of opacities.
    pub fn opacity(&self, mut dst: FrameMut<'_>) {
        for (y, &(first, last)) in self.rows.iter().enumerate().filter(|(_, (first, last))| first <= last) {
            let out = &mut dst.row_mut(y)[first * 3..(last + 1) * 3];
            let densities = &self.density[y * self.width + first..=y * self.width + last];
            for (out, &density) in out.chunks_exact_mut(3).zip(densities) {
                let behind = f32::from(out[0]);
                out.fill(to_byte(behind + opacity(density) * (255.0 - behind)));
            }
        }
    }

    /// Draws the snow over `dst`, which holds the scene behind it.
    pub fn draw(&mut self, mut dst: FrameMut<'_>, lens: &Lens, backdrop: &Backdrop) {
        // Snow is as bright as the light that falls on it, which the scene tells.
        let white = (95.0 * backdrop.daylight() + 1.15 * backdrop.brightness()).min(242.0);
        let tint = [white * 0.975, white * 0.99, white];
        let relief = (0.012 * lens.unit).max(1.0);
        let step = (relief.round() as usize).min(self.height.saturating_sub(1));
        for (y, &(first, last)) in self.rows.iter().enumerate() {
            if first > last {
                continue;
            }
            let line = |y: usize| &self.density[y * self.width + first..=y * self.width + last];
            let (here, above) = (line(y), line(y.saturating_sub(step)));
            let below = line((y + step).min(self.height - 1));
            let look = &mut self.look[..=last - first];
            for (look, ((&density, &above), &below)) in look.iter_mut().zip(here.iter().zip(above).zip(below))
            {
                let thick = density * THICKNESS;
                let alpha = opacity(density);
                // Light comes from above: slopes that face up are brighter.
                let rise = 1.0 / (1.0 + above) - 1.0 / (1.0 + below);
                // Thin snow lets some of the scene's light through, out of focus.
                *look = [alpha, 1.0 + (rise * 0.3).clamp(-0.14, 0.07), 0.45 / (1.0 + thick)];
            }
            let out = &mut dst.row_mut(y)[first * 3..(last + 1) * 3];
            for (i, (out, &[alpha, light, through])) in out.chunks_exact_mut(3).zip(&*look).enumerate() {
                if alpha < 0.004 {
                    continue;
                }
                let seen = backdrop.at((first + i) as i32 as f32, y as i32 as f32);
                for channel in 0..3 {
                    let snow = (tint[channel] + (seen[channel] - tint[channel]) * through) * light;
                    let behind = f32::from(out[channel]);
                    out[channel] = to_byte(behind + alpha * (snow - behind));
                }
            }
        }
    }
}

/// How much of what lies behind snow of this density it hides.
#[inline(always)]
fn opacity(density: f32) -> f32 {
    let thick = density * THICKNESS;
    0.96 - 0.96 / (1.0 + thick + thick * thick)
}

/// The bank of snow at the lower edge of the lens.
#[derive(Default)]
pub struct Bank {
    /// Heights at places [`Bank::STEP`] apart, from beyond the left edge of the frame.
    heights: Vec<f32>,
    left: f32,
}

impl Bank {
    const STEP: f32 = 1.0 / 64.0;
    /// The surface is soft over half this height, and more where the bank is high.
    const SOFT: f32 = 0.03;
    /// The bank grows no higher.
    const HIGHEST: f32 = 0.35;

    pub fn clear(&mut self, lens: &Lens) {
        self.left = -lens.half_width() - Self::STEP;
        self.heights.clear();
        self.heights.resize((2.0 * lens.half_width() / Self::STEP).ceil() as usize + 4, 0.0);
    }

    /// Adds a flake of this radius; `share` of it lies here.
    pub fn add(&mut self, x: f32, radius: f32, share: f32) {
        // It spreads over a few times its width; its area stays about the same.
        let spread = 3.0 * radius + 0.06;
        let peak = 4.2 * share * radius * radius / spread;
        let place =
            |x: f32| ((x - self.left) * (1.0 / Self::STEP)).clamp(0.0, (self.heights.len() - 1) as f32);
        let (first, last) = (place(x - spread).ceil() as usize, place(x + spread) as usize);
        for i in first..=last {
            let distance = (self.left + i as f32 * Self::STEP - x) / spread;
            let near = (1.0 - distance * distance).max(0.0);
            self.heights[i] += peak * near * near;
        }
    }

    /// Lets high parts settle.
    pub fn settle(&mut self) {
        for height in &mut self.heights {
            *height = *height * Self::HIGHEST / (*height + Self::HIGHEST);
        }
    }

    fn at(&self, x: f32) -> f32 {
        let place = ((x - self.left) * (1.0 / Self::STEP)).clamp(0.0, (self.heights.len() - 2) as f32);
        let first = place as usize;
        self.heights[first] + (self.heights[first + 1] - self.heights[first]) * (place - first as f32)
    }
}

/// A coordinate of a picture, going back and forth.
fn mirrored(v: f32) -> f32 {
    let limit = (SIDE - 1) as f32;
    let turns = v.abs() * (1.0 / limit);
    let whole = turns.floor();
    let within = (turns - whole) * limit;
    if whole as i32 & 1 == 0 { within } else { limit - within }
}

/// The value at a place, interpolated. Places wrap round at the borders.
#[inline(always)]
fn sample(picture: &Picture, u: f32, v: f32) -> f32 {
    let (x, y) = (u.max(0.0) as u32 as usize, v.max(0.0) as u32 as usize);
    let (across, down) = (u - x as i32 as f32, v - y as i32 as f32);
    let start = y * SIDE + x;
    let at = |offset: usize| picture[(start + offset) & (SIDE * SIDE - 1)];
    let upper = at(0) + (at(1) - at(0)) * across;
    let lower = at(SIDE) + (at(SIDE + 1) - at(SIDE)) * across;
    upper + (lower - upper) * down
}

/// A picture of a function of two numbers from 0 to 1.
fn picture(of: impl Fn(f32, f32) -> f32) -> Picture {
    std::array::from_fn(|i| of((i % SIDE) as f32 / (SIDE - 1) as f32, (i / SIDE) as f32 / (SIDE - 1) as f32))
}

/// Makes a stamp: a few soft lobes with ragged edges. Densities are about 1 in the middle and 0 at the border.
fn stamp(random: &mut Random) -> Picture {
    let lobes: [[f32; 3]; 6] = std::array::from_fn(|i| {
        let angle = random.uniform(0.0, std::f64::consts::TAU) as f32;
        let distance = if i == 0 { 0.0 } else { random.uniform(0.25, 0.75) as f32 };
        [libm::cosf(angle) * distance, libm::sinf(angle) * distance, random.uniform(0.35, 0.7) as f32]
    });
    let noise = Noise::new(random);
    picture(|u, v| {
        let (x, y) = ((2.0 * u - 1.0) * REACH, (2.0 * v - 1.0) * REACH);
        let mut body = 0.0;
        for [right, down, size] in lobes {
            let far = ((x - right) * (x - right) + (y - down) * (y - down)) / (size * size * 1.9);
            let near = (1.0 - far).max(0.0);
            body += near * near;
        }
        let border = smooth((REACH - (x * x + y * y).sqrt()) / 0.4);
        let ragged = smooth((body + 0.95 * noise.at(u, v) * (0.3 + body).min(1.0) - 0.12) / 1.35);
        ragged * border * (1.0 + 0.5 * noise.at(v, u)).max(0.0)
    })
}

/// Cells of each octave of [`Noise`] along a side, with its weight.
const OCTAVES: [(usize, f32); 3] = [(6, 0.5), (12, 0.33), (24, 0.25)];

/// Smooth noise: random values on grids, interpolated.
struct Noise([Vec<f32>; 3]);

impl Noise {
    fn new(random: &mut Random) -> Self {
        let grid = |(cells, _): (usize, f32)| {
            (0..(cells + 1) * (cells + 1)).map(|_| random.uniform(-1.0, 1.0) as f32).collect()
        };
        Self(OCTAVES.map(grid))
    }

    /// The noise at a place from 0 to 1: a number around 0, from about -1 to 1.
    fn at(&self, u: f32, v: f32) -> f32 {
        let mut sum = 0.0;
        for (grid, (cells, weight)) in self.0.iter().zip(OCTAVES) {
            let place = |w: f32| {
                let w = w * cells as f32;
                let first = (w as usize).min(cells - 1);
                (first, smooth(w - first as f32))
            };
            let ((x, across), (y, down)) = (place(u), place(v));
            let at = |x: usize, y: usize| grid[y * (cells + 1) + x];
            let upper = at(x, y) + (at(x + 1, y) - at(x, y)) * across;
            let lower = at(x, y + 1) + (at(x + 1, y + 1) - at(x, y + 1)) * across;
            sum += weight * (upper + (lower - upper) * down);
        }
        sum
    }
}
