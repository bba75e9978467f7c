//! By how much the image has moved between two frames.

use crate::frame::Frame;

/// Frames are reduced to about this many cells in a row.
const CELLS: usize = 80;
/// The furthest shift, as a share of the side: one part in this number.
const FURTHEST: usize = 8;

/// Follows the image from one frame to later ones. Keeps its memory, so that only the first frames of a size allocate.
#[derive(Default)]
pub struct Motion {
    from: Reduced,
    to: Reduced,
    /// The shifts that are tried, the smallest first, and for which size of reduced frames.
    shifts: Vec<[isize; 2]>,
    size: (usize, usize),
}

impl Motion {
    /// Follows the image from this frame on.
    pub fn begin(&mut self, frame: Frame<'_>) {
        self.from.set(frame);
    }

    /// The shift of the whole image in pixels, right and down, from the first frame to another of the same size: the one, of at
    /// most an eighth of each side, under which reduced pictures of the two differ least. Of equal ones it is the smallest.
    ///
    /// It follows from the two frames alone, and is computed in whole numbers.
    pub fn since(&mut self, frame: Frame<'_>) -> [isize; 2] {
        let Self { from, to, shifts, size } = self;
        to.set(frame);
        if *size != (to.columns, to.rows) {
            *size = (to.columns, to.rows);
            let (right, down) = ((to.columns / FURTHEST) as isize, (to.rows / FURTHEST) as isize);
            shifts.clear();
            shifts.extend((-down..=down).flat_map(|y| (-right..=right).map(move |x| [x, y])));
            shifts.sort_by_key(|[x, y]| (x * x + y * y, *x, *y));
        }
        let mut best = ([0, 0], u64::MAX, 1);
        for shift in shifts {
            let (sum, cells) = from.difference(to, *shift);
            // Means are compared without dividing.
            if u128::from(sum) * u128::from(best.2) < u128::from(best.1) * u128::from(cells) {
                best = (*shift, sum, cells);
            }
        }
        best.0.map(|cells| cells * to.block as isize)
    }
}

/// The mean brightness of square blocks of a frame.
#[derive(Default)]
struct Reduced {
    block: usize,
    columns: usize,
    rows: usize,
    cells: Vec<u8>,
    /// Of the blocks of a row.
    sums: Vec<u32>,
}

impl Reduced {
    fn set(&mut self, frame: Frame<'_>) {
        let block = (frame.width() / CELLS).max(1);
        (self.block, self.columns, self.rows) =
            (block, frame.width() / block, (frame.height() / block).max(1));
        self.cells.clear();
        self.sums.resize(self.columns, 0);
        for row in 0..self.rows {
            self.sums.fill(0);
            let lines = row * block..((row + 1) * block).min(frame.height());
            let count = (lines.len() * block * 3) as u32;
            for y in lines {
                for (sum, values) in self.sums.iter_mut().zip(frame.row(y).chunks_exact(block * 3)) {
                    *sum += values.iter().map(|&value| u32::from(value)).sum::<u32>();
                }
            }
            self.cells.extend(self.sums.iter().map(|sum| (sum / count) as u8));
        }
    }

    /// The sum of the differences to another one that is shifted against this one, and over how many cells.
    fn difference(&self, other: &Self, [right, down]: [isize; 2]) -> (u64, u64) {
        let overlap = |shift: isize, length: usize| {
            let (before, behind) = (shift.max(0) as usize, (-shift).max(0) as usize);
            (behind, before, length - before - behind)
        };
        let (x, other_x, width) = overlap(right, self.columns);
        let (y, other_y, height) = overlap(down, self.rows);
        let mut sum = 0;
        for row in 0..height {
            let own = &self.cells[(y + row) * self.columns + x..][..width];
            let others = &other.cells[(other_y + row) * self.columns + other_x..][..width];
            sum += own.iter().zip(others).map(|(a, b)| u64::from(a.abs_diff(*b))).sum::<u64>();
        }
        (sum, (width * height) as u64)
    }
}

/// Writes a map whose content is moved right and down; what comes in from beyond the edge is as the edge was.
pub fn moved(values: &[f32], width: usize, [right, down]: [isize; 2], into: &mut Vec<f32>) {
    let height = values.len() / width;
    let place =
        |at: usize, by: isize, length: usize| (at as isize - by).clamp(0, length as isize - 1) as usize;
    into.clear();
    for y in 0..height {
        let row = &values[place(y, down, height) * width..][..width];
        into.extend((0..width).map(|x| row[place(x, right, width)]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FrameBuf;

    /// A picture of spots, of which a window is shown.
    fn window(right: usize, down: usize) -> FrameBuf {
        let mut frame = FrameBuf::new(160, 96);
        for (x, y) in (0..160 * 96).map(|at| (at % 160, at / 160)) {
            let (u, v) = ((x + right) / 8, (y + down) / 8);
            frame.as_mut().set_pixel(x, y, [((u * 37 + v * 101) * 71 % 251) as u8; 3]);
        }
        frame
    }

    fn shift(from: Frame<'_>, to: Frame<'_>) -> [isize; 2] {
        let mut motion = Motion::default();
        // What was seen before has no part in it.
        motion.begin(FrameBuf::new(320, 20).as_ref());
        motion.since(FrameBuf::new(320, 20).as_ref());
        motion.begin(from);
        motion.since(to)
    }

    #[test]
    fn a_shift_is_found_and_a_map_moved_by_it() {
        // What lies further right in the picture moves left in the window.
        let (before, after) = (window(20, 10), window(8, 14));
        assert_eq!(shift(before.as_ref(), after.as_ref()), [12, -4]);
        assert_eq!(shift(after.as_ref(), before.as_ref()), [-12, 4]);
        assert_eq!(shift(before.as_ref(), before.as_ref()), [0, 0]);
        let blank = FrameBuf::new(160, 96);
        assert_eq!(shift(blank.as_ref(), blank.as_ref()), [0, 0]);
        let narrow = FrameBuf::new(3, 2);
        assert_eq!(shift(narrow.as_ref(), narrow.as_ref()), [0, 0]);
        let mut map = vec![7.0];
        moved(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 3, [1, -1], &mut map);
        assert_eq!(map, [4.0, 4.0, 5.0, 4.0, 4.0, 5.0]);
    }
}
