//! Ghosting: earlier frames shine through, as with slow pixels, or with noise reduction over time.

use pdk_sdk::ops::blend::weighted_sum;
use pdk_sdk::prelude::*;

/// Frames that it asks for.
const FRAMES: usize = 12;

/// Blends a frame with those before it.
pub struct Ghosting;

impl Component for Ghosting {
    fn description() -> Description {
        Description::perturbation(
            "ghosting",
            "Lets earlier frames shine through, each less than the one after it, so that what moves leaves a trail",
        )
        .version(2)
        .family("stream")
        .dynamic()
        .not_default()
        .alters_geometry()
        .history(FRAMES as u32)
        .mathematics("sum of p^k frame(t - k) / sum of p^k, k from 0 to 12, or as far as there are frames")
        .source("A recursive filter over time, as in the noise reduction of image signal processors, cut after twelve frames")
        .parameter(
            Parameter::by_level("persistence", [0.2, 0.4, 0.55, 0.7, 0.85], "share of what was there before in what is shown")
                .range(0.0, 0.99),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for Ghosting {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let persistence = cx.number("persistence") as f32;
        let frames = cx.history.len();
        let mut weights = [0.0f32; FRAMES + 1];
        let mut weight = 1.0;
        for each in &mut weights[..=frames] {
            *each = weight;
            weight *= persistence;
        }
        let all: f32 = weights.iter().sum();
        let mut seen = [(src, 0.0); FRAMES + 1];
        for (back, (seen, weight)) in seen.iter_mut().zip(weights).enumerate() {
            *seen = (cx.history.back(back).map_or(src, |earlier| earlier.frame), weight / all);
        }
        weighted_sum(&seen[..=frames], dst);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::{FRAMES, Ghosting};
    use crate::test_sequence::{any_frame_can_be_computed_alone, leaves_a_sequence_alone, mark, pixels};

    #[test]
    fn each_frame_weighs_less_than_the_one_after_it() {
        for persistence in [0.5, 0.85, 0.99f64] {
            let frames = pixels::<Ghosting>(&json!({"persistence": persistence}), 0.0, 40);
            for (index, frame) in frames.iter().enumerate() {
                let weights = (0..=index.min(FRAMES)).map(|back| libm::pow(persistence, back as f64));
                let sum: f64 = weights.clone().sum();
                let products =
                    weights.enumerate().map(|(back, weight)| weight * f64::from(mark(index - back)));
                let expected = (products.sum::<f64>() / sum).round() as u8;
                assert!(frame.data().iter().all(|value| value.abs_diff(expected) <= 1), "frame {index}");
            }
        }
    }

    #[test]
    fn an_even_sequence_stays_as_it_is() {
        leaves_a_sequence_alone::<Ghosting>(&json!({"persistence": 0.0}));
    }

    #[test]
    fn any_frame_needs_its_predecessors_alone() {
        any_frame_can_be_computed_alone::<Ghosting>();
    }
}
