//! Maps of numbers by cells: stretched to pixels, and reduced to fewer cells.

/// A map in another size, each part as large as all others.
pub fn stretch(values: &[f32], [width, height]: [usize; 2], to: [usize; 2], into: &mut Vec<f32>) {
    into.clear();
    for row in (0..to[1]).map(|y| y * height / to[1]) {
        into.extend((0..to[0]).map(|x| values[row * width + x * width / to[0]]));
    }
}

/// Adds the means of a map over the cells of a coarse one.
pub fn reduce(values: &[f32], width: usize, [columns, rows]: [usize; 2], into: &mut Vec<f32>) {
    let height = values.len() / width;
    let range = |cell: usize, cells: usize, length: usize| cell * length / cells..(cell + 1) * length / cells;
    for row in 0..rows {
        for column in 0..columns {
            let (across, down) = (range(column, columns, width), range(row, rows, height));
            let count = (across.len() * down.len()) as f64;
            let lines = down.map(|y| &values[y * width..][across.clone()]);
            into.push((lines.flatten().map(|&value| f64::from(value)).sum::<f64>() / count) as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_by_cells_is_stretched() {
        let mut stretched = vec![7.0];
        stretch(&[1.0, 2.0], [2, 1], [5, 2], &mut stretched);
        assert_eq!(stretched, [1.0, 1.0, 1.0, 2.0, 2.0, 1.0, 1.0, 1.0, 2.0, 2.0]);
    }

    #[test]
    fn a_map_is_reduced_to_the_means_of_its_cells() {
        let wide: Vec<f32> = (0..96 * 2).map(|at| (at % 96) as f32).collect();
        let mut coarse = Vec::new();
        reduce(&wide, 96, [24, 1], &mut coarse);
        assert_eq!(coarse[..2], [1.5, 5.5]);
    }
}
