//! What class activation maps by gradients share: they differ in how the activations and gradients of a layer become a map.

use std::marker::PhantomData;

use pdk_sdk::prelude::*;

use super::derived::{Derived, graph, layer_parameters, named_layer};
use super::grid::{Grid, Sign, sign_parameter};
use super::method::{Method, empty};
use super::viewer::{Viewer, common_parameters, parameters};

/// How activations and gradients of a layer become a map.
pub trait Rule: Send {
    /// Name and documentation.
    fn description() -> Description;

    /// Adds what a channel contributes.
    fn add(activations: &[f64], gradients: &[f64], map: &mut [f64]);

    /// Whether it explains one number, whose sign can be chosen; else the sum of all numbers that drive.
    const ONE: bool = true;
}

/// A class activation map.
pub struct Cam<R> {
    derived: Derived,
    rule: PhantomData<R>,
}

impl<R: Rule> Method for Cam<R> {
    fn description() -> Description {
        // Version 2 is of another layer than the last convolution if none is named.
        let description = R::description().family("gradient").version(2);
        match R::ONE {
            true => layer_parameters(parameters(description)).parameter(sign_parameter()),
            false => layer_parameters(common_parameters(description)),
        }
    }

    fn new(viewer: &mut Viewer, config: &Config) -> Result<Self> {
        let graph = graph(viewer)?;
        let layer = named_layer(&graph, viewer, config)?;
        let targets = if R::ONE { vec![viewer.target()?] } else { viewer.driving()? };
        Ok(Self { derived: Derived::gradient(&graph, viewer, layer, &targets)?, rule: PhantomData })
    }

    fn sign(config: &Config) -> Sign {
        if R::ONE { Sign::of(config.text("sign")) } else { Sign::Range }
    }

    fn cells(&self, _: &Viewer) -> [usize; 2] {
        let layer = &self.derived.layer;
        [layer.shape[layer.rows.0], layer.shape[layer.columns.0]]
    }

    fn grid(&mut self, viewer: &mut Viewer, frame: Frame<'_>, _: &MapContext<'_>) -> Result<Grid> {
        let planes = self.derived.run(viewer, frame)?;
        let mut grid = empty(&self.derived.layer);
        for (activations, gradients) in planes[0].channels().zip(planes[planes.len() - 1].channels()) {
            R::add(activations, gradients, &mut grid.values);
        }
        Ok(grid)
    }
}

/// Adds a channel with a weight.
pub fn add_weighed(activations: &[f64], weight: f64, map: &mut [f64]) {
    map.iter_mut().zip(activations).for_each(|(sum, value)| *sum += weight * value);
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// Compares the map that a rule makes of two channels with the one that its formula gives.
    pub fn assert_map<R: Rule>(expected: [f64; 2]) {
        let mut map = [0.0; 2];
        for (activations, gradients) in [([1.0, 3.0], [0.5, -0.1]), ([0.0, 2.0], [1.0, 1.0])] {
            R::add(&activations, &gradients, &mut map);
        }
        assert!(map.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{map:?}");
    }
}
