//! NSGA-II-DT: NSGA-II that is guided into the regions of the space in which candidates are critical.
//!
//! Ben Abdessalem, Nejati, Briand, Stifter, "Testing vision-based control systems using learnable evolutionary algorithms"
//! (2018). A decision tree over all evaluations tells in which regions most candidates are critical. In these, offspring is bred
//! that stays within the region, and the rest of the region is filled, so that its extent shows. A share of the evaluations goes
//! elsewhere, two thirds of it to several places that are better than all that lies next to them, so that further regions are found.
//! (What is best of all lies just beside the regions that are known.)
//!
//! `variant=published` is the algorithm as its published integration runs it: see [`crate::published`].

use std::collections::VecDeque;

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;
use pdk_statistics::ranking::survivors_of_many;
use pdk_statistics::tree::{Limits, PUBLISHED, Tree};

use crate::domain::{Domain, Region, Seen, contains};
use crate::niches::{NEARBY, objectives, promising};
use crate::nsga2::{breed, draw_new, initial, population, size};
use crate::published::Published;
use crate::strategy::{Next, Rule};
use crate::variation::Variation;

/// Of how many draws the most isolated is taken where a region is filled.
const DRAWS: usize = 12;
/// How far beyond a region it is filled, in shares of each variable's range, so that its border shows.
const MARGIN: f64 = 0.05;
/// Half the width of the region around a critical candidate that lies in none, in shares of each variable's range.
const AROUND: f64 = 0.08;
/// The most regions of one round.
const MOST_REGIONS: usize = 12;

/// See the [module](self).
pub struct Nsga2Dt {
    config: Config,
    rule: Variant,
}

enum Variant {
    Meant(Box<Meant>),
    Published(Box<Published>),
}

impl Rule for Nsga2Dt {
    fn description() -> Description {
        let description = Description::search(
            "nsga2_dt",
            "NSGA-II-DT: NSGA-II, guided by a decision tree into the regions in which candidates are critical",
        )
        .version(3)
        .source("R. Ben Abdessalem, S. Nejati, L. Briand, T. Stifter (2018)")
        .divergence(
            "`variant=published` searches from the front of each region alone, leaves the regions' bounds out, passes over \
             regions in which all are critical, repeats one stream of random numbers, and cuts whole numbers off",
        )
        .parameter(Parameter::choice(
            "variant",
            &["meant", "published"],
            "the algorithm as it is meant, or as its published integration runs it",
        ))
        .parameter(population())
        .parameter(
            Parameter::integer("generations", 3, "generations until the regions are determined anew").range(1.0, 1000.0),
        )
        .parameter(
            Parameter::number("explore", 0.4, "the share of candidates that lie outside of the critical regions")
                .range(0.0, 1.0)
                .only_for("variant", "meant"),
        );
        Variation::parameters(description)
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { config: config.clone(), rule: variant(config) })
    }

    fn start(&mut self, _problem: &Problem, _domain: &Domain) -> Result<()> {
        self.rule = variant(&self.config);
        Ok(())
    }

    fn next(&mut self, domain: &Domain, random: &mut Random, proposed: usize, told: &[Point]) -> Next {
        match &mut self.rule {
            Variant::Meant(meant) => meant.next(domain, random, proposed, told),
            Variant::Published(published) => published.next(domain, random, proposed, told),
        }
    }
}

fn variant(config: &Config) -> Variant {
    match config.text("variant") {
        "published" => Variant::Published(Box::new(Published::new(config))),
        _ => Variant::Meant(Box::new(Meant {
            size: size(config),
            generations: config.integer("generations"),
            explore: config.number("explore"),
            variation: Variation::new(config),
            regions: Vec::new(),
            generation: 0,
            seen: Seen::default(),
            rest: VecDeque::new(),
        })),
    }
}

/// The algorithm as it is meant.
struct Meant {
    size: usize,
    generations: i64,
    explore: f64,
    variation: Variation,
    /// The critical regions of this round.
    regions: Vec<Region>,
    /// The number of the generation in this round.
    generation: i64,
    seen: Seen,
    /// The rest of this generation.
    rest: VecDeque<Vec<f64>>,
}

