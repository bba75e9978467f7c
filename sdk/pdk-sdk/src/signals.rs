//! What passed between driver and vehicle at the frames before the one at hand, for perturbations that act on it: late controls, a slow
//! actuator, a speed that stays at its last value.
//!
//! A perturbation [asks](crate::describe::Description::history) for a number of frames, and keeps nothing itself. So what it does at a frame
//! follows from that many frames before it.

use crate::error::{Error, Result};

/// The numbers of a signal: steering and throttle of a control, time and speed of what the driver gets.
pub type Numbers = [f64; 2];

/// What passed at the frames before the one at hand. There are fewer than a perturbation asks for at the beginning of a drive. Frames that the
/// driver missed because it was late are not among them.
#[derive(Debug, Clone, Copy, Default)]
pub struct Signals<'a> {
    /// The number of each frame, the oldest first.
    pub(crate) indices: &'a [u64],
    /// Its time.
    pub(crate) times: &'a [f64],
    /// What the perturbation was given.
    pub(crate) given: &'a [Numbers],
    /// What it made of it.
    pub(crate) passed: &'a [Numbers],
}

/// What passed at one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Signal {
    /// The number of the frame in its sequence.
    pub frame_index: u64,
    /// Its simulation time in seconds.
    pub time: f64,
    /// What the perturbation was given: what the driver decided, or what is true, unless another perturbation came before.
    pub given: Numbers,
    /// What the perturbation made of it.
    pub passed: Numbers,
}

impl<'a> Signals<'a> {
    /// What crosses between pdk and a plugin.
    ///
    /// # Errors
    /// If its parts do not fit each other.
    pub(crate) fn new(
        indices: &'a [u64],
        times: &'a [f64],
        given: &'a [Numbers],
        passed: &'a [Numbers],
    ) -> Result<Self> {
        match [times.len(), given.len(), passed.len()].iter().all(|length| *length == indices.len()) {
            true => Ok(Self { indices, times, given, passed }),
            false => Err(Error::new("the earlier signals of a call do not fit each other")),
        }
    }

    /// How many frames there are.
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// The signals, the latest first.
    pub fn iter(&self) -> impl Iterator<Item = Signal> + '_ {
        (1..=self.len()).filter_map(|back| self.back(back))
    }

    /// The signal this many frames back: 1 is the one before the frame at hand. None if there are not that many, and for 0.
    pub fn back(&self, frames: usize) -> Option<Signal> {
        let place = self.len().checked_sub(frames).filter(|_| frames > 0)?;
        Some(Signal {
            frame_index: *self.indices.get(place)?,
            time: *self.times.get(place)?,
            given: *self.given.get(place)?,
            passed: *self.passed.get(place)?,
        })
    }
}

/// Keeps the latest signals of a drive. It allocates when it is made, not for every frame.
#[derive(Debug, Clone, Default)]
pub struct Passed {
    /// How many are handed over at most. There is room for twice as many, so that what is handed over lies in one piece.
    most: usize,
    indices: Vec<u64>,
    times: Vec<f64>,
    given: Vec<Numbers>,
    passed: Vec<Numbers>,
}

impl Passed {
    /// Keeps those of this many frames.
    pub fn of(frames: usize) -> Self {
        let room = 2 * frames;
        Self {
            most: frames,
            indices: Vec::with_capacity(room),
            times: Vec::with_capacity(room),
            given: Vec::with_capacity(room),
            passed: Vec::with_capacity(room),
        }
    }

    /// Forgets all signals: a drive begins.
    pub fn forget(&mut self) {
        self.truncate(0);
    }

    fn truncate(&mut self, length: usize) {
        self.indices.truncate(length);
        self.times.truncate(length);
        self.given.truncate(length);
        self.passed.truncate(length);
    }

    /// What comes before the frame with this number. Signals of it and of later ones are forgotten, so that a drive can be wound back.
    pub fn before(&mut self, frame_index: u64) -> Signals<'_> {
        self.truncate(self.indices.partition_point(|index| *index < frame_index));
        let oldest = self.indices.len().saturating_sub(self.most);
        Signals {
            indices: &self.indices[oldest..],
            times: &self.times[oldest..],
            given: &self.given[oldest..],
            passed: &self.passed[oldest..],
        }
    }

    /// Keeps what passed at a frame.
    pub fn keep(&mut self, Signal { frame_index, time, given, passed }: Signal) {
        if self.most == 0 {
            return;
        }
        if self.indices.len() == 2 * self.most {
            self.indices.drain(..=self.most);
            self.times.drain(..=self.most);
            self.given.drain(..=self.most);
            self.passed.drain(..=self.most);
        }
        self.indices.push(frame_index);
        self.times.push(time);
        self.given.push(given);
        self.passed.push(passed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signal(index: u64) -> Signal {
        let value = index as f64;
        Signal {
            frame_index: index,
            time: value / 20.0,
            given: [value, -value],
            passed: [value + 0.5, -value - 0.5],
        }
    }

    #[test]
    fn the_latest_signals_are_kept_and_the_latest_comes_first() {
        let mut kept = Passed::of(3);
        assert!(kept.before(0).is_empty());
        for index in 0..20 {
            let signals = kept.before(index);
            let expected: Vec<Signal> = (index.saturating_sub(3)..index).rev().map(signal).collect();
            assert_eq!(signals.iter().collect::<Vec<_>>(), expected, "frame {index}");
            assert_eq!((signals.back(0), signals.back(expected.len() + 1)), (None, None));
            kept.keep(signal(index));
            assert_eq!(kept.indices.capacity(), 6);
        }
        // Wound back: what comes later is forgotten.
        assert_eq!(kept.before(19).back(1), Some(signal(18)));
        kept.forget();
        assert!(kept.before(30).is_empty());
    }

    #[test]
    fn nothing_is_kept_if_nothing_is_asked_for() {
        let mut kept = Passed::of(0);
        kept.keep(signal(1));
        assert!(kept.before(2).is_empty());
    }

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let (indices, times, numbers) = ([1, 2], [0.0, 0.1], [[0.0; 2]; 2]);
        assert_eq!(
            Signals::new(&indices, &times, &numbers, &numbers).unwrap().back(1).unwrap().frame_index,
            2
        );
        assert!(Signals::new(&indices, &times[..1], &numbers, &numbers).is_err());
        assert!(Signals::new(&indices, &times, &numbers[..1], &numbers).is_err());
        assert!(Signals::new(&indices, &times, &numbers, &numbers[..0]).is_err());
    }
}
