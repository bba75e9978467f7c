//! How the scenarios of a group went.

use std::collections::BTreeMap;

use pdk_statistics::share::{Drives, share_over_roads};
use pdk_statistics::{CONFIDENCE, Estimate};

use crate::text::{count, number, percent};
use crate::view::{Scenario, Verdict};

/// How the scenarios of a group went.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// Scenarios that failed, in whatever way.
    pub failed: usize,
    /// Those of them in which the vehicle stopped.
    pub stopped: usize,
    /// Scenarios that say something about the driver.
    pub judged: usize,
    /// The sum of the mean cross-track errors of those that reached the end.
    error: f64,
    /// When the others failed, in seconds.
    times: Vec<f64>,
    /// The same by road, which is the unit of what can be concluded.
    roads: BTreeMap<String, Drives>,
}

impl Tally {
    /// Counts another scenario.
    pub fn add(&mut self, scenario: &Scenario) {
        if scenario.verdict == Verdict::Void {
            return;
        }
        let failed = scenario.verdict.failed();
        self.judged += 1;
        self.roads.entry(scenario.road_id.clone()).or_default().add(failed);
        match failed {
            true => {
                self.failed += 1;
                self.stopped += usize::from(scenario.verdict == Verdict::Stopped);
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

    /// The share that failed; 0 where nothing is known.
    pub fn share(&self) -> f64 {
        self.failed as f64 / self.judged.max(1) as f64
    }

    /// The share over roads with its interval; none where nothing is known.
    pub fn estimate(&self) -> Option<Estimate> {
        let roads: Vec<Drives> = self.roads.values().copied().collect();
        share_over_roads(&roads, CONFIDENCE)
    }

    /// The share that failed on each of these roads; none where it was not driven.
    pub fn shares(&self, roads: &[String]) -> Vec<Option<f64>> {
        roads.iter().map(|road| self.roads.get(road).copied().and_then(Drives::share)).collect()
    }

    /// The mean of the cross-track errors of those that reached the end; none where none did. That of a part of a road is not
    /// comparable.
    pub fn mean_error(&self) -> Option<f64> {
        let passed = self.judged - self.failed;
        (passed > 0).then(|| self.error / passed as f64)
    }

    /// The median time to failure in seconds; none where none failed.
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

    /// What is said about it in a sentence without its beginning, such as "3 of 10 failed (11 to 60 %), 1 of them stopped, ...".
    pub fn told(&self) -> String {
        let mut parts = vec![format!("{} of {} failed", self.failed, self.judged)];
        if let Some(Estimate { low, high, .. }) = self.estimate().filter(|_| self.roads.len() > 1) {
            parts[0] += &format!(" (95 %: {} to {})", percent(low), percent(high));
        }
        if self.stopped > 0 {
            parts.push(format!("{} because the vehicle stopped", self.stopped));
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

/// The perturbations, the worst first: by the share of failed scenarios, then by how soon they failed, then by the mean
/// cross-track error.
pub fn by_severity<'a>(scenarios: impl IntoIterator<Item = &'a Scenario>) -> Vec<(String, Tally)> {
    let mut tallies: BTreeMap<&str, Tally> = BTreeMap::new();
    for scenario in scenarios {
        if let Some(perturbation) = &scenario.perturbation {
            tallies.entry(perturbation).or_default().add(scenario);
        }
    }
    let mut order: Vec<_> = tallies.into_iter().map(|(name, tally)| (name.to_owned(), tally)).collect();
    let soon = |tally: &Tally| tally.time_to_failure().unwrap_or(f64::INFINITY);
    let error = |tally: &Tally| tally.mean_error().unwrap_or_default();
    order.sort_by(|(_, a), (_, b)| {
        let by_share = b.share().total_cmp(&a.share());
        by_share.then(soon(a).total_cmp(&soon(b))).then(error(b).total_cmp(&error(a)))
    });
    order
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
}