impl Meant {
    fn next(&mut self, domain: &Domain, random: &mut Random, proposed: usize, told: &[Point]) -> Next {
        if self.rest.is_empty() {
            if told.len() < proposed {
                return Next::Wait;
            }
            self.rest = match proposed {
                0 => initial(domain, self.size, &mut self.seen, random).into(),
                _ => self.generation(domain, random, told).into(),
            };
        }
        self.rest.pop_front().map_or(Next::End, Next::Propose)
    }

    fn generation(&mut self, domain: &Domain, random: &mut Random, told: &[Point]) -> Vec<Vec<f64>> {
        if self.generation == 0 {
            self.regions = critical_regions(domain, told);
        }
        self.generation = (self.generation + 1) % self.generations;
        let mut offspring = Vec::with_capacity(self.size);
        if !self.regions.is_empty() {
            let within = self.size - libm::round(self.size as f64 * self.explore) as usize;
            let regions = self.regions.clone();
            for (number, region) in regions.iter().enumerate() {
                // Each as many, the first ones get what is left over.
                let share = within / regions.len() + usize::from(number < within % regions.len());
                let inside = |point: &&Point| contains(region, &point.x);
                let bred = share / 2;
                offspring.extend(self.bred(domain, region, told.iter().filter(inside), bred, random));
                let (wide, filled) = (widened(domain, region), share - bred);
                offspring.extend(self.filled(domain, &wide, told, filled, random));
            }
        }
        let (everywhere, aside) =
            (domain.bounds().clone(), libm::round(self.size as f64 * self.explore) as usize);
        if self.regions.is_empty() {
            // NSGA-II, which leads to where there may be some.
            let bred = self.size - aside;
            offspring.extend(self.bred(domain, &everywhere, told.iter(), bred, random));
        }
        let places = promising(domain, told, &objectives(told), self.size);
        for place in &places {
            let share = aside * 2 / 3 / places.len();
            let region = around(domain, &told[*place].x, NEARBY);
            let inside = |point: &&Point| contains(&region, &point.x);
            // What is bred goes on in small steps, what is drawn finds the way.
            let drawn = share.div_ceil(2);
            offspring.extend(self.bred(domain, &region, told.iter().filter(inside), share - drawn, random));
            offspring.extend(self.filled(domain, &region, told, drawn, random));
        }
        let filled = self.size - offspring.len();
        offspring.extend(self.filled(domain, &everywhere, told, filled, random));
        offspring
    }

    /// Offspring of the best of these points, within a region.
    fn bred<'a>(
        &mut self,
        domain: &Domain,
        region: &Region,
        points: impl Iterator<Item = &'a Point>,
        n: usize,
        random: &mut Random,
    ) -> Vec<Vec<f64>> {
        let points: Vec<&Point> = points.collect();
        let parents = survivors_of_many(&points, self.size);
        breed(&self.variation, domain, region, &parents, n, &mut self.seen, random)
    }

    /// Positions in a region, each far from all that are known: of several draws the most isolated.
    fn filled(
        &mut self,
        domain: &Domain,
        region: &Region,
        told: &[Point],
        n: usize,
        random: &mut Random,
    ) -> Vec<Vec<f64>> {
        let mut known: Vec<Vec<f64>> =
            told.iter().filter(|point| contains(region, &point.x)).map(|point| point.x.clone()).collect();
        let mut filled = Vec::with_capacity(n);
        for _ in 0..n {
            let mut best: Option<(f64, Vec<f64>)> = None;
            for _ in 0..DRAWS {
                let x = domain.settle(domain.draw(region, random));
                if self.seen.has(&x) {
                    continue;
                }
                let isolation = known
                    .iter()
                    .map(|other| domain.space().distance(&x, other))
                    .fold(f64::INFINITY, f64::min);
                if best.as_ref().is_none_or(|(most, _)| isolation > *most) {
                    best = Some((isolation, x));
                }
            }
            let x = match best {
                Some((_, x)) => x,
                // The region is exhausted, as far as chance tells.
                None => draw_new(domain, domain.bounds(), &mut self.seen, random),
            };
            self.seen.add(&x);
            known.push(x.clone());
            filled.push(x);
        }
        filled
    }
}

