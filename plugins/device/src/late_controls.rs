//! Late controls: a control reaches the vehicle some time after the frame that it answers.

use std::path::Path;

use pdk_sdk::prelude::*;

use crate::profile;

/// Controls that it asks for: four seconds at 60 frames a second.
const FRAMES: u32 = 240;
/// The share of a frame that counts as none, because times are sums of steps.
const ROUNDING: f64 = 1e-6;

/// Applies controls late.
pub struct LateControls {
    /// Measured latencies in seconds, if they are what the latency follows.
    profile: Vec<f64>,
}

impl Component for LateControls {
    fn description() -> Description {
        crate::fault(
            "late_controls",
            "Applies a control some time after the frame that it answers: always the same, with jitter, or as it was measured",
            ActsOn::Control,
        )
        .history(FRAMES)
        .mathematics("applied(t) = mean over the frame of the newest control of t' with t' + latency(t') <= t")
        .drawn_per_frame("the jitter")
        .drawn_per_sequence("where in the profile the drive begins")
        .source("Latency from frame to control as in Falanga, Kim and Scaramuzza, How fast is too fast? (2019), and its variation as in RFC 3393; delayed outputs are among the timing faults of AVFI: Jha et al., AVFI: Fault injection for autonomous vehicles (2018)")
        .parameter(Parameter::choice(
            "latency",
            &["constant", "jitter", "profile"],
            "constant: always `delay`; jitter: `delay`, and as much again as is drawn for each control; profile: latencies of a file in their order",
        ))
        .parameter(
            Parameter::by_level("delay", [0.05, 0.1, 0.2, 0.35, 0.5], "how late a control is, at most 240 frames; without effect with a profile")
                .range(0.0, 4.0)
                .unit("s"),
        )
        .parameter(
            Parameter::by_level("jitter", [0.025, 0.05, 0.1, 0.175, 0.25], "mean of what jitter adds, which is distributed exponentially")
                .range(0.0, 4.0)
                .unit("s")
                .only_for("latency", "jitter"),
        )
        .parameter(
            Parameter::path("profile", "a file with measured latencies in milliseconds, one a line; after the last one the first follows")
                .only_for("latency", "profile"),
        )
        .parameter(
            Parameter::by_level("factor", [0.25, 0.5, 1.0, 2.0, 4.0], "what measured latencies are multiplied by")
                .range(0.0, 1000.0)
                .only_for("latency", "profile"),
        )
    }

    fn new(config: &Config) -> Result<Self> {
        let profile = match config.text("latency") {
            "profile" => profile::read(Path::new(config.text("profile")))?,
            _ => Vec::new(),
        };
        Ok(Self { profile })
    }
}

impl LateControls {
    /// How late the control of a frame is, in seconds, in a drive that begins at this place of the profile.
    fn latency(&self, frame_index: u64, begin: u64, cx: &Context<'_>) -> f64 {
        match cx.integer("latency") {
            0 => cx.number("delay"),
            1 => cx.number("delay") - cx.number("jitter") * libm::log1p(-cx.random_of(frame_index).unit()),
            _ => {
                let place = (begin + frame_index) % self.profile.len() as u64;
                self.profile[place as usize] * cx.number("factor")
            }
        }
    }
}

impl Perturbation for LateControls {
    fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
        let begin = match self.profile.len() {
            0 => 0,
            length => u64::from(cx.sequence_random().below(length as u32)),
        };
        // From which share of the frame on a control has arrived.
        let arrived = |time: f64, frame_index: u64| {
            let late = time + self.latency(frame_index, begin, cx) - cx.time;
            let share = match cx.period {
                Some(period) => late / period,
                None if late <= ROUNDING => 0.0,
                None => 1.0,
            };
            match share {
                share if share < ROUNDING => 0.0,
                share if share > 1.0 - ROUNDING => 1.0,
                share => share,
            }
        };
        let now = (cx.time, cx.frame_index, control.numbers());
        let earlier = cx.signals.iter().map(|signal| (signal.time, signal.frame_index, signal.given));
        // From the newest back: each is in effect from its arrival to that of a newer one.
        let (mut applied, mut until) = ([0.0; 2], 1.0);
        for (time, frame_index, given) in std::iter::once(now).chain(earlier) {
            let from = arrived(time, frame_index);
            if from < until {
                let share = until - from;
                applied = [applied[0] + share * given[0], applied[1] + share * given[1]];
                until = from;
            }
            if until == 0.0 {
                break;
            }
        }
        // What was in effect before is not known any more. Before the first control came, nothing was applied.
        let oldest = cx.signals.back(FRAMES as usize).filter(|_| until > 0.0);
        if let Some(oldest) = oldest {
            applied = [applied[0] + until * oldest.given[0], applied[1] + until * oldest.given[1]];
        }
        Ok(Control::from_numbers(applied))
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::*;
    use crate::test_drive::applied;

    fn steering(given: &pdk_sdk::serde_json::Value, controls: &[f64]) -> Vec<f64> {
        let controls: Vec<Control> =
            controls.iter().map(|steering| Control { steering: *steering, throttle: 0.5 }).collect();
        applied::<LateControls>(given, 0.0, &controls).iter().map(|control| control.steering).collect()
    }

