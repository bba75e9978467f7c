//! Roads for driving scenarios: generators, validity and measures.
//!
//! A road is a line on flat ground in metres: x to the right of the start, z ahead, y up. It is laid out by nodes, which
//! a centripetal Catmull-Rom spline joins to waypoints. The first node lies one segment behind the start and only shapes
//! the spline's beginning, so that the road leaves towards +z; the last one shapes its end in the same way.
//!
//! All is computed with the same bits on every machine.

#![forbid(unsafe_code)]

mod curve;
mod generate;
mod given;
pub mod opendrive;
mod path;
mod picture;
mod text;
pub mod traffic;
mod valid;

pub use curve::mean_curvature;
pub use generate::{Informed, STRAIGHTEST_TURN, informed_angles, random_angles};
pub use given::{read, read_with_end, with_heights};
pub use path::{Located, Path, catmull_rom};
pub use picture::svg;
pub use text::{parse, print};
pub use valid::{MapBox, check, check_bends};

/// Width of a lane in metres; a scenario's road has two.
pub const LANE_WIDTH: f64 = 4.0;
/// Width of a road in metres if none is given: its two lanes.
pub const WIDTH: f64 = 2.0 * LANE_WIDTH;
/// Smallest radius of a bend in metres if none is given. A car can drive it, and a simulator that measures between waypoints and
/// allows half a metre less takes every such road.
pub const SMALLEST_RADIUS: f64 = 8.5;

/// A point or direction on the ground: x, z, in metres.
pub type Point = [f64; 2];

/// Waypoints from one node to the next, both included.
pub const POINTS_PER_SEGMENT: usize = 20;
/// Length of a segment of the published study's roads, in metres.
pub const SEGMENT: f64 = 25.0;
/// Number of angles of the published study's roads.
pub const NODES: usize = 8;

/// A road.
#[derive(Debug, Clone, PartialEq)]
pub struct Road {
    /// The nodes, the one behind the start included.
    pub nodes: Vec<Point>,
    /// The angle at each node from the start on, in degrees, positive to the right.
    pub angles: Vec<f64>,
    /// The points along the line, from the start on.
    pub waypoints: Vec<Point>,
}

impl Road {
    /// Lays out a road: each node lies a segment on from the one before, turned by its angle in degrees.
    ///
    /// # Errors
    /// If there are fewer than 2 angles, another number of lengths than of angles, an angle is beyond 90 degrees, or a
    /// length is not from 1 to 1,000 m.
    pub fn from_angles(angles: &[f64], lengths: &[f64]) -> Result<Self, String> {
        if angles.len() < 2 || angles.len() > 200 {
            return Err(format!("a road needs 2 to 200 angles, but is given {}", angles.len()));
        }
        if lengths.len() != angles.len() {
            return Err(format!(
                "there are {} segment lengths for {} angles; give one length for each",
                lengths.len(),
                angles.len()
            ));
        }
        if let Some((i, angle)) =
            angles.iter().enumerate().find(|(_, angle)| !(-90.0..=90.0).contains(*angle))
        {
            return Err(format!("angle {} is {angle} degrees, but has to be from -90 to 90", i + 1));
        }
        if let Some((i, length)) = lengths.iter().enumerate().find(|(_, l)| !(1.0..=1000.0).contains(*l)) {
            return Err(format!("segment {} is {length} m long, but has to be from 1 to 1000 m", i + 1));
        }
        let nodes = lay_out(angles, lengths);
        let waypoints = curve::catmull_rom(&nodes, POINTS_PER_SEGMENT);
        Ok(Self { nodes, angles: angles.to_vec(), waypoints })
    }

    /// Number of turns: nodes at which the road turns by at least [`STRAIGHTEST_TURN`] degrees.
    pub fn turns(&self) -> usize {
        self.angles.iter().filter(|angle| angle.abs() >= STRAIGHTEST_TURN).count()
    }

    /// Mean curvature over the nodes in 1/m, rounded to 4 decimals: see [`mean_curvature`].
    pub fn mean_curvature(&self) -> f64 {
        (mean_curvature(&self.nodes) * 1e4).round() / 1e4
    }

    /// Length along the waypoints in metres.
    pub fn length(&self) -> f64 {
        self.waypoints.windows(2).map(|pair| distance(pair[0], pair[1])).sum()
    }
}

/// The nodes of a road, the one behind the start included.
fn lay_out(angles: &[f64], lengths: &[f64]) -> Vec<Point> {
    let first = lengths.first().copied().unwrap_or(SEGMENT);
    let mut nodes = vec![[0.0, -first], [0.0, 0.0]];
    let (mut at, mut heading) = ([0.0, 0.0], 0.0f64);
    for (angle, length) in angles.iter().zip(lengths) {
        heading += angle.to_radians();
        at = [at[0] + length * libm::sin(heading), at[1] + length * libm::cos(heading)];
        nodes.push(at);
    }
    nodes
}

/// Distance between two points in metres.
pub fn distance(a: Point, b: Point) -> f64 {
    let (dx, dz) = (b[0] - a[0], b[1] - a[1]);
    (dx * dx + dz * dz).sqrt()
}

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_layout_has_134_points() {
        let road = Road::from_angles(&[0.0; NODES], &[SEGMENT; NODES]).unwrap();
        assert_eq!((road.nodes.len(), road.waypoints.len()), (10, 134));
        assert_eq!((road.waypoints[0], road.nodes[0]), ([0.0, 0.0], [0.0, -25.0]));
        assert!((road.length() - 175.0).abs() < 1e-9);
        assert_eq!((road.turns(), road.mean_curvature()), (0, 0.0));
    }

    #[test]
    fn text_that_cannot_be_laid_out_is_reported() {
        let error = |angles: &[f64], lengths: &[f64]| Road::from_angles(angles, lengths).unwrap_err();
        assert!(error(&[1.0], &[25.0]).contains("2 to 200 angles"));
        assert!(error(&[1.0, 2.0], &[25.0]).contains("1 segment lengths for 2 angles"));
        assert!(error(&[1.0, 91.0], &[25.0, 25.0]).starts_with("angle 2 is 91 degrees"));
        assert!(error(&[1.0, f64::NAN], &[25.0, 25.0]).starts_with("angle 2"));
        assert!(error(&[1.0, 2.0], &[25.0, 0.0]).starts_with("segment 2 is 0 m"));
    }
}
