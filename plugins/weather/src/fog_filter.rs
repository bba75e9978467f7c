//! Fog filter: even fog with the grain of a camera that sees too little.
//!
//! The published code stores the noise in bytes without clipping it, so that what is a little below 0 becomes bright.
//! The variant `published` keeps that, and `corrected` clips.

use pdk_sdk::ops::blend::blend;
use pdk_sdk::ops::fog::{Grain, Overflow};
use pdk_sdk::prelude::*;

/// Blends the frame with a white layer that has grain.
pub struct FogFilter {
    grain: Grain,
}

impl Component for FogFilter {
    fn description() -> Description {
        Description::perturbation(
            "fog_filter",
            "Blends the frame with white and some noise, drawn anew for every frame; it brightens more than it hides",
        )
        .family("weather")
        .keeps_geometry()
        .mathematics("(1 - s) v + s ((1 - n) 255 + n noise), noise ~ N(0, 255 n)")
        .drawn_per_frame("the noise")
        .divergence(
            "Its effect on a driver is that of brightness more than of poor visibility: the published noise wraps round to bright \
             values, which lifts the mean of the frame. At level 4 the drivers `dave2`, `dave2_temporal` and `dave2_tub` failed on \
             eight of eight roads in easy conditions of `lane`, and with `variant=corrected` on eight, two and none; in standard \
             conditions they failed on all of them with both. `dave2_augmented`, which learned with changed brightness, failed on \
             one of 16 with either. For poor visibility take `fog_mapping`.",
        )
        .divergence("Only with `variant=corrected`: negative noise is clipped to 0; the published one wraps round to bright values.")
        .source("Weighted sum of the frame, white and normal noise")
        .parameter(
            Parameter::by_level("strength", [0.1, 0.2, 0.3, 0.45, 0.65], "share of the fog in the result")
                .range(0.0, 1.0),
        )
        .parameter(
            Parameter::by_level(
                "noise",
                [0.05, 0.1, 0.2, 0.3, 0.45],
                "share of the noise in the fog, and its standard deviation as a share of 255",
            )
            .range(0.0, 1.0),
        )
        .parameter(Parameter::choice(
            "variant",
            &["published", "corrected"],
            "published: noise below 0 wraps round to bright values; corrected: it is clipped to 0",
        ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { grain: Grain::default() })
    }
}

impl Perturbation for FogFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let overflow = if cx.integer("variant") == 0 { Overflow::Wraps } else { Overflow::Clips };
        let random = &mut cx.frame_random();
        let fog = self.grain.frame(src.width(), src.height(), cx.number("noise"), overflow, random);
        blend(src, 1.0 - cx.number("strength"), fog, dst);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::FogFilter;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<FogFilter>();
    }

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<FogFilter>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<FogFilter>(&json!({}));
        golden::writes_exactly_the_frame::<FogFilter>(&json!({"variant": "corrected"}));
    }

    #[test]
    fn draws_anew_for_every_frame() {
        golden::draws_anew_for_every_frame::<FogFilter>();
    }
}
