//! Spatter: drops of water or mud on the lens.

use pdk_sdk::ops::border::reflect;
use pdk_sdk::ops::float::{Edge, Image, Workspace, separable};
use pdk_sdk::ops::point::truncated;
use pdk_sdk::prelude::*;

use crate::chamfer::{bordered, distances, edges};
use crate::gaussian::weights;
use crate::simd::vectorised;
use crate::suite::{MadeFor, corruption};

/// Pale turquoise, and brown.
const WATER: [f32; 3] = [175.0, 238.0, 238.0];
const MUD: [f32; 3] = [63.0, 42.0, 20.0];
/// Mud that covers less is not there.
const LEAST_MUD: f32 = 0.8;
/// Further away from the edge of a drop it looks the same.
const FURTHEST: f32 = 20.0;

/// Lays drops over the frame.
#[derive(Default)]
pub struct Spatter {
    made_for: MadeFor,
    liquid: Image,
    /// How much of the liquid's colour each pixel gets.
    cover: Vec<f32>,
    workspace: Workspace,
}

impl Component for Spatter {
    fn description() -> Description {
        corruption("spatter", "Drops of water (levels 0 to 2) or mud (3 and 4) on the lens, the same ones in all frames of a sequence")
            .mathematics("water: v + cover colour; mud: (1 - cover) v + cover colour; drops where smoothed noise is above a threshold")
            .drawn_per_sequence("the drops")
            .parameter(Parameter::by_level("mean", [0.65, 0.65, 0.65, 0.65, 0.67], "mean of what drops are drawn from").range(-5.0, 5.0))
            .parameter(Parameter::by_level("deviation", [0.3, 0.3, 0.3, 0.3, 0.4], "standard deviation of that").range(0.0, 5.0))
            .parameter(Parameter::by_level("size", [4.0, 3.0, 2.0, 1.0, 1.0], "standard deviation of what smooths it").range(0.1, 50.0).unit("px"))
            .parameter(Parameter::by_level("threshold", [0.69, 0.68, 0.68, 0.65, 0.65], "above it there is liquid").range(-5.0, 5.0))
            .parameter(
                Parameter::by_level("strength", [0.6, 0.6, 0.5, 1.5, 1.5], "brightness of water at its brightest; of mud, what smooths its edges, in pixels")
                    .range(0.1, 50.0),
            )
            .parameter(Parameter::by_level("mud", [0.0, 0.0, 0.0, 1.0, 1.0], "1 for mud, 0 for water").range(0.0, 1.0))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for Spatter {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let mud = cx.number("mud") >= 0.5;
        let names = ["mean", "deviation", "size", "threshold", "strength", "mud"];
        if self.made_for.is_new(
            [src.width(), src.height()],
            Some(*cx.key()),
            &names.map(|name| cx.number(name)),
        ) {
            self.draw(src.width(), src.height(), cx);
            if mud { self.cover_with_mud(cx) } else { self.cover_with_water(cx) }
        }
        let colour = if mud { MUD } else { WATER };
        for ((from, to), cover) in src.rows().zip(dst.rows_mut()).zip(self.cover.chunks_exact(src.width())) {
            lay_row(from, to, cover, colour, mud);
        }
        Ok(())
    }
}

/// The pixels of a row that are laid over together.
const PIXELS: usize = 64;

vectorised! {
    /// Lays liquid of a colour over a row. Mud hides as much of what is behind it as it covers.
    fn lay_row / lay_row_avx2 / lay_row_avx512 (
        from: &[u8], to: &mut [u8], cover: &[f32], colour: [f32; 3], mud: bool,
    ) {
        let (mut covers, colours) = ([[0.0f32; 3]; PIXELS], [colour; PIXELS]);
        let hidden = if mud { 1.0 } else { 0.0 };
        let blocks = from.chunks(3 * PIXELS).zip(to.chunks_mut(3 * PIXELS)).zip(cover.chunks(PIXELS));
        for ((from, to), cover) in blocks {
            covers.iter_mut().zip(cover).for_each(|(covers, &cover)| *covers = [cover; 3]);
            let weights = covers.as_flattened().iter().zip(colours.as_flattened());
            for ((&from, to), (&cover, &colour)) in from.iter().zip(to).zip(weights) {
                *to = truncated((1.0 - hidden * cover) * f32::from(from) + cover * colour);
            }
        }
    }
}

impl Spatter {
    /// Smoothed noise, 0 where there is no liquid.
    fn draw(&mut self, width: usize, height: usize, cx: &Context<'_>) {
        let mut random = cx.sequence_random();
        let (mean, deviation) = (cx.number("mean"), cx.number("deviation"));
        self.liquid.resize(width, height, 1);
        self.liquid.values.iter_mut().for_each(|value| *value = (mean + deviation * random.normal()) as f32);
        let weights = weights(cx.number("size"));
        separable(&mut self.liquid, &weights, &weights, Edge::Nearest, &mut self.workspace);
        let threshold = cx.number("threshold") as f32;
        self.liquid.values.iter_mut().filter(|value| **value < threshold).for_each(|value| *value = 0.0);
    }

    fn cover_with_mud(&mut self, cx: &Context<'_>) {
        let threshold = cx.number("threshold") as f32;
        let weights = weights(cx.number("strength"));
        self.liquid.values.iter_mut().for_each(|value| *value = if *value > threshold { 1.0 } else { 0.0 });
        separable(&mut self.liquid, &weights, &weights, Edge::Nearest, &mut self.workspace);
        self.cover.clear();
        self.cover
            .extend(self.liquid.values.iter().map(|&value| if value < LEAST_MUD { 0.0 } else { value }));
    }

