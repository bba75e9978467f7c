//! NSGA-II-DT as its published integration runs it, for comparison. What it does that is hardly meant:
//!
//! - An inner search begins with the front of its region alone, one to six points, and its population has that size.
//! - The bounds of a region are not given to it: a region acts through its front only.
//! - A region in which all are critical is passed over.
//! - The tree is made from those that survived each generation, so that a point which lives long counts several times.
//! - Each inner search repeats the same stream of random numbers.
//! - Whole numbers are cut off towards zero, not rounded.

use std::collections::VecDeque;

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;
use pdk_statistics::ranking::{Ranked, dominates, survivors};
use pdk_statistics::tree::{PUBLISHED, Tree};

use crate::domain::Domain;
use crate::nsga2::size;
use crate::strategy::Next;
use crate::variation::Variation;

/// How often new offspring is bred for before what there is has to do.
const TRIES: usize = 100;

/// See the [module](self).
pub struct Published {
    size: usize,
    generations: i64,
    variation: Variation,
    /// From here every inner search draws.
    stream: Option<Random>,
    /// The populations of regions that wait for their inner search, the next one last.
    regions: Vec<Vec<Point>>,
    /// The inner search.
    inner: Option<Inner>,
    /// The front over everything.
    best: Vec<Point>,
    /// The survivors of every generation, copies among them.
    all: Vec<Point>,
    /// What is being evaluated, and where it begins.
    rest: VecDeque<Vec<f64>>,
    begin: usize,
}

/// An inner search.
struct Inner {
    size: usize,
    generation: i64,
    population: Vec<Ranked>,
    random: Random,
}

impl Published {
    /// The algorithm with the parameters of the strategy.
    pub fn new(config: &Config) -> Self {
        let variation = Variation { truncate: true, mutants: None, ..Variation::new(config) };
        Self {
            size: size(config),
            generations: config.integer("generations"),
            variation,
            stream: None,
            regions: Vec::new(),
            inner: None,
            best: Vec::new(),
            all: Vec::new(),
            rest: VecDeque::new(),
            begin: 0,
        }
    }

    /// As [`Rule::next`](crate::strategy::Rule::next).
    pub fn next(&mut self, domain: &Domain, random: &mut Random, proposed: usize, told: &[Point]) -> Next {
        if let Some(x) = self.rest.pop_front() {
            return Next::Propose(x);
        }
        if told.len() < proposed {
            return Next::Wait;
        }
        let new = &told[self.begin..];
        self.begin = proposed;
        let batch = if proposed == 0 {
            domain.latin_hypercube(domain.bounds(), self.size, random)
        } else if self.stream.is_none() {
            self.stream = Some(random.clone());
            self.regions.push(new.to_vec());
            self.begin_inner()
        } else {
            self.generation(domain, new)
        };
        self.rest = batch.into();
        self.rest.pop_front().map_or(Next::End, Next::Propose)
    }

    /// The front of the next region, which is evaluated again.
    fn begin_inner(&mut self) -> Vec<Vec<f64>> {
        let Some(points) = self.regions.pop() else { return Vec::new() };
        let front = front(&points);
        let size = front.len();
        let mut seeds: Vec<Vec<f64>> = Vec::new();
        for point in front {
            if !seeds.contains(&point.x) {
                seeds.push(point.x);
            }
        }
        let random = self.stream.clone().unwrap_or_else(|| Key::default().sequence());
        self.inner = Some(Inner { size, generation: 0, population: Vec::new(), random });
        seeds
    }

