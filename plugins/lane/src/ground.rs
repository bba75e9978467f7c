//! Draws a row of ground: the road with its markings, gravel and grass.

use crate::camera::Projection;
use crate::field::Place;
use crate::labels::Label;
use crate::light::Light;
use crate::places::{self, Line, RoadPlaces};
use crate::room::{Room, byte, interleave};
use crate::scene::Scene;
use crate::section::{self, Across, Section};
use crate::simd::{BLOCK, vectorised};
use crate::terrain::Strip;
use crate::texture::{Scale, Texture};
use crate::view::View;
use crate::weathered::{self, Weathered, WeatheredRow};

/// Texels a metre of the two layers of texture: grain everywhere, and patches in the grass.
const GRAIN: f32 = 30.0;
const PATCHES: f32 = 0.45;
/// What patches add to the colour of drawn grass.
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
    /// What it takes besides where the road is weathered.
    weathered: Option<WeatheredRow>,
}

impl GroundRow {
    /// The row that shows this strip.
    pub fn new(
        strip: Strip,
        texture: &Texture,
        damage: Option<&Texture>,
        light: &Light,
        projection: &Projection,
    ) -> Self {
        // Between the two extents of a pixel: with the larger one texture would vanish early, with the smaller one it
        // flickers.
        let footprint = (strip.pixel_width * strip.pixel_depth).sqrt() as f32;
        let ahead = strip.ahead as f32;
        let weathered =
            damage.map(|damage| WeatheredRow::new(&strip, texture, damage, light, projection.height));
        Self {
            ahead,
            pixel_width: strip.pixel_width as f32,
            pixel_depth: strip.pixel_depth as f32,
            haze: (MOST_HAZE * (1.0 - libm::exp(-strip.ahead.abs() / light.visibility))) as f32,
            grain: texture.scale(GRAIN, footprint),
            patches: texture.scale(PATCHES, footprint),
            beam: light.beam(ahead),
            weathered,
        }
    }

    /// How far away it is along the optical axis, in metres.
    pub fn depth(&self, projection: &Projection) -> f32 {
        self.pixel_width * projection.focal as f32
    }
}

/// What the ground is drawn with.
pub struct Ground<'a> {
    pub scene: &'a Scene,
    pub texture: &'a Texture,
    pub damage: &'a Texture,
    pub section: &'a Section,
    pub projection: &'a Projection,
}

impl Ground<'_> {
    /// Says what each pixel of a row shows in its middle.
    pub fn label(&self, view: &View, ground: &GroundRow, row: &mut [u8]) {
        let line = self.line(view, ground);
        for (i, label) in row.iter_mut().enumerate() {
            let at = line.at(i);
            let place = self.scene.field.at(at[0], at[1]).filter(Place::is_near);
            let offset = place.map(|place| (place.lateral - section::ROAD_CENTRE as f32, place.along));
            *label = match offset {
                Some((offset, along)) if offset.abs() <= section::PAVED_HALF_WIDTH as f32 => {
                    match self.section.is_marking(offset, along) && self.is_left(offset, along) {
                        true => Label::Marking,
                        false => Label::Road,
                    }
                }
                _ => Label::Ground,
            }
            .number();
        }
    }

    /// Whether more than half of the paint that was at a place of a marking is there still.
    fn is_left(&self, offset: f32, along: f32) -> bool {
        self.scene.wear.as_ref().is_none_or(|wear| weathered::left(wear, offset, along, 0.0) >= 0.5)
    }

    /// A row on the field's map.
    fn line(&self, view: &View, ground: &GroundRow) -> Line {
        let across = view.right.map(|r| r * ground.pixel_width);
        let left = 0.5 - self.projection.centre_x as f32;
        Line {
            start: [0, 1].map(|k| view.at[k] + view.ahead[k] * ground.ahead + across[k] * left),
            across,
            along: view.ahead.map(|a| a * ground.pixel_depth),
            pixel_width: ground.pixel_width,
        }
    }

    /// Draws a row.
    pub fn draw(&self, view: &View, ground: &GroundRow, room: &mut Room, row: &mut [u8]) {
        let line = self.line(view, ground);
        places::locate(&self.scene.field, &line, &mut room.asked, &mut room.places);

        // The surface: grass, and where the road is near, what the section says.
        let RoadPlaces { offset, wide, near, .. } = &room.places;
        let [red, green, blue] = room.colours.each_mut().map(Vec::as_mut_slice);
        self.section.fill(&Across { offset, wide, near }, [red, green, blue, &mut room.rough]);

        // Its texture.
        self.texture.fill(&mut room.grain, (line.start, line.across), ground.grain);
        self.texture.fill(&mut room.patches, (line.start, line.across), ground.patches);
        let light = &self.scene.light;
        let left = 0.5 - self.projection.centre_x as f32;
        let beam = (ground.beam, left, ground.pixel_width);
        match (&self.scene.wear, &ground.weathered) {
            (Some(wear), Some(row)) => {
                overgrow(offset, &mut room.meadow);
                light_up(beam, &room.numbers, &mut room.beam);
                self.texture.fill(&mut room.leaves, (line.start, line.across), row.leaves);
                let Self { section, damage, .. } = self;
                weathered::finish(&Weathered { section, damage, wear, light }, row, ground.haze, room);
            }
            _ => {
                let RoadPlaces { along, deep, .. } = &room.places;
                let mut blocks = [0; 2];
                find_middle(offset, wide, near, &mut blocks);
                let of = blocks[0] * BLOCK..blocks[1] * BLOCK;
                let [red, green, blue] = room.colours.each_mut().map(|colours| &mut colours[of.clone()]);
                let places = (&offset[of.clone()], &wide[of.clone()], &along[of.clone()], &deep[of]);
                let (offsets, wides, alongs, deeps) = places;
                paint_middle(self.section, offsets, wides, alongs, deeps, red, green, blue);
                let air = (light.haze.map(|haze| haze * ground.haze), 1.0 - ground.haze);
                let Room { colours: [red, green, blue], rough, grain, patches, numbers, .. } = room;
                let [reds, greens, blues] = &mut room.bytes;
                finish(
                    light.ambient,
                    air,
                    beam,
                    red,
                    green,
                    blue,
                    rough,
                    grain,
                    offset,
                    patches,
                    numbers,
                    reds,
                    greens,
                    blues,
                );
            }
        }
        interleave(&room.bytes, row);
    }
}

