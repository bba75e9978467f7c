//! Frost: ice crystals on the windscreen.
//!
//! The texture is drawn ([`draw`]). It is the same one for every key, made once for each frame size.
//!
//! The published code adds its texture without weighting it by the texture's own alpha. Its picture is opaque, so the
//! whole frame is blended with it, clear glass included. The variant `published` does that, and `corrected` leaves
//! clear glass clear.

use pdk_sdk::ops::ice::draw;
use pdk_sdk::prelude::*;

use crate::texture::{Texture, describe};

/// Lays frost over the frame.
pub struct FrostFilter {
    texture: Texture,
}

impl Component for FrostFilter {
    fn description() -> Description {
        let description = Description::perturbation(
            "frost_filter",
            "Lays a texture of ice crystals over the frame, the same one always, and lowers saturation",
        )
        .keeps_geometry()
        .source("Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations (2019), with a drawn texture");
        describe(description, [0.15, 0.19, 0.25, 0.32, 0.4])
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { texture: Texture::new(draw) })
    }
}

impl Perturbation for FrostFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.texture.apply(src, dst, cx);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{FrostFilter, draw};
    use crate::texture::tests::{lays_a_texture_over, means};

    #[test]
    fn lays_frost_over_the_frame() {
        lays_a_texture_over::<FrostFilter>(draw);
    }

    #[test]
    fn frost_is_brighter_and_thicker_at_the_edges() {
        for (width, height) in [(320, 240), (640, 160), (90, 200)] {
            let middle = |x: usize, y: usize| {
                (width / 3..2 * width / 3).contains(&x) && (height / 3..2 * height / 3).contains(&y)
            };
            let rim = |x: usize, y: usize| {
                x < width / 8 || y < height / 8 || x >= width - width / 8 || y >= height - height / 8
            };
            let (inner, outer) = (means(draw, width, height, middle), means(draw, width, height, rim));
            assert!(outer.0 > inner.0 + 0.06 && outer.1 > inner.1 + 0.1, "{inner:?} {outer:?}");
        }
    }

    #[test]
    fn frost_is_as_bright_as_the_photograph_that_was_published() {
        // The published picture has a mean of 0.76.
        let (shade, _) = means(draw, 320, 240, |_, _| true);
        assert!((0.7..0.82).contains(&shade), "{shade}");
    }
}
