//! What a perturbation costs in a frame.

use pdk_sdk::prelude::Frame;

use crate::costs::Costs;

/// The measure in words, as it stands in the files of scales.
pub const MEASURE: &str = "root mean square of how much cells of 1/80 of the frame's width differ in brightness, and four times as much in colour";

/// The costs of the scale that comes with pdk: each level costs twice what the one before it costs.
pub const COSTS: Costs = Costs([6.0, 12.0, 24.0, 48.0, 96.0]);

/// How many cells there are from left to right.
const COLUMNS: usize = 80;

/// How many times as much a difference in colour counts as one in brightness.
const COLOR: f64 = 4.0;

/// The root mean square of how much the means of cells differ, in steps of 8-bit values: in brightness, the mean of red, green and blue, and
/// [`COLOR`] times as much in how far red, green and blue lie from it. Cells are an eightieth of the frame wide and as high, about what stays of
/// a frame that a network sees in a small size; the last ones at the right and at the bottom may be smaller.
///
/// How it was chosen is in `docs/levels.md`.
pub fn of(raw: Frame<'_>, perturbed: Frame<'_>) -> f64 {
    let side = (raw.width() / COLUMNS).max(1);
    let columns = raw.width().div_ceil(side);
    let mut differences = vec![[0i64; 3]; columns];
    let (mut sum, mut cells) = (0.0, 0usize);
    let mut rows = raw.rows().zip(perturbed.rows()).peekable();
    while rows.peek().is_some() {
        differences.fill([0; 3]);
        let mut height = 0;
        for (raw, perturbed) in rows.by_ref().take(side) {
            height += 1;
            let pixels = raw.as_chunks::<3>().0.iter().zip(perturbed.as_chunks::<3>().0);
            for (x, (raw, perturbed)) in pixels.enumerate() {
                for (sum, (raw, perturbed)) in differences[x / side].iter_mut().zip(raw.iter().zip(perturbed))
                {
                    *sum += i64::from(*perturbed) - i64::from(*raw);
                }
            }
        }
        for (column, cell) in differences.iter().enumerate() {
            let pixels = side.min(raw.width() - column * side) * height;
            sum += of_cell(cell.map(|difference| difference as f64 / pixels as f64));
            cells += 1;
        }
    }
    (sum / cells.max(1) as f64).sqrt()
}

/// The square of what the difference of a cell's means counts.
fn of_cell(difference: [f64; 3]) -> f64 {
    let brightness = difference.iter().sum::<f64>() / 3.0;
    let color = difference.iter().map(|value| (value - brightness) * (value - brightness)).sum::<f64>() / 3.0;
    brightness * brightness + COLOR * COLOR * color
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::FrameBuf;

    fn frame(width: usize, height: usize, pixel: impl Fn(usize, usize) -> [u8; 3]) -> FrameBuf {
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        FrameBuf::from_vec(places.flat_map(|(x, y)| pixel(x, y)).collect(), width, height).unwrap()
    }

    #[test]
    fn cells_are_compared_by_their_means() {
        let raw = frame(160, 120, |_, _| [100, 100, 100]);
        let cost = |other: &FrameBuf| of(raw.as_ref(), other.as_ref());
        assert_eq!(cost(&raw), 0.0);
        assert!((cost(&frame(160, 120, |_, _| [90, 90, 90])) - 10.0).abs() < 1e-12);
        // Noise in a cell of two by two pixels is averaged away.
        assert_eq!(cost(&frame(160, 120, |x, y| if (x + y) % 2 == 0 { [80; 3] } else { [120; 3] })), 0.0);
        // A quarter of the cells changed by 20: half of that as the root of the mean square.
        let corner = frame(160, 120, |x, y| if x < 80 && y < 60 { [120; 3] } else { [100; 3] });
        assert!((cost(&corner) - 10.0).abs() < 1e-12);
        // As bright as before, but of another colour: red and blue differ by 10, green does not.
        let colored = frame(160, 120, |_, _| [110, 100, 90]);
        assert!((cost(&colored) - 4.0 * (200f64 / 3.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn sizes_that_cells_do_not_fill_count_whole() {
        // Cells of two pixels; the last column and row have one.
        let raw = frame(161, 5, |_, _| [0; 3]);
        assert!((of(raw.as_ref(), frame(161, 5, |_, _| [7; 3]).as_ref()) - 7.0).abs() < 1e-12);
        let tiny = frame(3, 2, |_, _| [0; 3]);
        assert!((of(tiny.as_ref(), frame(3, 2, |_, _| [9; 3]).as_ref()) - 9.0).abs() < 1e-12);
    }
}
