//! The road's cross-section: lane markings, asphalt, shoulder and grass as a function of the distance from its middle.
//!
//! The camera sees every part of it at another scale. So that thin lines neither flicker nor break up, a pixel takes the
//! mean of the section over all that it covers; a running sum makes the mean of any stretch cost two look-ups.

pub use pdk_road::LANE_WIDTH;

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

/// Colour of grass without its texture.
const GRASS: Ground = Ground { rgb: [94.0, 124.0, 56.0], texture: 0.2 };
const ASPHALT: Ground = Ground { rgb: [88.0, 89.0, 92.0], texture: 0.075 };
const WHITE: Ground = Ground { rgb: [232.0, 233.0, 228.0], texture: 0.035 };
const GRAVEL: Ground = Ground { rgb: [146.0, 134.0, 110.0], texture: 0.16 };
/// Colour of the line in the middle.
const YELLOW: [f32; 3] = [236.0, 184.0, 48.0];

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

/// The section, in a form that gives means quickly.
#[derive(Debug)]
pub struct Section {
    markings: Markings,
    /// Without the yellow line: sums of all samples before each: red, green, blue, texture.
    sums: Vec<[f32; 4]>,
}

impl Section {
    /// Builds the sums.
    pub fn new(markings: Markings) -> Self {
        let mut sums = Vec::with_capacity(SAMPLES + 1);
        // Summed in double precision: the mean is a small difference of large sums.
        let mut total = [0.0f64; 4];
        sums.push([0.0; 4]);
        for i in 0..SAMPLES {
            let ground = at((i as f32 + 0.5) / SAMPLES_PER_METRE - HALF_WIDTH, markings);
            let values = [ground.rgb[0], ground.rgb[1], ground.rgb[2], ground.texture];
            for channel in 0..4 {
                // Less the grass, which keeps the sums small.
                total[channel] += f64::from(values[channel] - grass()[channel]);
            }
            sums.push(total.map(|t| t as f32));
        }
        Self { markings, sums }
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
        let mut mean = grass();
        for channel in 0..4 {
            mean[channel] += (high[channel] - low[channel]) * scale;
        }
        mean
    }

    /// As [`Section::mean`], with the yellow line as it is `along` the road, where a pixel extends `deep` metres that way.
    #[inline(always)]
    pub fn ground(&self, offset: f32, wide: f32, along: f32, deep: f32) -> [f32; 4] {
        let mut ground = self.mean(offset, wide);
        let half_line = LINE_WIDTH as f32 / 2.0;
        if offset.abs() < half_line + wide {
            let line = cover(offset, wide.max(0.01), -half_line, half_line);
            let share = match self.markings {
                Markings::Solid => line,
                Markings::Dashed => line * dash_cover(along, deep),
                Markings::Worn => line * dash_cover(along, deep) * WORN,
            };
            for (c, yellow) in ground.iter_mut().zip(YELLOW) {
                *c += (yellow - *c) * share;
            }
        }
        ground
    }

    /// Whether there is paint at a place so many metres to the right of the middle of the road and along it.
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

/// Grass as red, green, blue, texture.
pub const fn grass() -> [f32; 4] {
    [GRASS.rgb[0], GRASS.rgb[1], GRASS.rgb[2], GRASS.texture]
}

/// The section at one place, `offset` metres to the right of the middle of the road.
fn at(offset: f32, markings: Markings) -> Ground {
    let from_middle = offset.abs();
    let from_line = (from_middle - EDGE_LINE as f32).abs();
    if from_line <= LINE_WIDTH as f32 / 2.0 {
        let paint = if markings == Markings::Worn { WORN } else { 1.0 };
        let mixed = |white: f32, asphalt: f32| asphalt + (white - asphalt) * paint;
        return Ground {
            rgb: [0, 1, 2].map(|c| mixed(WHITE.rgb[c], ASPHALT.rgb[c])),
            texture: mixed(WHITE.texture, ASPHALT.texture),
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
        return Ground { rgb: ASPHALT.rgb.map(|c| c * brightness), texture: ASPHALT.texture };
    }
    // Gravel, overgrown the more the farther out.
    let overgrown = ((from_middle - paved - 0.25) / 1.1).clamp(0.0, 1.0);
    let mixed = |gravel: f32, grass: f32| gravel + (grass - gravel) * overgrown;
    Ground {
        rgb: [0, 1, 2].map(|c| mixed(GRAVEL.rgb[c], GRASS.rgb[c])),
        texture: mixed(GRAVEL.texture, GRASS.texture),
    }
}

/// The share of the stretch of `width` metres around `position` that lies between `from` and `to`.
fn cover(position: f32, width: f32, from: f32, to: f32) -> f32 {
    let half = width * 0.5;
    (((position + half).min(to) - (position - half).max(from)) / width).clamp(0.0, 1.0)
}

/// The share of the stretch of `width` metres around `along` that dashes of the middle line cover.
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
        let section = Section::new(Markings::Dashed);
        for (offset, width) in [(3.9, 0.3), (0.0, 0.02), (-4.3, 2.0), (6.9, 0.5), (1.0, 13.0)] {
            let count = 4000;
            let direct = (0..count)
                .map(|i| {
                    at(offset + width * ((i as f32 + 0.5) / count as f32 - 0.5), Markings::Dashed).rgb[0]
                })
                .sum::<f32>()
                / count as f32;
            let mean = section.mean(offset, width)[0];
            assert!((mean - direct).abs() < 0.7, "{offset} {width}: {mean} {direct}");
        }
        assert_eq!(section.mean(50.0, 3.0), grass());
    }

    #[test]
    fn the_edge_line_is_white_and_lies_inside_the_lane_edge() {
        let section = Section::new(Markings::Dashed);
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
        let [dashed, solid, worn] = [Markings::Dashed, Markings::Solid, Markings::Worn].map(Section::new);
        // Five metres on there is a gap between dashes.
        let yellow = |section: &Section, along| section.ground(0.0, 0.02, along, 0.02)[0];
        assert!((yellow(&dashed, 1.0) - yellow(&solid, 5.0)).abs() < 0.01);
        assert!(yellow(&dashed, 5.0) < 100.0 && yellow(&worn, 1.0) < 0.7 * yellow(&dashed, 1.0));
        let white = |section: &Section| section.mean(EDGE_LINE as f32, 0.05)[0];
        assert!(white(&worn) < 0.7 * white(&dashed) && white(&worn) > 1.3 * ASPHALT.rgb[0]);
        assert_eq!(dashed.ground(2.0, 0.1, 1.0, 0.1), dashed.mean(2.0, 0.1));
    }
}
