//! What is lost in bursts: frames, controls, readings of a sensor.
//!
//! At each frame a burst may begin, and it lasts a geometrically distributed number of frames. A frame is lost if it lies in any burst. This
//! is the behaviour of the simple channel of Gilbert, in a form in which whether a frame is lost follows from the draws of the last
//! [`LONGEST`] frames, and not from a state. One frame in `LONGEST + 1` arrives in any case, so that no more are lost in a row.

use crate::describe::{Description, Parameter};
use crate::perturbation::Context;

/// The most frames that are lost in a row.
pub const LONGEST: u64 = 40;

/// How often and for how long frames are lost, or what comes once a frame.
#[derive(Debug, Clone, Copy)]
pub struct Bursts {
    /// The probability that a burst begins at a frame.
    begins: f64,
    /// The probability that a burst lasts another frame.
    lasts: f64,
}

impl Bursts {
    /// Bursts that lose this share of all frames, `mean` of them in a row on average; if that is less than what comes of losing each by
    /// itself, each is lost by itself.
    pub fn new(share: f64, mean: f64) -> Self {
        // After a frame that arrived, frames are lost once another burst begins, and after one that arrived in any case, if a burst goes on.
        // So rows begin `begins (1 - share) + share / (LONGEST + 1)` times a frame, and the mean of their lengths is `share` divided by
        // that.
        let begins = share * (1.0 / mean - 1.0 / (LONGEST + 1) as f64) / (1.0 - share);
        // As many as the longest bursts need to lose the share.
        let begins = begins.max(1.0 - libm::pow(1.0 - share, 1.0 / LONGEST as f64));
        if share <= 0.0 || begins >= share {
            return Self { begins: share, lasts: 0.0 };
        }
        // A frame arrives if no burst that began k frames before it lasts longer than k frames. The probability of that falls with `lasts`.
        let arrives = |lasts: f64| {
            let mut reaches = begins;
            (0..LONGEST).fold(1.0, |arrives, _| {
                let still = arrives * (1.0 - reaches);
                reaches *= lasts;
                still
            })
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if arrives(middle) > 1.0 - share { low = middle } else { high = middle }
        }
        Self { begins, lasts: low }
    }

    /// Whether a frame of the sequence is lost.
    pub fn lose(&self, frame_index: u64, cx: &Context<'_>) -> bool {
        let first = u64::from(cx.sequence_random().below(LONGEST as u32 + 1));
        let arrives = frame_index % (LONGEST + 1) == first;
        !arrives
            && (0..LONGEST.min(frame_index.saturating_add(1)))
                .any(|back| self.length(frame_index - back, cx) > back)
    }

    /// How many frames the burst lasts that begins at a frame; 0 if none does.
    fn length(&self, frame_index: u64, cx: &Context<'_>) -> u64 {
        let mut random = cx.random_of(frame_index);
        if random.unit() >= self.begins {
            return 0;
        }
        let mut length = 1;
        while length < LONGEST && random.unit() < self.lasts {
            length += 1;
        }
        length
    }
}

/// The parameters of bursts, by level: the share of `what`, such as frames, that is lost, and how many are lost in a row.
pub fn described(description: Description, what: &str, share: [f64; 5], mean: [f64; 5]) -> Description {
    let in_a_row = format!(
        "how many {what} are lost in a row, on average; no fewer than if each were lost by itself, and never more than {LONGEST}"
    );
    let lost = format!("share of the {what} that are lost; 1 of {} arrives in any case", LONGEST + 1);
    description
        .parameter(Parameter::by_level("lost", share, &lost).range(0.0, 1.0))
        .parameter(Parameter::by_level("burst", mean, &in_a_row).range(1.0, LONGEST as f64).unit("frames"))
}

/// The bursts that the parameters of a frame ask for.
pub fn of(cx: &Context<'_>) -> Bursts {
    Bursts::new(cx.number("lost"), cx.number("burst"))
}

#[cfg(test)]
mod tests {
    use pdk_seed::Key;

    use super::*;

    /// Which frames of a long sequence are lost.
    fn lost(share: f64, mean: f64) -> Vec<bool> {
        let (key, bursts) = (Key([4; 32]), Bursts::new(share, mean));
        (0..40_000).map(|index| bursts.lose(index, &Context::new(2.0, index, 0.0, &key))).collect()
    }

    /// The lengths of the rows of lost frames.
    fn rows(lost: &[bool]) -> Vec<usize> {
        lost.split(|lost| !lost).map(<[bool]>::len).filter(|length| *length > 0).collect()
    }

    #[test]
    fn as_many_frames_are_lost_as_asked_for_in_rows_as_long_as_asked_for() {
        for (share, mean) in [(0.1, 2.0), (0.2, 6.0), (0.35, 4.0), (0.5, 10.0), (0.6, 12.0), (0.7, 16.0)] {
            let lost = lost(share, mean);
            let found = lost.iter().filter(|lost| **lost).count() as f64 / lost.len() as f64;
            assert!((found - share).abs() < 0.03, "{share} in rows of {mean}: {found}");
            let rows = rows(&lost);
            let length = rows.iter().sum::<usize>() as f64 / rows.len() as f64;
            assert!((length / mean - 1.0).abs() < 0.25, "{share} in rows of {mean}: {length}");
        }
        // Each by itself makes longer rows than these.
        let each = rows(&lost(0.5, 1.0));
        let length = each.iter().sum::<usize>() as f64 / each.len() as f64;
        assert!((length - 2.0).abs() < 0.1, "{length}");
    }

    #[test]
    fn never_more_are_lost_in_a_row_than_the_longest() {
        for (share, mean) in [(0.7, 16.0), (0.9, 40.0), (1.0, 40.0)] {
            let longest = rows(&lost(share, mean)).into_iter().max();
            assert!(longest <= Some(LONGEST as usize), "{share} in rows of {mean}: {longest:?}");
        }
    }

    #[test]
    fn nothing_or_all_but_one_of_many_is_lost_at_the_ends() {
        assert!(lost(0.0, 3.0).iter().all(|lost| !lost));
        let all = lost(1.0, 3.0);
        let arrived = all.iter().filter(|lost| !**lost).count();
        assert_eq!(arrived, all.len().div_ceil(LONGEST as usize + 1));
    }
}
