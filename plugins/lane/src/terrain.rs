//! Which ground each row of pixels shows.
//!
//! The ground rises and falls with the distance ahead as the road does, and does not change sideways. So a row shows
//! ground at one distance, on hills as on the flat; where the ground ahead dips behind a crest, rows pass over it.

use crate::camera::Projection;
use crate::profile::Profile;
use pdk_road::{Path, Point};

/// Beyond this distance the ground goes on as high as it is there, in metres.
const FARTHEST: f64 = 300.0;
/// Where the ground ends in haze, in metres.
const END: f64 = 5_000.0;
/// Nearest ground considered, in metres, unless a frame shows what is nearer still.
const NEAREST: f64 = 0.3;
/// It is at least this far away along the optical axis, in metres: ground below a camera that looks up is behind the lens.
const LEAST_DEPTH: f64 = 0.05;

/// The strip of ground that a row of pixels shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strip {
    /// Distance ahead of the camera in metres.
    pub ahead: f64,
    /// Width of a pixel on the ground in metres.
    pub pixel_width: f64,
    /// Extent of a pixel on the ground along the view direction in metres.
    pub pixel_depth: f64,
}

/// A point of the ground ahead.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// Distance ahead of the camera in metres.
    ahead: f64,
    /// Height above the plane on which the vehicle stands, in metres.
    height: f64,
    /// The row on which it appears.
    row: f64,
    /// The highest row on which this ground or any before it appears: what lies behind shows only above.
    crest: f64,
}

/// The ground ahead of the camera.
#[derive(Debug)]
pub struct Terrain {
    samples: Vec<Sample>,
    /// The strip of each row, from the frame's upper edge; `None` where the row shows sky.
    strips: Vec<Option<Strip>>,
    /// The slope on which the vehicle stands.
    slope: f64,
}

impl Terrain {
    /// Room for the rows of a frame.
    pub fn new(rows: usize) -> Self {
        // A sample for each metre, and two more.
        Self { samples: Vec::with_capacity(FARTHEST as usize + 4), strips: vec![None; rows], slope: 0.0 }
    }

    /// Looks at the ground ahead of a camera at `at`, `along` the road.
    pub fn look(
        &mut self,
        projection: &Projection,
        (path, profile): (&Path, &Profile),
        (at, heading, along): (Point, f64, f64),
    ) {
        self.samples.clear();
        self.strips.fill(None);
        self.slope = profile.slope(along);
        let mut sample = |ahead: f64, height: f64| {
            let (depth, row) = depth_and_row(projection, ahead, height);
            let crest = self.samples.last().map_or(f64::INFINITY, |before: &Sample| before.crest);
            if depth > 0.0 {
                self.samples.push(Sample { ahead, height, row, crest: crest.min(row) });
            }
        };
        let nearest = nearest(projection, self.strips.len());
        sample(nearest, 0.0);
        let (start, slope) = (profile.height(along), self.slope);
        if !profile.is_flat() {
            let forward = [libm::sin(heading), libm::cos(heading)];
            let mut farthest = nearest;
            for step in 1..FARTHEST as usize {
                let s = along + step as f64;
                let point = path.point_at(s);
                let ahead = (point[0] - at[0]) * forward[0] + (point[1] - at[1]) * forward[1];
                // Where the road turns back it has no say in what lies ahead.
                if ahead > farthest + 0.05 {
                    farthest = ahead;
                    sample(ahead, profile.height(s) - start - slope * ahead);
                }
            }
            let height = profile.height(along + FARTHEST) - start;
            if farthest < FARTHEST {
                sample(FARTHEST, height - slope * FARTHEST);
            }
            sample(END, height - slope * END);
        } else {
            sample(END, 0.0);
        }
        self.lay(projection);
    }

    /// Finds what each row shows.
    fn lay(&mut self, projection: &Projection) {
        for pair in self.samples.windows(2) {
            let [near, far] = [pair[0], pair[1]];
            if far.row >= near.crest {
                // Behind a crest.
                continue;
            }
            let (near_depth, far_depth) = (depth(projection, near), depth(projection, far));
            // Along a line on the ground the inverse of the depth, and the distance over the depth, change linearly
            // with the row.
            let rows = near.row - far.row;
            let inverse = (1.0 / near_depth, 1.0 / far_depth);
            let scaled = (near.ahead / near_depth, far.ahead / far_depth);
            let first = (far.row - 0.5).ceil().max(0.0) as usize;
            // Up to the crest only: below it nearer ground shows.
            let last = (near.crest.min(self.strips.len() as f64 + 1.0) - 0.5).ceil().max(0.0) as usize;
            for y in first..last.min(self.strips.len()) {
                let share = (near.row - (y as f64 + 0.5)) / rows;
                let mix = |(a, b): (f64, f64)| a + (b - a) * share;
                let (inverse_depth, ahead) = (mix(inverse), mix(scaled));
                let slope = (scaled.1 - scaled.0) * inverse_depth - ahead * (inverse.1 - inverse.0);
                self.strips[y] = Some(Strip {
                    ahead: ahead / inverse_depth,
                    pixel_width: 1.0 / (inverse_depth * projection.focal),
                    pixel_depth: (slope / (inverse_depth * inverse_depth * rows)).abs(),
                });
            }
        }
    }

