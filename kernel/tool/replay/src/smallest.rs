//! The smallest part of a drive for which something holds: a span of frames, and a box in them.

use std::ops::Range;

use pdk_sdk::error::Result;

/// How finely boxes are told apart, in parts of the width and of the height.
pub const GRID: u32 = 64;

/// A span of frames and a box, whose sides are counted in parts of the frame.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Block {
    /// The frames.
    pub frames: Range<u32>,
    /// From left to right.
    pub columns: Range<u32>,
    /// From top to bottom.
    pub rows: Range<u32>,
}

/// A side of a block: its axis, and whether it is the first of the two.
pub type Side = (usize, bool);

/// Says for each block whether something holds for it.
pub type Holds<'a> = dyn FnMut(&[Block]) -> Result<Vec<bool>> + 'a;

/// The first and the last frame, which move before the sides of the box.
pub const OF_TIME: &[Side] = &[(0, true), (0, false)];

/// All sides of a block, in the order in which they move.
pub const SIDES: &[Side] = &[(0, true), (0, false), (2, true), (2, false), (1, true), (1, false)];

impl Block {
    /// The first `frames` frames, whole.
    pub fn whole(frames: u32) -> Self {
        Self { frames: 0..frames, columns: 0..GRID, rows: 0..GRID }
    }

    /// The box as left, top, right and bottom in shares of the frame; nothing if it is the whole frame.
    pub fn area(&self) -> Option<[f64; 4]> {
        let share = |part: u32| f64::from(part) / f64::from(GRID);
        let all = 0..GRID;
        (self.columns != all || self.rows != all)
            .then(|| [self.columns.start, self.rows.start, self.columns.end, self.rows.end].map(share))
    }

    /// Whether another block lies in this one.
    pub fn contains(&self, other: &Self) -> bool {
        (0..3).all(|axis| {
            let (own, other) = (self.axis(axis), other.axis(axis));
            own.start <= other.start && other.end <= own.end
        })
    }

    fn axis(&self, axis: usize) -> &Range<u32> {
        [&self.frames, &self.columns, &self.rows][axis]
    }

    /// The same with a side moved inwards by some steps; nothing if that leaves nothing.
    fn moved(&self, (axis, first): Side, steps: u32) -> Option<Self> {
        let mut moved = self.clone();
        let range = [&mut moved.frames, &mut moved.columns, &mut moved.rows].into_iter().nth(axis)?;
        match first {
            true => range.start += steps,
            false => range.end = range.end.checked_sub(steps)?,
        }
        (range.start < range.end).then_some(moved)
    }
}

/// Moves these sides of a block, for which something holds, inwards as long as it does. What comes out holds, and does not if any one of its sides is
/// one step further in. If a block holds whenever a block within it does, the result contains no smaller block that holds.
/// `holds` is asked about blocks that do not depend on each other at the same time.
///
/// # Errors
/// If `holds` fails.
pub fn smallest(mut block: Block, sides: &[Side], holds: &mut Holds<'_>) -> Result<Block> {
    for side in sides {
        let length = block.axis(side.0).len() as u32;
        block = moved_in(block, *side, 0, length, holds)?;
    }
    // What was needed when another side had not moved may not be any more. Two sides are tried at a time: more would be in vain if one of the first can move.
    let (mut next, mut stuck) = (0, 0);
    while stuck < sides.len() {
        let tried: Vec<Side> =
            (0..2.min(sides.len() - stuck)).map(|by| sides[(next + by) % sides.len()]).collect();
        let blocks: Vec<Option<Block>> = tried.iter().map(|side| block.moved(*side, 1)).collect();
        let possible: Vec<Block> = blocks.iter().flatten().cloned().collect();
        let mut held = holds(&possible)?.into_iter();
        for (side, moved) in tried.into_iter().zip(blocks) {
            next = (next + 1) % sides.len();
            stuck += 1;
            if moved.is_some() && held.next() == Some(true) {
                block = further_in(block, side, holds)?;
                stuck = 1;
                break;
            }
        }
    }
    Ok(block)
}

/// Moves one side in that can move by one step, by twice as many each time, and then as far as a search by halves finds.
fn further_in(block: Block, side: Side, holds: &mut Holds<'_>) -> Result<Block> {
    let length = block.axis(side.0).len() as u32;
    let mut possible = 1;
    while let Some(smaller) = block.moved(side, 2 * possible) {
        if holds(&[smaller])?.first() != Some(&true) {
            break;
        }
        possible *= 2;
    }
    moved_in(block, side, possible, length.min(2 * possible), holds)
}