/// The regions in which most evaluated points are critical, and those around critical points that lie in none of them.
fn critical_regions(domain: &Domain, told: &[Point]) -> Vec<Region> {
    let evaluated: Vec<&Point> = told.iter().filter(|point| !point.f.is_empty()).collect();
    let limits = Limits { split_share: 0.0, leaf: 3, decrease: 0.005, balanced: true, ..PUBLISHED };
    let tree = Tree::new(domain.space(), &evaluated, limits);
    let mut leaves = tree.leaves();
    leaves.retain(|leaf| leaf.share() > 0.5);
    // The largest first, by what they hold.
    leaves.sort_by_key(|leaf| std::cmp::Reverse(leaf.critical));
    let mut regions: Vec<Region> = leaves.into_iter().map(|leaf| leaf.region.clone()).collect();
    for point in evaluated.iter().filter(|point| point.critical) {
        if !regions.iter().any(|region| contains(region, &point.x)) {
            regions.push(around(domain, &point.x, AROUND));
        }
    }
    regions.truncate(MOST_REGIONS);
    regions
}

/// The region around a position, so wide to each side, in shares of each variable's range.
fn around(domain: &Domain, x: &[f64], half: f64) -> Region {
    let side = |i: usize| {
        let (low, high) = domain.bounds()[i];
        if domain.is_choice(i) {
            return (x[i], x[i]);
        }
        let half = half * (high - low);
        let half = if domain.is_discrete(i) { libm::round(half).max(1.0) } else { half };
        ((x[i] - half).max(low), (x[i] + half).min(high))
    };
    (0..domain.len()).map(side).collect()
}

/// A region and what lies just beyond it.
fn widened(domain: &Domain, region: &Region) -> Region {
    let side = |i: usize| {
        let ((low, high), (lowest, highest)) = (region[i], domain.bounds()[i]);
        if domain.is_choice(i) {
            return (low, high);
        }
        let margin = MARGIN * (highest - lowest);
        let margin = if domain.is_discrete(i) { libm::round(margin).max(1.0) } else { margin };
        ((low - margin).max(lowest), (high + margin).min(highest))
    };
    (0..domain.len()).map(side).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomSearch;
    use crate::strategy::Strategy;
    use crate::testing::{make, problem, reals, search};

    /// Two boxes of .8 % each in opposite corners; the nearer the better.
    fn boxes(x: &[f64]) -> (Vec<f64>, bool) {
        let miss = |corner: f64| x.iter().map(|x| ((x - corner).abs() - 0.1).max(0.0)).sum::<f64>();
        let nearest = miss(0.25).min(miss(0.75));
        (vec![nearest], nearest == 0.0)
    }

    #[test]
    fn all_critical_regions_are_found_and_filled() {
        let problem = problem(reals(3));
        let found = |all: Vec<(Vec<f64>, Vec<f64>, bool)>| {
            let critical = all.iter().filter(|(_, _, critical)| *critical);
            let (low, high): (Vec<_>, Vec<_>) = critical.partition(|(x, ..)| x[0] < 0.5);
            [low.len(), high.len()]
        };
        for seed in 0..3 {
            let mut strategy: Strategy<Nsga2Dt> = make(&[("population", 40.into())]);
            let guided = found(search(&mut strategy, &problem, seed, 1000, boxes));
            let mut strategy: Strategy<RandomSearch> = make(&[]);
            let random = found(search(&mut strategy, &problem, seed, 1000, boxes));
            assert!(guided.iter().min() > random.iter().max(), "{guided:?} {random:?}");
            assert!(guided.iter().all(|&count| count > 30), "{guided:?}");
        }
    }

    #[test]
    fn the_published_variant_is_there_for_comparison() {
        let mut strategy: Strategy<Nsga2Dt> = make(&[("variant", "published".into())]);
        let all = search(&mut strategy, &problem(reals(3)), 1, 500, boxes);
        // It searches from the front of 75 points alone: one point of one objective, which it proposes again at once.
        assert!(all[..75].iter().any(|(x, ..)| *x == all[75].0));
    }
}
