//! Lens flare: a bright source in front of the camera puts a veil, rays and images of the aperture into the picture.

use pdk_sdk::ops::light::Light;
use pdk_sdk::prelude::*;

/// The images of the aperture: place on the line from the source through the middle of the frame (0 the source, 1 the middle), radius in
/// heights, and colour.
const GHOSTS: [(f64, f64, [f64; 3]); 6] = [
    (0.55, 0.045, [0.05, 0.09, 0.06]),
    (0.85, 0.02, [0.14, 0.10, 0.05]),
    (1.3, 0.06, [0.04, 0.07, 0.11]),
    (1.55, 0.03, [0.10, 0.05, 0.09]),
    (1.9, 0.11, [0.06, 0.05, 0.03]),
    (2.4, 0.17, [0.03, 0.04, 0.05]),
];
/// Blades of the aperture, each of which makes a ray.
const BLADES: f64 = 6.0;

/// Adds the stray light of a source.
#[derive(Default)]
pub struct LensFlare {
    light: Light,
    /// The stray light of each value at a strength of 1, for a size of frame and a place of the source.
    stray: Vec<f32>,
    made_for: Option<([usize; 2], [f64; 2])>,
}

impl Component for LensFlare {
    fn description() -> Description {
        Description::perturbation(
            "lens_flare",
            "Puts a bright source, such as the sun or a lamp, in front of the camera, with the veil, the rays and the images of the aperture \
             that it makes in the lens",
        )
        .family("lens")
        .not_default()
        .keeps_geometry()
        .mathematics("light(v) + strength stray(x, y), clipped and stored")
        .drawn_per_sequence("where the source is")
        .source("Veiling glare and ghosts as in ISO 18844:2017 and Hullin et al., Physically-based real-time lens flare rendering (2011)")
        .parameter(Parameter::by_level("strength", [0.3, 0.7, 1.5, 3.0, 6.0], "how bright the stray light is").range(0.0, 100.0))
        .parameter(Parameter::choice(
            "source",
            &["drawn", "placed"],
            "drawn: the source is somewhere in the upper part of the frame; placed: at `x` and `y`",
        ))
        .parameter(Parameter::number("x", 0.7, "place of the source as a share of the width").range(-1.0, 2.0).only_for("source", "placed"))
        .parameter(Parameter::number("y", 0.12, "place of the source as a share of the height").range(-1.0, 2.0).only_for("source", "placed"))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

/// The stray light of a source at a place, at a pixel, both in heights from the middle of the frame.
fn stray([x, y]: [f64; 2], source: [f64; 2]) -> [f64; 3] {
    let (right, down) = (x - source[0], y - source[1]);
    let far = libm::hypot(right, down);
    let veil = 0.05 / (1.0 + far * far / 0.06);
    let disc = 6.0 * libm::exp(-far * far / 0.0009);
    // The distance from the nearest ray.
    let angle = libm::atan2(down, right) * BLADES / (2.0 * std::f64::consts::PI);
    let beside = (angle - angle.round()) * 2.0 * std::f64::consts::PI / BLADES * far;
    let ray = 0.5 * libm::exp(-far / 0.16) * libm::exp(-beside * beside / 0.00006);
    let white = veil + disc + ray;
    let mut light = [white, 0.96 * white, 0.86 * white];
    for (along, radius, colour) in GHOSTS {
        let (right, down) = (x - source[0] * (1.0 - along), y - source[1] * (1.0 - along));
        // Discs with soft edges and a brighter rim.
        let outward = libm::hypot(right, down) / radius;
        let inside = ((1.08 - outward) / 0.16).clamp(0.0, 1.0) * (0.7 + 0.3 * outward.min(1.0));
        for (light, colour) in light.iter_mut().zip(colour) {
            *light += inside * colour;
        }
    }
    light
}

impl LensFlare {
    fn prepare(&mut self, [width, height]: [usize; 2], place: [f64; 2]) {
        if self.made_for == Some(([width, height], place)) {
            return;
        }
        self.made_for = Some(([width, height], place));
        let unit = height as f64;
        let middle = [width as f64 / 2.0, height as f64 / 2.0];
        let source =
            [(place[0] * width as f64 - middle[0]) / unit, (place[1] * height as f64 - middle[1]) / unit];
        self.stray.clear();
        for y in 0..height {
            for x in 0..width {
                let pixel = [(x as f64 + 0.5 - middle[0]) / unit, (y as f64 + 0.5 - middle[1]) / unit];
                self.stray.extend(stray(pixel, source).map(|light| light as f32));
            }
        }
    }
}

impl Perturbation for LensFlare {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let mut random = cx.sequence_random();
        let drawn = [random.uniform(0.15, 0.85), random.uniform(0.02, 0.28)];
        let place = if cx.integer("source") == 0 { drawn } else { [cx.number("x"), cx.number("y")] };
        self.prepare([src.width(), src.height()], place);
        let strength = cx.number("strength") as f32;
        let row = 3 * src.width();
        for ((to, from), stray) in dst.rows_mut().zip(src.rows()).zip(self.stray.chunks_exact(row)) {
            self.light.change(from, to, |first, lights| {
                for (light, stray) in lights.iter_mut().zip(&stray[first..]) {
                    *light += strength * stray;
                }
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::ops::light::{from_light, to_light};
    use pdk_sdk::serde_json::{Value, json};
    use pdk_sdk::testing::{Trial, even_frame};

    use super::*;

    fn flared(instance: &mut LensFlare, given: &Value, source: &FrameBuf) -> FrameBuf {
        let mut trial = Trial::<LensFlare>::new(given, 2.0, Key([2; 32])).unwrap();
        let (_, cx) = trial.at(0, 0.0);
        let mut out = FrameBuf::new(source.width(), source.height());
        instance.apply(source.as_ref(), out.as_mut(), &cx).unwrap();
        out
    }

    #[test]
    fn the_light_is_added_that_the_source_scatters_to_each_pixel() {
        let source = even_frame(70, 60, 40);
        let mut instance = LensFlare::default();
        for (x, y) in [(0.5, 0.5), (0.2, 0.1)] {
            let given = json!({"source": "placed", "x": x, "y": y, "strength": 0.8});
            let found = flared(&mut instance, &given, &source);
            let place = [(60.0 * x - 30.0) / 40.0, (40.0 * y - 20.0) / 40.0];
            for (row, column) in [(0, 0), (20, 30), (4, 12), (39, 59), (27, 41)] {
                let pixel = [(column as f64 + 0.5 - 30.0) / 40.0, (row as f64 + 0.5 - 20.0) / 40.0];
                let expected = stray(pixel, place)
                    .map(|light| 255.0 * from_light((to_light(70.0 / 255.0) + 0.8 * light).min(1.0)));
                for (found, expected) in found.as_ref().pixel(column, row).iter().zip(expected) {
                    assert!((f64::from(*found) - expected).abs() < 0.7, "{column} {row}: {found} {expected}");
                }
            }
            // The source itself is white.
            assert_eq!(found.as_ref().pixel((60.0 * x) as usize, (40.0 * y) as usize), [255; 3]);
        }
        let dark = flared(&mut instance, &json!({"strength": 0}), &source);
        assert_eq!(dark, source);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<LensFlare>();
        crate::allocations::on_the_first_frames_alone::<LensFlare>();
    }
}
