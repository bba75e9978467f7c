//! When the frames of a video are shown: each at a time of its own, and only those that the edit list of the file leaves.
//!
//! A file stores when a frame is to be decoded, and by how much later it is shown. An encoder that stores frames in another order than
//! that of showing lets all of them begin late, and takes that back with an edit list, which is also how cameras and editors cut
//! the beginning or the end off without encoding anew. What the list leaves out is decoded, since other frames may need it, and not shown.

use mp4::Mp4Track;
use pdk_sdk::prelude::*;

/// More frames than this are not believed: they take the memory of their times. At 30 frames a second they take 38 hours.
const MOST: u32 = 1 << 22;

/// When frames are shown, in the order in which they are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Timing {
    /// How many frames before the first one are not shown.
    pub skipped: u32,
    /// When each frame begins, in ticks after the first one; behind them when the last one ends.
    ticks: Vec<i64>,
    /// Ticks a second.
    scale: u32,
}

impl Timing {
    /// The timing of a track, in a file whose edit lists count in `movie_scale` ticks a second. The index has been looked at.
    ///
    /// # Errors
    /// If the edit list does more than cut, or leaves nothing.
    pub fn of(track: &Mp4Track, movie_scale: u32) -> Result<Self> {
        let tables = &track.trak.mdia.minf.stbl;
        let scale = track.trak.mdia.mdhd.timescale.max(1);
        let count = track.sample_count();
        if count > MOST {
            return Err(Error::new(format!(
                "it has {count} frames, and a video may have {MOST}; cut it into parts"
            )));
        }
        let durations = tables.stts.entries.iter();
        let durations =
            durations.flat_map(|entry| std::iter::repeat_n(entry.sample_delta, entry.sample_count as usize));
        let offsets = tables.ctts.iter().flat_map(|offsets| &offsets.entries);
        let offsets =
            offsets.flat_map(|entry| std::iter::repeat_n(entry.sample_offset, entry.sample_count as usize));
        // When each begins, and how long it lasts.
        let mut decoded = 0;
        let mut frames: Vec<(i64, u32)> = durations
            .zip(offsets.chain(std::iter::repeat(0)))
            .take(count as usize)
            .map(|(duration, offset)| {
                let begins = decoded + i64::from(offset);
                decoded += i64::from(duration);
                (begins, duration)
            })
            .collect();
        frames.sort_by_key(|&(begins, _)| begins);

        let edit = Edit::of(track, scale, movie_scale.max(1))?;
        let skipped = frames.partition_point(|&(begins, _)| begins < edit.from);
        let shown = frames.partition_point(|&(begins, _)| edit.to.is_none_or(|to| begins < to));
        let Some(&[(first, _), ..]) = frames.get(skipped..shown) else {
            return Err(Error::new("its edit list leaves none of its frames"));
        };
        let (last, duration) = frames[shown - 1];
        let end = last + i64::from(duration);
        // An edit list says in ticks of its own when the last frame ends.
        let end = edit.to.filter(|to| to.abs_diff(end) > edit.tick).unwrap_or(end);
        let mut ticks: Vec<i64> = frames[skipped..shown].iter().map(|&(begins, _)| begins - first).collect();
        ticks.push(end - first);
        Ok(Self { skipped: skipped as u32, ticks, scale })
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
    fn of(track: &Mp4Track, scale: u32, movie_scale: u32) -> Result<Self> {
        let list = track.trak.edts.as_ref().and_then(|edits| edits.elst.as_ref());
        let empty = list.map_or(u64::MAX, |list| if list.version == 1 { u64::MAX } else { u32::MAX.into() });
        let parts = list.into_iter().flat_map(|list| &list.entries);
        // Nothing is shown before a track begins late, such as after its sound: time counts from the first frame.
        let parts: Vec<_> = parts.filter(|part| part.media_time != empty).collect();
        let tick = u64::from(scale.div_ceil(movie_scale));
        match parts[..] {
            [] => Ok(Self { from: i64::MIN, to: None, tick }),
            [part] if (part.media_rate, part.media_rate_fraction) == (1, 0) => {
                let from = i64::try_from(part.media_time).unwrap_or(i64::MAX);
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

fn unknown(what: &str) -> Error {
    Error::new(format!(
        "its edit list {what}, which the built-in reader cannot do; convert it, such as with `ffmpeg -i VIDEO -c:v libx264 \
         -pix_fmt yuv420p OUT.mp4`"
    ))
}
