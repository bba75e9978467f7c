//! The level at which the probability of failing reaches one half, and how to find it with few drives.

use serde::{Deserialize, Serialize};

use crate::bootstrap;
use crate::share::largest_unseen;

/// A drive at a level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// The level.
    pub level: f64,
    /// Whether it failed.
    pub failed: bool,
}

/// The level at which the probability of failing reaches one half.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FailingLevel {
    /// The level. It is the lowest level that was driven if the share is reached there already, and none if it is not reached at the
    /// highest.
    pub level: Option<f64>,
    /// The lower end of its interval, a level that was driven, or 0 if half may fail at the lowest already: below it nothing is known.
    /// None if it lies above the highest.
    pub low: Option<f64>,
    /// The upper end, in the same terms; none if it may lie above the highest level.
    pub high: Option<f64>,
    /// The highest level that was driven.
    pub highest: f64,
    /// How many drives it was found with.
    pub drives: usize,
}

/// Whether a driver fails at a level, by drives under the same luck: by that at this level, or else by the nearest level below that was
/// failed or above that was survived. None if no drive says it.
pub fn fails_at(trials: &[Trial], level: f64) -> Option<bool> {
    let tells = |trial: &&Trial| match trial.failed {
        true => trial.level <= level,
        false => trial.level >= level,
    };
    let exact = trials.iter().find(|trial| trial.level == level);
    let distance = |trial: &Trial| (trial.level - level).abs();
    let nearest = || trials.iter().filter(tells).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    exact.or_else(nearest).map(|trial| trial.failed)
}

/// The share of these levels at which a driver fails, by drives under the same luck; of those of which [a drive says
/// it](fails_at). None if no drive says anything.
///
/// Bisection drives where the answer is open, so that the share of its drives that failed means nothing; this share does.
pub fn failing_share(trials: &[Trial], levels: &[f64]) -> Option<f64> {
    let known = || levels.iter().filter_map(|level| fails_at(trials, *level));
    let count = known().count();
    (count > 0).then(|| known().filter(|fails| *fails).count() as f64 / count as f64)
}

/// Finds the level from the drives on each road: a list for each luck that was tried there, such as each repeat. None if there are
/// no drives; roads without drives do not count.
///
/// Drives under different luck may not be thrown together: where levels were chosen by what failed, as bisection does, low levels
/// were only driven under the luck that failed at high ones. So each list by itself says what happens at each level that was driven
/// anywhere: what [a drive says](fails_at), and between two drives that say nothing a share between theirs. These are averaged over
/// a road's lists, and then over roads. The means are made to rise (isotonic regression), and the level is where they cross one
/// half, linear between two levels.
///
/// The interval comes from resampled roads, and its ends are levels that were driven. How failing goes on between two of these is
/// not known: so of each resample the lower end is the last level below the first at which half of the roads may fail, and the
/// upper end the first from which on at least half of them do fail. If there are so few roads that half of all could be of a kind
/// that was not met (up to three), it reaches over all levels.
pub fn failing_level(roads: &[Vec<Vec<Trial>>], confidence: f64) -> Option<FailingLevel> {
    let mut levels: Vec<f64> = roads.iter().flatten().flatten().map(|trial| trial.level).collect();
    let drives = levels.len();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let highest = *levels.last()?;
    let roads: Vec<Vec<Shares>> = roads.iter().filter_map(|lists| over_lists(lists, &levels)).collect();
    let all: Vec<usize> = (0..roads.len()).collect();
    let (low, high) = match largest_unseen(roads.len() as u64, confidence) >= 0.5 {
        true => (0.0, f64::INFINITY),
        false => {
            let (mut resample, mut latest_of_each) = (vec![Shares::default(); levels.len()], Vec::new());
            let earliest_of_each = bootstrap::resampled(roads.len(), |chosen| {
                over_roads(&roads, chosen, &mut resample);
                latest_of_each.push(latest(&levels, &resample));
                earliest(&levels, &resample)
            });
            latest_of_each.sort_by(f64::total_cmp);
            let (low, _) = bootstrap::interval(&earliest_of_each, roads.len(), confidence);
            let (_, high) = bootstrap::interval(&latest_of_each, roads.len(), confidence);
            (low, high)
        }
    };
    let reached = |level: f64| (level <= highest).then_some(level);
    let mut means = vec![Shares::default(); levels.len()];
    over_roads(&roads, &all, &mut means);
    let level = reached(crossing(&levels, &means));
    Some(FailingLevel { level, low: reached(low), high: reached(high), highest, drives })
}

