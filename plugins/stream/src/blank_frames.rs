//! Blank frames: frames that are lost arrive as an even picture.

use pdk_sdk::bursts;
use pdk_sdk::prelude::*;

/// Shows an even picture in place of frames that are lost.
pub struct BlankFrames;

impl Component for BlankFrames {
    fn description() -> Description {
        let description = Description::perturbation(
            "blank_frames",
            "Shows a black picture in place of frames that are lost",
        )
        .version(2)
        .family("stream")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .mathematics("frame(t) = brightness if t is lost")
        .drawn_per_frame("whether a burst of lost frames begins, and its length")
        .source("Burst losses as in Gilbert, Capacity of a burst-noise channel (1960)");
        bursts::described(description, "frames", [0.05, 0.1, 0.2, 0.3, 0.5], [1.0, 1.5, 2.0, 3.0, 5.0])
            .parameter(
                Parameter::integer(
                    "brightness",
                    0,
                    "grey of the picture that is shown: 0 is black, 255 white",
                )
                .range(0.0, 255.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for BlankFrames {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        if bursts::of(cx).lose(cx.frame_index, cx) {
            let brightness = cx.integer("brightness").clamp(0, 255) as u8;
            dst.rows_mut().for_each(|row| row.fill(brightness));
        } else {
            dst.copy_from(src);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::BlankFrames;
    use crate::test_sequence::{any_frame_can_be_computed_alone, pixels};

    #[test]
    fn a_lost_frame_is_even_and_the_others_are_as_they_were() {
        let frames = pixels::<BlankFrames>(&json!({"lost": 0.3, "burst": 2, "brightness": 7}), 0.0, 300);
        let blank = frames.iter().filter(|frame| frame.data().iter().all(|value| *value == 7)).count();
        assert!((60..120).contains(&blank), "{blank}");
    }

    #[test]
    fn any_frame_needs_itself_alone() {
        any_frame_can_be_computed_alone::<BlankFrames>();
    }
}
