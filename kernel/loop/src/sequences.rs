//! Where a recording begins anew: a driver that remembers earlier frames has to forget them there.

use pdk_sdk::prelude::Position;

/// From one frame to the next, numbers and times may grow by this many usual steps.
const LARGEST_STEP: f64 = 5.0;

/// The first frame of each sequence, in order.
///
/// A frame begins a sequence if it belongs to another part of the recording than the frame before it; if its number or its time is
/// smaller; or if its number or its time is larger by more than [`LARGEST_STEP`] times the usual step, which is the median over the
/// recording. A time that is not known says nothing.
pub fn starts(positions: &[Position]) -> Vec<usize> {
    let numbers: Vec<f64> = positions.windows(2).map(|pair| number_step(&pair[0], &pair[1])).collect();
    let times: Vec<f64> = positions.windows(2).map(|pair| pair[1].time - pair[0].time).collect();
    let (by_number, by_time) = (largest_step(&numbers), largest_step(&times));
    let jumps = |step: f64, largest: f64| step < 0.0 || step > largest;
    let begins = |at: &usize| {
        positions[at - 1].part != positions[*at].part
            || jumps(numbers[at - 1], by_number)
            || jumps(times[at - 1], by_time)
    };
    (0..positions.len()).filter(|at| *at == 0 || begins(at)).collect()
}

fn number_step(before: &Position, after: &Position) -> f64 {
    after.number as f64 - before.number as f64
}

/// The largest step that is not a jump; infinite if there is no usual step.
fn largest_step(steps: &[f64]) -> f64 {
    let mut forward: Vec<f64> = steps.iter().copied().filter(|step| *step > 0.0).collect();
    forward.sort_by(f64::total_cmp);
    forward.get(forward.len() / 2).map_or(f64::INFINITY, |usual| usual * LARGEST_STEP)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn positions(frames: &[(u64, u64, f64)]) -> Vec<Position> {
        frames.iter().map(|&(part, number, time)| Position { part, number, time }).collect()
    }

    #[test]
    fn a_recording_without_gaps_is_one_sequence() {
        let even: Vec<_> = (0..50).map(|n| (0, n, n as f64 / 20.0)).collect();
        assert_eq!(starts(&positions(&even)), [0]);
        // Every tenth frame was kept, and there are no times.
        let sparse: Vec<_> = (0..50).map(|n| (0, 10 * n, f64::NAN)).collect();
        assert_eq!(starts(&positions(&sparse)), [0]);
        assert!(starts(&[]).is_empty());
    }

    #[test]
    fn a_jump_of_numbers_or_times_or_another_part_begins_a_sequence() {
        let mut frames: Vec<_> = (0..40).map(|n| (u64::from(n >= 30), n, n as f64 / 20.0)).collect();
        // Five frames are missing from here on, and four from there on.
        frames[10..].iter_mut().for_each(|frame| frame.1 += 5);
        frames[15..].iter_mut().for_each(|frame| frame.1 += 4);
        // The clock was put back, and stood still for a quarter of a second and a little more.
        frames[20..].iter_mut().for_each(|frame| frame.2 -= 1.0);
        frames[25..].iter_mut().for_each(|frame| frame.2 += 0.21);
        assert_eq!(starts(&positions(&frames)), [0, 10, 20, 25, 30]);
    }
}
