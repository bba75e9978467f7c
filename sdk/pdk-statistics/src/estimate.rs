//! A value with its interval.

use pdk_seed::normal_quantile;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// How often an interval covers the truth by default.
pub const CONFIDENCE: f64 = 0.95;

/// A value with its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// The lower end of its interval.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

/// How many standard deviations a normal variable lies from its mean at most, with this probability.
pub(crate) fn normal_limit(confidence: f64) -> f64 {
    normal_quantile(0.5 + 0.5 * confidence)
}

/// How many standard errors the mean of this many values lies from the true one at most, with this probability, by Student's t.
pub(crate) fn student_limit(values: usize, confidence: f64) -> f64 {
    let limit = match StudentsT::new(0.0, 1.0, values as f64 - 1.0) {
        Ok(student) => student.inverse_cdf(0.5 + 0.5 * confidence),
        Err(_) => f64::INFINITY,
    };
    // The crate computes with the system's mathematical functions; their last bits are cut off.
    (limit * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_of_95_percent_is_the_known_one() {
        assert!((normal_limit(CONFIDENCE) - 1.959_963_984_540_054).abs() < 1e-12);
    }
}
