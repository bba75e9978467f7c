//! The place of a clip that follows a saliency map.

/// The middle of what a map marks, in pixels right of and below the middle of the frame: the mean of all places by their squared
/// values, so that faint ones hardly count. A map that marks nothing has its middle in that of the frame.
pub fn middle(map: &[f32], width: usize) -> [isize; 2] {
    let (mut sums, mut total) = ([0.0; 2], 0.0);
    for (y, row) in map.chunks_exact(width).enumerate() {
        for (x, &value) in row.iter().enumerate() {
            let weight = f64::from(value) * f64::from(value);
            (sums[0], sums[1]) = (sums[0] + weight * x as f64, sums[1] + weight * y as f64);
            total += weight;
        }
    }
    if total <= 0.0 {
        return [0, 0];
    }
    let height = map.len() / width;
    [0, 1].map(|axis| (sums[axis] / total - ([width, height][axis] as f64 - 1.0) / 2.0).round() as isize)
}

/// A picture in another place.
#[derive(Default)]
pub struct Moved {
    colours: Vec<u8>,
    alphas: Vec<u8>,
}

impl Moved {
    /// Colours and alphas of a picture of this size, moved right and down; nothing comes in from beyond its edges.
    pub fn to(
        &mut self,
        [right, down]: [isize; 2],
        (colours, alphas): (&[u8], &[u8]),
        (width, height): (usize, usize),
    ) -> (&[u8], &[u8]) {
        self.colours.clear();
        self.alphas.clear();
        self.colours.resize(colours.len(), 0);
        self.alphas.resize(alphas.len(), 0);
        let overlap = |by: isize, length: usize| {
            let kept = length.saturating_sub(by.unsigned_abs());
            ((-by).max(0) as usize, by.max(0) as usize, kept)
        };
        let ((from_x, to_x, columns), (from_y, to_y, rows)) = (overlap(right, width), overlap(down, height));
        let rows = if columns > 0 { rows } else { 0 };
        for row in 0..rows {
            let (from, to) = ((from_y + row) * width + from_x, (to_y + row) * width + to_x);
            self.colours[to * 3..][..columns * 3].copy_from_slice(&colours[from * 3..][..columns * 3]);
            self.alphas[to..][..columns].copy_from_slice(&alphas[from..][..columns]);
        }
        (&self.colours, &self.alphas)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_is_where_the_map_marks() {
        let marked = |at: &[usize]| {
            let mut map = vec![0.0; 40];
            at.iter().for_each(|&at| map[at] = 1.0);
            middle(&map, 8)
        };
        assert_eq!(marked(&[]), [0, 0]);
        assert_eq!(marked(&[7]), [4, -2]);
        assert_eq!(marked(&[32, 34]), [-3, 2]);
        assert_eq!(middle(&[0.3; 40], 8), [0, 0]);
    }

    #[test]
    fn a_picture_is_moved_and_cut_at_the_edges() {
        let colours: Vec<u8> = (0..18).collect();
        let alphas: Vec<u8> = (1..7).collect();
        let mut moved = Moved::default();
        let (shown, opacity) = moved.to([1, -1], (&colours, &alphas), (3, 2));
        assert_eq!(opacity, [0, 4, 5, 0, 0, 0]);
        assert_eq!(shown[..9], [0, 0, 0, 9, 10, 11, 12, 13, 14]);
        assert_eq!(moved.to([0, 0], (&colours, &alphas), (3, 2)).1, alphas);
        assert_eq!(moved.to([5, 0], (&colours, &alphas), (3, 2)).1, [0; 6]);
    }
}
