//! What a trace is made of.

use pdk_sdk::prelude::{Control, State};

/// What one step of the loop did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Step {
    /// The number of the frame in its scenario, from 0.
    pub sequence: u64,
    /// The state that belongs to the frame.
    pub state: State,
    /// What the driver decided.
    pub control: Control,
    /// Hash of the frame that the driver saw: XXH3 with 64 bits over its bytes.
    pub frame_hash: u64,
    /// What the driver got besides the frame, if a perturbation acts on that: time and speed.
    pub observed: Option<[f64; 2]>,
    /// What was applied to the vehicle, if a perturbation acts on controls.
    pub applied: Option<Control>,
}

impl Step {
    /// What tables of steps call the numbers that the driver got besides the frame.
    pub const OBSERVED: [&str; 2] = ["observed_time", "observed_speed"];
    /// What tables of steps call the numbers of the control as it was applied.
    pub const APPLIED: [&str; 2] = ["applied_steering", "applied_throttle"];
}

/// What tells a drive from others: a hash over what the driver saw and decided in each frame. It is part of the outcome.
#[derive(Debug, Clone, Default)]
pub struct Digest(blake3::Hasher);

/// Hexadecimal digits of a digest.
const DIGITS: usize = 32;

impl Digest {
    /// Adds a step: the hash of the frame that the driver saw, and what it decided.
    pub fn add(&mut self, frame_hash: u64, control: &Control) {
        for part in [frame_hash, control.steering.to_bits(), control.throttle.to_bits()] {
            self.0.update(&part.to_le_bytes());
        }
    }

    /// The digest of all steps so far, in hexadecimal.
    pub fn text(&self) -> String {
        self.0.finalize().to_hex()[..DIGITS].to_owned()
    }
}

/// Which of the image topics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageTopic {
    /// What the camera saw.
    Raw,
    /// What the driver saw.
    Perturbed,
    /// What its network looked at: the frame that it saw, with a saliency map laid over.
    Attention,
}
