//! The road's cross-section: lane markings, asphalt, shoulder and grass as a function of the distance from its middle.
//!
//! The camera sees every part of it at another scale. So that thin lines neither flicker nor break up, a pixel takes the
//! mean of the section over all that it covers; a running sum makes the mean of any stretch cost two look-ups.

pub use pdk_road::LANE_WIDTH;

use crate::simd::BLOCK;
#[cfg(target_arch = "x86_64")]
use crate::simd::{avx2, avx512, has_avx2, has_avx512};

/// Where the middle of the road lies, seen from the centre line of the driven lane: to the left.
pub const ROAD_CENTRE: f64 = -LANE_WIDTH / 2.0;
/// Distance from the middle of the road to where the asphalt ends, in metres.
pub const PAVED_HALF_WIDTH: f64 = LANE_WIDTH + 0.45;
/// Distance from the middle of the road to the middle of a white edge line, in metres.
pub const EDGE_LINE: f64 = LANE_WIDTH - 0.1;
/// Width of the lane markings in metres.
pub const LINE_WIDTH: f64 = 0.16;
/// What is left of worn paint.
const WORN: f32 = 0.4;
/// Length of a dash of the middle line in metres, and of a dash with the gap behind it.
const DASH: f32 = 3.0;
const DASH_PERIOD: f32 = 7.5;

/// The section is known from the middle to this distance, in metres; beyond there is only grass.
pub const HALF_WIDTH: f32 = 7.0;
/// Fine enough that no place between samples is needed: a pixel is never narrower than a centimetre on the ground.
const SAMPLES_PER_METRE: f32 = 500.0;
const SAMPLES: usize = (2.0 * HALF_WIDTH * SAMPLES_PER_METRE) as usize;

/// Colour of the ground at one place, and what texture does to it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Ground {
    /// Red, green and blue, 0 to 255.
    rgb: [f32; 3],
    /// How strongly the texture changes the brightness: 0.1 for 10 %.
    texture: f32,
}

/// The colours of a section without their texture.
#[derive(Debug, Clone, Copy)]
struct Palette {
    grass: Ground,
    asphalt: Ground,
    gravel: Ground,
}

/// Lush and clean, as in a drawing.
const DRAWN: Palette = Palette {
    grass: Ground { rgb: [94.0, 124.0, 56.0], texture: 0.2 },
    asphalt: Ground { rgb: [88.0, 89.0, 92.0], texture: 0.075 },
    gravel: Ground { rgb: [146.0, 134.0, 110.0], texture: 0.16 },
};
/// As cameras see the countryside in summer: paler, drier, closer to each other.
const NATURAL: Palette = Palette {
    grass: Ground { rgb: [126.0, 124.0, 74.0], texture: 0.24 },
    asphalt: Ground { rgb: [104.0, 103.0, 104.0], texture: 0.085 },
    gravel: Ground { rgb: [148.0, 138.0, 116.0], texture: 0.2 },
};

const WHITE: Ground = Ground { rgb: [232.0, 233.0, 228.0], texture: 0.035 };
/// Colour of the line in the middle of a drawn road.
pub const YELLOW: [f32; 3] = [236.0, 184.0, 48.0];

/// How the road is marked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Markings {
    /// White edge lines and a dashed yellow line in the middle.
    Dashed,
    /// White edge lines and a solid yellow line in the middle.
    Solid,
    /// As dashed, with most of the paint gone.
    Worn,
}

impl Markings {
    /// The names, as the parameter `markings` has them.
    pub const NAMES: [&str; 3] = ["dashed", "solid", "worn"];

    /// The markings of a name; dashed for any other.
    pub fn named(name: &str) -> Self {
        match name {
            "solid" => Self::Solid,
            "worn" => Self::Worn,
            _ => Self::Dashed,
        }
    }
}

/// Places on the road along a row of pixels, in whole blocks.
pub struct Across<'a> {
    /// Distance to the right of the middle of the road in metres.
    pub offset: &'a [f32],
    /// How far a pixel extends across the road, in metres.
    pub wide: &'a [f32],
    /// Whether any pixel of a block lies near the road.
    pub near: &'a [bool],
}

