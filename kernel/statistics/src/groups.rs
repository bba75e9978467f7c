//! Ranks that cannot be told apart.

use crate::paired::compare;

/// The group of each entry of a ranking, from 1. `entries` are in the order of the ranking, each with its values by road (see
/// [`compare`]). The first of a group is its leader; who follows belongs to it as long as the interval of the paired difference to
/// the leader contains 0, or the randomisation test finds the difference no less likely than 1 - `confidence`. At 95 % fewer than
/// six roads are one group: the least likely difference of five has p = .0625.
///
/// Nobody in a group can be told from its leader. Two neighbours in different groups can still be close: it is the leader that the
/// second one differs from.
pub fn groups(entries: &[Vec<Option<f64>>], range: (f64, f64), confidence: f64) -> Vec<usize> {
    let (mut leader, mut group) = (0, 1);
    let mut of = Vec::with_capacity(entries.len());
    for (place, entry) in entries.iter().enumerate() {
        let apart = place > 0
            && compare(&entries[leader], entry, range, confidence).is_some_and(|paired| {
                (paired.difference.low > 0.0 || paired.difference.high < 0.0) && paired.p < 1.0 - confidence
            });
        if apart {
            (leader, group) = (place, group + 1);
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
        let ranking = [10, 9, 3, 1, 0, 0].map(roads);
        assert_eq!(groups(&ranking, (0.0, 1.0), 0.95), [1, 1, 2, 2, 2, 2]);
        // Five roads are too few for any difference.
        let few = [vec![Some(1.0); 5], vec![Some(0.0); 5]];
        assert_eq!(groups(&few, (0.0, 1.0), 0.95), [1, 1]);
        assert!(groups(&[], (0.0, 1.0), 0.95).is_empty());
        let unknown = vec![vec![None], vec![None]];
        assert_eq!(groups(&unknown, (0.0, 1.0), 0.95), [1, 1]);
    }
}
