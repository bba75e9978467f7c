//! Counts of how the scenarios of a group ended.

use std::collections::{BTreeMap, BTreeSet};

use pdk_model::level::MAX_INTENSITY;
use pdk_statistics::CONFIDENCE;
use pdk_statistics::Estimate;
use pdk_statistics::level::{Trial, failing_share};
use pdk_statistics::mean;
use pdk_statistics::share;

use crate::text::{count, number, percent};
use crate::view::{Scenario, Verdict};

/// Counts of how the scenarios of a group ended.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// Scenarios that failed, in whatever way.
    pub failed: usize,
    /// Those of them in which the vehicle stopped.
    pub stopped: usize,
    /// Those of them in which it was too slow.
    pub late: usize,
    /// Scenarios that say something about the driver.
    pub judged: usize,
    /// The sum of the mean cross-track errors of those that reached the end.
    error: f64,
    /// When the others failed, in seconds.
    times: Vec<f64>,
    /// The levels over which the share of a road is taken; none if it is that of its drives.
    levels: Vec<f64>,
    /// The same by road, which is the unit of what can be concluded.
    roads: BTreeMap<String, Road>,
}

/// What is known of a road.
#[derive(Debug, Clone, Default)]
struct Road {
    /// Drives with the same random draws, by their scenario without perturbations and their seed.
    trials: BTreeMap<(usize, u64), Vec<Trial>>,
    /// Whether drives failed that have no level.
    others: Vec<bool>,
}

/// What a share can be.
const SHARE: (f64, f64) = (0.0, 1.0);

impl Tally {
    /// One that takes the share of a road over levels, as far as drives say which of them fail. If levels were chosen by what
    /// failed, the share of the drives says nothing.
    pub fn over(levels: &[f64]) -> Self {
        Self { levels: levels.to_vec(), ..Self::default() }
    }

    /// Counts another scenario.
    pub fn add(&mut self, scenario: &Scenario) {
        self.add_of(0, scenario);
    }

    /// Counts another scenario of one of several drives.
    pub fn add_of(&mut self, drive: usize, scenario: &Scenario) {
        if scenario.verdict == Verdict::Void {
            return;
        }
        let failed = scenario.verdict.failed();
        self.judged += 1;
        let road = self.roads.entry(scenario.road_id.clone()).or_default();
        match scenario.level {
            Some(level) => {
                road.trials.entry((drive, scenario.seed)).or_default().push(Trial { level, failed });
            }
            None => road.others.push(failed),
        }
        match failed {
            true => {
                self.failed += 1;
                self.stopped += usize::from(scenario.verdict == Verdict::Stopped);
                self.late += usize::from(scenario.verdict == Verdict::Late);
                self.times.push(scenario.time);
            }
            false => self.error += scenario.mean_error,
        }
    }

    /// That of some scenarios.
    pub fn of<'a>(scenarios: impl IntoIterator<Item = &'a Scenario>) -> Self {
        let mut tally = Self::default();
        scenarios.into_iter().for_each(|scenario| tally.add(scenario));
        tally
    }

    /// The share of all drives that failed; 0 if nothing is known.
    pub fn share_of_drives(&self) -> f64 {
        self.failed as f64 / self.judged.max(1) as f64
    }

    /// The share over roads with its interval; none if nothing is known.
    pub fn estimate(&self) -> Option<Estimate> {
        let drives = |road: &Road| road.trials.values().map(Vec::len).sum::<usize>() + road.others.len();
        if self.roads.values().all(|road| drives(road) <= 1) {
            return share::share(self.failed as u64, self.judged as u64, CONFIDENCE);
        }
        let shares: Vec<f64> = self.roads.values().filter_map(|road| road.share(&self.levels)).collect();
        mean::over_roads(&shares, SHARE, CONFIDENCE)
    }

    /// How many roads there are.
    pub fn roads(&self) -> usize {
        self.roads.len()
    }

    /// The share that failed on each of these roads; none if it was not driven.
    pub fn shares(&self, roads: &[String]) -> Vec<Option<f64>> {
        roads.iter().map(|road| self.roads.get(road)?.share(&self.levels)).collect()
    }

    /// The mean of the cross-track errors of those that reached the end; none if none did. That of a part of a road is not
    /// comparable.
    pub fn mean_error(&self) -> Option<f64> {
        let passed = self.judged - self.failed;
        (passed > 0).then(|| self.error / passed as f64)
    }

    /// The median time to failure in seconds; none if none failed.
    pub fn time_to_failure(&self) -> Option<f64> {
        let mut times = self.times.clone();
        times.sort_by(f64::total_cmp);
        let half = times.len() / 2;
        match times.len() {
            0 => None,
            odd if odd % 2 == 1 => Some(times[half]),
            _ => Some(0.5 * (times[half - 1] + times[half])),
        }
    }

    /// The end of a sentence about it, such as "3 of 10 failed (11 to 60 %), 1 of them stopped, ...".
    pub fn told(&self) -> String {
        let mut parts = vec![format!("{} of {} failed", self.failed, self.judged)];
        if let Some(Estimate { low, high, .. }) = self.estimate().filter(|_| self.roads.len() > 1) {
            parts[0] += &format!(" (95 %: {} to {})", percent(low), percent(high));
        }
        if self.stopped > 0 {
            parts.push(format!("{} because the vehicle stopped", self.stopped));
        }
        if self.late > 0 {
            parts.push(format!("{} because it ran out of time", self.late));
        }
        if let Some(seconds) = self.time_to_failure() {
            parts.push(format!("half of these within {} s", number(seconds)));
        }
        if let Some(metres) = self.mean_error() {
            let finished = if self.failed > 0 {
                format!(" of {} that reached the end", count(self.judged - self.failed, "scenario"))
            } else {
                String::new()
            };
            parts.push(format!("mean cross-track error{finished} {} m", number(metres)));
        }
        parts.join(", ")
    }
}

