//! Curves on the ground: splines through points, and positions relative to them.

use crate::{Point, distance};

/// The point at `share` (0 to 1) of the way from `p[1]` to `p[2]` on a centripetal Catmull-Rom spline (alpha 0.5).
///
/// Barry and Goldman, "A recursive evaluation algorithm for a class of Catmull-Rom splines" (1988). The points have to
/// be apart from each other.
pub fn catmull_rom(p: [Point; 4], share: f64) -> Point {
    let mut knots = [0.0; 4];
    for i in 0..3 {
        knots[i + 1] = knots[i] + distance(p[i], p[i + 1]).sqrt();
    }
    let t = knots[1] + share * (knots[2] - knots[1]);
    let mut points = p;
    // Level 1 joins neighbours, level 2 pairs, and the last level the two middle curves.
    for level in 1..=3usize {
        for i in 0..4 - level {
            let (from, to) = match level {
                3 => (knots[1], knots[2]),
                _ => (knots[i], knots[i + level]),
            };
            let weight = (t - from) / (to - from);
            let [[x, z], [next_x, next_z]] = [points[i], points[i + 1]];
            points[i] = [x + (next_x - x) * weight, z + (next_z - z) * weight];
        }
    }
    points[0]
}

/// A finely divided curve, measured along its length.
#[derive(Debug, Clone)]
pub struct Path {
    points: Vec<Point>,
    /// Distance of each point from the start.
    along: Vec<f64>,
}

/// A position relative to a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Located {
    /// The number of the path's segment nearest to the position.
    pub segment: usize,
    /// Distance along the path in metres.
    pub along: f64,
    /// Signed distance from the path in metres, positive to the right. Beyond the ends it is measured to the straight
    /// continuation of the path.
    pub lateral: f64,
    /// Distance from the path itself in metres; larger than `lateral` beyond the ends.
    pub distance: f64,
}

impl Path {
    /// The centripetal Catmull-Rom spline through all waypoints, in pieces of at most `step` metres.
    pub fn through(waypoints: &[Point], step: f64) -> Self {
        let last = waypoints.len() - 1;
        let mirrored = |at: Point, from: Point| [2.0 * at[0] - from[0], 2.0 * at[1] - from[1]];
        let mut points = vec![waypoints[0]];
        for i in 0..last {
            let before = if i == 0 { mirrored(waypoints[0], waypoints[1]) } else { waypoints[i - 1] };
            let after =
                if i + 1 == last { mirrored(waypoints[last], waypoints[last - 1]) } else { waypoints[i + 2] };
            let pieces = (distance(waypoints[i], waypoints[i + 1]) / step).ceil().max(1.0) as usize;
            for piece in 1..=pieces {
                let share = piece as f64 / pieces as f64;
                points.push(catmull_rom([before, waypoints[i], waypoints[i + 1], after], share));
            }
        }
        Self::of(points)
    }

    /// The path along these points.
    pub fn of(points: Vec<Point>) -> Self {
        let mut along = Vec::with_capacity(points.len());
        let mut total = 0.0;
        for (i, &point) in points.iter().enumerate() {
            if i > 0 {
                total += distance(points[i - 1], point);
            }
            along.push(total);
        }
        Self { points, along }
    }

    /// All points.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Distance of a point from the start in metres.
    pub fn along(&self, point: usize) -> f64 {
        self.along[point.min(self.along.len() - 1)]
    }

    /// Number of segments.
    pub fn segments(&self) -> usize {
        self.points.len() - 1
    }

    /// Length in metres.
    pub fn length(&self) -> f64 {
        self.along.last().copied().unwrap_or_default()
    }

    /// Distance from the start in metres of each of these points, which are points of the path in its order.
    pub fn places(&self, points: impl IntoIterator<Item = Point>) -> Vec<f64> {
        let mut segment = 0;
        let mut place = |point: Point| {
            // Found by going on from the one before.
            while segment < self.segments() && distance(self.points[segment], point) > 1e-9 {
                segment += 1;
            }
            self.along(segment)
        };
        points.into_iter().map(&mut place).collect()
    }

