//! A repeating texture of random brightness, with smaller copies for what is far away.

use pdk_sdk::prelude::Random;

#[cfg(target_arch = "x86_64")]
use crate::simd::{BLOCK, avx2, avx512, has_avx2, has_avx512};

/// Texels along a side of the largest copy of a texture that is drawn here; a power of two, so that coordinates wrap by masking.
const SIZE: usize = 256;

/// 1.5 * 2^23: see [`Reading::fill`].
const ROUNDING: f32 = 12_582_912.0;

/// Brightness from about -1 to 1, mean 0, that repeats.
#[derive(Debug)]
pub struct Texture {
    /// Copies, each half as large as the one before, the last one texel large. For each texel of each copy: its own brightness
    /// and that of its lower neighbour. Behind each row comes its first texel again, so that the right neighbour is always
    /// the next texel.
    levels: Vec<Vec<[f32; 2]>>,
    /// Root mean square of each copy.
    spreads: Vec<f32>,
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
        Self::of(finest)
    }

    /// A texture from its texels, row by row: a square whose side is a power of two. The mean is taken out.
    pub fn of(mut finest: Vec<f32>) -> Self {
        let mean = finest.iter().map(|&v| f64::from(v)).sum::<f64>() / finest.len() as f64;
        finest.iter_mut().for_each(|v| *v -= mean as f32);
        let mut size = finest.len().isqrt();
        let mut levels = vec![finest];
        while size > 1 {
            size /= 2;
            let above = &levels[levels.len() - 1];
            let texel = |x: usize, y: usize| above[y * size * 2 + x];
            let smaller = (0..size * size)
                .map(|i| {
                    let (x, y) = (i % size * 2, i / size * 2);
                    (texel(x, y) + texel(x + 1, y) + texel(x, y + 1) + texel(x + 1, y + 1)) * 0.25
                })
                .collect();
            levels.push(smaller);
        }
        let spread =
            |level: &Vec<f32>| (level.iter().map(|v| v * v).sum::<f32>() / level.len() as f32).sqrt();
        let spreads = levels.iter().map(spread).collect();
        let levels = levels.iter().map(|level| with_neighbours(level)).collect();
        Self { levels, spreads }
    }

    /// How to read it with `frequency` texels a metre where a pixel covers `footprint` metres.
    ///
    /// One copy is read, the largest that does not flicker. Towards the distance at which the next one takes over
    /// its contrast falls to that of the next, so that the change does not show as an edge.
    pub fn scale(&self, frequency: f32, footprint: f32) -> Scale {
        let texels = (frequency * footprint).max(1.0);
        let position = libm::log2f(texels).min((self.levels.len() - 2) as f32 - 0.001);
        let level = position as usize;
        let share = position - level as f32;
        let next = self.spreads[level + 1] / self.spreads[level];
        Scale { frequency: frequency / (1u32 << level) as f32, level, strength: 1.0 + (next - 1.0) * share }
    }

    /// Writes the brightness at places in a row: `start` and this many times `step` further, x and z in metres. The row has whole
    /// blocks.
    pub fn fill(&self, row: &mut [f32], (start, step): ([f32; 2], [f32; 2]), scale: Scale) {
        let reading = self.reading(scale);
        let (start, step) = (start.map(|s| s * scale.frequency), step.map(|s| s * scale.frequency));
        #[cfg(target_arch = "x86_64")]
        if has_avx512() {
            // SAFETY: the processor has all that this version asks for.
            return unsafe { reading.fill_avx512(row, (start, step)) };
        }
        #[cfg(target_arch = "x86_64")]
        if has_avx2() {
            // SAFETY: the processor has AVX2, which is all that this version asks for.
            return unsafe { reading.fill_avx2(row, (start, step)) };
        }
        reading.fill(row, (start, step));
    }

    /// Writes the brightness at any places, x and y in metres and moved by `shift`, with texels that are `stretch` times as long in
    /// y. All have whole blocks.
    pub fn fill_at(
        &self,
        row: &mut [f32],
        (x, y): (&[f32], &[f32]),
        shift: [f32; 2],
        stretch: f32,
        scale: Scale,
    ) {
        let reading = self.reading(scale);
        let frequencies = [scale.frequency, scale.frequency / stretch];
        #[cfg(target_arch = "x86_64")]
        if has_avx512() {
            // SAFETY: the processor has all that this version asks for.
            return unsafe { reading.fill_at_avx512(row, (x, y), shift, frequencies) };
        }
        #[cfg(target_arch = "x86_64")]
        if has_avx2() {
            // SAFETY: the processor has AVX2, which is all that this version asks for.
            return unsafe { reading.fill_at_avx2(row, (x, y), shift, frequencies) };
        }
        reading.fill_at(row, (x, y), shift, frequencies);
    }

    fn reading(&self, scale: Scale) -> Reading<'_> {
        let texels = &self.levels[scale.level];
        // The last one has one texel.
        let shift = (self.levels.len() - 1 - scale.level) as u32;
        Reading { texels, shift, mask: (1 << shift) - 1, strength: scale.strength }
    }
}

