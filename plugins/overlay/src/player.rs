//! Plays a clip over frames: which of its frames at what time, at the size at hand.

use std::path::PathBuf;

use pdk_sdk::error::Place;
use pdk_sdk::ops::overlay::overlay;
use pdk_sdk::prelude::*;

use crate::air::Air;
use crate::cache;
use crate::clip::Clip;
use crate::place::{Moved, middle};
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
    /// The clip runs in simulation time and with the way that the vehicle drives, as the drive says.
    Driven { end: Loop, drive: Drive },
    /// One frame stands still: one of those that cover at least a third as much as the fullest.
    Stands,
}

/// How what a clip shows comes past a vehicle that drives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// The vehicle's speed for which the clip was made, in metres a second.
    pub speed: f64,
    /// The share of its motion that is there when the vehicle stands.
    pub still: f64,
}

impl Drive {
    /// How many seconds of the clip have passed at a time, where the vehicle has driven this many metres; if that is not known,
    /// it drives at the clip's speed.
    fn passed(self, time: f64, travelled: Option<f64>) -> f64 {
        let driven = travelled.map_or(time, |metres| metres / self.speed);
        self.still * time + (1.0 - self.still) * driven
    }
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
    /// The clip's frames that are held: the one shown, and the one after it.
    held: [Held; 2],
    /// Both, mixed.
    mixed: Layer,
    /// What is shown, in another place.
    moved: Moved,
    /// What the air or the camera does to the frame before the clip is laid over it.
    air: Option<Air>,
}

/// A frame of the clip that was read, and its number.
#[derive(Default)]
struct Held {
    number: Option<usize>,
    layer: Layer,
}

impl Player {
    /// A player of a clip. Nothing is prepared until the size of the frames is known.
    ///
    /// # Errors
    /// If the clip cannot be read.
    pub fn new(clip: Clip, settings: Settings, motion: Motion) -> Result<Self> {
        let hash = clip.hash().place(&clip)?;
        let folder = cache::folder()?;
        let (held, mixed) = (Default::default(), Layer::default());
        let moved = Moved::default();
        Ok(Self { clip, hash, settings, motion, folder, store: None, held, mixed, moved, air: None })
    }

    /// The same player that also does to frames what the air does, or the camera.
    pub fn through(self, air: Air) -> Self {
        Self { air: Some(air), ..self }
    }

    /// Lays the clip over a frame.
    ///
    /// # Errors
    /// If the clip cannot be prepared.
    pub fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let size = (src.width(), src.height());
        let fits = |store: &Store| (store.index().width, store.index().height) == size;
        if !self.store.as_ref().is_some_and(fits) {
            self.open(size)?;
        }
        let Some(store) = &self.store else { return Ok(()) };
        let shown = frame_at(store.index(), self.motion, (cx.time, cx.travelled), &mut cx.sequence_random());
        // The frame that is held already may be the first one now.
        if self.held[1].number == Some(shown.first) {
            self.held.swap(0, 1);
        }
        self.hold(0, shown.first, size)?;
        let layer = match shown.weight {
            0 => &self.held[0].layer,
            weight => {
                self.hold(1, shown.second, size)?;
                let [first, second] = &self.held;
                self.mixed.mix(&first.layer, &second.layer, weight);
                &self.mixed
            }
        };
        let (mut colours, mut alphas) = layer.planes();
        if let Some(map) = cx.saliency.filter(|map| map.len() == alphas.len()) {
            (colours, alphas) = self.moved.to(middle(map, size.0), (colours, alphas), size);
        }
        let opacity = cx.number("opacity");
        match &mut self.air {
            Some(air) => overlay(air.apply(src, cx), dst, colours, alphas, opacity),
            None => overlay(src, dst, colours, alphas, opacity),
        }
        Ok(())
    }

    /// Opens the clip at a size, and forgets what was held of another.
    fn open(&mut self, size: (usize, usize)) -> Result<()> {
        self.held.iter_mut().for_each(|held| held.number = None);
        self.store = None;
        self.store = Some(prepare::open(&self.clip, &self.hash, &self.settings, size, &self.folder)?);
        Ok(())
    }

    /// Reads a frame of the clip, unless it is held there already.
    fn hold(&mut self, place: usize, number: usize, size: (usize, usize)) -> Result<()> {
        if self.held[place].number == Some(number) {
            return Ok(());
        }
        let mut layer = std::mem::take(&mut self.held[place].layer);
        self.held[place].number = None;
        let read = |store: &mut Option<Store>, layer: &mut Layer| match store {
            Some(store) => store.read(number, layer),
            None => Err(Error::new("the clip is not open, which is a defect in pdk")),
        };
        if read(&mut self.store, &mut layer).is_err() {
            // The file was damaged after it was written; the clip itself is still there.
            prepare::discard(&self.hash, &self.settings, size, &self.folder);
            self.open(size)?;
            read(&mut self.store, &mut layer).place(format!("the prepared {}", self.clip))?;
        }
        self.held[place] = Held { number: Some(number), layer };
        Ok(())
    }
}

