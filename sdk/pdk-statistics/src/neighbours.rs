//! Whether neighbouring blocks of a recording resemble each other, so that they cannot be counted as independent observations.
//!
//! A test over blocks takes them for independent draws. If blocks are shorter than what the recording remembers, it is sure too soon. Blocks
//! that are looked at in a random order are rarely neighbours at first, when it does little harm, and often later, when it would: then
//! their correlation shows.

use std::collections::BTreeMap;

/// The fewest pairs of neighbours that say anything.
const FEWEST: usize = 10;
/// Of independent blocks, the correlation is above this many of its standard deviations in one case of twenty.
const LIMIT: f64 = 1.645;

/// Values of blocks by their places in a recording. Blocks of which one follows the other have places that follow each other.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Neighbours {
    values: BTreeMap<usize, f64>,
}

impl Neighbours {
    /// Takes the value of a block into account.
    pub fn add(&mut self, place: usize, value: f64) {
        self.values.insert(place, value);
    }

    /// The correlation between neighbours; none if there are too few pairs or all values are the same.
    pub fn correlation(&self) -> Option<f64> {
        self.found().map(|(correlation, _)| correlation)
    }

    /// Whether neighbours resemble each other more than independent ones do in one case of twenty.
    pub fn resemble(&self) -> bool {
        self.found().is_some_and(|(correlation, pairs)| correlation * (pairs as f64).sqrt() > LIMIT)
    }

    fn found(&self) -> Option<(f64, usize)> {
        let count = self.values.len() as f64;
        let mean = self.values.values().sum::<f64>() / count;
        let variance = self.values.values().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count;
        let products: Vec<f64> = self
            .values
            .iter()
            .filter_map(|(place, value)| Some((value - mean) * (self.values.get(&(place + 1))? - mean)))
            .collect();
        let pairs = products.len();
        (pairs >= FEWEST && variance > 0.0)
            .then(|| (products.iter().sum::<f64>() / pairs as f64 / variance, pairs))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: impl IntoIterator<Item = (usize, f64)>) -> Neighbours {
        Neighbours { values: values.into_iter().collect() }
    }

    #[test]
    fn runs_resemble_each_other_and_turns_do_not() {
        let runs = of((0..40).map(|place| (place, f64::from(u8::from(place % 10 < 5)))));
        assert!(runs.resemble() && runs.correlation().unwrap() > 0.5, "{runs:?}");
        let turns = of((0..40).map(|place| (place, f64::from(u8::from(place % 2 == 0)))));
        assert!(!turns.resemble() && turns.correlation().unwrap() < -0.9);
        // The same runs with a gap between all blocks have no neighbours.
        assert_eq!(
            of((0..40).map(|place| (2 * place, f64::from(u8::from(place % 10 < 5))))).correlation(),
            None
        );
    }

    #[test]
    fn few_pairs_and_equal_values_say_nothing() {
        assert_eq!(of((0..10).map(|place| (place, place as f64))).correlation(), None);
        assert!(of((0..11).map(|place| (place, place as f64))).correlation().is_some());
        assert_eq!(of((0..50).map(|place| (place, 0.0))).correlation(), None);
        assert_eq!(Neighbours::default().correlation(), None);
    }
}
