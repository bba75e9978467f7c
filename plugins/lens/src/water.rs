//! Water on glass: a field of heights that drops and films are added to, and the scene refracted by it.
//!
//! A drop is a cap, `h = c R (1 - q)` with `q` a little more than the squared distance from the middle in radii. Where
//! caps meet they join smoothly, as drops do. The eye looks through the surface in a direction that depends on its slope
//! alone, so each drop shows the scene upside down and small, whatever its size.

use pdk_sdk::prelude::*;

use crate::lens::{Backdrop, Lens, to_byte};

/// Height of a drop in the middle, in radii.
const CAP: f32 = 0.5;
/// Height of a film in the middle, in half widths.
const FILM: f32 = 0.28;
/// Level of dry glass, far below everything.
const DRY: f32 = -1.0e6;
/// Drops that come nearer than this to each other join, in heights of the frame.
const JOIN: f32 = 0.004;
/// How far away the eye sees through a slope of 1, in heights of the frame.
const REFRACTION: f32 = 0.26;
/// How much stronger steep slopes refract than in proportion.
const STEEPNESS: f32 = 0.55;
/// The edge of the water is out of focus over this width, in heights of the frame, and over a pixel at least.
const EDGE: f32 = 0.0032;
/// The slope that reflects the sky brightest, down and to the right.
const SPOT: [f32; 2] = [0.29, 0.43];
/// Columns and rows of a tile, the unit in which the field is cleared and drawn.
const TILE: usize = 16;

/// A drop, in heights of the frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct Drop {
    pub x: f32,
    pub y: f32,
    pub radius: f32,
    /// How much longer than wide it is above its middle: 0 for a round drop.
    pub tail: f32,
    /// Departure from a circle: stretch along the diagonal and along the axes, and two of threefold symmetry.
    pub wobble: [f32; 4],
}

/// The water on the lens.
#[derive(Default)]
pub struct Water {
    width: usize,
    height: usize,
    unit: f32,
    /// Heights in pixels, with a border of one pixel around the frame.
    field: Vec<f32>,
    /// Tiles with water, row by row.
    wet: Vec<bool>,
}

impl Water {
    /// Dries the lens.
    pub fn clear(&mut self, lens: &Lens) {
        if (self.width, self.height) != (lens.width, lens.height) {
            (self.width, self.height) = (lens.width, lens.height);
            self.field.clear();
            self.field.resize((lens.width + 2) * (lens.height + 2), DRY);
            self.wet.clear();
            self.wet.resize(self.tile_columns() * (self.height + 2).div_ceil(TILE), false);
        }
        self.unit = lens.unit;
        let (columns, line) = (self.tile_columns(), self.width + 2);
        for (tile, wet) in self.wet.iter_mut().enumerate() {
            if std::mem::take(wet) {
                let (left, top) = (tile % columns * TILE, tile / columns * TILE);
                let right = (left + TILE).min(line);
                for y in top..(top + TILE).min(self.height + 2) {
                    self.field[y * line + left..y * line + right].fill(DRY);
                }
            }
        }
    }

    fn tile_columns(&self) -> usize {
        (self.width + 2).div_ceil(TILE)
    }

    /// The part of the field from `left` to `right` and `top` to `bottom`, in pixels of the frame, marked as wet: first
    /// and last column, first and last row of the field; nothing if it lies outside.
    fn wet(&mut self, left: f32, right: f32, top: f32, bottom: f32) -> Option<([usize; 2], [usize; 2])> {
        let clip = |low: f32, high: f32, count: usize| {
            // Also false for what is not a number.
            let inside = high >= -1.0 && low <= count as f32;
            let low = (low + 1.0).floor().max(0.0) as usize;
            let high = ((high + 1.0).ceil().max(0.0) as usize).min(count + 1);
            (inside && low <= high).then_some([low, high])
        };
        let (columns, rows) = (clip(left, right, self.width)?, clip(top, bottom, self.height)?);
        let across = self.tile_columns();
        for row in rows[0] / TILE..=rows[1] / TILE {
            self.wet[row * across + columns[0] / TILE..=row * across + columns[1] / TILE].fill(true);
        }
        Some((columns, rows))
    }