    #[test]
    fn a_latency_of_whole_frames_shifts_the_controls_bit_for_bit() {
        let controls: Vec<f64> = (0..60).map(|index| f64::from(index * 37 % 60) / 61.0).collect();
        for (delay, frames) in [(0.0, 0), (0.05, 1), (0.1, 2), (0.35, 7), (2.0, 40)] {
            let found = steering(&json!({"delay": delay}), &controls);
            for (index, found) in found.iter().enumerate() {
                let expected = if index < frames { 0.0 } else { controls[index - frames] };
                assert_eq!(found.to_bits(), f64::to_bits(expected), "{delay} s, frame {index}");
            }
        }
    }

    /// A sine through a pure lag is the same sine, later; a control that is held for a frame makes it later by half a frame, and weaker.
    #[test]
    fn a_sine_comes_later_by_the_latency() {
        let (frequency, period) = (0.5, 0.05);
        let omega = 2.0 * std::f64::consts::PI * frequency;
        let controls: Vec<f64> =
            (0..200).map(|index| 0.8 * libm::sin(omega * f64::from(index) * period)).collect();
        for delay in [0.03, 0.1, 0.17, 0.5] {
            let found = steering(&json!({"delay": delay}), &controls);
            // Over whole periods of the sine, after the beginning.
            let (mut real, mut imaginary) = (0.0, 0.0);
            for (index, found) in found.iter().enumerate().skip(40).take(160) {
                let angle = omega * index as f64 * period;
                real += found * libm::sin(angle);
                imaginary += found * libm::cos(angle);
            }
            let lag = libm::atan2(-imaginary, real) / omega;
            assert!((lag - delay).abs() < 2e-4, "{delay} s: {lag} s");
        }
    }

    #[test]
    fn a_latency_between_frames_applies_both_controls_for_their_shares() {
        // Three quarters of a frame of the old one, a quarter of the new one.
        let found = steering(&json!({"delay": 0.0375}), &[0.0, 1.0, 1.0, 0.0]);
        let expected = [0.0, 0.25, 1.0, 0.75];
        assert!(
            found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-9),
            "{found:?}"
        );
    }

    #[test]
    fn jitter_adds_what_was_asked_for_and_newer_controls_win() {
        let controls: Vec<f64> = (0..4_000).map(|index| f64::from(index) / 4_000.0).collect();
        let found = steering(&json!({"latency": "jitter", "delay": 0.1, "jitter": 0.01}), &controls);
        let lags: Vec<f64> = found
            .iter()
            .zip(&controls)
            .skip(50)
            .map(|(found, control)| (control - found) * 4_000.0 * 0.05)
            .collect();
        let mean = lags.iter().sum::<f64>() / lags.len() as f64;
        assert!((mean - 0.11).abs() < 0.002, "{mean}");
        // With more jitter than frames last, controls overtake each other, and what is overtaken is never applied later.
        let found = steering(&json!({"latency": "jitter", "delay": 0, "jitter": 0.2}), &controls);
        assert!(found.windows(2).all(|pair| pair[0] <= pair[1] + 1e-12));
    }

    #[test]
    fn a_profile_is_followed_in_its_order() {
        let path = std::env::temp_dir().join(format!("pdk-late-controls-{}", std::process::id()));
        std::fs::write(&path, "0\n50\n").unwrap();
        let given = json!({"latency": "profile", "profile": path.to_str().unwrap(), "factor": 2.0});
        let controls: Vec<f64> = (0..40).map(|index| f64::from(index) / 40.0).collect();
        let found = steering(&given, &controls);
        std::fs::remove_file(&path).unwrap();
        // At once, or after two frames; then the one behind it has overtaken it.
        for (index, found) in found.iter().enumerate().skip(3) {
            let expected = [controls[index], controls[index - 1]];
            assert!(expected.contains(found), "frame {index}: {found}");
        }
        assert!(found.windows(2).skip(3).any(|pair| pair[0] == pair[1]));
        let missing = json!({"latency": "profile", "profile": "/nowhere"});
        let config = Config::check(&LateControls::description(), missing.as_object().unwrap()).unwrap();
        assert!(LateControls::new(&config).is_err());
    }

    #[test]
    fn a_control_is_late_by_as_many_frames_as_are_kept_at_most() {
        // 300 frames.
        let path = std::env::temp_dir().join(format!("pdk-later-controls-{}", std::process::id()));
        std::fs::write(&path, "15000\n").unwrap();
        let given = json!({"latency": "profile", "profile": path.to_str().unwrap(), "factor": 1.0});
        let controls: Vec<f64> = (0..400).map(|index| f64::from(index + 1) / 400.0).collect();
        let found = steering(&given, &controls);
        std::fs::remove_file(&path).unwrap();
        for (index, found) in found.iter().enumerate() {
            let expected = index.checked_sub(FRAMES as usize).map_or(0.0, |oldest| controls[oldest]);
            assert_eq!(*found, expected, "frame {index}");
        }
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<LateControls>();
    }
}
