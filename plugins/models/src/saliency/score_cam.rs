//! Score-CAM: the channels of a layer as masks, weighed by what the network answers behind each.

use pdk_sdk::prelude::*;

use super::cam::add_weighed;
use super::derived::{Derived, graph, layer_parameters, named_layer};
use super::grid::{Grid, Sign, sign_parameter};
use super::method::{Map, Method, blend, empty, fill, fill_parameter};
use super::viewer::{Viewer, parameters};

/// Score-CAM as a component.
pub type ScoreCam = Map<Score>;

/// Masks by channel.
pub struct Score {
    derived: Derived,
    fill: String,
}

impl Method for Score {
    fn description() -> Description {
        let description = Description::saliency("score-cam", "Weighs the channels of a layer by the output when each masks the frame, without gradients")
            .family("no gradient")
            .gradient_free()
            .version(2)
            .source("Wang et al., \"Score-CAM: Score-Weighted Visual Explanations for Convolutional Neural Networks\" (2020)")
            .mathematics("`map = Σ_c (f(x ∘ N_c) - f(∅)) A_c`, with `N_c` the channel `A_c` from 0 to 1 and `∅` the frame without content")
            .divergence("The weights are differences of the output, not their softmax, which would make the small differences of a steering angle all alike.");
        layer_parameters(parameters(description)).parameter(sign_parameter()).parameter(fill_parameter())
    }

    fn new(viewer: &mut Viewer, config: &Config) -> Result<Self> {
        let graph = graph(viewer)?;
        let layer = named_layer(&graph, viewer, config)?;
        Ok(Self { derived: Derived::forward(&graph, viewer, layer)?, fill: config.text("fill").to_owned() })
    }

    fn cells(&self, _: &Viewer) -> [usize; 2] {
        let layer = &self.derived.layer;
        [layer.shape[layer.rows.0], layer.shape[layer.columns.0]]
    }

    fn grid(&mut self, viewer: &mut Viewer, frame: Frame<'_>, _: &MapContext<'_>) -> Result<Grid> {
        let planes = self.derived.run(viewer, frame)?;
        let color = fill(frame, &self.fill);
        let (width, height) = viewer.size();
        let mut shares = vec![0.0f32; width * height];
        let mut masked = FrameBuf::new(width, height);
        blend(frame, color, &shares, masked.as_mut());
        let base = viewer.answer(masked.as_ref())?;
        let mut grid = empty(&self.derived.layer);
        for channel in planes[0].channels() {
            let (least, greatest) =
                channel.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, g), &v| (l.min(v), g.max(v)));
            if greatest <= least {
                // The same everywhere: no mask.
                continue;
            }
            let mask =
                Grid { values: channel.to_vec(), ..empty(&self.derived.layer) }.normalize(Sign::Range)?;
            mask.lay_over((width, height), HeatmapMut::new(&mut shares, width, height)?);
            blend(frame, color, &shares, masked.as_mut());
            let weight = viewer.answer(masked.as_ref())? - base;
            add_weighed(channel, weight, &mut grid.values);
        }
        Ok(grid)
    }
}
