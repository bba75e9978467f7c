//! The camera of a simulator.

use serde::{Deserialize, Serialize};

/// Size and rate of a simulator's camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Frame width in pixels.
    pub width: u32,
    /// Frame height in pixels.
    pub height: u32,
    /// Frames per second of simulation time.
    pub rate: f64,
}
