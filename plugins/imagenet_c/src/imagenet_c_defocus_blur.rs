//! Defocus: a disc with soft edges.

use pdk_sdk::ops::border::reflect;
use pdk_sdk::ops::float::{Edge, Workspace, gaussian, symmetric};
use pdk_sdk::prelude::*;

use crate::suite::{MadeFor, corruption};

/// Averages over a disc.
#[derive(Default)]
pub struct DefocusBlur {
    made_for: MadeFor,
    disc: Vec<Vec<f32>>,
    workspace: Workspace,
}

impl Component for DefocusBlur {
    fn description() -> Description {
        corruption("defocus_blur", "Averages every pixel over a disc with soft edges")
            .mathematics("v * (disc(radius) * G(edge))")
            .parameter(
                Parameter::by_level("radius", [3.0, 4.0, 6.0, 8.0, 10.0], "radius of the disc")
                    .range(0.0, 60.0)
                    .unit("px"),
            )
            .parameter(
                Parameter::by_level(
                    "edge",
                    [0.1, 0.5, 0.5, 0.5, 0.5],
                    "standard deviation of what softens its edge",
                )
                .range(0.01, 5.0)
                .unit("px"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for DefocusBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (radius, edge) = (cx.number("radius"), cx.number("edge"));
        // The disc is the same for frames of all sizes.
        if self.made_for.is_new([0; 2], None, &[radius, edge]) {
            self.disc = disc(radius, edge);
            leave_out_traces(&mut self.disc);
        }
        symmetric(src, dst, &self.disc, Edge::Mirrored, &mut self.workspace);
        Ok(())
    }
}

/// The weights of a disc from its middle on, softened by a Gaussian of 3 or, for large ones, 5 values.
fn disc(radius: f64, edge: f64) -> Vec<Vec<f32>> {
    let (reach, soft) = if radius <= 8.0 { (8, 1) } else { (radius.ceil() as usize, 2) };
    let size = 2 * reach + 1;
    let inside = |x: usize, y: usize| {
        let (x, y) = (x as f64 - reach as f64, y as f64 - reach as f64);
        x * x + y * y <= radius * radius
    };
    let count = (0..size * size).filter(|place| inside(place % size, place / size)).count() as f64;
    let around = gaussian(edge, soft);
    let softened = |x: usize, y: usize| {
        let mut sum = 0.0;
        for down in -(soft as isize)..=soft as isize {
            for right in -(soft as isize)..=soft as isize {
                let weight = around[right.unsigned_abs()] * around[down.unsigned_abs()];
                if inside(reflect(x as isize + right, size), reflect(y as isize + down, size)) {
                    sum += f64::from(weight) / count;
                }
            }
        }
        sum as f32
    };
    (reach..size).map(|y| (reach..size).map(|x| softened(x, y)).collect()).collect()
}

/// A weight that is smaller than the next larger one by this factor is a trace, and so are those below it: of whole grey levels, all
/// traces together change no sum that another weight has a part in. 24 bits are those of a number, 10 those of four grey levels of 255,
/// and 16 are for the number of weights.
const TRACE: f32 = 1.0 / (1u64 << 50) as f32;

/// Sets traces to 0. An edge that is hardly softened consists of them: the work for them is as much as for others, and many times as
/// much if they are so small that the processor computes with them step by step.
fn leave_out_traces(disc: &mut [Vec<f32>]) {
    let mut weights: Vec<f32> = disc.iter().flatten().copied().filter(|weight| *weight > 0.0).collect();
    weights.sort_unstable_by(|a, b| b.total_cmp(a));
    let largest_trace = weights.windows(2).find(|pair| pair[1] < pair[0] * TRACE).map_or(0.0, |pair| pair[1]);
    disc.iter_mut().flatten().filter(|weight| **weight <= largest_trace).for_each(|weight| *weight = 0.0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{frame, perturbed, stays_grey};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<DefocusBlur>();
    }

    #[test]
    fn keeps_nothing_that_does_not_fit() {
        crate::testing::keeps_nothing_that_does_not_fit::<DefocusBlur>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        stays_grey::<DefocusBlur>(&[0.0, 1.5, 4.0], 98..=101);
    }

    /// The same, with all weights.
    fn with_traces(src: &FrameBuf, [radius, edge]: [f64; 2]) -> FrameBuf {
        let mut dst = FrameBuf::new(src.width(), src.height());
        let mut workspace = Workspace::default();
        symmetric(src.as_ref(), dst.as_mut(), &disc(radius, edge), Edge::Mirrored, &mut workspace);
        dst
    }

    #[test]
    fn traces_change_nothing() {
        // Black, white, steps between them and noise.
        let mut src = frame(0, 64, 48);
        for (y, row) in src.as_mut().rows_mut().enumerate() {
            match y / 8 {
                0 => row.fill(255),
                1 => row.iter_mut().step_by(17).for_each(|value| *value = 255),
                2 | 3 => Key([y as u8; 32]).frame(0).fill(row),
                4 => row[90..].fill(1),
                _ => {}
            }
        }
        assert_eq!(perturbed::<DefocusBlur>(&src, 0.0, 1), with_traces(&src, [3.0, 0.1]));
        assert_eq!(perturbed::<DefocusBlur>(&src, 1.0, 1), with_traces(&src, [4.0, 0.5]));
    }

    #[test]
    fn an_edge_that_is_hardly_softened_consists_of_traces() {
        let count = |disc: &[Vec<f32>]| disc.iter().flatten().filter(|weight| **weight != 0.0).count();
        let mut sharp = disc(3.0, 0.1);
        assert!(count(&sharp) > 11);
        leave_out_traces(&mut sharp);
        // The 29 pixels of a disc are 11 in a quadrant.
        assert_eq!(count(&sharp), 11);
        let mut soft = disc(4.0, 0.5);
        let before = soft.clone();
        leave_out_traces(&mut soft);
        assert_eq!(soft, before);
    }
}
