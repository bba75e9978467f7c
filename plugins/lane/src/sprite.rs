//! Pictures with transparency, drawn into frames at any size.

use pdk_sdk::prelude::FrameMut;

use crate::blend::{self, FAINTEST, Paint, TexelRows, blend};
#[cfg(target_arch = "x86_64")]
use crate::{simd::has_avx512, strips};

/// Texels along a side of a picture; a power of two.
const SIZE: usize = 128;
/// Pictures are drawn larger by this factor and reduced, which smooths their edges.
const FINENESS: usize = 3;

/// The texels of a picture: colours multiplied by their opacity, then the opacity.
type Texels = Vec<[f32; 4]>;

/// One copy of a picture.
#[derive(Debug)]
struct Level {
    /// Texels along a side, without a transparent border one texel wide.
    size: usize,
    texels: Texels,
    /// For each row of texels and the one below it: from the first to behind the last column that is not transparent.
    opaque: Vec<std::ops::Range<usize>>,
    /// The same for each column of texels and the one to its right: from the first to behind the last row.
    #[cfg(target_arch = "x86_64")]
    opaque_rows: Vec<std::ops::Range<u32>>,
}

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
    fn of(largest: Texels) -> Self {
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
        let levels = levels.iter().map(|texels| Level::of(texels)).collect();
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
                if cover > FAINTEST {
                    tell(x, y, cover);
                }
            }
        }
    }

    /// Draws the picture into a frame.
    pub fn draw(&self, frame: &mut FrameMut<'_>, at: Placement) {
        let area = Area::new(self, frame.width(), frame.height(), &at);
        let (haze, share) = at.haze;
        let [own_red, own_green, own_blue] = [0, 1, 2].map(|c| area.opacity * at.tint[c] * (1.0 - share));
        let [air_red, air_green, air_blue] = [0, 1, 2].map(|c| haze[c] * share);
        let paint = Paint {
            opacity: area.opacity,
            own: [own_red, own_green, own_blue, 0.0],
            air: [air_red, air_green, air_blue, 0.0],
        };
        #[cfg(target_arch = "x86_64")]
        if has_avx512() {
            let Area { rows, columns, level, corner, step, .. } = area;
            let Level { size, texels, opaque_rows: opaque, .. } = level;
            let picture = strips::Picture { texels, size: *size, opaque, corner, step, columns, rows };
            let pitch = frame.stride();
            // SAFETY: the processor has all that this version asks for.
            return unsafe { strips::draw(&picture, &paint, frame.data_mut(), pitch) };
        }
        let stride = area.level.size + 2;
        for y in area.rows.clone() {
            let (top, below) = area.texel_row(y);
            let columns = area.seen(top);
            let (above, under) = area.level.texels[top * stride..(top + 2) * stride].split_at(stride);
            let rows =
                TexelRows { texels: [above, under], below, corner: area.corner[0], step: area.step[0] };
            blend(&rows, &paint, columns, frame.row_mut(y));
        }
    }
}

/// The pixels that a picture may cover, and which of its texels lies in each.
struct Area<'a> {
    rows: std::ops::Range<usize>,
    columns: std::ops::Range<usize>,
    opacity: f32,
    level: &'a Level,
    corner: [f32; 2],
    step: [f32; 2],
}

impl<'a> Area<'a> {
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
        let level = &picture.levels[level];
        let step = [level.size as f32 / width, level.size as f32 / height];
        Self { rows, columns, opacity, level, corner: [left, top], step }
    }

    /// What the picture has in the middle of a pixel.
    fn texel(&self, x: usize, y: usize) -> [f32; 4] {
        let ((left, fx), (top, fy)) = (self.texel_column(x), self.texel_row(y));
        let (texels, stride) = (&self.level.texels, self.level.size + 2);
        let at = top * stride + left;
        let ([a, b], [c, d]) = ([texels[at], texels[at + 1]], [texels[at + stride], texels[at + stride + 1]]);
        [0, 1, 2, 3].map(|k| {
            let upper = a[k] + (b[k] - a[k]) * fx;
            let lower = c[k] + (d[k] - c[k]) * fx;
            upper + (lower - upper) * fy
        })
    }

    /// The row of texels above the middle of a pixel, and how far below it that lies. Rows count from the border.
    #[inline(always)]
    fn texel_row(&self, y: usize) -> (usize, f32) {
        blend::place(y, self.corner[1], self.step[1], self.level.size)
    }

    /// The column of texels to the left of the middle of a pixel, as [`Area::texel_row`].
    #[inline(always)]
    fn texel_column(&self, x: usize) -> (usize, f32) {
        blend::place(x, self.corner[0], self.step[0], self.level.size)
    }

    /// The columns in which a row of texels shows anything; some more at the edges.
    fn seen(&self, row: usize) -> std::ops::Range<usize> {
        let opaque = &self.level.opaque[row];
        if opaque.is_empty() {
            return self.columns.start..self.columns.start;
        }
        let pixel = |texel: f32| self.corner[0] + (texel - 1.0) / self.step[0];
        let first = (pixel(opaque.start as f32 - 1.0) - 1.0).max(0.0) as usize;
        let last = (pixel(opaque.end as f32 + 1.0) + 2.0).max(0.0) as usize;
        let first = first.clamp(self.columns.start, self.columns.end);
        first..last.clamp(first, self.columns.end)
    }
}

