//! Ghosting: earlier frames shine through, as with slow pixels, or with noise reduction over time.

use pdk_sdk::prelude::*;

/// Frames that it asks for.
const FRAMES: usize = 12;

/// Blends a frame with those before it.
#[derive(Default)]
pub struct Ghosting {
    /// A row of sums: a workspace.
    sums: Vec<f32>,
}

impl Component for Ghosting {
    fn description() -> Description {
        Description::perturbation(
            "ghosting",
            "Lets earlier frames shine through, each less than the one after it, so that what moves leaves a trail",
        )
        .family("stream")
        .dynamic()
        .not_default()
        .alters_geometry()
        .history(FRAMES as u32)
        .mathematics("(1 - p) sum of p^k frame(t - k), k from 0 to 12, and the rest of the weight on the oldest")
        .source("A recursive filter over time, as in the noise reduction of image signal processors, cut after twelve frames")
        .parameter(
            Parameter::by_level("persistence", [0.2, 0.4, 0.55, 0.7, 0.85], "share of what was there before in what is shown")
                .range(0.0, 0.99),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for Ghosting {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let persistence = cx.number("persistence") as f32;
        let frames = cx.history.len();
        // What the frames before the oldest would have had, the oldest gets.
        let mut weights = [0.0f32; FRAMES + 1];
        let mut rest = 1.0;
        for weight in &mut weights[..frames] {
            *weight = rest * (1.0 - persistence);
            rest *= persistence;
        }
        weights[frames] = rest;
        let seen = |back: usize| cx.history.back(back).map_or(src, |earlier| earlier.frame);
        for (y, row) in dst.rows_mut().enumerate() {
            self.sums.clear();
            self.sums.resize(row.len(), 0.5);
            for (back, weight) in weights.iter().enumerate().take(frames + 1) {
                for (sum, value) in self.sums.iter_mut().zip(seen(back).row(y)) {
                    *sum += weight * f32::from(*value);
                }
            }
            for (to, sum) in row.iter_mut().zip(&self.sums) {
                *to = *sum as u8;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::Ghosting;
    use crate::test_sequence::{any_frame_can_be_computed_alone, leaves_a_sequence_alone, mark, pixels};

    #[test]
    fn a_frame_is_the_recursive_mean_of_those_before_it() {
        let persistence = 0.5;
        let frames = pixels::<Ghosting>(&json!({"persistence": persistence}), 0.0, 12);
        let mut mean = f64::from(mark(0));
        for (index, frame) in frames.iter().enumerate() {
            mean = (1.0 - persistence) * f64::from(mark(index)) + persistence * mean;
            let expected = mean.round() as u8;
            assert!(frame.data().iter().all(|value| value.abs_diff(expected) <= 1), "frame {index}");
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
