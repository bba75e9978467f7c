//! What came of a scenario with a driver: of a drive, or of a block of a recording.

use pdk_loop::protocol::EvaluatedFrame;
use pdk_model::canonical::canonical;
use pdk_model::outcome::{Cause, Outcome};
use pdk_model::scenario::ScenarioId;
use pdk_sdk::error::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::stretch::Stretch;

/// Hexadecimal digits of a checksum and of a digest.
const DIGITS: usize = 32;
/// What can be required of blocks: the numbers among the fields of [`BlockOutcome`].
pub const BLOCK_MEASURES: [&str; 3] = ["steering_error", "max_steering_error", "throttle_error"];

/// How a scenario ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Ending {
    /// A drive.
    Drive(Cause),
    /// A block of a recording.
    Block(Steering),
}

/// How a driver steered on a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Steering {
    /// As it was recorded, or near enough.
    Kept,
    /// Off by more than is allowed.
    Off,
}

impl Ending {
    /// Whether the driver failed.
    pub fn failed(self) -> bool {
        match self {
            Self::Drive(cause) => cause.verdict().failed(),
            Self::Block(steering) => steering == Steering::Off,
        }
    }

    /// As tables have it.
    pub fn text(self) -> &'static str {
        match self {
            Self::Drive(cause) => cause.text(),
            Self::Block(Steering::Kept) => "steering kept",
            Self::Block(Steering::Off) => "steering off",
        }
    }
}

/// What came of a scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Came {
    /// Of a drive.
    Drive(Box<Outcome>),
    /// Of a block of a recording.
    Block(BlockOutcome),
}

/// What came of a block of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlockOutcome {
    /// Whether the steering was off by no more than is allowed.
    pub kept: bool,
    /// Frames for which the driver decided.
    pub frames: usize,
    /// Frames that could not be read or perturbed, and count for nothing.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub bad_frames: usize,
    /// The mean absolute difference between the driver's steering and the recorded one.
    pub steering_error: f64,
    /// The largest one.
    pub max_steering_error: f64,
    /// That of the throttle on average; none if none was recorded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub throttle_error: Option<f64>,
    /// The hash of all that the driver decided and all that was recorded.
    pub digest: String,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl BlockOutcome {
    /// What frames of a stretch came to.
    ///
    /// # Errors
    /// If the driver failed on a frame, or there is nothing that its steering can be compared with.
    pub fn of(stretch: &Stretch, frames: &[EvaluatedFrame]) -> Result<Self> {
        let mut hasher = blake3::Hasher::new_derive_key("pdk block, version 1");
        let (mut steering, mut throttle, mut bad_frames, mut good) = (Vec::new(), Vec::new(), 0, 0);
        let mut first_bad = None;
        for (index, frame) in frames.iter().enumerate() {
            match frame {
                EvaluatedFrame::Good { truth, control, .. } => {
                    good += 1;
                    hasher.update(&(index as u64).to_le_bytes());
                    for number in [truth.steering, truth.throttle, control.steering, control.throttle] {
                        hasher.update(&number.to_bits().to_le_bytes());
                    }
                    steering.push((control.steering - truth.steering).abs());
                    throttle.push((control.throttle - truth.throttle).abs());
                }
                EvaluatedFrame::Bad { frame, error, by_driver: true } => {
                    return Err(Error::new(format!("{frame}: {error}")));
                }
                EvaluatedFrame::Bad { frame, error, by_driver: false } => {
                    bad_frames += 1;
                    first_bad.get_or_insert_with(|| {
                        format!("; the first that could not be used: {frame}: {error}")
                    });
                }
                EvaluatedFrame::Predicted { .. } => {
                    return Err(Error::new(
                        "a worker predicted instead of driving, which is a defect in pdk",
                    ));
                }
            }
        }
        // What was not recorded is not a number.
        steering.retain(|difference: &f64| !difference.is_nan());
        throttle.retain(|difference: &f64| !difference.is_nan());
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        if steering.is_empty() {
            return Err(Error::new(format!(
                "no frame from {} to {} has a steering that was recorded{}; leave these frames out",
                stretch.start,
                stretch.end,
                first_bad.unwrap_or_default()
            )));
        }
        let steering_error = mean(&steering);
        Ok(Self {
            kept: steering_error <= stretch.steering_error,
            frames: good,
            bad_frames,
            steering_error,
            max_steering_error: steering.iter().copied().fold(0.0, f64::max),
            throttle_error: (!throttle.is_empty()).then(|| mean(&throttle)),
            digest: hasher.finalize().to_hex()[..DIGITS].to_owned(),
        })
    }
}

