//! Random, smooth displacements.

use pdk_sdk::ops::displacement::Displacement;
use pdk_sdk::ops::float::{Edge, Image, Workspace, gaussian, separable};
use pdk_sdk::ops::rgbx;
use pdk_sdk::prelude::*;

use crate::simd::vectorised;
use crate::suite::{MadeFor, corruption};

/// Displaces every pixel at random, smoothly.
#[derive(Default)]
pub struct ElasticTransform {
    made_for: MadeFor,
    right: Image,
    down: Image,
    places: Places,
    /// A row of the result.
    pixels: Vec<[f32; 4]>,
    bytes: Vec<[u8; 4]>,
    workspace: Workspace,
}

/// The largest displacement before smoothing, and the standard deviation of the smoothing, as shares of the size.
const DISPLACED: f64 = 0.005;
const SMOOTHED: f64 = 0.01;
/// A Gaussian is cut off at this many standard deviations.
const TRUNCATE: f64 = 3.0;

impl Component for ElasticTransform {
    fn description() -> Description {
        corruption("elastic_transform", "Displaces every pixel at random, smoothly, in the same way in all frames of a sequence")
            .mathematics("v(x + alpha G dx, y + alpha G dy), dx and dy uniform within 0.005 of the height, G with 0.01 of each side")
            .drawn_per_sequence("the displacements")
            .moves_geometry()
            .parameter(
                Parameter::by_level("alpha", [12.5, 16.25, 21.25, 25.0, 30.0], "what displacements are multiplied by")
                    .range(0.0, 1000.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for ElasticTransform {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        self.prepare([width, height], cx);
        let alpha = cx.number("alpha") as f32;
        let Self { right, down, places, pixels, bytes, .. } = self;
        places.resize(width);
        pixels.resize(width, [0.0; 4]);
        bytes.resize(width, [0; 4]);
        for (y, to) in dst.rows_mut().enumerate() {
            places.set(y, alpha, right.row(y), down.row(y));
            interpolate(src, places, pixels);
            rgbx::truncate(pixels, bytes, to);
        }
        Ok(())
    }

    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        [width, height]: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        self.prepare([width, height], cx);
        let alpha = cx.number("alpha") as f32;
        let mut sources = Vec::with_capacity(width * height);
        for y in 0..height {
            let moved = self.right.row(y).iter().zip(self.down.row(y)).enumerate();
            sources
                .extend(moved.map(|(x, (right, down))| [x as f32 + alpha * right, y as f32 + alpha * down]));
        }
        let displaced = Displacement::new(width, height, sources);
        points.iter_mut().for_each(|point| {
            *point = match way {
                Way::ToPerturbed => displaced.to_perturbed(*point),
                Way::ToSource => displaced.to_source(*point),
            };
        });
        Ok(())
    }
}

/// Where the pixels of a row come from.
#[derive(Default)]
struct Places {
    /// The pixel at the upper left of each, which may lie beyond the edge.
    left: Vec<i32>,
    top: Vec<i32>,
    /// How far each is from that to the next one.
    share_x: Vec<f32>,
    share_y: Vec<f32>,
}

impl Places {
    fn resize(&mut self, width: usize) {
        self.left.resize(width, 0);
        self.top.resize(width, 0);
        self.share_x.resize(width, 0.0);
        self.share_y.resize(width, 0.0);
    }

    /// Those of row `y`, displaced.
    fn set(&mut self, y: usize, alpha: f32, right: &[f32], down: &[f32]) {
        displace(0.0, 1.0, alpha, right, &mut self.left, &mut self.share_x);
        displace(y as f32, 0.0, alpha, down, &mut self.top, &mut self.share_y);
    }
}

/// Places further out than this, in pixels, are far beyond any frame.
const FURTHEST: f32 = 1e9;

/// The whole part of a place, which goes down also below 0.
#[allow(clippy::manual_clamp)] // `clamp` keeps what is not a number
#[inline(always)]
fn whole(place: f32) -> i32 {
    let place = place.max(-FURTHEST).min(FURTHEST);
    // SAFETY: the number fits. Loops over the checked conversion are not vectorised.
    let cut = unsafe { place.to_int_unchecked::<i32>() };
    if place < cut as f32 { cut - 1 } else { cut }
}

vectorised! {
    // Places from `first` on, `step` apart and displaced: their whole parts, which go down also below 0, and the rest.
    fn displace / displace_avx2 / displace_avx512 (
        first: f32, step: f32, alpha: f32, by: &[f32], wholes: &mut [i32], shares: &mut [f32],
    ) {
        for (x, ((by, to), share)) in by.iter().zip(wholes).zip(shares).enumerate() {
            // Exact: sizes of frames are small whole numbers.
            let value = first + x as i32 as f32 * step + alpha * by;
            *to = whole(value);
            *share = value - *to as f32;
        }
    }
}

vectorised! {
    // Linear between four pixels each.
    fn interpolate / interpolate_avx2 (src: Frame<'_>, places: &Places, to: &mut [[f32; 4]]) {
        let (data, stride) = (src.data(), src.stride());
        let (width, height) = (src.width() as i32, src.height() as i32);
        let places =
            places.left.iter().zip(&places.top).zip(places.share_x.iter().zip(&places.share_y));
        for (to, ((&left, &top), (&share_x, &share_y))) in to.iter_mut().zip(places) {
            // A pixel is read together with the byte behind it.
            if left >= 0 && left + 2 < width && top >= 0 && top + 1 < height {
                let start = top as usize * stride + left as usize * 3;
                let (upper, lower) = (&data[start..][..7], &data[start + stride..][..7]);
                for (channel, to) in to.iter_mut().enumerate() {
                    let between = |row: &[u8]| {
                        let (a, b) = (f32::from(row[channel]), f32::from(row[channel + 3]));
                        a + (b - a) * share_x
                    };
                    let (above, below) = (between(upper), between(lower));
                    *to = above + (below - above) * share_y;
                }
            } else {
                interpolated(src, [left, top], [share_x, share_y], to);
            }
        }
    }
}

/// The same for one pixel, any part of which may lie beyond the edge.
#[inline(never)]
fn interpolated(src: Frame<'_>, [left, top]: [i32; 2], [share_x, share_y]: [f32; 2], to: &mut [f32; 4]) {
    let columns = [0, 1].map(|next| mirrored(left as isize + next, src.width()));
    let rows = [0, 1].map(|next| mirrored(top as isize + next, src.height()));
    for (channel, to) in to.iter_mut().take(3).enumerate() {
        let [above, below] = rows.map(|y| {
            let [a, b] = columns.map(|x| f32::from(src.pixel(x, y)[channel]));
            a + (b - a) * share_x
        });
        *to = above + (below - above) * share_y;
    }
}

/// A place in a row that goes on mirrored.
fn mirrored(index: isize, length: usize) -> usize {
    match usize::try_from(index) {
        Ok(inside) if inside < length => inside,
        _ => Edge::Symmetric.place(index, length),
    }
}

impl ElasticTransform {
    /// Draws, unless it was drawn for such frames already.
    fn prepare(&mut self, [width, height]: [usize; 2], cx: &Context<'_>) {
        if self.made_for.is_new([width, height], Some(*cx.key()), &[]) {
            self.draw(width, height, &mut cx.sequence_random());
        }
    }

    /// The displacements, which `alpha` multiplies.
    fn draw(&mut self, width: usize, height: usize, random: &mut Random) {
        let kernel = |length: usize| {
            let sigma = SMOOTHED * length as f64;
            gaussian(sigma, (TRUNCATE * sigma + 0.5) as usize)
        };
        let most = DISPLACED * height as f64;
        for field in [&mut self.right, &mut self.down] {
            field.resize(width, height, 1);
            field.values.iter_mut().for_each(|value| *value = random.uniform(-most, most) as f32);
            separable(field, &kernel(height), &kernel(width), Edge::Symmetric, &mut self.workspace);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::with_each;
    use crate::testing::{perturbed, stays_grey};
    use pdk_sdk::ops::point::truncated;
    use pdk_sdk::testing::sample_frame;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<ElasticTransform>();
    }

    #[test]
    fn keeps_nothing_that_does_not_fit() {
        crate::testing::keeps_nothing_that_does_not_fit::<ElasticTransform>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        stays_grey::<ElasticTransform>(&[0.0, 4.0], 99..=100);
    }

    #[test]
    fn displacements_stay_for_a_sequence_and_grow_with_the_level() {
        let src = pdk_sdk::testing::sample_frame(100, 80);
        let [weak, strong, other] =
            [(0.0, 1), (4.0, 1), (0.0, 2)].map(|(l, key)| perturbed::<ElasticTransform>(&src, l, key));
        let difference = |a: &FrameBuf| {
            let pairs = a.data().iter().zip(src.data());
            pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>()
        };
        assert!(difference(&weak) < difference(&strong));
        assert_ne!(weak, other);
    }

    /// Pixel by pixel.
    fn plain(src: &FrameBuf, alpha: f32, right: &Image, down: &Image) -> FrameBuf {
        let whole = |place: f32| (place.floor() as i32, place - place.floor());
        let mut dst = FrameBuf::new(src.width(), src.height());
        for y in 0..src.height() {
            for x in 0..src.width() {
                let (left, share_x) = whole(x as f32 + alpha * right.row(y)[x]);
                let (top, share_y) = whole(y as f32 + alpha * down.row(y)[x]);
                let mut pixel = [0.0; 4];
                interpolated(src.as_ref(), [left, top], [share_x, share_y], &mut pixel);
                dst.as_mut().set_pixel(x, y, [0, 1, 2].map(|channel| truncated(pixel[channel])));
            }
        }
        dst
    }

    #[test]
    fn matches_the_plain_version() {
        for (width, height) in [(1, 1), (3, 2), (67, 41), (160, 30)] {
            let src = sample_frame(width, height);
            let mut drawn = ElasticTransform::default();
            drawn.draw(width, height, &mut Key([5; 32]).sequence());
            for alpha in [0.0, 12.5, 300.0, 1000.0] {
                let wanted = plain(&src, alpha, &drawn.right, &drawn.down);
                with_each(|instructions| {
                    let mut found = FrameBuf::new(width, height);
                    let (mut pixels, mut bytes) = (vec![[0.0; 4]; width], vec![[0; 4]; width]);
                    drawn.places.resize(width);
                    for (y, to) in found.as_mut().rows_mut().enumerate() {
                        drawn.places.set(y, alpha, drawn.right.row(y), drawn.down.row(y));
                        interpolate(src.as_ref(), &drawn.places, &mut pixels);
                        rgbx::truncate(&pixels, &mut bytes, to);
                    }
                    assert!(found == wanted, "{width}x{height} by {alpha} with {instructions:?}");
                });
            }
        }
    }
}
