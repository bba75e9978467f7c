//! A repeating texture of random brightness, with smaller copies for what is far away.

use pdk_sdk::prelude::Random;

/// Texels along a side of the largest copy; a power of two, so that coordinates wrap by masking.
const SIZE: usize = 128;
/// Number of copies, each half as large as the one before.
const LEVELS: usize = 8;

/// Random brightness from about -1 to 1, mean 0, that repeats every 128 texels.
#[derive(Debug)]
pub struct Texture {
    levels: Vec<Vec<f32>>,
}

/// Which copies to read for one scale, and in what proportion.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    /// Texels a metre.
    frequency: f32,
    level: usize,
    share: f32,
}

impl Scale {
    /// For a texture of `frequency` texels a metre where a pixel covers `footprint` metres.
    pub fn new(frequency: f32, footprint: f32) -> Self {
        let texels = (frequency * footprint).max(1.0);
        let position = libm::log2f(texels).min((LEVELS - 1) as f32 - 0.001);
        Self { frequency, level: position as usize, share: position - (position as usize) as f32 }
    }
}

impl Texture {
    /// Draws a texture: several layers of random values, the coarser ones interpolated.
    pub fn new(random: &mut Random) -> Self {
        let mut finest = vec![0.0f32; SIZE * SIZE];
        for (shift, weight) in [(0, 0.45), (1, 0.4), (2, 0.4), (4, 0.35)] {
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
        Self { levels }
    }

    /// The brightness at a place on the ground.
    pub fn at(&self, x: f32, z: f32, scale: Scale) -> f32 {
        let texel = scale.frequency / (1u32 << scale.level) as f32;
        let fine = bilinear(&self.levels[scale.level], SIZE >> scale.level, x * texel, z * texel);
        // The largest copy stays sharp; between the others the change must not show as an edge.
        if scale.share == 0.0 {
            return fine;
        }
        let half = texel * 0.5;
        let coarse = bilinear(&self.levels[scale.level + 1], SIZE >> (scale.level + 1), x * half, z * half);
        fine + (coarse - fine) * scale.share
    }
}

fn bilinear(texels: &[f32], size: usize, x: f32, y: f32) -> f32 {
    let (left, top) = (floor(x), floor(y));
    let (fx, fy) = (x - left as f32, y - top as f32);
    let mask = size - 1;
    let (x0, y0) = (left as usize & mask, (top as usize & mask) * size);
    let (x1, y1) = ((x0 + 1) & mask, (y0 + size) & (size * size - 1));
    let upper = texels[y0 + x0] + (texels[y0 + x1] - texels[y0 + x0]) * fx;
    let lower = texels[y1 + x0] + (texels[y1 + x1] - texels[y1 + x0]) * fx;
    upper + (lower - upper) * fy
}

/// The largest whole number that is not larger. Without SSE 4.1, `f32::floor` is a call of a function.
fn floor(value: f32) -> i32 {
    let cut = value as i32;
    cut - i32::from((cut as f32) > value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::Key;

    #[test]
    fn the_texture_repeats_and_fades_with_distance() {
        let texture = Texture::new(&mut Key([1; 32]).sequence());
        let near = Scale::new(8.0, 0.01);
        assert_eq!(texture.at(3.25, -7.5, near), texture.at(3.25 + 16.0, -7.5 - 32.0, near));
        let spread = |scale| {
            (0..1000).map(|i| texture.at(i as f32 * 0.37, i as f32 * 0.11, scale).abs()).sum::<f32>() / 1000.0
        };
        assert!(spread(near) > 0.2, "{}", spread(near));
        assert!(spread(Scale::new(8.0, 20.0)) < 0.05);
    }

    #[test]
    fn floor_is_the_floor() {
        for value in [-2.0, -1.5, -0.1, 0.0, 0.9, 7.0, 1e6 + 0.5] {
            assert_eq!(floor(value) as f32, value.floor());
        }
    }
}
