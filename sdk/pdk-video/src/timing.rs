//! When the frames of a video are shown: each at a time of its own, and only those that the edit list of the file leaves.
//!
//! A file stores when a frame is to be decoded, and by how much later it is shown. An encoder that stores frames in another order than
//! that of showing lets all of them begin late, and takes that back with an edit list, which is also how cameras and editors cut
//! the beginning or the end off without encoding anew. What the list leaves out is decoded, since other frames may need it, and not shown.

use mp4_atom::ElstEntry;
use pdk_sdk::prelude::*;

use crate::sample::Left;

/// More frames than this are not believed: they take the memory of their times. At 30 frames a second they take 38 hours.
pub const MOST: u32 = 1 << 22;

/// When a frame is shown, in ticks of its track.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Moment {
    /// When it begins.
    pub begins: i64,
    /// How long it lasts until the next one is decoded.
    pub duration: u32,
}

/// When frames are shown, in the order in which they are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Timing {
    /// How many frames before the first one are not shown.
    pub skipped: u32,
    /// When each frame begins, in ticks after the first one; behind them when the last one ends.
    ticks: Vec<i64>,
    /// Ticks a second.
    scale: u32,
    /// Frames behind which nothing is decoded that is shown before them, and before which nothing that is shown later: they have the
    /// same place in both orders.
    begins: Vec<u32>,
}

impl Timing {
    /// The timing of frames, given in the order of decoding, of a track with `scale` ticks a second, in a file whose edit lists count in
    /// `movie_scale` ticks a second.
    ///
    /// # Errors
    /// If the edit list does more than cut, or leaves nothing.
    pub fn new(frames: Vec<Moment>, scale: u32, edits: &[ElstEntry], movie_scale: u32) -> Result<Self, Left> {
        let begins = beginnings(&frames);
        let mut frames: Vec<(i64, u32)> =
            frames.into_iter().map(|frame| (frame.begins, frame.duration)).collect();
        frames.sort_by_key(|&(begins, _)| begins);

        let edit = Edit::of(edits, scale, movie_scale.max(1))?;
        let skipped = frames.partition_point(|&(begins, _)| begins < edit.from);
        let shown = frames.partition_point(|&(begins, _)| edit.to.is_none_or(|to| begins < to));
        let Some(&[(first, _), ..]) = frames.get(skipped..shown) else {
            return Err(Error::new("its edit list leaves none of its frames").into());
        };
        let (last, duration) = frames[shown - 1];
        let end = last.saturating_add(i64::from(duration));
        // An edit list says in ticks of its own when the last frame ends.
        let end = edit.to.filter(|to| to.abs_diff(end) > edit.tick).unwrap_or(end);
        let mut ticks: Vec<i64> =
            frames[skipped..shown].iter().map(|&(begins, _)| begins.saturating_sub(first)).collect();
        ticks.push(end.saturating_sub(first));
        Ok(Self { skipped: skipped as u32, ticks, scale, begins })
    }

    /// How many frames are shown.
    pub fn count(&self) -> u32 {
        (self.ticks.len() - 1) as u32
    }

    /// When a frame begins, in seconds after the first one; that of the number behind the last one is when the last one ends.
    pub fn time(&self, frame: u32) -> f64 {
        let ticks = self.ticks.get(frame as usize).or(self.ticks.last());
        ticks.map_or(0.0, |&ticks| ticks as f64 / f64::from(self.scale))
    }

    /// Ticks a second.
    pub fn scale(&self) -> u32 {
        self.scale
    }

    /// Where to begin decoding so that a frame comes soon: a place that is the same in the orders of decoding and of showing. `alone`
    /// says with which ones decoding can begin.
    pub fn before(&self, frame: u32, alone: impl Fn(u32) -> bool) -> u32 {
        let wanted = frame.saturating_add(self.skipped);
        let behind = self.begins.partition_point(|&place| place <= wanted);
        self.begins[..behind].iter().rev().copied().find(|&place| alone(place)).unwrap_or_default()
    }
}

/// The frames that have the same place in the orders of decoding and of showing, and divide both: all that is decoded before them is shown
/// before them, and the same behind them.
fn beginnings(frames: &[Moment]) -> Vec<u32> {
    let mut latest = i64::MIN;
    let mut after = vec![false; frames.len()];
    for (place, frame) in frames.iter().enumerate() {
        after[place] = frame.begins >= latest;
        latest = latest.max(frame.begins);
    }
    let mut earliest = i64::MAX;
    let mut found = Vec::new();
    for (place, frame) in frames.iter().enumerate().rev() {
        if after[place] && frame.begins < earliest {
            found.push(place as u32);
        }
        earliest = earliest.min(frame.begins);
    }
    found.reverse();
    found
}

/// The part of a track that is shown, in ticks of the track.
struct Edit {
    from: i64,
    /// None if it is shown to its end.
    to: Option<i64>,
    /// How exactly the list says that.
    tick: u64,
}

impl Edit {
    fn of(parts: &[ElstEntry], scale: u32, movie_scale: u32) -> Result<Self, Left> {
        // Nothing is shown before a track begins late, such as after its sound: time counts from the first frame.
        let parts: Vec<_> = parts.iter().filter_map(|part| Some((part, part.media_time?))).collect();
        let tick = u64::from(scale.div_ceil(movie_scale));
        match parts[..] {
            [] => Ok(Self { from: i64::MIN, to: None, tick }),
            [(part, from)] if part.media_rate == 1.into() => {
                let from = i64::try_from(from).unwrap_or(i64::MAX);
                let (scale, movie_scale) = (u128::from(scale), u128::from(movie_scale));
                let length = (u128::from(part.segment_duration) * scale + movie_scale / 2) / movie_scale;
                let length = i64::try_from(length).unwrap_or(i64::MAX);
                Ok(Self { from, to: (length > 0).then(|| from.saturating_add(length)), tick })
            }
            [_] => Err(unknown("plays it at another speed")),
            _ => Err(unknown("puts it together from several parts")),
        }
    }
}

fn unknown(what: &str) -> Left {
    Left::Other(format!("an MP4 file whose edit list {what}"))
}

/// Makes sure that the times of this many frames find room in memory.
pub fn few_enough(count: u32) -> Result<()> {
    match count > MOST {
        true => {
            Err(Error::new(format!("it has {count} frames, and a video may have {MOST}; cut it into parts")))
        }
        false => Ok(()),
    }
}
