//! Gradients along straight lines that lead from another image to the frame.

use pdk_sdk::prelude::*;

use super::derived::Derived;
use super::grid::Grid;
use super::viewer::Viewer;

/// Adds what the pixels contribute at one point of a line to the cells: the gradient there times the way that each number goes, summed over the
/// colours. `share` is how far the point is from the start, from 0 to 1, and `weight` is what it counts.
///
/// # Errors
/// If the engine fails.
pub fn add(
    derived: &mut Derived,
    viewer: &Viewer,
    [start, end]: [&[f32]; 2],
    [share, weight]: [f64; 2],
    grid: &mut Grid,
) -> Result<()> {
    let way: Vec<f32> = end.iter().zip(start).map(|(end, start)| end - start).collect();
    let point: Vec<f32> = start
        .iter()
        .zip(&way)
        .map(|(start, way)| (f64::from(*start) + share * f64::from(*way)) as f32)
        .collect();
    let Some(gradient) = derived.run_on(viewer, &point)?.pop() else { return Ok(()) };
    let way = derived.planes(&way);
    for (gradient, way) in gradient.channels().zip(way.channels()) {
        for (value, (gradient, way)) in grid.values.iter_mut().zip(gradient.iter().zip(way)) {
            *value += weight * gradient * way;
        }
    }
    Ok(())
}
