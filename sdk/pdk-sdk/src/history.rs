//! Earlier frames of a sequence, for perturbations that show what the camera saw before: frozen, late or partial frames.
//!
//! A perturbation [asks](crate::describe::Description::history) for a number of frames. Then any frame of a recording can still be
//! computed on its own, from that many frames before it.

use pdk_ops::Frame;

use crate::error::{Error, Result};

/// The most frames that a perturbation may ask for.
pub const MOST_FRAMES: u32 = 240;

/// The frames before the one at hand, as the perturbation was given them: with what perturbations before it in a chain did to them. There are
/// fewer than it asks for at the beginning of a sequence, and none for a picture that stands alone. Frames that the driver missed because it
/// was late are not among them.
#[derive(Debug, Clone, Copy, Default)]
pub struct History<'a> {
    pub(crate) ring: Ring<'a>,
}

/// One frame of a [`History`].
#[derive(Debug, Clone, Copy)]
pub struct Earlier<'a> {
    /// Its pixels. It is as large as the frame at hand.
    pub frame: Frame<'a>,
    /// Its number in the sequence.
    pub frame_index: u64,
    /// Its simulation time in seconds.
    pub time: f64,
}

/// Frames in slots, which are used in turn. Some slots may be free.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Ring<'a> {
    /// Slot after slot, each as large as a frame.
    pub pixels: &'a [u8],
    /// The number of the frame in each slot.
    pub indices: &'a [u64],
    /// The time of the frame in each slot.
    pub times: &'a [f64],
    /// The slot of the latest frame.
    pub latest: usize,
    /// How many slots are in use: the latest and those before it.
    pub length: usize,
    pub width: usize,
    pub height: usize,
}

impl<'a> History<'a> {
    /// What crosses between pdk and a plugin.
    ///
    /// # Errors
    /// If its parts do not fit each other.
    pub(crate) fn new(ring: Ring<'a>) -> Result<Self> {
        let slots = ring.indices.len();
        let size = ring.width.checked_mul(ring.height).and_then(|pixels| pixels.checked_mul(3));
        let fits = size.and_then(|size| size.checked_mul(slots)) == Some(ring.pixels.len())
            && ring.times.len() == slots
            && ring.length <= slots
            && (ring.length == 0 || (ring.latest < slots && size != Some(0)));
        match fits {
            true => Ok(Self { ring }),
            false => Err(Error::new("the earlier frames of a call do not fit each other")),
        }
    }

    /// How many frames there are.
    pub fn len(&self) -> usize {
        self.ring.length
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ring.length == 0
    }

    /// The frames, the latest first.
    pub fn iter(&self) -> impl Iterator<Item = Earlier<'a>> + '_ {
        (1..=self.len()).filter_map(|back| self.back(back))
    }

    /// The frame this many frames back: 1 is the one before the frame at hand. None if there are not that many, and for 0.
    pub fn back(&self, frames: usize) -> Option<Earlier<'a>> {
        let Ring { pixels, indices, times, latest, length, width, height } = self.ring;
        if frames == 0 || frames > length {
            return None;
        }
        let slot = (latest + indices.len() + 1 - frames) % indices.len();
        let size = width * height * 3;
        let frame = Frame::new(pixels.get(slot * size..)?.get(..size)?, width, height).ok()?;
        Some(Earlier { frame, frame_index: *indices.get(slot)?, time: *times.get(slot)? })
    }
}

/// Keeps the latest frames of a sequence. It allocates when it is made and when frames change their size, not for every frame.
#[derive(Debug, Clone, Default)]
pub struct Recollection {
    pixels: Vec<u8>,
    indices: Vec<u64>,
    times: Vec<f64>,
    latest: usize,
    length: usize,
    width: usize,
    height: usize,
}

impl Recollection {
    /// Keeps this many frames.
    pub fn of(frames: usize) -> Self {
        Self { indices: vec![0; frames], times: vec![0.0; frames], ..Self::default() }
    }

    /// Forgets all frames: a sequence begins.
    pub fn forget(&mut self) {
        self.length = 0;
    }

