//! Where the vehicle is on its road, from the road and the position alone.

use pdk_road::{Located, Path, Point};
use pdk_sdk::prelude::{Error, Result};

/// The longest road in metres: what is kept of it takes memory in proportion.
pub const LONGEST: f64 = 5_000.0;
/// A lane of a map that is followed for this length ends a little behind it, at most this many metres.
const ROUNDING: f64 = 10.0;
/// The path is divided into pieces of this length in metres.
const STEP: f64 = 0.25;
/// How far from its last place along the road the vehicle is looked for, in metres, if it did not move farther: so a road that comes
/// close to itself is never mistaken for another part of it.
const SEARCH: f64 = 10.0;
/// The end of the road counts as reached this many metres before it: positions come now and then only.
const END: f64 = 0.5;
/// The heading follows from positions that are at least this many metres apart.
const HEADING_STEP: f64 = 0.1;

/// A road with a vehicle on it.
#[derive(Debug, Clone)]
pub struct Track {
    waypoints: Vec<[f64; 3]>,
    path: Path,
    located: Located,
    position: Point,
    /// The position from which the heading was taken, and that heading.
    headed: (Point, f64),
    farthest: f64,
}

/// Where a vehicle is on its road.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Signed distance from the centre line in metres, positive to the right.
    pub cross_track_error: f64,
    /// Distance along the road in metres.
    pub along: f64,
    /// The share of the road that has been driven, 0 to 1.
    pub progress: f64,
    /// Heading in radians, clockwise seen from above, 0 towards +z, from the way that the vehicle has come; at the start that of the road.
    pub heading: f64,
    /// Whether the end of the road was reached.
    pub finished: bool,
}

impl Track {
    /// A road through these waypoints, `[x, height, z]` in metres, x to the right where z is ahead. The vehicle is at its start.
    ///
    /// # Errors
    /// If there are fewer than two waypoints, two that follow each other are at the same place, or the road is longer than [`LONGEST`].
    pub fn new(waypoints: Vec<[f64; 3]>) -> Result<Self> {
        let points: Vec<Point> = waypoints.iter().map(|&[x, _, z]| [x, z]).collect();
        if points.len() < 2 {
            return Err(Error::new(format!("the road has {} waypoints, but needs at least 2", points.len())));
        }
        if let Some(i) = points.windows(2).position(|pair| pair[0] == pair[1]) {
            return Err(Error::new(format!(
                "waypoints {i} and {} of the road are at the same place: remove one of them",
                i + 1
            )));
        }
        let length: f64 = points.windows(2).map(|pair| pdk_road::distance(pair[0], pair[1])).sum();
        if length > LONGEST + ROUNDING {
            return Err(Error::new(format!(
                "the road is {length:.0} m long; divide it into roads of at most {LONGEST} m"
            )));
        }
        let path = Path::through(&points, STEP);
        let located = path.locate(points[0], 0, 1);
        let mut track =
            Self { waypoints, path, located, position: points[0], headed: (points[0], 0.0), farthest: 0.0 };
        track.restart();
        Ok(track)
    }

    /// Puts the vehicle at the start of the road.
    pub fn restart(&mut self) {
        let start = self.path.points()[0];
        let [dx, dz] = self.path.direction(0);
        self.located = self.path.locate(start, 0, 1);
        self.position = start;
        self.headed = (start, libm::atan2(dx, dz));
        self.farthest = 0.0;
    }

    /// Puts the vehicle at a position near the start, `[x, height, z]` in metres, in the direction of the road.
    pub fn stand(&mut self, [x, _, z]: [f64; 3]) {
        self.restart();
        self.position = [x, z];
        self.headed.0 = [x, z];
    }

    /// The waypoints.
    pub fn waypoints(&self) -> &[[f64; 3]] {
        &self.waypoints
    }

    /// Length in metres.
    pub fn length(&self) -> f64 {
        self.path.length()
    }

