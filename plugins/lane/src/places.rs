//! Where the pixels of a row lie on the road.

use crate::field::{Field, NEAR};
use crate::located::Located;
use crate::section;
use crate::simd::{BLOCK, vectorised};

/// Longest block that counts as straight, in metres.
const LONGEST: f32 = 0.5;

/// A row of pixels on the field's map.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    /// The middle of the first pixel, and the way to the next, x and z in metres.
    pub start: [f32; 2],
    pub across: [f32; 2],
    /// How far a pixel extends along the view.
    pub along: [f32; 2],
    /// The length of `across`.
    pub pixel_width: f32,
}

impl Line {
    /// The middle of a pixel.
    #[inline(always)]
    pub fn at(&self, pixel: usize) -> [f32; 2] {
        [0, 1].map(|k| self.start[k] + self.across[k] * pixel as f32)
    }

    /// How far a pixel extends in a direction.
    #[inline(always)]
    fn extent(&self, x: f32, z: f32) -> f32 {
        let Self { across, along, .. } = self;
        (x * across[0] + z * across[1]).abs() + (x * along[0] + z * along[1]).abs()
    }
}

/// Where the pixels of a row lie on the road, in whole blocks.
#[derive(Debug, PartialEq)]
pub struct RoadPlaces {
    /// Distance to the right of the middle of the road in metres; [`AWAY`] if that is not known.
    pub offset: Vec<f32>,
    /// Distance along it.
    pub along: Vec<f32>,
    /// How far a pixel extends across the road, and along it.
    pub wide: Vec<f32>,
    pub deep: Vec<f32>,
    /// How much of the sun is taken, 0 to 1.
    pub shade: Vec<f32>,
    /// Whether any pixel of a block lies near the road.
    pub near: Vec<bool>,
}

/// The distance from the road of what is far from it, in metres.
pub const AWAY: f32 = 1e6;

impl RoadPlaces {
    /// Room for this many pixels in whole blocks.
    pub fn new(pixels: usize) -> Self {
        let room = || vec![0.0; pixels];
        Self {
            offset: room(),
            along: room(),
            wide: room(),
            deep: room(),
            shade: room(),
            near: vec![false; pixels / BLOCK],
        }
    }
}

/// Places that the field is asked for, and what it says.
#[derive(Debug)]
pub struct Asked {
    x: Vec<f32>,
    z: Vec<f32>,
    lateral: Vec<f32>,
    along: Vec<f32>,
    gradient: [Vec<f32>; 2],
    shade: Vec<f32>,
    /// How far a pixel extends there, across the road and along it.
    wide: Vec<f32>,
    deep: Vec<f32>,
}

impl Asked {
    /// Room for this many pixels in whole blocks.
    pub fn new(pixels: usize) -> Self {
        // Of a single block both ends are asked for.
        let room = || vec![0.0; pixels + BLOCK];
        let gradient = [room(), room()];
        let (x, z, lateral, along, shade) = (room(), room(), room(), room(), room());
        Self { x, z, lateral, along, gradient, shade, wide: room(), deep: room() }
    }

    /// Asks for the first `count` places.
    fn locate(&mut self, field: &Field, count: usize) {
        let Self { x, z, lateral, along, gradient: [gx, gz], shade, .. } = self;
        let gradient = [&mut gx[..count], &mut gz[..count]];
        let (lateral, along) = (&mut lateral[..count], &mut along[..count]);
        let located = Located { lateral, along, gradient, shade: &mut shade[..count] };
        field.locate(&x[..count], &z[..count], located);
    }
}

