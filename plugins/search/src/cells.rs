//! Cells over variables of a space: each holds what is nearer to its centre than to any other.
//!
//! Vassiliades, Chatzilygeroudis, Mouret, "Using centroidal Voronoi tessellations to scale up the multi-dimensional archive of
//! phenotypic elites algorithm" (2018): however many variables there are, there are as many cells as are wanted, of about the same
//! size. S. Lloyd, "Least squares quantization in PCM" (1982).

use std::collections::BTreeSet;

use pdk_sdk::seed::Random;

use crate::domain::Domain;

/// Positions that are drawn for each cell, of which it gets the middle.
const DRAWS: usize = 10;
/// How often the centres are moved to the middle of their cells.
const ROUNDS: usize = 10;

/// The cells.
#[derive(Debug, Default)]
pub struct Cells {
    /// The variables.
    features: Vec<usize>,
    /// A position for each of these, as a share of its range; that of a choice is its place.
    centres: Vec<Vec<f64>>,
}

impl Cells {
    /// This many cells over these variables of a domain, or one for each of their values if these are fewer.
    pub fn new(domain: &Domain, features: &[usize], wanted: usize, random: &mut Random) -> Self {
        let mut cells = Self { features: features.to_vec(), centres: Vec::new() };
        let draw = |_| cells.shares(domain, &domain.settle(domain.draw(domain.bounds(), random)));
        let draws: Vec<Vec<f64>> = (0..wanted * DRAWS).map(draw).collect();
        let mut known = BTreeSet::new();
        let mut centres: Vec<Vec<f64>> = draws
            .iter()
            .filter(|draw| known.insert(draw.iter().map(|share| share.to_bits()).collect::<Vec<_>>()))
            .cloned()
            .collect();
        let all = centres.len() <= wanted;
        centres.truncate(wanted);
        cells.centres = centres;
        for _ in 0..if all { 0 } else { ROUNDS } {
            cells.move_centres(domain, &draws);
        }
        cells
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.centres.len()
    }

    /// The number of the cell that holds settled positions.
    pub fn of(&self, domain: &Domain, x: &[f64]) -> usize {
        self.nearest(domain, &self.shares(domain, x))
    }

    fn shares(&self, domain: &Domain, x: &[f64]) -> Vec<f64> {
        let share = |&feature: &usize| match domain.is_choice(feature) {
            true => x[feature],
            false => domain.space().share(feature, x[feature]),
        };
        self.features.iter().map(share).collect()
    }

    /// The nearest one, and the first of several that are equally near.
    fn nearest(&self, domain: &Domain, shares: &[f64]) -> usize {
        let mut best = (f64::INFINITY, 0);
        for (number, centre) in self.centres.iter().enumerate() {
            let mut squares = 0.0;
            for ((&feature, a), b) in self.features.iter().zip(shares).zip(centre) {
                squares += match domain.is_choice(feature) {
                    true => f64::from(u8::from(a != b)),
                    false => (a - b) * (a - b),
                };
            }
            if squares < best.0 {
                best = (squares, number);
            }
        }
        best.1
    }

    /// Moves each centre to the middle of the draws in its cell: their mean, and of a choice what most of them have.
    fn move_centres(&mut self, domain: &Domain, draws: &[Vec<f64>]) {
        let mut members: Vec<Vec<usize>> = vec![Vec::new(); self.len()];
        for (place, draw) in draws.iter().enumerate() {
            members[self.nearest(domain, draw)].push(place);
        }
        for (centre, members) in
            self.centres.iter_mut().zip(members).filter(|(_, members)| !members.is_empty())
        {
            for (i, &feature) in self.features.iter().enumerate() {
                let values = members.iter().map(|&member| draws[member][i]);
                centre[i] = match domain.is_choice(feature) {
                    true => most_common(values.collect()),
                    false => values.sum::<f64>() / members.len() as f64,
                };
            }
        }
    }
}

/// What most of some values are, of equally many the smallest.
fn most_common(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let runs = values.chunk_by(|a, b| a == b);
    runs.fold((0, 0.0), |most, run| if run.len() > most.0 { (run.len(), run[0]) } else { most }).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{integers, key, reals};

    #[test]
    fn cells_are_of_about_the_same_size_however_many_variables_there_are() {
        for variables in [1, 4, 12] {
            let domain = Domain::new(&reals(variables));
            let mut random = key(1).sequence();
            let features: Vec<usize> = (0..variables).collect();
            let cells = Cells::new(&domain, &features, 50, &mut random);
            assert_eq!(cells.len(), 50);
            let mut counts = [0; 50];
            for _ in 0..10_000 {
                counts[cells.of(&domain, &domain.draw(domain.bounds(), &mut random))] += 1;
            }
            assert!(counts.iter().all(|count| (20..=600).contains(count)), "{variables}: {counts:?}");
        }
    }

    #[test]
    fn few_values_have_a_cell_each() {
        let domain = Domain::new(&integers(2, 4));
        let cells = Cells::new(&domain, &[0, 1], 100, &mut key(2).sequence());
        assert_eq!(cells.len(), 25);
        let all: BTreeSet<usize> =
            (0..25).map(|i| cells.of(&domain, &[f64::from(i / 5), f64::from(i % 5)])).collect();
        assert_eq!(all.len(), 25);
        // Of one variable alone.
        assert_eq!(Cells::new(&domain, &[1], 100, &mut key(2).sequence()).len(), 5);
    }

    #[test]
    fn a_choice_has_no_middle() {
        use pdk_sdk::prelude::{Range, Space, Variable};
        let choice = Range::Choice { values: vec!["a".into(), "b".into(), "c".into()] };
        let variables = vec![
            Variable { name: "kind".into(), range: choice },
            Variable { name: "x".into(), range: Range::Real { min: -5.0, max: 5.0 } },
        ];
        let domain = Domain::new(&Space { variables, constraints: Vec::new() });
        let cells = Cells::new(&domain, &[0, 1], 12, &mut key(3).sequence());
        assert!(cells.centres.iter().all(|centre| [0.0, 1.0, 2.0].contains(&centre[0])));
        for kind in [0.0, 1.0, 2.0] {
            let of_kind = (0..100).map(|i| cells.of(&domain, &[kind, f64::from(i) / 10.0 - 5.0]));
            assert!(of_kind.into_iter().all(|cell| cells.centres[cell][0] == kind));
        }
    }
}
