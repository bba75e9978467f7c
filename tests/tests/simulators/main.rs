//! Simulators and drivers over their wires, and everything that can go wrong there.

#![allow(clippy::unwrap_used)]

mod beamng;
mod carla;
mod carla_maps;
mod donkey;
mod external_driver;
mod external_simulator;
mod udacity;
