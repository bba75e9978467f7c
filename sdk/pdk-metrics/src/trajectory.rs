//! Trajectories: how far predicted points lie from those that were driven (S. Pellegrini et al., "You'll Never Walk Alone", 2009, and
//! A. Alahi et al., "Social LSTM", 2016).

/// The average displacement error: the mean distance of points at the same time. None if the trajectories have no points or not
/// equally many.
pub fn average_displacement(predicted: &[[f64; 2]], driven: &[[f64; 2]]) -> Option<f64> {
    (predicted.len() == driven.len() && !driven.is_empty()).then(|| {
        let sum: f64 = predicted.iter().zip(driven).map(|(a, b)| distance(a, b)).sum();
        sum / driven.len() as f64
    })
}

/// The final displacement error: the distance of the last points. Returns none in the same cases as [`average_displacement`].
pub fn final_displacement(predicted: &[[f64; 2]], driven: &[[f64; 2]]) -> Option<f64> {
    let same = predicted.len() == driven.len();
    predicted.last().zip(driven.last()).filter(|_| same).map(|(a, b)| distance(a, b))
}

fn distance(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    let (x, y) = (a[0] - b[0], a[1] - b[1]);
    (x * x + y * y).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displacements_are_distances_at_the_same_time() {
        let (predicted, driven) = ([[0.0, 0.0], [3.0, 4.0]], [[0.0, 1.0], [0.0, 0.0]]);
        assert_eq!(average_displacement(&predicted, &driven), Some(3.0));
        assert_eq!(final_displacement(&predicted, &driven), Some(5.0));
        assert_eq!(average_displacement(&predicted, &driven[..1]), None);
        assert_eq!(final_displacement(&predicted, &driven[..1]), None);
        assert_eq!(average_displacement(&[], &[]), None);
    }
}
