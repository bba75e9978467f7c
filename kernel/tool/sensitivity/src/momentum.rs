//! Steps along gradients with momentum, for pictures in training (Dong et al., Boosting Adversarial Attacks with Momentum, CVPR 2018).

/// The share of the direction that is kept from step to step.
const KEPT: f32 = 0.9;

/// The direction of the steps so far.
#[derive(Debug, Clone)]
pub struct Momentum(Vec<f32>);

impl Momentum {
    /// Before the first step, for this many values.
    pub fn new(count: usize) -> Self {
        Self(vec![0.0; count])
    }

    /// Changes each value by `length` in the direction that makes grow what has these slopes, between `low` and `high`.
    pub fn step(&mut self, values: &mut [f32], slopes: &[f32], length: f32, [low, high]: [f32; 2]) {
        let size: f64 = slopes.iter().map(|slope| f64::from(slope.abs())).sum::<f64>().max(f64::MIN_POSITIVE);
        let scale = (slopes.len() as f64 / size) as f32;
        for ((value, direction), slope) in values.iter_mut().zip(&mut self.0).zip(slopes) {
            *direction = *direction * KEPT + slope * scale;
            let by = if *direction == 0.0 { 0.0 } else { length.copysign(*direction) };
            *value = (*value + by).clamp(low, high);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_go_along_the_slopes_and_remember_where_they_went() {
        let (mut momentum, mut values) = (Momentum::new(3), [10.0, 10.0, 10.0]);
        momentum.step(&mut values, &[2.0, -0.5, 0.0], 4.0, [0.0, 12.0]);
        assert_eq!(values, [12.0, 6.0, 10.0]);
        // A small slope against the direction does not turn it round, and a large one does.
        momentum.step(&mut values, &[-0.1, 2.0, 0.3], 4.0, [0.0, 12.0]);
        assert_eq!(values, [12.0, 10.0, 12.0]);
    }
}
