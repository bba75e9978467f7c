//! Masks from saliency maps: which pixels of a frame are chosen, and how the edges of what is chosen are treated.

use pdk_model::selection::{Choice, Selection};
use pdk_sdk::error::Result;
use pdk_sdk::prelude::{Frame, Key};

use crate::maps::{Maps, Turns};
use crate::moment::Moment;
use crate::registry::Registry;

/// Chooses pixels frame by frame.
pub struct Selector {
    selection: Selection,
    turns: Turns,
    /// None where pixels are chosen at random.
    maps: Option<Maps>,
    /// What the choice among equal pixels is drawn from.
    key: Key,
    /// How much of each pixel is changed, for the map and place of the image that they were made for.
    weights: Vec<u8>,
}

impl Selector {
    /// Makes the method.
    ///
    /// # Errors
    /// Where there is no such method, or it refuses its parameters.
    pub fn new(registry: &Registry, selection: &Selection, key: Key) -> Result<Self> {
        let by = selection.by.as_ref().filter(|_| selection.random.is_none());
        let maps = by.map(|by| Maps::new(registry, by, key)).transpose()?;
        let turns = Turns::new(selection.pace());
        Ok(Self { selection: selection.clone(), turns, maps, key, weights: Vec::new() })
    }

    /// How much of each pixel is changed, 0 to 255, row by row; `raw` is the frame as the camera saw it.
    ///
    /// # Errors
    /// Where the method fails.
    pub fn weights(&mut self, raw: Frame<'_>, moment: &Moment) -> Result<&[u8]> {
        let turn = self.turns.of(raw, moment);
        // What follows the image is chosen again, so that it is as many pixels as before.
        if turn.new || turn.moved != [0, 0] {
            let (width, height) = (raw.width(), raw.height());
            let chosen = match &mut self.maps {
                Some(maps) => choose(&self.selection, maps.of(raw, moment, turn)?, &self.key, turn.period),
                None => choose(&self.selection, &vec![0.0; width * height], &self.key, turn.period),
            };
            self.weights = finish(chosen, (width, height), &self.selection);
        }
        Ok(&self.weights)
    }
}

/// Whether each pixel is chosen. Among equal ones it is drawn.
fn choose(selection: &Selection, map: &[f32], key: &Key, period: u64) -> Vec<bool> {
    let share = match selection.choice() {
        Choice::Above(least) => return map.iter().map(|&value| value > least as f32).collect(),
        Choice::Top(share) | Choice::Bottom(share) | Choice::Random(share) => share,
    };
    let count = (share * map.len() as f64).round() as usize;
    if count == 0 || count >= map.len() {
        return vec![count > 0; map.len()];
    }
    let bottom = matches!(selection.choice(), Choice::Bottom(_));
    let order: Vec<f32> = map.iter().map(|value| if bottom { *value } else { -value }).collect();
    let mut sorted = order.clone();
    let (_, last, _) = sorted.select_nth_unstable_by(count - 1, f32::total_cmp);
    let mut chosen: Vec<bool> = order.iter().map(|value| value < last).collect();
    let mut equal: Vec<usize> = (0..order.len()).filter(|&at| order[at] == *last).collect();
    let missing = count - chosen.iter().filter(|chosen| **chosen).count();
    let mut random = key.frame(period);
    for place in 0..missing {
        let other = place + random.below((equal.len() - place) as u32) as usize;
        equal.swap(place, other);
        chosen[equal[place]] = true;
    }
    chosen
}

/// Closes gaps, leaves out small spots, and softens the edges, in this order.
fn finish(mut chosen: Vec<bool>, (width, height): (usize, usize), selection: &Selection) -> Vec<u8> {
    if selection.close > 0 {
        let reach = selection.close as usize;
        // What lies beyond the frame is neither chosen nor left out.
        chosen = spread(&chosen, width, height, reach, true);
        chosen = spread(&chosen, width, height, reach, false);
    }
    if selection.smallest > 0 {
        leave_out_small(&mut chosen, width, height, selection.smallest as usize);
    }
    let weights: Vec<u8> = chosen.into_iter().map(|chosen| u8::from(chosen) * 255).collect();
    match selection.soft {
        0 => weights,
        soft => soften(weights, width, height, soft as usize),
    }
}

