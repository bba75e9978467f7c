//! A repeating texture of random brightness, with smaller copies for what is far away.

use pdk_sdk::prelude::Random;

/// Texels along a side of the largest copy; a power of two, so that coordinates wrap by masking.
const SIZE: usize = 1 << SHIFT;
const SHIFT: usize = 8;
/// Number of copies, each half as large as the one before.
const LEVELS: usize = 9;

/// 1.5 * 2^23: see [`Texture::fill`].
const ROUNDING: f32 = 12_582_912.0;

/// Random brightness from about -1 to 1, mean 0, that repeats every 256 texels.
#[derive(Debug)]
pub struct Texture {
    /// For each texel of each copy: its own brightness, that of its right and lower neighbour, and of the one between these.
    levels: Vec<Vec<[f32; 4]>>,
    /// Root mean square of each copy.
    spreads: [f32; LEVELS],
}

/// How to read the texture at one scale.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    /// Texels of the chosen copy a metre.
    frequency: f32,
    /// The copy to read.
    level: usize,
    /// What its values are multiplied with.
    strength: f32,
}

impl Texture {
    /// Draws a texture: several layers of random values, the coarser ones interpolated.
    pub fn new(random: &mut Random) -> Self {
        let mut finest = vec![0.0f32; SIZE * SIZE];
        for (shift, weight) in [(0, 0.5), (1, 0.4), (2, 0.35), (3, 0.3), (4, 0.3), (5, 0.2)] {
            let size = SIZE >> shift;
            let lattice: Vec<f32> =
                (0..size * size).map(|_| weight * random.uniform(-1.0, 1.0) as f32).collect();
            let step = 1.0 / (1 << shift) as f32;
            for y in 0..SIZE {
                for x in 0..SIZE {
                    finest[y * SIZE + x] += bilinear(&lattice, size, x as f32 * step, y as f32 * step);
                }
            }
        }
        let mean = finest.iter().map(|&v| f64::from(v)).sum::<f64>() / (SIZE * SIZE) as f64;
        finest.iter_mut().for_each(|v| *v -= mean as f32);
        let mut levels = vec![finest];
        for level in 1..LEVELS {
            let (above, size) = (&levels[level - 1], SIZE >> level);
            let texel = |x: usize, y: usize| above[y * size * 2 + x];
            let smaller = (0..size * size)
                .map(|i| {
                    let (x, y) = (i % size * 2, i / size * 2);
                    (texel(x, y) + texel(x + 1, y) + texel(x, y + 1) + texel(x + 1, y + 1)) * 0.25
                })
                .collect();
            levels.push(smaller);
        }
        let mut spreads = [0.0; LEVELS];
        for (spread, level) in spreads.iter_mut().zip(&levels) {
            *spread = (level.iter().map(|v| v * v).sum::<f32>() / level.len() as f32).sqrt();
        }
        let levels = levels.iter().map(|level| with_neighbours(level)).collect();
        Self { levels, spreads }
    }

    /// How to read it with `frequency` texels a metre where a pixel covers `footprint` metres.
    ///
    /// One copy is read, the largest that does not flicker. Towards the distance at which the next one takes over
    /// its contrast falls to that of the next, so that the change does not show as an edge.
    pub fn scale(&self, frequency: f32, footprint: f32) -> Scale {
        let texels = (frequency * footprint).max(1.0);
        let position = libm::log2f(texels).min((LEVELS - 2) as f32 - 0.001);
        let level = position as usize;
        let share = position - level as f32;
        let next = self.spreads[level + 1] / self.spreads[level];
        Scale { frequency: frequency / (1u32 << level) as f32, level, strength: 1.0 + (next - 1.0) * share }
    }

