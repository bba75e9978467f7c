//! SmoothGrad: the gradient of the output with respect to the pixels, averaged over frames with noise.

use pdk_sdk::prelude::*;

use super::derived::{Derived, Planes};
use super::gradient::{join, open};
use super::grid::{Grid, Sign, sign_parameter};
use super::method::{Map, Method, empty};
use super::viewer::{Viewer, parameters};

/// The gradient averaged over noise.
pub type SmoothGrad = Map<Smooth>;

/// The mean of gradients at frames with noise.
pub struct Smooth {
    derived: Derived,
    sign: Sign,
    samples: usize,
    noise: f64,
}

impl Method for Smooth {
    fn description() -> Description {
        let description = Description::saliency(
            "smooth-grad",
            "The mean gradient with respect to each pixel over frames with noise",
        )
        .family("gradient")
        .source("Smilkov et al., \"SmoothGrad: removing noise by adding noise\" (2017)")
        .mathematics("`map = max_c |E[g_c(x + σ n)]|` over the colours, or `Σ_c` if the sign matters")
        .drawn_per_frame("the noise");
        parameters(description)
            .parameter(sign_parameter())
            .parameter(
                Parameter::integer("samples", 16, "how many noisy frames are averaged").range(1.0, 10_000.0),
            )
            .parameter(
                Parameter::number(
                    "noise",
                    0.15,
                    "standard deviation of the noise, as a share of the range of pixel values",
                )
                .range(0.0, 1.0),
            )
    }

    fn new(viewer: &Viewer, config: &Config) -> Result<Self> {
        Ok(Self {
            derived: open(viewer)?,
            sign: Sign::of(config.text("sign")),
            samples: config.integer("samples") as usize,
            noise: config.number("noise"),
        })
    }

    fn cells(&self, viewer: &Viewer) -> [usize; 2] {
        let (width, height) = viewer.size();
        [height, width]
    }

    fn grid(&mut self, viewer: &mut Viewer, frame: Frame<'_>, cx: &MapContext<'_>) -> Result<Grid> {
        let mut plain = vec![0.0; viewer.image_len()];
        viewer.numbers(frame, &mut plain);
        let (low, high) = viewer.range();
        let deviation = self.noise * f64::from(high - low);
        let mut random = cx.frame_random();
        let mut noisy = plain.clone();
        let mut mean: Option<Planes> = None;
        for _ in 0..self.samples {
            for (to, from) in noisy.iter_mut().zip(&plain) {
                *to = (f64::from(*from) + deviation * random.normal()) as f32;
            }
            let planes = self.derived.run_on(viewer, &noisy)?.pop();
            match (&mut mean, planes) {
                (Some(mean), Some(planes)) => mean.add(&planes),
                (mean, planes) => *mean = planes,
            }
        }
        let mut grid = empty(&self.derived.layer);
        if let Some(mean) = mean {
            join(&mean, self.sign, &mut grid);
        }
        Ok(grid)
    }
}