/// The share that fails at a level.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Shares {
    /// The likely one.
    likely: f64,
    /// The same, or that at the nearest level that was driven if no drive says anything about this one.
    nearest: f64,
    /// How many say what the likely one is; none if it is the nearest one.
    known: f64,
    /// That where whatever no drive says is survived, and where it fails.
    least: f64,
    most: f64,
}

/// The means of rows of shares, of which each has one for each level. The likely share is the mean over those rows of which a drive says it, if there are
/// any: roads that were driven at one level only say nothing about the others.
fn mean<'a>(rows: impl Iterator<Item = &'a Vec<Shares>>, into: &mut [Shares]) {
    into.fill(Shares::default());
    let mut count = 0.0;
    for row in rows {
        count += 1.0;
        for (sum, shares) in into.iter_mut().zip(row) {
            sum.likely += shares.likely * shares.known;
            sum.nearest += shares.nearest;
            sum.known += shares.known;
            sum.least += shares.least;
            sum.most += shares.most;
        }
    }
    for sum in into {
        let nearest = sum.nearest / count;
        let likely = if sum.known > 0.0 { sum.likely / sum.known } else { nearest };
        let known = sum.known.min(1.0);
        *sum = Shares { likely, nearest, known, least: sum.least / count, most: sum.most / count };
    }
}

/// The shares of a road at each of the levels, from its lists of drives; none if there are no drives.
fn over_lists(lists: &[Vec<Trial>], levels: &[f64]) -> Option<Vec<Shares>> {
    let lists: Vec<Vec<Shares>> =
        lists.iter().filter(|list| !list.is_empty()).map(|list| shares(list, levels)).collect();
    let mut means = vec![Shares::default(); levels.len()];
    mean(lists.iter(), &mut means);
    (!lists.is_empty()).then_some(means)
}

/// The means over the chosen roads.
fn over_roads(roads: &[Vec<Shares>], chosen: &[usize], into: &mut [Shares]) {
    mean(chosen.iter().map(|road| &roads[*road]), into);
}

/// What drives under the same luck say of each of the levels.
fn shares(trials: &[Trial], levels: &[f64]) -> Vec<Shares> {
    let driven: Vec<(f64, f64)> = levels
        .iter()
        .filter_map(|level| {
            let here = || trials.iter().filter(|trial| trial.level == *level);
            let (failed, of) = (here().filter(|trial| trial.failed).count(), here().count());
            (of > 0).then(|| (*level, failed as f64 / of as f64))
        })
        .collect();
    let between = |level: &f64| {
        let above = driven.partition_point(|(other, _)| other < level);
        match (above.checked_sub(1).map(|below| driven[below]), driven.get(above).copied()) {
            (_, Some((other, share))) if other == *level => share,
            (Some((low, from)), Some((high, to))) => from + (to - from) * (level - low) / (high - low),
            (Some((_, share)), None) | (None, Some((_, share))) => share,
            (None, None) => 0.0,
        }
    };
    let is_between = |level: &f64| {
        driven.first().is_some_and(|(low, _)| low < level)
            && driven.last().is_some_and(|(high, _)| high > level)
    };
    let at = |level: &f64| {
        let likely = between(level);
        let shares = |known: bool, [least, most]: [f64; 2]| Shares {
            likely,
            nearest: likely,
            known: f64::from(u8::from(known)),
            least,
            most,
        };
        if driven.iter().any(|(other, _)| other == level) {
            return shares(true, [likely; 2]);
        }
        match fails_at(trials, *level) {
            Some(fails) => shares(true, [f64::from(u8::from(fails)); 2]),
            None => shares(is_between(level), [0.0, 1.0]),
        }
    };
    levels.iter().map(at).collect()
}

