//! Where the pixels of a row lie on the road.

use crate::field::{Field, Place};
use crate::simd::BLOCK;

/// Longest block that counts as straight, in metres.
const LONGEST: f32 = 0.5;

/// The places on the road along one row of pixels, block by block. Where pixels are small the field is asked at the ends
/// of a block alone: in between it is straight to within a few millimetres.
pub struct Places<'a> {
    field: &'a Field,
    start: [f32; 2],
    across: [f32; 2],
    /// Whether places are interpolated.
    sparse: bool,
    /// The place where the next block begins, if near the road.
    next: Option<Place>,
}

/// The places of the pixels of a block.
pub enum Block {
    /// All of them lie far from the road.
    Away,
    /// From the first to just behind the last they lie on a straight line.
    Straight(Place, Place),
    /// Each has to be asked for.
    Any,
}

impl Block {
    /// The place of pixel `within` of a block whose places lie on a straight line from `a` to `b`.
    #[inline(always)]
    pub fn between(a: &Place, b: &Place, within: usize) -> Place {
        let share = within as f32 * (1.0 / BLOCK as f32);
        let mix = |a: f32, b: f32| a + (b - a) * share;
        Place {
            lateral: mix(a.lateral, b.lateral),
            along: mix(a.along, b.along),
            gradient: a.gradient,
            shade: mix(a.shade, b.shade),
        }
    }
}

impl<'a> Places<'a> {
    /// The places of the pixels at `start`, `start + across` and so on, each `pixel_width` metres wide.
    #[inline(always)]
    pub fn new(field: &'a Field, start: [f32; 2], across: [f32; 2], pixel_width: f32) -> Self {
        let sparse = pixel_width * BLOCK as f32 <= LONGEST;
        let mut places = Self { field, start, across, sparse, next: None };
        if sparse {
            places.next = places.end(0);
        }
        places
    }

    #[inline(always)]
    fn end(&self, pixel: usize) -> Option<Place> {
        let (x, z) =
            (self.start[0] + self.across[0] * pixel as f32, self.start[1] + self.across[1] * pixel as f32);
        self.field.at(x, z).filter(Place::is_near)
    }

    /// The places of the block that begins with `pixel`. Blocks have to be asked for in order.
    #[inline(always)]
    pub fn block(&mut self, pixel: usize) -> Block {
        if !self.sparse {
            return Block::Any;
        }
        let ends = (self.next, self.end(pixel + BLOCK));
        self.next = ends.1;
        match ends {
            // The road is wider than a block is long: it cannot lie in between.
            (None, None) => Block::Away,
            (Some(a), Some(b))
                if (a.lateral - b.lateral).abs() <= 2.0 * LONGEST
                    && (a.along - b.along).abs() <= 2.0 * LONGEST =>
            {
                Block::Straight(a, b)
            }
            _ => Block::Any,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::Road;

    #[test]
    fn places_in_between_are_those_of_the_field() {
        let road =
            Road::from_angles(&[0.0, 35.0, -35.0, 35.0, -35.0, 35.0, 35.0, 0.0], &[25.0; 8], &[]).unwrap();
        let field = Field::new(&road.path);
        let mut compared = 0;
        for step in 0..300 {
            let along = 2.0 + step as f64 * 0.5;
            let at = road.path.beside(along, -8.0);
            let [dx, dz] = road.path.direction(road.path.segment_at(along));
            let across = [(dz * 0.06) as f32, (-dx * 0.06) as f32];
            let start = [(at[0] - field.origin()[0]) as f32, (at[1] - field.origin()[1]) as f32];
            let mut places = Places::new(&field, start, across, 0.06);
            for first in (0..200).step_by(BLOCK) {
                let block = places.block(first);
                for pixel in first..first + BLOCK {
                    let (x, z) = (start[0] + across[0] * pixel as f32, start[1] + across[1] * pixel as f32);
                    let fast = match &block {
                        Block::Away => None,
                        Block::Straight(a, b) => Some(Block::between(a, b, pixel - first)),
                        Block::Any => field.at(x, z),
                    };
                    let plain = field.at(x, z);
                    if let (Some(fast), Some(plain)) = (fast, plain.filter(Place::is_near)) {
                        assert!((fast.lateral - plain.lateral).abs() < 0.01, "{fast:?} {plain:?}");
                        assert!((fast.along - plain.along).abs() < 0.06, "{fast:?} {plain:?}");
                        compared += 1;
                    }
                }
            }
        }
        assert!(compared > 50_000, "{compared}");
    }
}