    /// Brightest where the lower right edge of a drop catches the light.
    fn cover_with_water(&mut self, cx: &Context<'_>) {
        let (width, height) = (self.liquid.width, self.liquid.height);
        // As 8 bits have it: what is beyond wraps round.
        let liquid: Vec<u8> = self.liquid.values.iter().map(|&value| (value * 255.0) as i32 as u8).collect();
        let marked = edges(&liquid, width, height, 50, 150);
        let distances = distances(&marked, width, height, FURTHEST);
        let levels: Vec<u8> = box_blur(&distances, width, height).iter().map(|&value| value as u8).collect();
        let even = equalised(&levels);
        let relief: Vec<f32> = emboss(&even, width, height).iter().map(|&value| f32::from(value)).collect();
        let shine = box_blur(&relief, width, height);
        self.cover.clear();
        let products = liquid.iter().zip(&shine);
        self.cover.extend(products.map(|(&liquid, shine)| f32::from(liquid) * shine.round_ties_even()));
        let most = self.cover.iter().copied().fold(0.0, f32::max);
        let scale = if most > 0.0 { cx.number("strength") as f32 / most } else { 0.0 };
        self.cover.iter_mut().for_each(|value| *value *= scale);
    }
}

/// The mean of 3 x 3 values, mirrored at the edges.
fn box_blur(values: &[f32], width: usize, height: usize) -> Vec<f32> {
    around(values, width, height, |[above, here, below]| {
        let sum = |x: usize| above[x] + here[x] + below[x];
        (sum(0) + sum(1) + sum(2)) / 9.0
    })
}

/// A relief lit from the lower right.
fn emboss(values: &[u8], width: usize, height: usize) -> Vec<u8> {
    around(values, width, height, |[above, here, below]| {
        let [above, here, below] = [above, here, below].map(|row| [0, 1, 2].map(|x| i32::from(row[x])));
        let sum = here[1] + here[2] + below[1] + 2 * below[2] - 2 * above[0] - above[1] - here[0];
        sum.clamp(0, 255) as u8
    })
}

/// A value for each place, from the 3 x 3 around it, three of each row; mirrored at the edges.
fn around<T: Copy, R>(values: &[T], width: usize, height: usize, work: impl Fn([&[T]; 3]) -> R) -> Vec<R> {
    let beyond = |x: isize, y: isize| values[reflect(y, height) * width + reflect(x, width)];
    let wide = bordered(values, width, height, 1, beyond);
    let line = width + 2;
    let mut found = Vec::with_capacity(width * height);
    for y in 0..height {
        let rows = [0, 1, 2].map(|down| &wide[(y + down) * line..][..line]);
        found.extend((0..width).map(|x| work(rows.map(|row| &row[x..x + 3]))));
    }
    found
}

/// Values with a histogram that is as even as it can be.
fn equalised(values: &[u8]) -> Vec<u8> {
    let mut counts = [0usize; 256];
    values.iter().for_each(|&value| counts[usize::from(value)] += 1);
    let Some(first) = counts.iter().position(|count| *count > 0) else { return Vec::new() };
    let others = values.len() - counts[first];
    if others == 0 {
        return values.to_vec();
    }
    let mut below = 0;
    let table: Vec<u8> = (0..256)
        .map(|value| {
            if value > first {
                below += counts[value];
            }
            (below as f64 * 255.0 / others as f64).round_ties_even() as u8
        })
        .collect();
    values.iter().map(|&value| table[usize::from(value)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::with_each;
    use crate::testing::{frame, perturbed};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<Spatter>();
        crate::allocations::on_the_first_frames_alone::<Spatter>();
    }

    #[test]
    fn rows_are_laid_over_as_the_formula_says_with_all_instructions() {
        for (width, mud) in
            [1, 5, 63, 64, 65, 200].into_iter().flat_map(|width| [(width, false), (width, true)])
        {
            let from: Vec<u8> = (0..3 * width).map(|at| (at * 37) as u8).collect();
            let cover: Vec<f32> = (0..width).map(|x| (x * 13 % 17) as f32 / 16.0).collect();
            let colour = if mud { MUD } else { WATER };
            let value = |(at, &from): (usize, &u8)| {
                let cover = cover[at / 3];
                let left = if mud { 1.0 - cover } else { 1.0 };
                (left * f32::from(from) + cover * colour[at % 3]) as u8
            };
            let wanted: Vec<u8> = from.iter().enumerate().map(value).collect();
            with_each(|instructions| {
                let mut to = vec![0; from.len()];
                lay_row(&from, &mut to, &cover, colour, mud);
                assert_eq!(to, wanted, "{width} {mud} with {instructions:?}");
            });
        }
    }

    #[test]
    fn water_brightens_and_mud_covers() {
        let dark = frame(40, 160, 120);
        let wet = perturbed::<Spatter>(&dark, 0.0, 1);
        assert!(wet.data().iter().all(|&value| value >= 40) && wet != dark);
        let pale = frame(220, 160, 120);
        let dirty = perturbed::<Spatter>(&pale, 4.0, 1);
        assert!(dirty.data().iter().all(|&value| value <= 220));
        let covered = dirty.data().chunks_exact(3).filter(|pixel| pixel[2] < 100).count();
        assert!((2000..12000).contains(&covered), "{covered}");
    }

    #[test]
    fn a_histogram_becomes_even() {
        assert_eq!(equalised(&[10, 10, 20, 30]), [0, 0, 128, 255]);
        assert_eq!(equalised(&[7, 7]), [7, 7]);
    }
}
