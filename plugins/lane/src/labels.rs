//! What the pixels of a frame show and how far away it is, for those who perturb the road alone, the vehicles, or what is far.

use pdk_sdk::prelude::FrameMut;

use crate::sprite::{Placement, Sprite};

/// Something that can be told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Label {
    /// The sky, with the hills at the horizon.
    Sky,
    /// Grass and gravel.
    Ground,
    /// Asphalt.
    Road,
    /// Lines on the road.
    Marking,
    /// Other vehicles.
    Vehicle,
    /// Trees.
    Vegetation,
    /// Houses.
    Building,
    /// Posts beside the road.
    Post,
    /// Signs, with what they stand on.
    Sign,
}

impl Label {
    /// The names, in the order of the numbers.
    pub const NAMES: [&str; 9] =
        ["sky", "ground", "road", "marking", "vehicle", "vegetation", "building", "post", "traffic_sign"];

    /// Its number.
    pub fn number(self) -> u8 {
        self as u8
    }
}

/// What pictures of upright things are drawn into: a frame, or the labels or distances of one.
pub trait Canvas {
    /// Draws a picture of something, or of a shadow, which is nothing of its own.
    fn paint(&mut self, picture: &Sprite, at: Placement, label: Option<Label>);
}

impl Canvas for FrameMut<'_> {
    #[inline(always)]
    fn paint(&mut self, picture: &Sprite, at: Placement, _: Option<Label>) {
        picture.draw(self, at);
    }
}

/// The labels of a frame, row by row.
pub struct Labels<'a> {
    /// One for each pixel.
    pub pixels: &'a mut [u8],
    /// Pixels in a row.
    pub width: usize,
}

impl Canvas for Labels<'_> {
    /// A pixel shows what covers it by half or more; what comes last is in front.
    fn paint(&mut self, picture: &Sprite, at: Placement, label: Option<Label>) {
        let Some(label) = label else { return };
        let (width, height) = (self.width, self.pixels.len() / self.width);
        picture.covered(width, height, &at, |x, y, cover| {
            if cover >= 0.5 {
                self.pixels[y * width + x] = label.number();
            }
        });
    }
}

/// The distances of a frame along the optical axis in metres, row by row.
pub struct Distances<'a> {
    /// One for each pixel.
    pub pixels: &'a mut [f32],
    /// Pixels in a row.
    pub width: usize,
}

impl Canvas for Distances<'_> {
    /// As for labels: a shadow lies on the ground and leaves its distance as it is.
    fn paint(&mut self, picture: &Sprite, at: Placement, label: Option<Label>) {
        if label.is_none() {
            return;
        }
        let (width, height) = (self.width, self.pixels.len() / self.width);
        picture.covered(width, height, &at, |x, y, cover| {
            if cover >= 0.5 {
                self.pixels[y * width + x] = at.depth;
            }
        });
    }
}
