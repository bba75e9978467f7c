//! Pictures with transparency, drawn into frames at any size.

use pdk_sdk::prelude::FrameMut;

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
    /// What the picture's colours are multiplied with.
    pub tint: [f32; 3],
    /// Colour of the air in front of it, and its share.
    pub haze: ([f32; 3], f32),
    /// Rows from this one on hide it.
    pub bottom: f32,
}

impl Sprite {
    /// The picture with its opacity, row by row in the largest copy and the smaller ones, changed by a function of the
    /// place: x and y from 0 (left, top) to 1.
    pub fn with_opacity(mut self, opacity: impl Fn(f32, f32) -> f32) -> Self {
        for level in &mut self.levels {
            let size = (level.len() as f32).sqrt();
            for (i, texel) in level.iter_mut().enumerate() {
                let (x, y) = ((i as f32 % size + 0.5) / size, ((i as f32 / size).floor() + 0.5) / size);
                texel[3] = opacity(x, y);
            }
        }
        self
    }

    /// The picture with its colours multiplied by its opacity, as they have to be where [`Sprite::with_opacity`] lowered it.
    pub fn multiplied(mut self) -> Self {
        for texel in self.levels.iter_mut().flatten() {
            let opacity = texel[3];
            texel[..3].iter_mut().for_each(|channel| *channel *= opacity);
        }
        self
    }

    /// A picture from a function of the place: x from -1 (left) to 1, y from 0 (top) to 1.
    pub fn drawn(mut colour: impl FnMut(f32, f32) -> Option<[f32; 3]>) -> Self {
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
        let rows = rows.start..rows.end.min((at.bottom + 0.5).clamp(0.0, frame.height() as f32) as usize);
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
                    let own = texel[channel] * opacity * at.tint[channel];
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