    /// Adds a drop.
    pub fn add(&mut self, lens: &Lens, drop: &Drop) {
        let radius = drop.radius * self.unit;
        if radius < 0.1 {
            return;
        }
        let (cx, cy) = lens.to_pixels(drop.x, drop.y);
        let join = (JOIN * self.unit).min(0.45 * CAP * radius).max(1e-3);
        let reach = 1.25 * radius + 1.5;
        let above = 1.25 * radius * (1.0 + drop.tail) + 1.5;
        let Some((columns, rows)) = self.wet(cx - reach, cx + reach, cy - above, cy + reach) else { return };
        // The rim of a drop of a few pixels reaches many radii out, where cubes would outgrow squares.
        let [diagonal, axes, three_u, three_v] = drop.wobble.map(|w| w * (0.25 * radius).min(1.0));
        let inverse = 1.0 / radius;
        let line = self.width + 2;
        for y in rows[0]..=rows[1] {
            let mut v = (y as f32 - 1.0 - cy) * inverse;
            let mut narrower = 1.0;
            if v < 0.0 {
                v /= 1.0 + drop.tail;
                narrower = 1.0 + 0.9 * drop.tail * v * v;
            }
            // The squared distance as a polynomial in `u`.
            let a0 = v * v * (1.0 - axes - three_v * v);
            let a1 = 2.0 * diagonal * v - 3.0 * three_u * v * v;
            let a2 = (1.0 + axes) * narrower + 3.0 * three_v * v;
            let row = &mut self.field[y * line + columns[0]..=y * line + columns[1]];
            let start = (columns[0] as f32 - 1.0 - cx) * inverse;
            raise(row, start, inverse, [a0, a1, a2, three_u], CAP * radius, join);
        }
    }

    /// Adds one row of a film: water of this half width, in heights of the frame, around `x` in the pixel row `y`.
    pub fn add_film_row(&mut self, lens: &Lens, y: usize, x: f32, half_width: f32) {
        let half = half_width * self.unit;
        let (cx, cy) = (lens.to_pixels(x, 0.0).0, y as f32);
        let Some((columns, _)) = self.wet(cx - half - 1.5, cx + half + 1.5, cy, cy) else { return };
        let start = (y + 1) * (self.width + 2);
        let row = &mut self.field[start + columns[0]..=start + columns[1]];
        let inverse = 1.0 / half.max(0.05);
        let join = (JOIN * self.unit * 0.3).max(1e-3);
        raise(
            row,
            (columns[0] as f32 - 1.0 - cx) * inverse,
            inverse,
            [0.0, 0.0, 1.0, 0.0],
            FILM * half,
            join,
        );
    }

    /// Whether there is none.
    pub fn is_dry(&self) -> bool {
        !self.wet.contains(&true)
    }

    /// Writes how opaque the water is, 0 to 255, into all channels of a frame. What is dry stays as it is.
    pub fn opacity(&self, mut dst: FrameMut<'_>) {
        let (columns, line) = (self.tile_columns(), self.width + 2);
        let opacity = 255.0 / (EDGE * self.unit).max(1.0);
        for tile in (0..self.wet.len()).filter(|&tile| self.wet[tile]) {
            let (left, top) = ((tile % columns * TILE).max(1), (tile / columns * TILE).max(1));
            let right = (tile % columns * TILE + TILE).min(self.width + 1);
            let bottom = (tile / columns * TILE + TILE).min(self.height + 1);
            for y in top..bottom {
                let depths = &self.field[y * line + left..y * line + right];
                let out = &mut dst.row_mut(y - 1)[(left - 1) * 3..(right - 1) * 3];
                for (out, depth) in out.chunks_exact_mut(3).zip(depths) {
                    out.fill(to_byte((depth * opacity).clamp(0.0, 255.0)));
                }
            }
        }
    }

    /// Draws the scene as seen through the water over `dst`, which holds the scene as seen through dry glass.
    pub fn refract(&self, mut dst: FrameMut<'_>, backdrop: &Backdrop) {
        let (columns, line) = (self.tile_columns(), self.width + 2);
        let look = Look {
            refraction: REFRACTION * self.unit,
            opacity: 1.0 / (EDGE * self.unit).max(1.0),
            light: 16.0 * backdrop.daylight() + 0.3 * backdrop.brightness(),
        };
        for tile in (0..self.wet.len()).filter(|&tile| self.wet[tile]) {
            // Columns and rows of the field; those of the frame are one less.
            let (left, top) = ((tile % columns * TILE).max(1), (tile / columns * TILE).max(1));
            let right = (tile % columns * TILE + TILE).min(self.width + 1);
            let bottom = (tile / columns * TILE + TILE).min(self.height + 1);
            for y in top..bottom {
                let row = |y: usize, shift: usize| {
                    let start = y * line + left + shift - 1;
                    &self.field[start..start + right - left]
                };
                let near = Near {
                    depth: row(y, 1),
                    left: row(y, 0),
                    right: row(y, 2),
                    above: row(y - 1, 1),
                    below: row(y + 1, 1),
                };
                let out = &mut dst.row_mut(y - 1)[(left - 1) * 3..(right - 1) * 3];
                look.draw(&near, ((left - 1) as f32, (y - 1) as f32), backdrop, out);
            }
        }
    }
}

