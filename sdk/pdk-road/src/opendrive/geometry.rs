//! The shapes of which a reference line consists.

use std::f64::consts::PI;

use crate::{Point, distance};

/// A piece of a reference line, in the axes of OpenDRIVE.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// Its start, in metres along the line.
    pub s: f64,
    /// The point where it begins.
    pub at: Point,
    /// The heading there in radians, counter-clockwise from x.
    pub heading: f64,
    /// Length in metres.
    pub length: f64,
    /// What it looks like.
    pub shape: Shape,
}

/// What a piece looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A straight line, or a circle: the curvature in 1/m, positive to the left.
    Arc(f64),
    /// A clothoid: the curvature at its beginning and at its end.
    Spiral(f64, f64),
    /// A cubic across the direction of its beginning: `v(u) = a + b u + c u^2 + d u^3`.
    Cubic([f64; 4]),
    /// Two cubics of one parameter, which runs from 0 to this range: along and across the direction of the beginning.
    Parametric([f64; 4], [f64; 4], f64),
}

/// The value of a cubic and its slope.
pub fn cubic([a, b, c, d]: [f64; 4], t: f64) -> (f64, f64) {
    (a + t * (b + t * (c + t * d)), b + t * (2.0 * c + t * 3.0 * d))
}

impl Piece {
    /// Point and heading this many metres along the line; beyond the ends those of the ends.
    pub fn at(&self, s: f64) -> (Point, f64) {
        let along = (s - self.s).clamp(0.0, self.length);
        let (u, v, turned) = match self.shape {
            Shape::Arc(curvature) => arc(curvature, along),
            Shape::Spiral(from, to) => spiral(from, (to - from) / self.length.max(1e-9), along),
            Shape::Cubic(v) => {
                let u = abscissa(v, along);
                let (value, slope) = cubic(v, u);
                (u, value, libm::atan(slope))
            }
            Shape::Parametric(u, v, range) => {
                let t = along / self.length.max(1e-9) * range;
                let ((u, du), (v, dv)) = (cubic(u, t), cubic(v, t));
                (u, v, libm::atan2(dv, du))
            }
        };
        let (sine, cosine) = (libm::sin(self.heading), libm::cos(self.heading));
        let [x, y] = self.at;
        ([x + cosine * u - sine * v, y + sine * u + cosine * v], self.heading + turned)
    }
}

/// Along, across and turned, on a circle that begins straight ahead.
fn arc(curvature: f64, along: f64) -> (f64, f64, f64) {
    let turned = curvature * along;
    if turned.abs() < 1e-9 {
        return (along, turned * along / 2.0, turned);
    }
    (libm::sin(turned) / curvature, (1.0 - libm::cos(turned)) / curvature, turned)
}

/// The same on a clothoid, in short steps by the midpoint rule.
fn spiral(curvature: f64, change: f64, along: f64) -> (f64, f64, f64) {
    let steps = (along / 0.1).ceil().max(1.0);
    let step = along / steps;
    let (mut u, mut v) = (0.0, 0.0);
    for i in 0..steps as u32 {
        let middle = (f64::from(i) + 0.5) * step;
        let turned = middle * (curvature + change * middle / 2.0);
        u += step * libm::cos(turned);
        v += step * libm::sin(turned);
    }
    (u, v, along * (curvature + change * along / 2.0))
}

/// How far along u the cubic is this many metres long.
fn abscissa(v: [f64; 4], along: f64) -> f64 {
    let (mut u, mut left) = (0.0, along);
    while left > 0.0 {
        let step = left.min(0.1);
        let slope = cubic(v, u + step / 2.0).1;
        u += step / (1.0 + slope * slope).sqrt();
        left -= 0.1;
    }
    u
}

/// Circles and straight lines along a curve of points, which they follow within `tolerance` metres: between two points that are as far
/// apart as that allows lie two arcs that touch both directions (a biarc). `headings` are those of the curve at the points.
pub fn arcs_along(points: &[Point], headings: &[f64], tolerance: f64) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::new();
    let (mut from, last) = (0, points.len() - 1);
    while from < last {
        let fits = |to: usize| {
            let pair = biarc([points[from], points[to]], [headings[from], headings[to]]);
            points[from..=to].iter().all(|point| off(&pair, *point) < tolerance).then_some(pair)
        };
        // As far as it fits: the step doubles until it does not, and halves from there.
        let mut reached =
            (from + 1, biarc([points[from], points[from + 1]], [headings[from], headings[from + 1]]));
        let (mut step, mut grows) = (1, true);
        while step > 0 && reached.0 < last {
            let to = (reached.0 + step).min(last);
            match fits(to) {
                Some(pair) => reached = (to, pair),
                None => grows = false,
            }
            step = if grows { step * 2 } else { step / 2 };
        }
        for mut piece in reached.1.into_iter().filter(|piece| piece.length > 1e-6) {
            piece.s = pieces.last().map_or(0.0, |before| before.s + before.length);
            pieces.push(piece);
        }
        from = reached.0;
    }
    pieces
}

/// Two arcs from one point and heading to another.
fn biarc([from, to]: [Point; 2], [start, end]: [f64; 2]) -> [Piece; 2] {
    let direction = |heading: f64| [libm::cos(heading), libm::sin(heading)];
    let ([ax, ay], [bx, by]) = (direction(start), direction(end));
    let [vx, vy] = [to[0] - from[0], to[1] - from[1]];
    let (along, square) = (vx * (ax + bx) + vy * (ay + by), vx * vx + vy * vy);
    // The reach of both tangents, which is the same: the positive root of a quadratic equation.
    let spread = 2.0 * (1.0 - (ax * bx + ay * by));
    let reach = square / (along + (along * along + spread * square).sqrt());
    let middle = [(from[0] + to[0] + reach * (ax - bx)) / 2.0, (from[1] + to[1] + reach * (ay - by)) / 2.0];
    let first = arc_to(from, start, middle);
    [first, arc_to(middle, first.at(first.length).1, to)]
}

