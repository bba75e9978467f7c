//! Masks from saliency maps: which pixels of a frame are chosen, and how the edges of what is chosen are treated.

use pdk_model::selection::{Choice, Selection};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Frame, FrameBuf, HeatmapMut, Key, MapContext, Saliency};

use crate::calls::{self, Function};
use crate::registry::Registry;

/// Chooses pixels frame by frame.
pub struct Selector {
    selection: Selection,
    /// The method with what messages call it.
    method: Option<(Box<dyn Saliency>, String)>,
    /// What maps and the choice among equal pixels are drawn from.
    key: Key,
    /// Which map is in use: the number of its frame where it stays until a change, else that divided by how long it stays.
    period: Option<u64>,
    /// The frame whose map is in use, where it stays until a change.
    seen: FrameBuf,
    size: (usize, usize),
    weights: Vec<u8>,
}

impl Selector {
    /// Makes the method.
    ///
    /// # Errors
    /// Where there is no such method, or it refuses its parameters.
    pub fn new(registry: &Registry, selection: &Selection, key: Key) -> Result<Self> {
        let method = match &selection.by {
            Some(by) => {
                let (instance, _) = registry.saliency(&by.name, &by.parameters)?;
                Some((instance, format!("saliency `{}`", by.name)))
            }
            None => None,
        };
        let (seen, size, weights) = (FrameBuf::default(), (0, 0), Vec::new());
        Ok(Self { selection: selection.clone(), method, key, period: None, seen, size, weights })
    }

    /// How much of each pixel is changed, 0 to 255, row by row; `raw` is the frame as the camera saw it.
    ///
    /// # Errors
    /// Where the method fails.
    pub fn weights(&mut self, raw: Frame<'_>, frame_index: u64, time: f64) -> Result<&[u8]> {
        let size = (raw.width(), raw.height());
        let period = match (self.selection.change, self.period) {
            (None, _) => frame_index / self.selection.every,
            (Some(change), Some(period))
                if self.size == size && difference(self.seen.as_ref(), raw) <= change =>
            {
                period
            }
            (Some(_), _) => {
                self.seen.resize(raw.width(), raw.height());
                self.seen.as_mut().copy_from(raw);
                frame_index
            }
        };
        if self.period != Some(period) || self.size != size {
            let map = self.map(raw, frame_index, time)?;
            let chosen = self.choose(&map, period);
            self.weights = finish(chosen, size, &self.selection);
            (self.period, self.size) = (Some(period), size);
        }
        Ok(&self.weights)
    }

    /// The map of a frame; nothing in it where no map is needed.
    fn map(&mut self, raw: Frame<'_>, frame_index: u64, time: f64) -> Result<Vec<f32>> {
        let (width, height) = (raw.width(), raw.height());
        let mut values = vec![0.0; width * height];
        if let (Some((method, label)), false) = (&mut self.method, self.selection.random.is_some()) {
            let cx = MapContext { frame_index, time, key: &self.key };
            values = map(&mut **method, label, raw, &cx)?;
            if !values.iter().all(|value| value.is_finite()) {
                return Err(Error::new(format!(
                    "{label}: its map of frame {frame_index} holds numbers that are not finite"
                )));
            }
        }
        Ok(values)
    }

    /// Whether each pixel is chosen. Among equal ones it is drawn.
    fn choose(&self, map: &[f32], period: u64) -> Vec<bool> {
        let share = match self.selection.choice() {
            Choice::Above(least) => return map.iter().map(|&value| value > least as f32).collect(),
            Choice::Top(share) | Choice::Bottom(share) | Choice::Random(share) => share,
        };
        let bottom = matches!(self.selection.choice(), Choice::Bottom(_));
        let count = (share * map.len() as f64).round() as usize;
        let mut random = self.key.frame(period);
        let mut order: Vec<(f32, u64, usize)> = map
            .iter()
            .enumerate()
            .map(|(at, &value)| (if bottom { value } else { -value }, random.next_u64(), at))
            .collect();
        let mut chosen = vec![false; map.len()];
        if count > 0 && count < map.len() {
            order.select_nth_unstable_by(count - 1, |a, b| {
                a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2))
            });
        }
        order[..count].iter().for_each(|(_, _, at)| chosen[*at] = true);
        chosen
    }
}

