//! Ways in which the signs of paired differences could have come out.

use pdk_seed::Key;

/// With this many roads at most, all ways are tried: 8,192.
const MOST_EXACT: usize = 14;
/// With more roads, this many are drawn. The observed one is one of those that could have been drawn, so it is the first of them.
const DRAWN: usize = 10_000;
const KEY: Key = Key(*b"pdk statistics: exchanged pairs.");

/// Ways to exchange two conditions on each of some roads, which flips the sign of their difference there.
///
/// Tests that use them are two-sided, so of two ways that are opposite on all roads one is enough: the first road keeps its sign.
pub struct Signs {
    /// For each road its sign, 1 or -1, in each of the ways.
    by_road: Vec<Vec<f64>>,
    count: usize,
}

impl Signs {
    /// Those of this many roads.
    pub fn of(roads: usize) -> Self {
        let sign = |flipped: bool| if flipped { -1.0 } else { 1.0 };
        if roads <= MOST_EXACT {
            let count = 1 << roads.saturating_sub(1);
            let of_road =
                |road: usize| (0..count).map(move |way| sign(road > 0 && way >> (road - 1) & 1 == 1));
            return Self { by_road: (0..roads).map(|road| of_road(road).collect()).collect(), count };
        }
        let mut random = KEY.sequence();
        let mut of_road = || (0..DRAWN).map(|way| sign(way > 0 && random.next_u32() & 1 == 1)).collect();
        Self { by_road: (0..roads).map(|_| of_road()).collect(), count: DRAWN }
    }

    /// The size of the sum of the differences in each of the ways; the first is the observed one.
    pub fn sums(&self, differences: &[f64], into: &mut Vec<f64>) {
        into.clear();
        into.resize(self.count, 0.0);
        for (difference, signs) in
            differences.iter().zip(&self.by_road).filter(|(difference, _)| **difference != 0.0)
        {
            for (sum, sign) in into.iter_mut().zip(signs) {
                *sum += sign * difference;
            }
        }
        into.iter_mut().for_each(|sum| *sum = sum.abs());
    }

    /// How many ways there are.
    pub fn count(&self) -> usize {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_roads_have_all_signs_and_many_have_drawn_ones() {
        let mut sums = Vec::new();
        Signs::of(3).sums(&[1.0, 2.0, 4.0], &mut sums);
        assert_eq!(sums, [7.0, 3.0, 1.0, 5.0]);
        Signs::of(0).sums(&[], &mut sums);
        assert_eq!(sums, [0.0]);
        let many = Signs::of(20);
        many.sums(&[1.0; 20], &mut sums);
        assert_eq!((sums[0], sums.len(), many.count()), (20.0, DRAWN, DRAWN));
        // The sum of twenty signs has a variance of 20.
        let variance = sums[1..].iter().map(|sum| sum * sum).sum::<f64>() / (DRAWN - 1) as f64;
        assert!((variance - 20.0).abs() < 1.0, "{variance}");
    }
}
