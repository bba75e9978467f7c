//! Integrated gradients: what each pixel contributes to the difference between the output for the frame and for a plain image.

use pdk_sdk::prelude::*;

use super::along;
use super::derived::Derived;
use super::gradient::open;
use super::grid::{Grid, sign_parameter};
use super::method::{Map, Method, empty, fill, fill_parameter};
use super::viewer::{Viewer, parameters};

/// Gradients along the line from a plain image to the frame.
pub type IntegratedGradients = Map<Integrated>;

/// The integral by midpoints.
pub struct Integrated {
    derived: Derived,
    steps: usize,
    fill: String,
}

impl Method for Integrated {
    fn description() -> Description {
        let description = Description::saliency(
            "integrated-gradients",
            "What each pixel contributes to the difference between the output for the frame and for a plain image",
        )
        .family("gradient")
        .source("Sundararajan et al., \"Axiomatic Attribution for Deep Networks\" (2017)")
        .mathematics(
            "`map = Σ_c (x_c - b_c) ∫ g_c(b + s (x - b)) ds` over the colours, with `s` from 0 to 1, by midpoints; the sum over all pixels is \
             `f(x) - f(b)`",
        );
        parameters(description).parameter(sign_parameter()).parameter(fill_parameter()).parameter(
            Parameter::integer("steps", 32, "at how many points of the line the gradient is computed")
                .range(1.0, 10_000.0),
        )
    }

    fn new(viewer: &mut Viewer, config: &Config) -> Result<Self> {
        Ok(Self {
            derived: open(viewer)?,
            steps: config.integer("steps") as usize,
            fill: config.text("fill").to_owned(),
        })
    }

    fn cells(&self, viewer: &Viewer) -> [usize; 2] {
        let (width, height) = viewer.size();
        [height, width]
    }

    fn grid(&mut self, viewer: &mut Viewer, frame: Frame<'_>, _: &MapContext<'_>) -> Result<Grid> {
        let color = fill(frame, &self.fill).map(|value| (value + 0.5) as u8);
        let mut plain = FrameBuf::new(frame.width(), frame.height());
        for row in plain.as_mut().rows_mut() {
            row.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&color));
        }
        let [mut start, mut end] = [(); 2].map(|()| vec![0.0; viewer.image_len()]);
        viewer.numbers(plain.as_ref(), &mut start);
        viewer.numbers(frame, &mut end);
        let mut grid = empty(&self.derived.layer);
        let steps = self.steps as f64;
        for step in 0..self.steps {
            let share = (step as f64 + 0.5) / steps;
            along::add(&mut self.derived, viewer, [&start, &end], [share, 1.0 / steps], &mut grid)?;
        }
        Ok(grid)
    }
}
