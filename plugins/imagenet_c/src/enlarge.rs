//! The middle of an image, enlarged, of which flakes of snow are made.

use pdk_sdk::ops::float::Image;
use pdk_sdk::ops::zoom::Grid;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_of_one_changes_nothing() {
        let values: Vec<f32> = (0..5 * 4 * 3).map(|value| value as f32).collect();
        let image = Image { values, width: 5, height: 4, channels: 3 };
        enlarge(&image, 1.0, |y, row| assert_eq!(row, image.row(y)));
    }
}