vectorised! {
    /// Finds the blocks from the first to behind the last that cover a part of the line in the middle of the road.
    fn find_middle / find_middle_avx2 / find_middle_avx512(offset: &[f32], wide: &[f32], near: &[bool], range: &mut [usize; 2]) {
        *range = [0; 2];
        let blocks = offset.as_chunks::<BLOCK>().0.iter().zip(wide.as_chunks::<BLOCK>().0);
        for (block, ((offsets, wides), near)) in blocks.zip(near).enumerate() {
            if *near && section::is_at_middle(offsets, wides) {
                *range = [if range[1] == 0 { block } else { range[0] }, block + 1];
            }
        }
    }
}

vectorised! {
    /// Paints the line in the middle of a drawn road.
    fn paint_middle / paint_middle_avx2 / paint_middle_avx512(
        section: &Section, offset: &[f32], wide: &[f32], along: &[f32], deep: &[f32], red: &mut [f32], green: &mut [f32],
        blue: &mut [f32],
    ) {
        let places = offset.iter().zip(wide).zip(along).zip(deep);
        let colours = red.iter_mut().zip(green).zip(blue);
        for ((((offset, wide), along), deep), ((red, green), blue)) in places.zip(colours) {
            let share = section.middle_line(*offset, *wide, *along, *deep);
            let share = if offset.abs() < section::HALF_WIDTH + 1.0 { share } else { 0.0 };
            for (colour, yellow) in [red, green, blue].into_iter().zip(section::YELLOW) {
                let painted = *colour + (yellow - *colour) * share;
                *colour = if share > 0.0 { painted } else { *colour };
            }
        }
    }
}

/// The light of the headlights at a pixel: of a beam with its strength and half its width, from the first pixel's distance to the
/// right of the optical axis in pixels, and the width of a pixel.
#[inline(always)]
fn headlights(((strength, half_width), left, pixel_width): ((f32, f32), f32, f32), number: f32) -> f32 {
    let side = (number + left) * (pixel_width / half_width);
    strength * (1.0 - side * side).max(0.0)
}

/// How much of a place is meadow, from how far to the right of the middle of the road it lies.
#[inline(always)]
fn meadow(offset: f32) -> f32 {
    (offset.abs() - section::PAVED_HALF_WIDTH as f32 - 0.2).clamp(0.0, 1.0)
}

vectorised! {
    /// Writes the light of the headlights along a row.
    fn light_up / light_up_avx2 / light_up_avx512(beam: ((f32, f32), f32, f32), numbers: &[f32], into: &mut [f32]) {
        for (light, number) in into.iter_mut().zip(numbers) {
            *light = headlights(beam, *number);
        }
    }
}

vectorised! {
    /// Writes how much of each place is meadow.
    fn overgrow / overgrow_avx2 / overgrow_avx512(offset: &[f32], into: &mut [f32]) {
        for (share, offset) in into.iter_mut().zip(offset) {
            *share = meadow(*offset);
        }
    }
}

vectorised! {
    /// A drawn row under light and air: roughened by the texture's grain, with patches in the meadow. `air` is its colour with its
    /// share in it, and the share of what lies behind.
    fn finish / finish_avx2 / finish_avx512(
        ambient: [f32; 3], air: ([f32; 3], f32), beam: ((f32, f32), f32, f32), red: &[f32], green: &[f32], blue: &[f32],
        rough: &[f32], grain: &[f32], offset: &[f32], patches: &[f32], numbers: &[f32], reds: &mut [u8], greens: &mut [u8],
        blues: &mut [u8],
    ) {
        let (haze, clear) = air;
        let count = reds.len();
        let (red, green, blue, rough) = (&red[..count], &green[..count], &blue[..count], &rough[..count]);
        let (grain, offset, patches) = (&grain[..count], &offset[..count], &patches[..count]);
        let (numbers, greens, blues) = (&numbers[..count], &mut greens[..count], &mut blues[..count]);
        for i in 0..count {
            let rough = 1.0 + rough[i] * grain[i] * 1.6;
            let patch = meadow(offset[i]) * patches[i];
            let beam = headlights(beam, numbers[i]);
            let lit = |colour: f32, channel: usize| {
                let colour = colour * rough + patch * PATCH[channel];
                byte(colour * ((ambient[channel] + beam) * clear) + haze[channel])
            };
            (reds[i], greens[i], blues[i]) = (lit(red[i], 0), lit(green[i], 1), lit(blue[i], 2));
        }
    }
}
