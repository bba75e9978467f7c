//! Places that are better than what lies around them: where else a search may find something.

use pdk_statistics::point::Point;

use crate::domain::Domain;

/// The most places that are followed at the same time.
const PLACES: usize = 4;
/// How far these are from each other: see [`Space::distance`](pdk_sdk::prelude::Space::distance).
const APART: f64 = 0.15;
/// Nothing better is among this many points next to such a place.
const NEIGHBORS: usize = 8;
/// This many points are looked at, the best ones.
const LOOKED_AT: usize = 400;
/// How far around a place a search looks, in shares of each variable's range.
pub const NEARBY: f64 = 0.15;

/// Results that are not critical, and better than all that lie next to them, so that the way down from there leads somewhere else than
/// to the regions that are known; far from each other, and not yet searched enough. They are the best such results by the first of
/// several measures, by the second, and so on in turn, because what is critical may show in one of them alone. A measure has a
/// number for each result, smaller is better.
///
/// A. Törn, S. Viitanen, "Topographical global optimization" (1992).
pub fn promising(domain: &Domain, told: &[Point], measures: &[Vec<f64>], enough: usize) -> Vec<usize> {
    let space = domain.space();
    let evaluated: Vec<usize> =
        (0..told.len()).filter(|&place| !told[place].f.is_empty() && told[place].violation <= 0.0).collect();
    let mut orders: Vec<_> = measures
        .iter()
        .map(|values| {
            let mut order: Vec<usize> =
                evaluated.iter().copied().filter(|&place| !told[place].critical).collect();
            order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
            order.truncate(LOOKED_AT);
            (values, order.into_iter())
        })
        .collect();
    let mut distances: Vec<(f64, usize)> = Vec::with_capacity(evaluated.len());
    let mut leads_elsewhere = |place: usize, values: &[f64]| {
        distances.clear();
        let others = evaluated.iter().filter(|&&other| other != place);
        distances.extend(others.map(|&other| (space.distance(&told[place].x, &told[other].x), other)));
        if distances.iter().filter(|(distance, _)| *distance < NEARBY).count() >= enough {
            return false;
        }
        let next = NEIGHBORS.min(distances.len());
        if next == 0 {
            return true;
        }
        distances.select_nth_unstable_by(next - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let next = &distances[..next];
        // If all are equal, nothing leads anywhere.
        next.iter().all(|&(_, other)| !told[other].critical && values[other] >= values[place])
            && next.iter().any(|&(_, other)| values[other] > values[place])
    };
    let mut places: Vec<usize> = Vec::new();
    for turn in 0..PLACES {
        let Some((values, order)) = orders.get_mut(turn % measures.len().max(1)) else { break };
        let far =
            |place: usize| places.iter().all(|&other| space.distance(&told[place].x, &told[other].x) > APART);
        let found = order.find(|&place| far(place) && leads_elsewhere(place, values));
        places.extend(found);
    }
    places
}

/// The objectives of results as measures; one that is missing is the worst.
pub fn objectives(told: &[Point]) -> Vec<Vec<f64>> {
    let count = told.iter().map(|point| point.f.len()).max().unwrap_or_default();
    let values =
        |m: usize| told.iter().map(|point| point.f.get(m).copied().unwrap_or(f64::INFINITY)).collect();
    (0..count).map(values).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::reals;

    #[test]
    fn places_are_the_bottoms_of_valleys_that_hold_nothing_critical() {
        let domain = Domain::new(&reals(2));
        let middles = [[0.2, 0.2], [0.8, 0.7], [0.2, 0.8]];
        let told: Vec<Point> = (0..41 * 41)
            .map(|place| {
                let x = vec![f64::from(place % 41) / 40.0, f64::from(place / 41) / 40.0];
                let far = |middle: &[f64; 2]| {
                    libm::sqrt(middle.iter().zip(&x).map(|(m, x)| (x - m) * (x - m)).sum::<f64>())
                };
                let [first, second, third] = [0, 1, 2].map(|i| far(&middles[i]));
                // The third is critical at its bottom; beyond all of them it is flat.
                let value = first.min(second).min(third).min(0.25);
                Point { x, f: vec![value], violation: 0.0, critical: third < 0.1 }
            })
            .collect();
        let places = promising(&domain, &told, &objectives(&told), 2000);
        assert_eq!(places.len(), 2, "{places:?}");
        for middle in &middles[..2] {
            let near = |&place: &usize| domain.space().distance(&told[place].x, middle) < 0.06;
            assert_eq!(places.iter().filter(|place| near(place)).count(), 1);
        }
        // Searched enough.
        assert!(promising(&domain, &told, &objectives(&told), 2).is_empty());
    }
}
