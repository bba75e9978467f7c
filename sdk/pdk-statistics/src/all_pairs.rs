//! Differences between all pairs of several conditions on the same roads, with one error rate for all of them together.

use crate::paired::rounded;
use crate::signs::Signs;

/// The quantile of the scales of all pairs that is added to each scale.
const OFFSET_QUANTILE: usize = 10;

/// Two of the conditions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// The place of the first, which comes before the second.
    pub first: usize,
    /// That of the second.
    pub second: usize,
    /// The p-value of their difference, adjusted for all pairs.
    pub p: f64,
}

/// A pair that differs on some road.
struct Candidate {
    pair: Pair,
    differences: Vec<f64>,
    scale: f64,
}

/// Compares each condition with each other one. `conditions` have one value a road, none if it was not driven; the roads are in
/// the same order. A pair is compared on the roads that have both; if it does not differ on any, p is 1.
///
/// If the pairs below some p are reported as different, the probability that any of them does not is at most that p. This is the
/// step-down procedure of the largest statistic: P. H. Westfall, S. S. Young, "Resampling-Based Multiple Testing" (1993), algorithm
/// 2.8, and J. P. Romano, M. Wolf, "Exact and Approximate Stepdown Methods for Multiple Hypothesis Testing" (2005). Where two
/// conditions do not differ, the sign of their difference on a road is chance, so signs are flipped: on a road those of all pairs at
/// once, so that pairs depend on each other as they do. The observed statistic of a pair is compared with the largest of it and of
/// all pairs that are less extreme.
///
/// The statistic is the sum of the differences by their scale, the root of the sum of their squares, which flipping does not change.
/// Few roads with few levels have many pairs with equal differences on all roads, which would be as extreme as possible however small
/// they are. So the tenth percentile of all scales is added to each, as in V. G. Tusher, R. Tibshirani, G. Chu, "Significance
/// analysis of microarrays" (2001).
pub fn all_pairs(conditions: &[Vec<Option<f64>>]) -> Vec<Pair> {
    let roads = conditions.iter().map(Vec::len).max().unwrap_or(0);
    let value = |place: usize, road: usize| conditions[place].get(road).copied().flatten();
    // A road on which fewer than two were driven says nothing; in a search that is all of them.
    let roads: Vec<usize> = (0..roads)
        .filter(|road| (0..conditions.len()).filter_map(|place| value(place, *road)).count() > 1)
        .collect();
    let (mut equal, mut candidates) = (Vec::new(), Vec::new());
    for second in 0..conditions.len() {
        for first in 0..second {
            let difference = |road: &usize| Some(rounded(value(first, *road)? - value(second, *road)?));
            let differences: Vec<f64> = roads.iter().map(|road| difference(road).unwrap_or(0.0)).collect();
            let scale = differences.iter().map(|difference| difference * difference).sum::<f64>().sqrt();
            let pair = Pair { first, second, p: 1.0 };
            match scale > 0.0 {
                true => candidates.push(Candidate { pair, differences, scale }),
                false => equal.push(pair),
            }
        }
    }
    let mut found = step_down(candidates, &Signs::of(roads.len()));
    found.extend(equal);
    found
}

