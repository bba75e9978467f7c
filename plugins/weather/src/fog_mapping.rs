//! Fog mapping: uneven fog.
//!
//! Where the fog is thick is drawn once per sequence: fog banks stand still for longer than a sequence takes.

use pdk_sdk::ops::blend::blend;
use pdk_sdk::ops::fog::Field;
use pdk_sdk::prelude::*;

/// Blends the frame with a grey fractal field.
pub struct FogMapping {
    field: Field,
}

impl Component for FogMapping {
    fn description() -> Description {
        Description::perturbation(
            "fog_mapping",
            "Blends the frame with a grey fractal field, the same one in all frames of a sequence",
        )
        .family("weather")
        .keeps_geometry().mathematics("(1 - s) v + s fog, fog by midpoint displacement with a roughness that never decays").drawn_per_sequence("the field of fog")
        .divergence("Drawn once per sequence; the published tool draws anew on every call, as `draws=per_frame` does.")
        .not_default()
        .source("Fournier, Fussell and Carpenter, Computer rendering of stochastic models (1982); randomness does not decay with scale")
        .parameter(
            Parameter::by_level("strength", [0.05, 0.12, 0.22, 0.35, 0.6], "share of the field in the result")
                .range(0.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { field: Field::default() })
    }
}

impl Perturbation for FogMapping {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let field = self.field.frame(src.width(), src.height(), *cx.key());
        blend(src, 1.0 - cx.number("strength"), field, dst);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::FogMapping;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<FogMapping>();
    }

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<FogMapping>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<FogMapping>(&Value::Null);
    }

    #[test]
    fn the_field_stays_for_a_sequence_and_differs_between_sequences() {
        let src = pdk_sdk::testing::sample_frame(64, 48);
        let frame =
            |key, index| golden::perturb::<FogMapping>(&json!({}), src.as_ref(), 2.0, &Key([key; 32]), index);
        assert_eq!(frame(1, 0), frame(1, 9));
        assert_ne!(frame(1, 0), frame(2, 0));
    }
}
