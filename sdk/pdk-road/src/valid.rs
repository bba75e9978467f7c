//! Whether a road can be on a map: it stays inside, and does not cross itself.

use crate::{Point, Road, distance};

/// The part of the ground that a road may cover, in metres from its start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapBox {
    /// Smallest x and z.
    pub low: Point,
    /// Largest x and z.
    pub high: Point,
}

impl Default for MapBox {
    /// 250 x 250 m with the start in the middle of its width, 25 m from its lower edge: a straight road of the published
    /// length (175 m) fits, which it would not with the start in the centre.
    fn default() -> Self {
        Self { low: [-125.0, -25.0], high: [125.0, 225.0] }
    }
}

impl MapBox {
    /// The default one, grown as the segments of a road are longer on average than published ones: so a road of 50 m segments
    /// may cover twice the ground both ways.
    pub fn for_segments(lengths: &[f64]) -> Self {
        let mean = lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
        let scale = (mean / crate::SEGMENT).max(1.0);
        let Self { low, high } = Self::default();
        Self { low: low.map(|v| v * scale), high: high.map(|v| v * scale) }
    }
}

/// Refuses roads with a bend of a smaller radius than this, in metres along the line.
///
/// # Errors
/// Says where.
pub fn check_bends(road: &Road, radius: f64) -> Result<(), String> {
    // Over this many metres to either side, so that points rounded to centimetres do not count as bends.
    const REACH: f64 = 2.0;
    let line = &road.waypoints;
    let mut along = vec![0.0];
    for pair in line.windows(2) {
        along.push(along[along.len() - 1] + distance(pair[0], pair[1]));
    }
    for middle in 0..line.len() {
        // Waypoints lie on the line, which places between them need not.
        let before = along[..middle].iter().rposition(|place| along[middle] - place >= REACH);
        let after = along[middle..].iter().position(|place| place - along[middle] >= REACH);
        let (Some(before), Some(after)) = (before, after) else { continue };
        let [a, b, c] = [before, middle, middle + after].map(|i| line[i]);
        // Radius of the circle through three points: product of the sides over four times the area.
        let doubled_area = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
        if distance(a, b) * distance(b, c) * distance(c, a) < 2.0 * doubled_area * radius {
            return Err(format!(
                "the road bends more tightly than with a radius of {radius} m, {:.0} m after its start, near x {:.1}, z {:.1}",
                along[middle], b[0], b[1]
            ));
        }
    }
    Ok(())
}

/// Whether the road, `width` metres wide, lies within the map and its outline does not cross itself.
///
/// # Errors
/// Says where it does not.
pub fn check(road: &Road, width: f64, map: &MapBox) -> Result<(), String> {
    let [left, right] = edges(&road.waypoints, width / 2.0);
    let mut along = vec![0.0];
    for pair in road.waypoints.windows(2) {
        along.push(along[along.len() - 1] + distance(pair[0], pair[1]));
    }
    for edge in [&left, &right] {
        for (i, point) in edge.iter().enumerate() {
            if (0..2).any(|axis| !(map.low[axis]..=map.high[axis]).contains(&point[axis])) {
                return Err(format!(
                    "the road leaves the map {:.0} m after its start, near x {:.1}, z {:.1}: the map reaches from x {}, z {} \
                     to x {}, z {}",
                    along[i], point[0], point[1], map.low[0], map.low[1], map.high[0], map.high[1]
                ));
            }
        }
    }
    // The outline goes up the left edge and back down the right one.
    let outline: Vec<(usize, Point)> =
        left.into_iter().enumerate().chain(right.into_iter().enumerate().rev()).collect();
    let side = |i: usize| (outline[i], outline[(i + 1) % outline.len()]);
    for i in 0..outline.len() {
        let (from, to) = side(i);
        for j in i + 2..outline.len() {
            let (other_from, other_to) = side(j);
            let neighbours = i == 0 && j == outline.len() - 1;
            if !neighbours && cross([from.1, to.1], [other_from.1, other_to.1]) {
                return Err(format!(
                    "the road crosses itself {:.0} m and {:.0} m after its start, near x {:.1}, z {:.1}",
                    along[from.0.min(other_from.0)],
                    along[from.0.max(other_from.0)],
                    from.1[0],
                    from.1[1]
                ));
            }
        }
    }
    Ok(())
}

/// The left and the right edge of the road.
fn edges(line: &[Point], half_width: f64) -> [Vec<Point>; 2] {
    let normal = |i: usize| {
        let (a, b) = (line[i.saturating_sub(1)], line[(i + 1).min(line.len() - 1)]);
        let length = distance(a, b);
        [(b[1] - a[1]) / length * half_width, -(b[0] - a[0]) / length * half_width]
    };
    [-1.0, 1.0].map(|sign| {
        line.iter()
            .enumerate()
            .map(|(i, p)| {
                let n = normal(i);
                [p[0] + sign * n[0], p[1] + sign * n[1]]
            })
            .collect()
    })
}

