//! Lying snow: the ground turns white by the depth of the snow, in patches first, and what stands on it stays as it is.

use pdk_sdk::ops::light::Light;
use pdk_sdk::prelude::*;

use crate::distances::{self, Distances};
use crate::patches::{self, Patches};

/// The share of light that fresh snow reflects where it is thin, and how much more where it is deep.
const SNOW: [f32; 2] = [0.72, 0.16];
/// Blue is reflected a little more than red.
const TINT: [f32; 3] = [0.97, 0.985, 1.0];
/// What is higher than this above the ground, in metres, or than this share of its distance, is not the ground.
const ABOVE: [f32; 2] = [0.15, 0.01];

/// Lets snow lie on the ground.
pub struct LyingSnow {
    light: Light,
    distances: Distances,
    patches: Patches,
    /// For each pixel how much it looks down, and where it sees the ground, to the right and ahead; for frames of a size.
    places: Vec<(f32, [f32; 2])>,
    size: [usize; 2],
}

impl Component for LyingSnow {
    fn description() -> Description {
        let description = Description::perturbation(
            "lying_snow",
            "Lets snow lie on the ground, which it covers in patches first and hides in the end, with all that is painted on the road",
        )
        .family("weather")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .mathematics("light(v) + c (snow - light(v)), c the cover of patches that cover tanh(depth / (2.5 roughness)) of the ground")
        .drawn_per_sequence("where patches are")
        .source("Share of ground that snow covers by Yang et al., Validation of the snow submodel of the biosphere-atmosphere transfer scheme with Russian snow cover and meteorological observational data (1997); albedo of fresh snow as in Wiscombe and Warren (1980)")
        .parameter(
            Parameter::by_level("snow", [0.2, 0.5, 1.0, 2.0, 4.0], "how deep the snow is").range(0.0, 100.0).unit("cm"),
        )
        .parameter(
            Parameter::number("roughness", 0.5, "roughness of the ground: half a centimetre for roads, one for soil").range(0.01, 100.0).unit("cm"),
        );
        distances::described(patches::described(description))
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self {
            light: Light::new(),
            distances: Distances::new(config),
            patches: Patches::default(),
            places: Vec::new(),
            size: [0, 0],
        })
    }
}

impl LyingSnow {
    fn prepare(&mut self, size: [usize; 2]) {
        if self.size == size {
            return;
        }
        self.size = size;
        let height = self.distances.mounting().height;
        let place = |place: usize| {
            let [right, down, ahead] = self.distances.direction([place % size[0], place / size[0]], size);
            (down as f32, [right / down * height, ahead / down * height].map(|metres| metres as f32))
        };
        self.places = (0..size[0] * size[1]).map(place).collect();
    }
}

impl Perturbation for LyingSnow {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        self.prepare([width, height]);
        self.patches.draw(cx);
        let camera = self.distances.mounting().height as f32;
        // On the plane of the ground nothing stands.
        let stands = !self.distances.stay();
        let distances = self.distances.of(width, height, cx)?;
        let share = libm::tanh(cx.number("snow") / (2.5 * cx.number("roughness"))) as f32;
        let driven = patches::driven(cx);
        for (y, (to, from)) in dst.rows_mut().zip(src.rows()).enumerate() {
            for (x, (to, from)) in to.chunks_exact_mut(3).zip(from.chunks_exact(3)).enumerate() {
                let (down, place) = self.places[y * width + x];
                let distance = distances[y * width + x];
                let above = if stands { (camera - down * distance).abs() } else { 0.0 };
                if down <= 0.0 || above > ABOVE[0] + ABOVE[1] * distance {
                    to.copy_from_slice(from);
                    continue;
                }
                let patch = self.patches.at(place, driven);
                let cover = patch.cover(share);
                // It is deeper, and brighter, where it came to lie first.
                let snow = SNOW[0] + SNOW[1] * patch.cover(0.5 * share);
                for ((to, from), tint) in to.iter_mut().zip(from).zip(TINT) {
                    let light = self.light.of(*from);
                    *to = self.light.store(light + cover * (snow * tint - light));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::*;
    use crate::test_frames::{even, perturbed};

    /// The share of the ground's pixels that are white, for a camera that looks straight down on the ground within reach of patches.
    fn white(snow: f64) -> f64 {
        let given = json!({"snow": snow, "camera_pitch": 45, "camera_height": 8, "field_of_view": 60});
        let found = perturbed::<LyingSnow>(&given, &even(60, 160, 120), None);
        let white = found.data().iter().filter(|value| **value > 180).count();
        white as f64 / found.data().len() as f64
    }

    #[test]
    fn deeper_snow_covers_the_share_that_the_formula_says() {
        assert_eq!(perturbed::<LyingSnow>(&json!({"snow": 0}), &even(60, 40, 30), None), even(60, 40, 30));
        for snow in [0.3, 0.8, 1.5, 5.0] {
            let expected = libm::tanh(snow / 1.25);
            assert!((white(snow) - expected).abs() < 0.2, "{snow}: {} {expected}", white(snow));
        }
        let all = [0.1, 0.3, 0.8, 1.5, 5.0].map(white);
        assert!(all.windows(2).all(|pair| pair[0] < pair[1]) && white(100.0) > 0.999, "{all:?}");
    }

    #[test]
    fn snow_lies_on_the_ground_alone() {
        let source = even(60, 80, 60);
        let given = json!({"snow": 50, "camera_pitch": 0, "depth": "simulator"});
        let found = perturbed::<LyingSnow>(&given, &source, Some(&vec![3.0; 80 * 60]));
        // A wall three metres ahead, which meets the ground 23 rows below the horizon.
        assert!((0..50).all(|y| found.as_ref().row(y) == source.as_ref().row(y)));
        assert!(found.as_ref().row(53).iter().all(|value| *value > 200));
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<LyingSnow>();
        crate::allocations::on_the_first_frames_alone::<LyingSnow>();
    }
}
