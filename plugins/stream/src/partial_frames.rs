//! Partial frames: the transfer of a frame ends early, so its lower rows are those of the frame before.

use pdk_sdk::prelude::*;

/// How a receiver fills rows that have not come.
#[derive(Clone, Copy, PartialEq)]
enum Fill {
    Previous,
    LastRow,
    Black,
}

/// Loses the lower rows of some frames.
pub struct PartialFrames;

impl Component for PartialFrames {
    fn description() -> Description {
        Description::perturbation(
            "partial_frames",
            "Loses the lower rows of some frames and fills them as a receiver does, with those of the frame before",
        )
        .family("stream")
        .dynamic()
        .not_default()
        .alters_geometry()
        .history(1)
        .mathematics("row y of frame(t) = row y of frame(t - 1) for y >= (1 - u missing) H, u uniform")
        .drawn_per_frame("whether rows are lost, and how many")
        .source("Transfer that ends early; the rows of the previous frame are what a frame buffer still holds")
        .parameter(
            Parameter::by_level("partial", [0.1, 0.2, 0.4, 0.6, 0.9], "share of the frames that are not received in full")
                .range(0.0, 1.0),
        )
        .parameter(
            Parameter::by_level("missing", [0.3, 0.5, 0.7, 0.85, 1.0], "largest share of the rows that is lost").range(0.0, 1.0),
        )
        .parameter(Parameter::choice(
            "fill",
            &["previous", "last_row", "black"],
            "what lost rows show: previous: the rows of the frame before; last_row: the last row that was received; black: nothing",
        ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for PartialFrames {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        dst.copy_from(src);
        let mut random = cx.frame_random();
        if random.unit() >= cx.number("partial") {
            return Ok(());
        }
        let height = src.height();
        let lost = (random.unit() * cx.number("missing") * height as f64).round() as usize;
        let received = height.saturating_sub(lost);
        let fill = match cx.integer("fill") {
            0 => Fill::Previous,
            1 => Fill::LastRow,
            _ => Fill::Black,
        };
        let last = (fill == Fill::LastRow && received > 0).then(|| src.row(received - 1));
        let previous = cx.history.back(1).filter(|_| fill == Fill::Previous).map(|earlier| earlier.frame);
        for (y, row) in dst.rows_mut().enumerate().skip(received) {
            match (last, previous.map(|frame| frame.row(y))) {
                (Some(from), _) | (None, Some(from)) => row.copy_from_slice(from),
                // A receiver that has nothing yet shows nothing.
                (None, None) => row.fill(0),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::PartialFrames;
    use crate::test_sequence::{any_frame_can_be_computed_alone, mark, pixels};

    #[test]
    fn the_upper_rows_are_of_this_frame_and_the_lower_ones_of_the_frame_before() {
        let frames = pixels::<PartialFrames>(&json!({"partial": 1.0, "missing": 1.0}), 0.0, 200);
        let mut cuts = 0;
        for (index, frame) in frames.iter().enumerate().skip(1) {
            let of: Vec<usize> = frame
                .as_ref()
                .rows()
                .map(|row| if row[0] == mark(index) { index } else { index - 1 })
                .collect();
            assert!(of.windows(2).all(|pair| pair[0] >= pair[1]), "{of:?}");
            assert!(
                frame.as_ref().rows().zip(&of).all(|(row, of)| row.iter().all(|value| *value == mark(*of)))
            );
            cuts += usize::from(of.first() != of.last());
        }
        assert!(cuts > 150, "{cuts}");
    }

    #[test]
    fn lost_rows_can_be_black_or_repeat_the_last_one() {
        for (fill, lost) in [("black", true), ("last_row", false)] {
            let given = json!({"partial": 1.0, "missing": 0.5, "fill": fill});
            let frames = pixels::<PartialFrames>(&given, 0.0, 50);
            let black =
                frames.iter().enumerate().any(|(index, frame)| index > 0 && frame.data().contains(&0));
            assert_eq!(black, lost, "{fill}");
        }
    }

    #[test]
    fn any_frame_needs_its_predecessors_alone() {
        any_frame_can_be_computed_alone::<PartialFrames>();
    }
}