/// Frames a second from which on a clip is fast.
const FAST: f64 = 50.0;

/// What is shown of a store at some time: a frame, and how much of the next one is mixed in, in 256ths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shown {
    /// The frame.
    pub first: usize,
    /// The one that follows.
    pub second: usize,
    /// The share of the second, 0 to 255.
    pub weight: u16,
}

/// What is shown of a store at a time, in seconds, when the vehicle has driven this many metres, if that is known: between two
/// frames of the clip both, so that it moves evenly at any rate of frames. Of a clip with [`FAST`] frames a second or more it is the
/// nearest one: that is even enough, and what is mixed shows fast things twice.
pub fn frame_at(
    index: &Index,
    motion: Motion,
    (time, travelled): (f64, Option<f64>),
    random: &mut Random,
) -> Shown {
    let frames = index.frames;
    let (end, seconds, rate) = match motion {
        Motion::Runs { end, rate } => (end, time, rate),
        Motion::Driven { end, drive } => (end, drive.passed(time, travelled), None),
        Motion::Stands => return still_frame(index, random),
    };
    let faded = index.places.len() - frames;
    let period = match end {
        Loop::Repeat => frames,
        Loop::CrossFade => frames - faded,
        Loop::PingPong => (2 * frames).saturating_sub(2).max(1),
    };
    let start = random.below(period as u32) as i64;
    // The frame of the store that stands at a place of the period.
    let frame = |place: usize| match end {
        Loop::Repeat => place,
        Loop::CrossFade if place < faded => frames + place,
        Loop::CrossFade => place,
        Loop::PingPong => place.min(period - place),
    };
    if !index.durations.is_empty() {
        let speed = rate.map_or(1.0, |rate| rate / index.rate);
        // The clip's own frame that stands at a place, or the later of two that are faded into each other.
        let own = |place: usize| if end == Loop::PingPong { place.min(period - place) } else { place };
        let durations: Vec<u64> = (0..period).map(|place| index.durations[own(place)]).collect();
        let (place, weight) = place_at(&durations, start as usize, seconds * speed);
        return Shown { first: frame(place), second: frame((place + 1) % period), weight };
    }
    // In 256ths of a frame. Times are multiples of a frame's duration that are not exact, so the nearest one counts.
    let rate = rate.unwrap_or(index.rate);
    let passed = (seconds * rate * 256.0).round() as i64;
    let (whole, weight) = match rate >= FAST {
        true => (passed.saturating_add(127).div_euclid(256), 0),
        false => (passed.div_euclid(256), passed.rem_euclid(256) as u16),
    };
    let place = |number: i64| number.saturating_add(start).rem_euclid(period as i64) as usize;
    Shown { first: frame(place(whole)), second: frame(place(whole.saturating_add(1))), weight }
}

