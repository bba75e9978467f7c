//! By how much the image has moved between two frames.

use pdk_sdk::prelude::Frame;

/// Frames are reduced to about so many cells in a row.
const CELLS: usize = 80;
/// The furthest shift, as a share of the side: one part in so many.
const FURTHEST: usize = 8;

/// The shift of the whole image in pixels, right and down, from one frame to another of the same size: the one, of at most an
/// eighth of each side, under which reduced pictures of the two differ least. Of equal ones it is the smallest.
///
/// It follows from the two frames alone, and is computed in whole numbers.
pub fn shift(from: Frame<'_>, to: Frame<'_>) -> [isize; 2] {
    let block = (from.width() / CELLS).max(1);
    let (from, to) = (Reduced::of(from, block), Reduced::of(to, block));
    let (right, down) = ((from.columns / FURTHEST) as isize, (from.rows / FURTHEST) as isize);
    let mut shifts: Vec<_> = (-down..=down).flat_map(|y| (-right..=right).map(move |x| [x, y])).collect();
    shifts.sort_by_key(|[x, y]| (x * x + y * y, *x, *y));
    let mut best = ([0, 0], u64::MAX, 1);
    for shift in shifts {
        let (sum, cells) = from.difference(&to, shift);
        // Means are compared without dividing.
        if u128::from(sum) * u128::from(best.2) < u128::from(best.1) * u128::from(cells) {
            best = (shift, sum, cells);
        }
    }
    best.0.map(|cells| cells * block as isize)
}

/// The mean brightness of square blocks of a frame.
struct Reduced {
    columns: usize,
    rows: usize,
    cells: Vec<u8>,
}

impl Reduced {
    fn of(frame: Frame<'_>, block: usize) -> Self {
        let (columns, rows) = (frame.width() / block, (frame.height() / block).max(1));
        let mut cells = Vec::with_capacity(columns * rows);
        let mut sums = vec![0u32; columns];
        for row in 0..rows {
            sums.fill(0);
            let lines = row * block..((row + 1) * block).min(frame.height());
            let count = (lines.len() * block * 3) as u32;
            for y in lines {
                for (sum, values) in sums.iter_mut().zip(frame.row(y).chunks_exact(block * 3)) {
                    *sum += values.iter().map(|&value| u32::from(value)).sum::<u32>();
                }
            }
            cells.extend(sums.iter().map(|sum| (sum / count) as u8));
        }
        Self { columns, rows, cells }
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

/// A map whose content is moved right and down; what comes in from beyond the edge is as the edge was.
pub fn moved(values: &[f32], width: usize, [right, down]: [isize; 2]) -> Vec<f32> {
    let height = values.len() / width;
    let place =
        |at: usize, by: isize, length: usize| (at as isize - by).clamp(0, length as isize - 1) as usize;
    let columns: Vec<usize> = (0..width).map(|x| place(x, right, width)).collect();
    let rows = (0..height).map(|y| &values[place(y, down, height) * width..][..width]);
    rows.flat_map(|row| columns.iter().map(|&x| row[x])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::FrameBuf;

    /// A picture of spots, of which a window is shown.
    fn window(right: usize, down: usize) -> FrameBuf {
        let mut frame = FrameBuf::new(160, 96);
        for (x, y) in (0..160 * 96).map(|at| (at % 160, at / 160)) {
            let (u, v) = ((x + right) / 8, (y + down) / 8);
            frame.as_mut().set_pixel(x, y, [((u * 37 + v * 101) * 71 % 251) as u8; 3]);
        }
        frame
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
        assert_eq!(moved(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 3, [1, -1]), [4.0, 4.0, 5.0, 4.0, 4.0, 5.0]);
    }
}
