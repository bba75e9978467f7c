//! What a trace is made of.

use pdk_sdk::prelude::{Control, State};

/// What one step of the loop did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// The number of the frame in its scenario, from 0.
    pub sequence: u64,
    /// The state that belongs to the frame.
    pub state: State,
    /// What the driver decided.
    pub control: Control,
    /// Hash of the frame that the driver saw: XXH3 with 64 bits over its bytes.
    pub frame_hash: u64,
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
