//! SmoothGrad: the gradient of the output with respect to the pixels over frames with noise: its mean, the mean of its square, or its variance.

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
    statistic: Statistic,
}

/// What is taken of the gradients at frames with noise.
#[derive(Clone, Copy, PartialEq)]
enum Statistic {
    Mean,
    Square,
    Variance,
}

impl Method for Smooth {
    fn description() -> Description {
        let description = Description::saliency(
            "smooth-grad",
            "The mean gradient with respect to each pixel over frames with noise",
        )
        .family("gradient")
        .source(
            "Smilkov et al., \"SmoothGrad: removing noise by adding noise\" (2017); its square: Hooker et al., \"A Benchmark for \
             Interpretability Methods in Deep Neural Networks\" (2019); its variance: Adebayo et al., \"Local Explanation Methods for Deep \
             Neural Networks Lack Sensitivity to Parameter Values\" (2018)",
        )
        .mathematics(
            "`map = max_c |E[g_c(x + σ n)]|` over the colours, or `Σ_c` if the sign matters; `max_c E[g_c²]` and `max_c Var[g_c]` for the others",
        )
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
            .parameter(Parameter::choice(
                "statistic",
                &["mean", "square", "variance"],
                "what is taken of the gradients: their mean, the mean of their squares, or their variance; the last two have no sign",
            ))
    }

    fn new(viewer: &mut Viewer, config: &Config) -> Result<Self> {
        Ok(Self {
            derived: open(viewer)?,
            sign: Sign::of(config.text("sign")),
            samples: config.integer("samples") as usize,
            noise: config.number("noise"),
            statistic: match config.text("statistic") {
                "square" => Statistic::Square,
                "variance" => Statistic::Variance,
                _ => Statistic::Mean,
            },
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
        let mut sums: Option<[Planes; 2]> = None;
        for _ in 0..self.samples {
            for (to, from) in noisy.iter_mut().zip(&plain) {
                *to = (f64::from(*from) + deviation * random.normal()) as f32;
            }
            let Some(gradient) = self.derived.run_on(viewer, &noisy)?.pop() else { continue };
            let [sum, squares] = sums.get_or_insert_with(|| [gradient.zeros(), gradient.zeros()]);
            sum.add(&gradient);
            squares.add_squares(&gradient);
        }
        let mut grid = empty(&self.derived.layer);
        if let Some([mut sum, squares]) = sums {
            let count = self.samples as f64;
            match self.statistic {
                Statistic::Mean => {}
                Statistic::Square => sum.change(&squares, |_, square| square),
                // Where all gradients are alike, rounding may leave less than nothing.
                Statistic::Variance => {
                    sum.change(&squares, |sum, square| (square - sum * sum / count).max(0.0));
                }
            }
            join(&sum, self.sign, &mut grid);
        }
        Ok(grid)
    }
}
