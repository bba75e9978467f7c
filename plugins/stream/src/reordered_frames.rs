//! Reordered frames: packets overtake each other, so frames arrive out of order.

use pdk_sdk::prelude::*;

/// Frames that it asks for.
const FRAMES: u32 = 20;

/// Shows one of the latest frames, drawn anew for every frame.
pub struct ReorderedFrames;

impl Component for ReorderedFrames {
    fn description() -> Description {
        Description::perturbation(
            "reordered_frames",
            "Shows frames out of order: each time one of the latest, drawn at random",
        )
        .family("stream")
        .dynamic()
        .not_default()
        .alters_geometry()
        .history(FRAMES)
        .mathematics(
            "frame(t) = frame(t - k), k uniform in 0 to spread with probability reordered, else k = 0",
        )
        .drawn_per_frame("whether an earlier frame is shown, and which")
        .source("Packet reordering with a uniform displacement, as in RFC 4737")
        .parameter(
            Parameter::by_level("reordered", [0.2, 0.4, 0.6, 0.8, 1.0], "share of the frames that are drawn")
                .range(0.0, 1.0),
        )
        .parameter(
            Parameter::by_level(
                "spread",
                [1.0, 2.0, 4.0, 7.0, 12.0],
                "how far back a drawn frame lies at most",
            )
            .range(0.0, f64::from(FRAMES))
            .unit("frames"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for ReorderedFrames {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let mut random = cx.frame_random();
        let drawn = random.unit() < cx.number("reordered");
        let spread = cx.integer("spread").clamp(0, i64::from(FRAMES)) as u32;
        let back = if drawn { random.below(spread + 1) as usize } else { 0 };
        // At the beginning there are fewer frames to choose from.
        let earlier = cx.history.back(back.min(cx.history.len()));
        dst.copy_from(earlier.map_or(src, |earlier| earlier.frame));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::ReorderedFrames;
    use crate::test_sequence::{any_frame_can_be_computed_alone, shown};

    #[test]
    fn every_displacement_up_to_the_spread_is_equally_likely() {
        let shown = shown::<ReorderedFrames>(&json!({"reordered": 1.0, "spread": 3}), 0.0, 4_000);
        let mut counts = [0; 4];
        for (index, number) in shown.iter().enumerate().skip(3) {
            counts[index - number] += 1;
        }
        assert!(counts.iter().all(|count| (900..1_100).contains(count)), "{counts:?}");
    }

    #[test]
    fn any_frame_needs_its_predecessors_alone() {
        any_frame_can_be_computed_alone::<ReorderedFrames>();
    }
}
