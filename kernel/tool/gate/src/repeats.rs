//! Simulators that do not repeat themselves: a driver drives a scenario until its verdict is stable, and drives of the same scenario
//! that come out differently are counted.

use pdk_components::catalog::Catalog;
use pdk_model::scenario::{Mode, Scenario};
use pdk_sdk::describe::Kind;
use pdk_sdk::error::Result;
use pdk_statistics::drives::Drives;
use pdk_statistics::{CONFIDENCE, Estimate, repeats, share};
use serde::{Deserialize, Serialize};

use crate::step::Step;
use crate::stretch::Stretch;
use crate::suite::Suite;

/// How often a driver drives a scenario at most in a simulator that does not repeat itself.
const USUAL: u64 = 5;
/// A verdict is stable if it leads by this many drives.
const LEAD: usize = 2;

/// How often a driver drives a scenario at most.
///
/// # Errors
/// If there is no such simulator.
pub fn most(suite: &Suite, scenario: &Scenario, catalog: &Catalog) -> Result<u64> {
    if Stretch::of(scenario).is_some() {
        return Ok(1);
    }
    if let Some(repeats) = suite.test.repeats {
        return Ok(repeats);
    }
    let clock = catalog.get(Kind::Simulator, &scenario.simulator.name)?.description.clock;
    Ok(if clock.is_stepped() && scenario.mode == Mode::Lockstep { 1 } else { USUAL })
}

/// Drives of a scenario by one driver, by whether each failed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Drove(pub Vec<bool>);

impl Drove {
    /// How many are wanted before the first look: what can settle a verdict.
    pub fn at_first(most: u64) -> u64 {
        most.min(LEAD as u64)
    }

    /// Whether no more drives are wanted.
    pub fn is_over(&self, most: u64) -> bool {
        self.0.len() as u64 >= most || self.is_stable()
    }

    /// Whether one verdict leads, or there is nothing that it could differ from.
    pub fn is_stable(&self) -> bool {
        self.0.len() == 1 || self.failed().abs_diff(self.0.len() - self.failed()) >= LEAD
    }

    /// Whether the driver failed in most of them. As many failures as successes count as failed.
    pub fn has_failed(&self) -> bool {
        2 * self.failed() >= self.0.len()
    }

    fn failed(&self) -> usize {
        self.0.iter().filter(|failed| **failed).count()
    }

    /// The first two drives, whose number does not depend on how they went; none if there was only one.
    fn first_two(&self) -> Option<Drives> {
        let two = self.0.get(..2)?;
        let mut drives = Drives::default();
        two.iter().for_each(|failed| drives.add(*failed));
        Some(drives)
    }
}

/// A probability with its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Chance {
    /// The probability.
    pub value: f64,
    /// It is above this with a probability of 97.5 %.
    pub low: f64,
    /// It is below this.
    pub high: f64,
}

impl Chance {
    fn of(estimate: Estimate) -> Self {
        let Estimate { value, low, high } = estimate;
        Self { value, low, high }
    }

    fn text(&self) -> String {
        format!("{:.0} % ({:.0} to {:.0} %)", 100.0 * self.value, 100.0 * self.low, 100.0 * self.high)
    }
}

/// How far drives of the same scenario disagree, and how far the drivers do beyond that.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Luck {
    /// Scenarios that both drivers drove twice or more often.
    pub scenarios: usize,
    /// How many verdicts led by less than two drives in the end.
    pub unstable: usize,
    /// The probability that a second drive of the same scenario by the old driver comes out differently from the first.
    pub old: Chance,
    /// That of the new driver.
    pub new: Chance,
    /// That of both without a perturbation; none if there was no such scenario.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clear: Option<Chance>,
    /// That of both under perturbations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perturbed: Option<Chance>,
    /// How often both fail without a perturbation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fails_clear: Option<Chance>,
    /// How often both fail under perturbations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fails_perturbed: Option<Chance>,
    /// The probability that a drive of the old driver comes out differently from one of the new driver.
    pub drivers: Chance,
    /// How much of that is more than luck.
    pub beyond: Chance,
}

/// Drives that were repeated, while scenarios are looked at.
#[derive(Debug, Default)]
pub struct Counted {
    /// The first two drives of each scenario by the old and the new driver, and whether it has a perturbation.
    pairs: Vec<(Drives, Drives, bool)>,
    unstable: usize,
}

impl Counted {
    /// Looks at the drives of a scenario by both drivers.
    pub fn look(&mut self, step: &Step, old: &Drove, new: &Drove) {
        if let (Some(first), Some(second)) = (old.first_two(), new.first_two()) {
            self.pairs.push((first, second, !step.scenario.perturbations.is_empty()));
            self.unstable += usize::from(!old.is_stable()) + usize::from(!new.is_stable());
        }
    }