    /// The segment that contains the point `along` metres from the start.
    pub fn segment_at(&self, along: f64) -> usize {
        self.along.partition_point(|&a| a <= along).saturating_sub(1).min(self.segments() - 1)
    }

    /// The point `along` metres from the start, on the straight continuation beyond the ends.
    pub fn point_at(&self, along: f64) -> Point {
        let segment = self.segment_at(along);
        let [a, b] = [self.points[segment], self.points[segment + 1]];
        let share = (along - self.along[segment]) / (self.along[segment + 1] - self.along[segment]);
        [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share]
    }

    /// The unit vector along a segment.
    pub fn direction(&self, segment: usize) -> Point {
        let [a, b] = [self.points[segment], self.points[segment + 1]];
        let length = distance(a, b);
        [(b[0] - a[0]) / length, (b[1] - a[1]) / length]
    }

    /// The point `along` metres from the start, moved by `lateral` metres to the right.
    pub fn beside(&self, along: f64, lateral: f64) -> Point {
        let [x, z] = self.point_at(along);
        let [dx, dz] = self.direction(self.segment_at(along));
        [x + dz * lateral, z - dx * lateral]
    }

    /// The place on the path nearest to `point` among the segments `from..to`.
    pub fn locate(&self, point: Point, from: usize, to: usize) -> Located {
        let to = to.min(self.segments());
        let from = from.min(to - 1);
        let mut best = (f64::INFINITY, from, 0.0);
        for segment in from..to {
            let [a, b] = [self.points[segment], self.points[segment + 1]];
            let (dx, dz) = (b[0] - a[0], b[1] - a[1]);
            let (px, pz) = (point[0] - a[0], point[1] - a[1]);
            let share = ((px * dx + pz * dz) / (dx * dx + dz * dz)).clamp(0.0, 1.0);
            let (ex, ez) = (px - share * dx, pz - share * dz);
            let squared = ex * ex + ez * ez;
            if squared < best.0 {
                best = (squared, segment, share);
            }
        }
        let (squared, segment, share) = best;
        let a = self.points[segment];
        let [dx, dz] = self.direction(segment);
        let side = (point[0] - a[0]) * dz - (point[1] - a[1]) * dx;
        let distance = squared.sqrt();
        let at_an_end = (segment == 0 && share == 0.0) || (segment + 1 == self.segments() && share == 1.0);
        // At the outside of a bend the nearest place is a corner between two segments: there the distance counts.
        let lateral = if at_an_end { side } else { distance.copysign(side) };
        let along = self.along[segment] + share * (self.along[segment + 1] - self.along[segment]);
        Located { segment, along, lateral, distance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spline_passes_through_its_nodes_and_keeps_straight_lines_straight() {
        let p = [[0.0, -25.0], [0.0, 0.0], [3.0, 24.0], [10.0, 45.0]];
        assert_eq!(catmull_rom(p, 0.0), p[1]);
        let end = catmull_rom(p, 1.0);
        assert!(distance(end, p[2]) < 1e-12);
        let straight = Path::through(&[[0.0, 0.0], [0.0, 25.0], [0.0, 50.0]], 0.25);
        assert_eq!(straight.length(), 50.0);
        for (i, point) in straight.points().iter().enumerate() {
            assert!(point[0] == 0.0 && (point[1] - 0.25 * i as f64).abs() < 1e-9, "{i} {point:?}");
        }
    }

    #[test]
    fn lateral_is_positive_to_the_right_whatever_the_direction() {
        let north = Path::of(vec![[0.0, 0.0], [0.0, 10.0]]);
        assert_eq!(north.locate([1.5, 5.0], 0, 1).lateral, 1.5);
        assert_eq!(north.locate([-1.5, 5.0], 0, 1).lateral, -1.5);
        let west = Path::of(vec![[0.0, 0.0], [-10.0, 0.0]]);
        let located = west.locate([-4.0, 2.0], 0, 1);
        assert_eq!((located.along, located.lateral), (4.0, 2.0));
        assert_eq!(west.beside(4.0, 2.0), [-4.0, 2.0]);
        let beyond = north.locate([3.0, 14.0], 0, 1);
        assert_eq!((beyond.along, beyond.lateral, beyond.distance), (10.0, 3.0, 5.0));
    }
}
