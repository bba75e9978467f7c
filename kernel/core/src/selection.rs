//! Which pixels of a frame are chosen: by saliency maps, by a simulator's labels, by masks or at random; and how the edges of what
//! is chosen are treated.

use pdk_model::selection::{Choice, Selection};
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::prelude::{Frame, HeatmapMut, Key, Mask};

use crate::calls::{self, Function};
use crate::maps::{Maps, Turns, context};
use crate::moment::{Labels, Moment};
use crate::registry::Registry;

/// What the choice goes by.
enum Source {
    /// Nothing: it is drawn.
    Chance,
    /// Saliency maps.
    Maps(Maps),
    /// The labels that come with a frame.
    Labels,
    /// The distances that come with a frame.
    Depth,
    /// A mask, with what messages call it.
    Mask(Box<dyn Mask>, String),
}

/// Chooses pixels frame by frame.
pub struct Selector {
    selection: Selection,
    turns: Turns,
    source: Source,
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
        let source = match (&selection.by, &selection.mask) {
            (Some(by), _) => Source::Maps(Maps::new(registry, by, key)?),
            (None, Some(mask)) => {
                let (instance, _) = registry.mask(&mask.name, &mask.parameters)?;
                Source::Mask(instance, format!("mask `{}`", mask.name))
            }
            (None, None) if selection.random.is_some() => Source::Chance,
            (None, None) if matches!(selection.choice(), Choice::Between(..)) => Source::Depth,
            (None, None) => Source::Labels,
        };
        let turns = Turns::new(selection.pace());
        Ok(Self { selection: selection.clone(), turns, source, key, weights: Vec::new() })
    }

    /// How much of each pixel is changed, 0 to 255, row by row; `raw` is the frame as the camera saw it.
    ///
    /// # Errors
    /// Where the method fails.
    pub fn weights(&mut self, raw: Frame<'_>, moment: &Moment<'_>) -> Result<&[u8]> {
        let turn = self.turns.of(raw, moment);
        // What follows the image is chosen again, so that it is as many pixels as before.
        if turn.new || turn.moved != [0, 0] {
            let (width, height) = (raw.width(), raw.height());
            let Self { selection, source, key, .. } = self;
            let weights = match source {
                Source::Maps(maps) => choose(selection, maps.of(raw, moment, turn)?, key, turn.period),
                Source::Chance => choose(selection, &vec![0.0; width * height], key, turn.period),
                // What labels and masks say of the frame at hand is never moved: there is no need to.
                Source::Labels => labelled(&selection.label, moment.labels, width * height)?,
                Source::Depth => between(selection.choice(), moment.depth, width * height)?,
                Source::Mask(mask, label) => {
                    let mut values = vec![0.0; width * height];
                    let cx = context(moment, key);
                    calls::call_at(label, Function::Weights, moment.frame_index, || {
                        mask.weights(raw, &cx, HeatmapMut::new(&mut values, width, height)?)
                    })
                    .map_err(|error: Error| error.at(&*label))?;
                    // What is not a number becomes 0.
                    values.into_iter().map(|value| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect()
                }
            };
            self.weights = finish(weights, (width, height), &self.selection);
        }
        Ok(&self.weights)
    }

    /// Whether frames have to come with labels.
    pub fn needs_labels(&self) -> bool {
        matches!(self.source, Source::Labels)
    }

    /// Whether frames have to come with distances.
    pub fn needs_depth(&self) -> bool {
        matches!(self.source, Source::Depth)
    }
}

/// The pixels whose distance is in a range.
fn between(choice: Choice, depth: Option<&[f32]>, pixels: usize) -> Result<Vec<u8>> {
    let (Choice::Between(least, most), Some(depth)) = (choice, depth.filter(|depth| depth.len() == pixels))
    else {
        return Err(Error::of(
            ErrorKind::Configuration,
            "`nearer` and `farther` need a simulator that tells how far away pixels are, and these frames come without; use a mask instead",
        ));
    };
    let range = least as f32..=most as f32;
    Ok(depth.iter().map(|distance| if range.contains(distance) { 255 } else { 0 }).collect())
}

