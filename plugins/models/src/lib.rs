//! Drivers that run a neural network.
