//! Plays a clip over frames: which of its frames at what time, at the size at hand.

use std::path::PathBuf;

use pdk_sdk::error::Place;
use pdk_sdk::ops::overlay::overlay;
use pdk_sdk::prelude::*;

use crate::cache;
use crate::clip::Clip;
use crate::prepare::{self, Settings};
use crate::store::{Index, Layer, Store};

/// How a clip goes on at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Loop {
    /// Its last frames fade into its first ones.
    CrossFade,
    /// It runs backwards to its beginning.
    PingPong,
    /// It starts again, for clips whose last frame leads to the first.
    Repeat,
}

/// Which frames are shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// The clip runs in simulation time, at its own rate or at the given one.
    Runs { end: Loop, rate: Option<f64> },
    /// One frame stands still: one of those that cover at least a third as much as the fullest.
    Stands,
}

/// A clip that is laid over frames.
pub struct Player {
    clip: Clip,
    hash: blake3::Hash,
    settings: Settings,
    motion: Motion,
    folder: PathBuf,
    /// The clip at the size of the last frame.
    store: Option<Store>,
    /// The clip's frame that `layer` holds.
    held: Option<usize>,
    layer: Layer,
}

impl Player {
    /// A player of a clip. Nothing is prepared until the size of the frames is known.
    ///
    /// # Errors
    /// Where the clip cannot be read.
    pub fn new(clip: Clip, settings: Settings, motion: Motion) -> Result<Self> {
        let hash = clip.hash().place(&clip)?;
        let folder = cache::folder()?;
        Ok(Self { clip, hash, settings, motion, folder, store: None, held: None, layer: Layer::default() })
    }

    /// Lays the clip over a frame.
    ///
    /// # Errors
    /// Where the clip cannot be prepared.
    pub fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let size = (src.width(), src.height());
        let store = self.store.take().filter(|store| (store.index().width, store.index().height) == size);
        let store = match store {
            Some(store) => store,
            None => {
                self.held = None;
                prepare::open(&self.clip, &self.hash, &self.settings, size, &self.folder)?
            }
        };
        let mut store = self.store.insert(store);
        let wanted = frame_at(store.index(), self.motion, cx.time, &mut cx.sequence_random());
        if self.held != Some(wanted) {
            self.held = None;
            if store.read(wanted, &mut self.layer).is_err() {
                // The file was damaged after it was written; the clip itself is still there.
                prepare::discard(&self.hash, &self.settings, size, &self.folder);
                let fresh = prepare::open(&self.clip, &self.hash, &self.settings, size, &self.folder)?;
                store = self.store.insert(fresh);
                store.read(wanted, &mut self.layer).place(format!("the prepared {}", self.clip))?;
            }
            self.held = Some(wanted);
        }
        let (colours, alphas) = self.layer.planes();
        overlay(src, dst, colours, alphas, cx.number("opacity"));
        Ok(())
    }
}

