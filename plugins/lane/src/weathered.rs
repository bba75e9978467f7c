//! Finishes a row of ground as cameras see it: damaged asphalt, worn paint, shadows of trees, and a film of water.

use crate::damage;
use crate::light::Light;
use crate::places::RoadPlaces;
use crate::room::{Room, byte};
use crate::section::{self, Section};
use crate::simd::{BLOCK, vectorised};
use crate::terrain::Strip;
use crate::texture::{Scale, Texture};
use crate::wear::{Line, Wear};

/// Colours of fresh paint: a camera that exposes for the road never sees it as bright as paper.
const WHITE: [f32; 3] = [214.0, 212.0, 204.0];
const YELLOW: [f32; 3] = [206.0, 158.0, 58.0];
/// What patches, and tufts, add to the colour of grass.
const PATCH: [f32; 3] = [34.0, 17.0, 4.0];
const TUFT: [f32; 3] = [17.0, 15.0, 8.0];
/// The share of the sun's light in all light, by channel: shadows are bluish.
const SUN_SHARE: [f32; 3] = [0.68, 0.63, 0.53];
/// How much darker wet asphalt is, and the share of the sky that the roughness of a road swallows.
const WET_DARKER: f32 = 0.45;
const SWALLOWED: f32 = 0.3;

/// Texels a metre of the texture of what is as large as leaves and tufts.
const LEAVES: f32 = 3.2;

/// A row of weathered ground, prepared.
#[derive(Debug, Clone, Copy)]
pub struct WeatheredRow {
    /// How to read the texture of what is as large as leaves.
    pub leaves: Scale,
    /// How to read the picture of damage.
    damage: Scale,
    /// What a wet road shows of the sky there, and how much of it where it is a mirror.
    mirrored: ([f32; 3], f32),
}

impl WeatheredRow {
    /// The row that shows this strip to a camera so high above the road.
    pub fn new(strip: &Strip, texture: &Texture, damage: &Texture, light: &Light, height: f64) -> Self {
        let area = strip.pixel_width * strip.pixel_depth;
        // On the road's damage a texel is longer than wide, as a pixel is.
        let on_damage = (area as f32 / damage::STRETCH).sqrt();
        Self {
            leaves: texture.scale(LEAVES, area.sqrt() as f32),
            damage: damage.scale(damage::ACROSS, on_damage),
            mirrored: mirrored(light, strip.ahead, height),
        }
    }
}

/// What weathered ground is drawn with.
pub struct Weathered<'a> {
    /// The road without paint.
    pub section: &'a Section,
    /// The picture of damage.
    pub damage: &'a Texture,
    /// The state of the road.
    pub wear: &'a Wear,
    pub light: &'a Light,
}

/// What a mirror on the ground so far ahead shows of the sky, and how much of it, where water has a refractive index of 1.33.
fn mirrored(light: &Light, ahead: f64, height: f64) -> ([f32; 3], f32) {
    let ahead = ahead.max(0.1);
    let sine = height / (ahead * ahead + height * height).sqrt();
    let grazing = 1.0 - sine;
    // Schlick, "An inexpensive BRDF model for physically-based rendering" (1994).
    let share = 0.02 + 0.98 * grazing * grazing * grazing * grazing * grazing;
    let up = (1.0 - libm::exp(-height / ahead * 4.5)) as f32;
    let sky = [0, 1, 2].map(|c| light.haze[c] + (light.zenith[c] - light.haze[c]) * up);
    (sky, share as f32)
}

/// What is left of the paint at a place of a marking, from 0 to 1.
#[inline(always)]
pub fn left(wear: &Wear, offset: f32, along: f32, texture: f32) -> f32 {
    let line = match offset {
        offset if offset.abs() < section::EDGE_LINE as f32 / 2.0 => Line::Middle,
        offset if offset < 0.0 => Line::Left,
        _ => Line::Right,
    };
    Wear::left(wear.at(line, along), texture)
}

