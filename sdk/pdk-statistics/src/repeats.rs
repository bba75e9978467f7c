//! Drives of the same scenario that come out differently: how often, and how much of a difference between two conditions is more than that.
//!
//! A simulator with its own clock does not repeat itself. Where a driver is at its limit, one drive of a scenario fails and the next does
//! not. Two drives that differ in something else as well, such as a perturbation, disagree at least as often. What goes beyond is the effect.

use crate::drives::Drives;
use crate::estimate::Estimate;
use crate::mean;
use crate::share::mean_of_shares;

/// How often two drives of the same scenario disagree, as the mean over scenarios that were driven twice or more often. None if none was.
///
/// It takes all pairs of a scenario's drives, so their number must not depend on how they went. If they were repeated until something
/// was clear, count the first two.
pub fn flips(scenarios: &[Drives], confidence: f64) -> Option<Estimate> {
    let found: Vec<f64> = scenarios.iter().filter_map(|drives| flip(*drives)).collect();
    mean_of_shares(&found, confidence)
}

/// The same of scenarios that two drivers drove, which are the units: a scenario that is on the edge is so for both.
pub fn flips_of_both(scenarios: &[(Drives, Drives)], confidence: f64) -> Option<Estimate> {
    let both = |(a, b): &(Drives, Drives)| Some((flip(*a)? + flip(*b)?) / 2.0);
    let found: Vec<f64> = scenarios.iter().filter_map(both).collect();
    mean_of_shares(&found, confidence)
}

/// The share of pairs of a scenario's drives that disagree; none without a pair.
fn flip(Drives { failed, of }: Drives) -> Option<f64> {
    let pairs = of.checked_mul(of.checked_sub(1)?).filter(|pairs| *pairs > 0)?;
    Some(2.0 * (failed * (of - failed)) as f64 / pairs as f64)
}

/// How far two conditions are apart on scenarios that were driven twice or more often under both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Apart {
    /// How often a drive under one condition disagrees with one under the other.
    pub differ: Estimate,
    /// How often two drives under the same condition disagree: how often the two above would if the conditions did not differ.
    pub luck: Estimate,
    /// The first less the second. It is the mean over scenarios of the squared difference between the probabilities of failing, and 0 if
    /// the conditions are the same.
    pub beyond: Estimate,
    /// Roads, or other units that are independent.
    pub units: usize,
}

/// Compares two conditions. Each unit, such as a road, has the drives of its scenarios under the first and under the second condition.
/// None if no scenario was driven twice under both.
///
/// Most scenarios come out the same every time, so few of them say anything about luck. With 40 scenarios of which half always pass, nominal
/// 95 % intervals of what goes beyond luck cover it in 88 % of studies.
pub fn apart(units: &[Vec<(Drives, Drives)>], confidence: f64) -> Option<Apart> {
    let of_scenario = |(a, b): &(Drives, Drives)| {
        let luck = (flip(*a)? + flip(*b)?) / 2.0;
        let (first, second) = (a.share()?, b.share()?);
        Some([first * (1.0 - second) + second * (1.0 - first), luck])
    };
    let of_unit = |unit: &Vec<(Drives, Drives)>| {
        let found: Vec<[f64; 2]> = unit.iter().filter_map(of_scenario).collect();
        let mean = |of: usize| found.iter().map(|found| found[of]).sum::<f64>() / found.len() as f64;
        (!found.is_empty()).then(|| [mean(0), mean(1)])
    };
    let found: Vec<[f64; 2]> = units.iter().filter_map(of_unit).collect();
    let column = |of: fn(&[f64; 2]) -> f64| found.iter().map(of).collect::<Vec<f64>>();
    Some(Apart {
        differ: mean_of_shares(&column(|unit| unit[0]), confidence)?,
        luck: mean_of_shares(&column(|unit| unit[1]), confidence)?,
        beyond: mean::over_roads(&column(|unit| unit[0] - unit[1]), (-1.0, 1.0), confidence)?,
        units: found.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_seed::Key;

    fn of(failed: u64, of: u64) -> Drives {
        Drives { failed, of }
    }

    #[test]
    fn pairs_that_disagree_are_counted() {
        assert_eq!(flip(of(1, 2)), Some(1.0));
        assert!((flip(of(1, 3)).unwrap() - 2.0 / 3.0).abs() < 1e-12);
        assert_eq!((flip(of(3, 3)), flip(of(0, 1)), flip(of(0, 0))), (Some(0.0), None, None));
        let found = flips(&[of(1, 2), of(0, 2), of(2, 2), of(0, 2), of(1, 1)], 0.95).unwrap();
        assert!(found.value == 0.25 && found.low < 0.25 && found.high > 0.25);
        assert!(flips(&[of(1, 1)], 0.95).is_none());
        let none = flips(&[of(0, 2); 10], 0.95).unwrap();
        assert!((none.high - 0.2775).abs() < 1e-4, "what was never seen stays possible: {none:?}");
    }

    #[test]
    fn luck_is_not_an_effect_and_an_effect_is_not_luck() {
        // Every other drive fails under both conditions: they disagree as often as drives under one of them.
        let luck = apart(&vec![vec![(of(1, 2), of(1, 2))]; 40], 0.95).unwrap();
        assert_eq!((luck.differ.value, luck.luck.value, luck.beyond.value), (0.5, 1.0, -0.5));
        let effect = apart(&vec![vec![(of(0, 2), of(2, 2))]; 40], 0.95).unwrap();
        assert_eq!((effect.differ.value, effect.luck.value, effect.beyond.value), (1.0, 0.0, 1.0));
        assert!(apart(&[vec![(of(0, 1), of(1, 2))]], 0.95).is_none());
    }

    /// Drives of 40 scenarios, each with a probability of failing of its own under the two conditions.
    fn study(random: &mut pdk_seed::Random, effect: f64) -> Apart {
        let mut drives = |probability: f64| {
            let mut drives = Drives::default();
            (0..3).for_each(|_| drives.add(random.unit() < probability));
            drives
        };
        let scenarios: Vec<_> = (0..40)
            .map(|number| {
                let probability = [0.0, 0.0, 0.1, 0.5][number % 4];
                vec![(drives(probability), drives(probability + effect))]
            })
            .collect();
        apart(&scenarios, 0.95).unwrap()
    }

    #[test]
    fn intervals_cover_what_is_true() {
        for (effect, luck) in [(0.0, 0.17), (0.4, 0.29)] {
            let mut random = Key([effect as u8 + 3; 32]).sequence();
            let found: Vec<Apart> = (0..300).map(|_| study(&mut random, effect)).collect();
            let covered = |of: fn(&Apart) -> Estimate, truth: f64| {
                let covers = |apart: &&Apart| of(apart).low <= truth && truth <= of(apart).high;
                found.iter().filter(covers).count() as f64 / 300.0
            };
            let mean = found.iter().map(|apart| apart.beyond.value).sum::<f64>() / 300.0;
            assert!((mean - effect * effect).abs() < 0.01, "{effect}: {mean}");
            let (beyond, by_luck) =
                (covered(|apart| apart.beyond, effect * effect), covered(|apart| apart.luck, luck));
            println!("effect {effect}: beyond luck {beyond}, luck {by_luck}");
            assert!(beyond > 0.85 && by_luck > 0.9, "{effect}: {beyond} {by_luck}");
        }
    }
}
