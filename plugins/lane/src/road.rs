//! The road: from what a scenario says to the centre line of the driven lane.
//!
//! It is written as [`pdk_road::read`] says; null stands for random angles. The vehicle starts on the centre line of the driven lane,
//! the right one of two.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, json};

use crate::crests;
use crate::ends;
use crate::profile::Profile;
use crate::section;
use pdk_road::{Path, Point, distance};

/// Largest angle of a random road in degrees: that of the published study.
const RANDOM_ANGLE: i32 = 35;
/// Shortest and longest road in metres.
const LENGTHS: (f64, f64) = (10.0, 5_000.0);
/// The path is divided into pieces of this length in metres; it departs from the true spline by less than a millimetre.
const STEP: f64 = 0.25;
/// Smallest radius of a bend in metres: the far edge of the road lies up to 6 m from the driven lane's centre.
const SMALLEST_RADIUS: f64 = 8.0;
// Roads that are made without a limit of their own can be driven: a little is lost between the waypoints.
const _: () = assert!(SMALLEST_RADIUS < pdk_road::SMALLEST_RADIUS);
/// Parts of the road farther apart along it than this must not come closer than the road is wide, in metres.
const CROSSING_SEPARATION: f64 = 30.0;

/// A road that has been checked.
#[derive(Debug, Clone)]
pub struct Road {
    /// The centre line of the driven lane as `[x, height, z]` in metres. A road made from these is the same road if neither
    /// straight ends nor crests are added to it again.
    pub waypoints: Vec<[f64; 3]>,
    /// The same line on the ground, finely divided.
    pub path: Path,
    /// Its heights.
    pub profile: Profile,
}

/// What a simulator makes of the roads that scenarios ask for.
#[derive(Debug, Clone, Copy)]
pub struct Layout {
    /// Length of the segments of a road that the scenario leaves to the simulator, in metres.
    pub segment: f64,
    /// Straight road before the scenario's own, and behind the last node of a road of angles, in metres.
    pub straight_ends: f64,
    /// How far the road goes up and down if its heights are all equal, in metres.
    pub crests: f64,
}

impl Default for Layout {
    /// As published: the road begins with its first angle, and is flat.
    fn default() -> Self {
        Self { segment: pdk_road::SEGMENT, straight_ends: 0.0, crests: 0.0 }
    }
}

impl Road {
    /// Makes the road of a scenario.
    ///
    /// # Errors
    /// If the road is not written as it has to be, or nothing that can be driven on: it bends too sharply, crosses
    /// itself, is too steep, too short or too long.
    pub fn new(road: &Value, seed: u64, layout: Layout) -> Result<Self> {
        let read = pdk_road::read_with_end(road, layout.straight_ends).map_err(Error::new)?;
        let Some(waypoints) = read else { return Self::random(seed, layout) };
        Self::from_waypoints(ends::with_start(waypoints, layout.straight_ends), layout.crests, seed)
    }

    /// A road with random angles that can be driven.
    fn random(seed: u64, layout: Layout) -> Result<Self> {
        let mut random = pdk_sdk::seed::key(seed, "lane road", 0).sequence();
        let mut refused = Error::new("no road was tried");
        for _ in 0..1000 {
            let angles = pdk_road::random_angles(&mut random, pdk_road::NODES, RANDOM_ANGLE);
            match Self::new(&json!({"angles": angles, "segment": layout.segment}), seed, layout) {
                Ok(road) => return Ok(road),
                Err(error) => refused = error,
            }
        }
        Err(refused.at(format!("seed {seed} gives no road that can be driven")))
    }

    /// The road whose node `i + 1` lies `lengths[i]` metres from the one before, turned by angle `i` in degrees, clockwise. The
    /// first node is 0 m high, the others have `heights` in metres; if there are none, the road is flat.
    ///
    /// # Errors
    /// As [`Road::new`].
    #[cfg(test)]
    pub fn from_angles(angles: &[f64], lengths: &[f64], heights: &[f64]) -> Result<Self> {
        Self::from_waypoints(pdk_road::with_heights(angles, lengths, heights).map_err(Error::new)?, 0.0, 0)
    }