/// Finishes a row whose surface and textures have been computed. `haze` is the share of the air's colour.
pub fn finish(ground: &Weathered<'_>, row: &WeatheredRow, haze: f32, room: &mut Room) {
    let Weathered { wear, light, .. } = *ground;
    let near = &room.places.near;
    let first = near.iter().position(|near| *near).unwrap_or(near.len()) * BLOCK;
    let last = near.iter().rposition(|near| *near).map_or(first, |block| (block + 1) * BLOCK);
    if first < last {
        damage_asphalt(ground, row, room, first..last);
        paint(ground, room, first / BLOCK..last / BLOCK);
    }
    room.sun.fill(1.0);
    room.gloss.fill(0.0);
    if first < last {
        let range = first..last;
        let (shade, offset) = (&room.places.shade[range.clone()], &room.places.offset[range.clone()]);
        let (leaves, patches) = (&room.leaves[range.clone()], &room.patches[range.clone()]);
        if light.shadow > 0.0 {
            shadow(shade, leaves, &mut room.sun[range.clone()]);
        }
        if wear.wetness > 0.0 {
            let wide = &room.places.wide[range.clone()];
            let mirror = row.mirrored.1 * (1.0 - SWALLOWED);
            let [red, green, blue] = room.colours.each_mut().map(|colours| &mut colours[range.clone()]);
            wet(wear.wetness, mirror, offset, wide, patches, [red, green, blue], &mut room.gloss[range]);
        }
    }
    let rough = &mut room.rough;
    roughen(rough, &room.grain);
    let (mirrored, clear) = (row.mirrored.0, 1.0 - haze);
    for channel in 0..3 {
        let light = Channel {
            patch: PATCH[channel],
            tuft: TUFT[channel],
            ambient: light.ambient[channel],
            sun: SUN_SHARE[channel] * if light.shadow > 0.0 { 1.0 } else { 0.0 },
            clear,
            haze: light.haze[channel] * haze,
            mirrored: mirrored[channel],
        };
        let Room { colours, rough, meadow, patches, leaves, beam, sun, gloss, bytes, .. } = room;
        let surface =
            Surface { colours: &colours[channel], rough, meadow, patches, leaves, beam, sun, gloss };
        light_channel(&surface, &light, &mut bytes[channel]);
    }
}

fn damage_asphalt(
    ground: &Weathered<'_>,
    row: &WeatheredRow,
    room: &mut Room,
    range: std::ops::Range<usize>,
) {
    let wear = ground.wear;
    if wear.damage <= 0.0 {
        return;
    }
    let RoadPlaces { offset, along, wide, .. } = &room.places;
    let (offset, along, wide) = (&offset[range.clone()], &along[range.clone()], &wide[range.clone()]);
    let damage = &mut room.damage[range.clone()];
    ground.damage.fill_at(damage, (offset, along), wear.shift, damage::STRETCH, row.damage);
    let [red, green, blue] = room.colours.each_mut().map(|colours| &mut colours[range.clone()]);
    darken(wear.damage, damage, offset, wide, [red, green, blue]);
}

vectorised! {
    /// Paints the lines, as far as they are there.
    fn paint / paint_avx2 / paint_avx512(ground: &Weathered<'_>, room: &mut Room, blocks: std::ops::Range<usize>) {
        let RoadPlaces { offset, along, wide, deep, .. } = &room.places;
        for block in blocks {
            let (offsets, wides) = (offset.as_chunks::<BLOCK>().0, wide.as_chunks::<BLOCK>().0);
            let (offsets, wides) = (&offsets[block], &wides[block]);
            if !section::is_at_middle(offsets, wides) && !section::is_at_edge(offsets, wides) {
                continue;
            }
            for i in block * BLOCK..(block + 1) * BLOCK {
                let offset = offset[i];
                if offset.abs() >= section::HALF_WIDTH + 1.0 {
                    continue;
                }
                let edge = ground.section.edge_line(offset, wide[i]);
                let middle = match offset.abs() < section::LINE_WIDTH as f32 / 2.0 + wide[i] {
                    true => ground.section.middle_line(offset, wide[i], along[i], deep[i]),
                    // `middle_line` would return 0 too, after more work.
                    false => 0.0,
                };
                let (share, colour) = if edge > middle { (edge, WHITE) } else { (middle, YELLOW) };
                if share > 0.0 {
                    let texture = 0.7 * room.grain[i] + 0.8 * room.leaves[i];
                    let share = share * left(ground.wear, offset, along[i], texture);
                    for (colours, paint) in room.colours.iter_mut().zip(colour) {
                        colours[i] += (paint - colours[i]) * share;
                    }
                }
            }
        }
    }
}