/// The arc from a point and heading to another point.
fn arc_to(at: Point, heading: f64, to: Point) -> Piece {
    let chord = distance(at, to);
    let mut half = libm::atan2(to[1] - at[1], to[0] - at[0]) - heading;
    half -= 2.0 * PI * (half / (2.0 * PI)).round();
    // A turn that is not felt: over the chord it departs from it by nanometres.
    let straight = half.abs() < 1e-7 || chord == 0.0;
    let (curvature, length) = match straight {
        true => (0.0, chord),
        false => (2.0 * libm::sin(half) / chord, chord * half / libm::sin(half)),
    };
    Piece { s: 0.0, at, heading, length, shape: Shape::Arc(curvature) }
}

/// How far a point is from the nearer of two arcs, in metres.
fn off(pair: &[Piece; 2], point: Point) -> f64 {
    pair.iter().map(|piece| off_arc(piece, point)).fold(f64::INFINITY, f64::min)
}

fn off_arc(piece: &Piece, point: Point) -> f64 {
    let (sine, cosine) = (libm::sin(piece.heading), libm::cos(piece.heading));
    let [dx, dy] = [point[0] - piece.at[0], point[1] - piece.at[1]];
    let (u, v) = (cosine * dx + sine * dy, cosine * dy - sine * dx);
    match piece.shape {
        Shape::Arc(curvature) if curvature != 0.0 => {
            let (radius, up) = (1.0 / curvature, 1.0 / curvature - v);
            let turned = libm::atan2(u, up * curvature.signum());
            let within = (-1e-9..=piece.length * curvature.abs() + 1e-9).contains(&turned);
            if within { ((u * u + up * up).sqrt() - radius.abs()).abs() } else { f64::INFINITY }
        }
        _ => match (-1e-9..=piece.length + 1e-9).contains(&u) {
            true => v.abs(),
            false => f64::INFINITY,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(shape: Shape, length: f64) -> Piece {
        Piece { s: 5.0, at: [1.0, 2.0], heading: 0.5, length, shape }
    }

    #[test]
    fn every_shape_begins_where_it_says_and_is_as_long_as_it_says() {
        let curved = [0.0, 0.0, 0.01, 1e-4];
        for (shape, length) in [
            (Shape::Arc(0.0), 30.0),
            (Shape::Arc(-0.05), 40.0),
            (Shape::Spiral(-0.02, 0.08), 50.0),
            (Shape::Cubic(curved), 20.0),
            (Shape::Parametric([0.0, 20.0, 0.0, 0.0], [0.0, 0.0, 0.5, 0.0], 1.0), 20.0),
        ] {
            let piece = piece(shape, length);
            let (start, heading) = piece.at(5.0);
            assert!(distance(start, piece.at) < 1e-9 && (heading - 0.5).abs() < 1e-9, "{shape:?}");
            let (mut walked, mut before) = (0.0, start);
            for i in 1..=1000 {
                let (point, heading) = piece.at(5.0 + length * f64::from(i) / 1000.0);
                let step = distance(before, point);
                let direction = libm::atan2(point[1] - before[1], point[0] - before[0]);
                assert!((heading - direction).abs() < 0.01, "{shape:?} {i}");
                (walked, before) = (walked + step, point);
            }
            assert!((walked - length).abs() < 0.02, "{shape:?} {walked}");
        }
    }

    #[test]
    fn a_quarter_circle_ends_to_the_left() {
        let circle =
            Piece { at: [0.0, 0.0], heading: 0.0, s: 0.0, length: 10.0 * PI / 2.0, shape: Shape::Arc(0.1) };
        let (end, heading) = circle.at(circle.length);
        assert!(distance(end, [10.0, 10.0]) < 1e-9 && (heading - PI / 2.0).abs() < 1e-9);
    }

    #[test]
    fn arcs_follow_a_curve_closely_and_are_few() {
        let curve = |t: f64| [t, 8.0 * libm::sin(t / 15.0)];
        let points: Vec<Point> = (0..=800).map(|i| curve(f64::from(i) / 4.0)).collect();
        let headings: Vec<f64> =
            (0..=800).map(|i| libm::atan(8.0 / 15.0 * libm::cos(f64::from(i) / 60.0))).collect();
        let pieces = arcs_along(&points, &headings, 0.01);
        assert!(pieces.len() < 100, "{}", pieces.len());
        for pair in pieces.windows(2) {
            let (end, heading) = pair[0].at(pair[1].s);
            assert!(distance(end, pair[1].at) < 1e-6 && (heading - pair[1].heading).abs() < 1e-6);
        }
        for point in &points {
            let nearest = pieces.iter().map(|piece| off_arc(piece, *point)).fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.01, "{nearest}");
        }
        let straight: Vec<Point> = (0..=100).map(|i| [f64::from(i), 0.0]).collect();
        let line = arcs_along(&straight, &[0.0; 101], 0.01);
        assert!(line.len() <= 2 && line.iter().all(|piece| piece.shape == Shape::Arc(0.0)), "{line:?}");
    }
}
