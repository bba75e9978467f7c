//! Lost controls: controls are lost in bursts on their way to the vehicle.

use pdk_sdk::bursts;
use pdk_sdk::prelude::*;

/// Loses controls.
pub struct LostControls;

impl Component for LostControls {
    fn description() -> Description {
        let description = crate::fault(
            "lost_controls",
            "Loses controls in bursts, while the vehicle keeps to the last one that came",
            ActsOn::Control,
        )
        .version(2)
        .history(1)
        .mathematics("applied(t) = control(last t' <= t that is not lost)")
        .drawn_per_frame("whether a burst begins, and its length")
        .source("Burst losses as in Gilbert, Capacity of a burst-noise channel (1960); lost messages are among the timing faults of AVFI: Jha et al., AVFI: Fault injection for autonomous vehicles (2018)");
        bursts::described(description, "controls", [0.1, 0.2, 0.35, 0.5, 0.7], [1.0, 2.0, 4.0, 8.0, 16.0]).parameter(
            Parameter::choice(
                "applies",
                &["last", "nothing"],
                "what is applied in place of a lost control: last: the last one that came; nothing: wheels straight, neither throttle nor brake",
            ),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for LostControls {
    fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
        if !bursts::of(cx).lose(cx.frame_index, cx) {
            return Ok(control);
        }
        let last = cx.signals.back(1).filter(|_| cx.integer("applies") == 0);
        // Before the first control that came, nothing is applied.
        Ok(last.map_or_else(Control::default, |before| Control::from_numbers(before.passed)))
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::Control;
    use pdk_sdk::serde_json::json;

    use super::LostControls;
    use crate::test_drive::applied;

    #[test]
    fn the_vehicle_keeps_to_the_last_control_that_came() {
        let controls: Vec<Control> = (1..=500)
            .map(|index| Control { steering: f64::from(index) / 500.0, throttle: -f64::from(index) / 500.0 })
            .collect();
        let found = applied::<LostControls>(&json!({"lost": 0.5, "burst": 4}), 0.0, &controls);
        let mut latest = Control::default();
        for (control, applied) in controls.iter().zip(&found) {
            assert!(applied == control || *applied == latest, "{applied:?} at {control:?} after {latest:?}");
            latest = *applied;
        }
        let lost = found.iter().zip(&controls).filter(|(applied, control)| applied != control).count();
        assert!((160..340).contains(&lost), "{lost}");
        let nothing =
            applied::<LostControls>(&json!({"lost": 0.5, "burst": 4, "applies": "nothing"}), 0.0, &controls);
        assert_eq!(nothing.iter().filter(|control| **control == Control::default()).count(), lost);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<LostControls>();
    }
}
