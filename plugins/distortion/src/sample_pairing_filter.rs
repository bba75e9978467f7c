//! Sample pairing: a reflection of a part of the scene, enlarged, over the whole.

use pdk_sdk::ops::blend::blend;
use pdk_sdk::ops::frame::CHANNELS;
use pdk_sdk::ops::resize::resize_linear;
use pdk_sdk::prelude::*;

/// Blends the frame with an enlarged part of itself.
pub struct SamplePairingFilter {
    enlarged: FrameBuf,
}

impl Component for SamplePairingFilter {
    fn description() -> Description {
        Description::perturbation(
            "sample_pairing_filter",
            "Blends the frame with an enlarged window of half its size; the window's place is drawn once per sequence",
        )
        .family("distortion")
        .alters_geometry().mathematics("alpha v + (1 - alpha) window, a half-size part of the frame enlarged").drawn_per_sequence("the place of the window")
        .divergence("Drawn once per sequence; the published tool draws anew on every call, as `draws=per_frame` does.")
        .source("Inoue, Data augmentation by pairing samples for images classification (2018), with a part of the same frame")
        .parameter(
            Parameter::by_level("weight", [0.9, 0.7, 0.5, 0.3, 0.1], "share of the original in the result")
                .range(0.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { enlarged: FrameBuf::new(1, 1) })
    }
}

impl Perturbation for SamplePairingFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = ((src.width() / 2).max(1), (src.height() / 2).max(1));
        let mut random = cx.sequence_random();
        let x = random.below(src.width() as u32 / 2) as usize;
        let y = random.below(src.height() as u32 / 2) as usize;
        let from = y * src.stride() + x * CHANNELS;
        let window =
            Frame::with_stride(&src.data()[from..], width, height, src.stride()).map_err(Error::new)?;
        self.enlarged.resize(src.width(), src.height());
        resize_linear(window, self.enlarged.as_mut());
        blend(src, cx.number("weight"), self.enlarged.as_ref(), dst);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::SamplePairingFilter;
    use crate::golden;

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<SamplePairingFilter>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<SamplePairingFilter>(&Value::Null);
    }

    #[test]
    fn holds_what_every_perturbation_has_to_hold() {
        pdk_sdk::testing::perturbation::<SamplePairingFilter>();
    }

    #[test]
    fn strength_grows_with_the_intensity() {
        golden::strength_grows::<SamplePairingFilter>(&Value::Null, &golden::quarters(0.0, 4.0), true);
    }

    #[test]
    fn the_window_stays_in_place_for_a_sequence_and_moves_between_sequences() {
        let bytes = (0..64 * 48 * 3).map(|i| (i * i % 251) as u8).collect();
        let src = FrameBuf::from_vec(bytes, 64, 48).unwrap();
        let window_only = json!({"weight": 0.0});
        let frame = |key, index| {
            golden::perturb::<SamplePairingFilter>(&window_only, src.as_ref(), 0.0, &Key([key; 32]), index)
        };
        assert_eq!(frame(1, 0), frame(1, 9));
        assert!((2..6).any(|key| frame(key, 0) != frame(1, 0)));
    }
}
