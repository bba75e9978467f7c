//! What years do to asphalt: patches, cracks, their sealing, and seams. One picture of a piece of road, which repeats.

use pdk_sdk::prelude::Random;

use crate::texture::Texture;

/// Texels along a side.
const SIZE: usize = 512;
/// Texels a metre across the road, and how many times as long they are along it.
pub const ACROSS: f32 = 48.0;
pub const STRETCH: f32 = 6.0;
const ALONG: f64 = (ACROSS / STRETCH) as f64;
/// Metres of road that the picture shows across and along.
const WIDTH: f64 = SIZE as f64 / ACROSS as f64;
const LENGTH: f64 = SIZE as f64 / ALONG;

/// Brightness of the asphalt as shares of its own, to be added to 1. Coordinates are those across the road, then along it.
pub fn draw(random: &mut Random) -> Texture {
    let mut sheet = Sheet { texels: vec![0.0; SIZE * SIZE] };
    // Broad unevenness first: the spreader's passes, and places that have bled.
    for _ in 0..40 {
        let at = [random.uniform(0.0, WIDTH), random.uniform(0.0, LENGTH)];
        let size = [random.uniform(0.8, 3.0), random.uniform(3.0, 12.0)];
        sheet.blot(at, size, random.uniform(-0.12, 0.12) as f32);
    }
    for _ in 0..9 {
        patch(&mut sheet, random);
    }
    // Where two passes of the spreader meet, and joints across the road.
    for across in [0.5, 0.22, 0.79] {
        let start = WIDTH * across + random.uniform(-0.15, 0.15);
        sheet.wander([start, 0.0], [0.0, LENGTH], 0.035, 0.03, -0.38, random);
    }
    for joint in 0..4 {
        let along = (f64::from(joint) + random.unit()) * LENGTH / 4.0;
        sheet.wander([0.0, along], [WIDTH, 0.0], 0.09, 0.05, -0.4, random);
    }
    // Cracks, half of them sealed with tar, which is darker, broader and smoother.
    for _ in 0..26 {
        let at = [random.uniform(0.0, WIDTH), random.uniform(0.0, LENGTH)];
        let (across, along) = (random.uniform(-2.6, 2.6), random.uniform(-6.0, 6.0));
        let sealed = random.below(2) == 0;
        let (width, depth) = if sealed { (0.08, -0.42) } else { (0.03, -0.36) };
        sheet.wander(at, [across, along], width, 0.16, depth, random);
    }
    Texture::of(sheet.texels)
}

/// A place where the road was opened and filled: a rectangle of other asphalt with a seam around it.
fn patch(sheet: &mut Sheet, random: &mut Random) {
    let at = [random.uniform(0.0, WIDTH), random.uniform(0.0, LENGTH)];
    let size = [random.uniform(0.7, 2.6), random.uniform(1.2, 7.0)];
    let shade = if random.below(3) == 0 { random.uniform(0.08, 0.18) } else { random.uniform(-0.34, -0.16) };
    sheet.rectangle(at, size, shade as f32);
    let [width, length] = size;
    let corners = [at, [at[0] + width, at[1]], [at[0] + width, at[1] + length], [at[0], at[1] + length]];
    for side in 0..4 {
        let (from, to) = (corners[side], corners[(side + 1) % 4]);
        sheet.wander(from, [to[0] - from[0], to[1] - from[1]], 0.05, 0.01, -0.25, random);
    }
}

/// The picture, in metres across and along; it repeats both ways.
struct Sheet {
    texels: Vec<f32>,
}

impl Sheet {
    /// The texels within a rectangle, each with its place relative to the corner in metres.
    fn each(&mut self, at: [f64; 2], size: [f64; 2], mut change: impl FnMut(&mut f32, [f64; 2])) {
        let scale = [f64::from(ACROSS), ALONG];
        let range = |axis: usize| {
            let first = (at[axis] * scale[axis] - 0.5).ceil() as i64;
            first..((at[axis] + size[axis]) * scale[axis] - 0.5).ceil() as i64
        };
        let place = |texel: i64, axis: usize| (texel as f64 + 0.5) / scale[axis] - at[axis];
        for y in range(1) {
            for x in range(0) {
                let wrapped = |texel: i64| texel.rem_euclid(SIZE as i64) as usize;
                change(&mut self.texels[wrapped(y) * SIZE + wrapped(x)], [place(x, 0), place(y, 1)]);
            }
        }
    }

    fn rectangle(&mut self, at: [f64; 2], size: [f64; 2], shade: f32) {
        // Nothing of what was there before.
        self.each(at, size, |texel, _| *texel = shade);
    }

