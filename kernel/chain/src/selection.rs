//! Which pixels of a frame are chosen: by saliency maps, by a simulator's labels, by masks or at random.

use pdk_model::selection::{Choice, Selection};
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Frame, HeatmapMut, Key, Mask};

use crate::maps::{Maps, Turn, Turns, context};
use crate::moment::{Labels, Moment};
use pdk_components::held::Held;
use pdk_components::registry::Registry;
use pdk_ops::edges::{Edges, Treatment};
use pdk_supervise::calls::Function;

/// What the choice goes by.
enum Source {
    /// Nothing: it is drawn.
    Chance,
    /// Saliency maps.
    Maps(Box<Maps>),
    /// The labels that come with a frame.
    Labels,
    /// The distances that come with a frame.
    Depth,
    /// A mask.
    Mask(Held<dyn Mask>),
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
    edges: Edges,
    scratch: Scratch,
}

/// Memory that is kept from frame to frame.
#[derive(Default)]
struct Scratch {
    /// What a mask says.
    values: Vec<f32>,
    /// What pixels are ordered by, and the same in order as far as needed.
    order: Vec<f32>,
    sorted: Vec<f32>,
    /// The pixels among which it is drawn.
    equal: Vec<usize>,
}

impl Selector {
    /// Makes the method.
    ///
    /// # Errors
    /// If there is no such method, or it refuses its parameters.
    pub fn new(registry: &Registry, selection: &Selection, key: Key) -> Result<Self> {
        let source = match (&selection.by, &selection.mask) {
            (Some(by), _) => Source::Maps(Box::new(Maps::new(registry, by, key)?)),
            (None, Some(mask)) => {
                let (instance, _) = registry.mask(&mask.name, &mask.parameters)?;
                Source::Mask(Held::new(Kind::Mask, mask.clone(), instance))
            }
            (None, None) if selection.random.is_some() => Source::Chance,
            (None, None) if matches!(selection.choice(), Choice::Between(..)) => Source::Depth,
            (None, None) => Source::Labels,
        };
        Ok(Self::from_source(selection.clone(), source, key))
    }

    fn from_source(selection: Selection, source: Source, key: Key) -> Self {
        let turns = Turns::new(selection.pace());
        let (weights, edges, scratch) = (Vec::new(), Edges::default(), Scratch::default());
        Self { selection, turns, source, key, weights, edges, scratch }
    }

    /// Goes on with another sequence, and draws from another key.
    pub fn begin_again(&mut self, key: Key) {
        self.turns.begin_again();
        if let Source::Maps(maps) = &mut self.source {
            maps.set_key(key);
        }
        self.key = key;
    }

    /// How much of each pixel is changed, 0 to 255, row by row; `raw` is the frame as the camera saw it.
    ///
    /// # Errors
    /// If the method fails.
    pub fn weights(&mut self, raw: Frame<'_>, moment: &Moment<'_>) -> Result<&[u8]> {
        let turn = self.turns.of(raw, moment);
        // What follows the image is chosen again, so that it is as many pixels as before.
        if (turn.new || turn.moved != [0, 0])
            && let Err(error) = self.choose(raw, moment, turn)
        {
            // The frames that would have shared it have none.
            self.turns.begin_again();
            return Err(error);
        }
        Ok(&self.weights)
    }

    fn choose(&mut self, raw: Frame<'_>, moment: &Moment<'_>, turn: Turn) -> Result<()> {
        let (width, height) = (raw.width(), raw.height());
        let pixels = width * height;
        let Self { selection, source, key, weights, edges, scratch, .. } = self;
        weights.clear();
        match source {
            Source::Maps(maps) => {
                choose(selection, maps.of(raw, moment, turn)?, key, turn.period, scratch, weights);
            }
            Source::Chance => {
                let mut nothing = std::mem::take(&mut scratch.values);
                nothing.clear();
                nothing.resize(pixels, 0.0);
                choose(selection, &nothing, key, turn.period, scratch, weights);
                scratch.values = nothing;
            }
            // What labels and masks say of the frame at hand is never moved: there is no need to.
            Source::Labels => labelled(&selection.label, moment.labels, pixels, weights)?,
            Source::Depth => between(selection.choice(), moment.depth, pixels, weights)?,
            Source::Mask(mask) => {
                let values = &mut scratch.values;
                values.clear();
                values.resize(pixels, 0.0);
                let cx = context(moment, key);
                mask.call(Function::Weights, Some(moment.frame_index), |mask| {
                    mask.weights(raw, &cx, HeatmapMut::new(values, width, height)?)
                })?;
                // What is not a number becomes 0.
                weights.extend(values.iter().map(|value| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8));
            }
        }
        let &mut Selection { close, smallest, soft, .. } = selection;
        let [close, smallest, soft] = [close, smallest, soft].map(|pixels| pixels as usize);
        edges.treat(weights, (width, height), Treatment { close, smallest, soft });
        Ok(())
    }