/// Whether any pixel of a block covers a part of the line in the middle of the road: see [`Section::middle_line`].
#[inline(always)]
pub fn is_at_middle(offset: &[f32; BLOCK], wide: &[f32; BLOCK]) -> bool {
    any(|i| offset[i].abs() < LINE_WIDTH as f32 / 2.0 + wide[i])
}

/// As [`is_at_middle`] for either of the edge lines.
#[inline(always)]
pub fn is_at_edge(offset: &[f32; BLOCK], wide: &[f32; BLOCK]) -> bool {
    any(|i| (offset[i].abs() - EDGE_LINE as f32).abs() < LINE_WIDTH as f32 / 2.0 + wide[i])
}

#[inline(always)]
fn any(test: impl Fn(usize) -> bool) -> bool {
    // Without leaving early, so that all are tested at once.
    (0..BLOCK).fold(false, |any, i| any | test(i))
}

/// The section, in a form that gives means quickly.
#[derive(Debug)]
pub struct Section {
    markings: Markings,
    grass: [f32; 4],
    /// Without the yellow line: sums of all samples before each: red, green, blue, texture.
    sums: Vec<[f32; 4]>,
    /// The first and the last place at which the sums change; outside of them there is only grass.
    varied: [f32; 2],
}

impl Section {
    /// The section with its markings, as in a drawing.
    pub fn drawn(markings: Markings) -> Self {
        Self::new(&DRAWN, markings, true)
    }

    /// The section without any paint, as cameras see it.
    pub fn natural(markings: Markings) -> Self {
        Self::new(&NATURAL, markings, false)
    }

    /// Builds the sums.
    fn new(palette: &Palette, markings: Markings, painted: bool) -> Self {
        let Ground { rgb: [red, green, blue], texture } = palette.grass;
        let grass = [red, green, blue, texture];
        let mut sums = Vec::with_capacity(SAMPLES + 1);
        // Summed in double precision: the mean is a small difference of large sums.
        let mut total = [0.0f64; 4];
        sums.push([0.0; 4]);
        for i in 0..SAMPLES {
            let offset = (i as f32 + 0.5) / SAMPLES_PER_METRE - HALF_WIDTH;
            let ground = at(offset, palette, painted.then_some(markings));
            let values = [ground.rgb[0], ground.rgb[1], ground.rgb[2], ground.texture];
            for channel in 0..4 {
                // Less the grass, which keeps the sums small.
                total[channel] += f64::from(values[channel] - grass[channel]);
            }
            sums.push(total.map(|t| t as f32));
        }
        let varies = |at: &usize| sums[*at] != sums[*at + 1];
        let first = (0..SAMPLES).find(varies).unwrap_or(SAMPLES);
        let last = (0..SAMPLES).rfind(varies).map_or(0, |at| at + 1);
        Self { markings, grass, sums, varied: [first as f32, last as f32] }
    }

    /// Grass as red, green, blue, texture.
    #[cfg(test)]
    fn grass(&self) -> [f32; 4] {
        self.grass
    }

    /// Writes the means at places: red, green, blue, texture, in whole blocks. Blocks that are not near the road are grass.
    pub fn fill(&self, across: &Across<'_>, into: [&mut [f32]; 4]) {
        #[cfg(target_arch = "x86_64")]
        if has_avx512() {
            // SAFETY: the processor has all that this version asks for.
            return unsafe { self.fill_avx512(across, into) };
        }
        #[cfg(target_arch = "x86_64")]
        if has_avx2() {
            // SAFETY: the processor has AVX2, which is all that this version asks for.
            return unsafe { self.fill_avx2(across, into) };
        }
        self.fill_plainly(across, into);
    }

