//! The state of one scenario's road: how far its paint is worn, where it is missing, how damaged and how wet it is.

use std::f64::consts::PI;

use pdk_sdk::prelude::Random;

/// Metres between the stored values along the road.
const STEP: f64 = 1.0;
/// Stored before the road begins, in metres.
const BEFORE: f64 = 30.0;
/// Stored behind its end, in metres.
const BEHIND: f64 = 100.0;
/// Shortest and longest stretch without a line, in metres.
const GAPS: (f64, f64) = (8.0, 30.0);
/// Over this distance paint fades in and out at a gap, in metres.
const FADE: f64 = 2.0;

/// How a road has aged, and the weather; each from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wanted {
    /// How far the paint is worn.
    pub paint_wear: f64,
    /// The share of the road along which a line is missing.
    pub paint_missing: f64,
    /// How strongly patches, cracks and seams show.
    pub damage: f64,
    /// How wet it is.
    pub wetness: f64,
}

/// The lines of a road.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// The white one on the left.
    Left,
    /// The one in the middle.
    Middle,
    /// The white one on the right.
    Right,
}

/// The state of a road.
#[derive(Debug)]
pub struct Wear {
    /// How strongly damage shows.
    pub damage: f32,
    /// How wet it is.
    pub wetness: f32,
    /// Where on the picture of damage the road begins, across and along in metres.
    pub shift: [f32; 2],
    /// How far the paint of each line is worn, metre by metre; from 0, and above 1 nothing is left.
    lines: [Vec<f32>; 3],
}

impl Wear {
    /// Draws the state of a road of this many metres.
    pub fn new(wanted: Wanted, length: f64, random: &mut Random) -> Self {
        let count = ((BEFORE + length + BEHIND) / STEP) as usize + 2;
        let shift = [random.uniform(0.0, 10.0) as f32, random.uniform(0.0, 64.0) as f32];
        let lines = [(); 3].map(|()| {
            let mut worn = slow_swing(count, random);
            // Wear differs along the road.
            worn.iter_mut().for_each(|value| *value = (wanted.paint_wear * (0.75 + 0.4 * *value)).max(0.0));
            for (value, gone) in worn.iter_mut().zip(gaps(wanted.paint_missing, count, random)) {
                *value += 2.0 * gone;
            }
            worn.into_iter().map(|value| value as f32).collect()
        });
        Self { damage: wanted.damage as f32, wetness: wanted.wetness as f32, shift, lines }
    }

    /// How far the paint of a line is worn this many metres along the road.
    #[inline(always)]
    pub fn at(&self, line: Line, along: f32) -> f32 {
        let line = &self.lines[line as usize];
        let position = ((along + BEFORE as f32) / STEP as f32).clamp(0.0, (line.len() - 2) as f32);
        let index = position as usize;
        line[index] + (line[index + 1] - line[index]) * (position - index as f32)
    }

    /// What is left of paint that is worn so far, from 0 to 1, where the texture of the road has this value.
    #[inline(always)]
    pub fn left(worn: f32, texture: f32) -> f32 {
        // First it pales evenly, then the high places are bare, at last all of it.
        (1.0 - 0.55 * worn - worn * (0.25 + 1.1 * texture).max(0.0) - 4.0 * (worn - 1.0).max(0.0))
            .clamp(0.0, 1.0)
    }
}

/// Values from about -1 to 1 that change over tens of metres.
fn slow_swing(count: usize, random: &mut Random) -> Vec<f64> {
    let waves = [70.0, 31.0, 13.0].map(|period| (period, random.uniform(0.0, 2.0 * PI)));
    (0..count)
        .map(|i| {
            let swing = |(period, phase): (f64, f64)| libm::sin(2.0 * PI * i as f64 * STEP / period + phase);
            waves.iter().map(|wave| swing(*wave)).sum::<f64>() / 2.0
        })
        .collect()
}

/// How far a line is missing, from 0 to 1, metre by metre: gaps that take up this share of it, each somewhere in a stretch of its own.
fn gaps(share: f64, count: usize, random: &mut Random) -> Vec<f64> {
    let mut missing = vec![0.0; count];
    let mut start = 0.0;
    while share > 0.0 && start < count as f64 {
        let gap = random.uniform(GAPS.0, GAPS.1).min(share * 200.0);
        let stretch = gap / share;
        let from = start + random.unit() * (stretch - gap).max(0.0);
        for (i, value) in missing.iter_mut().enumerate() {
            let inside = (i as f64 * STEP - from).min(from + gap - i as f64 * STEP);
            *value = (inside / FADE + 0.5).clamp(*value, 1.0f64.max(*value));
        }
        start += stretch;
    }
    missing
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::Key;

    fn wear(wanted: Wanted) -> Wear {
        Wear::new(wanted, 4000.0, &mut Key([5; 32]).sequence())
    }

    #[test]
    fn as_much_paint_is_missing_as_is_wanted() {
        for share in [0.0, 0.1, 0.4] {
            let wear = wear(Wanted { paint_missing: share, ..Wanted::default() });
            for line in [Line::Left, Line::Middle, Line::Right] {
                let gone =
                    (0..4000).filter(|along| Wear::left(wear.at(line, *along as f32), 0.0) < 0.5).count();
                assert!(
                    (gone as f64 / 4000.0 - share).abs() < 0.3 * share + 0.005,
                    "{line:?} {share}: {gone}"
                );
            }
        }
    }

    #[test]
    fn paint_wears_until_nothing_is_left() {
        let mean = |paint_wear: f64| {
            let wear = wear(Wanted { paint_wear, ..Wanted::default() });
            let left = |along: u32, texture: f32| Wear::left(wear.at(Line::Right, along as f32), texture);
            (0..4000u32).map(|along| f64::from(left(along, (along % 7) as f32 / 3.0 - 1.0))).sum::<f64>()
                / 4000.0
        };
        let means = [0.0, 0.3, 0.6, 1.0].map(mean);
        assert_eq!(means[0], 1.0);
        assert!(means.is_sorted_by(|more, less| more > less), "{means:?}");
        assert!(means[3] < 0.4, "{means:?}");
        assert_eq!(Wear::left(2.0, -1.0), 0.0);
    }
}
