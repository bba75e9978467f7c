//! Where the filters take rows from, and where they put them.

use super::{Image, drop_fractions, widen};
use crate::frame::{CHANNELS, Frame, FrameMut};

/// What a filter reads and writes, row by row. A row is read before it is written.
pub(super) trait Rows {
    /// Width, height and channels.
    fn size(&self) -> [usize; 3];
    fn read(&self, y: usize, to: &mut [f32]);
    fn write(&mut self, y: usize, from: &[f32]);
}

impl Rows for &mut Image {
    fn size(&self) -> [usize; 3] {
        [self.width, self.height, self.channels]
    }

    fn read(&self, y: usize, to: &mut [f32]) {
        to.copy_from_slice(self.row(y));
    }

    fn write(&mut self, y: usize, from: &[f32]) {
        self.row_mut(y).copy_from_slice(from);
    }
}

/// From one image to another of the same size.
pub(super) struct Images<'a> {
    pub(super) from: &'a Image,
    pub(super) into: &'a mut Image,
}

impl Rows for Images<'_> {
    fn size(&self) -> [usize; 3] {
        [self.from.width, self.from.height, self.from.channels]
    }

    fn read(&self, y: usize, to: &mut [f32]) {
        to.copy_from_slice(self.from.row(y));
    }

    fn write(&mut self, y: usize, from: &[f32]) {
        self.into.row_mut(y).copy_from_slice(from);
    }
}

/// From one frame to another, with values from 0 to 255; clipped to them at the end, the fraction dropped.
pub(super) struct Frames<'a> {
    pub(super) src: Frame<'a>,
    pub(super) dst: FrameMut<'a>,
}

impl Rows for Frames<'_> {
    fn size(&self) -> [usize; 3] {
        [self.src.width(), self.src.height(), CHANNELS]
    }

    fn read(&self, y: usize, to: &mut [f32]) {
        widen(self.src.row(y), to);
    }

    fn write(&mut self, y: usize, from: &[f32]) {
        drop_fractions(from, self.dst.row_mut(y));
    }
}
