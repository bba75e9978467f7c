//! Defective pixels: photosites, rows and columns of the sensor that are dead, hot or stuck.

use pdk_sdk::prelude::*;

/// The most defects that a frame may have, as a share of its pixels.
const MOST: f64 = 0.2;
/// The most defective rows, and columns.
const MOST_LINES: i64 = 32;

/// Puts defects into the sensor.
pub struct DefectivePixels;

impl Component for DefectivePixels {
    fn description() -> Description {
        Description::perturbation(
            "defective_pixels",
            "Makes photosites of the sensor dead, hot or stuck, and rows and columns as well, each of which spreads to its neighbours \
             where colours are interpolated",
        )
        .version(2)
        .family("camera")
        .not_default()
        .keeps_geometry()
        .mathematics("v + w (defect - v) in the channel of the photosite, w = 1 at it, 1/2 or 1/4 where its colour is interpolated")
        .drawn_per_sequence("where the defects are, and what they show")
        .source("Hot, dead and stuck pixels as in EMVA 1288; bilinear interpolation of the pattern of Bayer, US patent 3971065 (1976)")
        .parameter(
            Parameter::by_level("share", [0.0002, 0.001, 0.004, 0.015, 0.05], "share of the photosites that are defective")
                .range(0.0, MOST),
        )
        .parameter(
            Parameter::by_level("lines", [0.0, 1.0, 2.0, 4.0, 8.0], "how many rows, and how many columns, are defective")
                .range(0.0, MOST_LINES as f64),
        )
        .parameter(Parameter::choice(
            "show",
            &["any", "hot", "dead"],
            "what defects show: any: white, black or a value at which they are stuck; hot: white; dead: black",
        ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

/// What a defect shows.
fn shows(random: &mut Random, only: i64) -> u8 {
    let drawn = random.below(3);
    let stuck = random.below(256) as u8;
    match (only, drawn) {
        (1, _) | (0, 0) => 255,
        (2, _) | (0, 1) => 0,
        _ => stuck,
    }
}

/// The channel of a photosite: red and green in even rows, green and blue in odd ones.
fn channel(x: usize, y: usize) -> usize {
    x % 2 + y % 2
}

/// How far a photosite at this place reaches, and with which weight in 1/4: its own colour is interpolated from its neighbours.
fn weight(channel: usize, right: isize, down: isize) -> i32 {
    match (right.abs() + down.abs(), channel) {
        (0, _) => 4,
        // Red and blue between two of their kind, and between four.
        (1, 0 | 2) => 2,
        (2, 0 | 2) => 1,
        // Green between four of its kind.
        (1, _) => 1,
        _ => 0,
    }
}

/// Makes the photosite at a place show a value, instead of what it shows so far: no other photosite reaches its own channel there.
fn mark(dst: &mut FrameMut<'_>, [x, y]: [usize; 2], value: u8) {
    let (channel, width, height) = (channel(x, y), dst.width(), dst.height());
    let difference = i32::from(value) - i32::from(dst.row_mut(y)[3 * x + channel]);
    for down in -1..=1isize {
        for right in -1..=1isize {
            let weight = weight(channel, right, down);
            let (Some(x), Some(y)) = (x.checked_add_signed(right), y.checked_add_signed(down)) else {
                continue;
            };
            if weight == 0 || x >= width || y >= height {
                continue;
            }
            let to = &mut dst.row_mut(y)[3 * x + channel];
            *to = (i32::from(*to) + difference * weight / 4).clamp(0, 255) as u8;
        }
    }
}

impl Perturbation for DefectivePixels {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        dst.copy_from(src);
        let (width, height) = (src.width(), src.height());
        let only = cx.integer("show");
        // In this order, so that a higher level adds defects to those of the lower ones.
        let mut random = cx.sequence_random();
        let lines = cx.integer("lines");
        for line in 0..MOST_LINES {
            let (row, of_row) = (random.below(height as u32) as usize, shows(&mut random, only));
            let (column, of_column) = (random.below(width as u32) as usize, shows(&mut random, only));
            if line < lines {
                (0..width).for_each(|x| mark(&mut dst, [x, row], of_row));
                (0..height).for_each(|y| mark(&mut dst, [column, y], of_column));
            }
        }
        let count = (cx.number("share").clamp(0.0, MOST) * (width * height) as f64).round() as usize;
        for _ in 0..count {
            let place = [random.below(width as u32) as usize, random.below(height as u32) as usize];
            let value = shows(&mut random, only);
            mark(&mut dst, place, value);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::*;
    use crate::test_frames::{even, perturbed};

    /// What a sensor with a defect delivers: its pattern of photosites, interpolated.
    fn interpolated(photosites: &[Vec<f64>]) -> Vec<Vec<[f64; 3]>> {
        let (height, width) = (photosites.len(), photosites[0].len());
        let around = |place: usize, length: usize| place.saturating_sub(1)..(place + 2).min(length);
        let mean = |channel: usize, x: usize, y: usize| {
            // The nearest photosites of a colour around a place, one step away at most.
            let mut found = Vec::new();
            for reach in 0..=2 {
                for v in around(y, height) {
                    for u in around(x, width) {
                        if super::channel(u, v) == channel && u.abs_diff(x) + v.abs_diff(y) == reach {
                            found.push(photosites[v][u]);
                        }
                    }
                }
                if !found.is_empty() {
                    break;
                }
            }
            found.iter().sum::<f64>() / found.len() as f64
        };
        (0..height)
            .map(|y| (0..width).map(|x| [0, 1, 2].map(|channel| mean(channel, x, y))).collect())
            .collect()
    }

    #[test]
    fn a_defect_spreads_as_interpolation_of_the_pattern_spreads_it() {
        for (x, y) in [(4, 4), (5, 4), (4, 5), (5, 5)] {
            let mut photosites = vec![vec![80.0; 12]; 10];
            photosites[y][x] = 240.0;
            let expected = interpolated(&photosites);
            let source = even(80, 12, 10);
            let mut target = source.clone();
            mark(&mut target.as_mut(), [x, y], 240);
            for (v, row) in expected.iter().enumerate() {
                for (u, pixel) in row.iter().enumerate() {
                    assert_eq!(target.as_ref().pixel(u, v).map(f64::from), *pixel, "{u} {v} of {x} {y}");
                }
            }
        }
    }

    #[test]
    fn of_two_defects_of_a_photosite_the_second_shows() {
        for (x, y) in [(4, 4), (5, 4), (5, 5)] {
            let (mut once, mut twice) = (even(100, 12, 10), even(100, 12, 10));
            mark(&mut once.as_mut(), [x, y], 150);
            [180, 150].into_iter().for_each(|value| mark(&mut twice.as_mut(), [x, y], value));
            // Parts of both are rounded around it.
            let near = |(a, b): (&u8, &u8)| a.abs_diff(*b) <= 1;
            assert!(once.data().iter().zip(twice.data()).all(near));
            assert_eq!(once.as_ref().pixel(x, y), twice.as_ref().pixel(x, y));
        }
    }

    #[test]
    fn a_higher_level_adds_defects_to_those_of_the_lower_ones() {
        let source = even(100, 97, 61);
        let changed = |level: f64| -> Vec<usize> {
            let found = perturbed::<DefectivePixels>(
                &json!({"lines": 0, "show": "hot"}),
                level,
                (3, 0.1),
                std::slice::from_ref(&source),
            );
            (0..found.data().len()).filter(|place| found.data()[*place] != 100).collect()
        };
        let all: Vec<Vec<usize>> = (0..=8).map(|step| changed(f64::from(step) / 2.0)).collect();
        for pair in all.windows(2) {
            assert!(pair[0].iter().all(|place| pair[1].contains(place)) && pair[0].len() < pair[1].len());
        }
        // A photosite of green changes five values, one of red or blue nine; half are green.
        let defects = (0.05 * 97.0 * 61.0) as usize;
        assert!((5 * defects..8 * defects).contains(&all[8].len()), "{}", all[8].len());
    }

    #[test]
    fn lines_go_through_the_whole_frame() {
        let found = perturbed::<DefectivePixels>(
            &json!({"lines": 1, "share": 0, "show": "dead"}),
            0.0,
            (0, 0.0),
            &[even(90, 40, 30)],
        );
        let dark = |values: Vec<[u8; 3]>| values.iter().all(|pixel| pixel.contains(&0));
        let frame = found.as_ref();
        assert_eq!((0..30).filter(|y| dark((0..40).map(|x| frame.pixel(x, *y)).collect())).count(), 1);
        assert_eq!((0..40).filter(|x| dark((0..30).map(|y| frame.pixel(*x, y)).collect())).count(), 1);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<DefectivePixels>();
        crate::allocations::on_the_first_frames_alone::<DefectivePixels>();
    }
}