/// Whether two line segments meet; parallel ones never do.
fn cross(a: [Point; 2], b: [Point; 2]) -> bool {
    let side = |line: [Point; 2], p: Point| {
        (line[1][0] - line[0][0]) * (p[1] - line[0][1]) - (line[1][1] - line[0][1]) * (p[0] - line[0][0])
    };
    let apart = |p: f64, q: f64| (p > 0.0 && q > 0.0) || (p < 0.0 && q < 0.0) || (p == 0.0 && q == 0.0);
    !apart(side(a, b[0]), side(a, b[1])) && !apart(side(b, a[0]), side(b, a[1]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{NODES, SEGMENT, random_angles};
    use pdk_seed::Key;
    use proptest::prelude::*;

    fn road(angles: &[f64], segment: f64) -> Road {
        Road::from_angles(angles, &vec![segment; angles.len()]).unwrap()
    }

    #[test]
    fn a_straight_road_is_valid_and_a_longer_one_leaves_the_map() {
        assert_eq!(check(&road(&[0.0; 8], SEGMENT), 8.0, &MapBox::default()), Ok(()));
        let error = check(&road(&[0.0; 12], SEGMENT), 8.0, &MapBox::default()).unwrap_err();
        assert!(error.starts_with("the road leaves the map 226 m after its start"), "{error}");
        // Longer segments need a larger map, shorter ones leave it as it is.
        assert_eq!(check(&road(&[0.0; 8], 50.0), 8.0, &MapBox::for_segments(&[50.0; 8])), Ok(()));
        assert!(check(&road(&[0.0; 8], 50.0), 8.0, &MapBox::default()).is_err());
        assert_eq!(MapBox::for_segments(&[10.0; 8]), MapBox::default());
    }

    #[test]
    fn crossings_and_bends_too_sharp_for_the_width_are_found() {
        let loop_road = road(&[0.0, 0.0, 80.0, 80.0, 80.0, 80.0, 0.0, 0.0], SEGMENT);
        let error = check(&loop_road, 8.0, &MapBox::default()).unwrap_err();
        assert!(error.starts_with("the road crosses itself"), "{error}");
        let sharp = road(&[0.0, 90.0, 90.0, 0.0], 4.0);
        assert!(check(&sharp, 8.0, &MapBox::default()).is_err());
        assert_eq!(check(&sharp, 0.5, &MapBox::default()), Ok(()));
    }

    #[test]
    fn most_random_roads_of_the_study_are_valid() {
        let valid = (0..=255)
            .map(|seed| road(&random_angles(&mut Key([seed; 32]).sequence(), NODES, 35), SEGMENT))
            .filter(|road| check(road, 8.0, &MapBox::default()).is_ok())
            .count();
        assert!((200..256).contains(&valid), "{valid} of 256");
    }

    #[test]
    fn bends_have_the_radius_of_their_circle() {
        // A circle of 20 m, as waypoints.
        let waypoints = (0..60)
            .map(|i| f64::from(i) / 15.0)
            .map(|t| [20.0 - 20.0 * libm::cos(t), 20.0 * libm::sin(t)])
            .collect();
        let circle = Road { nodes: Vec::new(), angles: Vec::new(), waypoints };
        assert_eq!(check_bends(&circle, 19.8), Ok(()));
        let error = check_bends(&circle, 20.2).unwrap_err();
        assert!(error.contains("a radius of 20.2 m"), "{error}");
        assert_eq!(check_bends(&road(&[0.0; 8], SEGMENT), 1000.0), Ok(()));
        assert!(check_bends(&road(&[0.0, 90.0, 0.0, 0.0], SEGMENT), 8.0).is_err());
    }

    proptest! {
        /// Against another way to say it: parts of a valid road's centre line that are far apart along it stay apart.
        #[test]
        fn valid_roads_stay_apart_from_themselves(seed in 0u8..=255, limit in 0i32..=90) {
            let angles = random_angles(&mut Key([seed; 32]).sequence(), NODES, limit);
            let road = road(&angles, SEGMENT);
            if check(&road, 8.0, &MapBox::default()).is_ok() {
                for (i, &a) in road.waypoints.iter().enumerate() {
                    prop_assert!(a[0].abs() <= 125.0 && (-25.0..=225.0).contains(&a[1]));
                    for &b in road.waypoints.iter().skip(i + 40) {
                        prop_assert!(distance(a, b) > 3.9, "{:?} {:?}", a, b);
                    }
                }
            }
        }
    }
}