/// The pixels that show something of these names.
fn labelled(names: &[String], labels: Option<Labels<'_>>, pixels: usize) -> Result<Vec<u8>> {
    let wrong = |sentence: String| Err(Error::of(ErrorKind::Configuration, sentence));
    let Some(labels) = labels.filter(|labels| !labels.names.is_empty() && labels.pixels.len() == pixels)
    else {
        return wrong(
            "`label` needs a simulator that says what its pixels show, and these frames come without; use a mask instead".to_owned(),
        );
    };
    let mut wanted = [0; 256];
    for name in names {
        match labels.names.iter().position(|known| known == name).filter(|place| *place < wanted.len()) {
            Some(place) => wanted[place] = 255,
            None => {
                let known: Vec<_> = labels.names.iter().map(|known| format!("`{known}`")).collect();
                return wrong(format!("the simulator has no label `{name}`; it has {}", known.join(", ")));
            }
        }
    }
    Ok(labels.pixels.iter().map(|label| wanted[usize::from(*label)]).collect())
}

/// 255 for each pixel that is chosen by a map. Among equal ones it is drawn.
fn choose(selection: &Selection, map: &[f32], key: &Key, period: u64) -> Vec<u8> {
    let share = match selection.choice() {
        Choice::Top(share) | Choice::Bottom(share) | Choice::Random(share) => share,
        Choice::Above(least) => {
            return map.iter().map(|&value| if value > least as f32 { 255 } else { 0 }).collect();
        }
        Choice::Labelled | Choice::Masked | Choice::Between(..) => 0.0,
    };
    let count = (share * map.len() as f64).round() as usize;
    if count == 0 || count >= map.len() {
        return vec![if count > 0 { 255 } else { 0 }; map.len()];
    }
    let bottom = matches!(selection.choice(), Choice::Bottom(_));
    let order: Vec<f32> = map.iter().map(|value| if bottom { *value } else { -value }).collect();
    let mut sorted = order.clone();
    let (_, last, _) = sorted.select_nth_unstable_by(count - 1, f32::total_cmp);
    let mut chosen: Vec<u8> = order.iter().map(|value| if value < last { 255 } else { 0 }).collect();
    let mut equal: Vec<usize> = (0..order.len()).filter(|&at| order[at] == *last).collect();
    let missing = count - chosen.iter().filter(|chosen| **chosen > 0).count();
    let mut random = key.frame(period);
    for place in 0..missing {
        let other = place + random.below((equal.len() - place) as u32) as usize;
        equal.swap(place, other);
        chosen[equal[place]] = 255;
    }
    chosen
}

