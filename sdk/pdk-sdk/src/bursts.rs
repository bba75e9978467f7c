//! What is lost in bursts: frames, controls, readings of a sensor.
//!
//! At each frame a burst may begin, and it lasts a geometrically distributed number of frames. A frame is lost if it lies in any burst. This
//! is the behaviour of the simple channel of Gilbert, in a form in which whether a frame is lost follows from the draws of the last
//! [`LONGEST`] frames, and not from a state.

use crate::describe::{Description, Parameter};
use crate::perturbation::Context;

/// The longest burst in frames; the geometric distribution is cut there.
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
    /// Bursts of `mean` frames on average that lose this share of all frames.
    pub fn new(share: f64, mean: f64) -> Self {
        let lasts = 1.0 - 1.0 / mean.max(1.0);
        // A frame is kept if no burst that began k frames before it lasts longer than k frames. The probability of that falls with `begins`.
        let kept = |begins: f64| {
            let mut reaches = begins;
            (0..LONGEST).fold(1.0, |kept, _| {
                let still = kept * (1.0 - reaches);
                reaches *= lasts;
                still
            })
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if kept(middle) > 1.0 - share { low = middle } else { high = middle }
        }
        Self { begins: if share >= 1.0 { 1.0 } else { low }, lasts }
    }

    /// Whether a frame of the sequence is lost.
    pub fn lose(&self, frame_index: u64, cx: &Context<'_>) -> bool {
        (0..LONGEST.min(frame_index.saturating_add(1))).any(|back| self.length(frame_index - back, cx) > back)
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
    let in_a_row = format!("how many {what} are lost in a row, on average; never more than {LONGEST}");
    description
        .parameter(
            Parameter::by_level("lost", share, &format!("share of the {what} that are lost")).range(0.0, 1.0),
        )
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

    #[test]
    fn as_many_frames_are_lost_as_asked_for_in_bursts_as_long_as_asked_for() {
        let key = Key([4; 32]);
        for (share, mean) in [(0.1, 1.0), (0.5, 1.0), (0.2, 6.0), (0.6, 12.0)] {
            let bursts = Bursts::new(share, mean);
            let lost: Vec<bool> =
                (0..20_000).map(|index| bursts.lose(index, &Context::new(2.0, index, 0.0, &key))).collect();
            let found = lost.iter().filter(|lost| **lost).count() as f64 / lost.len() as f64;
            assert!((found - share).abs() < 0.03, "{share} in bursts of {mean}: {found}");
            let begun: Vec<u64> = (0..20_000)
                .map(|index| bursts.length(index, &Context::new(2.0, index, 0.0, &key)))
                .filter(|length| *length > 0)
                .collect();
            let length = begun.iter().sum::<u64>() as f64 / begun.len() as f64;
            assert!((length - mean).abs() < 0.1 * mean, "bursts of {mean}: {length}");
        }
    }

    #[test]
    fn nothing_or_everything_is_lost_at_the_ends() {
        let key = Key([4; 32]);
        let lost = |share, index| Bursts::new(share, 3.0).lose(index, &Context::new(2.0, index, 0.0, &key));
        assert!((0..500).all(|index| !lost(0.0, index) && lost(1.0, index)));
    }
}
