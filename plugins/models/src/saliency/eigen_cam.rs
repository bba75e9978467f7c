//! Eigen-CAM: what the channels of a layer have most in common.

use pdk_sdk::prelude::*;

use super::cam::add_weighed;
use super::derived::{Derived, graph, layer_parameters, named_layer};
use super::grid::{Grid, sign_parameter};
use super::method::{Map, Method, empty};
use super::viewer::{Viewer, common_parameters};

/// Eigen-CAM as a component.
pub type EigenCam = Map<Eigen>;

/// The first principal component of a layer.
pub struct Eigen {
    derived: Derived,
}

impl Method for Eigen {
    fn description() -> Description {
        let description = Description::saliency("eigen-cam", "What the channels of a layer have most in common, without gradients")
            .family("no gradient")
            .gradient_free()
            .version(2)
            .source("Muhammad and Yeasin, \"Eigen-CAM: Class Activation Map using Principal Components\" (2020)")
            .mathematics("`map = A v`, with `A` a row for each cell and a column for each channel, and `v` its first right singular vector")
            .divergence("It is the same for every output: what is not looked at by any of them may show.");
        layer_parameters(common_parameters(description)).parameter(sign_parameter())
    }

    fn new(viewer: &mut Viewer, config: &Config) -> Result<Self> {
        let graph = graph(viewer)?;
        let layer = named_layer(&graph, viewer, config)?;
        Ok(Self { derived: Derived::forward(&graph, viewer, layer)? })
    }

    fn cells(&self, _: &Viewer) -> [usize; 2] {
        let layer = &self.derived.layer;
        [layer.shape[layer.rows.0], layer.shape[layer.columns.0]]
    }

    fn grid(&mut self, viewer: &mut Viewer, frame: Frame<'_>, _: &MapContext<'_>) -> Result<Grid> {
        let planes = self.derived.run(viewer, frame)?;
        let channels: Vec<&[f64]> = planes[0].channels().collect();
        let mut grid = empty(&self.derived.layer);
        for (channel, weight) in channels.iter().zip(first_direction(&channels)) {
            add_weighed(channel, weight, &mut grid.values);
        }
        // A direction has no sign of its own: most of it is to be positive.
        if grid.values.iter().sum::<f64>() < 0.0 {
            grid.values.iter_mut().for_each(|value| *value = -*value);
        }
        Ok(grid)
    }
}

/// The direction in which vectors, one for each channel, are longest together: the weights of the channels, of length 1.
///
/// Power iteration on the products of all pairs of channels, from the channels' own lengths.
fn first_direction(channels: &[&[f64]]) -> Vec<f64> {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let gram: Vec<Vec<f64>> =
        channels.iter().map(|a| channels.iter().map(|b| product(a, b)).collect()).collect();
    let mut direction: Vec<f64> = (0..channels.len()).map(|place| gram[place][place].sqrt()).collect();
    for _ in 0..1000 {
        let mut next: Vec<f64> = gram.iter().map(|row| product(row, &direction)).collect();
        let length = product(&next, &next).sqrt();
        if length == 0.0 {
            return direction;
        }
        next.iter_mut().for_each(|value| *value /= length);
        let change = next.iter().zip(&direction).fold(0.0f64, |change, (a, b)| change.max((a - b).abs()));
        direction = next;
        if change < 1e-13 {
            break;
        }
    }
    direction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_direction_is_the_one_of_the_largest_singular_value() {
        // The columns of [[3, 0], [4, 5]], whose first right singular vector is (1, 1) / sqrt 2.
        let direction = first_direction(&[&[3.0, 4.0], &[0.0, 5.0]]);
        assert!(direction.iter().all(|value| (value - 0.5f64.sqrt()).abs() < 1e-9), "{direction:?}");
        assert_eq!(first_direction(&[&[0.0, 0.0], &[0.0, 0.0]]), [0.0, 0.0]);
    }
}