/// One half, which sums of shares need not reach exactly.
const HALF: f64 = 0.5 - 1e-9;

/// Where the likely share crosses one half; infinite if it does not.
fn crossing(levels: &[f64], shares: &[Shares]) -> f64 {
    let rising = rising(shares.iter().map(|shares| shares.likely));
    match rising.iter().position(|share| *share >= HALF) {
        None => f64::INFINITY,
        Some(0) => levels[0],
        Some(place) => {
            let (below, above) = (rising[place - 1], rising[place]);
            let share = ((0.5 - below) / (above - below)).min(1.0);
            levels[place - 1] + (levels[place] - levels[place - 1]) * share
        }
    }
}

/// The last level below the first at which half may fail, 0 if that is the lowest, since nothing is known below; infinite if half cannot
/// fail at any.
fn earliest(levels: &[f64], shares: &[Shares]) -> f64 {
    let first = shares.iter().position(|shares| shares.most >= HALF);
    first.map_or(f64::INFINITY, |place| place.checked_sub(1).map_or(0.0, |below| levels[below]))
}

/// The first level from which on at least half fail; infinite if there is none.
fn latest(levels: &[f64], shares: &[Shares]) -> f64 {
    let last = shares.iter().rposition(|shares| shares.least < HALF);
    levels.get(last.map_or(0, |place| place + 1)).copied().unwrap_or(f64::INFINITY)
}

/// The rising numbers that are nearest to these: neighbours that fall are replaced by their mean.
fn rising(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut blocks: Vec<(f64, usize)> = Vec::new();
    for value in values {
        blocks.push((value, 1));
        while let [.., (before, many), (last, more)] = blocks[..] {
            if before <= last {
                break;
            }
            blocks.truncate(blocks.len() - 2);
            let count = many + more;
            blocks.push(((before * many as f64 + last * more as f64) / count as f64, count));
        }
    }
    blocks.into_iter().flat_map(|(mean, count)| std::iter::repeat_n(mean, count)).collect()
}

/// Levels in which the failing level is looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bisection {
    /// The lowest level.
    pub lowest: f64,
    /// The highest level.
    pub highest: f64,
    /// How close the levels that were survived and failed come in the end.
    pub resolution: f64,
}

