//! NSGA-II: generations of offspring, of which the non-dominated and the most isolated survive.
//!
//! Deb, Pratap, Agarwal, Meyarivan, "A fast and elitist multiobjective genetic algorithm: NSGA-II" (2002). Nothing is proposed
//! twice as long as there is something new: copies tell nothing.

use std::collections::VecDeque;

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;
use pdk_statistics::ranking::{Ranked, survivors};

use crate::domain::{Domain, Region, Seen};
use crate::strategy::{Next, Rule};
use crate::variation::Variation;

/// How often a new child is bred for, for each that is wanted, before one is drawn instead.
const TRIES: usize = 20;
/// How often a new position is drawn for before a known one is taken.
const DRAWS: usize = 200;

/// See the [module](self).
pub struct Nsga2 {
    size: usize,
    variation: Variation,
    population: Vec<Ranked>,
    seen: Seen,
    /// The rest of the generation, and where it begins.
    rest: VecDeque<Vec<f64>>,
    begin: usize,
}

impl Rule for Nsga2 {
    fn description() -> Description {
        let description = Description::search(
            "nsga2",
            "NSGA-II: generations of offspring, of which the non-dominated and the most isolated survive",
        )
        .version(2)
        .source("K. Deb, A. Pratap, S. Agarwal, T. Meyarivan (2002)")
        .parameter(population());
        Variation::parameters(description)
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self {
            size: size(config),
            variation: Variation::new(config),
            population: Vec::new(),
            seen: Seen::default(),
            rest: VecDeque::new(),
            begin: 0,
        })
    }

    fn start(&mut self, _problem: &Problem, _domain: &Domain) -> Result<()> {
        *self = Self {
            size: self.size,
            variation: self.variation.clone(),
            population: Vec::new(),
            seen: Seen::default(),
            rest: VecDeque::new(),
            begin: 0,
        };
        Ok(())
    }

    fn next(&mut self, domain: &Domain, random: &mut Random, proposed: usize, told: &[Point]) -> Next {
        if self.rest.is_empty() {
            if told.len() < proposed {
                return Next::Wait;
            }
            self.rest = if proposed == 0 {
                initial(domain, self.size, &mut self.seen, random).into()
            } else {
                let parents = self.population.iter().map(|ranked| &ranked.point);
                let all: Vec<&Point> = parents.chain(&told[self.begin..]).collect();
                self.population = survivors(&all, self.size);
                breed(
                    &self.variation,
                    domain,
                    domain.bounds(),
                    &self.population,
                    self.size,
                    &mut self.seen,
                    random,
                )
                .into()
            };
            self.begin = proposed;
        }
        self.rest.pop_front().map_or(Next::End, Next::Propose)
    }
}

/// The parameter for the size of a population.
pub fn population() -> Parameter {
    Parameter::integer("population", 75, "candidates in a generation").range(2.0, 100_000.0)
}

/// The size of the population.
pub fn size(config: &Config) -> usize {
    usize::try_from(config.integer("population")).unwrap_or_default()
}

/// A first population: a Latin hypercube.
pub fn initial(domain: &Domain, n: usize, seen: &mut Seen, random: &mut Random) -> Vec<Vec<f64>> {
    let mut population = Vec::with_capacity(n);
    for x in domain.latin_hypercube(domain.bounds(), n, random) {
        let x = domain.settle(x);
        let x = if domain.keeps_constraints(&x) && seen.add(&x) {
            x
        } else {
            draw_new(domain, domain.bounds(), seen, random)
        };
        population.push(x);
    }
    population
}

/// A new position within a region, and, if none is found, a known one.
pub fn draw_new(domain: &Domain, region: &Region, seen: &mut Seen, random: &mut Random) -> Vec<f64> {
    let mut x = Vec::new();
    for _ in 0..DRAWS {
        x = domain.settle(domain.draw(region, random));
        if seen.add(&x) {
            break;
        }
    }
    x
}

/// New offspring of a population within a region: as much as is wanted, filled up with draws where breeding gives nothing new.
pub fn breed(
    variation: &Variation,
    domain: &Domain,
    region: &Region,
    population: &[Ranked],
    n: usize,
    seen: &mut Seen,
    random: &mut Random,
) -> Vec<Vec<f64>> {
    let mut offspring = Vec::with_capacity(n);
    let mut tournament = Tournament::default();
    for _ in 0..n * TRIES {
        if offspring.len() >= n || population.is_empty() {
            break;
        }
        let parents = [tournament.winner(population, random), tournament.winner(population, random)];
        for child in variation.children(domain, region, parents, random) {
            if offspring.len() < n && seen.add(&child) {
                offspring.push(child);
            }
        }
    }
    while offspring.len() < n {
        offspring.push(draw_new(domain, region, seen, random));
    }
    offspring
}

/// Tournaments of two, in which each of a population takes part equally often, as in the authors' program.
#[derive(Default)]
struct Tournament {
    /// Who has not taken part in this round.
    waiting: Vec<usize>,
}