    /// The brightness at places in a row: `start` and so many times `step` further, x and z in metres.
    #[inline(always)]
    pub fn fill<'a>(
        &self,
        line: &'a mut Line,
        numbers: &[f32],
        (start, step): ([f32; 2], [f32; 2]),
        scale: Scale,
    ) -> &'a [f32] {
        let texels = &self.levels[scale.level][..];
        let shift = (SHIFT - scale.level) as u32;
        let mask = (1u32 << shift) - 1;
        let count = numbers.len();
        let Line { fx, fy, index, corners: [a, b, c, d], values } = line;
        let (fx, fy, index) = (&mut fx[..count], &mut fy[..count], &mut index[..count]);
        let [su, sv] = start.map(|s| s * scale.frequency);
        let [du, dv] = step.map(|s| s * scale.frequency);
        for i in 0..count {
            // A number just above 1.5 * 2^23 has no fraction: adding and subtracting rounds, faster than any conversion,
            // and the lowest bits are those of the whole number.
            let (u, v) = (su + numbers[i] * du, sv + numbers[i] * dv);
            let (left, top) = (u - 0.5 + ROUNDING, v - 0.5 + ROUNDING);
            fx[i] = u - (left - ROUNDING);
            fy[i] = v - (top - ROUNDING);
            index[i] = ((top.to_bits() & mask) << shift) | (left.to_bits() & mask);
        }
        let (a, b, c, d) = (&mut a[..count], &mut b[..count], &mut c[..count], &mut d[..count]);
        for i in 0..count {
            [a[i], b[i], c[i], d[i]] = texels[index[i] as usize];
        }
        let values = &mut values[..count];
        for i in 0..count {
            let upper = a[i] + (b[i] - a[i]) * fx[i];
            let lower = c[i] + (d[i] - c[i]) * fx[i];
            values[i] = (upper + (lower - upper) * fy[i]) * scale.strength;
        }
        values
    }
}

/// Room for the texture along one row of pixels.
#[derive(Debug)]
pub struct Line {
    fx: Vec<f32>,
    fy: Vec<f32>,
    index: Vec<u32>,
    corners: [Vec<f32>; 4],
    values: Vec<f32>,
}

impl Line {
    /// Room for rows of so many pixels.
    pub fn new(width: usize) -> Self {
        let room = || vec![0.0; width];
        Self {
            fx: room(),
            fy: room(),
            index: vec![0; width],
            corners: std::array::from_fn(|_| room()),
            values: room(),
        }
    }
}

/// Each texel with its neighbours.
fn with_neighbours(level: &[f32]) -> Vec<[f32; 4]> {
    let size = level.len().isqrt();
    let texel = |x: usize, y: usize| level[y % size * size + x % size];
    (0..size * size)
        .map(|i| {
            let (x, y) = (i % size, i / size);
            [texel(x, y), texel(x + 1, y), texel(x, y + 1), texel(x + 1, y + 1)]
        })
        .collect()
}

/// The lattice interpolated at a place; it repeats.
fn bilinear(texels: &[f32], size: usize, x: f32, y: f32) -> f32 {
    let (fx, fy) = (x - x.floor(), y - y.floor());
    let (x0, y0) = (x as usize % size, y as usize % size);
    let (x1, y1) = ((x0 + 1) % size, (y0 + 1) % size);
    let upper = texels[y0 * size + x0] + (texels[y0 * size + x1] - texels[y0 * size + x0]) * fx;
    let lower = texels[y1 * size + x0] + (texels[y1 * size + x1] - texels[y1 * size + x0]) * fx;
    upper + (lower - upper) * fy
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::Key;

    #[test]
    fn a_row_is_its_places_one_by_one() {
        let texture = Texture::new(&mut Key([1; 32]).sequence());
        let numbers: Vec<f32> = (0..40).map(|i| i as f32).collect();
        for footprint in [0.01, 0.2, 3.0] {
            let scale = texture.scale(30.0, footprint);
            let (start, step) = ([3.7, -8.1], [0.31, 0.17]);
            let (mut line, mut single) = (Line::new(40), Line::new(1));
            let row = texture.fill(&mut line, &numbers, (start, step), scale).to_vec();
            for (i, value) in row.into_iter().enumerate() {
                let alone = texture.fill(&mut single, &[i as f32], (start, step), scale)[0];
                assert_eq!(value.to_bits(), alone.to_bits());
            }
        }
    }

    #[test]
    fn the_texture_repeats_and_fades_with_distance() {
        let texture = Texture::new(&mut Key([1; 32]).sequence());
        let near = texture.scale(8.0, 0.01);
        let mut line = Line::new(1);
        let mut at = |x: f32, z: f32, scale| texture.fill(&mut line, &[0.0], ([x, z], [0.0; 2]), scale)[0];
        assert_eq!(at(3.25, -7.5, near), at(3.25 + 32.0, -7.5 - 64.0, near));
        let mut spread = |scale| {
            (0..1000).map(|i| at(i as f32 * 0.37, i as f32 * 0.11, scale).abs()).sum::<f32>() / 1000.0
        };
        assert!(spread(near) > 0.2, "{}", spread(near));
        assert!(spread(texture.scale(8.0, 20.0)) < 0.05);
    }
}
