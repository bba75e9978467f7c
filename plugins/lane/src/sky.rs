//! Draws a row of sky: its colour, clouds, the glow around the sun, and the hills on the horizon.

use crate::camera::Projection;
use crate::light::Light;
use crate::room::{Room, interleave, to_bytes};
use crate::scene::Scene;
use crate::simd::vectorised;
use crate::texture::{Scale, Texture};
use crate::view::View;

/// A row of sky, prepared.
#[derive(Debug, Clone, Copy)]
pub struct SkyRow {
    colour: [f32; 3],
    clouds: f32,
    right: f32,
    ahead: f32,
    scale: Scale,
}

impl SkyRow {
    /// Row `y` (0.5 in the middle of the first one) of a camera on a slope.
    pub fn new(projection: &Projection, texture: &Texture, light: &Light, y: f64, slope: f64) -> Self {
        let elevation = (projection.elevation(y) + slope).max(0.0);
        // The colour overhead grows quickly above the horizon and slowly further up.
        let share = (1.0 - libm::exp(-elevation * 4.5)) as f32;
        let colour = [0, 1, 2].map(|c| light.haze[c] + (light.zenith[c] - light.haze[c]) * share);
        // Clouds lie on a plane one unit up; a unit is as far as the plane is high.
        let ahead = 1.0 / elevation.max(0.01);
        let slant = (1.0 + elevation * elevation).sqrt() / elevation.max(0.01);
        let pixel_width = slant / projection.focal;
        let footprint = pixel_width * slant.sqrt();
        let clouds = ((elevation - 0.04) / 0.25).clamp(0.0, 1.0) * 0.8;
        Self {
            colour,
            clouds: clouds as f32,
            right: pixel_width as f32,
            ahead: ahead as f32,
            scale: texture.scale(7.0, footprint as f32),
        }
    }
}

/// What the sky of a frame is drawn with.
#[derive(Debug)]
pub struct Sky {
    /// Angle of each column to the right of the optical axis in radians, with its cosine.
    columns: Vec<(f64, f32)>,
    /// The rows on which the far and the near hills begin, by column.
    hill_tops: [Vec<f32>; 2],
    /// The highest and the lowest of these rows, counted from the frame's upper edge: the least and the greatest number.
    hill_ranges: [(f32, f32); 2],
    /// Red, green and blue of the row at hand.
    colours: [Vec<f32>; 3],
    /// Column and row of the sun, and the square of the extent of its glow in pixels, where it is before the camera.
    sun: Option<[f32; 3]>,
    horizon: f32,
}

impl Sky {
    /// The sky for a camera.
    pub fn new(projection: &Projection, width: usize) -> Self {
        let columns = (0..width)
            .map(|x| {
                let angle = libm::atan((x as f64 + 0.5 - projection.centre_x) / projection.focal);
                (angle, libm::cos(angle) as f32)
            })
            .collect();
        let room = || vec![0.0; width];
        Self {
            columns,
            hill_tops: [room(), room()],
            hill_ranges: [(0.0, 0.0); 2],
            colours: [room(), room(), room()],
            sun: None,
            horizon: 0.0,
        }
    }

    /// Turns towards a heading on a slope.
    pub fn look(&mut self, projection: &Projection, scene: &Scene, heading: f64, slope: f64) {
        self.horizon = projection.horizon_on(slope) as f32;
        let focal = projection.focal as f32;
        for (i, (angle, cosine)) in self.columns.iter().enumerate() {
            // Exact on the optical axis; the camera's small pitch is neglected beside it.
            let tangents = scene.hills_towards(heading + angle);
            for (tops, tangent) in self.hill_tops.iter_mut().zip(tangents) {
                tops[i] = self.horizon - tangent / cosine * focal;
            }
        }
        self.hill_ranges = self.hill_tops.each_ref().map(|tops| {
            let ends = (f32::INFINITY, f32::NEG_INFINITY);
            tops.iter().fold(ends, |(least, greatest), top| (least.min(*top), greatest.max(*top)))
        });
        self.sun = None;
        if let (Some(sun), Some(glow)) = (scene.sun, scene.light.sun) {
            let (sine, cosine) = (libm::sin(sun.heading - heading), libm::cos(sun.heading - heading));
            if cosine > 0.2 {
                let column = projection.centre_x + projection.focal * sine / cosine;
                let row = projection.horizon_on(slope - sun.elevation / cosine);
                let extent = glow.extent * focal;
                self.sun = Some([column as f32, row as f32, extent * extent]);
            }
        }
    }

