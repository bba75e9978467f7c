//! Dotted lines: scratches and cracks in the glass. Where the lines run is drawn once per sequence.
//!
//! The published code counts its lines by the number of the level, so that level 0 draws none; everything else there
//! follows the severity. The variant `published` keeps that, and `corrected` counts by the severity too: 10, 20, 30, 40
//! and 50 lines.

use pdk_sdk::ops::draw::fill_circle;
use pdk_sdk::prelude::*;

use crate::ray::Ray;

/// Draws dotted black lines.
pub struct DottedLinesMapping;

impl Component for DottedLinesMapping {
    fn description() -> Description {
        Description::perturbation(
            "dotted_lines_mapping",
            "Draws dotted black lines, at places that stay for a sequence",
        )
        .family("pattern")
        .keeps_geometry()
        .mathematics("black where |(x, y) - trunc(start + k * spacing * direction)| <= radius for any line, k = 0, 1, ...")
        .source("Leonhard, Lambertenghi and Stocco, PerturbationDrive: dots along random lines")
        .divergence("Drawn once per sequence; the published tool draws anew on every call, as `draws=per_frame` does.")
        .divergence("Only with `variant=corrected`: it counts its lines by the severity; the published tool counts by the number of the level, so that level 0 draws none.")
        .drawn_per_sequence("start and direction of each line")
        .parameter(
            Parameter::by_level(
                "severity",
                [0.1, 0.2, 0.3, 0.4, 0.5],
                "s: dots lie 50 * (1 - s) pixels apart, at least 10, and have a radius of 5 * s pixels without its fraction; the variant says how many lines there are",
            )
            .range(0.0, 1.0),
        )
        .parameter(Parameter::choice(
            "variant",
            &["published", "corrected"],
            "published: 100 * s - 10 lines, none at level 0; corrected: 100 * s lines",
        ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for DottedLinesMapping {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        dst.copy_from(src);
        let severity = cx.number("severity");
        let missing = if cx.integer("variant") == 0 { 10.0 } else { 0.0 };
        let lines = (100.0 * severity - missing).round().max(0.0) as u32;
        let spacing = (50.0 * (1.0 - severity)).max(10.0);
        // The small term keeps whole numbers whole.
        let radius = (5.0 * severity + 1e-9).floor();
        let (width, height) = (src.width(), src.height());
        let mut random = cx.sequence_random();
        for _ in 0..lines {
            let mut ray = Ray::draw(&mut random, width, height);
            while let Some((x, y)) = ray.pixel(width, height) {
                fill_circle(dst.reborrow(), x as f64, y as f64, radius, [0; 3]);
                ray.x += ray.dx * spacing;
                ray.y += ray.dy * spacing;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::DottedLinesMapping;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<DottedLinesMapping>();
    }

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<DottedLinesMapping>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<DottedLinesMapping>(&Value::Null);
        golden::writes_exactly_the_frame::<DottedLinesMapping>(&json!({"variant": "corrected"}));
    }

    fn black(given: &Value, intensity: f64) -> usize {
        let src = FrameBuf::from_vec(vec![200; 320 * 240 * 3], 320, 240).unwrap();
        let out = golden::perturb::<DottedLinesMapping>(given, src.as_ref(), intensity, &Key([5; 32]), 0);
        out.data().chunks(3).filter(|p| p == &[0, 0, 0]).count()
    }

    #[test]
    fn level_0_draws_nothing_as_published_and_ten_lines_when_corrected() {
        assert_eq!(black(&Value::Null, 0.0), 0);
        // Radius 0: one pixel a dot, a few dots a line.
        let corrected = black(&json!({"variant": "corrected"}), 0.0);
        assert!((15..=100).contains(&corrected), "{corrected}");
    }

    #[test]
    fn dots_are_plus_signs_then_diamonds() {
        // Dots grow from 1 to 5 and from 5 to 13 pixels where the radius reaches a whole number.
        let dots = |severity: f64| black(&json!({"severity": severity}), 0.0);
        assert!(dots(0.2) > 3 * dots(0.199), "{} {}", dots(0.2), dots(0.199));
        assert!(dots(0.4) > 2 * dots(0.399), "{} {}", dots(0.4), dots(0.399));
    }
}
