//! Resampling of roads.

use pdk_ops::random::Key;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::estimate::Estimate;

/// With fewer roads resampling says too little.
const FEW: usize = 6;

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

/// How many standard errors of a mean over roads its interval reaches to each side, by Student's t.
fn student_limit(roads: usize, confidence: f64) -> f64 {
    let limit = match StudentsT::new(0.0, 1.0, roads as f64 - 1.0) {
        Ok(student) => student.inverse_cdf(0.5 + 0.5 * confidence),
        Err(_) => f64::INFINITY,
    };
    // The crate computes with the system's mathematical functions; their last bits are cut off.
    (limit * 1e6).round() / 1e6
}

/// The interval of the mean of values within a range, of which there is one a road.
///
/// Where all roads have the same value, resampling says nothing. Then the interval leaves room for as many roads with any other
/// value as could have been missed: with 10 roads up to 28 % of all. With fewer than six roads resampling says too little, and the
/// interval is Student's. In any case as many roads at either end of the range stay possible, so that a mean near an end is not
/// surer than one at it.
pub fn mean(values: &[f64], range: (f64, f64), confidence: f64) -> Estimate {
    let roads = values.len();
    let value = values.iter().sum::<f64>() / roads as f64;
    // Means of shares are not exact.
    let alike = |other: &f64| (other - values[0]).abs() <= 1e-9 * values[0].abs().max(1.0);
    let missed = crate::share::largest_unseen(roads as u64, confidence);
    let (low, high) = match values.iter().all(alike) {
        true => {
            let toward = |end: f64| if end.is_finite() { value + (end - value) * missed } else { value };
            (toward(range.0), toward(range.1))
        }
        false if roads < FEW => {
            let variance =
                values.iter().map(|v| (v - value) * (v - value)).sum::<f64>() / (roads as f64 - 1.0);
            let reach = student_limit(roads, confidence) * (variance / roads as f64).sqrt();
            ((value - reach).max(range.0), (value + reach).min(range.1))
        }
        false => {
            let of = |drawn: &[usize]| drawn.iter().map(|road| values[*road]).sum::<f64>() / roads as f64;
            interval(&resampled(roads, of), roads, confidence)
        }
    };
    let width = range.1 - range.0;
    match width.is_finite() {
        true => Estimate {
            value,
            low: low.min(range.1 - width * missed),
            high: high.max(range.0 + width * missed),
        },
        false => Estimate { value, low, high },
    }
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

    #[test]
    fn what_differs_by_rounding_is_alike() {
        let rounded: Vec<f64> = (0..10).map(|road| if road % 2 == 0 { 0.6 - 0.4 } else { 0.2 }).collect();
        let Estimate { low, high, .. } = mean(&rounded, (0.0, 1.0), 0.95);
        assert!((low - 0.2 * (1.0 - 0.2775)).abs() < 1e-4 && (high - (0.2 + 0.8 * 0.2775)).abs() < 1e-4);
    }

    #[test]
    fn the_same_numbers_give_the_same_interval() {
        let values = [0.0, 0.2, 0.2, 0.4, 0.4, 1.0];
        assert_eq!(mean(&values, (0.0, 1.0), 0.95), mean(&values, (0.0, 1.0), 0.95));
        // Fixed, so that another machine that differs is noticed.
        let Estimate { value, low, high } = mean(&values, (0.0, 1.0), 0.95);
        assert!((value - 2.2 / 6.0).abs() < 1e-15);
        assert!((low - 0.1).abs() < 1e-15 && (high - 4.6 / 6.0).abs() < 1e-15, "{low} {high}");
    }

    #[test]
    fn one_failure_is_no_surer_than_none() {
        let none = mean(&[0.0; 8], (0.0, 1.0), 0.95);
        let one = mean(&[0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], (0.0, 1.0), 0.95);
        assert!(none.high > 0.3 && one.high == none.high, "{none:?} {one:?}");
        let all_but_one = mean(&[0.95, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0], (0.0, 1.0), 0.95);
        assert!((all_but_one.low - (1.0 - none.high)).abs() < 1e-12, "{all_but_one:?}");
    }
}