/// Joins a row of the field with `peak * (1 - q)`, where `q` is a polynomial in `u = start + i * step`. Heights that
/// differ by less than `join` meet in a smooth curve.
#[inline(always)]
fn raise(row: &mut [f32], start: f32, step: f32, [a0, a1, a2, a3]: [f32; 4], peak: f32, join: f32) {
    let bend = 0.25 / join;
    for (i, height) in row.iter_mut().enumerate() {
        let u = start + i as i32 as f32 * step;
        let cap = peak * (1.0 - (((a3 * u + a2) * u + a1) * u + a0));
        let old = *height;
        let higher = if old > cap { old } else { cap };
        let near = join - (old - cap).abs();
        let near = if near > 0.0 { near } else { 0.0 };
        *height = higher + near * near * bend;
    }
}

/// How water looks.
struct Look {
    /// Pixels seen away through a slope of 1.
    refraction: f32,
    /// Opacity of a pixel of depth.
    opacity: f32,
    /// Brightness of highlights.
    light: f32,
}

/// The heights along a part of a row, at most as long as a tile, and those beside them.
struct Near<'a> {
    depth: &'a [f32],
    left: &'a [f32],
    right: &'a [f32],
    above: &'a [f32],
    below: &'a [f32],
}

/// The slope between two neighbours; if one is dry glass, that on the other side.
#[inline(always)]
fn slope(before: f32, depth: f32, after: f32) -> f32 {
    let (wet_before, wet_after) = (before > DRY, after > DRY);
    let before = if wet_before { before } else { depth };
    let after = if wet_after { after } else { depth };
    let slope = (after - before) * if wet_before & wet_after { 0.5 } else { 1.0 };
    slope.clamp(-1.2, 1.2)
}

