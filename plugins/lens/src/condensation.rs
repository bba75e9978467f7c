//! Condensation: the glass in front of the camera mists up until a wiper has passed.

use pdk_sdk::ops::canvas::Canvas;
use pdk_sdk::ops::gaussian::{self, gaussian_blur};
use pdk_sdk::ops::resample::{self, resize_area};
use pdk_sdk::ops::resize::resize_linear;
use pdk_sdk::prelude::*;

/// The rows of the blurred picture, as nearly as whole numbers allow, so that the mist blurs by the same share of any frame.
const ROWS: f64 = 30.0;
/// Size of the blur in that picture.
const BLUR: usize = 5;
/// How long the wiper needs from the left to the right, in seconds.
const SWEEP: f64 = 0.7;
/// The light that the mist scatters, and how much of the blurred picture it leaves.
const VEIL: u32 = 205;
const SEEN: u32 = 160;

/// Mists the glass up.
#[derive(Default)]
pub struct Condensation {
    /// How much mist settles in each pixel, 0 to 1, for a size of frame and a key.
    settles: Vec<f32>,
    made_for: Option<([usize; 2], Key)>,
    small: FrameBuf,
    blurred: FrameBuf,
    large: FrameBuf,
    area: resample::Workspace,
    gauss: gaussian::Workspace,
    /// The share of the mist in each column.
    grown: Vec<f32>,
}