impl Tournament {
    /// The better of the next two.
    fn winner<'a>(&mut self, population: &'a [Ranked], random: &mut Random) -> &'a [f64] {
        let (a, b) = (self.next(population.len(), random), self.next(population.len(), random));
        let (a, b) = (&population[a], &population[b]);
        if b.order(a).is_lt() { &b.point.x } else { &a.point.x }
    }

    fn next(&mut self, count: usize, random: &mut Random) -> usize {
        if self.waiting.is_empty() {
            self.waiting = (0..count).collect();
            random.shuffle(&mut self.waiting);
        }
        self.waiting.pop().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::Strategy;
    use crate::testing::{integers, key, make, problem, reals, search};
    use pdk_statistics::hypervolume::hypervolume;

    #[test]
    fn the_front_of_a_known_problem_is_approached() {
        // ZDT1 with 10 variables.
        let zdt1 = |x: &[f64]| {
            let g = 1.0 + 9.0 * x[1..].iter().sum::<f64>() / 9.0;
            (vec![x[0], g * (1.0 - libm::sqrt(x[0] / g))], false)
        };
        let mut strategy: Strategy<Nsga2> = make(&[("population", 40.into())]);
        let all = search(&mut strategy, &problem(reals(10)), 1, 4000, zdt1);
        let front: Vec<Vec<f64>> = all.into_iter().map(|(_, f, _)| f).collect();
        let volume = hypervolume(&front, &[1.1, 1.1]);
        // The whole front dominates 1.21 - 1 / 3.
        assert!(volume > 0.98 * (1.21 - 1.0 / 3.0), "{volume}");
    }

    #[test]
    fn no_part_of_a_front_in_several_parts_is_lost() {
        // ZDT3 with 30 variables.
        let zdt3 = |x: &[f64]| {
            let g = 1.0 + 9.0 * x[1..].iter().sum::<f64>() / 29.0;
            let share = x[0] / g;
            let waves = share * libm::sin(10.0 * std::f64::consts::PI * x[0]);
            (vec![x[0], g * (1.0 - libm::sqrt(share) - waves)], false)
        };
        let lost = |parameters: &[(&str, pdk_sdk::serde_json::Value)]| {
            let part_is_lost = |seed: &u8| {
                let mut strategy: Strategy<Nsga2> = make(parameters);
                let all = search(&mut strategy, &problem(reals(30)), *seed, 15_000, zdt3);
                // The whole front dominates 1.328.
                let front: Vec<Vec<f64>> = all.into_iter().map(|(_, f, _)| f).collect();
                hypervolume(&front, &[1.1, 1.1]) < 1.3
            };
            [0, 1, 2, 27, 39].into_iter().filter(part_is_lost).collect::<Vec<u8>>()
        };
        assert!(lost(&[]).is_empty());
        // Smaller steps do not always lead from one part to another.
        assert_eq!(lost(&[("eta_mutation", 20.into())]), [27, 39]);
    }

    #[test]
    fn each_of_a_population_takes_part_in_equally_many_tournaments() {
        let mut random = key(4).sequence();
        let ranked = |number: usize| Ranked {
            point: Point { x: vec![number as f64], f: vec![], violation: 0.0, critical: false },
            front: number,
            room: 0.0,
        };
        let population: Vec<Ranked> = (0..6).map(ranked).collect();
        let mut tournament = Tournament::default();
        for _ in 0..50 {
            let winners: Vec<f64> = (0..3).map(|_| tournament.winner(&population, &mut random)[0]).collect();
            // The best wins, the worst does not, and none wins twice.
            assert!(winners.contains(&0.0) && !winners.contains(&5.0), "{winners:?}");
            assert!((0..3).all(|i| !winners[i + 1..].contains(&winners[i])), "{winners:?}");
        }
    }

    #[test]
    fn the_optimum_of_whole_numbers_is_found_where_it_is_not_at_a_bound() {
        let aim = [37.0, 61.0, 83.0];
        let miss =
            |x: &[f64]| (vec![x.iter().zip(aim).map(|(x, aim)| (x - aim) * (x - aim)).sum::<f64>()], false);
        for seed in 0..5 {
            let mut strategy: Strategy<Nsga2> = make(&[("population", 20.into())]);
            let all = search(&mut strategy, &problem(integers(3, 100)), seed, 1500, miss);
            assert!(all.iter().any(|(x, ..)| *x == aim), "seed {seed}");
            let mut distinct: Vec<_> = all.iter().map(|(x, ..)| format!("{x:?}")).collect();
            distinct.sort_unstable();
            distinct.dedup();
            assert_eq!(distinct.len(), all.len());
        }
    }

    #[test]
    fn constraints_come_before_objectives() {
        // The best lies where the constraint does not hold.
        let mut strategy: Strategy<Nsga2> = make(&[("population", 20.into())]);
        let problem = problem(reals(2));
        strategy.start(&problem, &key(3)).unwrap();
        let mut last = Vec::new();
        for _ in 0..40 {
            let candidates = strategy.ask(100).unwrap();
            let evaluated = candidates.iter().map(|candidate| {
                let x = problem.space.positions(&candidate.values).unwrap();
                let violations = vec![(0.6 - x[0]).max(0.0)];
                last.push((x.clone(), violations[0]));
                Evaluated {
                    id: candidate.id,
                    objectives: vec![x[0] + x[1]],
                    violations,
                    critical: false,
                    failure: None,
                }
            });
            strategy.tell(&evaluated.collect::<Vec<_>>()).unwrap();
        }
        let best =
            last.iter().filter(|(_, v)| *v == 0.0).map(|(x, _)| x[0] + x[1]).fold(f64::INFINITY, f64::min);
        assert!(best < 0.62, "{best}");
        let kept = last[last.len() - 20..].iter().filter(|(_, violation)| *violation == 0.0).count();
        assert!(kept >= 5, "{kept}");
    }
}
