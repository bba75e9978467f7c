//! Sensor noise: what a camera makes of the little light that falls through its aperture while it exposes.

use pdk_sdk::ops::light::Light;
use pdk_sdk::ops::sensor::{Sensor, expose};
use pdk_sdk::prelude::*;

/// Photons of daylight in a lux second and a square micrometre, of which each colour of the pattern gets a third.
const PHOTONS: f64 = 11_000.0 / 3.0;
/// The share of the light that a white thing reflects, and of that the share that the lens lets through.
const WHITE: f64 = 0.9;

/// Counts the electrons of each value.
#[derive(Default)]
pub struct SensorNoise {
    light: Light,
}

impl Component for SensorNoise {
    fn description() -> Description {
        Description::perturbation(
            "sensor_noise",
            "Takes the frame with a camera in little light, whose sensor counts few electrons, and amplifies it to the brightness that it had",
        )
        .family("camera")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .mathematics("light(v) + N(0, light(v) / n + (read / n)^2), n = efficiency 3667 pitch^2 exposure 0.9 illuminance / (4 aperture^2) electrons of white, and not above full_well")
        .drawn_per_frame("the noise of each value")
        .source("EMVA 1288; illuminance behind a lens E / (4 N^2); 1.1e4 photons of daylight in a lux second and a square micrometre; light by IEC 61966-2-1 (sRGB)")
        .parameter(
            Parameter::by_level(
                "illuminance",
                [300.0, 50.0, 10.0, 2.0, 0.5],
                "light on the scene: 300 in a lit tunnel, 50 in a lit street, 2 at the end of civil twilight",
            )
            .range(0.001, 200_000.0)
            .unit("lx"),
        )
        .parameter(Parameter::number("aperture", 2.0, "the f-number: focal length by diameter").range(0.5, 64.0))
        .parameter(Parameter::number("exposure", 0.01, "how long the camera exposes").range(0.00001, 1.0).unit("s"))
        .parameter(Parameter::number("pitch", 3.0, "the side of a pixel of the sensor").range(0.5, 30.0).unit("um"))
        .parameter(Parameter::number("efficiency", 0.6, "electrons for each photon").range(0.01, 1.0))
        .parameter(Parameter::number("read", 2.5, "noise of reading the sensor out").range(0.0, 1000.0).unit("electrons"))
        .parameter(Parameter::number("full_well", 10_000.0, "electrons that a pixel holds").range(10.0, 1_000_000.0).unit("electrons"))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

/// The electrons of white.
fn electrons(cx: &Context<'_>) -> f64 {
    let (aperture, pitch) = (cx.number("aperture"), cx.number("pitch"));
    let lux = WHITE * cx.number("illuminance") / (4.0 * aperture * aperture);
    let counted = cx.number("efficiency") * PHOTONS * pitch * pitch * cx.number("exposure") * lux;
    counted.min(cx.number("full_well"))
}

impl Perturbation for SensorNoise {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let sensor = Sensor { white: electrons(cx), read: cx.number("read") };
        expose(&self.light, src, dst, sensor, &mut cx.frame_random(), |_| 1.0);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::ops::light::to_light;
    use pdk_sdk::serde_json::json;

    use super::*;
    use crate::test_frames::{even, perturbed};

    #[test]
    fn a_quarter_of_the_light_is_half_of_the_ratio_of_signal_to_noise() {
        let ratio = |illuminance: f64, aperture: f64| {
            let given = json!({"illuminance": illuminance, "aperture": aperture, "read": 0});
            let found = perturbed::<SensorNoise>(&given, 2.0, (0, 0.0), &[even(140, 200, 150)]);
            let lights: Vec<f64> =
                found.data().iter().map(|value| to_light(f64::from(*value) / 255.0)).collect();
            let mean = lights.iter().sum::<f64>() / lights.len() as f64;
            let variance =
                lights.iter().map(|light| (light - mean) * (light - mean)).sum::<f64>() / lights.len() as f64;
            mean / variance.sqrt()
        };
        let [full, quarter, slow] = [ratio(40.0, 2.0), ratio(10.0, 2.0), ratio(40.0, 4.0)];
        assert!(
            (full / quarter - 2.0).abs() < 0.05 && (quarter - slow).abs() < 0.1,
            "{full} {quarter} {slow}"
        );
        // 0.9 * 40 lx / 16 for 10 ms on 9 square micrometres, of which 60 % count.
        let white = 0.9 * 40.0 / 16.0 * 0.01 * 9.0 * 0.6 * 11_000.0 / 3.0;
        let expected = (to_light(140.0 / 255.0) * white).sqrt();
        assert!((full / expected - 1.0).abs() < 0.03, "{full} {expected}");
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<SensorNoise>();
        crate::allocations::on_the_first_frames_alone::<SensorNoise>();
    }
}
