//! The middle of an image, enlarged, of which zoom blur and flakes of snow are made.

use pdk_sdk::ops::float::Image;

/// The middle of an image, enlarged to its size: hands out row by row, interpolated linearly on a grid from corner to corner.
pub fn enlarge(image: &Image, factor: f64, mut each: impl FnMut(usize, &[f32])) {
    let Image { width, height, channels, .. } = *image;
    let columns = Grid::new(width, factor);
    let rows = Grid::new(height, factor);
    let places: Vec<(usize, f32)> = (0..width).map(|x| columns.place(x)).collect();
    let (mut between, mut row) = (vec![0.0; width * channels], vec![0.0; width * channels]);
    for y in 0..height {
        let (above, down) = rows.place(y);
        let below = (above + 1).min(rows.last());
        let pairs = image.row(above).iter().zip(image.row(below));
        for (to, (&a, &b)) in between.iter_mut().zip(pairs) {
            *to = a + (b - a) * down;
        }
        for (to, &(left, right)) in row.chunks_exact_mut(channels).zip(&places) {
            let next = (left + 1).min(columns.last());
            let (a, b) = (&between[left * channels..][..channels], &between[next * channels..][..channels]);
            for ((to, &a), &b) in to.iter_mut().zip(a).zip(b) {
                *to = a + (b - a) * right;
            }
        }
        each(y, &row);
    }
}

/// Which pixels of a row an enlarged one consists of.
pub struct Grid {
    start: usize,
    count: usize,
    step: f64,
}

impl Grid {
    /// For the middle of `length` pixels, enlarged by a factor.
    pub fn new(length: usize, factor: f64) -> Self {
        let count = (libm::ceil(length as f64 / factor) as usize).clamp(1, length);
        let enlarged = (count as f64 * factor).round_ties_even().max(1.0);
        let step = if enlarged > 1.0 { (count - 1) as f64 / (enlarged - 1.0) } else { 0.0 };
        Self { start: (length - count) / 2, count, step }
    }

    /// How many pixels it is made of.
    pub fn count(&self) -> usize {
        self.count
    }

    fn last(&self) -> usize {
        self.start + self.count - 1
    }

    /// The pixel before a place, and how far behind that it is.
    fn place(&self, index: usize) -> (usize, f32) {
        let place = (index as f64 * self.step).min((self.count - 1) as f64);
        (self.start + place as usize, place.fract() as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_of_one_changes_nothing() {
        let values: Vec<f32> = (0..5 * 4 * 3).map(|value| value as f32).collect();
        let image = Image { values, width: 5, height: 4, channels: 3 };
        enlarge(&image, 1.0, |y, row| assert_eq!(row, image.row(y)));
    }

    #[test]
    fn the_grid_goes_from_corner_to_corner() {
        let grid = Grid::new(100, 2.0);
        assert_eq!((grid.start, grid.count, grid.place(0)), (25, 50, (25, 0.0)));
        assert_eq!(grid.place(99).0, 74);
    }
}