/// The share of a pixel that is asphalt.
#[inline(always)]
fn asphalt(offset: f32, wide: f32) -> f32 {
    ((section::PAVED_HALF_WIDTH as f32 - offset.abs()) / wide.max(0.01) + 0.5).clamp(0.0, 1.0)
}

vectorised! {
    /// Changes the brightness of asphalt by its damage.
    fn darken / darken_avx2 / darken_avx512(
        strength: f32, damage: &[f32], offset: &[f32], wide: &[f32], colours: [&mut [f32]; 3],
    ) {
        let [red, green, blue] = colours;
        let colours = red.iter_mut().zip(green).zip(blue);
        for ((((red, green), blue), damage), (offset, wide)) in
            colours.zip(damage).zip(offset.iter().zip(wide))
        {
            let factor = 1.0 + damage * strength * asphalt(*offset, *wide);
            *red *= factor;
            *green *= factor;
            *blue *= factor;
        }
    }
}

vectorised! {
    /// How much of the sun is left below trees whose leaves let some of it through.
    fn shadow / shadow_avx2 / shadow_avx512(shade: &[f32], leaves: &[f32], sun: &mut [f32]) {
        for ((sun, shade), leaves) in sun.iter_mut().zip(shade).zip(leaves) {
            *sun = 1.0 - (shade * (1.9 + 1.5 * leaves) - 0.4).clamp(0.0, 1.0);
        }
    }
}

vectorised! {
    /// Darkens asphalt by a film of water, and says how much of the sky this throws back.
    fn wet / wet_avx2 / wet_avx512(
        wetness: f32, mirror: f32, offset: &[f32], wide: &[f32], patches: &[f32], colours: [&mut [f32]; 3],
        gloss: &mut [f32],
    ) {
        let [red, green, blue] = colours;
        let colours = red.iter_mut().zip(green).zip(blue);
        let places = offset.iter().zip(wide).zip(patches).zip(gloss);
        for (((red, green), blue), (((offset, wide), patch), gloss)) in colours.zip(places) {
            // Ruts hold more of it than crowns, and hollows more than either.
            let rut = 1.0 - ((offset.abs() - section::LANE_WIDTH as f32 / 2.0).abs() - 0.8).abs();
            let film = wetness * 1.5 - 0.45 + wetness * (0.5 * patch + 0.3 * rut.max(0.0));
            let film = film.clamp(0.0, 1.0) * asphalt(*offset, *wide);
            let factor = 1.0 - WET_DARKER * film;
            *red *= factor;
            *green *= factor;
            *blue *= factor;
            *gloss = film * film * mirror;
        }
    }
}

vectorised! {
    /// Turns how rough a surface is into what its texture makes of its brightness.
    fn roughen / roughen_avx2 / roughen_avx512(rough: &mut [f32], grain: &[f32]) {
        for (rough, grain) in rough.iter_mut().zip(grain) {
            *rough = 1.0 + *rough * grain * 1.6;
        }
    }
}

/// What a row shows before light falls on it; one channel.
struct Surface<'a> {
    colours: &'a [f32],
    rough: &'a [f32],
    meadow: &'a [f32],
    patches: &'a [f32],
    leaves: &'a [f32],
    beam: &'a [f32],
    sun: &'a [f32],
    gloss: &'a [f32],
}