/// Spreads `value` to all pixels within a square of `reach` pixels around those that have it.
fn spread(pixels: &[bool], width: usize, height: usize, reach: usize, value: bool) -> Vec<bool> {
    let along = |from: &[bool], length: usize, lines: usize, at: &dyn Fn(usize, usize) -> usize| {
        let mut to = vec![!value; from.len()];
        for line in 0..lines {
            // How far back the last pixel of that value is, forwards and backwards.
            for backwards in [false, true] {
                let mut since = usize::MAX;
                for step in 0..length {
                    let place = at(line, if backwards { length - 1 - step } else { step });
                    since = if from[place] == value { 0 } else { since.saturating_add(1) };
                    if since <= reach {
                        to[place] = value;
                    }
                }
            }
        }
        to
    };
    let rows = along(pixels, width, height, &|row, column| row * width + column);
    along(&rows, height, width, &|column, row| row * width + column)
}

/// Leaves out spots, joined by their sides, of fewer pixels.
fn leave_out_small(chosen: &mut [bool], width: usize, height: usize, smallest: usize) {
    let mut seen = vec![false; chosen.len()];
    let mut spot = Vec::new();
    for start in 0..chosen.len() {
        if !chosen[start] || std::mem::replace(&mut seen[start], true) {
            continue;
        }
        spot.clear();
        spot.push(start);
        let mut next = 0;
        while let Some(&at) = spot.get(next) {
            next += 1;
            let (x, y) = (at % width, at / width);
            let sides = [
                (x > 0).then(|| at - 1),
                (x + 1 < width).then(|| at + 1),
                (y > 0).then(|| at - width),
                (y + 1 < height).then(|| at + width),
            ];
            for side in sides.into_iter().flatten() {
                if chosen[side] && !std::mem::replace(&mut seen[side], true) {
                    spot.push(side);
                }
            }
        }
        if spot.len() < smallest {
            spot.iter().for_each(|&at| chosen[at] = false);
        }
    }
}