    /// What a row shows; `None` for sky.
    pub fn strip(&self, row: usize) -> Option<Strip> {
        self.strips[row]
    }

    /// The slope on which the vehicle stands.
    pub fn slope(&self) -> f64 {
        self.slope
    }

    /// The height of the ground `ahead` metres in front of the camera above the plane on which the vehicle stands, and
    /// the row above which things there show.
    pub fn at(&self, ahead: f64) -> (f64, f64) {
        let next = self.samples.partition_point(|sample| sample.ahead <= ahead);
        match (next.checked_sub(1).map(|i| self.samples[i]), self.samples.get(next)) {
            (Some(before), Some(after)) => {
                let share = (ahead - before.ahead) / (after.ahead - before.ahead);
                (before.height + (after.height - before.height) * share, before.crest)
            }
            (Some(last), None) => (last.height, last.crest),
            (None, _) => (0.0, f64::INFINITY),
        }
    }
}

/// How far ahead the nearest ground lies that a frame of this many rows may show.
fn nearest(projection: &Projection, rows: usize) -> f64 {
    let ahead = projection.ahead_at(LEAST_DEPTH).max(NEAREST);
    projection.ground(rows as f64).map_or(ahead, |edge| ahead.min(edge.ahead))
}

fn depth_and_row(projection: &Projection, ahead: f64, height: f64) -> (f64, f64) {
    projection.depth_and_row(ahead, projection.height - height)
}

fn depth(projection: &Projection, sample: Sample) -> f64 {
    depth_and_row(projection, sample.ahead, sample.height).0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn terrain(heights: &[(f64, f64)], along: f64) -> (Terrain, Projection) {
        let projection = Projection::new(320, 160, crate::camera::MOUNTING);
        let path = Path::of((0..=400).map(|z| [0.0, f64::from(z)]).collect());
        let profile = Profile::of(heights);
        let mut terrain = Terrain::new(160);
        terrain.look(&projection, (&path, &profile), ([0.0, along], 0.0, along));
        (terrain, projection)
    }

    #[test]
    fn on_the_flat_rows_show_what_the_camera_says() {
        let (terrain, projection) = terrain(&[(0.0, 1.0), (400.0, 1.0)], 20.0);
        for y in 0..160 {
            let expected = projection.ground(y as f64 + 0.5);
            let Some(expected) = expected.filter(|row| row.ahead < END) else { continue };
            let strip = terrain.strip(y).unwrap();
            assert!((strip.ahead / expected.ahead - 1.0).abs() < 1e-6, "{y}: {strip:?} {expected:?}");
            assert!((strip.pixel_width / expected.pixel_width - 1.0).abs() < 1e-6, "{y}");
            // The ray falls by the camera's height over `pixel_width` times the focal length.
            let pixel_depth =
                expected.pixel_width * expected.pixel_width * projection.focal / projection.height;
            assert!((strip.pixel_depth / pixel_depth - 1.0).abs() < 1e-3, "{y}");
        }
        assert_eq!(terrain.strip(0), None);
    }

    #[test]
    fn a_constant_slope_looks_flat() {
        let (slope, _) = terrain(&[(0.0, 0.0), (400.0, 20.0)], 30.0);
        let (flat, _) = terrain(&[(0.0, 0.0), (400.0, 0.0)], 30.0);
        for y in 60..160 {
            let (a, b) = (slope.strip(y).unwrap(), flat.strip(y).unwrap());
            assert!((a.ahead / b.ahead - 1.0).abs() < 0.02, "{y}: {a:?} {b:?}");
        }
    }

    #[test]
    fn a_crest_hides_what_lies_behind_it() {
        // Up until 60 m, then down.
        let (terrain, _) = terrain(&[(0.0, 0.0), (60.0, 6.0), (120.0, 0.0), (400.0, 0.0)], 20.0);
        let distances: Vec<f64> = (0..160).filter_map(|y| terrain.strip(y)).map(|s| s.ahead).collect();
        assert!(distances.windows(2).all(|pair| pair[0] > pair[1]), "nearer ground is lower in the frame");
        assert!(!distances.iter().any(|d| (50.0..90.0).contains(d)), "{distances:?}");
        let (height, crest) = terrain.at(80.0);
        assert!(height < -5.0 && crest < 160.0, "{height} {crest}");
        // Before the crest nothing is hidden but by the ground it stands on.
        let (_, open) = terrain.at(10.0);
        assert!(open > crest);
    }
}
