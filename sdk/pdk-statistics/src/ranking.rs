//! Which points are better: domination under constraints, fronts, and crowding.

use std::cmp::Ordering;

use crate::point::Point;

/// Whether `a` is better than `b`: it violates the constraints less, or neither does and it is at least as good in every
/// objective and better in one.
///
/// Deb, "An efficient constraint handling method for genetic algorithms" (2000).
pub fn dominates(a: &Point, b: &Point) -> bool {
    if a.violation > 0.0 || b.violation > 0.0 {
        return a.violation < b.violation;
    }
    let mut better = false;
    for (mine, other) in a.f.iter().zip(&b.f) {
        if mine > other {
            return false;
        }
        better |= mine < other;
    }
    better
}

/// The places of points in fronts: those that nothing dominates, those that only they dominate, and so on, until at least
/// `wanted` points are in a front. Within a front the places ascend.
///
/// Deb, Pratap, Agarwal, Meyarivan, "A fast and elitist multiobjective genetic algorithm: NSGA-II" (2002).
pub fn fronts(points: &[&Point], wanted: usize) -> Vec<Vec<usize>> {
    let mut dominated: Vec<Vec<usize>> = vec![Vec::new(); points.len()];
    let mut dominators = vec![0usize; points.len()];
    for a in 0..points.len() {
        for b in a + 1..points.len() {
            if dominates(points[a], points[b]) {
                dominated[a].push(b);
                dominators[b] += 1;
            } else if dominates(points[b], points[a]) {
                dominated[b].push(a);
                dominators[a] += 1;
            }
        }
    }
    let mut fronts = Vec::new();
    let mut placed = 0;
    let mut front: Vec<usize> = (0..points.len()).filter(|&i| dominators[i] == 0).collect();
    while !front.is_empty() && placed < wanted {
        placed += front.len();
        let mut next = Vec::new();
        for &a in &front {
            for &b in &dominated[a] {
                dominators[b] -= 1;
                if dominators[b] == 0 {
                    next.push(b);
                }
            }
        }
        next.sort_unstable();
        fronts.push(std::mem::replace(&mut front, next));
    }
    fronts
}

/// How much room each point of a front has: the sum over the objectives of the gap between its neighbours, in shares of the
/// front's extent. The ends have infinite room, and a point that stands where an earlier one does has none.
pub fn crowding(points: &[&Point], front: &[usize]) -> Vec<f64> {
    let mut room = vec![0.0; front.len()];
    let mut distinct: Vec<usize> = Vec::new();
    for place in 0..front.len() {
        if distinct.iter().all(|&other| points[front[other]].f != points[front[place]].f) {
            distinct.push(place);
        }
    }
    let objectives = front.first().map_or(0, |&i| points[i].f.len());
    for m in 0..objectives {
        let value = |place: usize| points[front[place]].f.get(m).copied().unwrap_or(f64::INFINITY);
        let mut order = distinct.clone();
        order.sort_by(|&a, &b| value(a).total_cmp(&value(b)));
        let (Some(&first), Some(&last)) = (order.first(), order.last()) else { continue };
        let extent = value(last) - value(first);
        room[first] = f64::INFINITY;
        room[last] = f64::INFINITY;
        if extent > 0.0 && extent.is_finite() {
            for three in order.windows(3) {
                room[three[1]] += (value(three[2]) - value(three[0])) / extent;
            }
        }
    }
    room
}

/// A survivor with what selection looks at.
#[derive(Debug, Clone)]
pub struct Ranked {
    /// The point.
    pub point: Point,
    /// The number of its front.
    pub front: usize,
    /// Its room.
    pub room: f64,
}

impl Ranked {
    /// The better first: of an earlier front, and then with more room.
    pub fn order(&self, other: &Self) -> Ordering {
        self.front.cmp(&other.front).then(other.room.total_cmp(&self.room))
    }
}

/// The best `n` points: whole fronts, and of the last one those with the most room.
pub fn survivors(points: &[&Point], n: usize) -> Vec<Ranked> {
    let mut survivors = Vec::with_capacity(n);
    for (number, front) in fronts(points, n).into_iter().enumerate() {
        let room = crowding(points, &front);
        let ranked = |(&i, room): (&usize, f64)| Ranked { point: points[i].clone(), front: number, room };
        let mut ranked: Vec<Ranked> = front.iter().zip(room).map(ranked).collect();
        if survivors.len() + ranked.len() > n {
            // Stable: of equal ones the earlier survives.
            ranked.sort_by(Ranked::order);
            ranked.truncate(n - survivors.len());
        }
        survivors.append(&mut ranked);
    }
    survivors
}

/// As [`survivors`] of generation after generation, for this many points that comparing each with each takes too long.
pub fn survivors_of_many(points: &[&Point], n: usize) -> Vec<Ranked> {
    let mut best: Vec<Ranked> = Vec::new();
    for generation in points.chunks(2 * n.max(1)) {
        let all: Vec<&Point> =
            best.iter().map(|ranked| &ranked.point).chain(generation.iter().copied()).collect();
        best = survivors(&all, n);
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(f: &[f64], violation: f64) -> Point {
        Point { x: f.to_vec(), f: f.to_vec(), violation, critical: false }
    }

    #[test]
    fn fronts_are_those_that_only_the_earlier_ones_dominate() {
        let points = [
            point(&[1.0, 4.0], 0.0),
            point(&[2.0, 2.0], 0.0),
            point(&[2.0, 5.0], 0.0),
            point(&[4.0, 1.0], 0.0),
            point(&[5.0, 5.0], 0.0),
            point(&[0.0, 0.0], 1.0),
            point(&[0.0, 0.0], 0.5),
            Point { f: vec![], ..point(&[], f64::INFINITY) },
        ];
        let all: Vec<&Point> = points.iter().collect();
        let expected = [vec![0, 1, 3], vec![2], vec![4], vec![6], vec![5], vec![7]];
        assert_eq!(fronts(&all, 8), expected);
        assert_eq!(fronts(&all, 4), expected[..2]);
        assert!(!dominates(&points[0], &points[0]));
    }

    #[test]
    fn room_is_that_between_neighbours_and_a_copy_has_none() {
        let points = [[0.0, 4.0], [1.0, 2.0], [4.0, 0.0], [1.0, 2.0], [3.0, 1.0]].map(|f| point(&f, 0.0));
        let all: Vec<&Point> = points.iter().collect();
        let room = crowding(&all, &[0, 1, 2, 3, 4]);
        assert_eq!(room, [f64::INFINITY, 0.75 + 0.75, f64::INFINITY, 0.0, 0.75 + 0.5]);
        let kept: Vec<Vec<f64>> = survivors(&all, 3).into_iter().map(|ranked| ranked.point.f).collect();
        assert_eq!(kept, [[0.0, 4.0], [4.0, 0.0], [1.0, 2.0]]);
    }
}
