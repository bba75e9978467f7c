//! Positions of which a model chooses what is evaluated.

use pdk_sdk::seed::Random;

use crate::domain::{Domain, Seen};
use crate::forest::Forest;

/// Farther than this from all that is known, a candidate is no better for being farther.
const FAR: f64 = 0.15;

/// Positions of which a batch is chosen.
#[derive(Default)]
pub struct Pool {
    pub candidates: Vec<Candidate>,
    seen: Seen,
}

/// One of them.
pub struct Candidate {
    pub x: Vec<f64>,
    /// Near which place it lies.
    pub group: usize,
    /// What the model expects, and how unsure it is.
    pub mean: f64,
    pub deviation: f64,
    /// How far it is from what is known to be critical, and from what was proposed lately.
    apart: f64,
    /// Whether it lies in a region that is known to be critical.
    pub known: bool,
}

impl Candidate {
    /// The room around it, 0 to 1.
    pub fn room(&self) -> f64 {
        self.apart.min(FAR) / FAR
    }
}

impl Pool {
    /// Adds new positions: near some positions, or drawn from the whole space if there are none.
    pub fn fill(
        &mut self,
        domain: &Domain,
        random: &mut Random,
        known: &Seen,
        group: usize,
        near: &[&[f64]],
        n: usize,
    ) {
        for _ in 0..n {
            let x = match near.len() {
                0 => domain.draw(domain.bounds(), random),
                count => nearby(domain, near[random.below(count as u32) as usize], random),
            };
            let x = domain.settle(x);
            if !known.has(&x) && self.seen.add(&x) {
                let (mean, deviation, apart) = (0.0, 0.0, f64::INFINITY);
                self.candidates.push(Candidate { x, group, mean, deviation, apart, known: false });
            }
        }
    }

    /// Lets a model say what it expects of each.
    pub fn predict(&mut self, forest: &Forest) {
        for one in &mut self.candidates {
            (one.mean, one.deviation) = forest.predict(&one.x);
        }
    }

    /// Notes how far its positions are from others.
    pub fn keep_away<'a>(&mut self, domain: &Domain, others: impl Iterator<Item = &'a [f64]>) {
        for other in others {
            for one in &mut self.candidates {
                one.apart = one.apart.min(domain.space().distance(&one.x, other));
            }
        }
    }

    /// Takes the position with the best score, of equal ones the first; none if none has one.
    pub fn take(&mut self, domain: &Domain, score: impl Fn(&Candidate) -> f64) -> Option<Vec<f64>> {
        let mut best: Option<(f64, usize)> = None;
        for (place, one) in self.candidates.iter().enumerate() {
            let score = score(one);
            if score > f64::NEG_INFINITY && best.is_none_or(|(most, _)| score > most) {
                best = Some((score, place));
            }
        }
        let x = self.candidates.remove(best?.1).x;
        self.keep_away(domain, std::iter::once(x.as_slice()));
        Some(x)
    }
}

/// A position near another one: some variables are moved, by a step whose size is drawn.
fn nearby(domain: &Domain, x: &[f64], random: &mut Random) -> Vec<f64> {
    let step = 0.3 * libm::pow(0.03, random.unit());
    let share = random.uniform(0.3, 1.0);
    let moved = |i: usize| {
        let (low, high) = domain.bounds()[i];
        let (which, by, anew) = (random.unit(), random.normal(), random.unit());
        match domain.is_choice(i) {
            _ if which >= share => x[i],
            true if by.abs() > 1.0 => domain.at_share(domain.bounds(), i, anew),
            true => x[i],
            // At least to the next whole number now and then.
            false if domain.is_discrete(i) => x[i] + by * (step * (high - low)).max(0.7),
            false => x[i] + by * step * (high - low),
        }
    };
    (0..domain.len()).map(moved).collect()
}
