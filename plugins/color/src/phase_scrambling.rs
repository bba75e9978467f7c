//! Phase scrambling: structure dissolves while the strengths of the spatial frequencies stay. The angles are drawn anew
//! for every frame, like noise.

use pdk_sdk::ops::phase::{Workspace, scramble_phase};
use pdk_sdk::prelude::*;

/// Adds random angles to the phases of the Fourier transform.
pub struct PhaseScrambling {
    workspace: Workspace,
}

impl Component for PhaseScrambling {
    fn description() -> Description {
        Description::perturbation(
            "phase_scrambling",
            "Adds random angles to the phases of each channel's Fourier transform, anew in every frame",
        )
        .family("color")
        .keeps_geometry()
        .source("Geirhos and others, Generalisation in humans and deep neural networks (2018): phase noise")
        .mathematics("Re F^-1(F(v) * exp(i * strength * pi * U(0, 1)))")
        .drawn_per_frame("the angles")
        .parameter(
            Parameter::by_level(
                "strength",
                [0.05, 0.15, 0.26, 0.38, 0.55],
                "largest angle, as a share of half a turn; the frame darkens with it, because its mean has a phase too",
            )
            .range(0.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for PhaseScrambling {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        scramble_phase(src, dst, cx.number("strength"), &mut cx.frame_random(), &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::PhaseScrambling;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<PhaseScrambling>();
    }

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<PhaseScrambling>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<PhaseScrambling>(&pdk_sdk::serde_json::Value::Null);
    }

    #[test]
    fn draws_anew_for_every_frame() {
        golden::draws_anew_for_every_frame::<PhaseScrambling>();
    }
}
