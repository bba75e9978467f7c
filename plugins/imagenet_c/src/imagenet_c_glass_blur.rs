//! Frosted glass: pixels change places.

use pdk_sdk::ops::float::{Edge, Workspace, separable_frame};
use pdk_sdk::prelude::*;

use crate::gaussian::weights;
use crate::suite::{MadeFor, corruption};

/// Smooths, copies pixels from nearby, and smooths again.
#[derive(Default)]
pub struct GlassBlur {
    made_for: MadeFor,
    /// For each pixel the place of the one whose colour it gets.
    sources: Vec<u32>,
    smooth: FrameBuf,
    scattered: FrameBuf,
    workspace: Workspace,
}

impl Component for GlassBlur {
    fn description() -> Description {
        corruption("glass_blur", "Smooths, gives pixels the colours of random ones nearby, and smooths again")
            .mathematics("G(sigma) * scatter(G(sigma) * v), from the lower right on, each from one that may have changed already")
            .drawn_per_sequence("where pixels come from")
            .parameter(
                Parameter::by_level("sigma", [0.7, 0.9, 1.0, 1.1, 1.5], "standard deviation of both Gaussians")
                    .range(0.1, 20.0)
                    .unit("px"),
            )
            .parameter(
                Parameter::by_level("distance", [1.0, 2.0, 2.0, 3.0, 4.0], "largest distance left and up; right and down one less")
                    .range(1.0, 100.0)
                    .unit("px"),
            )
            .parameter(Parameter::by_level("rounds", [2.0, 1.0, 3.0, 2.0, 2.0], "how often pixels are scattered").range(1.0, 20.0))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for GlassBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        let (distance, rounds) = (cx.integer("distance").max(1), cx.integer("rounds").max(1));
        let drawn_with = [distance as f64, rounds as f64];
        if self.made_for.is_new([width, height], Some(*cx.key()), &drawn_with) {
            self.draw(width, height, distance as usize, rounds as usize, &mut cx.sequence_random());
        }
        let Self { sources, smooth, scattered, workspace, .. } = self;
        smooth.resize(width, height);
        scattered.resize(width, height);
        let weights = weights(cx.number("sigma"));
        separable_frame(src, smooth.as_mut(), &weights, &weights, Edge::Nearest, workspace);
        let pixels = smooth.data().as_chunks::<3>().0;
        for (to, &source) in scattered.as_mut().data_mut().as_chunks_mut::<3>().0.iter_mut().zip(&*sources) {
            *to = pixels[source as usize];
        }
        separable_frame(scattered.as_ref(), dst, &weights, &weights, Edge::Nearest, workspace);
        Ok(())
    }
}

impl GlassBlur {
    /// Draws where pixels come from. They change places in turn, so what is copied is the source of a pixel that may have changed
    /// already.
    fn draw(&mut self, width: usize, height: usize, distance: usize, rounds: usize, random: &mut Random) {
        self.sources.clear();
        self.sources.extend(0..(width * height) as u32);
        for _ in 0..rounds {
            for y in (distance + 1..=height.saturating_sub(distance)).rev() {
                for x in (distance + 1..=width.saturating_sub(distance)).rev() {
                    let right = random.below(2 * distance as u32) as usize;
                    let down = random.below(2 * distance as u32) as usize;
                    self.sources[y * width + x] =
                        self.sources[(y + down - distance) * width + x + right - distance];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::stays_grey;
    use pdk_sdk::testing::{Trial, sample_frame};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<GlassBlur>();
    }

    #[test]
    fn keeps_nothing_that_does_not_fit() {
        crate::testing::keeps_nothing_that_does_not_fit::<GlassBlur>();
    }

    /// The same, with colours that change places one after another.
    fn plain(src: &FrameBuf, trial: &mut Trial<GlassBlur>) -> FrameBuf {
        let (_, cx) = trial.at(0, 0.0);
        let (width, height) = (src.width(), src.height());
        let weights = weights(cx.number("sigma"));
        let mut workspace = Workspace::default();
        let mut smooth = |from: &FrameBuf| {
            let mut to = FrameBuf::new(width, height);
            separable_frame(from.as_ref(), to.as_mut(), &weights, &weights, Edge::Nearest, &mut workspace);
            to
        };
        let mut scattered = smooth(src);
        let (distance, mut random) = (cx.integer("distance") as usize, cx.sequence_random());
        for _ in 0..cx.integer("rounds") {
            for y in (distance + 1..=height.saturating_sub(distance)).rev() {
                for x in (distance + 1..=width.saturating_sub(distance)).rev() {
                    let right = random.below(2 * distance as u32) as usize;
                    let down = random.below(2 * distance as u32) as usize;
                    let colour = scattered.as_ref().pixel(x + right - distance, y + down - distance);
                    scattered.as_mut().set_pixel(x, y, colour);
                }
            }
        }
        smooth(&scattered)
    }

    #[test]
    fn pixels_change_places_one_after_another() {
        for (level, [width, height]) in [(0.0, [50, 30]), (2.0, [31, 64]), (4.0, [9, 9]), (4.0, [3, 70])] {
            let src = sample_frame(width, height);
            let mut trial = Trial::<GlassBlur>::new(&Default::default(), level, Key([3; 32])).unwrap();
            let wanted = plain(&src, &mut trial);
            assert_eq!(trial.frame(&src, 0, 0.0).unwrap(), wanted, "{width}x{height} at level {level}");
        }
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        stays_grey::<GlassBlur>(&[0.0, 1.5, 4.0], 98..=101);
    }
}