/// Closes gaps, leaves out small spots, and softens the edges, in this order.
fn finish(mut weights: Vec<u8>, (width, height): (usize, usize), selection: &Selection) -> Vec<u8> {
    if selection.close > 0 || selection.smallest > 0 {
        let mut chosen: Vec<bool> = weights.iter().map(|weight| *weight > 127).collect();
        if selection.close > 0 {
            let reach = selection.close as usize;
            // What lies beyond the frame is neither chosen nor left out.
            chosen = spread(&chosen, width, height, reach, true);
            chosen = spread(&chosen, width, height, reach, false);
        }
        if selection.smallest > 0 {
            leave_out_small(&mut chosen, width, height, selection.smallest as usize);
        }
        weights = chosen.into_iter().map(|chosen| u8::from(chosen) * 255).collect();
    }
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
        chosen.iter().enumerate().filter(|(_, chosen)| **chosen > 0).map(|(at, _)| at).collect()
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
            assert_eq!(draw(0).iter().filter(|chosen| **chosen > 0).count(), 200);
            assert_eq!(draw(0), draw(0));
            assert_ne!(draw(0), draw(1));
            assert_ne!(draw(0), choose(&selection(value.clone()), &map, &Key([6; 32]), 0));
            // Drawn over the whole frame, not from its beginning.
            assert!((70..130).contains(&draw(0)[500..].iter().filter(|chosen| **chosen > 0).count()));
        }
    }

    #[test]
    fn a_choice_stays_for_its_period() {
        let frame = FrameBuf::new(20, 20);
        let selector = || {
            let selection = selection(json!({"random": 50, "every": 3}));
            let turns = Turns::new(selection.pace());
            Selector { selection, turns, source: Source::Chance, key: Key([5; 32]), weights: Vec::new() }
        };
        let mut first = selector();
        let mut at = |index| first.weights(frame.as_ref(), &Moment::new(index, 0.0)).unwrap().to_vec();
        let weights: Vec<_> = (0..5).map(&mut at).collect();
        assert!(weights[0] == weights[1] && weights[1] == weights[2] && weights[2] != weights[3]);
        // A later period is the same whatever came before it.
        assert_eq!(selector().weights(frame.as_ref(), &Moment::new(4, 0.0)).unwrap(), weights[4]);
    }

    #[test]
    fn labels_choose_what_is_named() {
        let names = ["sky", "road"].map(str::to_owned);
        let labels = Some(Labels { names: &names, pixels: &[0, 1, 1, 7] });
        let choose = |wanted: &[&str], labels| {
            let wanted: Vec<String> = wanted.iter().map(|name| (*name).to_owned()).collect();
            labelled(&wanted, labels, 4).map_err(|error| error.to_string())
        };
        assert_eq!(choose(&["road"], labels).unwrap(), [0, 255, 255, 0]);
        let depth = [0.5, 5.0, 30.0, f32::INFINITY];
        let within = |least, most| between(Choice::Between(least, most), Some(&depth), 4).unwrap();
        assert_eq!(within(5.0, 30.0), [0, 255, 255, 0]);
        assert_eq!(within(6.0, f64::INFINITY), [0, 0, 255, 255]);
        assert!(between(Choice::Between(0.0, 1.0), None, 4).unwrap_err().message().contains("come without"));
        assert_eq!(choose(&["sky", "road"], labels).unwrap(), [255, 255, 255, 0]);
        assert_eq!(
            choose(&["rode"], labels).unwrap_err(),
            "the simulator has no label `rode`; it has `sky`, `road`"
        );
        assert!(choose(&["road"], None).unwrap_err().contains("these frames come without"));
    }

    /// Half of every pixel on the left.
    struct Left;

    impl Mask for Left {
        fn weights(
            &mut self,
            frame: Frame<'_>,
            _: &pdk_sdk::prelude::MapContext<'_>,
            mut out: HeatmapMut<'_>,
        ) -> Result<()> {
            for y in 0..frame.height() {
                let half = out.width() / 2;
                out.row_mut(y)
                    .iter_mut()
                    .enumerate()
                    .for_each(|(x, value)| *value = if x < half { 0.5 } else { f32::NAN });
            }
            Ok(())
        }
    }

    #[test]
    fn a_mask_says_how_much_of_each_pixel_is_changed() {
        let selection = selection(json!({"mask": "left"}));
        let turns = Turns::new(selection.pace());
        let source = Source::Mask(Box::new(Left), "mask `left`".to_owned());
        let mut selector = Selector { selection, turns, source, key: Key([5; 32]), weights: Vec::new() };
        let frame = FrameBuf::new(4, 1);
        assert_eq!(selector.weights(frame.as_ref(), &Moment::new(0, 0.0)).unwrap(), [128, 128, 0, 0]);
    }

    fn treat(rows: &[&str], value: Value) -> Vec<String> {
        let width = rows[0].len();
        let chosen =
            rows.iter().flat_map(|row| row.bytes().map(|byte| if byte == b'#' { 255 } else { 0 })).collect();
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
        let chosen = (0..20).map(|x| if x >= 10 { 255 } else { 0 }).collect();
        let weights = finish(chosen, (20, 1), &selection(json!({"random": 1, "soft": 2})));
        assert_eq!(weights[6..14], [0, 0, 51, 102, 153, 204, 255, 255]);
    }
}
