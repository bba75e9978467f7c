//! Where the pixels of a row lie on the road.

use crate::field::{Field, Place};

/// The places on the road along one row of pixels. Where pixels are small the field is asked at every eighth alone: in
/// between it is straight to within a few millimetres.
pub struct Places<'a> {
    field: &'a Field,
    start: [f32; 2],
    across: [f32; 2],
    /// Whether places are interpolated.
    sparse: bool,
    /// The places at both ends of the block at hand, where they are near the road.
    ends: [Option<Place>; 2],
    /// Whether both belong to the same part of the road.
    straight: bool,
}

impl<'a> Places<'a> {
    /// Pixels in a block.
    const BLOCK: usize = 8;
    /// Longest block that counts as straight, in metres.
    const LONGEST: f32 = 0.5;

    /// The places of the pixels at `start`, `start + across` and so on, each `pixel_width` metres wide.
    pub fn new(field: &'a Field, start: [f32; 2], across: [f32; 2], pixel_width: f32) -> Self {
        let sparse = pixel_width * Self::BLOCK as f32 <= Self::LONGEST;
        let mut places = Self { field, start, across, sparse, ends: [None; 2], straight: false };
        places.ends[1] = places.end(0);
        places
    }

    fn end(&self, pixel: usize) -> Option<Place> {
        if !self.sparse {
            return None;
        }
        let (x, z) =
            (self.start[0] + self.across[0] * pixel as f32, self.start[1] + self.across[1] * pixel as f32);
        self.field.at(x, z).filter(Place::is_near)
    }

    /// The place of a pixel, which lies at `x`, `z`. Pixels have to be asked for in order.
    #[inline]
    pub fn at(&mut self, pixel: usize, x: f32, z: f32) -> Option<Place> {
        let within = pixel % Self::BLOCK;
        if self.sparse && within == 0 {
            self.ends = [self.ends[1], self.end(pixel + Self::BLOCK)];
            self.straight = matches!(self.ends, [Some(a), Some(b)]
                if (a.lateral - b.lateral).abs() <= 2.0 * Self::LONGEST
                    && (a.along - b.along).abs() <= 2.0 * Self::LONGEST);
        }
        match self.ends {
            [Some(a), Some(b)] if self.straight => {
                let share = within as f32 * (1.0 / Self::BLOCK as f32);
                let mix = |a: f32, b: f32| a + (b - a) * share;
                Some(Place {
                    lateral: mix(a.lateral, b.lateral),
                    along: mix(a.along, b.along),
                    gradient: a.gradient,
                })
            }
            // Far from the road, at its ends, or where pixels are large.
            _ => self.field.at(x, z),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::Road;

    #[test]
    fn places_in_between_are_those_of_the_field() {
        let road = Road::from_angles(&[0.0, 35.0, -35.0, 35.0, -35.0, 35.0, 35.0, 0.0], 25.0).unwrap();
        let field = Field::new(&road.path);
        let mut compared = 0;
        for step in 0..300 {
            let along = 2.0 + step as f64 * 0.5;
            let at = road.path.beside(along, -8.0);
            let [dx, dz] = road.path.direction(road.path.segment_at(along));
            let across = [(dz * 0.06) as f32, (-dx * 0.06) as f32];
            let start = [(at[0] - field.origin()[0]) as f32, (at[1] - field.origin()[1]) as f32];
            let mut places = Places::new(&field, start, across, 0.06);
            for pixel in 0..200 {
                let (x, z) = (start[0] + across[0] * pixel as f32, start[1] + across[1] * pixel as f32);
                let (fast, plain) = (places.at(pixel, x, z), field.at(x, z));
                if let (Some(fast), Some(plain)) = (fast, plain.filter(Place::is_near)) {
                    assert!((fast.lateral - plain.lateral).abs() < 0.01, "{fast:?} {plain:?}");
                    assert!((fast.along - plain.along).abs() < 0.06, "{fast:?} {plain:?}");
                    compared += 1;
                }
            }
        }
        assert!(compared > 50_000, "{compared}");
    }
}
