//! A component of each kind, all named `frozen`, on the first SDK of this version of the interface. Each one shows by what it
//! does that everything that it was given has arrived.

mod dataset;
mod driver;
mod perturbation;
mod saliency;
mod search;
mod simulator;

pdk_sdk::export! {
    perturbations: [perturbation::Frozen],
    simulators: [simulator::Frozen],
    drivers: [driver::Frozen],
    saliencies: [saliency::Frozen],
    searches: [search::Frozen],
    datasets: [dataset::Frozen],
}
