//! Where the pixels of a frame come from that was displaced pixel by pixel, and where things go.

/// The place in the source of each pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Displacement {
    width: usize,
    height: usize,
    /// `[x, y]` for each pixel, row by row, in pixels from the centre of the first; they may lie outside the frame, which goes on mirrored.
    sources: Vec<[f32; 2]>,
    /// The largest displacement in either direction.
    largest: f64,
}

/// What is seen of a point is averaged over the pixels that show what is this near to it, in pixels: neighbours may be displaced almost
/// independently, so that a point goes with what is around it.
const NEAR: f64 = 4.0;

impl Displacement {
    /// A displacement, from the source of each pixel, row by row.
    ///
    /// # Panics
    /// If there is not one for each pixel.
    pub fn new(width: usize, height: usize, sources: Vec<[f32; 2]>) -> Self {
        assert_eq!(sources.len(), width * height, "a displacement has a source for each pixel");
        let moved = |(at, source): (usize, &[f32; 2])| {
            let [x, y] = source.map(f64::from);
            (x - (at % width) as f64).abs().max((y - (at / width) as f64).abs())
        };
        let largest = sources.iter().enumerate().map(moved).fold(0.0, f64::max);
        Self { width, height, sources, largest }
    }

    /// By how much the source of a pixel lies to the right of it and below.
    fn offset(&self, x: usize, y: usize) -> [f64; 2] {
        let [right, down] = self.sources[y * self.width + x].map(f64::from);
        [right - x as f64, down - y as f64]
    }

    /// The place in the source that is seen at a point: between pixels what lies between, outside of the frame as at its edge. It is
    /// always inside the frame.
    pub fn to_source(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        if !(x.is_finite() && y.is_finite()) || self.sources.is_empty() {
            return [f64::NAN; 2];
        }
        let between = |place: f64, length: usize| {
            let place = place.clamp(0.0, (length - 1) as f64);
            let first = place as usize;
            (first, (first + 1).min(length - 1), place - first as f64)
        };
        let ((left, right, across), (top, bottom, down)) = (between(x, self.width), between(y, self.height));
        let mix = |a: f64, b: f64, share: f64| a + (b - a) * share;
        let corners = [(left, top), (right, top), (left, bottom), (right, bottom)];
        let corners = corners.map(|(x, y)| self.offset(x, y));
        let offset = [0, 1].map(|axis| {
            let upper = mix(corners[0][axis], corners[1][axis], across);
            mix(upper, mix(corners[2][axis], corners[3][axis], across), down)
        });
        [mirrored(x + offset[0], self.width), mirrored(y + offset[1], self.height)]
    }

    /// Where a point of the source is seen. A displacement may show a point several times, or tear it: then it is the middle of the
    /// pixels that show what is near it.
    pub fn to_perturbed(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        if !(x.is_finite() && y.is_finite()) || self.sources.is_empty() {
            return [f64::NAN; 2];
        }
        let mut near = NEAR;
        loop {
            let reach = self.largest + near;
            let range = |place: f64, length: usize| {
                let last = (length - 1) as f64;
                let [from, to] = [place - reach, place + reach].map(|end| end.clamp(0.0, last));
                libm::ceil(from) as usize..=libm::floor(to) as usize
            };
            let (mut total, mut seen, mut moved) = (0.0, [0.0; 2], [0.0; 2]);
            for row in range(y, self.height) {
                for column in range(x, self.width) {
                    let offset = self.offset(column, row);
                    let shown = [column as f64, row as f64];
                    let away = libm::hypot(shown[0] + offset[0] - x, shown[1] + offset[1] - y);
                    let weight = (1.0 - away / near).max(0.0);
                    total += weight;
                    for axis in [0, 1] {
                        seen[axis] += weight * shown[axis];
                        moved[axis] -= weight * offset[axis];
                    }
                }
            }
            if total > 0.0 {
                // At the edge of the frame half of the surroundings is missing, so that their middle would lie inside.
                let whole = |place: f64, length: usize| (near..=length as f64 - 1.0 - near).contains(&place);
                return match whole(x, self.width) && whole(y, self.height) {
                    true => seen.map(|sum| sum / total),
                    false => [x + moved[0] / total, y + moved[1] / total],
                };
            }
            // Far outside of the frame nothing is seen, and nothing is known of displacements.
            if near > (self.width + self.height) as f64 {
                return [x, y];
            }
            near *= 2.0;
        }
    }
}

/// A place along a row of this many pixels that goes on mirrored, its first and last pixel repeated.
fn mirrored(place: f64, length: usize) -> f64 {
    let length = length as f64;
    let period = 2.0 * length;
    let shifted = place + 0.5;
    let within = shifted - period * libm::floor(shifted / period);
    (if within > length { period - within } else { within }) - 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shifted(right: f32, down: f32) -> Displacement {
        let source = |at: usize| [(at % 8) as f32 + right, (at / 8) as f32 + down];
        Displacement::new(8, 6, (0..48).map(source).collect())
    }

    #[test]
    fn an_even_shift_is_exact_both_ways_also_at_the_edges() {
        let shift = shifted(1.5, -0.5);
        for point in [[3.0, 2.0], [0.0, 5.0], [7.25, 0.5]] {
            let [x, y] = shift.to_perturbed(point);
            assert!((x - point[0] + 1.5).abs() < 1e-9 && (y - point[1] - 0.5).abs() < 1e-9, "{x} {y}");
        }
        assert_eq!(shift.to_source([2.25, 3.0]), [3.75, 2.5]);
        // Beyond the last column the frame goes on mirrored.
        assert_eq!(shift.to_source([7.0, 3.0]), [6.5, 2.5]);
        assert_eq!(shifted(0.0, 0.0).to_perturbed([900.0, 4.0]), [900.0, 4.0]);
        assert!(shift.to_source([f64::NAN, 0.0])[0].is_nan());
    }

    #[test]
    fn a_row_goes_on_mirrored() {
        let places = [-1.0, -0.5, 0.0, 3.0, 3.5, 4.0, 8.0, -9.0].map(|place| mirrored(place, 4));
        assert_eq!(places, [0.0, -0.5, 0.0, 3.0, 3.5, 3.0, 0.0, 0.0]);
    }
}
