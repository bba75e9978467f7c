//! Resampling of roads.

use pdk_seed::Key;

use crate::estimate::student_limit;

/// Resamples for an interval.
const DRAWS: usize = 4000;

/// The key of all resamples: the same number of roads is always resampled in the same way, so that differences of two estimates
/// are not blurred by the draws.
const KEY: Key = Key(*b"pdk statistics: resampled roads.");

/// The statistic of each resample, sorted. It gets the numbers of `roads` roads, drawn with replacement.
pub fn resampled(roads: usize, mut statistic: impl FnMut(&[usize]) -> f64) -> Vec<f64> {
    let mut random = KEY.sequence();
    let mut drawn = vec![0; roads];
    let mut values: Vec<f64> = (0..DRAWS)
        .map(|_| {
            drawn.iter_mut().for_each(|road| *road = random.below(roads as u32) as usize);
            statistic(&drawn)
        })
        .collect();
    values.sort_by(f64::total_cmp);
    values
}

/// The ends of the interval of a statistic over resamples of at least two roads.
///
/// The percentile interval, expanded as few roads need it: T. Hesterberg, "What Teachers Should Know About the Bootstrap" (2015),
/// section 5.3. The ends are values that occurred, so that infinite ones have their place; where all resamples are equal, both
/// ends are, too.
pub fn interval(resampled: &[f64], roads: usize, confidence: f64) -> (f64, f64) {
    let last = resampled.len() - 1;
    let below = (expanded_tail(roads, confidence) * last as f64).floor() as usize;
    (resampled[below], resampled[last - below])
}

/// The share of the resamples below the interval: the normal one of (1 - confidence) / 2, but as far out as Student's t with one
/// degree of freedom fewer than roads, and for a standard deviation that resamples of few roads make too small.
fn expanded_tail(roads: usize, confidence: f64) -> f64 {
    let n = roads as f64;
    0.5 * libm::erfc(student_limit(roads, confidence) * (n / (n - 1.0)).sqrt() / core::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_is_that_of_the_published_table() {
        // Hesterberg's table of adjusted tails, for a nominal tail of 0.025.
        for (roads, tail) in [(5, 0.0010), (10, 0.0086), (20, 0.0159), (40, 0.0203), (100, 0.0231)] {
            assert!(
                (expanded_tail(roads, 0.95) - tail).abs() < 1e-4,
                "{roads}: {}",
                expanded_tail(roads, 0.95)
            );
        }
    }
}