/// As [`Reading::at`], for eight places.
#[cfg(target_arch = "x86_64")]
macro_rules! at_avx2 {
    ($reading:expr, $u:expr, $v:expr) => {{
        let (reading, u, v): (&Reading<'_>, __m256, __m256) = ($reading, $u, $v);
        let (half, rounding) = (_mm256_set1_ps(0.5), _mm256_set1_ps(ROUNDING));
        let mask = _mm256_set1_epi32(reading.mask as i32);
        let left = _mm256_add_ps(_mm256_sub_ps(u, half), rounding);
        let top = _mm256_add_ps(_mm256_sub_ps(v, half), rounding);
        let fx = _mm256_sub_ps(u, _mm256_sub_ps(left, rounding));
        let fy = _mm256_sub_ps(v, _mm256_sub_ps(top, rounding));
        let column = _mm256_and_si256(_mm256_castps_si256(left), mask);
        let shift = _mm_cvtsi32_si128(reading.shift as i32);
        let line = _mm256_and_si256(_mm256_castps_si256(top), mask);
        let places = _mm256_add_epi32(_mm256_add_epi32(_mm256_sll_epi32(line, shift), line), column);
        let first = _mm256_broadcastd_epi32(_mm256_castsi256_si128(places));
        let pairs = avx2::Pairs::new(reading.texels);
        // Neighbours often lie between the same texels, above all of coarse textures.
        let [a, c, b, d] = match _mm256_movemask_epi8(_mm256_cmpeq_epi32(places, first)) {
            -1 => pairs[_mm256_cvtsi256_si32(places) as u32 as usize].map(|v| _mm256_set1_ps(v)),
            _ => avx2::look_up!(pairs, places),
        };
        let (upper, lower) = (avx2::mix(a, b, fx), avx2::mix(c, d, fx));
        _mm256_mul_ps(avx2::mix(upper, lower, fy), _mm256_set1_ps(reading.strength))
    }};
}

/// As [`Reading::at`], for sixteen places.
#[cfg(target_arch = "x86_64")]
macro_rules! at_avx512 {
    ($reading:expr, $u:expr, $v:expr) => {{
        let (reading, u, v): (&Reading<'_>, __m512, __m512) = ($reading, $u, $v);
        let (half, rounding) = (_mm512_set1_ps(0.5), _mm512_set1_ps(ROUNDING));
        let mask = _mm512_set1_epi32(reading.mask as i32);
        let left = _mm512_add_ps(_mm512_sub_ps(u, half), rounding);
        let top = _mm512_add_ps(_mm512_sub_ps(v, half), rounding);
        let fx = _mm512_sub_ps(u, _mm512_sub_ps(left, rounding));
        let fy = _mm512_sub_ps(v, _mm512_sub_ps(top, rounding));
        let column = _mm512_and_si512(_mm512_castps_si512(left), mask);
        let shift = _mm_cvtsi32_si128(reading.shift as i32);
        let line = _mm512_and_si512(_mm512_castps_si512(top), mask);
        let places = _mm512_add_epi32(_mm512_add_epi32(_mm512_sll_epi32(line, shift), line), column);
        let first = _mm512_broadcastd_epi32(_mm512_castsi512_si128(places));
        let [a, c, b, d] = match _mm512_cmpneq_epi32_mask(places, first) {
            0 => {
                let pairs = avx2::Pairs::new(reading.texels);
                pairs[_mm512_cvtsi512_si32(places) as u32 as usize].map(|v| _mm512_set1_ps(v))
            }
            _ => avx512::look_up!(reading.texels.as_flattened(), 2, places),
        };
        let (upper, lower) = (avx512::mix(a, b, fx), avx512::mix(c, d, fx));
        _mm512_mul_ps(avx512::mix(upper, lower, fy), _mm512_set1_ps(reading.strength))
    }};
}

/// One copy of the texture, as it is read.
struct Reading<'a> {
    texels: &'a [[f32; 2]],
    /// The copy has `1 << shift` texels along a side, and `mask` takes what is beyond.
    shift: u32,
    mask: u32,
    strength: f32,
}

impl Reading<'_> {
    /// As [`Texture::fill`], in texels.
    fn fill(&self, row: &mut [f32], ([su, sv], [du, dv]): ([f32; 2], [f32; 2])) {
        for (i, value) in row.iter_mut().enumerate() {
            *value = self.at(su + i as f32 * du, sv + i as f32 * dv);
        }
    }

    /// As [`Texture::fill_at`], with texels a metre both ways.
    fn fill_at(&self, row: &mut [f32], (x, y): (&[f32], &[f32]), shift: [f32; 2], frequencies: [f32; 2]) {
        for ((value, x), y) in row.iter_mut().zip(x).zip(y) {
            *value = self.at((x + shift[0]) * frequencies[0], (y + shift[1]) * frequencies[1]);
        }
    }

    #[inline(always)]
    fn at(&self, u: f32, v: f32) -> f32 {
        // A number just above 1.5 * 2^23 has no fraction: adding and subtracting rounds, faster than any conversion,
        // and the lowest bits are those of the whole number.
        let (left, top) = (u - 0.5 + ROUNDING, v - 0.5 + ROUNDING);
        let (fx, fy) = (u - (left - ROUNDING), v - (top - ROUNDING));
        let line = top.to_bits() & self.mask;
        let index = ((line << self.shift) + line + (left.to_bits() & self.mask)) as usize;
        let ([a, c], [b, d]) = (self.texels[index], self.texels[index + 1]);
        let upper = a + (b - a) * fx;
        let lower = c + (d - c) * fx;
        (upper + (lower - upper) * fy) * self.strength
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn fill_avx2(&self, row: &mut [f32], (start, step): ([f32; 2], [f32; 2])) {
        use std::arch::x86_64::*;

        let [su, sv] = start.map(|s| _mm256_set1_ps(s));
        let [du, dv] = step.map(|s| _mm256_set1_ps(s));
        let mut numbers = _mm256_setr_ps(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0);
        for block in row.as_chunks_mut::<BLOCK>().0 {
            let u = _mm256_add_ps(su, _mm256_mul_ps(numbers, du));
            let v = _mm256_add_ps(sv, _mm256_mul_ps(numbers, dv));
            numbers = _mm256_add_ps(numbers, _mm256_set1_ps(BLOCK as f32));
            avx2::store(block, at_avx2!(self, u, v));
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn fill_at_avx2(
        &self,
        row: &mut [f32],
        (x, y): (&[f32], &[f32]),
        shift: [f32; 2],
        frequencies: [f32; 2],
    ) {
        use std::arch::x86_64::*;

        let [fx, fy] = frequencies.map(|f| _mm256_set1_ps(f));
        let [sx, sy] = shift.map(|s| _mm256_set1_ps(s));
        let (x, y) = (x.as_chunks::<BLOCK>().0, y.as_chunks::<BLOCK>().0);
        for ((block, x), y) in row.as_chunks_mut::<BLOCK>().0.iter_mut().zip(x).zip(y) {
            let u = _mm256_mul_ps(_mm256_add_ps(avx2::load(x), sx), fx);
            let v = _mm256_mul_ps(_mm256_add_ps(avx2::load(y), sy), fy);
            avx2::store(block, at_avx2!(self, u, v));
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
    fn fill_avx512(&self, row: &mut [f32], (start, step): ([f32; 2], [f32; 2])) {
        use std::arch::x86_64::*;

        let [su, sv] = start.map(|s| _mm512_set1_ps(s));
        let [du, dv] = step.map(|s| _mm512_set1_ps(s));
        let mut numbers = _mm512_setr_ps(
            0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
        );
        for values in row.chunks_mut(avx512::LANES) {
            let u = _mm512_add_ps(su, _mm512_mul_ps(numbers, du));
            let v = _mm512_add_ps(sv, _mm512_mul_ps(numbers, dv));
            numbers = _mm512_add_ps(numbers, _mm512_set1_ps(avx512::LANES as f32));
            avx512::store(values, !0, at_avx512!(self, u, v));
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
    fn fill_at_avx512(
        &self,
        row: &mut [f32],
        (x, y): (&[f32], &[f32]),
        shift: [f32; 2],
        frequencies: [f32; 2],
    ) {
        use std::arch::x86_64::*;

        let [fx, fy] = frequencies.map(|f| _mm512_set1_ps(f));
        let [sx, sy] = shift.map(|s| _mm512_set1_ps(s));
        let places = x.chunks(avx512::LANES).zip(y.chunks(avx512::LANES));
        for (values, (x, y)) in row.chunks_mut(avx512::LANES).zip(places) {
            let u = _mm512_mul_ps(_mm512_add_ps(avx512::load(x), sx), fx);
            let v = _mm512_mul_ps(_mm512_add_ps(avx512::load(y), sy), fy);
            avx512::store(values, !0, at_avx512!(self, u, v));
        }
    }
}

/// Each texel with its lower neighbour, and behind each row its first texel again.
fn with_neighbours(level: &[f32]) -> Vec<[f32; 2]> {
    let size = level.len().isqrt();
    let texel = |x: usize, y: usize| level[y % size * size + x % size];
    (0..size * (size + 1))
        .map(|i| {
            let (x, y) = (i % (size + 1), i / (size + 1));
            [texel(x, y), texel(x, y + 1)]
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
    use crate::simd;
    use pdk_sdk::prelude::Key;

    #[test]
    fn a_row_is_its_places_one_by_one_on_every_processor() {
        let texture = Texture::new(&mut Key([1; 32]).sequence());
        for footprint in [0.01, 0.2, 3.0] {
            let scale = texture.scale(30.0, footprint);
            let (start, step) = ([3.7, -8.1], [0.31, 0.17]);
            let mut row = [0.0f32; 40];
            texture.fill(&mut row, (start, step), scale);
            let plain = simd::portably(|| {
                let mut plain = [0.0f32; 40];
                texture.fill(&mut plain, (start, step), scale);
                plain.map(f32::to_bits)
            });
            assert_eq!(row.map(f32::to_bits), plain);
            let places: [Vec<f32>; 2] =
                [0, 1].map(|k| (0..40).map(|i| start[k] + i as f32 * step[k]).collect());
            let anywhere = || {
                let mut row = [0.0f32; 40];
                texture.fill_at(&mut row, (&places[0], &places[1]), [0.3, -2.0], 2.5, scale);
                row.map(f32::to_bits)
            };
            assert_eq!(anywhere(), simd::portably(anywhere));
            for (i, value) in row.into_iter().enumerate() {
                let at = [0, 1].map(|k| start[k] + i as f32 * step[k]);
                let [alone, ..] = simd::portably(|| {
                    let mut row = [0.0; 8];
                    texture.fill(&mut row, (at, [0.0; 2]), scale);
                    row
                });
                assert!((value - alone).abs() < 2e-3, "{value} {alone}");
            }
        }
    }

    #[test]
    fn the_texture_repeats_and_fades_with_distance() {
        let texture = Texture::new(&mut Key([1; 32]).sequence());
        let near = texture.scale(8.0, 0.01);
        let at = |x: f32, z: f32, scale| {
            let mut block = [0.0; 8];
            texture.fill(&mut block, ([x, z], [0.0; 2]), scale);
            block[0]
        };
        assert_eq!(at(3.25, -7.5, near), at(3.25 + 32.0, -7.5 - 64.0, near));
        let spread = |scale| {
            (0..1000).map(|i| at(i as f32 * 0.37, i as f32 * 0.11, scale).abs()).sum::<f32>() / 1000.0
        };
        assert!(spread(near) > 0.2, "{}", spread(near));
        assert!(spread(texture.scale(8.0, 20.0)) < 0.05);
    }
}