    /// Draws row `y` (0.5 in the middle of the first one).
    pub fn draw(
        &mut self,
        (view, projection): (&View, &Projection),
        (scene, texture): (&Scene, &Texture),
        (sky, y): (&SkyRow, f32),
        room: &mut Room,
        row: &mut [u8],
    ) {
        let left = 0.5 - projection.centre_x as f32;
        let light = &scene.light;
        let colours = &mut self.colours;
        for (channel, colour) in colours.iter_mut().zip(sky.colour) {
            fill(channel, colour);
        }
        // Not where the near hills hide it anyway.
        let open = y < self.hill_ranges[1].1 + 1.0;
        if open && sky.clouds > 0.0 {
            let start = [0, 1].map(|k| view.ahead[k] * sky.ahead + view.right[k] * (sky.right * left));
            let step = view.right.map(|r| r * sky.right);
            texture.fill(&mut room.grain, (start, step), sky.scale);
            for (channel, cloud) in colours.iter_mut().zip(light.cloud) {
                cover_by_clouds(channel, &room.grain, cloud, (light.cloudiness, sky.clouds));
            }
        }
        if let (true, Some(sun), Some(glow)) = (open, self.sun, light.sun) {
            for (channel, own) in colours.iter_mut().zip(glow.colour) {
                add_glow(channel, &room.numbers, own, sun, y);
            }
        }
        for ((tops, (first, _)), colour) in self.hill_tops.iter().zip(self.hill_ranges).zip(light.hills) {
            if y + 0.5 <= first {
                continue;
            }
            let [red, green, blue] = &mut *colours;
            cover_by_hills(red, green, blue, tops, (colour, light.haze), self.horizon, y);
        }
        for (bytes, colours) in room.bytes.iter_mut().zip(&self.colours) {
            to_bytes(colours, bytes);
        }
        interleave(&room.bytes, row);
    }
}

vectorised! {
    fn fill / fill_avx2 / fill_avx512(values: &mut [f32], value: f32) {
        values.fill(value);
    }
}

vectorised! {
    fn cover_by_clouds / cover_by_clouds_avx2 / cover_by_clouds_avx512(values: &mut [f32], density: &[f32], cloud: f32, most: (f32, f32)) {
        let (cloudiness, clouds) = most;
        for (value, density) in values.iter_mut().zip(density) {
            let cover = ((density + cloudiness) * 1.6).clamp(0.0, 1.0) * clouds;
            *value += (cloud - *value) * cover;
        }
    }
}

vectorised! {
    /// `sun` is its column and row, and the square of the extent of its glow.
    fn add_glow / add_glow_avx2 / add_glow_avx512(values: &mut [f32], numbers: &[f32], colour: f32, sun: [f32; 3], y: f32) {
        let [column, row, extent] = sun;
        let dy = y - row;
        for (value, number) in values.iter_mut().zip(numbers) {
            let dx = number + 0.5 - column;
            *value += colour * (extent / (extent + dx * dx + dy * dy));
        }
    }
}

vectorised! {
    /// `air` is the colour of the hills and that of the air before them.
    fn cover_by_hills / cover_by_hills_avx2 / cover_by_hills_avx512(
        red: &mut [f32], green: &mut [f32], blue: &mut [f32], tops: &[f32], air: ([f32; 3], [f32; 3]), horizon: f32, y: f32,
    ) {
        let (hill, haze) = air;
        for (((red, green), blue), top) in red.iter_mut().zip(green).zip(blue).zip(tops) {
            let cover = (y + 0.5 - top).clamp(0.0, 1.0);
            // Haze gathers at the foot of the hills.
            let share = ((y - top) / (horizon - top + 1.0)).clamp(0.0, 1.0) * 0.45;
            for (channel, value) in [red, green, blue].into_iter().enumerate() {
                let seen = hill[channel] + (haze[channel] - hill[channel]) * share;
                *value += (seen - *value) * cover;
            }
        }
    }
}
