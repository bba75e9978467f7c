//! The saliency maps that a perturbation follows: that of the frame at hand, and those of the sequence so far.

use pdk_model::attention::Attention;
use pdk_sdk::error::Result;
use pdk_sdk::prelude::{EarlierMaps, Frame, Key};

use crate::maps::{Maps, Turns};
use crate::moment::Moment;
use pdk_components::registry::Registry;
use pdk_ops::cells;

/// This many values in a row has a map that is kept for later frames.
const COLUMNS: usize = 24;
/// Seconds between two maps that are kept, and how long they are.
const APART: f64 = 0.25;
const KEPT: f64 = 120.0;

/// The maps that a perturbation is given: that of the frame at hand, and those of the sequence so far.
pub struct Attended {
    turns: Turns,
    maps: Maps,
    times: Vec<f64>,
    values: Vec<f32>,
    size: [usize; 2],
}

impl Attended {
    /// Makes the method.
    ///
    /// # Errors
    /// If there is no such method, or it refuses its parameters.
    pub fn new(registry: &Registry, attention: &Attention, key: Key) -> Result<Self> {
        let (turns, maps) = (Turns::new(attention.pace()), Maps::new(registry, &attention.by, key)?);
        Ok(Self { turns, maps, times: Vec::new(), values: Vec::new(), size: [0, 0] })
    }

    /// Goes on with another sequence, and draws from another key.
    pub fn begin_again(&mut self, key: Key) {
        self.turns.begin_again();
        self.maps.set_key(key);
        self.times.clear();
        self.values.clear();
    }

    /// As [`Maps::noticed`].
    pub fn noticed(&self) -> Option<String> {
        self.maps.noticed()
    }

    /// The map of a frame, and those of the sequence so far with it.
    ///
    /// # Errors
    /// If the method fails.
    pub fn look(&mut self, raw: Frame<'_>, moment: &Moment<'_>) -> Result<(&[f32], EarlierMaps<'_>)> {
        let turn = self.turns.of(raw, moment);
        let turns = &mut self.turns;
        // The frames that would have shared a map that failed have none.
        let now = self.maps.of(raw, moment, turn).inspect_err(|_| turns.begin_again())?;
        let (width, height) = (raw.width(), raw.height());
        let columns = COLUMNS.min(width);
        let size = [columns, (height * columns / width).clamp(1, height)];
        let last = self.times.last().copied();
        // A frame that counts for itself, another sequence, or a camera of another size.
        if moment.alone || size != self.size || last.is_some_and(|last| moment.time < last) {
            self.times.clear();
            self.values.clear();
            self.size = size;
        }
        let cells = size[0] * size[1];
        // The same moment in another state.
        if self.times.pop_if(|last| *last >= moment.time).is_some() {
            self.values.truncate(self.times.len() * cells);
        }
        if self.times.last().is_none_or(|last| moment.time - last >= APART) {
            let old = self.times.partition_point(|time| moment.time - time > KEPT);
            self.times.drain(..old);
            self.values.drain(..old * cells);
            self.times.push(moment.time);
            cells::reduce(now, width, size, &mut self.values);
        }
        let earlier = EarlierMaps::new(&self.times, &self.values, size[0], size[1])?;
        Ok((now, earlier))
    }
}

#[cfg(test)]
mod tests {
    use pdk_components::held::Held;
    use pdk_model::component::ComponentSpec;
    use pdk_model::pace::Pace;
    use pdk_sdk::describe::{Description, Kind};
    use pdk_sdk::prelude::{FrameBuf, HeatmapMut, MapContext, Saliency};

    use super::*;

    fn shade(value: u8) -> FrameBuf {
        FrameBuf::from_vec(vec![value; 20 * 20 * 3], 20, 20).unwrap()
    }

    /// Sees brightness.
    struct Bright;

    impl Saliency for Bright {
        fn map(&mut self, frame: Frame<'_>, _: &MapContext<'_>, mut out: HeatmapMut<'_>) -> Result<()> {
            for y in 0..frame.height() {
                for (value, pixel) in out.row_mut(y).iter_mut().zip(frame.row(y).chunks_exact(3)) {
                    *value = f32::from(pixel[0]) / 255.0;
                }
            }
            Ok(())
        }
    }

    #[test]
    fn the_maps_of_a_sequence_are_kept_and_those_of_single_frames_are_not() {
        let attended = || Attended {
            turns: Turns::new(Pace { every: 1, change: None, follow: false }),
            maps: Maps::from_method(
                Held::new(
                    Kind::Saliency,
                    ComponentSpec::parse("saliency method", "bright").unwrap(),
                    Box::new(Bright),
                ),
                Description::saliency("x", "x"),
                Key([1; 32]),
            ),
            times: Vec::new(),
            values: Vec::new(),
            size: [0, 0],
        };
        let mut sequence = attended();
        for index in 0..21 {
            let moment = Moment::new(index, index as f64 / 20.0);
            let (now, earlier) = sequence.look(shade(index as u8 * 10).as_ref(), &moment).unwrap();
            assert_eq!((now.len(), now[0]), (400, index as f32 * 10.0 / 255.0));
            assert_eq!(earlier.len(), index as usize / 5 + 1);
            // The map in use half a second ago, as far as there was one.
            let place = earlier.place_at(moment.time - 0.5).unwrap();
            let expected = (index.saturating_sub(10) / 5 * 50) as f32 / 255.0;
            let (width, height, values) = earlier.map(place);
            assert_eq!((width, height), (20, 20));
            assert!(values.iter().all(|value| (value - expected).abs() < 1e-6), "{index}");
        }
        // The same moment in another state.
        let moment = Moment::new(20, 1.0);
        let (now, earlier) = sequence.look(shade(51).as_ref(), &moment).unwrap();
        assert_eq!((now[0], earlier.len(), earlier.map(4).2[0]), (0.2, 5, 0.2));
        let mut single = attended();
        for index in 0..5 {
            let moment = Moment::new(index, index as f64).alone();
            let (_, earlier) = single.look(shade(index as u8).as_ref(), &moment).unwrap();
            assert_eq!((earlier.len(), earlier.map(0).2[0]), (1, index as f32 / 255.0));
        }
    }
}
