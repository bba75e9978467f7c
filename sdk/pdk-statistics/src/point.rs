//! An evaluated candidate as numbers.

/// An evaluated candidate. A position is a number for each variable: see [`Range`](pdk_model::search::Range).
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Its positions.
    pub x: Vec<f64>,
    /// Its objectives, smaller is better; empty if it has none.
    pub f: Vec<f64>,
    /// How far it is from keeping the constraints: 0 if it does, infinite if it could not be evaluated.
    pub violation: f64,
    /// Whether it shows what is searched for.
    pub critical: bool,
}