    /// What comes before the frame with this number, if it is of this size. Frames with its number and later ones are forgotten, so that a
    /// sequence can be wound back.
    pub fn before(&mut self, frame: Frame<'_>, frame_index: u64) -> History<'_> {
        if (self.width, self.height) != (frame.width(), frame.height()) {
            self.forget();
        }
        while self.length > 0 && self.indices[self.latest] >= frame_index {
            self.latest = (self.latest + self.indices.len() - 1) % self.indices.len();
            self.length -= 1;
        }
        let Self { pixels, indices, times, latest, length, width, height } = self;
        let ring =
            Ring { pixels, indices, times, latest: *latest, length: *length, width: *width, height: *height };
        // Before the first frame there is no memory for pixels either.
        if self.length == 0 { History::default() } else { History { ring } }
    }

    /// Keeps a copy of a frame, in place of the oldest one if all slots are in use.
    pub fn keep(&mut self, frame: Frame<'_>, frame_index: u64, time: f64) {
        let slots = self.indices.len();
        if slots == 0 {
            return;
        }
        if (self.width, self.height) != (frame.width(), frame.height()) {
            (self.width, self.height) = (frame.width(), frame.height());
            self.pixels = vec![0; slots * self.width * self.height * 3];
            self.forget();
        }
        self.latest = (self.latest + 1) % slots;
        self.length = (self.length + 1).min(slots);
        (self.indices[self.latest], self.times[self.latest]) = (frame_index, time);
        let size = self.width * self.height * 3;
        let slot = &mut self.pixels[self.latest * size..][..size];
        for (to, from) in slot.chunks_exact_mut(self.width.max(1) * 3).zip(frame.rows()) {
            to.copy_from_slice(from);
        }
    }
}

#[cfg(test)]
mod tests {
    use pdk_ops::FrameBuf;

    use super::*;

    /// A frame in which every byte is the number.
    fn frame(number: u8, width: usize) -> FrameBuf {
        let mut frame = FrameBuf::new(width, 2);
        frame.as_mut().rows_mut().for_each(|row| row.fill(number));
        frame
    }

    fn seen(kept: &mut Recollection, index: u64, width: usize) -> Vec<(u64, u8)> {
        let now = frame(0, width);
        let history = kept.before(now.as_ref(), index);
        assert!(history.back(0).is_none() && history.back(history.len() + 1).is_none());
        (1..=history.len())
            .map(|back| {
                let earlier = history.back(back).unwrap();
                assert_eq!(earlier.time, earlier.frame_index as f64 / 20.0);
                (earlier.frame_index, earlier.frame.pixel(width - 1, 1)[2])
            })
            .collect()
    }

    #[test]
    fn the_latest_frames_are_kept_and_the_latest_comes_first() {
        let mut kept = Recollection::of(3);
        assert_eq!(seen(&mut kept, 0, 4), []);
        for index in 0..5 {
            kept.keep(frame(index as u8 + 10, 4).as_ref(), index, index as f64 / 20.0);
        }
        assert_eq!(seen(&mut kept, 5, 4), [(4, 14), (3, 13), (2, 12)]);
        // Wound back: what comes later is forgotten.
        assert_eq!(seen(&mut kept, 4, 4), [(3, 13), (2, 12)]);
        kept.keep(frame(50, 4).as_ref(), 4, 0.2);
        assert_eq!(seen(&mut kept, 5, 4), [(4, 50), (3, 13), (2, 12)]);
        // Frames of another size begin anew.
        assert_eq!(seen(&mut kept, 6, 5), []);
        kept.keep(frame(6, 5).as_ref(), 6, 0.3);
        assert_eq!(seen(&mut kept, 7, 5), [(6, 6)]);
        kept.forget();
        assert_eq!(seen(&mut kept, 8, 5), []);
    }

    #[test]
    fn nothing_is_kept_if_nothing_is_asked_for() {
        let mut kept = Recollection::of(0);
        kept.keep(frame(1, 4).as_ref(), 0, 0.0);
        assert_eq!(seen(&mut kept, 1, 4), []);
    }

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let (indices, times, pixels) = ([1, 2], [0.0, 0.1], [0; 24]);
        let ring = Ring {
            pixels: &pixels,
            indices: &indices,
            times: &times,
            latest: 1,
            length: 2,
            width: 2,
            height: 2,
        };
        assert_eq!(History::new(ring).unwrap().back(1).unwrap().frame_index, 2);
        assert_eq!(History::new(ring).unwrap().back(2).unwrap().frame_index, 1);
        for wrong in [
            Ring { latest: 2, ..ring },
            Ring { length: 3, ..ring },
            Ring { width: 3, ..ring },
            Ring { width: usize::MAX, ..ring },
            Ring { times: &times[..1], ..ring },
        ] {
            assert!(History::new(wrong).is_err());
        }
        assert!(History::new(Ring::default()).unwrap().is_empty());
    }
}
