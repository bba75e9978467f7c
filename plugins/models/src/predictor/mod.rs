//! The predictors: [`network`] gives all outputs of a network in a file.

mod network;

pub use network::Network;