impl Road {
    /// The mean share over what was driven under the same luck; none if nothing was.
    fn share(&self, levels: &[f64]) -> Option<f64> {
        let of = |trials: &Vec<Trial>| match levels.is_empty() {
            true => Some(trials.iter().filter(|trial| trial.failed).count() as f64 / trials.len() as f64),
            false => failing_share(trials, levels),
        };
        let others = self.others.iter().map(|failed| f64::from(u8::from(*failed)));
        let shares: Vec<f64> = self.trials.values().filter_map(of).chain(others).collect();
        (!shares.is_empty()).then(|| shares.iter().sum::<f64>() / shares.len() as f64)
    }
}

/// Levels, by their bits.
type Levels = BTreeSet<u64>;

/// At which levels each perturbation was driven, for each drive, road and luck.
fn driven_levels<'a>(drives: impl IntoIterator<Item = &'a [Scenario]>) -> BTreeMap<&'a str, Vec<Levels>> {
    let mut of_perturbations: BTreeMap<&str, BTreeMap<_, Levels>> = BTreeMap::new();
    for (drive, scenarios) in drives.into_iter().enumerate() {
        for scenario in scenarios {
            if let (Some(perturbation), Some(level)) = (&scenario.perturbation, scenario.level) {
                let searches = of_perturbations.entry(perturbation).or_default();
                let search = searches.entry((drive, &scenario.road_id, scenario.seed)).or_default();
                search.insert(level.to_bits());
            }
        }
    }
    of_perturbations.into_iter().map(|(name, searches)| (name, searches.into_values().collect())).collect()
}

/// The levels that all have.
fn common<'a>(searches: impl IntoIterator<Item = &'a Levels>) -> Levels {
    searches.into_iter().cloned().reduce(|common, levels| &common & &levels).unwrap_or_default()
}

/// The highest level at which each perturbation was driven on each road under each luck; none if there is no such level.
pub fn common_level(scenarios: &[Scenario]) -> Option<f64> {
    let common = common(driven_levels([scenarios]).values().flatten());
    common.into_iter().map(f64::from_bits).max_by(f64::total_cmp)
}

/// The levels over which the share of a road is taken in these drives; none if that of its drives says as much.
///
/// If levels were chosen by what failed, some roads were not driven at levels at which others were. Then these are the whole
/// ones from the lowest to the highest that was driven.
pub fn levels<'a>(drives: impl IntoIterator<Item = &'a [Scenario]>) -> Vec<f64> {
    let of_perturbations = driven_levels(drives);
    let differ = |searches: &Vec<Levels>| searches.iter().any(|levels| *levels != searches[0]);
    // What was chosen began at the same level everywhere; drives that have nothing to do with each other, as of a search, did not.
    let begins = |searches: &Vec<Levels>| !common(searches).is_empty();
    if !of_perturbations.values().any(differ) || !of_perturbations.values().all(begins) {
        return Vec::new();
    }
    let driven = of_perturbations.values().flatten().flatten().copied().map(f64::from_bits);
    let (lowest, highest) =
        driven.fold((MAX_INTENSITY, 0.0_f64), |(low, high), level: f64| (low.min(level), high.max(level)));
    (0..=MAX_INTENSITY as u32).map(f64::from).filter(|level| (lowest..=highest).contains(level)).collect()
}

