//! Draws a row of ground: the road with its markings, gravel and grass.

use crate::camera::Projection;
use crate::field::Place;
use crate::labels::Label;
use crate::light::Light;
use crate::places::{BLOCK, Block, Places};
use crate::scene::Scene;
use crate::section::{self, Section};
use crate::terrain::Strip;
use crate::texture::{Line, Scale, Texture};
use crate::view::View;

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

impl GroundRow {
    /// How far away it is along the optical axis, in metres.
    pub fn depth(&self, projection: &Projection) -> f32 {
        self.pixel_width * projection.focal as f32
    }
}

/// What the ground is drawn with.
pub struct Ground<'a> {
    pub scene: &'a Scene,
    pub texture: &'a Texture,
    pub section: &'a Section,
    pub projection: &'a Projection,
}

/// Room for one row of pixels.
#[derive(Debug)]
pub struct Room {
    /// 0, 1, 2 and so on.
    pub numbers: Vec<f32>,
    /// Red, green and blue of the surface.
    colours: [Vec<f32>; 3],
    /// How strongly the texture changes its brightness.
    rough: Vec<f32>,
    /// How much of it is meadow.
    meadow: Vec<f32>,
    /// Light of the headlights.
    beam: Vec<f32>,
    pub bytes: [Vec<u8>; 3],
    pub grain: Line,
    patches: Line,
}

impl Room {
    /// Room for rows of so many pixels.
    pub fn new(width: usize) -> Self {
        let room = || vec![0.0; width];
        Self {
            numbers: (0..width).map(|i| i as f32).collect(),
            colours: std::array::from_fn(|_| room()),
            rough: room(),
            meadow: room(),
            beam: room(),
            bytes: std::array::from_fn(|_| vec![0; width]),
            grain: Line::new(width),
            patches: Line::new(width),
        }
    }
}

impl Ground<'_> {
    /// Says what each pixel of a row shows in its middle.
    pub fn label(&self, view: &View, ground: &GroundRow, row: &mut [u8]) {
        let across = view.right.map(|r| r * ground.pixel_width);
        let left = 0.5 - self.projection.centre_x as f32;
        let start = [0, 1].map(|k| view.at[k] + view.ahead[k] * ground.ahead + across[k] * left);
        for (i, label) in row.iter_mut().enumerate() {
            let at = [0, 1].map(|k| start[k] + across[k] * i as f32);
            let place = self.scene.field.at(at[0], at[1]).filter(Place::is_near);
            let offset = place.map(|place| (place.lateral - section::ROAD_CENTRE as f32, place.along));
            *label = match offset {
                Some((offset, along)) if offset.abs() <= section::PAVED_HALF_WIDTH as f32 => {
                    match self.section.is_marking(offset, along) {
                        true => Label::Marking,
                        false => Label::Road,
                    }
                }
                _ => Label::Ground,
            }
            .number();
        }
    }

    /// Draws a row.
    #[inline(always)]
    pub fn draw(&self, view: &View, ground: &GroundRow, room: &mut Room, row: &mut [u8]) {
        let across = view.right.map(|r| r * ground.pixel_width);
        let along = view.ahead.map(|a| a * ground.pixel_depth);
        let left = 0.5 - self.projection.centre_x as f32;
        let start = [0, 1].map(|k| view.at[k] + view.ahead[k] * ground.ahead + across[k] * left);
        let light = &self.scene.light;
        let Room { numbers, colours, rough, meadow, beam, bytes, grain, patches } = room;
        let count = numbers.len();

        // The surface: grass, and where the road is near, what the section says.
        let grass = section::grass();
        for (channel, grass) in colours.iter_mut().zip(grass) {
            channel.fill(grass);
        }
        rough.fill(grass[3]);
        meadow.fill(1.0);
        let mut places = Places::new(&self.scene.field, start, across, ground.pixel_width);
        for first in (0..count).step_by(BLOCK) {
            let block = places.block(first);
            if matches!(block, Block::Away) {
                continue;
            }
            for i in first..(first + BLOCK).min(count) {
                let (x, z) = (start[0] + across[0] * numbers[i], start[1] + across[1] * numbers[i]);
                let Some(place) = block.at(&self.scene.field, i - first, x, z) else { continue };
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

        // Its texture.
        let grain = self.texture.fill(grain, numbers, (start, across), ground.grain);
        let patches = self.texture.fill(patches, numbers, (start, across), ground.patches);
        for i in 0..count {
            rough[i] = 1.0 + rough[i] * grain[i] * 1.6;
            meadow[i] *= patches[i];
        }

        // Light and air.
        beam.fill(0.0);
        if light.headlights > 0.0 {
            let (strength, half_width) = ground.beam;
            let scale = ground.pixel_width / half_width;
            for i in 0..count {
                let side = (numbers[i] + left) * scale;
                beam[i] = strength * (1.0 - side * side).max(0.0);
            }
        }
        let clear = 1.0 - ground.haze;
        for channel in 0..3 {
            let (colours, bytes) = (&colours[channel][..count], &mut bytes[channel][..count]);
            let (ambient, patch) = (light.ambient[channel], PATCH[channel]);
            let haze = light.haze[channel] * ground.haze;
            for i in 0..count {
                let colour = colours[i] * rough[i] + meadow[i] * patch;
                bytes[i] = byte(colour * ((ambient + beam[i]) * clear) + haze);
            }
        }
        interleave(bytes, row);
    }
}

/// Writes channels as pixels.
#[inline(always)]
pub fn interleave([red, green, blue]: &[Vec<u8>; 3], row: &mut [u8]) {
    for (((pixel, red), green), blue) in row.chunks_exact_mut(3).zip(red).zip(green).zip(blue) {
        pixel[0] = *red;
        pixel[1] = *green;
        pixel[2] = *blue;
    }
}

/// Rounds a value to a byte.
#[inline(always)]
pub fn byte(value: f32) -> u8 {
    // In a number just above 2^23 the lowest bits are those of the whole number added: faster than a conversion.
    (value.clamp(0.0, 255.0) + 8_388_608.0).to_bits() as u8
}
