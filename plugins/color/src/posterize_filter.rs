//! Posterization: few tones, as a sensor or a compression with too few bits gives.
//!
//! In the published version neighbouring tones lie 255 / (tones - 1) apart without the fraction. Between the published
//! numbers of tones that loses up to a third of the brightness (96 tones reach 190), so here the distance is
//! interpolated, over the width of a bin, between the published ones. Strength grows with the level over the published
//! ones; in between it wavers with where the boundaries of few bins fall in an image's histogram.

use pdk_sdk::ops::posterize::posterize;
use pdk_sdk::prelude::*;

/// Published widths of a bin, `255 / tones`, and the distances of neighbouring tones that belong to them.
const PUBLISHED: [(f64, f64); 5] = [
    (255.0 / 128.0, 2.0),
    (255.0 / 64.0, 4.0),
    (255.0 / 32.0, 8.0),
    (255.0 / 8.0, 36.0),
    (255.0 / 4.0, 85.0),
];

/// Reduces the number of tones of each channel.
pub struct PosterizeFilter;

impl Component for PosterizeFilter {
    fn description() -> Description {
        Description::perturbation("posterize_filter", "Reduces the number of tones of each channel")
            .family("color")
            .keeps_geometry()
            .mathematics("min(255, step * floor(v * tones / 255)), step = floor(255 / (tones - 1))")
            .divergence("Between the published numbers of tones the step is interpolated, because the published formula darkens there by up to a third.")
            .source("Leonhard, Lambertenghi and Stocco, PerturbationDrive: uniform quantisation of each channel")
            .parameter(
                Parameter::by_level(
                    "tones",
                    [128.0, 64.0, 32.0, 8.0, 4.0],
                    "number of tones; need not be whole, it divides the range of values",
                )
                .range(2.0, 256.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

/// The distance of neighbouring tones: as published at the published numbers of tones, linear over the bins' width in
/// between, and spanning the whole range beyond them.
fn step(tones: f64) -> f64 {
    let width = 255.0 / tones;
    let [(finest, _), .., (coarsest, _)] = PUBLISHED;
    if width < finest || width > coarsest {
        return 255.0 / (tones - 1.0);
    }
    let upper = PUBLISHED.iter().position(|&(at, _)| width <= at).unwrap_or(PUBLISHED.len() - 1).max(1);
    let ((low, below), (high, above)) = (PUBLISHED[upper - 1], PUBLISHED[upper]);
    let fraction = (width - low) / (high - low);
    below * (1.0 - fraction) + above * fraction
}

impl Perturbation for PosterizeFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let tones = cx.number("tones");
        posterize(src, dst, tones, step(tones));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::{PosterizeFilter, step};
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<PosterizeFilter>();
    }

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<PosterizeFilter>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<PosterizeFilter>(&Value::Null);
    }

    #[test]
    fn steps_are_published_at_the_levels_and_never_darken_in_between() {
        for (tones, expected) in
            [(128.0, 2.0), (64.0, 4.0), (32.0, 8.0), (8.0, 36.0), (4.0, 85.0), (2.0, 255.0)]
        {
            assert_eq!(step(tones), expected, "{tones}");
        }
        for tenths in 20..=2560 {
            let tones = f64::from(tenths) / 10.0;
            // The brightness of a mid-grey to that of its tone.
            let gain = step(tones) * tones / 255.0;
            assert!((1.0..=2.0).contains(&gain) && (tones > 4.0 || gain >= 4.0 / 3.0), "{tones}: {gain}");
        }
    }

    #[test]
    fn two_tones_are_black_and_white() {
        let src = FrameBuf::from_vec((0..=254).collect(), 85, 1).unwrap();
        let out =
            golden::perturb::<PosterizeFilter>(&json!({"tones": 2}), src.as_ref(), 0.0, &Key::default(), 0);
        assert!(out.data().iter().zip(src.data()).all(|(to, from)| *to == if *from < 128 { 0 } else { 255 }));
    }
}
