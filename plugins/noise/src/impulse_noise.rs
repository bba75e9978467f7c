//! Impulse noise: dead and stuck pixels.
//!
//! The published code draws rows, columns and channels from ranges that leave out the last of each. Blue is never hit,
//! so its noise is coloured: cyan, magenta and yellow specks where black and white ones were meant. The variant
//! `published` keeps that, and `corrected` hits whole pixels, all of them reachable, as the name salt-and-pepper says.

use pdk_sdk::ops::noise::{Impulses, impulse_noise};
use pdk_sdk::prelude::*;

/// Sets random values to the extremes.
pub struct ImpulseNoise;

impl Component for ImpulseNoise {
    fn description() -> Description {
        Description::perturbation("impulse_noise", "Sets random values to 255 and as many to 0, anew in every frame")
            .family("noise")
            .keeps_geometry().mathematics("v = 255 or v = 0 at ceil(3/2 fraction W H) random places each").drawn_per_frame("the places").divergence("Only with `variant=corrected`: it sets whole pixels, all of them reachable; the published draw never reaches the last row, the last column or the blue channel.")
            .source("Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations (2019)")
            .parameter(
                Parameter::by_level("fraction", [0.01, 0.02, 0.04, 0.065, 0.1], "share of the frame that is drawn, half of it for 255 and half for 0")
                    .range(0.0, 1.0),
            )
            .parameter(Parameter::choice(
                "variant",
                &["published", "corrected"],
                "published: single red and green values, never blue, the last row or the last column; corrected: whole pixels anywhere",
            ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for ImpulseNoise {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let impulses = if cx.integer("variant") == 0 { Impulses::Published } else { Impulses::WholePixels };
        impulse_noise(src, dst, cx.number("fraction"), impulses, &mut cx.frame_random());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::ImpulseNoise;
    use crate::golden;

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<ImpulseNoise>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<ImpulseNoise>(&Value::Null);
        golden::writes_exactly_the_frame::<ImpulseNoise>(&json!({"variant": "corrected"}));
    }

    #[test]
    fn draws_anew_for_every_frame() {
        golden::draws_anew_for_every_frame::<ImpulseNoise>();
    }

    #[test]
    fn the_published_variant_spares_blue_and_the_last_row_and_column() {
        let src = FrameBuf::from_vec(vec![120; 20 * 10 * 3], 20, 10).unwrap();
        let out =
            golden::perturb::<ImpulseNoise>(&json!({"fraction": 1.0}), src.as_ref(), 0.0, &Key([1; 32]), 0);
        let mut hit = [0; 3];
        for y in 0..10 {
            for x in 0..20 {
                let pixel = out.as_ref().pixel(x, y);
                (0..3).for_each(|c| hit[c] += usize::from(pixel[c] != 120));
                assert!(x < 19 && y < 9 || pixel == [120; 3]);
            }
        }
        assert!(hit[0] > 100 && hit[1] > 100 && hit[2] == 0, "{hit:?}");
    }

    #[test]
    fn the_corrected_variant_reaches_every_pixel_and_is_grey() {
        let src = FrameBuf::from_vec(vec![120; 8 * 4 * 3], 8, 4).unwrap();
        let mut reached = [false; 32];
        let mut whites = 0;
        for frame in 0..100 {
            let given = json!({"variant": "corrected", "fraction": 0.25});
            let out = golden::perturb::<ImpulseNoise>(&given, src.as_ref(), 0.0, &Key([1; 32]), frame);
            for (i, pixel) in out.data().chunks(3).enumerate() {
                assert!([0, 120, 255].contains(&pixel[0]) && pixel[1] == pixel[0] && pixel[2] == pixel[0]);
                reached[i] |= pixel[0] != 120;
                whites += usize::from(pixel[0] == 255);
            }
        }
        assert!(reached.iter().all(|&r| r));
        // Four draws of white a frame; some meet each other or are overwritten by black.
        assert!((280..=400).contains(&whites), "{whites}");
    }
}
