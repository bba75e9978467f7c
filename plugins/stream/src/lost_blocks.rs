//! Lost blocks: runs of 16 x 16 blocks are lost from a compressed stream, and a decoder shows in their place what it had there.

use pdk_sdk::prelude::*;

use crate::codec::MACROBLOCK;

/// Frames that it asks for, and so the longest time for which a block can be old.
const FRAMES: u32 = 12;

/// Shows older blocks in place of those that are lost.
#[derive(Default)]
pub struct LostBlocks {
    /// How many frames ago each block came, row by row: a workspace.
    ages: Vec<u32>,
}

impl Component for LostBlocks {
    fn description() -> Description {
        Description::perturbation(
            "lost_blocks",
            "Loses runs of 16 x 16 blocks and shows the latest that came in their place, as a decoder that conceals losses does",
        )
        .family("stream")
        .dynamic()
        .not_default()
        .alters_geometry()
        .history(FRAMES)
        .mathematics("block(t) = block(last t' <= t in which it is not lost); in each row of blocks, all from a random one on are lost")
        .drawn_per_frame("which rows of blocks lose some, and from which on")
        .source("A slice is lost from the first damaged macroblock to its end (ITU-T H.264, clause 7.3.4); concealed by copies of the frame before")
        .parameter(
            Parameter::by_level("lost", [0.02, 0.06, 0.15, 0.35, 0.7], "share of the rows of blocks that lose blocks in a frame")
                .range(0.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

/// From which block on each row of blocks is lost in a frame; the number of blocks if all came.
fn first_lost(rows: usize, columns: usize, lost: f64, random: &mut Random) -> impl Iterator<Item = usize> {
    let columns = columns as u32;
    (0..rows).map(move |_| {
        // Both are drawn in any case, so that rows do not depend on each other.
        let (is_lost, from) = (random.unit() < lost, random.below(columns));
        if is_lost { from as usize } else { columns as usize }
    })
}

impl Perturbation for LostBlocks {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (columns, rows) = (src.width().div_ceil(MACROBLOCK), src.height().div_ceil(MACROBLOCK));
        let lost = cx.number("lost");
        // From the frame at hand back, until every block has come or there are no more frames.
        self.ages.clear();
        self.ages.resize(columns * rows, u32::MAX);
        for back in 0..=cx.history.len() {
            let frame_index = cx.history.back(back).map_or(cx.frame_index, |earlier| earlier.frame_index);
            // Without any frame before it, a frame is shown as it came.
            let lost = if back == cx.history.len() { 0.0 } else { lost };
            let mut missing = false;
            let mut random = cx.random_of(frame_index);
            for (row, first) in first_lost(rows, columns, lost, &mut random).enumerate() {
                for (column, age) in self.ages[row * columns..][..columns].iter_mut().enumerate() {
                    if *age == u32::MAX && column < first {
                        *age = back as u32;
                    }
                    missing |= *age == u32::MAX;
                }
            }
            if !missing {
                break;
            }
        }
        for (y, to) in dst.rows_mut().enumerate() {
            let ages = &self.ages[y / MACROBLOCK * columns..][..columns];
            for ((column, to), age) in to.chunks_mut(3 * MACROBLOCK).enumerate().zip(ages) {
                let from = cx.history.back(*age as usize).map_or(src, |earlier| earlier.frame);
                to.copy_from_slice(&from.row(y)[3 * MACROBLOCK * column..][..to.len()]);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::LostBlocks;
    use crate::test_sequence::{any_frame_can_be_computed_alone, leaves_a_sequence_alone, mark, pixels};

    #[test]
    fn rows_of_blocks_are_new_up_to_a_block_and_older_from_there_on() {
        let frames = pixels::<LostBlocks>(&json!({"lost": 0.5}), 0.0, 100);
        let mut old = 0;
        for (index, frame) in frames.iter().enumerate().skip(12) {
            for row in frame.as_ref().rows() {
                let lost = row.iter().filter(|value| **value != mark(index)).count();
                // Only ends of rows, in whole blocks but for the last one.
                assert!(row[..row.len() - lost].iter().all(|value| *value == mark(index)));
                assert_eq!((row.len() - lost) % 48 * usize::from(lost > 0), 0, "{lost}");
                old += usize::from(lost > 0);
            }
        }
        let all = 88 * frames[0].height();
        assert!((all * 4 / 10..all * 6 / 10).contains(&old), "{old} of {all}");
    }

    #[test]
    fn without_losses_nothing_changes() {
        leaves_a_sequence_alone::<LostBlocks>(&json!({"lost": 0.0}));
    }

    #[test]
    fn any_frame_needs_its_predecessors_alone() {
        any_frame_can_be_computed_alone::<LostBlocks>();
    }
}