/// The mean over a square of `2 soft + 1` pixels, whose sides end at the frame.
fn soften(weights: Vec<u8>, width: usize, height: usize, soft: usize) -> Vec<u8> {
    let along = |from: &[u8], length: usize, lines: usize, at: &dyn Fn(usize, usize) -> usize| {
        let mut to = vec![0; from.len()];
        let mut sums = vec![0u64; length + 1];
        for line in 0..lines {
            for step in 0..length {
                sums[step + 1] = sums[step] + u64::from(from[at(line, step)]);
            }
            for step in 0..length {
                let (first, end) = (step.saturating_sub(soft), (step + soft + 1).min(length));
                let count = (end - first) as u64;
                to[at(line, step)] = ((sums[end] - sums[first] + count / 2) / count) as u8;
            }
        }
        to
    };
    let rows = along(&weights, width, height, &|row, column| row * width + column);
    along(&rows, height, width, &|column, row| row * width + column)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::FrameBuf;
    use serde_json::{Value, json};

    fn selection(value: Value) -> Selection {
        Selection::from_json(&value).unwrap()
    }

    fn chosen(value: Value, map: &[f32]) -> Vec<usize> {
        let chosen = choose(&selection(value), map, &Key([5; 32]), 0);
        chosen.iter().enumerate().filter(|(_, chosen)| **chosen).map(|(at, _)| at).collect()
    }

    #[test]
    fn exactly_the_share_is_chosen_from_the_right_end() {
        let map = [0.1, 0.9, 0.5, 0.7, 0.3, 0.2, 0.8, 0.0, 0.4, 0.6];
        assert_eq!(chosen(json!({"top": 30, "by": "x"}), &map), [1, 3, 6]);
        assert_eq!(chosen(json!({"bottom": 20, "by": "x"}), &map), [0, 7]);
        assert_eq!(chosen(json!({"above": 0.6, "by": "x"}), &map), [1, 3, 6]);
        assert_eq!(chosen(json!({"top": 0, "by": "x"}), &map), [0; 0]);
        assert_eq!(chosen(json!({"top": 100, "by": "x"}), &map).len(), 10);
        assert_eq!(chosen(json!({"random": 30}), &map).len(), 3);
        // Only what is equal at the edge of the share is drawn, and zeros are equal whatever their sign.
        let map = [0.0, -0.0, 0.9, 0.0, 0.5, -0.0, 0.0, 0.0, 0.0, 0.0];
        let top = chosen(json!({"top": 50, "by": "x"}), &map);
        assert!(top.len() == 5 && top.contains(&2) && top.contains(&4), "{top:?}");
    }

    #[test]
    fn equal_pixels_are_drawn_by_the_seed_and_the_period() {
        let map = [0.5; 1000];
        for value in [json!({"top": 20, "by": "x"}), json!({"bottom": 20, "by": "x"}), json!({"random": 20})]
        {
            let draw = |period| choose(&selection(value.clone()), &map, &Key([5; 32]), period);
            assert_eq!(draw(0).iter().filter(|chosen| **chosen).count(), 200);
            assert_eq!(draw(0), draw(0));
            assert_ne!(draw(0), draw(1));
            assert_ne!(draw(0), choose(&selection(value.clone()), &map, &Key([6; 32]), 0));
            // Drawn over the whole frame, not from its beginning.
            assert!((70..130).contains(&draw(0)[500..].iter().filter(|chosen| **chosen).count()));
        }
    }

    #[test]
    fn a_choice_stays_for_its_period() {
        let frame = FrameBuf::new(20, 20);
        let selector = || {
            let selection = selection(json!({"random": 50, "every": 3}));
            let turns = Turns::new(selection.pace());
            Selector { selection, turns, maps: None, key: Key([5; 32]), weights: Vec::new() }
        };
        let mut first = selector();
        let mut at = |index| first.weights(frame.as_ref(), &Moment::new(index, 0.0)).unwrap().to_vec();
        let weights: Vec<_> = (0..5).map(&mut at).collect();
        assert!(weights[0] == weights[1] && weights[1] == weights[2] && weights[2] != weights[3]);
        // A later period is the same whatever came before it.
        assert_eq!(selector().weights(frame.as_ref(), &Moment::new(4, 0.0)).unwrap(), weights[4]);
    }

    fn treat(rows: &[&str], value: Value) -> Vec<String> {
        let width = rows[0].len();
        let chosen = rows.iter().flat_map(|row| row.bytes().map(|byte| byte == b'#')).collect();
        let weights = finish(chosen, (width, rows.len()), &selection(value));
        weights
            .chunks(width)
            .map(|row| row.iter().map(|&w| if w > 127 { '#' } else { '.' }).collect())
            .collect()
    }

    #[test]
    fn gaps_are_closed_and_small_spots_are_left_out() {
        let rows = ["##.##...", "##.##...", "##.##...", "........", ".......#"];
        let closed = treat(&rows, json!({"random": 1, "close": 1}));
        assert_eq!(closed[..3], ["#####...", "#####...", "#####..."]);
        assert_eq!(closed[4].chars().last(), Some('#'));
        let cleaned = treat(&rows, json!({"random": 1, "smallest": 4}));
        assert_eq!(cleaned, ["##.##...", "##.##...", "##.##...", "........", "........"]);
        assert_eq!(treat(&rows, json!({"random": 1, "smallest": 6})), cleaned);
        assert!(treat(&rows, json!({"random": 1, "smallest": 7})).iter().all(|row| !row.contains('#')));
    }

    #[test]
    fn soft_edges_are_blended() {
        let chosen = (0..20).map(|x| x >= 10).collect();
        let weights = finish(chosen, (20, 1), &selection(json!({"random": 1, "soft": 2})));
        assert_eq!(weights[6..14], [0, 0, 51, 102, 153, 204, 255, 255]);
    }
}