/// The pairs with their adjusted p, the most extreme first.
fn step_down(candidates: Vec<Candidate>, signs: &Signs) -> Vec<Pair> {
    let mut scales: Vec<f64> = candidates.iter().map(|candidate| candidate.scale).collect();
    scales.sort_by(f64::total_cmp);
    let offset = scales.get(scales.len() / OFFSET_QUANTILE).copied().unwrap_or_default();
    let statistic =
        |candidate: &Candidate| candidate.differences.iter().sum::<f64>().abs() / (candidate.scale + offset);
    let mut ranked: Vec<(f64, Candidate)> =
        candidates.into_iter().map(|candidate| (statistic(&candidate), candidate)).collect();
    // From the least extreme.
    ranked.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let (mut largest, mut sums) = (vec![0.0_f64; signs.count()], Vec::new());
    let mut pairs: Vec<Pair> = ranked
        .into_iter()
        .map(|(observed, Candidate { pair, differences, scale })| {
            signs.sums(&differences, &mut sums);
            // What differs by rounding alone is equal.
            let (scale, observed) = (1.0 / (scale + offset), observed - 1e-9);
            let mut reached = 0_usize;
            for (largest, sum) in largest.iter_mut().zip(&sums) {
                *largest = largest.max(sum * scale);
                reached += usize::from(*largest >= observed);
            }
            Pair { p: reached as f64 / signs.count() as f64, ..pair }
        })
        .collect();
    pairs.reverse();
    // None has a smaller p than a pair that is more extreme.
    let mut least = 0.0_f64;
    for pair in &mut pairs {
        least = least.max(pair.p);
        pair.p = least;
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn p(found: &[Pair], first: usize, second: usize) -> f64 {
        found.iter().find(|pair| (pair.first, pair.second) == (first, second)).unwrap().p
    }

    fn some(values: &[f64]) -> Vec<Option<f64>> {
        values.iter().copied().map(Some).collect()
    }

    #[test]
    fn a_single_pair_has_the_p_of_the_randomisation_test() {
        let found = all_pairs(&[some(&[1.0; 8]), some(&[0.0; 8])]);
        assert_eq!(found, [Pair { first: 0, second: 1, p: 2.0 / 256.0 }]);
        // Of the sums of 1, 2, 3 and 4 with any signs, 4 of 16 are at least as large as 8.
        let found = all_pairs(&[some(&[0.1, 0.2, 0.3, 0.4]), some(&[0.2, 0.0, 0.0, 0.0])]);
        assert_eq!(p(&found, 0, 1), 4.0 / 16.0);
    }

    #[test]
    fn the_most_extreme_pair_is_compared_with_all_and_the_others_with_those_below_them() {
        // By hand: four roads, of which the first keeps its sign, so eight ways. The differences of 0 and 1 are 4, 4, 4, 4; of 1 and 2
        // they are 1, -1, 1, 1; of 0 and 2 they are 5, 3, 5, 5.
        let conditions =
            [some(&[5.0, 5.0, 5.0, 5.0]), some(&[1.0, 1.0, 1.0, 1.0]), some(&[0.0, 2.0, 0.0, 0.0])];
        let found = all_pairs(&conditions);
        let order: Vec<(usize, usize)> = found.iter().map(|pair| (pair.first, pair.second)).collect();
        assert_eq!(order, [(0, 2), (0, 1), (1, 2)]);
        // The offset is 2, the smallest scale. Observed are 18 of 11.165, 16 of 10 and 2 of 4; as far as 18 reaches no other way.
        assert_eq!(p(&found, 0, 2), 1.0 / 8.0);
        assert_eq!(p(&found, 0, 1), 1.0 / 8.0);
        // Sums of 1, -1, 1, 1 are 2 or more but where two signs fit: 4 or 2 in five of eight, 0 in three.
        assert_eq!(p(&found, 1, 2), 5.0 / 8.0);
    }

    #[test]
    fn roads_that_one_of_a_pair_lacks_do_not_count() {
        let full = all_pairs(&[some(&[1.0; 6]), some(&[0.0; 6])]);
        let mut longer = [some(&[1.0; 8]), some(&[0.0; 8])];
        (longer[0][6], longer[1][7]) = (None, None);
        assert_eq!(all_pairs(&longer), full);
        // Nothing in common, or nothing at all.
        assert_eq!(all_pairs(&[vec![Some(1.0), None], vec![None, Some(0.0)]])[0].p, 1.0);
        assert!(all_pairs(&[]).is_empty() && all_pairs(&[some(&[1.0])]).is_empty());
    }

    #[test]
    fn rounding_makes_no_difference() {
        let conditions = [some(&[0.6 - 0.4; 8]), some(&[0.2; 8]), some(&[0.1 + 0.2; 8])];
        let found = all_pairs(&conditions);
        assert_eq!((p(&found, 0, 1), p(&found, 0, 2)), (1.0, 2.0 / 256.0));
    }
}
