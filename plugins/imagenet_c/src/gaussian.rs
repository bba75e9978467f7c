//! The Gaussian that blurs and drops are smoothed with.

use pdk_sdk::ops::float::gaussian;

/// A Gaussian is cut off at this many standard deviations.
const TRUNCATE: f64 = 4.0;

/// The weights of a Gaussian from its middle on.
pub fn weights(sigma: f64) -> Vec<f32> {
    gaussian(sigma, (TRUNCATE * sigma + 0.5) as usize)
}