/// Finds where the pixels of a row lie on the road. If pixels are small the field is asked at the ends of blocks alone: in
/// between the road is straight to within a few millimetres.
pub fn locate(field: &Field, line: &Line, asked: &mut Asked, places: &mut RoadPlaces) {
    let blocks = places.near.len();
    let sparse = line.pixel_width * BLOCK as f32 <= LONGEST;
    let (step, count) = if sparse { (BLOCK, crate::simd::padded(blocks + 1)) } else { (1, blocks * BLOCK) };
    step_along(line, step, &mut asked.x[..count], &mut asked.z[..count]);
    asked.locate(field, count);
    if sparse {
        lay_sparsely(field, line, asked, places);
    } else {
        lay_all(line, asked, places);
    }
}

vectorised! {
    /// Writes the middle of every `step`th pixel.
    fn step_along / step_along_avx2 / step_along_avx512(line: &Line, step: usize, x: &mut [f32], z: &mut [f32]) {
        for (i, (x, z)) in x.iter_mut().zip(z).enumerate() {
            [*x, *z] = line.at(i * step);
        }
    }
}

vectorised! {
    /// Writes the places of all blocks from their ends.
    fn lay_sparsely / lay_sparsely_avx2 / lay_sparsely_avx512(field: &Field, line: &Line, asked: &mut Asked, places: &mut RoadPlaces) {
        let blocks = places.near.len();
        let Asked { lateral, along, gradient: [gx, gz], shade, wide, deep, .. } = asked;
        let extents = wide[..blocks].iter_mut().zip(&mut deep[..blocks]);
        for ((wide, deep), (gx, gz)) in extents.zip(gx.iter().zip(gz.iter())) {
            *wide = line.extent(*gx, *gz);
            *deep = line.extent(*gz, -gx);
        }
        let known = |lateral: f32| lateral.abs() < NEAR;
        for block in 0..blocks {
            let ends = |values: &[f32]| [values[block], values[block + 1]];
            let (laterals, alongs) = (ends(lateral), ends(along));
            let is_near = match laterals.map(known) {
                // The road is wider than a block is long: it cannot lie in between.
                [false, false] => {
                    places.offset.as_chunks_mut::<BLOCK>().0[block] = [AWAY; BLOCK];
                    places.shade.as_chunks_mut::<BLOCK>().0[block] = [0.0; BLOCK];
                    false
                }
                [true, true]
                    if (laterals[0] - laterals[1]).abs() <= 2.0 * LONGEST
                        && (alongs[0] - alongs[1]).abs() <= 2.0 * LONGEST =>
                {
                    // In between it lies on a straight line.
                    places.wide.as_chunks_mut::<BLOCK>().0[block] = [wide[block]; BLOCK];
                    places.deep.as_chunks_mut::<BLOCK>().0[block] = [deep[block]; BLOCK];
                    let offset = &mut places.offset.as_chunks_mut::<BLOCK>().0[block];
                    *offset = between(laterals).map(|lateral| lateral - section::ROAD_CENTRE as f32);
                    places.along.as_chunks_mut::<BLOCK>().0[block] = between(alongs);
                    places.shade.as_chunks_mut::<BLOCK>().0[block] = between(ends(shade));
                    true
                }
                _ => {
                    ask_for_each(field, line, block * BLOCK, places);
                    continue;
                }
            };
            places.near[block] = is_near;
        }
    }
}

/// The values of a block from those of its first pixel and of the one just behind its last.
#[inline(always)]
fn between([a, b]: [f32; 2]) -> [f32; BLOCK] {
    const SHARES: [f32; BLOCK] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875];
    SHARES.map(|share| a + (b - a) * share)
}

/// Asks for each place of a block.
#[inline(never)]
fn ask_for_each(field: &Field, line: &Line, first: usize, places: &mut RoadPlaces) {
    let mut values = [[0.0; BLOCK]; 7];
    let [x, z, lateral, along, gx, gz, shade] = &mut values;
    for (within, (x, z)) in x.iter_mut().zip(z.iter_mut()).enumerate() {
        [*x, *z] = line.at(first + within);
    }
    field.locate(x, z, Located { lateral, along, gradient: [gx, gz], shade });
    lay_each(line, [lateral, along, gx, gz, shade], places, first);
}

