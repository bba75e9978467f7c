//! The gradient of the output with respect to the pixels.

use pdk_sdk::prelude::*;

use super::derived::{Derived, Planes, graph, image_layer};
use super::grid::{Grid, Sign, sign_parameter};
use super::method::{Map, Method, empty};
use super::viewer::{Viewer, parameters};

/// The plain gradient.
pub type Gradient = Map<Plain>;

/// The graph that computes it.
///
/// # Errors
/// If an operator has no gradient, or the engine cannot run the graph.
pub fn open(viewer: &Viewer) -> Result<Derived> {
    let graph = graph(viewer)?;
    let layer = image_layer(&graph, viewer)?;
    Derived::gradient(&graph, viewer, layer, &[viewer.target()?])
}

/// Joins the colours of each pixel: the largest by size where the sign does not matter, else their sum.
pub fn join(planes: &Planes, sign: Sign, grid: &mut Grid) {
    for channel in planes.channels() {
        for (value, gradient) in grid.values.iter_mut().zip(channel) {
            *value = if sign == Sign::Absolute { value.max(gradient.abs()) } else { *value + gradient };
        }
    }
}

/// The gradient as it is.
pub struct Plain {
    derived: Derived,
    sign: Sign,
}

impl Method for Plain {
    fn description() -> Description {
        let description = Description::saliency("gradient", "The gradient of the output with respect to each pixel")
            .family("gradient")
            .source("Simonyan et al., \"Deep Inside Convolutional Networks: Visualising Image Classification Models and Saliency Maps\" (2014)")
            .mathematics("`map = max_c |g_c|` over the colours, or `Σ_c g_c` if the sign matters");
        parameters(description).parameter(sign_parameter())
    }

    fn new(viewer: &mut Viewer, config: &Config) -> Result<Self> {
        Ok(Self { derived: open(viewer)?, sign: Sign::of(config.text("sign")) })
    }

    fn cells(&self, viewer: &Viewer) -> [usize; 2] {
        let (width, height) = viewer.size();
        [height, width]
    }

    fn grid(&mut self, viewer: &mut Viewer, frame: Frame<'_>, _: &MapContext<'_>) -> Result<Grid> {
        let planes = self.derived.run(viewer, frame)?;
        let mut grid = empty(&self.derived.layer);
        join(&planes[planes.len() - 1], self.sign, &mut grid);
        Ok(grid)
    }
}
