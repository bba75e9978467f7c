//! Perturbations of the device family: faults between the driver and the vehicle that are not in the picture.
//!
//! Nothing is kept between calls. What a fault did at earlier frames is in the signals that pdk hands over, and what was drawn for
//! them is drawn again from their numbers.

mod biased_speed;
mod drifting_clock;
mod drifting_speed;
mod lagging_controls;
mod late_controls;
mod late_speed;
mod limited_controls;
mod lost_controls;
mod lost_speed;
mod noisy_speed;
mod profile;
mod quantised_controls;
mod slow_controls;
mod steering_offset;
mod steering_play;

#[cfg(test)]
mod test_drive;

use pdk_sdk::prelude::*;

pdk_sdk::export! {
    perturbations: [
        biased_speed::BiasedSpeed,
        drifting_clock::DriftingClock,
        drifting_speed::DriftingSpeed,
        lagging_controls::LaggingControls,
        late_controls::LateControls,
        late_speed::LateSpeed,
        limited_controls::LimitedControls,
        lost_controls::LostControls,
        lost_speed::LostSpeed,
        noisy_speed::NoisySpeed,
        quantised_controls::QuantisedControls,
        slow_controls::SlowControls,
        steering_offset::SteeringOffset,
        steering_play::SteeringPlay,
    ]
}

/// What the descriptions of all of them have in common.
#[track_caller]
fn fault(name: &str, doc: &str, acts_on: ActsOn) -> Description {
    Description::perturbation(name, doc)
        .family("device")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .acts_on(acts_on)
}

/// What the driver gets with another speed. One below 0 is 0, and one that is not known stays unknown.
fn with_speed(observation: DriveContext, speed: f64) -> DriveContext {
    DriveContext { speed: if speed < 0.0 { 0.0 } else { speed }, ..observation }
}