impl Came {
    /// How it ended.
    pub fn ending(&self) -> Ending {
        match self {
            Self::Drive(outcome) => Ending::Drive(outcome.cause),
            Self::Block(outcome) => Ending::Block(if outcome.kept { Steering::Kept } else { Steering::Off }),
        }
    }

    /// Why a component failed; none if none did.
    pub fn error(&self) -> Option<&str> {
        match self {
            Self::Drive(outcome) if outcome.cause == Cause::Error => {
                Some(outcome.error.as_deref().unwrap_or_default())
            }
            Self::Drive(_) | Self::Block(_) => None,
        }
    }

    /// How it ended, in a clause with a number.
    pub fn said(&self) -> String {
        let text = self.ending().text();
        match self {
            Self::Drive(outcome) => format!("{text} after {:.2} s", outcome.time),
            Self::Block(outcome) => format!("{text} by {:.3} on average", outcome.steering_error),
        }
    }

    /// A measure; none if it was not measured, or if a drive did not reach the end of its road, because the measure of a part of a drive
    /// says something else.
    pub fn measured(&self, measure: &str) -> Option<f64> {
        if let Self::Drive(outcome) = self
            && outcome.cause != Cause::Finished
        {
            return None;
        }
        let value = serde_json::to_value(self).ok()?;
        value.get(measure).or_else(|| value.get("measures")?.get(measure))?.as_f64()
    }

    /// The checksum of all that it says, and of the scenario.
    pub fn checksum(&self, id: &ScenarioId) -> String {
        let text = canonical(&json!({"id": id, "outcome": self}));
        let hash = blake3::derive_key("pdk verdict outcome, version 1", text.as_bytes());
        blake3::Hash::from_bytes(hash).to_hex()[..DIGITS].to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::Control;

    const STRETCH: Stretch = Stretch { sequence: 0, from: 0, start: 0, end: 4, steering_error: 0.25 };

    fn good(truth: f64, steering: f64) -> EvaluatedFrame {
        EvaluatedFrame::Good {
            frame: "a".into(),
            truth: Control { steering: truth, throttle: f64::NAN },
            control: Control { steering, throttle: 0.5 },
        }
    }

    fn bad(by_driver: bool) -> EvaluatedFrame {
        EvaluatedFrame::Bad { frame: "7.jpg".into(), error: "cut off".into(), by_driver }
    }

    #[test]
    fn a_block_is_failed_if_the_steering_is_off_on_average() {
        let of = |frames: &[EvaluatedFrame]| BlockOutcome::of(&STRETCH, frames).unwrap();
        let kept = of(&[good(0.0, 0.5), good(0.25, 0.25), bad(false)]);
        assert_eq!((kept.kept, kept.frames, kept.bad_frames), (true, 2, 1));
        assert_eq!((kept.steering_error, kept.max_steering_error, kept.throttle_error), (0.25, 0.5, None));
        let off = of(&[good(0.0, 0.5), good(0.25, 0.0)]);
        assert!(!off.kept && off.digest != kept.digest);
        let came = Came::Block(off.clone());
        assert!(came.ending().failed() && came.said() == "steering off by 0.375 on average");
        assert_eq!((came.measured("steering_error"), came.measured("throttle_error")), (Some(0.375), None));
        for measure in BLOCK_MEASURES {
            let all = Came::Block(BlockOutcome { throttle_error: Some(1.0), ..off.clone() });
            assert!(all.measured(measure).is_some(), "{measure}");
        }
        let text = serde_json::to_string(&came).unwrap();
        assert_eq!(serde_json::from_str::<Came>(&text).unwrap(), came);
    }

    #[test]
    fn what_cannot_be_compared_is_an_error_and_so_is_a_driver_that_fails() {
        let error = |frames: &[EvaluatedFrame]| BlockOutcome::of(&STRETCH, frames).unwrap_err().to_string();
        assert_eq!(error(&[good(0.0, 0.5), bad(true)]), "7.jpg: cut off");
        let nothing = error(&[good(f64::NAN, 0.5), bad(false)]);
        assert!(
            nothing.contains("no frame from 0 to 4 has a steering") && nothing.contains("7.jpg: cut off"),
            "{nothing}"
        );
    }

    #[test]
    fn a_measure_is_that_of_a_whole_drive() {
        let mut outcome =
            Outcome { cause: Cause::Finished, max_cross_track_error: 0.5, ..Outcome::default() };
        outcome.measures = Some(Box::default());
        let came = |outcome: &Outcome| Came::Drive(Box::new(outcome.clone()));
        assert_eq!(came(&outcome).measured("max_cross_track_error"), Some(0.5));
        assert_eq!(came(&outcome).measured("max_jerk"), Some(0.0));
        outcome.cause = Cause::LaneDeparture;
        assert_eq!(came(&outcome).measured("max_cross_track_error"), None);
    }
}