    /// What follows; none if nothing was repeated.
    pub fn luck(&self) -> Option<Luck> {
        let of = |drives: Vec<Drives>| repeats::flips(&drives, CONFIDENCE).map(Chance::of);
        let some = |perturbed: bool| self.pairs.iter().filter(move |pair| pair.2 == perturbed);
        let both = |perturbed: bool| {
            let pairs: Vec<(Drives, Drives)> = some(perturbed).map(|(old, new, _)| (*old, *new)).collect();
            repeats::flips_of_both(&pairs, CONFIDENCE).map(Chance::of)
        };
        let fails = |perturbed: bool| {
            let share = |(old, new, _): &(Drives, Drives, bool)| Some((old.share()? + new.share()?) / 2.0);
            let shares: Vec<f64> = some(perturbed).filter_map(share).collect();
            share::mean_of_shares(&shares, CONFIDENCE).map(Chance::of)
        };
        let units: Vec<Vec<(Drives, Drives)>> =
            self.pairs.iter().map(|(old, new, _)| vec![(*old, *new)]).collect();
        let apart = repeats::apart(&units, CONFIDENCE)?;
        Some(Luck {
            scenarios: self.pairs.len(),
            unstable: self.unstable,
            old: of(self.pairs.iter().map(|pair| pair.0).collect())?,
            new: of(self.pairs.iter().map(|pair| pair.1).collect())?,
            clear: both(false),
            perturbed: both(true),
            fails_clear: fails(false),
            fails_perturbed: fails(true),
            drivers: Chance::of(apart.differ),
            beyond: Chance::of(apart.beyond),
        })
    }
}

impl Luck {
    /// What it says, a sentence each.
    pub fn sentences(&self) -> Vec<String> {
        let mut sentences = vec![format!(
            "the simulator does not repeat itself: a second drive of the same scenario comes out differently with a probability of {} for the \
             old driver and {} for the new one (95 %), in {} scenarios; {} verdicts were not stable in the end",
            self.old.text(),
            self.new.text(),
            self.scenarios,
            self.unstable
        )];
        if let (Some(clear), Some(perturbed), Some(fails), Some(fails_perturbed)) =
            (&self.clear, &self.perturbed, &self.fails_clear, &self.fails_perturbed)
        {
            sentences.push(format!(
                "with a clear view {} of drives fail, and a second one differs in {}; under perturbations {} fail, and a second one differs in {}",
                fails.text(),
                clear.text(),
                fails_perturbed.text(),
                perturbed.text()
            ));
        }
        sentences.push(format!(
            "a drive of the new driver comes out differently from one of the old driver in {}; {} of these points are more than luck",
            self.drivers.text(),
            format_args!(
                "{:+.0} ({:+.0} to {:+.0})",
                100.0 * self.beyond.value,
                100.0 * self.beyond.low,
                100.0 * self.beyond.high
            )
        ));
        sentences
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{SMALL, suite};
    use crate::series::Series;
    use crate::step::step;

    fn drove(text: &str) -> Drove {
        Drove(text.chars().map(|c| c == 'F').collect())
    }

    #[test]
    fn a_verdict_is_stable_once_it_leads_by_two() {
        for (drives, most, over, stable, failed) in [
            ("F", 1, true, true, true),
            ("F", 5, true, true, true),
            ("FF", 5, true, true, true),
            ("FP", 5, false, false, true),
            ("FPP", 5, false, false, false),
            ("FPPP", 5, true, true, false),
            ("FPPFP", 5, true, false, false),
            ("FP", 2, true, false, true),
        ] {
            let drove = drove(drives);
            assert_eq!(
                (drove.is_over(most), drove.is_stable(), drove.has_failed()),
                (over, stable, failed),
                "{drives} of {most}"
            );
        }
        assert_eq!((Drove::at_first(1), Drove::at_first(5)), (1, 2));
    }

    #[test]
    fn luck_and_what_differs_are_apart() {
        let loaded = suite(SMALL).unwrap();
        let mut counted = Counted::default();
        assert_eq!(counted.luck(), None);
        for number in 0..40 {
            let step = step(&loaded, Series::Drawn, number).unwrap();
            let perturbed = !step.scenario.perturbations.is_empty();
            // Under perturbations the old driver is at its limit, and the new one fails.
            let (old, new) = if perturbed { ("FPFF", "FF") } else { ("PP", "PP") };
            counted.look(&step, &drove(old), &drove(new));
        }
        let luck = counted.luck().unwrap();
        assert!(luck.scenarios == 40 && luck.unstable == 0 && luck.new.value == 0.0 && luck.new.high < 0.1);
        assert_eq!((luck.clear.unwrap().value, luck.fails_clear.unwrap().value), (0.0, 0.0));
        let (flips, fails) = (luck.perturbed.unwrap().value, luck.fails_perturbed.unwrap().value);
        assert!((flips - 0.5).abs() < 1e-12 && (fails - 0.75).abs() < 1e-12, "{flips} {fails}");
        assert!(luck.drivers.value > 0.3 && luck.beyond.value.abs() < 1e-12, "{luck:?}");
        assert_eq!(luck.sentences().len(), 3);
    }
}
