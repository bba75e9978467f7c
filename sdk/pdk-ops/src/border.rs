//! What lies beyond the edge of an image.

/// The index that stands for `index` in a row of `len` when the row is mirrored at both ends without repeating the
/// last element: `c b | a b c d | c b`. Works for any distance from the row.
pub fn reflect(index: isize, len: usize) -> usize {
    if len == 1 {
        return 0;
    }
    let period = 2 * (len - 1);
    let place = index.rem_euclid(period as isize) as usize;
    if place < len { place } else { period - place }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirrors_without_repeating_the_edge() {
        let row: Vec<usize> = (-5..9).map(|i| reflect(i, 4)).collect();
        assert_eq!(row, [1, 2, 3, 2, 1, 0, 1, 2, 3, 2, 1, 0, 1, 2]);
        assert_eq!(reflect(-1, 4), 1);
        assert_eq!(reflect(4, 4), 2);
        assert!((-9..9).all(|i| reflect(i, 1) == 0));
        assert_eq!((-2..4).map(|i| reflect(i, 2)).collect::<Vec<_>>(), [0, 1, 0, 1, 0, 1]);
    }
}
