//! The middle of an image, enlarged, of which flakes of snow are made.

use pdk_sdk::ops::float::Image;
use pdk_sdk::ops::zoom::Grid;

/// Two columns of an image, and how far behind the first one a column of the result lies.
#[derive(Debug, Clone, Copy)]
struct Place {
    left: usize,
    right: usize,
    share: f32,
}

/// What [`enlarge`] keeps between calls.
#[derive(Debug, Default)]
pub struct Workspace {
    places: Vec<Place>,
    between: Vec<f32>,
    row: Vec<f32>,
}

/// The middle of an image of one channel, enlarged to its size: hands out row by row, interpolated linearly on a grid from corner to
/// corner.
pub fn enlarge(
    image: &Image,
    factor: f64,
    Workspace { places, between, row }: &mut Workspace,
    mut each: impl FnMut(usize, &[f32]),
) {
    let Image { width, height, .. } = *image;
    let (columns, rows) = (Grid::new(width, factor), Grid::new(height, factor));
    places.clear();
    places.extend((0..width).map(|x| {
        let (left, share) = columns.place(x);
        Place { left, right: (left + 1).min(columns.last()), share }
    }));
    between.resize(width, 0.0);
    row.resize(width, 0.0);
    let used = places.first().map_or(0, |place| place.left)..columns.last() + 1;
    for y in 0..height {
        let (above, down) = rows.place(y);
        let below = (above + 1).min(rows.last());
        let pairs = image.row(above)[used.clone()].iter().zip(&image.row(below)[used.clone()]);
        for (to, (&a, &b)) in between[used.clone()].iter_mut().zip(pairs) {
            *to = a + (b - a) * down;
        }
        for (to, place) in row.iter_mut().zip(&*places) {
            let (a, b) = (between[place.left], between[place.right]);
            *to = a + (b - a) * place.share;
        }
        each(y, row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_of_one_changes_nothing() {
        let values: Vec<f32> = (0..5 * 4).map(|value| value as f32).collect();
        let image = Image { values, width: 5, height: 4, channels: 1 };
        enlarge(&image, 1.0, &mut Workspace::default(), |y, row| assert_eq!(row, image.row(y)));
    }

    #[test]
    fn the_middle_is_stretched_from_corner_to_corner() {
        let values: Vec<f32> = (0..4 * 4).map(|value| value as f32).collect();
        let image = Image { values, width: 4, height: 4, channels: 1 };
        let mut rows = Vec::new();
        enlarge(&image, 2.0, &mut Workspace::default(), |_, row| rows.push([row[0], row[3]]));
        assert_eq!([rows[0], rows[3]], [[5.0, 6.0], [9.0, 10.0]]);
    }
}
