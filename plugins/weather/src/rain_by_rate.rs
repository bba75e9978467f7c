//! Rain by rate: drops of the sizes that fall at a rate in millimetres an hour, streaked by their fall and the vehicle's way, and the haze of
//! those that are too far away to be seen.

use pdk_sdk::prelude::*;

use crate::falling::{self, Curtain, Kind};

/// Sizes by Marshall and Palmer, fall by Atlas and Ulbrich.
const RAIN: Kind = Kind {
    intercept: |_| 8000.0,
    slope: |rate| 4.1 * libm::pow(rate.max(1e-6), -0.21),
    smallest: 1.0,
    diameter: |size| size,
    fall: |diameter| 3.778 * libm::pow(diameter, 0.67),
};

/// Lets it rain.
pub struct RainByRate {
    curtain: Curtain,
}

impl Component for RainByRate {
    fn description() -> Description {
        let description = Description::perturbation(
            "rain_by_rate",
            "Lets it rain at a rate: near drops are streaks in front of what is further away, and the others take contrast from the distance",
        )
        .version(4)
        .family("weather")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .mathematics("N(D) = 8000 exp(-4.1 R^-0.21 D) drops per m3 and mm; haze of extinction (pi / 2) int N D^2 dD; streaks of width D and length v T")
        .drawn_per_frame("size and place of each drop")
        .source("Sizes by Marshall and Palmer, The distribution of raindrops with size (1948); fall by Atlas and Ulbrich (1977); streaks as in Garg and Nayar, Vision and rain (2007); haze by Koschmieder's law")
        .parameter(
            Parameter::by_level(
                "rate",
                [1.0, 4.0, 12.0, 35.0, 80.0],
                "how much it rains: slight below 2.5, moderate to 10, heavy to 50, violent above",
            )
            .range(0.0, 300.0)
            .unit("mm/h"),
        );
        falling::described(description)
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { curtain: Curtain::new(config) })
    }
}

impl Perturbation for RainByRate {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.curtain.draw(&RAIN, src, dst, cx)
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::*;
    use crate::test_frames::{even, perturbed};

    #[test]
    fn the_extinction_is_that_of_the_distribution() {
        for rate in [1.0, 10.0, 80.0] {
            // The integral of an exponential with a square, in closed form.
            let slope = (RAIN.slope)(rate);
            let exact = std::f64::consts::PI * 8000.0 / (slope * slope * slope) * 1e-6;
            assert!((RAIN.extinction(rate) / exact - 1.0).abs() < 1e-3, "{rate}: {exact}");
        }
        // Heavy rain leaves about two kilometres of visibility.
        let visibility = 3.0 / RAIN.extinction(10.0);
        assert!((1500.0..2500.0).contains(&visibility), "{visibility}");
        assert_eq!(RAIN.extinction(0.0), 0.0);
    }

    #[test]
    fn more_rain_changes_more_and_none_changes_nothing() {
        let changed = |rate: f64| -> u64 {
            let found = perturbed::<RainByRate>(&json!({"rate": rate}), &even(60, 160, 120), None);
            found.data().iter().map(|value| u64::from(value.abs_diff(60))).sum()
        };
        let all = [0.0, 1.0, 4.0, 12.0, 35.0, 80.0].map(changed);
        assert_eq!(all[0], 0);
        assert!(all.windows(2).all(|pair| pair[0] < pair[1]), "{all:?}");
    }

    #[test]
    fn more_rain_covers_more_at_any_exposure() {
        let changed = |rate: f64, exposure: f64| -> f64 {
            let given = json!({"rate": rate, "exposure": exposure});
            let found = perturbed::<RainByRate>(&given, &even(60, 160, 120), None);
            found.data().iter().map(|value| f64::from(value.abs_diff(60))).sum()
        };
        for exposure in [0.0001, 0.012] {
            let [heavy, violent] = [35.0, 300.0].map(|rate| changed(rate, exposure));
            assert!(violent > 1.6 * heavy, "{exposure}: {heavy} {violent}");
        }
    }

    #[test]
    fn nothing_falls_behind_what_is_near() {
        let wall = vec![0.2; 80 * 60];
        let given = json!({"rate": 80, "depth": "simulator"});
        let found = perturbed::<RainByRate>(&given, &even(60, 80, 60), Some(&wall));
        assert!(found.data().iter().all(|value| value.abs_diff(60) <= 1));
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<RainByRate>();
        crate::allocations::on_the_first_frames_alone::<RainByRate>();
    }
}
