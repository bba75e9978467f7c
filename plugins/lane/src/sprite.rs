//! Pictures of what stands beside the road: trees and posts. They are drawn once, when a simulator is made.

use pdk_sdk::prelude::{FrameMut, Random};

/// Texels along a side of a picture; a power of two.
const SIZE: usize = 128;
/// Pictures are drawn larger by this factor and reduced, which smooths their edges.
const FINENESS: usize = 3;

/// One copy of a picture: colours multiplied by their opacity, then the opacity.
type Level = Vec<[f32; 4]>;

/// A picture with smaller copies.
#[derive(Debug)]
pub struct Sprite {
    levels: Vec<Level>,
}

/// Where a picture goes in a frame, in pixels, and how.
#[derive(Debug, Clone, Copy)]
pub struct Placement {
    /// Left edge.
    pub left: f32,
    /// Upper edge.
    pub top: f32,
    /// Width and height.
    pub size: [f32; 2],
    /// Opacity, 0 to 1.
    pub opacity: f32,
    /// Brightness; 1 for the picture's own.
    pub brightness: f32,
    /// Colour of the air in front of it, and its share.
    pub haze: ([f32; 3], f32),
}

impl Sprite {
    /// A picture from a function of the place: x from -1 (left) to 1, y from 0 (top) to 1.
    fn drawn(mut colour: impl FnMut(f32, f32) -> Option<[f32; 3]>) -> Self {
        let fine = SIZE * FINENESS;
        let mut largest = vec![[0.0f32; 4]; SIZE * SIZE];
        let share = 1.0 / (FINENESS * FINENESS) as f32;
        for y in 0..fine {
            for x in 0..fine {
                let place = [(x as f32 + 0.5) / fine as f32 * 2.0 - 1.0, (y as f32 + 0.5) / fine as f32];
                if let Some([r, g, b]) = colour(place[0], place[1]) {
                    let texel = &mut largest[y / FINENESS * SIZE + x / FINENESS];
                    for (sum, value) in texel.iter_mut().zip([r, g, b, 1.0]) {
                        *sum += value * share;
                    }
                }
            }
        }
        let mut levels = vec![largest];
        let mut size = SIZE / 2;
        while size > 0 {
            let above = &levels[levels.len() - 1];
            let smaller = (0..size * size)
                .map(|i| {
                    let at = i / size * 2 * (size * 2) + i % size * 2;
                    let [a, b, c, d] = [at, at + 1, at + size * 2, at + size * 2 + 1].map(|j| above[j]);
                    [0, 1, 2, 3].map(|k| (a[k] + b[k] + c[k] + d[k]) * 0.25)
                })
                .collect();
            levels.push(smaller);
            size /= 2;
        }
        Self { levels }
    }

    /// A conifer.
    pub fn conifer(random: &mut Random) -> Self {
        const TIERS: usize = 9;
        let ragged: Vec<f32> = (0..64).map(|_| random.uniform(0.72, 1.0) as f32).collect();
        let lean: Vec<f32> = (0..TIERS).map(|_| random.uniform(-0.05, 0.05) as f32).collect();
        Self::drawn(|x, y| {
            if y > 0.9 {
                return (x.abs() < 0.05).then(|| [84.0, 62.0, 44.0].map(|c| c * (0.9 - 0.5 * x / 0.05)));
            }
            // Each tier widens downwards and starts narrower than the one above ends.
            let tier = (y / 0.9 * TIERS as f32) as usize;
            let within = y / 0.9 * TIERS as f32 - tier as f32;
            let widest = 0.12 + 0.8 * (tier as f32 + 1.0) / TIERS as f32;
            // The topmost comes to a point.
            let narrowest = if tier == 0 { 0.05 } else { 0.55 };
            let half = widest * (narrowest + (1.0 - narrowest) * within);
            let centre = lean[tier.min(TIERS - 1)];
            let tooth = ragged[(((x + 1.0) * 16.0) as usize + tier * 5) & 63];
            let side = (x - centre) / half;
            if side.abs() > tooth {
                return None;
            }
            let light = 0.86 - 0.34 * side - 0.3 * (1.0 - within) * (1.0 - side * side);
            Some([52.0, 84.0, 48.0].map(|c| c * light))
        })
    }

    /// A broad-leaved tree.
    pub fn broadleaf(random: &mut Random) -> Self {
        // Clumps of leaves, the later ones in front.
        let clumps: Vec<[f32; 4]> = (0..70)
            .map(|i| {
                let depth = i as f64 / 70.0;
                let angle = random.uniform(0.0, 2.0 * std::f64::consts::PI);
                let reach = random.unit().sqrt() * (0.78 - 0.2 * depth);
                let (x, y) = (reach * libm::cos(angle), 0.38 + reach * 0.38 * libm::sin(angle));
                let radius = random.uniform(0.1, 0.22);
                [x, y, radius, random.uniform(-0.1, 0.1)].map(|v| v as f32)
            })
            .collect();
        Self::drawn(|x, y| {
            for &[cx, cy, radius, tint] in clumps.iter().rev() {
                // Heights run from 0 to 1 where widths run from -1 to 1.
                let (dx, dy) = ((x - cx) / radius, (y - cy) * 2.0 / radius);
                if dx * dx + dy * dy < 1.0 {
                    let light = 0.8 - 0.2 * dx - 0.22 * dy - 0.38 * (y - 0.3) + tint;
                    return Some([88.0, 114.0, 52.0].map(|c| c * light));
                }
            }
            let half = 0.05 + 0.05 * (y - 0.9).max(0.0) * 10.0;
            (y > 0.5 && x.abs() < half).then(|| [92.0, 72.0, 54.0].map(|c| c * (0.85 - 0.4 * x / half)))
        })
    }