impl Look {
    /// Draws a part of a row that starts at the place `(x, y)`.
    #[inline(always)]
    fn draw(&self, near: &Near<'_>, (x, y): (f32, f32), backdrop: &Backdrop, out: &mut [u8]) {
        let count = near.depth.len().min(TILE);
        if near.depth.iter().all(|&depth| depth <= 0.0) {
            return;
        }
        let [mut alpha, mut across, mut down, mut shade, mut light] = [[0.0f32; TILE]; 5];
        let (depth, left, right) = (&near.depth[..count], &near.left[..count], &near.right[..count]);
        let (above, below) = (&near.above[..count], &near.below[..count]);
        for i in 0..count {
            let (sx, sy) = (slope(left[i], depth[i], right[i]), slope(above[i], depth[i], below[i]));
            let steep = (sx * sx + sy * sy) * (1.0 / (4.0 * CAP * CAP));
            let bend = self.refraction * (1.0 + STEEPNESS * steep);
            (across[i], down[i]) = (x + i as i32 as f32 + sx * bend, y + sy * bend);
            // Light from the side hardly comes through the steep rim.
            shade[i] = 1.02 - 0.34 * (steep * steep).min(1.6);
            // A soft spot where the surface faces the sky, on the upper left.
            let (dx, dy) = (sx - SPOT[0], sy - SPOT[1]);
            let spot = (1.0 - (dx * dx + dy * dy) * 28.0).max(0.0);
            light[i] = self.light * spot * spot;
            alpha[i] = (depth[i] * self.opacity).clamp(0.0, 1.0);
        }
        for (i, out) in out.chunks_exact_mut(3).enumerate().take(count) {
            if alpha[i] > 0.0 {
                let seen = backdrop.at(across[i], down[i]);
                for (channel, out) in out.iter_mut().enumerate() {
                    let behind = f32::from(*out);
                    let colour = seen[channel] * shade[i] + light[i];
                    *out = to_byte(behind + alpha[i] * (colour - behind));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame that is dark above and bright below, red on the left and blue on the right.
    fn scene() -> FrameBuf {
        let mut frame = FrameBuf::new(240, 240);
        for (x, y) in (0..240 * 240).map(|i| (i % 240, i / 240)) {
            frame.as_mut().set_pixel(x, y, [(240 - x) as u8, y as u8, x as u8]);
        }
        frame
    }

    fn drawn(add: impl FnOnce(&mut Water, &Lens)) -> FrameBuf {
        let mut frame = scene();
        let lens = Lens::of(frame.as_ref());
        let (mut water, mut backdrop) = (Water::default(), Backdrop::default());
        water.clear(&lens);
        add(&mut water, &lens);
        backdrop.update(scene().as_ref(), &lens);
        water.refract(frame.as_mut(), &backdrop);
        frame
    }

    /// A round drop in the middle of the frame.
    const DROP: Drop = Drop { x: 0.0, y: 0.5, radius: 0.1, tail: 0.0, wobble: [0.0; 4] };

    #[test]
    fn a_drop_shows_the_scene_upside_down_and_the_wrong_way_round() {
        let frame = drawn(|water, lens| water.add(lens, &DROP));
        let at = |x: usize, y: usize| frame.as_ref().pixel(x, y).map(i32::from);
        // Half a radius from the middle the view is half of the refraction away, on the other side.
        let seen = (0.5 * REFRACTION * 240.0) as i32;
        assert!((at(120, 132)[1] - (132 - seen)).abs() < 16, "{:?}", at(120, 132));
        assert!((at(132, 120)[2] - (132 - seen)).abs() < 16, "{:?}", at(132, 120));
        assert!(at(120, 110)[1] > at(120, 130)[1] + 20 && at(110, 120)[2] > at(130, 120)[2] + 20);
        // Nothing beyond the rim has changed, and everything well inside it has been looked through.
        let scene = scene();
        for (x, y) in (0..240 * 240).map(|i| (i % 240, i / 240)) {
            let far = libm::hypotf(x as f32 - 119.5, y as f32 - 119.5);
            if far > 25.0 {
                assert_eq!(frame.as_ref().pixel(x, y), scene.as_ref().pixel(x, y), "{x} {y}");
            }
        }
        let changed = frame.data().chunks(3).zip(scene.data().chunks(3)).filter(|(a, b)| a != b).count();
        assert!((changed as f32 / (std::f32::consts::PI * 24.0 * 24.0) - 1.0).abs() < 0.06, "{changed}");
    }

    #[test]
    fn near_drops_join_and_distant_ones_do_not() {
        let bridge = |apart: f32| {
            let mut depth = 0.0;
            drawn(|water, lens| {
                water.add(lens, &Drop { x: -apart, ..DROP });
                water.add(lens, &Drop { x: apart, ..DROP });
                depth = water.field[121 * 242 + 121];
            });
            depth
        };
        assert!(bridge(0.102) > bridge(0.115) && bridge(0.115) < 0.0);
        assert!(bridge(0.08) > 0.0);
    }

    #[test]
    fn a_film_bends_the_view_less_than_a_drop() {
        let film = drawn(|water, lens| (60..180).for_each(|y| water.add_film_row(lens, y, 0.0, 0.04)));
        let changed = |frame: &FrameBuf, y: usize| {
            let row = frame.as_ref().row(y).iter().zip(scene().as_ref().row(y).to_vec());
            row.map(|(a, b)| u32::from(a.abs_diff(b))).max()
        };
        assert_eq!((changed(&film, 50), changed(&film, 190)), (Some(0), Some(0)));
        let drop = drawn(|water, lens| water.add(lens, &DROP));
        assert!(changed(&film, 120) > Some(8) && changed(&film, 120) < changed(&drop, 120));
    }

    #[test]
    fn clearing_dries_the_lens_at_any_size() {
        let mut water = Water::default();
        for (width, height) in [(240, 240), (17, 90), (1, 1), (240, 240)] {
            let frame = FrameBuf::new(width, height);
            let lens = Lens::of(frame.as_ref());
            for i in -3..30 {
                water.clear(&lens);
                assert!(water.field.iter().all(|&h| h == DRY) && !water.wet.contains(&true));
                water.add(&lens, &Drop { x: i as f32 * 0.05, y: i as f32 * 0.04, ..DROP });
                water.add(&lens, &Drop { radius: 4.0 / lens.unit, tail: 1.3, wobble: [0.15; 4], ..DROP });
            }
        }
    }

    #[test]
    fn drops_of_any_size_stay_within_their_rims() {
        for radius in [0.3f32, 0.5, 0.9, 1.4, 2.0, 3.1, 4.7, 9.0] {
            for wobble in [[0.15, 0.16, 0.09, 0.04], [-0.15, -0.08, -0.09, -0.09]] {
                let drop = Drop { radius: radius / 240.0, wobble, tail: 1.3, ..DROP };
                drawn(|water, lens| {
                    water.add(lens, &drop);
                    for (i, &depth) in water.field.iter().enumerate().filter(|(_, depth)| **depth > 0.0) {
                        let (x, y) = ((i % 242) as f32 - 120.5, (i / 242) as f32 - 120.5);
                        let far = libm::hypotf(x, y) / radius;
                        assert!(far < 2.8 && depth <= CAP * radius * 1.01, "{far} radii out at {radius}");
                    }
                });
            }
        }
    }
}