    /// A soft spot around a place.
    fn blot(&mut self, at: [f64; 2], size: [f64; 2], shade: f32) {
        let corner = [at[0] - size[0], at[1] - size[1]];
        self.each(corner, size.map(|s| 2.0 * s), |texel, place| {
            let [x, y] = [0, 1].map(|axis| place[axis] / size[axis] - 1.0);
            *texel += shade * (1.0 - x * x - y * y).max(0.0) as f32;
        });
    }

    /// A line that strays from its course by up to this many metres a step.
    fn wander(
        &mut self,
        from: [f64; 2],
        course: [f64; 2],
        width: f64,
        stray: f64,
        shade: f32,
        random: &mut Random,
    ) {
        let length = (course[0] * course[0] + course[1] * course[1]).sqrt();
        let steps = (length / 0.25).ceil().max(1.0) as usize;
        let mut off = 0.0;
        let mut at = from;
        for step in 1..=steps {
            let share = step as f64 / steps as f64;
            off = off * 0.96 + random.uniform(-stray, stray);
            let [x, y] = [course[0] / length, course[1] / length];
            let next = [from[0] + course[0] * share - y * off, from[1] + course[1] * share + x * off];
            self.stroke(at, next, width, shade);
            at = next;
        }
    }

    /// A straight stroke, as dark as the share of each texel that it covers.
    fn stroke(&mut self, from: [f64; 2], to: [f64; 2], width: f64, shade: f32) {
        // A texel's extent, and so the least extent of what is drawn.
        let texel = [1.0 / f64::from(ACROSS), 1.0 / ALONG];
        let half = [0, 1].map(|axis| (width / 2.0).max(texel[axis] / 2.0) + texel[axis] / 2.0);
        let corner = [0, 1].map(|axis| from[axis].min(to[axis]) - half[axis]);
        let size = [0, 1].map(|axis| (from[axis] - to[axis]).abs() + 2.0 * half[axis]);
        let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
        let squared = (dx * dx + dy * dy).max(1e-9);
        let faint = |axis: usize| (width / texel[axis]).min(1.0);
        self.each(corner, size, |value, place| {
            let at = [corner[0] + place[0] - from[0], corner[1] + place[1] - from[1]];
            let share = ((at[0] * dx + at[1] * dy) / squared).clamp(0.0, 1.0);
            let off = [at[0] - dx * share, at[1] - dy * share];
            let near = [0, 1].map(|axis| {
                (1.0 - (off[axis].abs() - half[axis] + texel[axis]).max(0.0) / texel[axis]).max(0.0)
            });
            // Across the stroke it covers a part of a texel, along it all of it.
            let cover = near[0] * near[1] * if dx.abs() > dy.abs() { faint(1) } else { faint(0) };
            *value = value.min(shade * cover as f32);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::Key;

    #[test]
    fn damage_is_mostly_darker_and_leaves_most_of_the_road_alone() {
        let texture = draw(&mut Key([3; 32]).sequence());
        let scale = texture.scale(ACROSS, 0.01);
        let (mut dark, mut even, mut asked) = (0, 0, 0);
        for step in 0..200 {
            let x: Vec<f32> = (0..64).map(|i| i as f32 * 0.131).collect();
            let y = vec![step as f32 * 0.317; 64];
            let mut row = vec![0.0; 64];
            texture.fill_at(&mut row, (&x, &y), [0.0; 2], STRETCH, scale);
            asked += 64;
            dark += row.iter().filter(|value| **value < -0.15).count();
            even += row.iter().filter(|value| value.abs() < 0.15).count();
            assert!(row.iter().all(|value| (-0.7..0.5).contains(value)));
        }
        assert!(dark * 20 > asked && dark * 3 < asked && even * 2 > asked, "{dark} {even} of {asked}");
        // It repeats, and the same key draws the same.
        let at = |texture: &Texture, x: f32, y: f32| {
            let mut row = [0.0; 8];
            texture.fill_at(&mut row, (&[x; 8], &[y; 8]), [0.0; 2], STRETCH, scale);
            row[0]
        };
        let again = draw(&mut Key([3; 32]).sequence());
        for i in 0..100 {
            let (x, y) = (i as f32 * 0.0625, i as f32 * 0.5);
            assert_eq!(at(&texture, x, y), at(&again, x, y));
            assert!((at(&texture, x, y) - at(&texture, x, y + LENGTH as f32)).abs() < 1e-3);
        }
    }
}
