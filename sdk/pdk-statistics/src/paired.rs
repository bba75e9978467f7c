//! Differences between two conditions that were driven on the same roads: a perturbation and a clear view, or two drivers.

use serde::Serialize;

use crate::estimate::Estimate;
use crate::mean;
use crate::signs::Signs;

/// Differences that are smaller than this are rounding: values are shares, metres and the like.
const ROUNDING: f64 = 1e-9;

/// The difference between two conditions on the same roads.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Paired {
    /// The mean over roads of the first minus the second.
    pub difference: Estimate,
    /// The matched-pairs rank-biserial correlation: how much of the evidence of the roads points upwards, less that which points
    /// downwards, from -1 to 1. D. S. Kerby, "The simple difference formula" (2014).
    pub effect_size: f64,
    /// How likely a mean difference of this size or more is if the conditions do not differ: a randomisation test that exchanges the
    /// conditions on each road. It is the mid-p-value, which counts differences of exactly this size half: H. O. Lancaster,
    /// "Significance tests in discrete distributions" (1961). It is 1 if no road
    /// differs. It is for this comparison alone, and not adjusted for others.
    pub p: f64,
    /// Roads that have both.
    pub roads: usize,
}

/// Compares two conditions, of which there is one value a road, none if it was not driven; the roads are in the same order.
/// `range` is what a value can be, infinite if it has no end. None if no road has both.
pub fn compare(a: &[Option<f64>], b: &[Option<f64>], range: (f64, f64), confidence: f64) -> Option<Paired> {
    let differences: Vec<f64> = a.iter().zip(b).filter_map(|(a, b)| Some(rounded((*a)? - (*b)?))).collect();
    if differences.is_empty() {
        return None;
    }
    let width = range.1 - range.0;
    Some(Paired {
        difference: mean::interval(&differences, (-width, width), confidence),
        effect_size: rank_biserial(&differences),
        p: randomisation_test(&differences),
        roads: differences.len(),
    })
}

/// A difference without its rounding errors. Shares such as 3 of 5 are not exact; what differs by rounding alone has to be equal, in sums
/// and in ranks.
pub(crate) fn rounded(difference: f64) -> f64 {
    (difference / ROUNDING).round() * ROUNDING
}

/// The matched-pairs rank-biserial correlation of differences: see [`Paired::effect_size`]. Differences that are rounding count as zero.
pub fn effect_size(differences: &[f64]) -> f64 {
    rank_biserial(&differences.iter().copied().map(rounded).collect::<Vec<_>>())
}

/// Sums of ranks of the sizes, by sign; equal sizes share their mean rank, and those of zero say nothing.
fn rank_biserial(differences: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = differences.iter().copied().filter(|difference| *difference != 0.0).collect();
    sizes.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let (mut up, mut all, mut before) = (0.0, 0.0, 0.0);
    for tied in sizes.chunk_by(|a, b| a.abs() == b.abs()) {
        let count = tied.len() as f64;
        let rank = before + (count + 1.0) / 2.0;
        up += rank * tied.iter().filter(|difference| **difference > 0.0).count() as f64;
        all += rank * count;
        before += count;
    }
    if all == 0.0 { 0.0 } else { (2.0 * up - all) / all }
}

fn randomisation_test(differences: &[f64]) -> f64 {
    if differences.iter().all(|difference| *difference == 0.0) {
        return 1.0;
    }
    let signs = Signs::of(differences.len());
    let mut sums = Vec::new();
    signs.sums(differences, &mut sums);
    let observed = sums[0];
    // What differs by rounding alone is equal.
    let margin = 1e-9 * differences.iter().map(|difference| difference.abs()).sum::<f64>();
    let larger = sums.iter().filter(|sum| **sum > observed + margin).count();
    let equal = sums.iter().filter(|sum| (**sum - observed).abs() <= margin).count();
    (larger as f64 + 0.5 * equal as f64) / signs.count() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHARE: (f64, f64) = (0.0, 1.0);

    fn of(a: &[f64], b: &[f64]) -> Paired {
        let some = |values: &[f64]| values.iter().copied().map(Some).collect::<Vec<_>>();
        compare(&some(a), &some(b), SHARE, 0.95).unwrap()
    }

    #[test]
    fn an_effect_on_every_road_is_distinguished_from_chance() {
        let all = of(&[1.0; 10], &[0.0; 10]);
        assert_eq!((all.difference.value, all.effect_size), (1.0, 1.0));
        // Of 1024 ways to exchange, two are as extreme and none is more so.
        assert!((all.p - 1.0 / 1024.0).abs() < 1e-12 && all.difference.low > 0.4, "{all:?}");
        let none = of(&[0.0; 10], &[0.0; 10]);
        assert_eq!((none.difference.value, none.effect_size, none.p), (0.0, 0.0, 1.0));
        assert!(none.difference.low < 0.0 && none.difference.high > 0.0);
    }

    #[test]
    fn ranks_and_signs_are_those_of_the_textbook() {
        // Sizes 1, 2, 2, 4 have ranks 1, 2.5, 2.5, 4; upwards are 2.5 and 4.
        let found = of(&[0.0, 0.2, 0.0, 0.4, 0.5], &[0.1, 0.0, 0.2, 0.0, 0.5]);
        assert!((found.effect_size - (6.5 - 3.5) / 10.0).abs() < 1e-12, "{found:?}");
        assert_eq!(effect_size(&[-0.1, 0.2, -0.2, 0.4, 1e-12]), found.effect_size);
        assert_eq!(found.roads, 5);
    }

    #[test]
    fn rounding_makes_no_difference() {
        let found = of(&[0.6, 0.2], &[0.4, 0.4]);
        assert_eq!((found.difference.value, found.effect_size), (0.0, 0.0));
        let (a, b): (Vec<f64>, Vec<f64>) =
            (0..10).map(|road| if road % 2 == 0 { (0.6, 0.4) } else { (0.4, 0.2) }).unzip();
        assert_eq!(of(&a, &b), of(&[0.4; 10], &[0.2; 10]));
        assert_eq!(of(&[(0.2 + 0.4) / 2.0], &[0.3]).effect_size, 0.0);
    }

    #[test]
    fn a_road_that_misses_one_does_not_count() {
        let found =
            compare(&[Some(1.0), None, Some(0.5)], &[Some(0.5), Some(0.0), None], SHARE, 0.95).unwrap();
        assert_eq!((found.roads, found.difference.value), (1, 0.5));
        assert!(compare(&[None], &[Some(0.0)], SHARE, 0.95).is_none());
    }

    #[test]
    fn many_roads_are_drawn_and_agree_with_all() {
        // 14 roads are tried out, 15 drawn; the one that is added says nothing.
        let a: Vec<f64> = (0..14).map(|road| f64::from(road % 5) / 5.0).collect();
        let b: Vec<f64> = (0..14).map(|road| f64::from(road * 7 % 4) / 5.0).collect();
        let (mut more_a, mut more_b) = (a.clone(), b.clone());
        more_a.push(0.0);
        more_b.push(0.0);
        let (exact, drawn) = (of(&a, &b).p, of(&more_a, &more_b).p);
        assert!((exact - drawn).abs() < 0.01, "{exact} {drawn}");
    }
}
