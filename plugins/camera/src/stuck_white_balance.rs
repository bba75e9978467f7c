//! Stuck white balance: the camera balances colours for a light that is not there.

use pdk_sdk::ops::light::Light;
use pdk_sdk::ops::point::lookup_by_channel;
use pdk_sdk::prelude::*;

/// Balances colours for another light.
#[derive(Default)]
pub struct StuckWhiteBalance {
    light: Light,
}

impl Component for StuckWhiteBalance {
    fn description() -> Description {
        Description::perturbation(
            "stuck_white_balance",
            "Balances colours for the light of lamps by day, as a camera does whose white balance is stuck",
        )
        .family("camera")
        .not_default()
        .keeps_geometry()
        .mathematics("light(v_c) gain_c, with the gains of von Kries from one black body to another, and green as it was")
        .source("Colour of black bodies by Kim et al., Design of advanced color temperature control system for HDTV applications (2002); gains as von Kries has them, in light by IEC 61966-2-1 (sRGB)")
        .parameter(
            Parameter::by_level(
                "stuck",
                [5400.0, 4500.0, 3700.0, 3000.0, 2300.0],
                "the light for which colours are balanced: below that of the scene, the picture turns blue; above, it turns orange",
            )
            .range(1667.0, 25_000.0)
            .unit("K"),
        )
        .parameter(Parameter::number("scene", 6500.0, "the light of the scene").range(1667.0, 25_000.0).unit("K"))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

/// The place of a black body in the diagram of CIE 1931, for 1667 to 25,000 K.
fn chromaticity(kelvin: f64) -> [f64; 2] {
    let t = 1000.0 / kelvin;
    let x = match kelvin {
        ..=4000.0 => -0.266_123_9 * t * t * t - 0.234_358_9 * t * t + 0.877_695_6 * t + 0.179_910,
        _ => -3.025_846_9 * t * t * t + 2.107_037_9 * t * t + 0.222_634_7 * t + 0.240_390,
    };
    let y = match kelvin {
        ..=2222.0 => -1.106_381_4 * x * x * x - 1.348_110_20 * x * x + 2.185_558_32 * x - 0.202_196_83,
        ..=4000.0 => -0.954_947_6 * x * x * x - 1.374_185_93 * x * x + 2.091_370_15 * x - 0.167_488_67,
        _ => 3.081_758_0 * x * x * x - 5.873_386_70 * x * x + 3.751_129_97 * x - 0.370_014_83,
    };
    [x, y]
}

/// The light of a black body in the primaries of sRGB, none of which is below a trace.
fn primaries(kelvin: f64) -> [f64; 3] {
    let [x, y] = chromaticity(kelvin);
    let (x, z) = (x / y, (1.0 - x - y) / y);
    [
        3.240_45 * x - 1.537_14 - 0.498_53 * z,
        -0.969_27 * x + 1.876_01 + 0.041_56 * z,
        0.055_64 * x - 0.204_03 + 1.057_23 * z,
    ]
    .map(|light| light.max(0.01))
}

/// The factors of red, green and blue of a scene that is balanced for another light.
fn gains(scene: f64, stuck: f64) -> [f64; 3] {
    let (is, believed) = (primaries(scene), primaries(stuck));
    let green = is[1] / believed[1];
    [0, 1, 2].map(|channel| is[channel] / believed[channel] / green)
}

impl Perturbation for StuckWhiteBalance {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let gains = gains(cx.number("scene"), cx.number("stuck"));
        let light = &self.light;
        let tables: [[u8; 256]; 3] =
            gains.map(|gain| std::array::from_fn(|value| light.store(gain as f32 * light.of(value as u8))));
        lookup_by_channel(src, dst, &tables);
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
    fn black_bodies_are_where_tables_have_them() {
        // Places of the Planckian locus in CIE 1931, to the accuracy of the approximation.
        for (kelvin, x, y) in [
            (2000.0, 0.5267, 0.4133),
            (3000.0, 0.4369, 0.4041),
            (4500.0, 0.3608, 0.3636),
            (6500.0, 0.3135, 0.3237),
            (10_000.0, 0.2807, 0.2884),
        ] {
            let [found_x, found_y] = chromaticity(kelvin);
            assert!(
                (found_x - x).abs() < 0.002 && (found_y - y).abs() < 0.002,
                "{kelvin} K: {found_x} {found_y}"
            );
        }
    }

    #[test]
    fn grey_gets_the_colour_that_the_gains_say() {
        let gains = gains(6500.0, 3000.0);
        assert!(gains[0] < 0.7 && gains[1] == 1.0 && gains[2] > 2.0, "{gains:?}");
        let found =
            perturbed::<StuckWhiteBalance>(&json!({"stuck": 3000}), 3.0, (0, 0.0), &[even(100, 2, 2)]);
        for (value, gain) in found.data().iter().zip(gains) {
            let expected = 255.0 * from_light((to_light(100.0 / 255.0) * gain).min(1.0));
            assert!((f64::from(*value) - expected).abs() < 0.7, "{value} {expected}");
        }
        // Nothing is wrong if the light is what the camera believes it to be.
        let source = even(100, 2, 2);
        let balanced = perturbed::<StuckWhiteBalance>(
            &json!({"stuck": 6500}),
            3.0,
            (0, 0.0),
            std::slice::from_ref(&source),
        );
        assert_eq!(balanced, source);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<StuckWhiteBalance>();
        crate::allocations::on_the_first_frames_alone::<StuckWhiteBalance>();
    }
}
