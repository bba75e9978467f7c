//! The latest frames of a scenario, so that the record of a failure shows what came before it.

use std::collections::VecDeque;

use pdk_sdk::prelude::{Frame, FrameBuf};

/// How long before the last frame the others are, in seconds; the longest first.
pub const BEFORE: [f64; 2] = [2.0, 1.0];
/// The time between frames that are kept, in seconds.
const SPACING: f64 = 0.5;

/// The last frame, and some of the two seconds before it. Each is what the camera and what the driver saw.
#[derive(Default)]
pub struct Recent {
    kept: VecDeque<Pair>,
    last: Option<Pair>,
    /// Frames that can be filled.
    spare: Vec<Pair>,
}

/// A frame as the camera and as the driver saw it.
#[derive(Default)]
pub struct Pair {
    /// Its number.
    pub sequence: u64,
    /// Simulation time in seconds.
    pub time: f64,
    /// What the camera saw.
    pub raw: FrameBuf,
    /// What the driver saw.
    pub perturbed: FrameBuf,
}

impl Recent {
    /// Forgets everything, for another scenario.
    pub fn clear(&mut self) {
        self.spare.extend(self.kept.drain(..).chain(self.last.take()));
    }

    /// Adds the next frame. Frames of the same size need no new memory once some seconds have gone by.
    pub fn add(&mut self, sequence: u64, time: f64, raw: Frame<'_>, perturbed: Frame<'_>) {
        if let Some(last) = self.last.take() {
            match self.kept.back() {
                Some(kept) if last.time < kept.time + SPACING => self.spare.push(last),
                _ => self.kept.push_back(last),
            }
        }
        // One has to stay that is old enough.
        while self.kept.get(1).is_some_and(|kept| kept.time <= time - BEFORE[0]) {
            self.spare.extend(self.kept.pop_front());
        }
        let mut last = self.spare.pop().unwrap_or_default();
        (last.sequence, last.time) = (sequence, time);
        for (copy, frame) in [(&mut last.raw, raw), (&mut last.perturbed, perturbed)] {
            copy.resize(frame.width(), frame.height());
            copy.as_mut().copy_from(frame);
        }
        self.last = Some(last);
    }

    /// The last frame and those at least [`BEFORE`] it, as far as there are, in the order of time.
    pub fn before_the_end(&self) -> Vec<&Pair> {
        let frames: Vec<&Pair> = self.kept.iter().chain(&self.last).collect();
        let times: Vec<f64> = frames.iter().map(|pair| pair.time).collect();
        before_the_last(&times).into_iter().map(|position| frames[position]).collect()
    }
}

/// The positions of the last of some times, which are in order, and of those at least [`BEFORE`] it, as far as there are.
pub fn before_the_last(times: &[f64]) -> Vec<usize> {
    let Some(last) = times.last() else { return Vec::new() };
    // Half a millisecond allows for times that are sums of rounded frame times.
    let at = |before: &f64| times.iter().rposition(|time| *time <= last - before + 0.0005);
    let mut positions: Vec<usize> = BEFORE.iter().filter_map(at).chain([times.len() - 1]).collect();
    positions.dedup();
    positions
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(recent: &Recent) -> Vec<f64> {
        recent.before_the_end().iter().map(|pair| pair.time).collect()
    }

    #[test]
    fn the_last_frame_and_those_seconds_before_are_there() {
        let mut recent = Recent::default();
        assert!(times(&recent).is_empty());
        for scenario in 0..3 {
            recent.clear();
            for sequence in 0..=200u64 {
                let mut frame = FrameBuf::new(4, 2);
                frame.as_mut().data_mut().fill(sequence as u8);
                recent.add(sequence, sequence as f64 / 20.0, frame.as_ref(), frame.as_ref());
                let frames = recent.kept.len() + recent.spare.len() + usize::from(recent.last.is_some());
                assert!(frames <= 8, "{frames}, scenario {scenario}");
                match sequence {
                    0 => assert_eq!(times(&recent), [0.0]),
                    10 => assert_eq!(times(&recent), [0.5]),
                    30 => assert_eq!(times(&recent), [0.5, 1.5]),
                    200 => assert_eq!(times(&recent), [8.0, 9.0, 10.0]),
                    _ => {}
                }
            }
            for pair in recent.before_the_end() {
                assert_eq!(
                    (pair.raw.data()[0], pair.perturbed.data()[0]),
                    (pair.sequence as u8, pair.sequence as u8)
                );
                assert_eq!(pair.time, pair.sequence as f64 / 20.0);
            }
        }
    }

    #[test]
    fn at_one_frame_a_second_there_is_no_finer_choice() {
        let mut recent = Recent::default();
        let frame = FrameBuf::new(1, 1);
        for sequence in 0..5 {
            recent.add(sequence, sequence as f64 * 1.5, frame.as_ref(), frame.as_ref());
        }
        assert_eq!(times(&recent), [3.0, 4.5, 6.0]);
    }
}