    /// Finds the vehicle at its next position, `[x, height, z]` in metres.
    pub fn find(&mut self, [x, _, z]: [f64; 3]) -> Place {
        let position = [x, z];
        let travelled = pdk_road::distance(self.position, position);
        // In a bend the way along the middle can be longer than that of the vehicle.
        let reach = SEARCH.max(2.0 * travelled);
        let first = self.path.segment_at(self.located.along - reach);
        let last = self.path.segment_at(self.located.along + reach) + 1;
        self.located = self.path.locate(position, first, last);
        self.position = position;
        let (from, _) = self.headed;
        if pdk_road::distance(from, position) >= HEADING_STEP {
            self.headed = (position, libm::atan2(position[0] - from[0], position[1] - from[1]));
        }
        self.farthest = self.farthest.max(self.located.along);
        let finished = self.farthest >= self.path.length() - END;
        Place {
            cross_track_error: self.located.lateral,
            along: self.located.along,
            progress: if finished { 1.0 } else { self.farthest / self.path.length() },
            heading: self.headed.1,
            finished,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_road_is_measured_from_its_line() {
        let mut track = Track::new(vec![[5.0, 1.0, 0.0], [5.0, 1.0, 100.0]]).unwrap();
        let place = track.find([5.0, 1.0, 0.0]);
        assert_eq!(
            (place.cross_track_error, place.progress, place.heading, place.finished),
            (0.0, 0.0, 0.0, false)
        );
        let place = track.find([6.5, 1.0, 20.0]);
        assert!((place.cross_track_error - 1.5).abs() < 1e-9 && (place.progress - 0.2).abs() < 1e-9);
        assert!((place.heading - libm::atan(1.5 / 20.0)).abs() < 1e-9);
        // Driving backwards is not progress.
        assert_eq!(track.find([5.0, 1.0, 10.0]).progress, place.progress);
        let place = track.find([4.0, 1.0, 99.6]);
        assert!(place.finished && place.progress == 1.0 && place.cross_track_error < -0.99);
        track.restart();
        assert!(!track.find([5.0, 1.0, 1.0]).finished);
        // Beside the start it has not come from the start.
        track.stand([6.0, 1.0, 0.0]);
        assert_eq!(track.find([6.0, 1.0, 0.0]).heading, 0.0);
        assert_eq!(track.find([6.0, 1.0, 1.0]).heading, 0.0);
    }

    #[test]
    fn a_road_that_comes_close_to_itself_is_not_mistaken() {
        // There and back, 6 m apart.
        let mut waypoints: Vec<_> = (0..=10).map(|i| [0.0, 0.0, 10.0 * f64::from(i)]).collect();
        waypoints.extend((0..=10).map(|i| [6.0, 0.0, 100.0 - 10.0 * f64::from(i)]));
        let mut track = Track::new(waypoints).unwrap();
        for z in 0..50 {
            let place = track.find([4.0, 0.0, f64::from(z)]);
            assert!((place.cross_track_error - 4.0).abs() < 1e-6 && place.progress < 0.3, "{z} {place:?}");
        }
    }

    #[test]
    fn a_wrong_road_is_rejected() {
        assert!(Track::new(vec![[0.0; 3]]).unwrap_err().message().contains("1 waypoints"));
        let twice = vec![[0.0; 3], [0.0, 0.0, 5.0], [0.0, 0.0, 5.0]];
        assert!(Track::new(twice).unwrap_err().message().starts_with("waypoints 1 and 2"));
        // Measured before it is divided, for which there would not be memory enough.
        for length in [5_100.0, 1e15, 1e300] {
            let error = Track::new(vec![[0.0; 3], [0.0, 0.0, length]]).unwrap_err();
            assert!(error.message().ends_with("m long; divide it into roads of at most 5000 m"), "{error}");
        }
        assert!(Track::new(vec![[0.0; 3], [0.0, 0.0, LONGEST]]).is_ok());
    }
}
