//! Curves through nodes: the centripetal Catmull-Rom spline of the waypoints, and the cubic spline whose curvature counts.

use crate::{Point, distance};

/// The waypoints through all nodes but the first and the last, which only shape the ends: `per_segment` points from each
/// node to the next, both included, joints not repeated.
///
/// Barry and Goldman, "A recursive evaluation algorithm for a class of Catmull-Rom splines" (1988), alpha 0.5.
pub fn catmull_rom(nodes: &[Point], per_segment: usize) -> Vec<Point> {
    let mut points = Vec::with_capacity(nodes.len().saturating_sub(3) * (per_segment - 1) + 1);
    for (segment, window) in nodes.windows(4).enumerate() {
        let p = [window[0], window[1], window[2], window[3]];
        let mut t = [0.0; 4];
        for i in 0..3 {
            t[i + 1] = t[i] + distance(p[i], p[i + 1]).sqrt();
        }
        for step in usize::from(segment > 0)..per_segment {
            let at = t[1] + (t[2] - t[1]) * step as f64 / (per_segment - 1) as f64;
            let between = |a: Point, b: Point, from: f64, to: f64| {
                let share = (at - from) / (to - from);
                [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share]
            };
            let a = [0, 1, 2].map(|i| between(p[i], p[i + 1], t[i], t[i + 1]));
            let b = [between(a[0], a[1], t[0], t[2]), between(a[1], a[2], t[1], t[3])];
            points.push(between(b[0], b[1], t[1], t[2]));
        }
    }
    points
}

/// Mean absolute curvature over the nodes in 1/m, of the cubic spline that interpolates them.
///
/// The spline's parameter is the chord length from node to node. Its ends are "not a knot": the first two pieces are one
/// cubic, and so are the last two, so that a circle has its curvature at the ends too. With three nodes it is a parabola,
/// with fewer a line.
pub fn mean_curvature(nodes: &[Point]) -> f64 {
    if nodes.len() < 3 {
        return 0.0;
    }
    let h: Vec<f64> = nodes.windows(2).map(|pair| distance(pair[0], pair[1])).collect();
    let [x, z] = [0, 1].map(|axis| derivatives(&nodes.iter().map(|node| node[axis]).collect::<Vec<_>>(), &h));
    let curvature = |i: usize| {
        let ([dx, ddx], [dz, ddz]) = (x[i], z[i]);
        let speed = dx * dx + dz * dz;
        (dx * ddz - dz * ddx).abs() / (speed * speed.sqrt())
    };
    (0..nodes.len()).map(curvature).sum::<f64>() / nodes.len() as f64
}

/// First and second derivative of the interpolating spline at each of at least 3 values, `h` apart.
fn derivatives(values: &[f64], h: &[f64]) -> Vec<[f64; 2]> {
    let last = values.len() - 1;
    let slope: Vec<f64> = (0..last).map(|i| (values[i + 1] - values[i]) / h[i]).collect();
    let mut second = vec![0.0; last + 1];
    if last == 2 {
        second.fill(2.0 * (slope[1] - slope[0]) / (h[0] + h[1]));
    } else {
        // One row for each inner node: below, diagonal, above, right-hand side. The second derivatives at the ends are
        // linear in those of the two next nodes and are put into the first and last row.
        let mut rows: Vec<[f64; 4]> = (1..last)
            .map(|i| [h[i - 1], 2.0 * (h[i - 1] + h[i]), h[i], 6.0 * (slope[i] - slope[i - 1])])
            .collect();
        let (first_ratio, last_ratio) = (h[0] / h[1], h[last - 1] / h[last - 2]);
        rows[0][1] += h[0] * (1.0 + first_ratio);
        rows[0][2] -= h[0] * first_ratio;
        let end = rows.len() - 1;
        rows[end][1] += h[last - 1] * (1.0 + last_ratio);
        rows[end][0] -= h[last - 1] * last_ratio;
        for i in 1..rows.len() {
            let factor = rows[i][0] / rows[i - 1][1];
            rows[i][1] -= factor * rows[i - 1][2];
            rows[i][3] -= factor * rows[i - 1][3];
        }
        for i in (0..rows.len()).rev() {
            let above = if i == end { 0.0 } else { rows[i][2] * second[i + 2] };
            second[i + 1] = (rows[i][3] - above) / rows[i][1];
        }
        second[0] = second[1] - first_ratio * (second[2] - second[1]);
        second[last] = second[last - 1] + last_ratio * (second[last - 1] - second[last - 2]);
    }
    (0..=last)
        .map(|i| {
            let first = if i < last {
                slope[i] - h[i] * (2.0 * second[i] + second[i + 1]) / 6.0
            } else {
                slope[i - 1] + h[i - 1] * (second[i - 1] + 2.0 * second[i]) / 6.0
            };
            [first, second[i]]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_cubic_is_interpolated_exactly() {
        let h = [1.0, 0.5, 2.0, 1.5];
        let mut t = 0.0;
        let mut at = vec![t];
        for step in h {
            t += step;
            at.push(t);
        }
        let values: Vec<f64> = at.iter().map(|t| 2.0 + t - 3.0 * t * t + 0.5 * t * t * t).collect();
        for (t, [first, second]) in at.iter().zip(derivatives(&values, &h)) {
            assert!((first - (1.0 - 6.0 * t + 1.5 * t * t)).abs() < 1e-9, "{t} {first}");
            assert!((second - (3.0 * t - 6.0)).abs() < 1e-9, "{t} {second}");
        }
    }

    proptest! {
        #[test]
        fn a_circle_has_the_curvature_of_its_radius(radius in 5.0f64..500.0, nodes in 5usize..30) {
            let circle: Vec<Point> = (0..nodes)
                .map(|i| 0.25 * i as f64)
                .map(|angle| [radius * libm::cos(angle), radius * libm::sin(angle)])
                .collect();
            let curvature = mean_curvature(&circle);
            prop_assert!((curvature * radius - 1.0).abs() < 0.02, "{} {}", curvature, 1.0 / radius);
        }
    }
}
