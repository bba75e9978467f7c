//! What is measured.

use std::path::PathBuf;

use serde::Deserialize;

/// A line of standard input.
#[derive(Deserialize)]
pub struct Task {
    pub library: Library,
    pub work: Work,
    /// Width and height.
    pub size: [usize; 2],
    /// The file with the bytes of the frame.
    pub frame: PathBuf,
    /// Where the bytes of the result go.
    pub picture: PathBuf,
}

/// Whose functions are measured.
#[derive(Clone, Copy, Deserialize)]
pub enum Library {
    #[serde(rename = "kornia-rs")]
    Kornia,
    #[serde(rename = "fast_image_resize")]
    FastImageResize,
    #[serde(rename = "libblur")]
    Libblur,
}

/// What is done to a frame.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Work {
    /// Smooths with a Gaussian kernel.
    Gaussian { kernel: Gaussian, edge: Edge },
    /// Takes a Gaussian blur from twice the frame.
    HighPass(Gaussian),
    /// Smooths the value of hue, saturation and value.
    LowPass(Gaussian),
    /// Weighs the pixels around each one.
    Filter { side: usize, weights: Vec<f32>, edge: Edge },
    /// Shrinks to this size and enlarges again, both by linear interpolation.
    Pixelate([usize; 2]),
    /// Shrinks to the means of areas and enlarges to blocks.
    Blocks([usize; 2]),
    /// Shrinks and puts the result in the middle of black.
    Centre([usize; 2]),
    /// Puts this many rows of the bottom, upside down, under the frame and squeezes both to its height.
    Reflect(usize),
    /// Moves the frame over black; the matrix says where a pixel goes.
    Warp([f32; 6]),
    /// Multiplies and adds.
    Hsv { saturation: Change, value: Change },
    /// Blends with grey.
    Grey(f32),
    /// Equalises the value of hue, saturation and value in 8 x 8 tiles.
    Equalise(f64),
    /// Darkens the frame and marks its edges in red.
    Edges { low: f64, high: f64, weight: f32 },
}

/// A Gaussian kernel.
#[derive(Clone, Copy, Deserialize)]
pub struct Gaussian {
    pub size: usize,
    pub sigma: f64,
}

/// What lies beyond the edge of a frame.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Edge {
    /// The frame, mirrored at the middle of its last pixel.
    Mirrored,
    /// The last pixel.
    Nearest,
}

/// A factor and what is added then, of full scale.
#[derive(Clone, Copy, Deserialize)]
pub struct Change {
    pub factor: f32,
    pub added: f32,
}