/// The frame of a store that is shown at a time, in seconds.
pub fn frame_at(index: &Index, motion: Motion, time: f64, random: &mut Random) -> usize {
    let frames = index.frames;
    let Motion::Runs { end, rate } = motion else {
        let fullest = index.coverage[..frames].iter().copied().fold(0.0, f64::max);
        let full = || (0..frames).filter(|&frame| index.coverage[frame] * 3.0 >= fullest);
        let chosen = random.below(full().count() as u32) as usize;
        return full().nth(chosen).unwrap_or_default();
    };
    let faded = index.places.len() - frames;
    let period = match end {
        Loop::Repeat => frames,
        Loop::CrossFade => frames - faded,
        Loop::PingPong => (2 * frames).saturating_sub(2).max(1),
    };
    let start = random.below(period as u32) as i64;
    // Times are multiples of a frame's duration that are not exact: the least bit below a whole number belongs to it.
    let passed = (time * rate.unwrap_or(index.rate) + 1e-6).floor() as i64;
    let place = passed.saturating_add(start).rem_euclid(period as i64) as usize;
    match end {
        Loop::Repeat => place,
        Loop::CrossFade if place < faded => frames + place,
        Loop::CrossFade => place,
        Loop::PingPong => place.min(period - place),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn index(frames: usize, faded: usize, coverage: &[f64]) -> Index {
        let mut coverage = coverage.to_vec();
        coverage.resize(frames + faded, 0.0);
        Index { width: 1, height: 1, rate: 30.0, frames, places: vec![(0, 0); frames + faded], coverage }
    }

    /// The frames at 30 a second, beginning with the start that a key draws.
    fn played(index: &Index, end: Loop, count: usize) -> Vec<usize> {
        let random = Key([4; 32]).sequence();
        let motion = Motion::Runs { end, rate: None };
        (0..count).map(|i| frame_at(index, motion, i as f64 / 30.0, &mut random.clone())).collect()
    }

    #[test]
    fn every_frame_is_shown_once_in_a_round_and_in_order() {
        for frames in [1, 2, 3, 90, 91, 400] {
            let shown = played(&index(frames, 0, &[]), Loop::Repeat, 2 * frames + 1);
            for pair in shown.windows(2) {
                assert_eq!(pair[1], (pair[0] + 1) % frames);
            }
        }
    }

    #[test]
    fn ping_pong_turns_round_without_showing_an_end_twice() {
        let shown = played(&index(4, 0, &[]), Loop::PingPong, 14);
        assert!(shown.windows(2).all(|pair| pair[0].abs_diff(pair[1]) == 1), "{shown:?}");
        assert_eq!(played(&index(1, 0, &[]), Loop::PingPong, 3), [0, 0, 0]);
        let two = played(&index(2, 0, &[]), Loop::PingPong, 4);
        assert!(two.windows(2).all(|pair| pair[0] != pair[1]));
    }

    #[test]
    fn a_cross_fade_leads_from_the_last_frame_before_it_to_the_first_behind_it() {
        // 12 frames of which the last 3 are faded into the first 3: those are 12, 13, 14.
        let shown = played(&index(12, 3, &[]), Loop::CrossFade, 18);
        for pair in shown.windows(2) {
            let follows = match pair[0] {
                8 => 12,
                14 => 3,
                other => other + 1,
            };
            assert_eq!(pair[1], follows, "{shown:?}");
        }
    }

    #[test]
    fn the_clip_runs_in_its_own_time() {
        let index = index(1000, 0, &[]);
        let random = Key([4; 32]).sequence();
        let at = |time: f64, rate: Option<f64>| {
            frame_at(&index, Motion::Runs { end: Loop::Repeat, rate }, time, &mut random.clone())
        };
        let start = at(0.0, None);
        assert_eq!((at(2.0, None) + 1000 - start) % 1000, 60);
        assert_eq!((at(2.0, Some(25.0)) + 1000 - start) % 1000, 50);
        // Two simulator frames show the same frame of the clip where the simulator is twice as fast.
        assert_eq!((at(1.0 / 60.0, None) + 1000 - start) % 1000, 0);
        assert!(at(f64::NAN, None) < 1000 && at(1e300, None) < 1000 && at(-1e300, None) < 1000);
    }

    #[test]
    fn a_still_frame_is_one_that_shows_something_and_depends_on_the_key_alone() {
        let index = index(6, 1, &[0.0, 10.0, 40.0, 0.0, 14.0, 13.0]);
        let mut chosen = Vec::new();
        for key in 0..40 {
            let random = Key([key; 32]).sequence();
            let frame = frame_at(&index, Motion::Stands, 0.0, &mut random.clone());
            assert_eq!(frame, frame_at(&index, Motion::Stands, 7.3, &mut random.clone()));
            chosen.push(frame);
        }
        chosen.sort_unstable();
        chosen.dedup();
        assert_eq!(chosen, [2, 4]);
    }
}