impl Bisection {
    /// The next level to drive on a road with these drives so far; none if enough is known.
    ///
    /// If drives under the same draws have the same outcome, as in a simulator without a clock of its own, the levels that
    /// [`failing_level`] finds from these drives are those that it finds if all are driven. If each drive has luck of its own, bisection
    /// goes wrong where a drive did, and never comes back: the levels found are up to .23 too high if they are near 1 and up to .1 too
    /// low elsewhere, if the probability of failing takes 3.5 levels to rise from 10 to 90 %. With all levels they are off by .08 at most.
    /// `tests/coverage.rs` prints these figures.
    ///
    /// First the highest level: most perturbations never make a driver fail, and cost one drive then. Then the middle between
    /// the highest level that was survived and the lowest that was failed above it; the lowest level of all where everything above
    /// it failed.
    pub fn next(&self, trials: &[Trial]) -> Option<f64> {
        let survived = trials.iter().filter(|trial| !trial.failed).map(|trial| trial.level).reduce(f64::max);
        let failed = trials
            .iter()
            .filter(|trial| trial.failed && survived.is_none_or(|level| trial.level > level))
            .map(|trial| trial.level)
            .reduce(f64::min);
        match (survived, failed) {
            (None, None) => Some(self.highest),
            (Some(survived), None) => (survived < self.highest).then_some(self.highest),
            (None, Some(failed)) if failed <= self.lowest => None,
            (None, Some(failed)) if failed - self.lowest <= self.resolution => Some(self.lowest),
            (survived, Some(failed)) => {
                let survived = survived.unwrap_or(self.lowest);
                (failed - survived > self.resolution * (1.0 + 1e-9)).then_some(0.5 * (survived + failed))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bisection_tells_the_share_of_all_levels() {
        let levels = [0.0, 1.0, 2.0, 3.0, 4.0];
        for from in 0..=5 {
            let fails = |level: f64| level >= f64::from(from);
            let mut trials = Vec::new();
            let bisection = Bisection { lowest: 0.0, highest: 4.0, resolution: 1.0 };
            while let Some(level) = bisection.next(&trials) {
                trials.push(Trial { level, failed: fails(level) });
            }
            assert_eq!(failing_share(&trials, &levels), Some((5.0 - f64::from(from)) / 5.0), "{trials:?}");
            assert!(levels.iter().all(|level| fails_at(&trials, *level) == Some(fails(*level))));
        }
        // What no drive says is left out.
        let one = [Trial { level: 2.0, failed: true }];
        assert_eq!((fails_at(&one, 1.0), fails_at(&one, 3.0)), (None, Some(true)));
        assert_eq!((failing_share(&one, &levels), failing_share(&[], &levels)), (Some(1.0), None));
        // A drive at the level counts for more than one beside it.
        let odd = [Trial { level: 1.0, failed: true }, Trial { level: 2.0, failed: false }];
        assert_eq!((fails_at(&odd, 2.0), fails_at(&odd, 3.0)), (Some(false), Some(true)));
    }

    #[test]
    fn roads_that_were_driven_at_one_level_say_nothing_about_lower_ones() {
        let road = |level: f64, failed: bool| vec![vec![Trial { level, failed }]];
        let all = |at_one: bool, at_three: bool| -> Vec<Vec<Vec<Trial>>> {
            (0..20)
                .map(|number| if number % 2 == 0 { road(1.0, at_one) } else { road(3.0, at_three) })
                .collect()
        };
        // All survive level 1, and all fail at level 3.
        let found = failing_level(&all(false, true), 0.95).unwrap();
        // Half of the roads may fail at any level, or at none.
        assert_eq!((found.level, found.low, found.high), (Some(2.0), Some(0.0), None));
        assert_eq!(failing_level(&all(true, true), 0.95).unwrap().level, Some(1.0));
        assert_eq!(failing_level(&all(false, false), 0.95).unwrap().level, None);
    }

    fn trials(threshold: f64, levels: &[f64]) -> Vec<Trial> {
        levels.iter().map(|&level| Trial { level, failed: level >= threshold }).collect()
    }

    const LEVELS: [f64; 5] = [0.0, 1.0, 2.0, 3.0, 4.0];

    /// The level of roads on which one luck was tried.
    fn found(roads: &[Vec<Trial>]) -> Option<FailingLevel> {
        failing_level(&roads.iter().map(|road| vec![road.clone()]).collect::<Vec<_>>(), 0.95)
    }

    fn ends(found: Option<FailingLevel>) -> (Option<f64>, Option<f64>, Option<f64>) {
        found.map(|found| (found.level, found.low, found.high)).unwrap()
    }

    #[test]
    fn the_level_is_where_half_of_the_roads_fail() {
        let roads = [0.5, 1.5, 1.6, 2.5, 2.6, 3.5].map(|threshold| trials(threshold, &LEVELS));
        let half = found(&roads).unwrap();
        assert_eq!((half.level, half.highest, half.drives), (Some(2.0), 4.0, 30));
        assert!(half.low.unwrap() < 2.0 && half.high.is_none_or(|high| high > 2.0), "{half:?}");
        assert_eq!(ends(found(&vec![trials(9.0, &LEVELS); 10])), (None, None, None));
        assert_eq!(ends(found(&vec![trials(0.0, &LEVELS); 10])), (Some(0.0), Some(0.0), Some(0.0)));
        assert_eq!((found(&[vec![]]), failing_level(&[vec![]], 0.95)), (None, None));
        assert_eq!(ends(found(&[trials(2.5, &LEVELS)])), (Some(2.5), Some(0.0), None));
    }

    #[test]
    fn between_two_levels_nothing_is_known_however_many_roads_agree() {
        for threshold in [1.01, 1.5, 2.0] {
            let found = found(&vec![trials(threshold, &LEVELS); 20]);
            assert_eq!(ends(found), (Some(1.5), Some(1.0), Some(2.0)));
        }
        // Nor what a level means that more survive than one below it.
        let odd: Vec<Trial> = LEVELS.iter().map(|&level| Trial { level, failed: level != 1.0 }).collect();
        assert_eq!(ends(found(&vec![odd; 20])), (Some(0.0), Some(0.0), Some(2.0)));
    }

    #[test]
    fn each_luck_counts_as_much_however_many_levels_were_driven_under_it() {
        let bisected = |threshold: f64| {
            let (mut road, bisection) =
                (Vec::new(), Bisection { lowest: 0.0, highest: 4.0, resolution: 0.25 });
            while let Some(level) = bisection.next(&road) {
                road.push(Trial { level, failed: level >= threshold });
            }
            road
        };
        // One of three fails, from level 1 on: never half.
        let third = vec![vec![bisected(1.0), bisected(9.0), bisected(9.0)]; 8];
        assert_eq!(ends(failing_level(&third, 0.95)), (None, None, None));
        // Two of three do.
        let two_thirds = vec![vec![bisected(1.1), bisected(9.0), bisected(1.1)]; 8];
        assert_eq!(ends(failing_level(&two_thirds, 0.95)), (Some(1.1875), Some(1.0), Some(1.25)));
    }

    #[test]
    fn below_the_lowest_level_nothing_is_known() {
        let road = |failed: [bool; 2]| {
            vec![[2.0, 4.0].into_iter().zip(failed).map(|(level, failed)| Trial { level, failed }).collect()]
        };
        let all = vec![road([true, true]); 8];
        assert_eq!(ends(failing_level(&all, 0.95)), (Some(2.0), Some(0.0), Some(2.0)));
        let high = vec![road([false, true]); 8];
        assert_eq!(ends(failing_level(&high, 0.95)), (Some(3.0), Some(2.0), Some(4.0)));
    }

    #[test]
    fn shares_that_fall_are_evened_out() {
        assert_eq!(
            rising([0.0, 0.5, 0.25, 0.25, 1.0].into_iter()),
            [0.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 1.0]
        );
        assert_eq!(rising([1.0, 0.0].into_iter()), [0.5, 0.5]);
    }

    #[test]
    fn levels_that_a_road_was_not_driven_at_lie_between_those_that_it_was() {
        let road = [Trial { level: 1.0, failed: false }, Trial { level: 3.0, failed: true }];
        let of = |pick: fn(&Shares) -> f64| shares(&road, &LEVELS).iter().map(pick).collect::<Vec<_>>();
        assert_eq!(of(|shares| shares.likely), [0.0, 0.0, 0.5, 1.0, 1.0]);
        assert_eq!(of(|shares| shares.least), [0.0, 0.0, 0.0, 1.0, 1.0]);
        assert_eq!(of(|shares| shares.most), [0.0, 0.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn a_bisection_comes_as_near_as_it_says_with_few_drives() {
        let bisection = Bisection { lowest: 0.0, highest: 4.0, resolution: 0.25 };
        for (threshold, expected) in [(9.0, 1), (2.3, 5), (0.1, 6), (0.0, 6), (3.9, 5)] {
            let mut road: Vec<Trial> = Vec::new();
            while let Some(level) = bisection.next(&road) {
                road.push(Trial { level, failed: level >= threshold });
                assert!(road.len() < 20);
            }
            assert_eq!(road.len(), expected, "{threshold}: {road:?}");
            let found = found(&[road]).unwrap().level;
            match (0.0..=4.0).contains(&threshold) {
                true => assert!((found.unwrap() - threshold).abs() <= 0.25, "{threshold}: {found:?}"),
                false => assert_eq!(found, None),
            }
        }
    }
}
