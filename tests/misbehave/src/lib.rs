//! A plugin whose only work is to misbehave: one component of each kind, all named `misbehave`, with a parameter `how`.
//!
//! Every function that pdk calls can panic, hang, or end the process in one of the ways of [`ending`]: `panic_in_apply`,
//! `hang_in_new`, `exit_in_drop`, `segfault_in_drive`. Perturbation, driver and simulator can do something to the whole
//! process as well ([`process`]). Beyond that each kind has ways of its own to return something wrong. Without `how` a
//! component behaves.
//!
//! The description itself misbehaves where the environment variable `MISBEHAVE` says so: `panic_in_describe`.

mod dataset;
mod driver;
mod ending;
mod manner;
mod perturbation;
mod process;
mod saliency;
mod search;
mod simulator;

pdk_sdk::export! {
    perturbations: [perturbation::Misbehaving],
    simulators: [simulator::Misbehaving],
    drivers: [driver::Misbehaving],
    saliencies: [saliency::Misbehaving],
    searches: [search::Misbehaving],
    datasets: [dataset::Misbehaving],
}
