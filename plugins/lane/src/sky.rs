//! Draws a row of sky: its colour, clouds, the glow around the sun, and the hills on the horizon.

use crate::camera::Projection;
use crate::ground::byte;
use crate::light::Light;
use crate::places::BLOCK;
use crate::render::View;
use crate::scene::Scene;
use crate::texture::{Scale, Texture};

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
    hill_tops: Vec<[f32; 2]>,
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
        Self { columns, hill_tops: vec![[0.0; 2]; width], sun: None, horizon: 0.0 }
    }

    /// Turns towards a heading on a slope.
    pub fn look(&mut self, projection: &Projection, scene: &Scene, heading: f64, slope: f64) {
        self.horizon = projection.horizon_on(slope) as f32;
        let focal = projection.focal as f32;
        for (top, (angle, cosine)) in self.hill_tops.iter_mut().zip(&self.columns) {
            // Exact on the optical axis; the camera's small pitch is neglected beside it.
            *top =
                scene.hills_towards(heading + angle).map(|tangent| self.horizon - tangent / cosine * focal);
        }
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
    #[inline(always)]
    pub fn draw(
        &self,
        (view, projection): (&View, &Projection),
        (scene, texture): (&Scene, &Texture),
        (sky, y): (&SkyRow, f32),
        row: &mut [u8],
    ) {
        let left = 0.5 - projection.centre_x as f32;
        let light = &scene.light;
        for (number, pixels) in row.chunks_mut(3 * BLOCK).enumerate() {
            let first = number * BLOCK;
            let mut colours = [0, 1, 2].map(|c| [sky.colour[c]; BLOCK]);
            let mut tops = [[1e9f32; 2]; BLOCK];
            for (top, own) in tops.iter_mut().zip(&self.hill_tops[first..]) {
                *top = *own;
            }
            // Not where the near hills hide it anyway.
            if tops.iter().any(|top| y < top[1] + 1.0) {
                if sky.clouds > 0.0 {
                    let (mut x, mut z) = ([0.0; BLOCK], [0.0; BLOCK]);
                    for i in 0..BLOCK {
                        let to_right = sky.right * ((first + i) as f32 + left);
                        x[i] = view.ahead[0] * sky.ahead + view.right[0] * to_right;
                        z[i] = view.ahead[1] * sky.ahead + view.right[1] * to_right;
                    }
                    let density = texture.at(x, z, sky.scale);
                    for (channel, cloud) in colours.iter_mut().zip(light.cloud) {
                        for i in 0..BLOCK {
                            let cover = ((density[i] + light.cloudiness) * 1.6).clamp(0.0, 1.0) * sky.clouds;
                            channel[i] += (cloud - channel[i]) * cover;
                        }
                    }
                }
                if let (Some([column, sun_row, extent]), Some(glow)) = (self.sun, light.sun) {
                    let dy = y - sun_row;
                    for (channel, own) in colours.iter_mut().zip(glow.colour) {
                        for (i, value) in channel.iter_mut().enumerate() {
                            let dx = (first + i) as f32 + 0.5 - column;
                            *value += own * (extent / (extent + dx * dx + dy * dy));
                        }
                    }
                }
            }
            for (hill, colour) in light.hills.iter().enumerate() {
                if tops.iter().all(|top| y + 0.5 <= top[hill]) {
                    continue;
                }
                for i in 0..BLOCK {
                    let top = tops[i][hill];
                    let cover = (y + 0.5 - top).clamp(0.0, 1.0);
                    // Haze gathers at the foot of the hills.
                    let share = ((y - top) / (self.horizon - top + 1.0)).clamp(0.0, 1.0) * 0.45;
                    for channel in 0..3 {
                        let seen = colour[channel] + (light.haze[channel] - colour[channel]) * share;
                        colours[channel][i] += (seen - colours[channel][i]) * cover;
                    }
                }
            }
            for (i, pixel) in pixels.chunks_exact_mut(3).enumerate() {
                for channel in 0..3 {
                    pixel[channel] = byte(colours[channel][i]);
                }
            }
        }
    }
}
