//! ASAM OpenDRIVE 1.4: the road of a scenario as a map that simulators can load, and lanes of maps that they have.
//!
//! OpenDRIVE is right-handed with x ahead of the start, y to the left and headings counter-clockwise; so its x is our z, and its y is
//! our -x.

mod geometry;
mod map;
mod read;
mod write;

pub use map::{Lane, Map};
pub use write::{BEHIND, BEYOND, write};

use crate::Point;

/// A point of ours in the axes of OpenDRIVE.
fn turned([x, z]: Point) -> Point {
    [z, -x]
}

/// A point in the axes of OpenDRIVE in ours.
fn turned_back([x, y]: Point) -> Point {
    [-y, x]
}

#[cfg(test)]
mod tests;