    /// A delineator post: white with a black band and a reflector.
    pub fn post() -> Self {
        Self::drawn(|x, y| {
            let light = 0.95 - 0.2 * x;
            // The top slants.
            if y < 0.03 + 0.03 * x {
                return None;
            }
            let band = (0.14..0.36).contains(&(y - 0.06 * x));
            let reflector = band && x.abs() < 0.5 && (0.19..0.31).contains(&y);
            Some(if reflector {
                [250.0, 150.0, 40.0]
            } else if band {
                [38.0, 38.0, 42.0].map(|c| c * light)
            } else {
                [238.0, 238.0, 234.0].map(|c| c * light)
            })
        })
    }

    /// The shadow of something round, black and fading outwards.
    pub fn shadow() -> Self {
        let mut sprite = Self::drawn(|_, _| Some([0.0; 3]));
        for level in &mut sprite.levels {
            let size = (level.len() as f32).sqrt();
            for (i, texel) in level.iter_mut().enumerate() {
                let (x, y) = ((i as f32 % size + 0.5) / size, ((i as f32 / size).floor() + 0.5) / size);
                let from_middle = (2.0 * x - 1.0) * (2.0 * x - 1.0) + (2.0 * y - 1.0) * (2.0 * y - 1.0);
                texel[3] = (1.0 - from_middle).max(0.0);
            }
        }
        sprite
    }

    /// Draws the picture into a frame.
    pub fn draw(&self, frame: &mut FrameMut<'_>, at: Placement) {
        // What is narrower than a pixel becomes a pixel wide and the fainter for it.
        let [width, height] = at.size.map(|s| s.max(1.0));
        let opacity = at.opacity * (at.size[0] / width).max(0.0) * (at.size[1] / height).max(0.0);
        let (left, top) = (at.left - (width - at.size[0]) * 0.5, at.top - (height - at.size[1]) * 0.5);
        let pixels = |low: f32, length: f32, most: usize| {
            let first = (low - 0.5).max(0.0) as usize;
            let last = (low + length + 1.5).clamp(0.0, most as f32) as usize;
            first.min(last)..last
        };
        let (columns, rows) = (pixels(left, width, frame.width()), pixels(top, height, frame.height()));
        // A level for each direction would be better; the finer one would flicker, so the coarser one decides.
        let texels = SIZE as f32 / width.max(height);
        let mut level = 0;
        while ((2usize << level) as f32) <= texels && level + 1 < self.levels.len() {
            level += 1;
        }
        let size = SIZE >> level;
        let texture = &self.levels[level];
        let (haze, share) = at.haze;
        let (step_x, step_y) = (size as f32 / width, size as f32 / height);
        for y in rows {
            let v = (y as f32 + 0.5 - top) * step_y - 0.5;
            let first = columns.start;
            let row = &mut frame.row_mut(y)[first * 3..columns.end * 3];
            for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                let u = ((first + x) as f32 + 0.5 - left) * step_x - 0.5;
                let texel = bilinear(texture, size, u, v);
                let cover = texel[3] * opacity;
                if cover <= 0.003 {
                    continue;
                }
                for channel in 0..3 {
                    let own = texel[channel] * opacity * at.brightness;
                    let seen = own + (haze[channel] * cover - own) * share;
                    let behind = f32::from(pixel[channel]);
                    pixel[channel] = (behind + seen - behind * cover + 0.5) as u8;
                }
            }
        }
    }
}

/// The picture at a place in texels, transparent outside it.
#[inline]
fn bilinear(texels: &[[f32; 4]], size: usize, u: f32, v: f32) -> [f32; 4] {
    let (left, top) = ((u + 1.0) as i32 - 1, (v + 1.0) as i32 - 1);
    let (fx, fy) = (u - left as f32, v - top as f32);
    let texel = |x: i32, y: i32| {
        let inside = x >= 0 && y >= 0 && (x as usize) < size && (y as usize) < size;
        if inside { texels[y as usize * size + x as usize] } else { [0.0; 4] }
    };
    let ([a, b], [c, d]) =
        ([texel(left, top), texel(left + 1, top)], [texel(left, top + 1), texel(left + 1, top + 1)]);
    let mut mixed = [0.0; 4];
    for k in 0..4 {
        let upper = a[k] + (b[k] - a[k]) * fx;
        let lower = c[k] + (d[k] - c[k]) * fx;
        mixed[k] = upper + (lower - upper) * fy;
    }
    mixed
}