impl Level {
    /// A copy with a transparent border.
    fn of(texels: &[[f32; 4]]) -> Self {
        let size = texels.len().isqrt();
        let stride = size + 2;
        let mut wide = vec![[0.0; 4]; stride * stride];
        for (y, row) in texels.chunks_exact(size).enumerate() {
            let first = (y + 1) * stride + 1;
            wide[first..first + size].copy_from_slice(row);
        }
        let shows = |row: usize, column: usize| wide[row * stride + column][3] > 0.0;
        let range = |shows: &dyn Fn(usize) -> bool| {
            let first = (0..stride).find(|at| shows(*at)).unwrap_or(0);
            first..(0..stride).rfind(|at| shows(*at)).map_or(0, |at| at + 1)
        };
        let in_rows = |row: usize| range(&|column| shows(row, column) || shows(row + 1, column));
        #[cfg(target_arch = "x86_64")]
        let in_columns = |column: usize| {
            let rows = range(&|row| shows(row, column) || shows(row, column + 1));
            rows.start as u32..rows.end as u32
        };
        Self {
            size,
            opaque: (0..=size).map(in_rows).collect(),
            #[cfg(target_arch = "x86_64")]
            opaque_rows: (0..=size).map(in_columns).collect(),
            texels: wide,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::room::byte;
    use crate::simd::portably;
    use pdk_sdk::prelude::{FrameBuf, Key};

    /// The texels one by one, as the mathematics has it.
    fn drawn_plainly(picture: &Sprite, frame: &mut FrameMut<'_>, at: &Placement) {
        let area = Area::new(picture, frame.width(), frame.height(), at);
        let (haze, share) = at.haze;
        for y in area.rows.clone() {
            for x in area.columns.clone() {
                let texel = area.texel(x, y);
                let cover = texel[3] * area.opacity;
                if cover <= FAINTEST {
                    continue;
                }
                let pixel = &mut frame.row_mut(y)[x * 3..x * 3 + 3];
                for channel in 0..3 {
                    let own = area.opacity * at.tint[channel] * (1.0 - share);
                    let seen = texel[channel] * own + haze[channel] * share * cover;
                    let behind = f32::from(pixel[channel]);
                    pixel[channel] = byte(behind + seen - behind * cover);
                }
            }
        }
    }

    #[test]
    fn a_picture_is_its_texels_one_by_one() {
        let mut random = Key([8; 32]).sequence();
        let soft =
            Sprite::veil([10.0, 40.0, 90.0], |x, y| (1.0 - 4.0 * (x - 0.5) * (x - 0.5) - y * y).max(0.0));
        let ring = Sprite::drawn(|x, y| {
            let from_middle = x * x + (2.0 * y - 1.0) * (2.0 * y - 1.0);
            (0.3..0.9).contains(&from_middle).then_some([200.0 * y, 90.0, 120.0 + 60.0 * x])
        });
        let pictures = [soft, ring, Sprite::drawn(|x, _| (x.abs() < 0.2).then_some([255.0; 3]))];
        for _ in 0..300 {
            let [width, height] = [0.3, 0.3].map(|least| least + 90.0 * random.unit() * random.unit());
            let at = Placement {
                left: random.uniform(-60.0, 70.0) as f32,
                top: random.uniform(-60.0, 50.0) as f32,
                size: [width as f32, height as f32],
                depth: 9.0,
                opacity: random.unit() as f32,
                tint: [0.9, 1.1, random.unit() as f32],
                haze: ([200.0, 210.0, 220.0], random.unit() as f32),
                bottom: random.uniform(10.0, 90.0) as f32,
            };
            for picture in &pictures {
                let grey = || FrameBuf::from_vec(vec![99; 64 * 48 * 3], 64, 48).unwrap();
                let (mut fast, mut plain) = (grey(), grey());
                picture.draw(&mut fast.as_mut(), at);
                drawn_plainly(picture, &mut plain.as_mut(), &at);
                assert!(fast == plain, "{at:?}");
                let portable = portably(|| {
                    let mut portable = grey();
                    picture.draw(&mut portable.as_mut(), at);
                    portable
                });
                assert!(portable == plain, "{at:?}");
            }
        }
    }
}