/// The perturbations of some drives, the worst first: by the share that fails, then by how soon they failed, then by the mean
/// cross-track error.
pub fn by_severity<'a>(drives: impl IntoIterator<Item = &'a [Scenario]> + Clone) -> Vec<(String, Tally)> {
    let levels = levels(drives.clone());
    let mut tallies: BTreeMap<&str, Tally> = BTreeMap::new();
    for (drive, scenarios) in drives.into_iter().enumerate() {
        for scenario in scenarios {
            if let Some(perturbation) = &scenario.perturbation {
                let tally = tallies.entry(perturbation).or_insert_with(|| Tally::over(&levels));
                tally.add_of(drive, scenario);
            }
        }
    }
    let share = |tally: &Tally| tally.estimate().map_or(0.0, |share| share.value);
    let mut order: Vec<_> =
        tallies.into_iter().map(|(name, tally)| (share(&tally), name.to_owned(), tally)).collect();
    let soon = |tally: &Tally| tally.time_to_failure().unwrap_or(f64::INFINITY);
    let error = |tally: &Tally| tally.mean_error().unwrap_or_default();
    order.sort_by(|(a_share, _, a), (b_share, _, b)| {
        let by_share = b_share.total_cmp(a_share);
        by_share.then(soon(a).total_cmp(&soon(b))).then(error(b).total_cmp(&error(a)))
    });
    order.into_iter().map(|(_, name, tally)| (name, tally)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario(road: &str, verdict: Verdict, time: f64) -> Scenario {
        Scenario { road_id: road.into(), verdict, time, mean_error: 0.25, ..Scenario::default() }
    }

    #[test]
    fn a_drive_that_was_cut_short_has_a_time_and_no_mean() {
        use Verdict::{Passed, Stopped, Unsafe, Void};
        let all = [
            scenario("a", Passed, 20.0),
            scenario("a", Unsafe, 4.0),
            scenario("b", Stopped, 8.0),
            scenario("c", Void, 1.0),
        ];
        let tally = Tally::of(&all);
        assert_eq!((tally.failed, tally.stopped, tally.judged), (2, 1, 3));
        assert_eq!((tally.mean_error(), tally.time_to_failure()), (Some(0.25), Some(6.0)));
        let roads = ["a", "b", "c"].map(str::to_owned);
        assert_eq!(tally.shares(&roads), [Some(0.5), Some(1.0), None]);
        let told = tally.told();
        for part in [
            "2 of 3 failed (95 %: ",
            "1 because the vehicle stopped",
            "half of these within 6.00 s",
            "mean cross-track error of 1 scenario that reached the end 0.250 m",
        ] {
            assert!(told.contains(part), "{told}");
        }
        assert_eq!(Tally::of(&all[1..2]).told(), "1 of 1 failed, half of these within 4.00 s");
        assert_eq!(Tally::of(&all[3..]).told(), "0 of 0 failed");
    }

    #[test]
    fn levels_that_were_chosen_by_what_failed_count_like_all_levels() {
        // On road a all from level 2 on fail, on road b none: by bisection, and all.
        let at = |road: &str, level: f64| Scenario {
            level: Some(level),
            perturbation: Some("fog".into()),
            ..scenario(road, if road == "a" && level >= 2.0 { Verdict::Unsafe } else { Verdict::Passed }, 5.0)
        };
        let chosen = [at("a", 4.0), at("a", 2.0), at("a", 1.0), at("b", 4.0)];
        let all: Vec<Scenario> =
            ["a", "b"].iter().flat_map(|road| (0..5).map(move |level| at(road, f64::from(level)))).collect();
        let levels = levels([&chosen[..]]);
        assert_eq!(levels, [1.0, 2.0, 3.0, 4.0]);
        // Between whole levels, these count.
        assert_eq!(super::levels([&[at("a", 4.0), at("a", 1.5), at("b", 4.0)][..]]), [2.0, 3.0, 4.0]);
        // As a search drives.
        assert!(super::levels([&[at("a", 4.0), at("b", 2.0), at("b", 3.0)][..]]).is_empty());
        assert!(super::levels([&all[..]]).is_empty());
        let levels = [0.0, 1.0, 2.0, 3.0, 4.0];
        let roads = ["a", "b"].map(str::to_owned);
        for scenarios in [&chosen[..], &all] {
            let mut tally = Tally::over(&levels);
            scenarios.iter().for_each(|scenario| tally.add(scenario));
            assert_eq!(tally.shares(&roads), [Some(0.6), Some(0.0)]);
            let Estimate { value, low, high } = tally.estimate().unwrap();
            assert!((value - 0.3).abs() < 1e-12 && low <= value && value <= high);
        }
    }
}
