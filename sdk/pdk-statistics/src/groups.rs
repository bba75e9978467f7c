//! Ranks that cannot be told apart.

use crate::all_pairs::all_pairs;

/// The group of each entry of a ranking, from 1. `entries` are in the order of the ranking, each with its values by road (see
/// [`all_pairs`]). A new group begins at the first entry that differs significantly from any of the group before.
///
/// So no two entries of a group can be told apart, and the first of each group differs from at least one of the group before. Two
/// entries of different groups can still be close: neighbours often are. With the probability `confidence` all differences that
/// groups begin with are real, however many entries there are. If none differ, that is how often all are one group.
///
/// At 95 % fewer than six roads are one group: the least possible p of five is 1/16.
pub fn groups(entries: &[Vec<Option<f64>>], confidence: f64) -> Vec<usize> {
    let mut apart = vec![vec![false; entries.len()]; entries.len()];
    for pair in all_pairs(entries).iter().filter(|pair| pair.p <= 1.0 - confidence) {
        apart[pair.second][pair.first] = true;
    }
    let (mut begin, mut group) = (0, 1);
    let mut of = Vec::with_capacity(entries.len());
    for (place, apart_from) in apart.iter().enumerate() {
        if apart_from[begin..place].contains(&true) {
            (begin, group) = (place, group + 1);
        }
        of.push(group);
    }
    of
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn those_that_never_fail_are_one_group() {
        let roads =
            |failed: usize| (0..10).map(|road| Some(f64::from(u8::from(road < failed)))).collect::<Vec<_>>();
        let ranking = [10, 9, 2, 1, 0, 0].map(roads);
        assert_eq!(groups(&ranking, 0.95), [1, 1, 2, 2, 2, 2]);
        // Five roads are too few for any difference, six are enough.
        let always = |roads: usize| [vec![Some(1.0); roads], vec![Some(0.0); roads]];
        assert_eq!((groups(&always(5), 0.95), groups(&always(6), 0.95)), (vec![1, 1], vec![1, 2]));
        assert!(groups(&[], 0.95).is_empty());
        let unknown = vec![vec![None], vec![None]];
        assert_eq!(groups(&unknown, 0.95), [1, 1]);
    }

    #[test]
    fn no_two_of_a_group_differ() {
        // The second fails on few roads, so it cannot be told from the third; the first and the third can be.
        let entry = |on: &[usize], share: f64| {
            (0..12).map(|road| Some(if on.contains(&road) { share } else { 0.0 })).collect::<Vec<_>>()
        };
        let all: Vec<usize> = (0..12).collect();
        let ranking =
            [entry(&all, 0.6), entry(&[0, 1, 2, 3, 4, 5, 6], 1.0), entry(&all, 0.2), entry(&[], 0.0)];
        let found = groups(&ranking, 0.95);
        assert_eq!(found, [1, 1, 2, 3]);
    }
}
