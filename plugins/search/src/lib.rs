//! Search strategies: each proposes candidates by a rule, which [`strategy`] makes a component.

mod border;
mod cells;
mod descent;
mod domain;
mod forest;
mod grid;
mod latin_hypercube;
mod map_elites;
mod niches;
mod nsga2;
mod nsga2_dt;
mod pool;
mod published;
mod random;
mod sobol;
mod strategy;
mod surrogate;
#[cfg(test)]
mod testing;
mod variation;

use strategy::Strategy;

pdk_sdk::export! {
    searches: [
        Strategy<random::RandomSearch>,
        Strategy<grid::Grid>,
        Strategy<sobol::Sobol>,
        Strategy<latin_hypercube::LatinHypercube>,
        Strategy<nsga2::Nsga2>,
        Strategy<nsga2_dt::Nsga2Dt>,
        Strategy<surrogate::Surrogate>,
        Strategy<map_elites::MapElites>,
        Strategy<descent::Descent>,
    ]
}