/// Where a clip is at a time, in seconds, whose frames have times of their own: after which frame, of those that it goes through one
/// after the other, and how many 256ths of the way to the next. `durations` are in nanoseconds; at time 0 frame `start` begins.
fn place_at(durations: &[u64], start: usize, seconds: f64) -> (usize, u16) {
    let total = durations.iter().sum::<u64>().max(1);
    let begin: u64 = durations[..start].iter().sum();
    let passed = i128::from((seconds * 1e9).round() as i64) + i128::from(begin);
    let mut left = passed.rem_euclid(i128::from(total)) as u64;
    let place = durations.iter().position(|&duration| {
        let here = left < duration;
        left -= if here { 0 } else { duration };
        here
    });
    let Some(place) = place else { return (0, 0) };
    let weight = (u128::from(left) * 256 / u128::from(durations[place])) as u16;
    match durations[place] as f64 * FAST <= 1e9 {
        true => ((place + usize::from(weight >= 128)) % durations.len(), 0),
        false => (place, weight),
    }
}

/// One of the frames that cover at least a third as much as the fullest.
fn still_frame(index: &Index, random: &mut Random) -> Shown {
    let fullest = index.coverage[..index.frames].iter().copied().fold(0.0, f64::max);
    let full = || (0..index.frames).filter(|&frame| index.coverage[frame] * 3.0 >= fullest);
    let chosen = random.below(full().count() as u32) as usize;
    let first = full().nth(chosen).unwrap_or_default();
    Shown { first, second: first, weight: 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn index(frames: usize, faded: usize, coverage: &[f64]) -> Index {
        let mut coverage = coverage.to_vec();
        coverage.resize(frames + faded, 0.0);
        Index {
            width: 1,
            height: 1,
            rate: 30.0,
            durations: Vec::new(),
            frames,
            places: vec![Default::default(); frames + faded],
            coverage,
        }
    }

    /// The frames at 30 a second, beginning with the start that a key draws.
    fn played(index: &Index, end: Loop, count: usize) -> Vec<usize> {
        let random = Key([4; 32]).sequence();
        let motion = Motion::Runs { end, rate: None };
        let at = |i: usize| frame_at(index, motion, (i as f64 / 30.0, None), &mut random.clone());
        assert!((0..count).all(|i| at(i).weight == 0), "at its own rate nothing is mixed");
        (0..count).map(|i| at(i).first).collect()
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
            frame_at(&index, Motion::Runs { end: Loop::Repeat, rate }, (time, None), &mut random.clone())
        };
        let start = at(0.0, None).first;
        assert_eq!((at(2.0, None).first + 1000 - start) % 1000, 60);
        assert_eq!((at(2.0, Some(25.0)).first + 1000 - start) % 1000, 50);
        // Between two frames of the clip both are shown.
        for (time, weight) in [(1.0 / 60.0, 128), (0.01 / 3.0, 26), (-1.0 / 120.0, 192)] {
            let shown = at(time, None);
            assert_eq!((shown.second + 1000 - shown.first) % 1000, 1);
            assert_eq!((shown.first == start, shown.weight), (time > 0.0, weight), "{time}");
        }
        for time in [f64::NAN, 1e300, -1e300] {
            let shown = at(time, None);
            assert!(shown.first < 1000 && shown.second < 1000 && shown.weight < 256);
        }
    }

    #[test]
    fn of_a_fast_clip_the_nearest_frame_is_shown() {
        let index = Index { rate: 60.0, ..index(1000, 0, &[]) };
        let random = Key([4; 32]).sequence();
        let at = |time: f64, rate: Option<f64>| {
            frame_at(&index, Motion::Runs { end: Loop::Repeat, rate }, (time, None), &mut random.clone())
        };
        let start = at(0.0, None).first;
        let passed = |time: f64| (at(time, None).first + 1000 - start) % 1000;
        // At 20 frames a second three each, at 25 two or three.
        assert_eq!([0.05, 0.1, 0.15, 0.04, 0.08, 0.12, 0.16].map(passed), [3, 6, 9, 2, 5, 7, 10]);
        for i in 0..100 {
            assert_eq!(at(f64::from(i) / 77.0, None).weight, 0);
        }
        // In slow motion both are shown again.
        assert_eq!(at(0.05, Some(10.0)).weight, 128);
        assert!(at(1e300, None).first < 1000);
    }

    #[test]
    fn frames_with_times_of_their_own_are_shown_at_these() {
        // 100, 400, 40 and 60 ms.
        let durations = vec![100_000_000, 400_000_000, 40_000_000, 60_000_000];
        let index = Index { rate: 4.0 / 0.6, durations, ..index(4, 0, &[]) };
        let random = (0..).map(|key| Key([key; 32]).sequence()).find(|random| random.clone().below(4) == 0);
        let random = random.unwrap();
        let at = |time: f64, end: Loop, rate: Option<f64>| {
            let Shown { first, second, weight } =
                frame_at(&index, Motion::Runs { end, rate }, (time, None), &mut random.clone());
            (first, second, weight)
        };
        for (time, shown) in [
            (0.0, (0, 1, 0)),
            (0.05, (0, 1, 128)),
            (0.1, (1, 2, 0)),
            (0.4, (1, 2, 192)),
            (0.51, (2, 3, 64)),
            (0.54, (3, 0, 0)),
            (0.6, (0, 1, 0)),
            (-0.06, (3, 0, 0)),
        ] {
            assert_eq!(at(time, Loop::Repeat, None), shown, "{time}");
            // Twice as many frames a second.
            assert_eq!(at(time / 2.0, Loop::Repeat, Some(8.0 / 0.6)), shown, "{time}");
        }
        // There and back: 0 1 2 3 2 1.
        assert_eq!(at(0.62, Loop::PingPong, None), (2, 1, 128));
        assert_eq!(at(0.64, Loop::PingPong, None), (1, 0, 0));
        assert_eq!(at(1.04, Loop::PingPong, None), (0, 1, 0));
        for time in [f64::NAN, 1e300, -1e300] {
            assert!(at(time, Loop::Repeat, None).0 < 4);
        }
    }

    #[test]
    fn what_comes_past_the_vehicle_follows_the_way_it_drives() {
        let index = index(1000, 0, &[]);
        let random = Key([4; 32]).sequence();
        let drive = Drive { speed: 10.0, still: 0.4 };
        let at = |time: f64, travelled: Option<f64>| {
            let motion = Motion::Driven { end: Loop::Repeat, drive };
            frame_at(&index, motion, (time, travelled), &mut random.clone()).first
        };
        let start = at(0.0, None);
        let passed = |time, travelled| (at(time, travelled) + 1000 - start) % 1000;
        // At the speed it was made for it runs as it is, and also if the distance driven is not known.
        assert_eq!((passed(2.0, None), passed(2.0, Some(20.0))), (60, 60));
        // Twice as fast, and standing still.
        assert_eq!((passed(2.0, Some(40.0)), passed(2.0, Some(0.0))), (96, 24));
    }

    #[test]
    fn a_still_frame_is_one_that_shows_something_and_depends_on_the_key_alone() {
        let index = index(6, 1, &[0.0, 10.0, 40.0, 0.0, 14.0, 13.0]);
        let mut chosen = Vec::new();
        for key in 0..40 {
            let random = Key([key; 32]).sequence();
            let frame = frame_at(&index, Motion::Stands, (0.0, None), &mut random.clone());
            assert_eq!(frame, frame_at(&index, Motion::Stands, (7.3, Some(9.0)), &mut random.clone()));
            assert_eq!(frame.weight, 0);
            let frame = frame.first;
            chosen.push(frame);
        }
        chosen.sort_unstable();
        chosen.dedup();
        assert_eq!(chosen, [2, 4]);
    }
}
