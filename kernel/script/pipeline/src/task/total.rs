//! Numbers about pictures.

use pdk_statistics::{CONFIDENCE, Estimate, blocks};
use serde::Serialize;

use crate::evaluation::Interval;

/// A number about pictures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Total {
    /// What it is.
    pub name: String,
    /// The number; none if the pictures do not have it, such as the precision of objects of a size that none has.
    pub value: Option<f64>,
    /// The range in which it may lie, for means over pictures.
    pub interval: Option<Interval>,
}

impl Total {
    /// A number that is not a mean over pictures.
    pub fn plain(name: impl Into<String>, value: Option<f64>) -> Self {
        Self { name: name.into(), value, interval: None }
    }

    /// A mean over pictures, with its interval.
    pub fn mean(name: &str, values: &[f64]) -> Self {
        let found = blocks::mean(values, blocks::length(values), CONFIDENCE);
        let interval = found.filter(|found| found.low.is_finite() && found.high.is_finite());
        Self {
            name: name.to_owned(),
            value: found.map(|found| found.value),
            interval: interval.map(|Estimate { low, high, .. }| Interval { low, high }),
        }
    }
}