    /// The road through these waypoints, with crests as [`crests::raised`] makes them.
    fn from_waypoints(waypoints: Vec<[f64; 3]>, swing: f64, seed: u64) -> Result<Self> {
        if waypoints.len() < 2 {
            return Err(Error::new(format!(
                "the road has {} waypoints, but needs at least 2",
                waypoints.len()
            )));
        }
        let points: Vec<Point> = waypoints.iter().map(|p| [p[0], p[2]]).collect();
        if let Some(i) = points.windows(2).position(|p| distance(p[0], p[1]) < 0.05) {
            return Err(Error::new(format!(
                "waypoints {i} and {} of the road are less than 5 cm apart: remove one of them",
                i + 1
            )));
        }
        // Measured before the path is divided, which would take memory in proportion.
        let length: f64 = points.windows(2).map(|p| distance(p[0], p[1])).sum();
        if !(LENGTHS.0..=LENGTHS.1).contains(&length) {
            return Err(Error::new(format!(
                "the road is {length:.1} m long, but has to be {} to {} m long",
                LENGTHS.0, LENGTHS.1
            )));
        }
        let path = Path::through(&points, STEP);
        check_bends(&path)?;
        check_crossings(&path)?;
        // Distance along the path of each waypoint, which does not depend on the heights.
        let places = path.places(points);
        let profile = |waypoints: &[[f64; 3]]| {
            let heights = waypoints.iter().map(|point| point[1]);
            Profile::of(&places.iter().copied().zip(heights).collect::<Vec<_>>())
        };
        let (waypoints, profile) = crests::raised(waypoints, swing, seed, profile);
        Ok(Self { waypoints, path, profile: profile.checked()? })
    }
}

/// Refuses bends that the far edge of the road could not follow.
fn check_bends(path: &Path) -> Result<()> {
    // Over 2 m to either side, so that waypoints rounded to centimetres do not count as bends.
    const REACH: f64 = 2.0;
    let steps = ((path.length() - 2.0 * REACH) / 0.5) as usize;
    for step in 0..=steps {
        let along = REACH + step as f64 * 0.5;
        let [a, b, c] = [along - REACH, along, along + REACH].map(|s| path.point_at(s));
        // Radius of the circle through three points: product of the sides over four times the area.
        let doubled_area = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
        let sides = distance(a, b) * distance(b, c) * distance(c, a);
        let turns_back = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) <= 0.0;
        if turns_back || sides < 2.0 * doubled_area * SMALLEST_RADIUS {
            return Err(Error::new(format!(
                "the road bends too sharply {along:.0} m after its start, near x {:.1}, z {:.1}: the radius of a bend has to be \
                 at least {SMALLEST_RADIUS} m",
                b[0], b[1]
            )));
        }
    }
    Ok(())
}

