//! Flicker: lamps on the mains go bright and dark while the rows of a frame are read.

use pdk_sdk::ops::light::Light;
use pdk_sdk::prelude::*;

/// Lights the rows of a frame by a lamp that flickers.
#[derive(Default)]
pub struct Flicker {
    light: Light,
}

impl Component for Flicker {
    fn description() -> Description {
        Description::perturbation(
            "flicker",
            "Lights the scene with lamps that flicker, so that bright and dark bands wander through the frame as its rows are read",
        )
        .family("camera")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .mathematics("light(v) (1 + depth sinc(f e) cos(2 pi f (t + readout y / H) + phase)), clipped and stored")
        .drawn_per_sequence("the phase, and by how much the frequency is off: up to half a percent")
        .source("Modulation of lamps as in IEEE 1789-2015, read by a rolling shutter; light by IEC 61966-2-1 (sRGB)")
        .parameter(
            Parameter::by_level("depth", [0.1, 0.2, 0.4, 0.65, 1.0], "how much the light of the lamps goes up and down, as a share of its mean")
                .range(0.0, 1.0),
        )
        .parameter(
            Parameter::number("frequency", 100.0, "how often the lamps flicker: twice the frequency of the mains")
                .range(0.1, 10_000.0)
                .unit("Hz"),
        )
        .parameter(Parameter::number("readout", 0.02, "how long it takes to read all rows").range(0.0, 1.0).unit("s"))
        .parameter(Parameter::number("exposure", 0.004, "how long a row is exposed, which evens the flicker out").range(0.0, 1.0).unit("s"))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

/// The lamps in a frame: the factor of the light in a row, by the share of the way from the first row to the one behind the last.
fn gain(cx: &Context<'_>) -> impl Fn(f64) -> f64 {
    let mut random = cx.sequence_random();
    let phase = random.unit();
    let frequency = cx.number("frequency") * random.uniform(0.995, 1.005);
    // The mean over the exposure.
    let half = std::f64::consts::PI * frequency * cx.number("exposure");
    let evened = if half > 0.0 { libm::sin(half) / half } else { 1.0 };
    let (depth, time, readout) = (cx.number("depth") * evened, cx.time, cx.number("readout"));
    move |down| {
        let turn = frequency * (time + down * readout) + phase;
        1.0 + depth * libm::cos(2.0 * std::f64::consts::PI * turn)
    }
}

impl Perturbation for Flicker {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (height, gain) = (src.height() as f64, gain(cx));
        for (y, (row, from)) in dst.rows_mut().zip(src.rows()).enumerate() {
            self.light.scale(from, row, gain(y as f64 / height) as f32);
        }
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
    fn rows_are_as_bright_as_the_formula_says() {
        let key = Key([6; 32]);
        let names = ["depth", "frequency", "readout", "exposure"].map(str::to_owned);
        let cx = Context::new(2.0, 4, 0.2, &key).with_values(&names, &[0.5, 120.0, 0.03, 0.002]);
        let given = json!({"depth": 0.5, "frequency": 120, "readout": 0.03, "exposure": 0.002});
        let found = perturbed::<Flicker>(&given, 2.0, (4, 0.2), &[even(100, 3, 40)]);
        let (mut seen, gain) = (std::collections::BTreeSet::new(), gain(&cx));
        for (y, row) in found.as_ref().rows().enumerate() {
            let expected = 255.0 * from_light(to_light(100.0 / 255.0) * gain(y as f64 / 40.0));
            assert!(row.iter().all(|value| (f64::from(*value) - expected).abs() < 0.7), "row {y}");
            seen.insert(row[0]);
        }
        assert!(seen.len() > 10, "{seen:?}");
    }

    #[test]
    fn an_exposure_of_a_whole_period_evens_the_flicker_out() {
        // The frequency is off by up to half a percent.
        let source = even(100, 4, 20);
        let found = perturbed::<Flicker>(
            &json!({"depth": 1.0, "exposure": 0.01}),
            4.0,
            (4, 0.2),
            std::slice::from_ref(&source),
        );
        assert!(found.data().iter().zip(source.data()).all(|(a, b)| a.abs_diff(*b) <= 1));
        let still = perturbed::<Flicker>(&json!({"depth": 0}), 4.0, (4, 0.2), std::slice::from_ref(&source));
        assert_eq!(still, source);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<Flicker>();
        crate::allocations::on_the_first_frames_alone::<Flicker>();
    }
}
