//! JPEG compression: a camera that sends compressed frames over a narrow link.
//!
//! The published code hands RGB frames to an encoder that expects BGR, and reads the result the same way. Colours come
//! out right, but red and blue have exchanged their weights in the luma, so that red loses detail where blue should.
//! The variant `published` keeps that, and `corrected` compresses RGB as RGB.

use pdk_sdk::ops::jpeg::{ChannelOrder, Workspace, jpeg};
use pdk_sdk::prelude::*;

/// Compresses and decompresses every frame.
pub struct JpegFilter {
    workspace: Workspace,
}

impl Component for JpegFilter {
    fn description() -> Description {
        Description::perturbation("jpeg_filter", "Compresses every frame as JPEG and decompresses it again")
            .family("noise")
            .keeps_geometry().mathematics("decode(encode(image, quality))").divergence("Only with `variant=corrected`: red and blue have the standard's weights in the luma; the published tool takes RGB for BGR, which exchanges them.")
            .source("ITU-T T.81 (1992), baseline with the tables of Annex K, chroma at half the resolution")
            .parameter(
                Parameter::by_level("quality", [30.0, 18.0, 15.0, 10.0, 5.0], "quality, 1 for the coarsest")
                    .range(1.0, 100.0),
            )
            .parameter(Parameter::choice(
                "variant",
                &["published", "corrected"],
                "published: red and blue exchange their weights in the luma; corrected: they have the standard's",
            ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for JpegFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let order = if cx.integer("variant") == 0 { ChannelOrder::Bgr } else { ChannelOrder::Rgb };
        jpeg(src, dst, cx.number("quality"), order, &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::JpegFilter;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<JpegFilter>();
    }

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<JpegFilter>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<JpegFilter>(&Value::Null);
        golden::writes_exactly_the_frame::<JpegFilter>(&json!({"variant": "corrected"}));
    }

    #[test]
    fn the_corrected_variant_keeps_red_and_blue_in_their_places() {
        let src = FrameBuf::from_vec([200, 40, 20].repeat(32 * 16), 32, 16).unwrap();
        for variant in ["published", "corrected"] {
            let given = json!({"variant": variant, "quality": 90.0});
            let out = golden::perturb::<JpegFilter>(&given, src.as_ref(), 0.0, &Key::default(), 0);
            for pixel in out.data().chunks(3) {
                assert!(
                    pixel.iter().zip([200u8, 40, 20]).all(|(a, b)| a.abs_diff(b) <= 4),
                    "{variant} {pixel:?}"
                );
            }
        }
    }
}
