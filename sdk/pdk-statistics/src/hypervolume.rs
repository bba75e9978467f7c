//! How much a front is worth: the volume that it dominates.

/// The volume of what `points` dominate, up to a reference point, with all objectives minimised. What is not better than the
/// reference in every objective adds nothing.
///
/// While, Bradstreet, Barone, "A fast way of calculating exact hypervolumes" (2012).
pub fn hypervolume(points: &[Vec<f64>], reference: &[f64]) -> f64 {
    let within = |point: &&Vec<f64>| point.iter().zip(reference).all(|(value, bound)| value < bound);
    let mut front = non_dominated(points.iter().filter(within).cloned().collect());
    // Slices in which most points are limited early leave little to do.
    front.sort_by(|a, b| b.last().copied().unwrap_or(0.0).total_cmp(&a.last().copied().unwrap_or(0.0)));
    volume(&front, reference)
}

/// The volume of a front, as a sum of what each point adds to those behind it.
fn volume(front: &[Vec<f64>], reference: &[f64]) -> f64 {
    if reference.len() == 2 {
        return area(front, reference);
    }
    let exclusive = |(place, point): (usize, &Vec<f64>)| {
        let own: f64 = point.iter().zip(reference).map(|(value, bound)| bound - value).product();
        let limited: Vec<Vec<f64>> = front[place + 1..]
            .iter()
            .map(|other| other.iter().zip(point).map(|(other, own)| other.max(*own)).collect())
            .collect();
        own - volume(&non_dominated(limited), reference)
    };
    front.iter().enumerate().map(exclusive).sum()
}

/// The volume of a front of two objectives.
fn area(front: &[Vec<f64>], reference: &[f64]) -> f64 {
    let mut order: Vec<&Vec<f64>> = front.iter().collect();
    order.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut height = reference[1];
    let mut area = 0.0;
    for point in order {
        if point[1] < height {
            area += (reference[0] - point[0]) * (height - point[1]);
            height = point[1];
        }
    }
    area
}

/// Those that no other dominates; of equal ones the first.
fn non_dominated(points: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let mut kept: Vec<Vec<f64>> = Vec::with_capacity(points.len());
    let covers = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a <= b);
    for point in points {
        if kept.iter().all(|other| !covers(other, &point)) {
            kept.retain(|other| !covers(&point, other));
            kept.push(point);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_are_those_of_boxes() {
        assert_eq!(hypervolume(&[], &[1.0, 1.0]), 0.0);
        assert_eq!(hypervolume(&[vec![2.0, 0.0]], &[1.0, 1.0]), 0.0);
        let front = [vec![0.0, 2.0], vec![1.0, 1.0], vec![2.0, 0.0], vec![2.0, 2.0], vec![1.0, 1.0]];
        assert_eq!(hypervolume(&front, &[3.0, 3.0]), 6.0);
        assert_eq!(hypervolume(&[vec![0.25]], &[1.0]), 0.75);
        let corners = [vec![0.0, 0.0, 1.0], vec![0.0, 1.0, 0.0], vec![1.0, 0.0, 0.0]];
        // Three slabs of 2 x 2 x 1, of which each two share 2, and all three 1.
        assert_eq!(hypervolume(&corners, &[2.0, 2.0, 2.0]), 3.0 * 4.0 - 3.0 * 2.0 + 1.0);
    }

    /// Against counting the cells of a grid, for fronts that chance made.
    #[test]
    fn volumes_are_those_that_counting_gives() {
        let mut state = 1u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 60) as f64
        };
        for dimensions in 2..=4usize {
            let points: Vec<Vec<f64>> = (0..12).map(|_| (0..dimensions).map(|_| draw()).collect()).collect();
            let reference = vec![16.0; dimensions];
            let cells = (0..16usize.pow(dimensions as u32)).filter(|cell| {
                let corner: Vec<f64> =
                    (0..dimensions).map(|d| (cell / 16usize.pow(d as u32) % 16) as f64).collect();
                points.iter().any(|point| point.iter().zip(&corner).all(|(p, c)| p <= c))
            });
            assert_eq!(hypervolume(&points, &reference), cells.count() as f64);
        }
    }
}
