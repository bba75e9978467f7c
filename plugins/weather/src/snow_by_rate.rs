//! Snow by rate: flakes of the sizes that fall at a rate in millimetres of water an hour, and the haze of those that are too far away to be
//! seen.

use pdk_sdk::prelude::*;

use crate::falling::{self, Curtain, Kind};

/// Sizes by Sekhon and Srivastava, density by Brandes and others, fall by Locatelli and Hobbs.
const SNOW: Kind = Kind {
    intercept: |rate| 2500.0 * libm::pow(rate.max(1e-6), -0.94),
    slope: |rate| 2.29 * libm::pow(rate.max(1e-6), -0.45),
    smallest: 0.5,
    // A flake weighs what its drop does, and its density is 0.178 d^-0.922 g/cm3.
    diameter: |size| libm::pow(size * size * size / 0.178, 1.0 / 2.078),
    fall: |diameter| 0.8 * libm::pow(diameter, 0.16),
};

/// Lets it snow.
pub struct SnowByRate {
    curtain: Curtain,
}

impl Component for SnowByRate {
    fn description() -> Description {
        let description = Description::perturbation(
            "snow_by_rate",
            "Lets it snow at a rate: near flakes are streaks in front of what is further away, and the others hide the distance",
        )
        .version(4)
        .family("weather")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .mathematics("N(D) = 2500 R^-0.94 exp(-2.29 R^-0.45 D) flakes per m3 and mm of melted size D, of diameter d = (D^3 / 0.178)^(1 / 2.078); haze of extinction (pi / 2) int N d^2 dD")
        .drawn_per_frame("size and place of each flake")
        .source("Sizes by Sekhon and Srivastava, Snow size spectra and radar reflectivity (1970); density by Brandes et al., A statistical and physical description of hydrometeor distributions in Colorado snowstorms (2007); fall by Locatelli and Hobbs (1974); haze by Koschmieder's law")
        .parameter(
            Parameter::by_level(
                "rate",
                [0.1, 0.3, 1.0, 2.5, 6.0],
                "how much it snows, as water: light below 1, moderate to 2.5, heavy above",
            )
            .range(0.0, 30.0)
            .unit("mm/h"),
        );
        falling::described(description)
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { curtain: Curtain::new(config) })
    }
}

impl Perturbation for SnowByRate {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.curtain.draw(&SNOW, src, dst, cx)
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::*;
    use crate::test_frames::{even, perturbed};

    #[test]
    fn snow_hides_the_distance_as_far_as_observers_report() {
        // At 1 mm/h visibilities of half a kilometre to one and a half are observed, and in heavy snow of a few hundred metres.
        let visibility = |rate: f64| 3.0 / SNOW.extinction(rate);
        assert!((500.0..1500.0).contains(&visibility(1.0)), "{}", visibility(1.0));
        assert!((150.0..500.0).contains(&visibility(4.0)), "{}", visibility(4.0));
        assert_eq!(SNOW.extinction(0.0), 0.0);
    }

    #[test]
    fn a_flake_weighs_what_its_drop_does() {
        for size in [0.5, 1.0, 3.0] {
            let diameter = (SNOW.diameter)(size);
            let density = 0.178 * libm::pow(diameter, -0.922);
            assert!((density * libm::pow(diameter, 3.0) - size * size * size).abs() < 1e-6 * size, "{size}");
            assert!(diameter > 1.5 * size && (0.7..1.5).contains(&(SNOW.fall)(diameter)));
        }
    }

    #[test]
    fn more_snow_changes_more_and_none_changes_nothing() {
        let changed = |rate: f64| -> u64 {
            let found = perturbed::<SnowByRate>(&json!({"rate": rate}), &even(60, 160, 120), None);
            found.data().iter().map(|value| u64::from(value.abs_diff(60))).sum()
        };
        let all = [0.0, 0.1, 0.3, 1.0, 2.5, 6.0].map(changed);
        assert_eq!(all[0], 0);
        assert!(all.windows(2).all(|pair| pair[0] < pair[1]), "{all:?}");
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<SnowByRate>();
        crate::allocations::on_the_first_frames_alone::<SnowByRate>();
    }
}
