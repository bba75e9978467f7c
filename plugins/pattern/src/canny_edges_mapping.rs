//! Canny edges: contours in red over a darkened frame.
//!
//! As published, higher levels have higher thresholds and so fewer edges: what all levels share, the darkening, makes
//! most of the effect, and level 0 is the strongest.
//!
//! A low threshold above the high one is refused: edges could start where they may not go on. Whether it is above can
//! depend on the intensity, where the user sets one and the other follows it.

use pdk_sdk::config::frame_values;
use pdk_sdk::describe::LEVELS;
use pdk_sdk::ops::canny::{Workspace, blend_with_edges};
use pdk_sdk::prelude::*;

/// Darkens the frame and marks edges in red.
pub struct CannyEdgesMapping {
    workspace: Workspace,
}

impl Component for CannyEdgesMapping {
    fn description() -> Description {
        Description::perturbation(
            "canny_edges_mapping",
            "Darkens the frame and marks its edges in red; higher levels mark fewer, as published",
        )
        .family("pattern")
        .keeps_geometry()
        .grows_with(pdk_sdk::serde_json::json!({"weight": [0.1, 0.2, 0.3, 0.4, 0.5]}))
        .source("Canny, A computational approach to edge detection (1986)")
        .mathematics("(1 - weight) * v + weight * red where there is an edge, (1 - weight) * v elsewhere")
        .parameter(
            Parameter::by_level(
                "low_threshold",
                [51.0, 60.0, 75.0, 90.0, 120.0],
                "gradient (Sobel, |dx| + |dy|) above which a pixel continues an edge",
            )
            .range(0.0, 2040.0),
        )
        .parameter(
            Parameter::by_level(
                "high_threshold",
                [151.0, 160.0, 175.0, 190.0, 220.0],
                "gradient above which a pixel starts an edge",
            )
            .range(0.0, 2040.0),
        )
        .parameter(
            Parameter::by_level("weight", [0.3; 5], "share of the edges, red on black, in the result")
                .range(0.0, 1.0),
        )
    }

    fn new(config: &Config) -> Result<Self> {
        let description = Self::description();
        let place =
            |name: &str| description.parameters.iter().position(|p| p.name == name).unwrap_or_default();
        let (low, high) = (place("low_threshold"), place("high_threshold"));
        let mut values = Vec::new();
        let at_levels = (0..LEVELS).map(|level| {
            frame_values(&description, config, level as f64, &mut values);
            thresholds(values[low], values[high])
        });
        // What fits no level is wrong before the first frame.
        let checked: Vec<_> = at_levels.collect();
        if checked.iter().all(Result::is_err) {
            checked.into_iter().collect::<Result<Vec<_>>>()?;
        }
        Ok(Self { workspace: Workspace::default() })
    }
}

/// Both thresholds, if they are in order.
fn thresholds(low: f64, high: f64) -> Result<(f64, f64)> {
    if low <= high {
        return Ok((low, high));
    }
    Err(Error::new(format!(
        "parameter `low_threshold` is {low} and above `high_threshold`, which is {high} at this level; set both, the low one \
         no higher"
    )))
}

impl Perturbation for CannyEdgesMapping {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let thresholds = thresholds(cx.number("low_threshold"), cx.number("high_threshold"))?;
        blend_with_edges(src, dst, cx.number("weight"), thresholds, &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};
    use pdk_sdk::testing::Trial;

    use super::CannyEdgesMapping;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<CannyEdgesMapping>();
    }

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<CannyEdgesMapping>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<CannyEdgesMapping>(&Value::Null);
    }

    #[test]
    fn a_low_threshold_above_the_high_one_is_refused() {
        let src = pdk_sdk::testing::sample_frame(20, 10);
        let run = |given: Value, intensity: f64| {
            let trial = Trial::<CannyEdgesMapping>::new(&given, intensity, Key::default());
            let mut trial = trial.map_err(|error| format!("new: {error}"))?;
            trial.frame(&src, 0, 0.0).map(drop).map_err(|error| error.to_string())
        };
        let refused = run(json!({"low_threshold": 300, "high_threshold": 200}), 2.0).unwrap_err();
        assert!(refused.starts_with("new: parameter `low_threshold` is 300 and above"), "{refused}");
        assert!(run(json!({"low_threshold": 300}), 2.0).unwrap_err().starts_with("new: "));
        // In order at level 4, where the high one is 220, and not at level 0, where it is 151.
        assert_eq!(run(json!({"low_threshold": 200}), 4.0), Ok(()));
        assert!(run(json!({"low_threshold": 200}), 0.0).unwrap_err().contains("which is 151 at this level"));
        assert_eq!(run(json!({"low_threshold": 200, "high_threshold": 200}), 0.0), Ok(()));
    }

    #[test]
    fn full_weight_shows_the_edges_alone() {
        let mut src = FrameBuf::new(20, 10);
        src.as_mut().rows_mut().for_each(|row| row[30..].fill(255));
        let out = golden::perturb::<CannyEdgesMapping>(
            &json!({"weight": 1.0}),
            src.as_ref(),
            0.0,
            &Key::default(),
            0,
        );
        for (i, pixel) in out.data().chunks(3).enumerate() {
            // Of the two columns beside the step, which are equally steep, the left one counts.
            assert_eq!(pixel, if i % 20 == 9 { [255, 0, 0] } else { [0; 3] }, "column {}", i % 20);
        }
    }
}
