//! Splatter: mud or dead insects on the lens. Where the discs sit is drawn once per sequence, because dirt stays.

use pdk_sdk::ops::draw::fill_circle;
use pdk_sdk::prelude::*;

/// The smallest radius, in pixels.
const SMALLEST: f64 = 5.0;

/// Lays black discs over the frame.
pub struct SplatterMapping;

impl Component for SplatterMapping {
    fn description() -> Description {
        Description::perturbation(
            "splatter_mapping",
            "Lays black discs over the frame, at places that stay for a sequence",
        )
        .family("pattern")
        .keeps_geometry()
        .mathematics(
            "black where (x - cx)^2 + (y - cy)^2 <= r^2 for any disc, r uniform in 5..=largest_radius",
        )
        .source("Leonhard, Lambertenghi and Stocco, PerturbationDrive: discs at random places")
        .divergence("Drawn once per sequence; the published tool draws anew on every call, as `draws=per_frame` does.")
        .drawn_per_sequence("middle and radius of each disc")
        .parameter(
            Parameter::by_level(
                "discs",
                [5.0, 10.0, 15.0, 20.0, 25.0],
                "number of discs, rounded to the nearest whole number",
            )
            .range(0.0, 10_000.0),
        )
        .parameter(
            Parameter::by_level(
                "largest_radius",
                [5.0, 9.0, 14.0, 19.0, 24.0],
                "largest radius; each disc has a whole number from 5 to this one",
            )
            .range(SMALLEST, 10_000.0)
            .unit("px"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for SplatterMapping {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        dst.copy_from(src);
        let mut random = cx.sequence_random();
        let radii = cx.number("largest_radius") - SMALLEST + 1.0;
        for _ in 0..cx.integer("discs") {
            // Three draws for a disc, whatever the intensity: as it grows, discs grow and join the ones that are there.
            let x = f64::from(random.below(src.width() as u32));
            let y = f64::from(random.below(src.height() as u32));
            let radius = SMALLEST + (random.unit() * radii).floor();
            fill_circle(dst.reborrow(), x, y, radius, [0; 3]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::SplatterMapping;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<SplatterMapping>();
    }

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<SplatterMapping>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<SplatterMapping>(&Value::Null);
    }

    #[test]
    fn discs_stay_for_a_sequence_and_only_grow_with_intensity() {
        let src = FrameBuf::from_vec(vec![200; 160 * 120 * 3], 160, 120).unwrap();
        let at = |intensity, frame| {
            golden::perturb::<SplatterMapping>(&Value::Null, src.as_ref(), intensity, &Key([5; 32]), frame)
        };
        assert_eq!(at(2.0, 0), at(2.0, 1));
        for step in 1..=40 {
            let (weaker, stronger) = (at(f64::from(step - 1) / 10.0, 0), at(f64::from(step) / 10.0, 0));
            assert!(weaker.data().iter().zip(stronger.data()).all(|(w, s)| s <= w), "step {step}");
        }
    }

    #[test]
    fn a_disc_holds_what_lies_within_its_radius() {
        let src = FrameBuf::from_vec(vec![200; 400 * 400 * 3], 400, 400).unwrap();
        let given = json!({"discs": 1, "largest_radius": 5});
        let areas = (0..20).map(|seed| {
            let out = golden::perturb::<SplatterMapping>(&given, src.as_ref(), 0.0, &Key([seed; 32]), 0);
            out.data().chunks(3).filter(|p| p == &[0, 0, 0]).count()
        });
        // 81 places have whole-numbered distances within 5; the frame's edge may cut some off.
        let areas: Vec<usize> = areas.collect();
        assert!(
            areas.iter().all(|&a| a <= 81) && areas.iter().filter(|&&a| a == 81).count() > 15,
            "{areas:?}"
        );
    }
}
