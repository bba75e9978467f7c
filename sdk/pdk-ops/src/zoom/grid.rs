//! Enlarging from corner to corner.

/// One direction of an enlargement from corner to corner: `ceil(length / factor)` whole pixels from the middle are stretched to a whole number
/// of pixels near the factor, first to first and last to last.
#[derive(Debug, Clone, Copy)]
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

    /// The last pixel that it is made of.
    pub fn last(&self) -> usize {
        self.start + self.count - 1
    }

    /// The pixel before a place in the enlarged image, and how far behind that it is, from 0 to 1.
    pub fn place(&self, index: usize) -> (usize, f32) {
        let place = (index as f64 * self.step).min((self.count - 1) as f64);
        (self.start + place as usize, place.fract() as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_goes_from_corner_to_corner() {
        let grid = Grid::new(100, 2.0);
        assert_eq!((grid.start, grid.count, grid.place(0)), (25, 50, (25, 0.0)));
        assert_eq!(grid.place(99).0, 74);
        let odd = Grid::new(9, 1.5);
        assert_eq!((odd.start, odd.count, odd.last()), (1, 6, 6));
        assert_eq!([0, 4, 8].map(|index| odd.place(index)), [(1, 0.0), (3, 0.5), (6, 0.0)]);
    }
}
