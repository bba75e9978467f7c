//! Fog by visibility: haze by Koschmieder's law, with the distance of each pixel.

use pdk_sdk::ops::light::Light;
use pdk_sdk::prelude::*;

use crate::distances::{self, Distances, haze};

/// The contrast that is left of a black thing before the sky at the visibility, by the definition of the meteorological optical range.
const THRESHOLD: f64 = 0.05;

/// The colour of dust, as shares of its grey: that of sand in the air, which absorbs blue.
const DUST: [f64; 3] = [1.0, 0.84, 0.62];

/// Scatters the light of the air into the frame.
pub struct FogByVisibility {
    light: Light,
    /// Red, green and blue of what is in the air, as shares of its grey.
    colour: [f64; 3],
    distances: Distances,
}

impl Component for FogByVisibility {
    fn description() -> Description {
        let description = Description::perturbation(
            "fog_by_visibility",
            "Puts fog or dust between the camera and the scene that leaves a visibility in metres, so that what is further away fades more",
        )
        .version(2)
        .family("weather")
        .not_default()
        .keeps_geometry()
        .mathematics("light(v) 20^(-d / visibility) + air (1 - 20^(-d / visibility)), d the distance of the pixel")
        .source("Koschmieder, Theorie der horizontalen Sichtweite (1924); the visibility is the meteorological optical range of the WMO, at which 5 % of the light is left; light by IEC 61966-2-1 (sRGB)")
        .parameter(
            Parameter::by_level(
                "visibility",
                [1000.0, 500.0, 200.0, 100.0, 50.0],
                "how far one sees: fog begins at 1000 m, and is dense below 200 m and very dense below 50 m",
            )
            .range(1.0, 100_000.0)
            .unit("m"),
        )
        .parameter(Parameter::choice("of", &["fog", "dust"], "what is in the air: grey fog, or dust, which is brown"))
        .parameter(Parameter::number("air", 205.0, "grey of the fog itself: 0 is black, 255 white").range(0.0, 255.0));
        distances::described(description)
    }

    fn new(config: &Config) -> Result<Self> {
        let colour = if config.text("of") == "dust" { DUST } else { [1.0; 3] };
        Ok(Self { light: Light::new(), colour, distances: Distances::new(config) })
    }
}

impl Perturbation for FogByVisibility {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let distances = self.distances.of(src.width(), src.height(), cx)?;
        let extinction = (-libm::log(THRESHOLD) / cx.number("visibility")) as f32;
        let grey = cx.number("air");
        let air = self.colour.map(|share| self.light.of((share * grey).round() as u8));
        haze(&self.light, src, &mut dst, distances, extinction, air);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::ops::light::{from_light, to_light};
    use pdk_sdk::serde_json::json;

    use super::*;
    use crate::test_frames::{even, perturbed};

    /// Koschmieder's law in double precision, at depths that are known, to within one of 255.
    #[test]
    fn what_is_left_at_known_depths_is_what_the_law_says() {
        let (width, height) = (64usize, 48usize);
        let mut source = FrameBuf::new(width, height);
        for (place, value) in source.as_mut().rows_mut().flatten().enumerate() {
            *value = (place * 37 % 256) as u8;
        }
        let depth: Vec<f32> = (0..width * height)
            .map(|place| if place % 97 == 0 { f32::INFINITY } else { (place % 500) as f32 })
            .collect();
        for (visibility, air) in [(30.0, 205u8), (200.0, 120), (1000.0, 255)] {
            let given =
                json!({"depth": "simulator", "visibility": visibility, "air": air, "field_of_view": 90});
            let found = perturbed::<FogByVisibility>(&given, &source, Some(&depth));
            let mut worst = 0.0f64;
            for y in 0..height {
                for x in 0..width {
                    let focal = width as f64 / 2.0;
                    let u = (x as f64 + 0.5 - width as f64 / 2.0) / focal;
                    let v = (y as f64 + 0.5 - height as f64 / 2.0) / focal;
                    let distance = f64::from(depth[y * width + x]) * (1.0 + u * u + v * v).sqrt();
                    let left = libm::pow(0.05, distance / visibility);
                    for channel in 0..3 {
                        let value = f64::from(source.as_ref().pixel(x, y)[channel]) / 255.0;
                        let light = to_light(value) * left + to_light(f64::from(air) / 255.0) * (1.0 - left);
                        let difference =
                            f64::from(found.as_ref().pixel(x, y)[channel]) - 255.0 * from_light(light);
                        worst = worst.max(difference.abs());
                    }
                }
            }
            assert!(worst < 1.0, "{visibility} m: {worst}");
        }
    }

    #[test]
    fn at_the_visibility_a_twentieth_of_the_contrast_is_left() {
        let mut source = FrameBuf::new(1, 1);
        let mut light = |value: u8| {
            source.as_mut().set_pixel(0, 0, [value; 3]);
            let given = json!({"depth": "simulator", "visibility": 100, "air": 255, "field_of_view": 20});
            let found = perturbed::<FogByVisibility>(&given, &source, Some(&[100.0]));
            to_light(f64::from(found.data()[0]) / 255.0)
        };
        let contrast = 1.0 - light(0);
        assert!((contrast - 0.05).abs() < 0.005, "{contrast}");
        assert_eq!(light(255), 1.0);
    }

    #[test]
    fn on_the_plane_of_the_ground_the_sky_is_fog_and_what_is_near_stays() {
        let given = json!({"visibility": 50, "air": 200});
        let found = perturbed::<FogByVisibility>(&given, &even(30, 40, 60), None);
        assert!(found.as_ref().pixel(20, 0).iter().all(|value| value.abs_diff(200) <= 1));
        let near = found.as_ref().pixel(20, 59)[0];
        assert!((30..80).contains(&near), "{near}");
        let column: Vec<u8> = (0..60).map(|y| found.as_ref().pixel(20, y)[0]).collect();
        assert!(column.windows(2).all(|pair| pair[0] >= pair[1]), "{column:?}");
    }

    #[test]
    fn dust_is_brown_and_hides_as_much() {
        let given = json!({"visibility": 20, "air": 200, "of": "dust"});
        let found = perturbed::<FogByVisibility>(&given, &even(30, 40, 60), None);
        assert_eq!(found.as_ref().pixel(20, 0), [200, 168, 124]);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<FogByVisibility>();
        crate::allocations::on_the_first_frames_alone::<FogByVisibility>();
    }
}