vectorised! {
    /// Writes the places of a row, each of which was asked for.
    fn lay_all / lay_all_avx2 / lay_all_avx512(line: &Line, asked: &Asked, places: &mut RoadPlaces) {
        let Asked { lateral, along, gradient: [gx, gz], shade, .. } = asked;
        lay_each(line, [lateral, along, gx, gz, shade], places, 0);
    }
}

/// Writes places from pixel `first` on, each of which was asked for, in whole blocks: lateral, along, both parts of the
/// gradient, shade.
#[inline(always)]
fn lay_each(line: &Line, found: [&[f32]; 5], places: &mut RoadPlaces, first: usize) {
    let RoadPlaces { offset, along, wide, deep, shade, near } = places;
    let count = (offset.len() - first).min(found[0].len() / BLOCK * BLOCK);
    let [lateral, alongs, gx, gz, shades] = found.map(|values| &values[..count]);
    let of = first..first + count;
    along[of.clone()].copy_from_slice(alongs);
    shade[of.clone()].copy_from_slice(shades);
    for (offset, lateral) in offset[of.clone()].iter_mut().zip(lateral) {
        let there = lateral - section::ROAD_CENTRE as f32;
        *offset = if *lateral < AWAY { there } else { AWAY };
    }
    let extents = wide[of.clone()].iter_mut().zip(&mut deep[of]);
    for ((wide, deep), (gx, gz)) in extents.zip(gx.iter().zip(gz)) {
        *wide = line.extent(*gx, *gz);
        *deep = line.extent(*gz, -gx);
    }
    for (near, lateral) in near[first / BLOCK..].iter_mut().zip(lateral.as_chunks::<BLOCK>().0) {
        // Without leaving early, so that all are tested at once.
        *near = lateral.iter().fold(false, |near, lateral| near | (lateral.abs() < f32::INFINITY));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Place;
    use crate::road::Road;
    use crate::simd::{padded, portably};

    #[test]
    fn places_in_between_are_those_of_the_field_on_every_processor() {
        let road =
            Road::from_angles(&[0.0, 35.0, -35.0, 35.0, -35.0, 35.0, 35.0, 0.0], &[25.0; 8], &[]).unwrap();
        let field = Field::new(&road.path);
        let mut compared = 0;
        for (step, pixel_width) in (0..300).flat_map(|step| [(step, 0.06), (step, 0.2)]) {
            let along = 2.0 + step as f64 * 0.5;
            let at = road.path.beside(along, -8.0);
            let [dx, dz] = road.path.direction(road.path.segment_at(along));
            let across = [dz * pixel_width, -dx * pixel_width].map(|a| a as f32);
            let line = Line {
                start: [(at[0] - field.origin()[0]) as f32, (at[1] - field.origin()[1]) as f32],
                across,
                along: [dx as f32, dz as f32],
                pixel_width: pixel_width as f32,
            };
            let located = || {
                let width = padded(200);
                let (mut asked, mut places) = (Asked::new(width), RoadPlaces::new(width));
                locate(&field, &line, &mut asked, &mut places);
                places
            };
            let places = located();
            assert_eq!(places, portably(located));
            for pixel in 0..200 {
                let [x, z] = line.at(pixel);
                let Some(plain) = field.at(x, z).filter(Place::is_near) else { continue };
                let (offset, along) = (places.offset[pixel], places.along[pixel]);
                if offset < AWAY {
                    let lateral = offset + section::ROAD_CENTRE as f32;
                    assert!((lateral - plain.lateral).abs() < 0.01, "{lateral} {plain:?}");
                    assert!((along - plain.along).abs() < 0.06, "{along} {plain:?}");
                    assert!(places.near[pixel / BLOCK]);
                    compared += 1;
                }
            }
        }
        assert!(compared > 75_000, "{compared}");
    }
}
