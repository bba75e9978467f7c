//! Exposure hunting: automatic exposure swings around its aim and does not settle.

use pdk_sdk::ops::light::Light;
use pdk_sdk::ops::point::lookup;
use pdk_sdk::prelude::*;

/// Lets the exposure swing.
#[derive(Default)]
pub struct ExposureHunting {
    light: Light,
}

impl Component for ExposureHunting {
    fn description() -> Description {
        Description::perturbation(
            "exposure_hunting",
            "Lets the exposure swing around its aim, as automatic exposure does that corrects too much and too late",
        )
        .family("camera")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .mathematics("light(v) 2^(swing sin(2 pi t / period + phase)), clipped and stored")
        .drawn_per_sequence("the phase")
        .source("Oscillation of a control loop with too much gain and dead time; exposure in stops, light by IEC 61966-2-1 (sRGB)")
        .parameter(
            Parameter::by_level("swing", [0.3, 0.6, 1.0, 1.5, 2.2], "how far the exposure swings to either side")
                .range(0.0, 8.0)
                .unit("stops"),
        )
        .parameter(Parameter::number("period", 1.6, "how long a swing and the one back take").range(0.02, 1000.0).unit("s"))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

/// The factor of the light at a time.
fn gain(cx: &Context<'_>) -> f64 {
    let phase = cx.sequence_random().unit();
    let turn = 2.0 * std::f64::consts::PI * (cx.time / cx.number("period") + phase);
    libm::exp2(cx.number("swing") * libm::sin(turn))
}

impl Perturbation for ExposureHunting {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let gain = gain(cx) as f32;
        let table = std::array::from_fn(|value| self.light.store(gain * self.light.of(value as u8)));
        lookup(src, dst, &table);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::ops::light::{from_light, to_light};
    use pdk_sdk::serde_json::json;

    use super::*;
    use crate::test_frames::{even, perturbed};

    #[test]
    fn light_is_multiplied_as_the_formula_says() {
        let key = Key([6; 32]);
        let names = ["swing", "period"].map(str::to_owned);
        for (index, time) in [(0, 0.0), (7, 0.35), (23, 1.15)] {
            let cx = Context::new(2.0, index, time, &key).with_values(&names, &[1.5, 2.0]);
            let factor = gain(&cx);
            for grey in [0, 1, 10, 77, 128, 200, 255] {
                let found = perturbed::<ExposureHunting>(
                    &json!({"swing": 1.5, "period": 2.0}),
                    2.0,
                    (index, time),
                    &[even(grey, 5, 3)],
                );
                let light = (to_light(f64::from(grey) / 255.0) * factor).min(1.0);
                let expected = 255.0 * from_light(light);
                assert!(
                    found.data().iter().all(|value| (f64::from(*value) - expected).abs() < 0.7),
                    "{grey}"
                );
            }
        }
    }

    #[test]
    fn over_a_period_the_exposure_goes_to_both_sides_and_back() {
        let grey =
            |time: f64| perturbed::<ExposureHunting>(&json!({}), 2.0, (0, time), &[even(90, 2, 2)]).data()[0];
        let swing: Vec<u8> = (0..33).map(|step| grey(f64::from(step) * 0.05)).collect();
        // A stop more and a stop less of a grey of 90.
        let (darkest, brightest) = (*swing.iter().min().unwrap(), *swing.iter().max().unwrap());
        assert!((62..=66).contains(&darkest) && (122..=127).contains(&brightest), "{darkest} {brightest}");
        assert_eq!(swing[0], swing[32]);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<ExposureHunting>();
        crate::allocations::on_the_first_frames_alone::<ExposureHunting>();
    }
}
