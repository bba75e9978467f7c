//! Delayed frames: the driver sees what the camera saw some time ago.

use pdk_sdk::prelude::*;

/// Frames that it asks for: a delay of a second at 60 frames a second.
const FRAMES: u32 = 60;

/// Shows the frame of some time ago.
pub struct DelayedFrames;

impl Component for DelayedFrames {
    fn description() -> Description {
        Description::perturbation(
            "delayed_frames",
            "Shows the frame of some time ago, as if the camera were late",
        )
        .family("stream")
        .dynamic()
        .not_default()
        .alters_geometry()
        .history(FRAMES)
        .mathematics("frame(t) = the latest frame of t - delay or before")
        .source("Constant latency between exposure and decision")
        .parameter(
            Parameter::by_level(
                "delay",
                [0.05, 0.1, 0.2, 0.35, 0.5],
                "how much later the driver sees a frame; at most 60 frames",
            )
            .range(0.0, 1.0)
            .unit("s"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for DelayedFrames {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        // Times are sums of steps, so they miss a multiple of a step by a rounding error.
        let latest = cx.time - cx.number("delay") + 1e-6;
        let mut shown = src;
        if cx.time > latest {
            for earlier in cx.history.iter() {
                shown = earlier.frame;
                if earlier.time <= latest {
                    break;
                }
            }
        }
        dst.copy_from(shown);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::DelayedFrames;
    use crate::test_sequence::{any_frame_can_be_computed_alone, shown};

    #[test]
    fn a_frame_is_seen_as_much_later_as_asked_for() {
        // The sequence has 20 frames a second. What was never seen is the first frame for as long.
        for (delay, frames) in [(0.0, 0), (0.05, 1), (0.12, 3), (0.5, 10), (1.0, 20)] {
            let expected: Vec<usize> = (0..60usize).map(|index| index.saturating_sub(frames)).collect();
            assert_eq!(shown::<DelayedFrames>(&json!({"delay": delay}), 0.0, 60), expected, "{delay} s");
        }
    }

    #[test]
    fn any_frame_needs_its_predecessors_alone() {
        any_frame_can_be_computed_alone::<DelayedFrames>();
    }
}
