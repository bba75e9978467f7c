//! False colours: what a camera shows whose channels are mixed up, or set to an infrared mode.
//!
//! Each level is an effect of its own, so strength does not grow with the level: inversion, level 3, is the strongest
//! and level 1 the weakest. Between two levels their effects are blended.

use pdk_sdk::ops::false_color::{Sums, false_color};
use pdk_sdk::prelude::*;

/// Exchanges, inverts or adds channels.
pub struct FalseColorFilter;

impl Component for FalseColorFilter {
    fn description() -> Description {
        Description::perturbation(
            "false_color_filter",
            "Exchanges, inverts or adds channels; the levels are different effects, of which level 3 is the strongest",
        )
        .family("color")
        .keeps_geometry()
        .grows_with(pdk_sdk::serde_json::json!({"effect": [1, 1.5, 2, 2.5, 3]}))
        .mathematics("(G,B,R), (G,R,B), (B,G,R), (255-R,255-G,255-B), ((R+G)/2,(G+B)/2,(B+R)/2)")
        .source("Leonhard, Lambertenghi and Stocco, PerturbationDrive: channels exchanged, inverted and added")
        .divergence("Only with `variant=corrected`: effect 4 is the mean of two channels; the published 8-bit sum wraps before it is halved.")
        .parameter(
            Parameter::by_level(
                "effect",
                [0.0, 1.0, 2.0, 3.0, 4.0],
                "0: green, blue, red; 1: green, red, blue; 2: blue, green, red; 3: inverted; 4: half the sums of neighbouring channels; in between, a blend of two",
            )
            .range(0.0, 4.0),
        )
        .parameter(Parameter::choice(
            "variant",
            &["published", "corrected"],
            "published: the sums of effect 4 wrap at 256, so what is bright comes out dark; corrected: they do not",
        ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for FalseColorFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let sums = if cx.integer("variant") == 0 { Sums::Wrapped } else { Sums::Means };
        false_color(src, dst, cx.number("effect"), sums);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::FalseColorFilter;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<FalseColorFilter>();
    }

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<FalseColorFilter>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<FalseColorFilter>(&Value::Null);
        golden::writes_exactly_the_frame::<FalseColorFilter>(&json!({"variant": "corrected"}));
    }

    #[test]
    fn sums_wrap_as_published_and_are_means_when_corrected() {
        let src = FrameBuf::from_vec(vec![200, 100, 40], 1, 1).unwrap();
        let at = |given: &Value, intensity| {
            golden::perturb::<FalseColorFilter>(given, src.as_ref(), intensity, &Key::default(), 0).into_vec()
        };
        assert_eq!(at(&Value::Null, 4.0), [22, 70, 120]);
        assert_eq!(at(&json!({"variant": "corrected"}), 4.0), [150, 70, 120]);
        // Half way between (100, 40, 200) and (100, 200, 40).
        assert_eq!(at(&Value::Null, 0.5), [100, 120, 120]);
    }
}
