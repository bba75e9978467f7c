//! The latest frames of a scenario, so that the record of a failure shows what came before it.

use std::collections::VecDeque;

use pdk_record::trace::ending::{BEFORE, before_the_last};
use pdk_sdk::prelude::{Frame, FrameBuf};

/// The time between frames that are kept, in seconds.
const SPACING: f64 = 0.5;

/// Some frames of the latest two seconds. Each is what the camera and what the driver saw.
///
/// The last frame is not among them: it still lies in shared memory when the end is known, so that a frame is copied every half
/// second only.
#[derive(Default)]
pub struct Recent {
    kept: VecDeque<Pair>,
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
        self.spare.extend(self.kept.drain(..));
    }

    /// Looks at the next frame, and copies it where half a second has gone by. Frames of the same size need no new memory once
    /// some seconds have gone by.
    pub fn look(&mut self, sequence: u64, time: f64, raw: Frame<'_>, perturbed: Frame<'_>) {
        if self.kept.back().is_some_and(|kept| time < kept.time + SPACING) {
            return;
        }
        // One has to stay that is old enough.
        while self.kept.get(1).is_some_and(|kept| kept.time <= time - BEFORE[0]) {
            self.spare.extend(self.kept.pop_front());
        }
        let mut pair = self.spare.pop().unwrap_or_default();
        (pair.sequence, pair.time) = (sequence, time);
        for (copy, frame) in [(&mut pair.raw, raw), (&mut pair.perturbed, perturbed)] {
            copy.resize(frame.width(), frame.height());
            copy.as_mut().copy_from(frame);
        }
        self.kept.push_back(pair);
    }

    /// Of a scenario that ended with a frame of this number and time, the frames at least [`BEFORE`] it, as far as there are,
    /// in the order of time.
    pub fn before_the_end(&self, sequence: u64, time: f64) -> Vec<&Pair> {
        let earlier: Vec<&Pair> = self.kept.iter().filter(|pair| pair.sequence < sequence).collect();
        let times: Vec<f64> = earlier.iter().map(|pair| pair.time).chain([time]).collect();
        before_the_last(&times).into_iter().filter_map(|position| earlier.get(position).copied()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(recent: &Recent, sequence: u64, time: f64) -> Vec<f64> {
        recent.before_the_end(sequence, time).iter().map(|pair| pair.time).collect()
    }

    #[test]
    fn the_frames_seconds_before_the_last_are_there() {
        let mut recent = Recent::default();
        assert!(times(&recent, 0, 0.0).is_empty());
        for _scenario in 0..3 {
            recent.clear();
            for sequence in 0..=200u64 {
                let mut frame = FrameBuf::new(4, 2);
                frame.as_mut().data_mut().fill(sequence as u8);
                let time = sequence as f64 / 20.0;
                recent.look(sequence, time, frame.as_ref(), frame.as_ref());
                assert!(recent.kept.len() + recent.spare.len() <= 8);
                let times = times(&recent, sequence, time);
                match sequence {
                    0 | 10 => assert!(times.is_empty()),
                    30 => assert_eq!(times, [0.5]),
                    200 => assert_eq!(times, [8.0, 9.0]),
                    _ => {}
                }
            }
            for pair in recent.before_the_end(201, 10.05) {
                let seen = (pair.raw.data()[0], pair.perturbed.data()[0]);
                assert_eq!(seen, (pair.sequence as u8, pair.sequence as u8));
                assert_eq!(pair.time, pair.sequence as f64 / 20.0);
            }
        }
    }

    #[test]
    fn at_one_frame_a_second_there_is_no_finer_choice() {
        let mut recent = Recent::default();
        let frame = FrameBuf::new(1, 1);
        for sequence in 0..5 {
            recent.look(sequence, sequence as f64 * 1.5, frame.as_ref(), frame.as_ref());
        }
        assert_eq!(times(&recent, 4, 6.0), [3.0, 4.5]);
    }
}
