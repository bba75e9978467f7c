//! Pictures with transparency, drawn into frames at any size.

use pdk_sdk::prelude::FrameMut;

use crate::ground::byte;

/// Texels along a side of a picture; a power of two.
const SIZE: usize = 128;
/// Pictures are drawn larger by this factor and reduced, which smooths their edges.
const FINENESS: usize = 3;

/// One copy of a picture: colours multiplied by their opacity, then the opacity.
type Level = Vec<[f32; 4]>;

/// A picture with smaller copies.
#[derive(Debug)]
pub struct Sprite {
    /// With a transparent border one texel wide.
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
    /// How far away it is along the optical axis, in metres.
    pub depth: f32,
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
    /// One colour with an opacity that is a function of the place: x and y from 0 (left, top) to 1.
    pub fn veil(colour: [f32; 3], opacity: impl Fn(f32, f32) -> f32) -> Self {
        let place = |i: usize| (i as f32 + 0.5) / SIZE as f32;
        let texel = |i: usize| {
            let opacity = opacity(place(i % SIZE), place(i / SIZE));
            [colour[0] * opacity, colour[1] * opacity, colour[2] * opacity, opacity]
        };
        Self::of((0..SIZE * SIZE).map(texel).collect())
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
        Self::of(largest)
    }

    /// The picture and its smaller copies.
    fn of(largest: Level) -> Self {
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
        let levels = levels.iter().map(|level| bordered(level)).collect();
        Self { levels }
    }

    /// Tells how much of each pixel the picture covers in a frame of this size, where it covers anything.
    pub fn covered(
        &self,
        width: usize,
        height: usize,
        at: &Placement,
        mut tell: impl FnMut(usize, usize, f32),
    ) {
        let area = Area::new(self, width, height, at);
        for y in area.rows.clone() {
            for x in area.columns.clone() {
                let cover = area.texel(x, y)[3] * area.opacity;
                if cover > 0.003 {
                    tell(x, y, cover);
                }
            }
        }
    }

    /// Draws the picture into a frame.
    #[inline(always)]
    pub fn draw(&self, frame: &mut FrameMut<'_>, at: Placement) {
        let area = Area::new(self, frame.width(), frame.height(), &at);
        let (haze, share) = at.haze;
        // What each texel's colour is multiplied with, and what the air adds where the picture is opaque.
        let own = [0, 1, 2].map(|c| area.opacity * at.tint[c] * (1.0 - share));
        let air = [0, 1, 2].map(|c| haze[c] * share);
        for y in area.rows.clone() {
            let first = area.columns.start;
            let row = &mut frame.row_mut(y)[first * 3..area.columns.end * 3];
            for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                let texel = area.texel(first + x, y);
                let cover = texel[3] * area.opacity;
                if cover <= 0.003 {
                    continue;
                }
                for channel in 0..3 {
                    let seen = texel[channel] * own[channel] + air[channel] * cover;
                    let behind = f32::from(pixel[channel]);
                    pixel[channel] = byte(behind + seen - behind * cover);
                }
            }
        }
    }
}

/// The pixels that a picture may cover, and which of its texels lies in each.
struct Area<'a> {
    rows: std::ops::Range<usize>,
    columns: std::ops::Range<usize>,
    opacity: f32,
    texture: &'a Level,
    size: usize,
    corner: [f32; 2],
    step: [f32; 2],
}

impl<'a> Area<'a> {
    #[inline(always)]
    fn new(picture: &'a Sprite, frame_width: usize, frame_height: usize, at: &Placement) -> Self {
        // What is narrower than a pixel becomes a pixel wide and the fainter for it.
        let [width, height] = at.size.map(|s| s.max(1.0));
        let opacity = at.opacity * (at.size[0] / width).max(0.0) * (at.size[1] / height).max(0.0);
        let (left, top) = (at.left - (width - at.size[0]) * 0.5, at.top - (height - at.size[1]) * 0.5);
        let pixels = |low: f32, length: f32, most: usize| {
            let first = (low - 0.5).max(0.0) as usize;
            let last = (low + length + 1.5).clamp(0.0, most as f32) as usize;
            first.min(last)..last
        };
        let (columns, rows) = (pixels(left, width, frame_width), pixels(top, height, frame_height));
        let rows = rows.start..rows.end.min((at.bottom + 0.5).clamp(0.0, frame_height as f32) as usize);
        // A level for each direction would be better; the finer one would flicker, so the coarser one decides.
        let texels = SIZE as f32 / width.max(height);
        let mut level = 0;
        while ((2usize << level) as f32) <= texels && level + 1 < picture.levels.len() {
            level += 1;
        }
        let size = SIZE >> level;
        let step = [size as f32 / width, size as f32 / height];
        Self { rows, columns, opacity, texture: &picture.levels[level], size, corner: [left, top], step }
    }

    /// What the picture has in the middle of a pixel.
    #[inline(always)]
    fn texel(&self, x: usize, y: usize) -> [f32; 4] {
        let u = (x as f32 + 0.5 - self.corner[0]) * self.step[0] - 0.5;
        let v = (y as f32 + 0.5 - self.corner[1]) * self.step[1] - 0.5;
        bilinear(self.texture, self.size, u, v)
    }
}

/// A copy with a transparent border.
fn bordered(level: &[[f32; 4]]) -> Level {
    let size = level.len().isqrt();
    let mut wide = vec![[0.0; 4]; (size + 2) * (size + 2)];
    for (y, row) in level.chunks_exact(size).enumerate() {
        let first = (y + 1) * (size + 2) + 1;
        wide[first..first + size].copy_from_slice(row);
    }
    wide
}

/// The picture at a place in texels; around it lies a transparent border.
#[inline(always)]
fn bilinear(texels: &[[f32; 4]], size: usize, u: f32, v: f32) -> [f32; 4] {
    let most = size as f32;
    // Places count from the border.
    let (u, v) = ((u + 1.0).clamp(0.0, most), (v + 1.0).clamp(0.0, most));
    let (left, top) = (u as i32 as usize, v as i32 as usize);
    let (fx, fy) = (u - left as f32, v - top as f32);
    let stride = size + 2;
    let at = top * stride + left;
    let ([a, b], [c, d]) = ([texels[at], texels[at + 1]], [texels[at + stride], texels[at + stride + 1]]);
    let mut mixed = [0.0; 4];
    for k in 0..4 {
        let upper = a[k] + (b[k] - a[k]) * fx;
        let lower = c[k] + (d[k] - c[k]) * fx;
        mixed[k] = upper + (lower - upper) * fy;
    }
    mixed
}
