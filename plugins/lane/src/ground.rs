//! Draws a row of ground: the road with its markings, gravel and grass.

use crate::camera::Projection;
use crate::light::Light;
use crate::places::{BLOCK, Block, Places};
use crate::render::View;
use crate::scene::Scene;
use crate::section::{self, Section};
use crate::terrain::Strip;
use crate::texture::{Scale, Texture};

/// Texels a metre of the two layers of texture: grain everywhere, and patches in the grass.
const GRAIN: f32 = 30.0;
const PATCHES: f32 = 0.45;
/// What patches add to the colour of grass.
const PATCH: [f32; 3] = [24.0, 13.0, -2.0];
/// The share of the air's colour that no distance exceeds.
const MOST_HAZE: f64 = 0.9;

/// A row of ground, prepared.
#[derive(Debug, Clone, Copy)]
pub struct GroundRow {
    ahead: f32,
    pixel_width: f32,
    pixel_depth: f32,
    haze: f32,
    grain: Scale,
    patches: Scale,
    /// Light of the headlights where they shine brightest, and half the width of their beam in metres.
    beam: (f32, f32),
}

impl GroundRow {
    /// The row that shows this strip.
    pub fn new(strip: Strip, texture: &Texture, light: &Light) -> Self {
        // Between the two extents of a pixel: with the larger one texture would vanish early, with the smaller one it
        // flickers.
        let footprint = (strip.pixel_width * strip.pixel_depth).sqrt() as f32;
        let ahead = strip.ahead as f32;
        // Brightest some metres ahead, then fading.
        let reach = 1.0 / (1.0 + (ahead / 16.0) * (ahead / 16.0));
        let rise = (ahead / 4.0).min(1.0);
        Self {
            ahead,
            pixel_width: strip.pixel_width as f32,
            pixel_depth: strip.pixel_depth as f32,
            haze: (MOST_HAZE * (1.0 - libm::exp(-strip.ahead.abs() / light.visibility))) as f32,
            grain: texture.scale(GRAIN, footprint),
            patches: texture.scale(PATCHES, footprint),
            beam: (light.headlights * reach * rise, 1.6 + 0.28 * ahead),
        }
    }
}

/// What the ground is drawn with.
pub struct Ground<'a> {
    pub scene: &'a Scene,
    pub texture: &'a Texture,
    pub section: &'a Section,
    pub projection: &'a Projection,
}

impl Ground<'_> {
    /// Draws a row.
    #[inline(always)]
    pub fn draw(&self, view: &View, ground: &GroundRow, row: &mut [u8]) {
        let across = view.right.map(|r| r * ground.pixel_width);
        let along = view.ahead.map(|a| a * ground.pixel_depth);
        let left = 0.5 - self.projection.centre_x as f32;
        let start = [0, 1].map(|k| view.at[k] + view.ahead[k] * ground.ahead + across[k] * left);
        let mut places = Places::new(&self.scene.field, start, across, ground.pixel_width);
        let light = &self.scene.light;
        let clear = 1.0 - ground.haze;
        let haze = light.haze.map(|c| c * ground.haze);
        let grass = section::grass();
        for (number, pixels) in row.chunks_mut(3 * BLOCK).enumerate() {
            let first = number * BLOCK;
            let (mut x, mut z) = ([0.0; BLOCK], [0.0; BLOCK]);
            for i in 0..BLOCK {
                let pixel = (first + i) as f32;
                x[i] = start[0] + across[0] * pixel;
                z[i] = start[1] + across[1] * pixel;
            }
            let mut colours = [[grass[0]; BLOCK], [grass[1]; BLOCK], [grass[2]; BLOCK]];
            let mut rough = [grass[3]; BLOCK];
            let mut meadow = [1.0f32; BLOCK];
            let block = places.block(first);
            if !matches!(block, Block::Away) {
                for i in 0..BLOCK {
                    let Some(place) = block.at(&self.scene.field, i, x[i], z[i]) else { continue };
                    let offset = place.lateral - section::ROAD_CENTRE as f32;
                    if offset.abs() < section::HALF_WIDTH + 1.0 {
                        let [gx, gz] = place.gradient;
                        // How far the pixel extends across the road, and along it.
                        let extent = |x: f32, z: f32| {
                            (x * across[0] + z * across[1]).abs() + (x * along[0] + z * along[1]).abs()
                        };
                        let [r, g, b, texture] =
                            self.section.ground(offset, extent(gx, gz), place.along, extent(gz, -gx));
                        (colours[0][i], colours[1][i], colours[2][i], rough[i]) = (r, g, b, texture);
                        meadow[i] = (offset.abs() - section::PAVED_HALF_WIDTH as f32 - 0.2).clamp(0.0, 1.0);
                    }
                }
            }
            let grain = self.texture.at(x, z, ground.grain);
            let mut patches = [0.0; BLOCK];
            if meadow.iter().any(|&share| share > 0.0) {
                patches = self.texture.at(x, z, ground.patches);
            }
            let (mut detail, mut patch) = ([0.0f32; BLOCK], [0.0f32; BLOCK]);
            for i in 0..BLOCK {
                detail[i] = 1.0 + rough[i] * grain[i] * 1.6;
                patch[i] = patches[i] * meadow[i];
            }
            let mut beam = [0.0; BLOCK];
            if light.headlights > 0.0 {
                for (i, beam) in beam.iter_mut().enumerate() {
                    let side = ((first + i) as f32 + left) * ground.pixel_width / ground.beam.1;
                    *beam = ground.beam.0 * (1.0 - side * side).max(0.0);
                }
            }
            let mut bytes = [[0u8; BLOCK]; 3];
            for channel in 0..3 {
                for i in 0..BLOCK {
                    let lit = (light.ambient[channel] + beam[i]) * clear;
                    let colour = colours[channel][i] * detail[i] + patch[i] * PATCH[channel];
                    bytes[channel][i] = byte(colour * lit + haze[channel]);
                }
            }
            for (i, pixel) in pixels.chunks_exact_mut(3).enumerate() {
                for channel in 0..3 {
                    pixel[channel] = bytes[channel][i];
                }
            }
        }
    }
}

/// Rounds a value to a byte.
#[inline(always)]
pub fn byte(value: f32) -> u8 {
    // In a number just above 2^23 the lowest bits are those of the whole number added: faster than a conversion.
    (value.clamp(0.0, 255.0) + 8_388_608.0).to_bits() as u8
}
