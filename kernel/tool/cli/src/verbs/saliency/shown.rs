//! A frame that maps are made of.

use pdk_sdk::prelude::FrameBuf;

/// A frame that maps are made of.
pub struct Shown {
    /// Its name, which is fit for a file's.
    pub name: String,
    pub frame: FrameBuf,
    /// How fast the vehicle was, in metres per second, if that is known.
    pub speed: Option<f64>,
    /// The number of the road on which it was recorded, if that is known.
    pub road: Option<usize>,
}

impl Shown {
    /// A frame of which nothing but the image is known.
    pub fn image(name: String, frame: FrameBuf) -> Self {
        Self { name, frame, speed: None, road: None }
    }
}