/// Light and air of a row; one channel.
struct Channel {
    patch: f32,
    tuft: f32,
    ambient: f32,
    /// The sun's share of `ambient`.
    sun: f32,
    clear: f32,
    haze: f32,
    mirrored: f32,
}

vectorised! {
    fn light_channel / light_channel_avx2 / light_channel_avx512(surface: &Surface<'_>, light: &Channel, bytes: &mut [u8]) {
        let count = bytes.len();
        let Surface { colours, rough, meadow, patches, leaves, beam, sun, gloss } = surface;
        let (colours, rough, meadow) = (&colours[..count], &rough[..count], &meadow[..count]);
        let (patches, leaves, beam) = (&patches[..count], &leaves[..count], &beam[..count]);
        let (sun, gloss) = (&sun[..count], &gloss[..count]);
        for i in 0..count {
            let grass = meadow[i] * (patches[i] * light.patch + leaves[i] * light.tuft);
            let colour = colours[i] * rough[i] + grass;
            let lit = light.ambient * (1.0 - light.sun * (1.0 - sun[i])) + beam[i];
            let seen = colour * lit * (1.0 - gloss[i]) + light.mirrored * gloss[i];
            bytes[i] = byte(seen * light.clear + light.haze);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::portably;

    fn values(count: usize, low: f32, high: f32) -> Vec<f32> {
        (0..count).map(|i| low + (high - low) * ((i * 37 + 11) % count) as f32 / count as f32).collect()
    }

    #[test]
    fn every_processor_computes_the_same() {
        let count = 203;
        let (offset, wide) = (values(count, -9.0, 9.0), values(count, 0.0, 2.0));
        let (noise, share) = (values(count, -1.0, 1.0), values(count, 0.0, 1.0));
        let all = || {
            let mut colours: [Vec<f32>; 3] = std::array::from_fn(|c| values(count, c as f32, 200.0));
            let [red, green, blue] = colours.each_mut().map(Vec::as_mut_slice);
            darken(0.8, &noise, &offset, &wide, [red, green, blue]);
            let (mut gloss, mut sun, mut bytes) = (vec![0.0; count], vec![0.0; count], vec![0; count]);
            let [red, green, blue] = colours.each_mut().map(Vec::as_mut_slice);
            wet(0.7, 0.6, &offset, &wide, &noise, [red, green, blue], &mut gloss);
            shadow(&share, &noise, &mut sun);
            let surface = Surface {
                colours: &colours[0],
                rough: &share,
                meadow: &share,
                patches: &noise,
                leaves: &noise,
                beam: &share,
                sun: &sun,
                gloss: &gloss,
            };
            let channel = Channel {
                patch: 30.0,
                tuft: 12.0,
                ambient: 0.9,
                sun: 0.6,
                clear: 0.8,
                haze: 30.0,
                mirrored: 190.0,
            };
            light_channel(&surface, &channel, &mut bytes);
            assert!(sun.iter().chain(&gloss).all(|value| (0.0..=1.0).contains(value)));
            bytes
        };
        assert_eq!(all(), portably(all));
    }

    #[test]
    fn water_is_a_mirror_where_one_looks_along_it() {
        let light = Light::named("day");
        let shares = [2.0, 5.0, 15.0, 60.0].map(|ahead| mirrored(&light, ahead, 1.35).1);
        assert!(shares.is_sorted() && shares[0] < 0.06 && shares[3] > 0.85, "{shares:?}");
    }

    #[test]
    fn what_is_far_from_trees_is_in_the_sun() {
        let mut sun = [0.0; 3];
        shadow(&[0.0, 1.0, 1.0], &[0.3, 0.0, -0.9], &mut sun);
        assert_eq!(sun[0], 1.0);
        assert!(sun[1] < 0.05 && sun[2] > sun[1], "{sun:?}");
    }
}