    /// What a user should know about the maps that were made.
    pub fn noticed(&self) -> Option<String> {
        match &self.source {
            Source::Maps(maps) => maps.noticed(),
            _ => None,
        }
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
fn between(choice: Choice, depth: Option<&[f32]>, pixels: usize, weights: &mut Vec<u8>) -> Result<()> {
    let (Choice::Between(least, most), Some(depth)) = (choice, depth.filter(|depth| depth.len() == pixels))
    else {
        return Err(Error::new(
            "`nearer` and `farther` need a simulator that reports how far away pixels are, and these frames come without; use a mask instead",
        ));
    };
    let range = least as f32..=most as f32;
    weights.extend(depth.iter().map(|distance| if range.contains(distance) { 255 } else { 0 }));
    Ok(())
}

/// The pixels that show something of these names.
fn labelled(
    names: &[String],
    labels: Option<Labels<'_>>,
    pixels: usize,
    weights: &mut Vec<u8>,
) -> Result<()> {
    let wrong = |sentence: String| Err(Error::new(sentence));
    let Some(labels) = labels.filter(|labels| !labels.names.is_empty() && labels.pixels.len() == pixels)
    else {
        return wrong(
            "`label` needs a simulator that labels its pixels, and these frames come without; use a mask instead".to_owned(),
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
    weights.extend(labels.pixels.iter().map(|label| wanted[usize::from(*label)]));
    Ok(())
}

/// 255 for each pixel that is chosen by a map. Among equal ones it is drawn. `bottom` takes exactly the pixels that `top` with the
/// rest of the share leaves, ties included.
fn choose(
    selection: &Selection,
    map: &[f32],
    key: &Key,
    period: u64,
    scratch: &mut Scratch,
    weights: &mut Vec<u8>,
) {
    let (percent, [chosen, other]) = match selection.choice() {
        Choice::Top(percent) | Choice::Random(percent) => (percent, [255, 0]),
        Choice::Bottom(percent) => (100.0 - percent, [0, 255]),
        Choice::Above(least) => {
            weights.extend(map.iter().map(|&value| if value > least as f32 { 255 } else { 0 }));
            return;
        }
        Choice::Labelled | Choice::Masked | Choice::Between(..) => (0.0, [255, 0]),
    };
    let count = (percent * map.len() as f64 / 100.0).round() as usize;
    if count == 0 || count >= map.len() {
        weights.resize(map.len(), if count > 0 { chosen } else { other });
        return;
    }
    let Scratch { order, sorted, equal, .. } = scratch;
    order.clear();
    order.extend(map.iter().map(|value| -value));
    sorted.clone_from(order);
    let (_, last, _) = sorted.select_nth_unstable_by(count - 1, f32::total_cmp);
    weights.extend(order.iter().map(|value| if value < last { chosen } else { other }));
    equal.clear();
    equal.extend((0..order.len()).filter(|&at| order[at] == *last));
    let missing = count - weights.iter().filter(|weight| **weight == chosen).count();
    let mut random = key.frame(period);
    for place in 0..missing {
        let drawn = place + random.below((equal.len() - place) as u32) as usize;
        equal.swap(place, drawn);
        weights[equal[place]] = chosen;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_model::component::ComponentSpec;
    use pdk_sdk::prelude::FrameBuf;
    use serde_json::{Value, json};

    fn selection(value: Value) -> Selection {
        Selection::from_json(&value).unwrap()
    }

    fn choice(value: Value, map: &[f32], key: u8, period: u64) -> Vec<u8> {
        let mut weights = Vec::new();
        choose(&selection(value), map, &Key([key; 32]), period, &mut Scratch::default(), &mut weights);
        weights
    }

    fn chosen(value: Value, map: &[f32]) -> Vec<usize> {
        let chosen = choice(value, map, 5, 0);
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
    fn the_top_and_the_rest_are_complements_with_ties_among_them() {
        // Coarse values, so that the share ends among equal ones; 15 pixels, whose tenth is one and a half.
        let coarse: Vec<f32> = (0..1000).map(|at| (at * 7 % 10 / 3) as f32 / 4.0).collect();
        let flat = [0.5; 1001];
        for map in [&coarse[..], &flat[..], &coarse[..15]] {
            for (top, bottom) in [(20, 80), (10, 90), (33, 67), (50, 50), (0, 100), (100, 0)] {
                let both = [("top", top), ("bottom", bottom)]
                    .map(|(name, share)| choice(json!({name: share, "by": "x"}), map, 5, 3));
                let exclusive = both[0].iter().zip(&both[1]).all(|(a, b)| *a == 255 - *b);
                assert!(exclusive, "top {top} and bottom {bottom} of {} pixels", map.len());
            }
        }
    }

    #[test]
    fn equal_pixels_are_drawn_by_the_seed_and_the_period() {
        let map = [0.5; 1000];
        for value in [json!({"top": 20, "by": "x"}), json!({"bottom": 20, "by": "x"}), json!({"random": 20})]
        {
            let draw = |period| choice(value.clone(), &map, 5, period);
            assert_eq!(draw(0).iter().filter(|chosen| **chosen > 0).count(), 200);
            assert_eq!(draw(0), draw(0));
            assert_ne!(draw(0), draw(1));
            assert_ne!(draw(0), choice(value.clone(), &map, 6, 0));
            // Drawn over the whole frame, not from its beginning.
            assert!((70..130).contains(&draw(0)[500..].iter().filter(|chosen| **chosen > 0).count()));
        }
    }

    #[test]
    fn a_choice_stays_for_its_period() {
        let frame = FrameBuf::new(20, 20);
        let selector = || {
            let selection = selection(json!({"random": 50, "every": 3}));
            Selector::from_source(selection, Source::Chance, Key([5; 32]))
        };
        let mut first = selector();
        let mut at = |index| first.weights(frame.as_ref(), &Moment::new(index, 0.0)).unwrap().to_vec();
        let weights: Vec<_> = (0..5).map(&mut at).collect();
        assert!(weights[0] == weights[1] && weights[1] == weights[2] && weights[2] != weights[3]);
        // A later period is the same whatever came before it.
        assert_eq!(selector().weights(frame.as_ref(), &Moment::new(4, 0.0)).unwrap(), weights[4]);
    }

    #[test]
    fn the_same_frame_in_another_state_is_chosen_from_anew() {
        let names = ["sky", "road"].map(str::to_owned);
        let selection = selection(json!({"label": "road"}));
        let mut selector = Selector::from_source(selection, Source::Labels, Key([5; 32]));
        let frame = FrameBuf::new(2, 1);
        for (pixels, chosen) in [([0, 1], [0, 255]), ([1, 0], [255, 0])] {
            let labels = Labels { names: &names, pixels: &pixels };
            let moment = Moment::new(7, 0.35).with_labels(Some(labels));
            assert_eq!(selector.weights(frame.as_ref(), &moment).unwrap(), chosen);
        }
    }

    #[test]
    fn labels_choose_what_is_named() {
        let names = ["sky", "road"].map(str::to_owned);
        let labels = Some(Labels { names: &names, pixels: &[0, 1, 1, 7] });
        let choose = |wanted: &[&str], labels| {
            let wanted: Vec<String> = wanted.iter().map(|name| (*name).to_owned()).collect();
            let mut weights = Vec::new();
            labelled(&wanted, labels, 4, &mut weights).map_err(|error| error.to_string())?;
            Ok::<_, String>(weights)
        };
        assert_eq!(choose(&["road"], labels).unwrap(), [0, 255, 255, 0]);
        let depth = [0.5, 5.0, 30.0, f32::INFINITY];
        let within = |least, most, depth| {
            let mut weights = Vec::new();
            between(Choice::Between(least, most), depth, 4, &mut weights).map(|()| weights)
        };
        assert_eq!(within(5.0, 30.0, Some(&depth[..])).unwrap(), [0, 255, 255, 0]);
        assert_eq!(within(6.0, f64::INFINITY, Some(&depth[..])).unwrap(), [0, 0, 255, 255]);
        assert!(within(0.0, 1.0, None).unwrap_err().message().contains("come without"));
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
        let left = ComponentSpec::parse("mask", "left").unwrap();
        let source = Source::Mask(Held::new(Kind::Mask, left, Box::new(Left)));
        let mut selector = Selector::from_source(selection, source, Key([5; 32]));
        let frame = FrameBuf::new(4, 1);
        assert_eq!(selector.weights(frame.as_ref(), &Moment::new(0, 0.0)).unwrap(), [128, 128, 0, 0]);
    }
}