impl Component for Condensation {
    fn description() -> Description {
        Description::perturbation(
            "condensation",
            "Mists the glass in front of the camera up, more and more, until a wiper passes and it begins again",
        )
        .version(2)
        .family("lens")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .mathematics("(1 - a) v + a (5/8 blurred + 3/8 205), a = density settles(x, y) (1 - exp(-(t - wiped(x)) / growth))")
        .drawn_per_sequence("where mist settles, and when the wiper passes first")
        .source("Condensation is among the camera failures of Secci and Ceccarelli, On failures of RGB cameras and their effects in autonomous driving applications (2020); it grows as the difference to saturation falls")
        .parameter(Parameter::by_level("density", [0.35, 0.55, 0.75, 0.9, 1.0], "share of the mist where most of it has settled").range(0.0, 1.0))
        .parameter(
            Parameter::by_level("growth", [12.0, 8.0, 5.0, 3.0, 2.0], "how long it takes until 63 % of it is there")
                .range(0.01, 10_000.0)
                .unit("s"),
        )
        .parameter(
            Parameter::number("wipe", 10.0, "how often the wiper passes; 0 for never, with the mist that has grown in a minute")
                .range(0.0, 10_000.0)
                .unit("s"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

/// How long ago a column, the share `right` of the way from the left, was wiped.
fn since(time: f64, right: f64, wipe: f64, offset: f64) -> f64 {
    if wipe <= 0.0 {
        return 60.0 + time;
    }
    let sweep = SWEEP.min(wipe);
    let since = time + (0.35 + 0.5 * offset) * wipe - sweep * right;
    since - wipe * (since / wipe).floor()
}

impl Condensation {
    /// Mist settles in clouds, and most at the edges of the glass.
    fn prepare(&mut self, [width, height]: [usize; 2], cx: &Context<'_>) {
        if self.made_for == Some(([width, height], *cx.key())) {
            return;
        }
        self.made_for = Some(([width, height], *cx.key()));
        let mut random = cx.sequence_random();
        // The first number is the wiper's.
        random.unit();
        let clouds = Canvas::clouds(width, height, (height as f64 / 3.0).max(2.0), 4, &mut random);
        self.settles.clear();
        for y in 0..height {
            for x in 0..width {
                let out = |place: usize, length: usize| 2.0 * (place as f64 + 0.5) / length as f64 - 1.0;
                let (u, v) = (out(x, width), out(y, height));
                let edge = 0.3 * (u * u).max(v * v);
                let cloud = 1.6 * (clouds.shades[y * width + x] - 0.5);
                self.settles.push((0.65 + cloud + edge).clamp(0.0, 1.0) as f32);
            }
        }
    }

    /// The frame as it is seen through mist, out of focus.
    fn blur(&mut self, src: Frame<'_>) {
        let shrunk = ((src.height() as f64 / ROWS).round() as usize).max(1);
        let [width, height] = [src.width(), src.height()].map(|side| side.div_ceil(shrunk));
        for frame in [&mut self.small, &mut self.blurred] {
            frame.resize(width, height);
        }
        self.large.resize(src.width(), src.height());
        resize_area(src, self.small.as_mut(), &mut self.area);
        gaussian_blur(self.small.as_ref(), self.blurred.as_mut(), BLUR, &mut self.gauss);
        resize_linear(self.blurred.as_ref(), self.large.as_mut());
    }
}

impl Perturbation for Condensation {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let width = src.width();
        self.prepare([width, src.height()], cx);
        self.blur(src);
        let offset = cx.sequence_random().unit();
        let (density, growth, wipe) = (cx.number("density"), cx.number("growth"), cx.number("wipe"));
        self.grown.clear();
        self.grown.extend((0..width).map(|x| {
            let since = since(cx.time, (x as f64 + 0.5) / width as f64, wipe, offset);
            (256.0 * density * -libm::expm1(-since / growth)) as f32
        }));
        let misty = self.large.as_ref();
        for (y, (to, from)) in dst.rows_mut().zip(src.rows()).enumerate() {
            let settles = &self.settles[y * width..][..width];
            let pixels = to.chunks_exact_mut(3).zip(from.chunks_exact(3)).zip(misty.row(y).chunks_exact(3));
            for (((to, from), misty), (settles, grown)) in pixels.zip(settles.iter().zip(&self.grown)) {
                let mist = (settles * grown + 0.5) as u32;
                for ((to, value), misty) in to.iter_mut().zip(from).zip(misty) {
                    let veiled = (SEEN * u32::from(*misty) + (256 - SEEN) * VEIL + 128) >> 8;
                    *to = (((256 - mist) * u32::from(*value) + mist * veiled + 128) >> 8) as u8;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::{Value, json};
    use pdk_sdk::testing::{Trial, even_frame};

    use super::*;

    fn misted(given: &Value, time: f64, source: &FrameBuf) -> FrameBuf {
        let mut trial = Trial::<Condensation>::new(given, 2.0, Key([2; 32])).unwrap();
        trial.frame(source, 0, time).unwrap()
    }

    #[test]
    fn mist_grows_and_begins_again_behind_the_wiper() {
        for right in [0.0, 0.5, 1.0] {
            let ages: Vec<f64> =
                (0..2000).map(|step| since(f64::from(step) * 0.01, right, 8.0, 0.3)).collect();
            assert!(ages.iter().all(|age| (0.0..8.0).contains(age)));
            let wiped = ages.windows(2).filter(|pair| pair[1] < pair[0]).count();
            assert!((2..=3).contains(&wiped), "{wiped}");
            assert!(ages.windows(2).all(|pair| pair[1] < pair[0] || (pair[1] - pair[0] - 0.01).abs() < 1e-9));
        }
        // The wiper comes to the right later than to the left.
        let first = |right: f64| {
            let age = |step: i32| since(f64::from(step) * 0.01, right, 8.0, 0.3);
            (1..2000).find(|step| age(*step) < age(*step - 1)).unwrap()
        };
        assert!((first(1.0) - first(0.0) - 70).abs() <= 1);
    }

    #[test]
    fn an_even_frame_goes_towards_the_veil_as_the_formula_says() {
        let given = json!({"density": 1.0, "growth": 4, "wipe": 0});
        let found = misted(&given, 0.0, &even_frame(40, 80, 60));
        // After a minute all of it has grown, and some place has all that settles.
        let most = *found.data().iter().max().unwrap();
        let veiled = 0.625 * 40.0 + 0.375 * 205.0;
        assert!((f64::from(most) - veiled).abs() < 1.5, "{most} {veiled}");
        assert!(*found.data().iter().min().unwrap() < 80);
        assert_eq!(misted(&json!({"density": 0}), 3.0, &even_frame(40, 80, 60)), even_frame(40, 80, 60));
    }

    #[test]
    fn the_mist_blurs_by_the_same_share_of_any_frame() {
        // Stripes, ten to a height.
        let contrast = |height: usize| {
            let is_dark = |place: usize| (place % height * 20 / height).is_multiple_of(2);
            let mut source = FrameBuf::new(height, height);
            for place in (0..height * height).filter(|place| !is_dark(*place)) {
                source.as_mut().set_pixel(place % height, place / height, [255; 3]);
            }
            let found = misted(&json!({"density": 1.0, "growth": 4, "wipe": 0}), 0.0, &source);
            let sum = |dark: bool| -> f64 {
                let places = (0..height * height).filter(|place| is_dark(*place) == dark);
                places.map(|place| f64::from(found.as_ref().pixel(place % height, place / height)[0])).sum()
            };
            2.0 * (sum(false) - sum(true)) / (height * height) as f64
        };
        let [small, large] = [240, 960].map(contrast);
        assert!((small - large).abs() < 5.0, "{small} {large}");
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<Condensation>();
        crate::allocations::on_the_first_frames_alone::<Condensation>();
    }
}