/// The map of a frame by a method, brought to the size of the frame. `label` is what messages call the method.
///
/// # Errors
/// Where the method fails.
pub fn map(
    method: &mut dyn Saliency,
    label: &str,
    frame: Frame<'_>,
    cx: &MapContext<'_>,
) -> Result<Vec<f32>> {
    let size = [frame.width(), frame.height()];
    let work = || {
        let [width, height] = method.map_size(size[0], size[1])?;
        let mut values = vec![0.0; width * height];
        method.map(frame, cx, HeatmapMut::new(&mut values, width, height)?)?;
        Ok((values, [width, height]))
    };
    let (values, made) =
        calls::call_at(label, Function::Map, cx.frame_index, work).map_err(|error: Error| error.at(label))?;
    Ok(if made == size { values } else { stretch(&values, made, size) })
}

/// A map in another size, each part as large as all others.
fn stretch(values: &[f32], [width, height]: [usize; 2], to: [usize; 2]) -> Vec<f32> {
    let rows = (0..to[1]).map(|y| y * height / to[1]);
    rows.flat_map(|row| (0..to[0]).map(move |x| values[row * width + x * width / to[0]])).collect()
}

/// The mean difference of all values of two frames of the same size.
fn difference(a: Frame<'_>, b: Frame<'_>) -> f64 {
    let rows = a.rows().zip(b.rows());
    let sum: u64 = rows.flat_map(|(a, b)| a.iter().zip(b)).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / (a.width() * a.height() * 3) as f64
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
    use serde_json::{Value, json};

    fn selection(value: Value) -> Selection {
        Selection::from_json(&value).unwrap()
    }

    fn selector(value: Value) -> Selector {
        let key = Key([5; 32]);
        Selector {
            selection: selection(value),
            method: None,
            key,
            period: None,
            seen: FrameBuf::default(),
            size: (0, 0),
            weights: Vec::new(),
        }
    }

    fn chosen(value: Value, map: &[f32]) -> Vec<usize> {
        let chosen = selector(value).choose(map, 0);
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
    }

    #[test]
    fn equal_pixels_are_drawn_by_the_seed_and_the_period() {
        let map = [0.5; 1000];
        for choice in [json!({"top": 20, "by": "x"}), json!({"bottom": 20, "by": "x"}), json!({"random": 20})]
        {
            let draw = |period| selector(choice.clone()).choose(&map, period);
            assert_eq!(draw(0).iter().filter(|chosen| **chosen).count(), 200);
            assert_eq!(draw(0), draw(0));
            assert_ne!(draw(0), draw(1));
            // Drawn over the whole frame, not from its beginning.
            assert!((70..130).contains(&draw(0)[500..].iter().filter(|chosen| **chosen).count()));
        }
    }

    #[test]
    fn a_choice_stays_for_its_period() {
        let frame = FrameBuf::new(20, 20);
        let mut selector = selector(json!({"random": 50, "every": 3}));
        let mut at = |index| selector.weights(frame.as_ref(), index, 0.0).unwrap().to_vec();
        let (first, second, third, fourth) = (at(0), at(1), at(2), at(3));
        assert!(first == second && second == third && third != fourth);
        // A later period is the same whatever came before it.
        let mut other = self::selector(json!({"random": 50, "every": 3}));
        assert_eq!(other.weights(frame.as_ref(), 4, 0.0).unwrap(), fourth);
    }

    #[test]
    fn a_choice_stays_until_the_frame_changes() {
        let shade = |value: u8| FrameBuf::from_vec(vec![value; 20 * 20 * 3], 20, 20).unwrap();
        let run = |shades: &[u8]| {
            let mut selector = selector(json!({"random": 50, "change": 10}));
            let frames = shades.iter().enumerate();
            let weights = frames.map(|(at, &value)| {
                selector.weights(shade(value).as_ref(), at as u64, 0.0).unwrap().to_vec()
            });
            weights.collect::<Vec<_>>()
        };
        let weights = run(&[100, 106, 110, 111, 105]);
        assert!(weights[0] == weights[1] && weights[1] == weights[2]);
        assert!(weights[2] != weights[3] && weights[3] == weights[4]);
        // Slow changes add up: what counts is the distance from the map's own frame.
        assert_ne!(run(&[100, 105, 111])[2], run(&[100, 105, 110])[2]);
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
    fn a_map_by_cells_is_stretched() {
        assert_eq!(stretch(&[1.0, 2.0], [2, 1], [5, 2]), [1.0, 1.0, 1.0, 2.0, 2.0, 1.0, 1.0, 1.0, 2.0, 2.0]);
    }

    #[test]
    fn soft_edges_are_blended() {
        let chosen = (0..20).map(|x| x >= 10).collect();
        let weights = finish(chosen, (20, 1), &selection(json!({"random": 1, "soft": 2})));
        assert_eq!(weights[6..14], [0, 0, 51, 102, 153, 204, 255, 255]);
    }
}