/// Refuses roads that cross or touch themselves.
fn check_crossings(path: &Path) -> Result<()> {
    const SPACING: f64 = 2.0;
    let centre: Vec<Point> = (0..=(path.length() / SPACING) as usize)
        .map(|i| path.beside(i as f64 * SPACING, section::ROAD_CENTRE))
        .collect();
    let separation = (CROSSING_SEPARATION / SPACING) as usize;
    let closest = 2.0 * section::PAVED_HALF_WIDTH + 0.5;
    for (i, &a) in centre.iter().enumerate() {
        for (j, &b) in centre.iter().enumerate().skip(i + separation) {
            let (dx, dz) = (b[0] - a[0], b[1] - a[1]);
            if dx * dx + dz * dz < closest * closest {
                return Err(Error::new(format!(
                    "the road crosses itself: {:.0} m and {:.0} m after its start it is at the same place, near x {:.1}, z {:.1}; \
                     choose smaller angles, or waypoints that stay apart",
                    i as f64 * SPACING,
                    j as f64 * SPACING,
                    a[0],
                    a[1]
                )));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(road: Value) -> String {
        Road::new(&road, 0, Layout::default()).unwrap_err().to_string()
    }

    #[test]
    fn eight_angles_make_the_published_road() {
        let road =
            Road::new(&json!({"angles": [0, 0, 10, -20, 35, 0, -35, 0]}), 0, Layout::default()).unwrap();
        assert_eq!(road.waypoints.len(), 134);
        assert_eq!(road.waypoints[0], [0.0, 0.0, 0.0]);
        // A little longer than its seven chords of 25 m.
        assert!((175.0..178.0).contains(&road.path.length()), "{}", road.path.length());
        let straight = Road::new(&json!({"angles": [0, 0, 0, 0, 0, 0, 0, 0]}), 0, Layout::default()).unwrap();
        assert!((straight.path.length() - 175.0).abs() < 1e-9);
    }

    /// So a user who makes a road with `pdk_road` can give its angles and lengths, in place of its waypoints.
    #[test]
    fn the_short_form_is_the_road_of_pdk_road() {
        let angles = [0.0, 12.5, -30.0, 20.0, 35.0];
        for (segment, lengths) in [
            (Value::Null, [25.0; 5]),
            (json!(17.5), [17.5; 5]),
            (json!([20, 35.5, 150, 30, 400]), [20.0, 35.5, 150.0, 30.0, 400.0]),
        ] {
            let mut road = json!({"angles": angles});
            if !segment.is_null() {
                road["segment"] = segment;
            }
            let road = Road::new(&road, 0, Layout::default()).unwrap();
            let expected = pdk_road::Road::from_angles(&angles, &lengths).unwrap();
            let waypoints: Vec<_> = expected.waypoints.iter().map(|&[x, z]| [x, 0.0, z]).collect();
            assert_eq!(road.waypoints, waypoints);
            let given = Road::new(&json!({"waypoints": waypoints}), 0, Layout::default()).unwrap();
            assert_eq!(road.path.points(), given.path.points());
            // Both measure along a curve, one in coarse pieces.
            assert!((road.path.length() / expected.length() - 1.0).abs() < 1e-3);
        }
    }

    #[test]
    fn heights_make_hills() {
        let angles = json!([0, 10, -10, 0, 0]);
        let road =
            Road::new(&json!({"angles": angles, "heights": [0, 2, 2, 0, 0]}), 0, Layout::default()).unwrap();
        assert!(!road.profile.is_flat() && (road.profile.height(60.0) - 2.0).abs() < 0.3);
        // Given as waypoints it is the same road.
        let again = Road::new(&json!({"waypoints": road.waypoints}), 3, Layout::default()).unwrap();
        for along in 0..100 {
            assert_eq!(road.profile.height(f64::from(along)), again.profile.height(f64::from(along)));
        }
        assert!(Road::new(&json!({"angles": angles}), 0, Layout::default()).unwrap().profile.is_flat());
    }

    #[test]
    fn positive_angles_turn_right() {
        let road = Road::new(&json!({"angles": [0, 20, 20, 0]}), 0, Layout::default()).unwrap();
        assert!(road.waypoints.last().unwrap()[0] > 5.0);
    }

    #[test]
    fn a_road_made_from_its_waypoints_is_the_same_road() {
        let road = Road::new(&Value::Null, 5, Layout::default()).unwrap();
        let again = Road::new(&json!({"waypoints": road.waypoints}), 99, Layout::default()).unwrap();
        assert_eq!(road.path.points(), again.path.points());
    }

    #[test]
    fn random_roads_depend_on_the_seed_alone() {
        let road = |seed| Road::new(&Value::Null, seed, Layout::default()).unwrap().waypoints;
        assert_eq!(road(1), road(1));
        assert_ne!(road(1), road(2));
        for seed in 0..200 {
            assert_eq!(road(seed).len(), 134);
        }
    }

    #[test]
    fn errors_name_what_is_wrong() {
        let long = "[1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18]";
        for (road, expected) in [
            (json!(3), "the road is 3, but has to be null or an object with `angles` or `waypoints`"),
            (
                json!({"angle": []}),
                "the road has an unknown key `angle`; it takes `angles`, `segment` and `heights`, or `waypoints`",
            ),
            (json!({}), "the road has neither `angles` nor `waypoints`; give one of them"),
            (
                json!({"angles": [0, 0], "waypoints": []}),
                "the road has both `angles` and `waypoints`; give one of them",
            ),
            (
                json!({"angles": 4}),
                "`angles` of the road is 4, but has to be a list of degrees, as in [0, 10, -20]",
            ),
            (json!({"angles": [0]}), "the road: a road needs 2 to 200 angles, but is given 1"),
            (
                json!({"angles": [0, "1"]}),
                "`angles` of the road is [0,\"1\"], but has to be a list of degrees, as in [0, 10, -20]",
            ),
            (json!({"angles": [0, 91]}), "the road: angle 2 is 91 degrees, but has to be from -90 to 90"),
            (
                json!({"angles": [0, 0], "segment": 0.5}),
                "the road: segment 1 is 0.5 m long, but has to be from 1 to 1000 m",
            ),
            (
                json!({"angles": [0, 0], "segment": [25]}),
                "the road: there are 1 segment lengths for 2 angles; give one length for each",
            ),
            (
                json!({"angles": [0, 0], "segment": [25, null]}),
                "`segment` of the road is [25,null], but has to be a length in metres, or a list with one for each angle",
            ),
            (
                json!({"waypoints": [[0, 0, 0], [1, 2]]}),
                "`waypoints` of the road has to be a list of points [x, height, z] in metres, and waypoint 1 is [1,2]",
            ),
            (json!({"waypoints": [[0, 0, 0]]}), "the road has 1 waypoints, but needs at least 2"),
            (
                json!({"waypoints": [[0, 0, 0], [0, 0, 0.01], [0, 0, 50]]}),
                "waypoints 0 and 1 of the road are less than 5 cm apart: remove one of them",
            ),
            (
                json!({"waypoints": [[0, 0, 0], [0, 0, 9]]}),
                "the road is 9.0 m long, but has to be 10 to 5000 m long",
            ),
            (
                json!({"waypoints": [[0, 0, 0], [1e9, 0, 0]]}),
                "waypoint 1 of the road is more than 100 km from the origin",
            ),
        ] {
            assert_eq!(error(road), expected);
        }
        assert!(error(json!({"waypoints": [[0, 0, 0], [0, 13, 50]]})).contains("a slope of 26.0 %"));
        let error_in_heights = error(json!({"angles": [0, 0, 0], "heights": [1, 2]}));
        assert!(
            error_in_heights.contains("is [1,2], but has to be a list of 3 heights"),
            "{error_in_heights}"
        );
        assert!(error(json!(long)).ends_with("`waypoints`") && error(json!(long)).contains("..."));
    }

    #[test]
    fn roads_that_cannot_be_driven_are_refused() {
        let sharp = error(json!({"waypoints": [[0, 0, 0], [0, 0, 50], [2, 0, 10]]}));
        assert!(sharp.starts_with("the road bends too sharply 49 m"), "{sharp}");
        assert!(error(json!({"angles": [0, 90, 90, 90, 0], "segment": 8})).contains("bends too sharply"));
        let circle: Vec<i32> = vec![40; 12];
        let crossing = error(json!({"angles": circle}));
        assert!(crossing.starts_with("the road crosses itself: "), "{crossing}");
    }

    #[test]
    fn a_road_with_as_many_angles_as_possible_has_straight_ends_too() {
        let straight = json!({"angles": vec![0; 200], "segment": 20});
        for straight_ends in [0.0, 1.0, 16.0] {
            let layout = Layout { straight_ends, ..Layout::default() };
            let road = Road::new(&straight, 0, layout).unwrap();
            let segments = if straight_ends > 0.0 { 200.0 } else { 199.0 };
            let expected = segments * 20.0 + straight_ends;
            assert!((road.path.length() - expected).abs() < 1e-6, "{}", road.path.length());
        }
        let refused = json!({"angles": vec![0; 201], "segment": 20});
        assert!(error(refused).contains("a road needs 2 to 200 angles, but is given 201"));
    }

    #[test]
    fn crests_of_any_height_can_be_driven() {
        for crests in [2.4, 4.0, 6.0] {
            for seed in 0..30 {
                let road = json!({"angles": [0, 10, -20, 15, 0, -10, 20, 0], "segment": 40});
                let road = Road::new(&road, seed, Layout { crests, ..Layout::default() }).unwrap();
                assert!(!road.profile.is_flat());
            }
        }
    }

    #[test]
    fn a_road_left_to_the_simulator_has_the_segments_that_are_set() {
        let layout = Layout { segment: 50.0, straight_ends: 32.0, crests: 2.0 };
        for seed in 0..30 {
            let road = Road::new(&Value::Null, seed, layout).unwrap();
            assert!((420.0..450.0).contains(&road.path.length()), "{}", road.path.length());
            assert!(!road.profile.is_flat());
        }
    }
}