    /// Takes the results of a generation, and breeds the next one, of this inner search or of another.
    fn generation(&mut self, domain: &Domain, new: &[Point]) -> Vec<Vec<f64>> {
        if let Some(mut inner) = self.inner.take() {
            let all: Vec<&Point> = inner.population.iter().map(|ranked| &ranked.point).chain(new).collect();
            inner.population = survivors(&all, inner.size);
            inner.generation += 1;
            self.all.extend(inner.population.iter().map(|ranked| ranked.point.clone()));
            if inner.generation < self.generations {
                let offspring = self.offspring(domain, &mut inner);
                if !offspring.is_empty() {
                    self.inner = Some(inner);
                    return offspring;
                }
            }
            self.best.extend(inner.population.into_iter().map(|ranked| ranked.point));
            self.best = front(&self.best);
        }
        if self.regions.is_empty() {
            self.regions = self.critical_regions(domain);
        }
        self.begin_inner()
    }

    fn offspring(&self, domain: &Domain, inner: &mut Inner) -> Vec<Vec<f64>> {
        let mut offspring: Vec<Vec<f64>> = Vec::new();
        for _ in 0..TRIES {
            let random = &mut inner.random;
            let mut draw = || &inner.population[random.below(inner.population.len() as u32) as usize];
            let mut select = || {
                let (a, b) = (draw(), draw());
                if b.order(a).is_lt() { &b.point.x } else { &a.point.x }
            };
            let parents = [select().as_slice(), select().as_slice()];
            for child in self.variation.children(domain, domain.bounds(), parents, random) {
                let living = inner.population.iter().any(|ranked| ranked.point.x == child);
                if !living && !offspring.contains(&child) {
                    offspring.push(child);
                }
                if offspring.len() == inner.size {
                    return offspring;
                }
            }
        }
        offspring
    }

    /// The points of each critical region, the next one last; the best so far if there is none.
    fn critical_regions(&self, domain: &Domain) -> Vec<Vec<Point>> {
        let all: Vec<&Point> = self.all.iter().collect();
        let tree = Tree::new(domain.space(), &all, PUBLISHED);
        let mut regions: Vec<Vec<Point>> = tree
            .leaves()
            .into_iter()
            .filter(|leaf| leaf.share() > 0.5 && leaf.share() < 1.0)
            .map(|leaf| leaf.rows.iter().map(|&row| self.all[row].clone()).collect())
            .collect();
        regions.reverse();
        if regions.is_empty() {
            regions.push(self.best.clone());
        }
        regions
    }
}

/// Those that nothing dominates, in their order, copies kept. A region holds many thousands of points, most of them copies, so
/// each is compared with the best so far alone.
fn front(points: &[Point]) -> Vec<Point> {
    let same = |a: &Point, b: &Point| a.violation == b.violation && a.f == b.f;
    // The places of points that are equal in everything that counts, for each of the best.
    let mut best: Vec<Vec<usize>> = Vec::new();
    for (place, point) in points.iter().enumerate() {
        if let Some(copies) = best.iter_mut().find(|copies| same(&points[copies[0]], point)) {
            copies.push(place);
        } else if !best.iter().any(|copies| dominates(&points[copies[0]], point)) {
            best.retain(|copies| !dominates(point, &points[copies[0]]));
            best.push(vec![place]);
        }
    }
    let mut places: Vec<usize> = best.into_iter().flatten().collect();
    places.sort_unstable();
    places.into_iter().map(|place| points[place].clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::key;
    use pdk_statistics::ranking::fronts;

    #[test]
    fn a_front_is_the_first_of_all_fronts_with_its_copies() {
        let mut random = key(5).sequence();
        for most in [2, 4, 30] {
            let point = |random: &mut Random| {
                let f = [0, 1].map(|_| f64::from(random.below(most))).to_vec();
                let violation = f64::from(random.below(4).saturating_sub(2));
                Point { x: vec![random.unit()], f, violation, critical: false }
            };
            let points: Vec<Point> = (0..300).map(|_| point(&mut random)).collect();
            let all: Vec<&Point> = points.iter().collect();
            let expected: Vec<&Point> = fronts(&all, 1)[0].iter().map(|&place| all[place]).collect();
            assert_eq!(front(&points).iter().collect::<Vec<_>>(), expected);
        }
        assert!(front(&[]).is_empty());
    }
}
