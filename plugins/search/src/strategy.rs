//! What all strategies share: they number candidates, keep the results, and see to it that a candidate depends on nothing but
//! problem, key and the results that its rule asks for.

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;

use crate::domain::Domain;

/// What a rule comes up with.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// A candidate at these positions.
    Propose(Vec<f64>),
    /// It depends on results that are not there yet.
    Wait,
    /// There is none any more.
    End,
}

/// How a strategy proposes.
pub trait Rule: Sized + Send {
    /// Name, documentation and parameters.
    fn description() -> Description;

    /// Makes a rule from checked parameters.
    ///
    /// # Errors
    /// If values do not go together.
    fn new(config: &Config) -> Result<Self>;

    /// Begins a search.
    ///
    /// # Errors
    /// If it cannot search this space.
    fn start(&mut self, problem: &Problem, domain: &Domain) -> Result<()>;

    /// The next candidate, after `proposed` earlier ones, of which the first have been evaluated. It may use as many of these
    /// results as it likes, but always as many for this candidate: it waits if they are fewer, and leaves out what is more.
    fn next(&mut self, domain: &Domain, random: &mut Random, proposed: usize, told: &[Point]) -> Next;
}

/// A rule as a component.
pub struct Strategy<R> {
    rule: R,
    begun: Option<Begun>,
}

/// A search that was begun.
struct Begun {
    domain: Domain,
    random: Random,
    /// The positions of all candidates.
    proposed: Vec<Vec<f64>>,
    /// How the first of them did.
    told: Vec<Point>,
}

impl<R> Strategy<R> {
    fn begun(&mut self) -> Result<(&mut R, &mut Begun)> {
        match &mut self.begun {
            Some(begun) => Ok((&mut self.rule, begun)),
            None => Err(Error::new("the search was not started; call `start` first")),
        }
    }
}

impl<R: Rule> Component for Strategy<R> {
    fn description() -> Description {
        R::description()
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { rule: R::new(config)?, begun: None })
    }
}

impl<R: Rule> Search for Strategy<R> {
    fn start(&mut self, problem: &Problem, key: &Key) -> Result<()> {
        problem.space.check()?;
        let domain = Domain::new(&problem.space);
        self.rule.start(problem, &domain)?;
        let random = key.sequence();
        self.begun = Some(Begun { domain, random, proposed: Vec::new(), told: Vec::new() });
        Ok(())
    }

    fn ask(&mut self, n: usize) -> Result<Vec<Candidate>> {
        let (rule, begun) = self.begun()?;
        let mut candidates = Vec::new();
        while candidates.len() < n {
            let number = begun.proposed.len();
            let Next::Propose(positions) = rule.next(&begun.domain, &mut begun.random, number, &begun.told)
            else {
                break;
            };
            let positions = begun.domain.settle(positions);
            candidates.push(Candidate { id: number as u64, values: begun.domain.space().values(&positions) });
            begun.proposed.push(positions);
        }
        Ok(candidates)
    }

    fn tell(&mut self, results: &[Evaluated]) -> Result<()> {
        let (_, begun) = self.begun()?;
        for result in results {
            let number = begun.told.len();
            let Some(x) = begun.proposed.get(number).filter(|_| result.id == number as u64) else {
                return Err(Error::of(
                    ErrorKind::Nonsense,
                    format!("the result of candidate {} was told where that of {number} is next", result.id),
                ));
            };
            let mut violation = result.violation();
            if result.objectives.iter().any(|objective| objective.is_nan()) {
                violation = f64::INFINITY;
            }
            begun.told.push(Point {
                x: x.clone(),
                f: result.objectives.clone(),
                violation,
                critical: result.critical,
            });
        }
        Ok(())
    }
}