    fn fill_plainly(&self, across: &Across<'_>, into: [&mut [f32]; 4]) {
        let [red, green, blue, texture] = into;
        let places = across.offset.iter().zip(across.wide).enumerate();
        let values = red.iter_mut().zip(green).zip(blue).zip(texture);
        for ((i, (offset, wide)), (((red, green), blue), texture)) in places.zip(values) {
            let known = across.near[i / BLOCK] && offset.abs() < HALF_WIDTH + 1.0;
            [*red, *green, *blue, *texture] = if known { self.mean(*offset, *wide) } else { self.grass };
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn fill_avx2(&self, across: &Across<'_>, into: [&mut [f32]; 4]) {
        use std::arch::x86_64::*;

        let set = |value: f32| _mm256_set1_ps(value);
        let without_sign = _mm256_castsi256_ps(_mm256_set1_epi32(i32::MAX));
        // A macro, because a closure that gives back four vectors passes them through memory.
        macro_rules! place_in_sums {
            ($place:expr) => {{
                // As `clamp` and a conversion: what is not a number would be its lower bound there and is here too.
                let inside = _mm256_min_ps(_mm256_max_ps($place, set(0.0)), set(SAMPLES as f32));
                avx2::look_up!(&self.sums, _mm256_cvttps_epi32(inside))
            }};
        }
        let [red, green, blue, texture] = into.map(|values| values.as_chunks_mut::<BLOCK>().0);
        let (offsets, wides) = (across.offset.as_chunks::<BLOCK>().0, across.wide.as_chunks::<BLOCK>().0);
        for (block, near) in across.near.iter().enumerate() {
            let (offset, wide) = (avx2::load(&offsets[block]), avx2::load(&wides[block]));
            let known =
                _mm256_cmp_ps::<_CMP_LT_OQ>(_mm256_and_ps(offset, without_sign), set(HALF_WIDTH + 1.0));
            if !near || _mm256_testz_ps(known, known) == 1 {
                let [r, g, b, t] = self.grass.map(set);
                avx2::store(&mut red[block], r);
                avx2::store(&mut green[block], g);
                avx2::store(&mut blue[block], b);
                avx2::store(&mut texture[block], t);
                continue;
            }
            let half = _mm256_mul_ps(
                _mm256_max_ps(wide, set(1.0 / SAMPLES_PER_METRE)),
                set(0.5 * SAMPLES_PER_METRE),
            );
            let place = _mm256_add_ps(
                _mm256_mul_ps(_mm256_add_ps(offset, set(HALF_WIDTH)), set(SAMPLES_PER_METRE)),
                set(0.5),
            );
            let low = _mm256_floor_ps(_mm256_sub_ps(place, half));
            let high = _mm256_floor_ps(_mm256_add_ps(place, half));
            let scale = _mm256_div_ps(set(1.0), _mm256_max_ps(_mm256_sub_ps(high, low), set(1.0)));
            let (low, high) = (place_in_sums!(low), place_in_sums!(high));
            let mean = |channel: usize| {
                let grass = set(self.grass[channel]);
                let more = _mm256_mul_ps(_mm256_sub_ps(high[channel], low[channel]), scale);
                _mm256_blendv_ps(grass, _mm256_add_ps(grass, more), known)
            };
            avx2::store(&mut red[block], mean(0));
            avx2::store(&mut green[block], mean(1));
            avx2::store(&mut blue[block], mean(2));
            avx2::store(&mut texture[block], mean(3));
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
    fn fill_avx512(&self, across: &Across<'_>, into: [&mut [f32]; 4]) {
        use std::arch::x86_64::*;

        let set = |value: f32| _mm512_set1_ps(value);
        let sums = self.sums.as_flattened();
        // As for AVX2.
        macro_rules! place_in_sums {
            ($place:expr) => {{
                let inside = _mm512_min_ps(_mm512_max_ps($place, set(0.0)), set(SAMPLES as f32));
                avx512::look_up!(sums, 4, _mm512_cvttps_epi32(inside))
            }};
        }
        let floor =
            |value: __m512| _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(value);
        let grass = self.grass.map(set);
        let Across { offset, wide, near } = *across;
        let count = near.len() * BLOCK;
        let [red, green, blue, texture] = into.map(|values| &mut values[..count]);
        let (offset, wide) = (&offset[..count], &wide[..count]);
        for first in (0..count).step_by(avx512::LANES) {
            let bits = |block: usize| if near.get(block).is_some_and(|near| *near) { 0xFF } else { 0 };
            let near = bits(first / BLOCK) | bits(first / BLOCK + 1) << BLOCK;
            let (offset, wide) = (avx512::load(&offset[first..]), avx512::load(&wide[first..]));
            let known = near & _mm512_cmp_ps_mask::<_CMP_LT_OQ>(_mm512_abs_ps(offset), set(HALF_WIDTH + 1.0));
            let half = _mm512_mul_ps(
                _mm512_max_ps(wide, set(1.0 / SAMPLES_PER_METRE)),
                set(0.5 * SAMPLES_PER_METRE),
            );
            let place = _mm512_add_ps(
                _mm512_mul_ps(_mm512_add_ps(offset, set(HALF_WIDTH)), set(SAMPLES_PER_METRE)),
                set(0.5),
            );
            let (low, high) = (floor(_mm512_sub_ps(place, half)), floor(_mm512_add_ps(place, half)));
            let known = known
                & _mm512_cmp_ps_mask::<_CMP_GT_OQ>(high, set(self.varied[0]))
                & _mm512_cmp_ps_mask::<_CMP_LT_OQ>(low, set(self.varied[1]));
            let mut means = grass;
            if known != 0 {
                let scale = _mm512_div_ps(set(1.0), _mm512_max_ps(_mm512_sub_ps(high, low), set(1.0)));
                let (low, high) = (place_in_sums!(low), place_in_sums!(high));
                for (mean, (low, high)) in means.iter_mut().zip(low.into_iter().zip(high)) {
                    let more = _mm512_mul_ps(_mm512_sub_ps(high, low), scale);
                    *mean = _mm512_mask_add_ps(*mean, known, *mean, more);
                }
            }
            avx512::store(&mut red[first..], !0, means[0]);
            avx512::store(&mut green[first..], !0, means[1]);
            avx512::store(&mut blue[first..], !0, means[2]);
            avx512::store(&mut texture[first..], !0, means[3]);
        }
    }

    /// The mean over `width` metres around the place `offset` metres to the right of the middle of the road: red, green,
    /// blue, texture.
    #[inline(always)]
    pub fn mean(&self, offset: f32, width: f32) -> [f32; 4] {
        let half = width.max(1.0 / SAMPLES_PER_METRE) * (0.5 * SAMPLES_PER_METRE);
        let place = (offset + HALF_WIDTH) * SAMPLES_PER_METRE + 0.5;
        let (low, high) = ((place - half).floor(), (place + half).floor());
        // Divided by the samples that there are, which need not be as many as the width says.
        let scale = 1.0 / (high - low).max(1.0);
        let (low, high) = (self.sum(low), self.sum(high));
        let mut mean = self.grass;
        for channel in 0..4 {
            mean[channel] += (high[channel] - low[channel]) * scale;
        }
        mean
    }

    /// The share of a pixel that the yellow line covers, `offset` metres to the right of the middle of the road and `along` it,
    /// where the pixel extends `wide` and `deep` metres.
    #[inline(always)]
    pub fn middle_line(&self, offset: f32, wide: f32, along: f32, deep: f32) -> f32 {
        let half_line = LINE_WIDTH as f32 / 2.0;
        let line = cover(offset, wide.max(0.01), -half_line, half_line);
        // Without branches, so that the places of a block are computed at once.
        let dash = if self.markings == Markings::Solid { 1.0 } else { dash_cover(along, deep) };
        let left = if self.markings == Markings::Worn { WORN } else { 1.0 };
        if offset.abs() < half_line + wide { line * dash * left } else { 0.0 }
    }

    /// The share of a pixel that a white edge line covers.
    #[inline(always)]
    pub fn edge_line(&self, offset: f32, wide: f32) -> f32 {
        let half_line = LINE_WIDTH as f32 / 2.0;
        let from = offset.abs() - EDGE_LINE as f32;
        if from.abs() >= half_line + wide {
            return 0.0;
        }
        let paint = if self.markings == Markings::Worn { WORN } else { 1.0 };
        cover(from, wide.max(0.01), -half_line, half_line) * paint
    }

    /// Whether there is paint at a place this many metres to the right of the middle of the road and along it.
    pub fn is_marking(&self, offset: f32, along: f32) -> bool {
        let half_line = LINE_WIDTH as f32 / 2.0;
        let edge = (offset.abs() - EDGE_LINE as f32).abs() <= half_line;
        let dash = self.markings == Markings::Solid || along.rem_euclid(DASH_PERIOD) < DASH;
        edge || offset.abs() <= half_line && dash
    }

    /// The sum of the first samples, as many as `samples` says.
    #[inline(always)]
    fn sum(&self, samples: f32) -> &[f32; 4] {
        // By way of a signed number, which CPUs convert to directly.
        &self.sums[samples.clamp(0.0, SAMPLES as f32) as i32 as usize]
    }
}

/// The section at one place, `offset` metres to the right of the middle of the road.
fn at(offset: f32, palette: &Palette, paint: Option<Markings>) -> Ground {
    let Palette { grass, asphalt, gravel } = *palette;
    let from_middle = offset.abs();
    let from_line = (from_middle - EDGE_LINE as f32).abs();
    if let (true, Some(markings)) = (from_line <= LINE_WIDTH as f32 / 2.0, paint) {
        let paint = if markings == Markings::Worn { WORN } else { 1.0 };
        let mixed = |white: f32, asphalt: f32| asphalt + (white - asphalt) * paint;
        return Ground {
            rgb: [0, 1, 2].map(|c| mixed(WHITE.rgb[c], asphalt.rgb[c])),
            texture: mixed(WHITE.texture, asphalt.texture),
        };
    }
    let paved = PAVED_HALF_WIDTH as f32;
    if from_middle <= paved {
        // Tyres polish two tracks in each lane, and what drips from engines darkens the strip between them.
        let from_track = ((from_middle - LANE_WIDTH as f32 / 2.0).abs() - 0.8).abs();
        let polish = (1.0 - from_track / 0.45).max(0.0);
        let from_lane = (from_middle - LANE_WIDTH as f32 / 2.0).abs();
        let drip = (1.0 - from_lane / 0.35).max(0.0);
        let brightness = 1.0 + 0.07 * polish - 0.05 * drip;
        return Ground { rgb: asphalt.rgb.map(|c| c * brightness), texture: asphalt.texture };
    }
    // Gravel, overgrown the more the farther out.
    let overgrown = ((from_middle - paved - 0.25) / 1.1).clamp(0.0, 1.0);
    let mixed = |gravel: f32, grass: f32| gravel + (grass - gravel) * overgrown;
    Ground {
        rgb: [0, 1, 2].map(|c| mixed(gravel.rgb[c], grass.rgb[c])),
        texture: mixed(gravel.texture, grass.texture),
    }
}

/// The share of the stretch of `width` metres around `position` that lies between `from` and `to`.
#[inline(always)]
fn cover(position: f32, width: f32, from: f32, to: f32) -> f32 {
    let half = width * 0.5;
    (((position + half).min(to) - (position - half).max(from)) / width).clamp(0.0, 1.0)
}

/// The share of the stretch of `width` metres around `along` that dashes of the middle line cover.
#[inline(always)]
fn dash_cover(along: f32, width: f32) -> f32 {
    let painted = |position: f32| {
        let periods = (position / DASH_PERIOD).floor();
        periods * DASH + (position - periods * DASH_PERIOD).min(DASH)
    };
    let width = width.max(0.01);
    (painted(along + width * 0.5) - painted(along - width * 0.5)) / width
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_is_the_mean_of_the_samples() {
        let section = Section::drawn(Markings::Dashed);
        for (offset, width) in [(3.9, 0.3), (0.0, 0.02), (-4.3, 2.0), (6.9, 0.5), (1.0, 13.0)] {
            let count = 4000;
            let direct = (0..count)
                .map(|i| {
                    at(
                        offset + width * ((i as f32 + 0.5) / count as f32 - 0.5),
                        &DRAWN,
                        Some(Markings::Dashed),
                    )
                    .rgb[0]
                })
                .sum::<f32>()
                / count as f32;
            let mean = section.mean(offset, width)[0];
            assert!((mean - direct).abs() < 0.7, "{offset} {width}: {mean} {direct}");
        }
        assert_eq!(section.mean(50.0, 3.0), section.grass());
    }

    #[test]
    fn the_edge_line_is_white_and_lies_inside_the_lane_edge() {
        let section = Section::drawn(Markings::Dashed);
        for side in [-1.0, 1.0] {
            assert_eq!(section.mean(side * EDGE_LINE as f32, 0.05)[0].round(), WHITE.rgb[0]);
        }
        const { assert!(EDGE_LINE + LINE_WIDTH / 2.0 < LANE_WIDTH) };
    }

    #[test]
    fn dashes_cover_their_share_of_the_road() {
        assert_eq!(dash_cover(1.5, 0.5), 1.0);
        assert_eq!(dash_cover(5.0, 0.5), 0.0);
        assert!((dash_cover(3.0, 1.0) - 0.5).abs() < 1e-6);
        assert!((dash_cover(40.0, 10.0 * DASH_PERIOD) - DASH / DASH_PERIOD).abs() < 1e-5);
        assert_eq!(dash_cover(-6.0, 0.5), 1.0);
        assert_eq!(cover(0.0, 1.0, -0.25, 0.25), 0.5);
    }

    #[test]
    fn markings_differ_where_there_is_paint() {
        let [dashed, solid, worn] = [Markings::Dashed, Markings::Solid, Markings::Worn].map(Section::drawn);
        // Five metres on there is a gap between dashes.
        let yellow = |section: &Section, along| section.middle_line(0.0, 0.02, along, 0.02);
        assert!((yellow(&dashed, 1.0) - yellow(&solid, 5.0)).abs() < 0.01);
        assert!(yellow(&dashed, 5.0) < 0.01 && yellow(&worn, 1.0) < 0.7 * yellow(&dashed, 1.0));
        let white = |section: &Section| section.mean(EDGE_LINE as f32, 0.05)[0];
        assert!(white(&worn) < 0.7 * white(&dashed) && white(&worn) > 1.3 * DRAWN.asphalt.rgb[0]);
        assert_eq!(dashed.middle_line(2.0, 0.1, 1.0, 0.1), 0.0);
        assert_eq!((dashed.edge_line(EDGE_LINE as f32, 0.05), dashed.edge_line(2.0, 0.1)), (1.0, 0.0));
    }

    #[test]
    fn blocks_are_their_places_one_by_one_on_every_processor() {
        let section = Section::drawn(Markings::Dashed);
        let offset: Vec<f32> = (0..400).map(|i| (i as f32 - 200.0) * 0.05).chain([f32::NAN; 8]).collect();
        let wide: Vec<f32> = (0..408).map(|i| 0.001 * 1.03f32.powi(i % 300)).collect();
        let near: Vec<bool> = (0..51).map(|i| i % 7 != 3).collect();
        let across = Across { offset: &offset, wide: &wide, near: &near };
        let filled = || {
            let mut into: [Vec<f32>; 4] = std::array::from_fn(|_| vec![-1.0; 408]);
            section.fill(&across, into.each_mut().map(Vec::as_mut_slice));
            into.map(|values| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>())
        };
        let found = filled();
        assert_eq!(found, crate::simd::portably(filled));
        for i in 0..408 {
            let expected = match near[i / 8] {
                true if offset[i].abs() < 8.0 => section.mean(offset[i], wide[i]),
                _ => section.grass(),
            };
            assert_eq!([0, 1, 2, 3].map(|c| f32::from_bits(found[c][i])), expected, "{i}");
        }
    }
}