/// Moves one side in, as far as a search by halves finds. It can move by `possible` steps; `not` steps were tried in vain, or leave nothing.
fn moved_in(
    block: Block,
    side: Side,
    mut possible: u32,
    mut not: u32,
    holds: &mut Holds<'_>,
) -> Result<Block> {
    while not - possible > 1 {
        let middle = possible + (not - possible) / 2;
        let Some(smaller) = block.moved(side, middle) else { break };
        match holds(&[smaller])?.first() {
            Some(true) => possible = middle,
            _ => not = middle,
        }
    }
    Ok(block.moved(side, possible).unwrap_or(block))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn intersection(a: &Range<u32>, b: &Range<u32>) -> u32 {
        a.end.min(b.end).saturating_sub(a.start.max(b.start))
    }

    fn size(block: &Block) -> u64 {
        [&block.frames, &block.columns, &block.rows].iter().map(|range| range.len() as u64).product()
    }

    fn overlap(a: &Block, b: &Block) -> f64 {
        let both: u64 = (0..3).map(|axis| u64::from(intersection(a.axis(axis), b.axis(axis)))).product();
        both as f64 / (size(a) + size(b) - both) as f64
    }

    /// Causes at places that look random, of 1 to 40 frames and boxes of 4 to 36 parts.
    fn causes() -> impl Iterator<Item = Block> {
        let mut state = 1u64;
        let mut below = move |limit: u32| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as u32) % limit
        };
        (0..200).map(move |_| {
            let (frames, columns, rows) = (1 + below(40), 4 + below(32), 4 + below(32));
            let [first, left, top] = [below(400 - frames), below(GRID - columns), below(GRID - rows)];
            Block { frames: first..first + frames, columns: left..left + columns, rows: top..top + rows }
        })
    }

    #[test]
    fn planted_causes_are_found_exactly_if_all_of_them_is_needed() {
        let mut probes = 0;
        for cause in causes() {
            let found = smallest(Block::whole(400), SIDES, &mut |blocks| {
                probes += blocks.len();
                Ok(blocks
                    .iter()
                    .map(|block| overlap(block, &cause) >= size(&cause) as f64 / size(block) as f64)
                    .collect())
            })
            .unwrap();
            assert_eq!(found, cause);
        }
        assert!(probes / 200 < 60, "{} probes for each", probes / 200);
    }

    #[test]
    fn what_is_found_holds_and_no_side_can_move_further() {
        for cause in causes() {
            // Nine tenths of the cause are enough.
            let holds = |block: &Block| {
                let both: u64 =
                    (0..3).map(|axis| u64::from(intersection(block.axis(axis), cause.axis(axis)))).product();
                both * 10 >= size(&cause) * 9
            };
            let found =
                smallest(Block::whole(400), SIDES, &mut |blocks| Ok(blocks.iter().map(holds).collect()))
                    .unwrap();
            assert!(holds(&found));
            for side in SIDES {
                assert!(!found.moved(*side, 1).is_some_and(|smaller| holds(&smaller)), "{cause:?} {found:?}");
            }
            assert!(overlap(&found, &cause) >= 0.9, "{cause:?} {found:?}");
        }
    }

    #[test]
    fn of_two_causes_one_suffices_and_a_part_of_both_is_needed() {
        let all: Vec<Block> = causes().collect();
        for two in all.chunks_exact(2) {
            let fails = |block: &Block| two.iter().any(|cause| block.contains(cause));
            let found =
                smallest(Block::whole(400), SIDES, &mut |blocks| Ok(blocks.iter().map(fails).collect()))
                    .unwrap();
            assert!(two.contains(&found), "{two:?} {found:?}");
            // With all but this part perturbed, neither is whole.
            let passes = |block: &Block| two.iter().all(|cause| overlap(block, cause) > 0.0);
            let found =
                smallest(Block::whole(400), SIDES, &mut |blocks| Ok(blocks.iter().map(passes).collect()))
                    .unwrap();
            assert!(passes(&found));
            for side in SIDES {
                assert!(!found.moved(*side, 1).is_some_and(|smaller| passes(&smaller)), "{two:?} {found:?}");
            }
        }
    }

    /// Each cell of a small drive has a weight of 0 to 3, and blocks hold from some sum on.
    #[test]
    fn no_smaller_block_within_holds_by_trying_all_of_them() {
        const FRAMES: u32 = 5;
        const CELLS: u32 = 4;
        let whole = Block { frames: 0..FRAMES, columns: 0..CELLS, rows: 0..CELLS };
        let mut state = 1u64;
        for _ in 0..100 {
            let weights: Vec<u64> = (0..size(&whole))
                .map(|_| {
                    state =
                        state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (state >> 33) % 4
                })
                .collect();
            let sum = |block: &Block| -> u64 {
                let cells = block.frames.clone().flat_map(|frame| {
                    let rows = block.rows.clone();
                    rows.flat_map(move |row| block.columns.clone().map(move |column| (frame, row, column)))
                });
                cells
                    .map(|(frame, row, column)| weights[((frame * CELLS + row) * CELLS + column) as usize])
                    .sum()
            };
            let least = sum(&whole) / 3;
            let holds = |block: &Block| sum(block) >= least;
            let found =
                smallest(whole.clone(), SIDES, &mut |blocks| Ok(blocks.iter().map(holds).collect())).unwrap();
            assert!(holds(&found));
            let within = |range: &Range<u32>| -> Vec<Range<u32>> {
                let starts =
                    range.clone().flat_map(|start| (start + 1..=range.end).map(move |end| start..end));
                starts.collect()
            };
            for frames in within(&found.frames) {
                for columns in within(&found.columns) {
                    for rows in within(&found.rows) {
                        let smaller = Block { frames: frames.clone(), columns: columns.clone(), rows };
                        assert!(smaller == found || !holds(&smaller), "{smaller:?} in {found:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn an_error_ends_the_search() {
        let failed = smallest(Block::whole(9), SIDES, &mut |_| Err(pdk_sdk::error::Error::new("no")));
        assert_eq!(failed.unwrap_err().to_string(), "no");
    }
}
