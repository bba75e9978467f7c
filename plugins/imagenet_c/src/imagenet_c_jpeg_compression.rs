//! JPEG.

use pdk_sdk::ops::jpeg::{self, ChannelOrder, jpeg};
use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// Compresses and decompresses.
#[derive(Default)]
pub struct JpegCompression {
    workspace: jpeg::Workspace,
}

impl Component for JpegCompression {
    fn description() -> Description {
        corruption("jpeg_compression", "Compresses the frame as JPEG and decompresses it again")
            .mathematics("decode(encode(v, quality)), colour at half the resolution")
            .parameter(
                Parameter::by_level("quality", [25.0, 18.0, 15.0, 10.0, 7.0], "quality, 1 for the coarsest")
                    .range(1.0, 100.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for JpegCompression {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        jpeg(src, dst, cx.number("quality").round(), ChannelOrder::Rgb, &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::stays_grey;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<JpegCompression>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        stays_grey::<JpegCompression>(&[0.0, 4.0], 100..=100);
    }
}
