//! Frozen frames: the stream stalls, and the driver is shown the last frame that arrived.

use pdk_sdk::bursts;
use pdk_sdk::prelude::*;

/// Repeats the last frame that arrived in place of those that are lost.
pub struct FrozenFrames;

impl Component for FrozenFrames {
    fn description() -> Description {
        let description = Description::perturbation(
            "frozen_frames",
            "Repeats the last frame that arrived while frames are lost, so that the picture freezes",
        )
        .version(2)
        .family("stream")
        .dynamic()
        .not_default()
        .alters_geometry()
        .history(bursts::LONGEST as u32)
        .mathematics("frame(t) = frame(last t' <= t that is not lost)")
        .drawn_per_frame("whether a burst of lost frames begins, and its length")
        .source("Burst losses as in Gilbert, Capacity of a burst-noise channel (1960); frozen frames are among the camera failures of Secci and Ceccarelli, On failures of RGB cameras and their effects in autonomous driving applications (2020)");
        bursts::described(description, "frames", [0.1, 0.2, 0.35, 0.5, 0.7], [2.0, 4.0, 6.0, 10.0, 16.0])
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for FrozenFrames {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let bursts = bursts::of(cx);
        let mut shown = src;
        if bursts.lose(cx.frame_index, cx) {
            for earlier in cx.history.iter() {
                // Before the first frame that arrived there is nothing to repeat, so that one is shown.
                shown = earlier.frame;
                if !bursts.lose(earlier.frame_index, cx) {
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

    use super::FrozenFrames;
    use crate::test_sequence::{any_frame_can_be_computed_alone, shown};

    #[test]
    fn the_picture_is_always_that_of_the_last_frame_that_arrived() {
        for (lost, burst, expected) in [(0.5, 5, 120..280), (0.7, 16, 200..360), (1.0, 16, 380..395)] {
            let shown = shown::<FrozenFrames>(&json!({"lost": lost, "burst": burst}), 0.0, 400);
            let mut latest = shown[0];
            for (index, number) in shown.iter().enumerate() {
                assert!(*number == index || *number == latest, "frame {index} shows {number} after {latest}");
                latest = *number;
            }
            let frozen = shown.iter().enumerate().filter(|(index, number)| *index != **number).count();
            assert!(expected.contains(&frozen), "{lost} in rows of {burst}: {frozen}");
        }
    }

    #[test]
    fn any_frame_needs_its_predecessors_alone() {
        any_frame_can_be_computed_alone::<FrozenFrames>();
    }
}
